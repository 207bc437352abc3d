//! The aileron of `systems/aileron_dual.toml` as the tests drive it.

use servotwin::ensemble::{Ensemble, Variant};
use servotwin::system::System;
use servotwin_model::program::{FaultAt, Program, Slot};
use servotwin_model::signal::Piecewise;
use servotwin_model::solver::{SolverFailure, SolverSettings, Statistics};
use std::collections::BTreeMap;
use std::sync::OnceLock;

/// The embedded system, compiled once.
pub fn program() -> &'static Program {
    static SYSTEM: OnceLock<System> = OnceLock::new();
    &SYSTEM.get_or_init(System::default).program
}

/// A component by id.
pub fn component(id: &str) -> usize {
    let components = &program().network().components;
    components.iter().position(|c| c.id == id).unwrap_or_else(|| panic!("{id}"))
}

/// A parameter as `component.parameter`: the component and the parameter.
pub fn parameter(id: &str) -> (usize, usize) {
    let (owner, name) = id.rsplit_once('.').expect("component.parameter");
    let owner = component(owner);
    let spec = program().network().components[owner].component;
    (owner, spec.parameter(name).unwrap_or_else(|| panic!("{id}")))
}

/// A fault by id at an intensity.
pub fn fault(id: &str, intensity: f64) -> FaultAt {
    let (component, fault) = program().find_fault(id).unwrap_or_else(|| panic!("{id}"));
    FaultAt { component, fault, intensity }
}

/// A state by id.
pub fn state(id: &str) -> usize {
    program().states().iter().position(|s| s.name == id).unwrap_or_else(|| panic!("{id}"))
}

/// The place of something observable.
pub fn slot(id: &str) -> Slot {
    program().observable(id).unwrap_or_else(|| panic!("{id}")).slot
}

pub fn constant(value: f64) -> Piecewise {
    Piecewise::constant(value).unwrap()
}

/// From one value to another at a time.
pub fn step(at_s: f64, from: f64, to: f64) -> Piecewise {
    Piecewise::steps(&[0.0, at_s], &[from, to]).unwrap()
}

/// A run of the aileron: what differs from the healthy system at rest.
pub struct Test {
    inputs: Vec<Piecewise>,
    faults: Vec<FaultAt>,
    overrides: Vec<(usize, usize, f64)>,
    settings: SolverSettings,
    duration_s: f64,
    period_s: f64,
}

/// The samples of a run.
pub struct Samples {
    pub time_s: Vec<f64>,
    columns: BTreeMap<String, Vec<f64>>,
    pub statistics: Statistics,
}

impl Samples {
    pub fn of(&self, id: &str) -> &[f64] {
        self.columns.get(id).unwrap_or_else(|| panic!("{id} was not recorded"))
    }

    /// The integral over time of what `f` makes of each sample, by Simpson's
    /// rule.
    pub fn integral(&self, f: impl Fn(usize) -> f64) -> f64 {
        let h = self.time_s[1] - self.time_s[0];
        let intervals = self.time_s.len() - 1;
        assert!(intervals.is_multiple_of(2), "Simpson's rule takes pairs");
        let weight = |k: usize| match k {
            0 => 1.0,
            k if k == intervals => 1.0,
            k if k % 2 == 1 => 4.0,
            _ => 2.0,
        };
        (0..=intervals).map(|k| weight(k) * f(k)).sum::<f64>() * h / 3.0
    }
}

/// At rest with command zero and the full air load.
pub fn test() -> Test {
    let inputs = program().network().inputs.iter().map(|i| constant(i.default)).collect();
    Test {
        inputs,
        faults: Vec::new(),
        overrides: Vec::new(),
        settings: SolverSettings::of_runs(),
        duration_s: 1.0,
        period_s: 1e-3,
    }
}

impl Test {
    pub fn input(mut self, id: &str, signal: Piecewise) -> Self {
        let inputs = &program().network().inputs;
        let place = inputs.iter().position(|i| i.id == id).unwrap_or_else(|| panic!("{id}"));
        self.inputs[place] = signal;
        self
    }

