//! The variables of an FMU. The reference of a variable is its place in the arrays of the C code.

use super::units;
use crate::twin::ExportedTwin;
use servotwin::shown::Shown;
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_model::program::{Program, Slot};
use servotwin_model::spec::Unit;
use std::collections::BTreeMap;

/// `SERVOTWIN_FMU_PARAMETER` and `SERVOTWIN_FMU_FAULT` of the C code.
const FIRST_PARAMETER: usize = 100_000;
const FIRST_FAULT: usize = 200_000;

/// `SERVOTWIN_FMU_NOISE`, `SERVOTWIN_FMU_SEED` and `SERVOTWIN_FMU_LARGEST_SEED`.
const NOISE: usize = 300_001;
const SEED: usize = 300_002;
const LARGEST_SEED: f64 = 4_294_967_295.0;

/// `SERVOTWIN_FMU_MEASURED` and its kin for a hybrid twin.
const FIRST_MEASURED: usize = 10_000;
const FIRST_SWITCH: usize = 20_000;
const RESET_ALARM: usize = 29_999;
const FIRST_EXPECTED: usize = 30_000;
const FIRST_RESULT: usize = 40_000;

/// What a variable is to the importing tool.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum VariableKind {
    Input,
    Output,
    /// An output that changes with samples only.
    Sampled,
    Local,
    /// A parameter that may change during a simulation.
    Tunable,
}

/// A variable of an FMU, in SI units.
#[derive(Clone, Debug)]
pub(super) struct Variable {
    pub(crate) name: String,
    pub(crate) reference: usize,
    pub(crate) kind: VariableKind,
    pub(crate) unit: Unit,
    /// The unit that people read, where it is another one.
    pub(crate) display: Option<&'static str>,
    pub(crate) description: String,
    pub(crate) start: Option<f64>,
    /// The least and the largest value, as far as there are limits.
    pub(crate) range: [Option<f64>; 2],
    pub(crate) nominal: Option<f64>,
    /// The place of the state whose derivative it is.
    pub(crate) derivative_of: Option<usize>,
}

/// All variables, and which of them are states and their derivatives.
pub(super) struct Variables {
    pub(crate) all: Vec<Variable>,
    /// For each slot of the program, the place of its variable.
    of_slots: BTreeMap<usize, usize>,
    states: usize,
    first_derivative: usize,
}

impl Variables {
    /// Of a system: inputs, outputs (what the sensors measure), states, all other observables, derivatives, parameters,
    /// faults.
    pub(crate) fn of_system(twin: &ExportedTwin) -> Self {
        let program = twin.program;
        let mut variables = Variables {
            all: Vec::new(),
            of_slots: BTreeMap::new(),
            states: program.states().len(),
            first_derivative: program.derivatives().start,
        };
        variables.add_inputs(program, true);
        for slot in twin.sensors.iter().map(|&slot| slot as usize) {
            if let Some(measured) = program.observables().iter().find(|o| o.slot as usize == slot) {
                variables.add_slot(slot, &measured.name, measured.unit, VariableKind::Output);
                let output = &mut variables.all[variables.of_slots[&slot]];
                output.description = summary(program, &measured.name)
                    + ", with noise and the steps of its converter unless sensors.noise is 0";
            }
        }
        for (slot, state) in program.states().iter().enumerate() {
            // Some states have the name of what is read from them, such as a pressure above vapor pressure.
            let is_taken =
                program.observable(&state.name).is_some_and(|read| read.slot as usize != slot);
            let name = if is_taken { format!("state.{}", state.name) } else { state.name.clone() };
            variables.add_slot(slot, &name, state.unit, VariableKind::Local);
            variables.describe(slot, || summary(program, &state.name));
        }
        for observable in program.observables() {
            let slot = observable.slot as usize;
            variables.add_slot(slot, &observable.name, observable.unit, VariableKind::Local);
            variables.describe(slot, || summary(program, &observable.name));
        }
        for (state, slot) in program.derivatives().enumerate() {
            let name = format!("der({})", program.states()[state].name);
            // The unit of a derivative is that of the state over a second, which has no name of its own.
            variables.add_slot(slot, &name, Unit::None, VariableKind::Local);
            let rate = || {
                format!("rate of {}, in its SI unit over a second", program.states()[state].name)
            };
            variables.describe(slot, rate);
            variables.all[variables.of_slots[&slot]].derivative_of = Some(state);
        }
        for (state, declared) in program.states().iter().enumerate() {
            variables.all[variables.of_slots[&state]].nominal = Some(declared.scale);
        }
        variables.add_parameters(program);
        variables.add_faults(program);
        variables.add_noise();
        variables
    }

