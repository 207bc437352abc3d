//! The variables of an FMU. The reference of a variable is its place in the arrays of the C code.

use crate::twin::ExportedTwin;
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_model::program::{Program, Slot};
use servotwin_model::spec::Unit;
use std::collections::BTreeMap;

/// `SERVOTWIN_FMU_PARAMETER` and `SERVOTWIN_FMU_FAULT` of the C code.
const FIRST_PARAMETER: usize = 100_000;
const FIRST_FAULT: usize = 200_000;

/// `SERVOTWIN_FMU_MEASURED` and its kin for a hybrid twin.
const FIRST_MEASURED: usize = 10_000;
const FIRST_SWITCH: usize = 20_000;
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
    pub name: String,
    pub reference: usize,
    pub kind: VariableKind,
    pub unit: Unit,
    pub description: String,
    pub start: Option<f64>,
    /// The least and the largest value, as far as there are limits.
    pub range: [Option<f64>; 2],
    pub nominal: Option<f64>,
    /// The place of the state whose derivative it is.
    pub derivative_of: Option<usize>,
}

/// All variables, and which of them are states and their derivatives.
pub(super) struct Variables {
    pub all: Vec<Variable>,
    /// For each slot of the program, the place of its variable.
    of_slots: BTreeMap<usize, usize>,
    states: usize,
    first_derivative: usize,
}

impl Variables {
    /// Of a system: inputs, outputs (what the sensors measure), states, all other observables, derivatives, parameters,
    /// faults.
    pub fn of_system(twin: &ExportedTwin) -> Self {
        let program = twin.program;
        let mut variables = Variables {
            all: Vec::new(),
            of_slots: BTreeMap::new(),
            states: program.states().len(),
            first_derivative: program.derivatives().start,
        };
        variables.add_inputs(program);
        for slot in twin.sensors.iter().map(|&slot| slot as usize) {
            if let Some(measured) = program.observables().iter().find(|o| o.slot as usize == slot) {
                variables.add_slot(slot, &measured.name, measured.unit, VariableKind::Output);
            }
        }
        for (slot, state) in program.states().iter().enumerate() {
            // Some states have the name of what is read from them, such as a pressure above vapor pressure.
            let is_taken =
                program.observable(&state.name).is_some_and(|read| read.slot as usize != slot);
            let name = if is_taken { format!("state.{}", state.name) } else { state.name.clone() };
            variables.add_slot(slot, &name, state.unit, VariableKind::Local);
        }
        for observable in program.observables() {
            let slot = observable.slot as usize;
            variables.add_slot(slot, &observable.name, observable.unit, VariableKind::Local);
        }
        for (state, slot) in program.derivatives().enumerate() {
            let name = format!("der({})", program.states()[state].name);
            // The unit of a derivative is that of the state over a second, which has no name of its own.
            variables.add_slot(slot, &name, Unit::None, VariableKind::Local);
            variables.all[variables.of_slots[&slot]].derivative_of = Some(state);
        }
        for (state, declared) in program.states().iter().enumerate() {
            variables.all[variables.of_slots[&state]].nominal = Some(declared.scale);
        }
        variables.add_parameters(program);
        variables.add_faults(program);
        variables
    }

    /// Of a hybrid twin: inputs, measured values, switches of the actuators, expected values, the diagnosis, parameters.
    pub fn of_hybrid(diagnoser: &Diagnoser, twin: &ExportedTwin) -> Self {
        let mut variables = Variables {
            all: Vec::new(),
            of_slots: BTreeMap::new(),
            states: 0,
            first_derivative: 0,
        };
        variables.add_inputs(twin.program);
        variables.add_sensors(diagnoser, twin);
        for (actuator, name) in diagnoser.names().actuators.iter().enumerate() {
            let reference = FIRST_SWITCH + actuator;
            let switch = variables.add(
                format!("switched_off.{name}"),
                reference,
                VariableKind::Input,
                Unit::None,
            );
            switch.description = "1: the flight control computer has switched it off".into();
            switch.start = Some(0.0);
            switch.range = [Some(0.0), Some(1.0)];
        }
        variables.add_results(diagnoser);
        variables.add_parameters(twin.program);
        variables
    }

    /// The places of the states and of their derivatives, in the order of the states.
    pub fn states(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.states).map(|slot| self.of_slots[&slot])
    }

    pub fn derivatives(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.states).map(|state| self.of_slots[&(self.first_derivative + state)])
    }

    /// The places of the outputs.
    pub fn outputs(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.all.len()).filter(|&place| {
            matches!(self.all[place].kind, VariableKind::Output | VariableKind::Sampled)
        })
    }

    /// Everything that the initialization computes, in order: outputs, states, derivatives.
    pub fn initial_unknowns(&self) -> Vec<usize> {
        let mut all: Vec<usize> =
            self.outputs().chain(self.states()).chain(self.derivatives()).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// The place of a slot's variable.
    pub fn of_slot(&self, slot: usize) -> Option<usize> {
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

    fn add_inputs(&mut self, program: &Program) {
        let inputs = program.network().inputs.iter().enumerate();
        for ((place, input), slot) in inputs.zip(program.externals()) {
            self.of_slots.insert(slot, self.all.len());
            let (least, largest) = program.network().input_range(place);
            let variable = self.add(input.id.clone(), slot, VariableKind::Input, input.unit);
            variable.start = Some(input.default);
            variable.range = [least, largest].map(finite);
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
            self.add(format!("measured.{name}"), reference, VariableKind::Input, unit).start =
                Some(0.0);
            self.add(
                format!("expected.{name}"),
                FIRST_EXPECTED + place,
                VariableKind::Sampled,
                unit,
            );
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
            let declared = instance.component.spec().parameters.iter();
            for (parameter, &value) in declared.zip(&instance.parameters) {
                let name = format!("parameter.{}.{}", instance.id, parameter.name);
                let variable = self.add(name, reference, VariableKind::Tunable, parameter.unit);
                variable.description = parameter.summary.into();
                variable.start = Some(value);
                variable.range = [parameter.min, parameter.max].map(finite);
                reference += 1;
            }
        }
    }

    fn add_faults(&mut self, program: &Program) {
        for (number, (component, fault)) in program.faults().enumerate() {
            let instance = &program.network().components[component];
            let declared = &instance.component.spec().faults[fault];
            let name = format!("fault.{}.{}", instance.id, declared.name);
            let variable = self.add(name, FIRST_FAULT + number, VariableKind::Tunable, Unit::None);
            variable.description = format!("intensity: {}", declared.summary);
            variable.start = Some(0.0);
            variable.range = [Some(0.0), Some(1.0)];
        }
    }
}

fn finite(limit: f64) -> Option<f64> {
    limit.is_finite().then_some(limit)
}