    pub fn command(self, signal: Piecewise) -> Self {
        self.input("command", signal)
    }

    /// The command in degrees, for ever.
    pub fn hold_deg(self, angle_deg: f64) -> Self {
        self.command(constant(angle_deg.to_radians()))
    }

    pub fn load(self, factor: f64) -> Self {
        self.input("load_factor", constant(factor))
    }

    pub fn fault(mut self, id: &str, intensity: f64) -> Self {
        self.faults.push(fault(id, intensity));
        self
    }

    pub fn with(mut self, id: &str, value: f64) -> Self {
        let (component, parameter) = parameter(id);
        self.overrides.push((component, parameter, value));
        self
    }

    /// The same parameter of both actuators.
    pub fn with_both(self, id: &str, value: f64) -> Self {
        self.with(&format!("actuator_1.{id}"), value).with(&format!("actuator_2.{id}"), value)
    }

    pub fn settings(mut self, settings: SolverSettings) -> Self {
        self.settings = settings;
        self
    }

    pub fn lasting(mut self, duration_s: f64, period_s: f64) -> Self {
        (self.duration_s, self.period_s) = (duration_s, period_s);
        self
    }

    pub fn variant(&self) -> Variant<'_> {
        Variant {
            faults: self.faults.clone(),
            overrides: self.overrides.clone(),
            inputs: self.inputs.iter().collect(),
            ..Variant::default()
        }
    }

    pub fn parameters(&self) -> Vec<Vec<f64>> {
        program().parameters_with(&self.overrides, &self.faults)
    }

    pub fn ensemble(&self, record: &[&str]) -> Ensemble<'static> {
        let mut ensemble = Ensemble::new(program());
        ensemble.threads = 1;
        ensemble.settings = self.settings;
        ensemble.duration_s = self.duration_s;
        ensemble.sample_period_s = self.period_s;
        ensemble.record = record.iter().map(|id| slot(id)).collect();
        ensemble
    }

    pub fn try_run(&self, record: &[&str]) -> Result<Samples, SolverFailure> {
        let ensemble = self.ensemble(record);
        let (columns, statistics) = ensemble.run_one(&self.variant())?;
        let columns = record.iter().map(|id| id.to_string()).zip(columns).collect();
        let time_s = (0..ensemble.samples()).map(|k| k as f64 * self.period_s).collect();
        Ok(Samples { time_s, columns, statistics })
    }

    pub fn run(&self, record: &[&str]) -> Samples {
        self.try_run(record).unwrap_or_else(|failure| panic!("{failure:?}"))
    }

    /// The states at rest.
    pub fn settled(&self) -> Vec<f64> {
        let settled = self.ensemble(&[]).settle(&self.variant());
        settled.unwrap_or_else(|failure| panic!("{failure:?}")).0
    }

    /// All variables of the system at rest: states, inputs, sums.
    pub fn at_rest(&self) -> Rest {
        let program = program();
        let parameters = self.parameters();
        let mut variables = self.settled();
        variables.extend(self.inputs.iter().map(|input| input.value(0.0)));
        variables.extend(program.stand_in_values(&parameters));
        variables.resize(program.memory(), 0.0);
        let constants = program.block_constants(&parameters);
        program.evaluate(&constants, &mut variables);
        Rest { variables, constants }
    }
}

/// The system in one state.
pub struct Rest {
    variables: Vec<f64>,
    constants: Vec<f64>,
}

impl Rest {
    pub fn of(&self, id: &str) -> f64 {
        self.variables[slot(id) as usize]
    }

    /// The Jacobian of the states.
    pub fn jacobian(&self) -> Vec<Vec<f64>> {
        let program = program();
        let mut variables = self.variables.clone();
        let mut gradients = vec![0.0; program.jacobian().slots()];
        program.evaluate_with_jacobian(&self.constants, &mut variables, &mut gradients);
        servotwin_model::jacobian::dense(program.jacobian(), &gradients, 0)
    }
}