    /// Of a hybrid twin: inputs, measured values, switches of the actuators, expected values, the diagnosis, parameters.
    pub(crate) fn of_hybrid(diagnoser: &Diagnoser, twin: &ExportedTwin) -> Self {
        let mut variables = Variables {
            all: Vec::new(),
            of_slots: BTreeMap::new(),
            states: 0,
            first_derivative: 0,
        };
        variables.add_inputs(twin.program, false);
        variables.add_sensors(diagnoser, twin);
        let off = "1: the flight control computer has switched it off";
        let names = diagnoser.names().actuators.iter().enumerate();
        let switches =
            names.map(|(place, name)| (FIRST_SWITCH + place, format!("switched_off.{name}"), off));
        let reset = "a change from 0 to 1 withdraws all raised actions, with shutdowns that stand";
        for (reference, name, description) in
            switches.chain([(RESET_ALARM, "reset_alarm".into(), reset)])
        {
            let switch = variables.add(name, reference, VariableKind::Input, Unit::None);
            switch.description = description.into();
            switch.start = Some(0.0);
            switch.range = [Some(0.0), Some(1.0)];
        }
        variables.add_results(diagnoser);
        variables.add_parameters(twin.program);
        variables
    }

    /// The places of the states and of their derivatives, in the order of the states.
    pub(crate) fn states(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.states).map(|slot| self.of_slots[&slot])
    }

    pub(crate) fn derivatives(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.states).map(|state| self.of_slots[&(self.first_derivative + state)])
    }

    /// The places of the outputs.
    pub(crate) fn outputs(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.all.len()).filter(|&place| {
            matches!(self.all[place].kind, VariableKind::Output | VariableKind::Sampled)
        })
    }

    /// Everything that the initialization computes, in order: outputs, states, derivatives.
    pub(crate) fn initial_unknowns(&self) -> Vec<usize> {
        let mut all: Vec<usize> =
            self.outputs().chain(self.states()).chain(self.derivatives()).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// The place of a slot's variable.
    pub(crate) fn of_slot(&self, slot: usize) -> Option<usize> {
        self.of_slots.get(&slot).copied()
    }

    fn add(
        &mut self,
        name: String,
        reference: usize,
        kind: VariableKind,
        unit: Unit,
    ) -> &mut Variable {
        let (description, range) = (String::new(), [None; 2]);
        self.all.push(Variable {
            name,
            reference,
            kind,
            unit,
            display: units::display(unit, 0.0),
            description,
            range,
            start: None,
            nominal: None,
            derivative_of: None,
        });
        let last = self.all.len() - 1;
        &mut self.all[last]
    }

    /// Adds a variable for a slot, unless it has one.
    fn add_slot(&mut self, slot: usize, name: &str, unit: Unit, kind: VariableKind) {
        if !self.of_slots.contains_key(&slot) {
            self.of_slots.insert(slot, self.all.len());
            self.add(name.into(), slot, kind, unit);
        }
    }

    /// Describes the variable of a slot that has no description yet.
    fn describe(&mut self, slot: usize, text: impl Fn() -> String) {
        let description = &mut self.all[self.of_slots[&slot]].description;
        if description.is_empty() {
            *description = text();
        }
    }

    /// Adds the inputs. A diagnosis judges those that it receives itself, so only a system refuses values out of range.
    fn add_inputs(&mut self, program: &Program, is_checked: bool) {
        let network = program.network();
        for ((place, input), slot) in network.inputs.iter().enumerate().zip(program.externals()) {
            self.of_slots.insert(slot, self.all.len());
            let (least, largest) = network.input_range(place);
            let shown = Shown::of_input(network, place).symbol();
            let port = input
                .targets
                .first()
                .map(|to| network.components[to.component].component.ports[to.port].summary);
            let variable = self.add(input.id.clone(), slot, VariableKind::Input, input.unit);
            variable.description = format!("{}; held during a step", port.unwrap_or("input"));
            variable.start = Some(input.default);
            variable.display = Some(shown).filter(|shown| *shown != input.unit.symbol());
            if is_checked {
                variable.range = [least, largest].map(finite);
            }
        }
    }

    /// Whether the outputs of a system are what real sensors show.
    fn add_noise(&mut self) {
        let texts = [
            (
                "sensors.noise",
                NOISE,
                "1: the outputs have the noise of the sensors and the steps of their converters; 0: neither",
            ),
            ("sensors.noise_seed", SEED, "a whole number; other noise with the same statistics"),
        ];
        for (place, (name, reference, description)) in texts.into_iter().enumerate() {
            let added = self.add(name.into(), reference, VariableKind::Tunable, Unit::None);
            added.description = description.into();
            added.start = Some([1.0, 0.0][place]);
            added.range = [Some(0.0), Some([1.0, LARGEST_SEED][place])];
        }
    }

    /// What the sensors measure, as an input, and what the twin expects of them.
    fn add_sensors(&mut self, diagnoser: &Diagnoser, twin: &ExportedTwin) {
        let unit_of = |slot: Slot| {
            let mut observables = twin.program.observables().iter();
            observables.find(|o| o.slot == slot).map_or(Unit::None, |o| o.unit)
        };
        for (place, (sensor, &slot)) in diagnoser.sensors.iter().zip(&twin.sensors).enumerate() {
            let (name, unit) = (&sensor.name, unit_of(slot));
            let reference = FIRST_MEASURED + place;
            let measured =
                self.add(format!("measured.{name}"), reference, VariableKind::Input, unit);
            measured.start = Some(0.0);
            measured.description = "what the sensor measures; NaN is a missing value".into();
            let (name, reference) = (format!("expected.{name}"), FIRST_EXPECTED + place);
            self.add(name, reference, VariableKind::Sampled, unit).description =
                "what the twin expects of the sensor".into();
        }
    }

    /// The outcome of the diagnosis, in the order of the C code.
    fn add_results(&mut self, diagnoser: &Diagnoser) {
        let names = diagnoser.names();
        let list = |names: &[String]| {
            let numbered = names.iter().zip(1..).map(|(name, number)| format!(", {number} {name}"));
            format!("0 none{}", numbered.collect::<String>())
        };
        let sensors: Vec<String> = diagnoser.sensors.iter().map(|s| s.name.clone()).collect();
        let [actuators, actions, details, sensors] =
            [&names.actuators, &names.actions, &names.details, &sensors].map(|names| list(names));
        let findings = "0 not judged, 1 no fault, 2 detected, 3 actuator, 4 action, 5 detail, 6 unknown, 7 input invalid";
        let alarms = "0 normal, 1 pending, 2 raised, 3 recovering, 4 no data, 5 error";
        let results = [
            ("is_simulated", "1: the twin can be simulated for the inputs"),
            ("finding", findings),
            ("actuator", &actuators),
            ("action", &actions),
            ("detail", &details),
            ("confidence", "probability of the finding"),
            ("alarm", alarms),
            ("raised_actuator", &actuators),
            ("raised_action", &actions),
            ("raised_detail", &details),
            ("largest_residual", "in parts of its band"),
            ("sensor_of_largest_residual", &sensors),
            ("lost_sensors", "how many sensors are lost"),
        ];
        for (place, (name, description)) in results.into_iter().enumerate() {
            let name = format!("diagnosis.{name}");
            let result = self.add(name, FIRST_RESULT + place, VariableKind::Sampled, Unit::None);
            result.description = description.into();
        }
    }

    fn add_parameters(&mut self, program: &Program) {
        let mut reference = FIRST_PARAMETER;
        for instance in &program.network().components {
            let declared = instance.component.parameters.iter();
            for (parameter, &value) in declared.zip(&instance.parameters) {
                let name = format!("parameter.{}.{}", instance.id, parameter.name);
                let variable = self.add(name, reference, VariableKind::Tunable, parameter.unit);
                variable.description = parameter.summary.into();
                variable.start = Some(value);
                variable.display = units::display(parameter.unit, value);
                variable.range = [parameter.min, parameter.max].map(finite);
                reference += 1;
            }
        }
    }

    fn add_faults(&mut self, program: &Program) {
        for (number, (component, fault)) in program.faults().enumerate() {
            let instance = &program.network().components[component];
            let declared = &instance.component.faults[fault];
            let name = format!("fault.{}.{}", instance.id, declared.name);
            let variable = self.add(name, FIRST_FAULT + number, VariableKind::Tunable, Unit::None);
            variable.description = format!("intensity: {}", declared.summary);
            variable.start = Some(0.0);
            variable.range = [Some(0.0), Some(1.0)];
        }
    }
}

/// What the declaration of a port or a state says about an observable.
fn summary(program: &Program, observable: &str) -> String {
    let summary = program.network().components.iter().find_map(|instance| {
        let own = observable.strip_prefix(&instance.id)?.strip_prefix('.')?;
        let (spec, port) = (instance.component, own.split('.').next()?);
        let state = spec.states.iter().find(|state| state.name == own).map(|state| state.summary);
        state.or_else(|| spec.port(port).map(|port| spec.ports[port].summary))
    });
    summary.unwrap_or_default().to_owned()
}

fn finite(limit: f64) -> Option<f64> {
    limit.is_finite().then_some(limit)
}
