//! The virtual twin that an export takes along.

use servotwin::live::runtime::{RuntimeError, between, place_of, slots};
use servotwin::study::{Reaction, Study};
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_model::program::{Program, Slot};
use servotwin_model::solver::{Between, Control, SolverSettings};

/// A virtual twin to be exported.
#[derive(Clone)]
pub struct ExportedTwin<'p> {
    /// Its system.
    pub program: &'p Program,
    /// Method and control of its steps.
    pub settings: SolverSettings,
    /// The time between samples, s.
    pub period_s: f64,
    /// The course of each external input between samples.
    pub between: Vec<Between>,
    /// The least and the largest plausible value of each external input, SI.
    pub ranges: Vec<[f64; 2]>,
    /// The variables that the diagnosis compares with its sensors, in their order.
    pub sensors: Vec<Slot>,
    /// The least and the largest possible value of each external input, and then of each of these sensors, SI. Values
    /// beyond them count as missing.
    pub possible: Vec<(f64, f64)>,
    /// What the flight control computer does after an action. None of them belongs to a diagnosis of another system.
    pub reactions: Vec<ExportedReaction>,
}

/// A reaction of a study to an action.
#[derive(Clone, Debug, PartialEq)]
pub struct ExportedReaction {
    /// The actuator.
    pub actuator: usize,
    /// The action.
    pub action: usize,
    /// The detail, if the reaction is for one alone.
    pub detail: Option<usize>,
    /// The reaction. It takes out sensors of the diagnoser.
    pub reaction: Reaction,
}

impl ExportedReaction {
    /// All reactions of a study to what a diagnoser raises.
    pub(crate) fn all(study: &Study, diagnoser: &Diagnoser) -> Vec<ExportedReaction> {
        let names = diagnoser.names();
        let sensor = |&place: &usize| place_of(place, study, diagnoser);
        let mut all = Vec::new();
        for actuator in 0..names.actuators.len() {
            for (action, command) in names.actions.iter().enumerate() {
                let general = study.reactions.of(actuator, command, None);
                let mut add = |detail, reaction: &Reaction| {
                    let takes_out = reaction.takes_out.iter().filter_map(sensor).collect();
                    let reaction = Reaction { takes_out, ..reaction.clone() };
                    all.push(ExportedReaction { actuator, action, detail, reaction });
                };
                for (detail, name) in names.details.iter().enumerate() {
                    let special = study.reactions.of(actuator, command, Some(name));
                    if special != general {
                        add(Some(detail), &special);
                    }
                }
                if general != Reaction::default() {
                    add(None, &general);
                }
            }
        }
        all
    }

    /// Whether the inputs show that it is carried out: it switches off, by inputs.
    pub(crate) fn is_seen(&self) -> bool {
        self.detail.is_none() && self.reaction.switches_off && !self.reaction.inputs.is_empty()
    }
}

impl<'s> ExportedTwin<'s> {
    /// The twin of a study that runs beside a diagnoser, with steps of 1 ms or under error control.
    ///
    /// # Errors
    /// The diagnoser is for another study.
    pub fn beside(
        study: &'s Study,
        diagnoser: &Diagnoser,
        has_fixed_step: bool,
    ) -> Result<Self, RuntimeError> {
        let sensors = diagnoser.sensors.iter().map(|sensor| sensor.name.as_str());
        let ranges = diagnoser.environment.inputs.iter().map(|input| [input.least, input.largest]);
        let alone = Self::of(study, diagnoser.period_s, ranges.collect(), sensors)?;
        let settings = if has_fixed_step { SolverSettings::real_time() } else { alone.settings };
        let reactions = ExportedReaction::all(study, diagnoser);
        Ok(ExportedTwin { settings, reactions, ..alone })
    }

    /// The twin of a study with all its sensors, for other programs.
    ///
    /// # Errors
    /// A sensor's signal is not in the system.
    pub fn alone(study: &'s Study) -> Result<Self, RuntimeError> {
        let network = study.system.network();
        let sensors = study.system.sensors.iter().map(|sensor| sensor.id.as_str());
        let ranges = (0..network.inputs.len()).map(|input| network.input_range(input).into());
        Self::of(study, study.sample_period_s, ranges.collect(), sensors)
    }

    /// A twin of a study with these sensors, by id.
    fn of<'n>(
        study: &'s Study,
        period_s: f64,
        ranges: Vec<[f64; 2]>,
        sensors: impl Iterator<Item = &'n str> + Clone,
    ) -> Result<Self, RuntimeError> {
        let system = &study.system;
        let place = |id: &str| system.sensors.iter().position(|sensor| sensor.id == id);
        let inputs = (0..system.network().inputs.len()).map(|input| system.accepted_range(input));
        let readable = sensors.clone().filter_map(place).map(|place| system.readable(place));
        Ok(ExportedTwin {
            program: &system.program,
            settings: SolverSettings::of_runs(),
            period_s,
            between: between(study),
            ranges,
            sensors: slots(study, sensors)?,
            possible: inputs.chain(readable).collect(),
            reactions: vec![],
        })
    }

    /// The index of a component's first parameter among those of all components.
    pub(crate) fn first_parameter(&self, component: usize) -> usize {
        let before = &self.program.network().components[..component];
        before.iter().map(|instance| instance.parameters.len()).sum()
    }

    /// Whether every step has the same length.
    pub(crate) fn has_fixed_step(&self) -> bool {
        matches!(self.settings.control, Control::Fixed { .. })
    }
}
