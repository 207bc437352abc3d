//! Flights in varying environments, for training and evaluating the diagnosis in operation.
//!
//! An *environment* is a command with values for everything else that varies. Faults and specimens are
//! flown in it beside one virtual twin. The twin knows the environment, because its boundary values are
//! measured, but not the specimen. How many flights there are, and for what, is said by suites ([`super::suites`]).

use super::faults::full_name;
use super::keys::{FLIGHT_S, some};
use super::other_plant::{self, DrawText, OtherPlant, PlantDraw};
use super::reader::{Noted, Reader};
use super::seed::{Seed, Stream};
use super::training::{check_pattern, count_ranges, filled_at, halton_in};
use crate::format::{At, Names, Value, section, usual};
use crate::signal::bus;
use crate::system::System;
use crate::toml_text::Diagnostic;
use servotwin_diagnosis::features::MAX_ACTUATORS;
use servotwin_model::signal::Piecewise;

pub(super) type Ranges = Names<At<[f64; 2]>>;

section! {
    /// The section of a study file.
    pub(super) struct Text {
        must pub(super) duration_s: f64 = FLIGHT_S, "length of a flight with a fault";
        must pub(super) onset_s: At<[f64; 2]>, "range of the onset of the fault, s";
        must pub(super) windows_s: Vec<At<f64>> = Value::List(1, &Value::Number(1e-3, 1e4, "s")),
            "lengths of the sliding windows";
        must pub(super) commands: Vec<At<String>> = some::<Vec<At<String>>>(),
            "signals with {a..b} and {n}; the environments use them in turn";
        with pub(super) drawn: DrawnRanges, "ranges from which each environment is drawn";
        may pub(super) phases: Vec<At<PhaseText>>,
            "parts of a flight with ranges of their own; the environments take turns";
        may pub(super) least_on: Option<At<u32>> = Value::Whole(0.0, MAX_ACTUATORS as f64),
            "minimum number of actuators that stay on; default 1, or 0 for a single actuator";
        may pub(super) draws: Vec<At<DrawText>>,
            "ranges from which each specimen with tolerances draws further parameters";
        may pub(super) other_plant: Option<other_plant::Text>,
            "plants that differ from their twin in structure, for the evaluation only";
        may pub(super) limits: Limits => usual(), "targets of the diagnosis";
    }
}

section! {
    /// Ranges from which each environment is drawn. Flights, suites and tests on the ground have these keys.
    #[derive(Default)]
    pub(super) struct DrawnRanges {
        may pub(super) inputs: Ranges, "ranges of inputs, drawn for each environment; those of a suite replace those of [flights]";
        may pub(super) actuator_inputs: Ranges, "ranges of inputs that every actuator has, likewise";
        may pub(super) actuator_parameters: Ranges, "ranges of parameters that every actuator has, likewise";
    }
}

section! {
    /// A part of a flight, such as cruise: inputs that belong together.
    pub(super) struct PhaseText {
        must inputs: Ranges = some::<Ranges>(), "ranges of inputs; the same inputs in every phase";
    }
}

section! {
    /// The targets of the diagnosis at work.
    #[derive(Copy, PartialEq)]
    pub struct Limits {
        may pub(crate) latency_s: f64 = Value::Number(0.0, 1e4, "s") => 1.0,
            "latency limit for 95 % of visible shutdown faults";
        may pub(crate) latency_unfitted_s: f64 = Value::Number(0.0, 1e4, "s") => 2.0,
            "the same limit for a twin that is not fitted";
        may pub false_alarms_per_h: f64 = Value::Number(0.0, 1e4, "1/h") => 1e-3,
            "limit on false alarms of healthy actuators";
        may pub wrong_shutdowns: f64 = Value::Number(0.0, 1e4, "") => 0.0,
            "limit on shutdowns of the wrong actuator";
    }
}

/// A command, with values for everything else that varies.
#[derive(Clone, Debug)]
pub struct Environment {
    /// The name: its suite and its number, such as `judge/007`; of an operating case its command and load, as `S2/100`.
    pub name: String,
    /// The command as text.
    pub command: String,
    /// One signal for each input of the system.
    pub inputs: Vec<Piecewise>,
    /// Parameters that the environment changes (temperatures): component, parameter, value.
    pub(crate) parameters: Vec<(usize, usize, f64)>,
}

impl Environment {
    /// The value of an input at the beginning, or of a parameter that the environment changes, SI.
    pub(crate) fn value_of(&self, system: &System, name: &str) -> Option<f64> {
        if let Ok(input) = system.find_input(name) {
            return Some(self.inputs[input].value(0.0));
        }
        let place = system.parameter(name)?;
        let mut parameters = self.parameters.iter();
        parameters.find(|own| (own.0, own.1) == place).map(|own| own.2)
    }
}

/// What all flights of a study have in common.
#[derive(Clone, Debug)]
pub struct Flights {
    /// Length of a flight with a fault, s.
    pub(crate) duration_s: f64,
    /// The range of a fault's onset, s.
    pub(crate) onset_s: [f64; 2],
    /// Lengths of the windows, s, ascending.
    pub windows_s: Vec<f64>,
    /// The targets of the diagnosis.
    pub limits: Limits,
    /// Plants that differ from their twin in structure.
    pub(crate) other_plant: Option<OtherPlant>,
    /// What each specimen with tolerances draws, besides its tolerances.
    pub(crate) draws: Vec<PlantDraw>,
    /// What each test on the ground draws, besides what its specimen is: the changes since the first test. Empty in
    /// flight.
    pub(crate) wear: Vec<PlantDraw>,
    /// The minimum number of actuators that stay on; `None` for the usual one.
    pub(super) least_on: Option<u32>,
    pub(super) varied: Varied,
}

/// What varies between environments: the commands, and ranges of inputs and parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentRanges {
    /// The patterns of the commands in each phase, each with the number of its ranges.
    pub(crate) commands: Vec<(String, usize)>,
    /// Inputs and parameters of the system with their ranges, SI.
    pub ranges: Vec<(String, [f64; 2])>,
    /// The range of a fault's onset, s.
    pub(crate) onset_s: [f64; 2],
    /// Length of a flight, s.
    pub duration_s: f64,
}

/// An environment by its place in [`EnvironmentRanges`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct ChosenEnvironment<'c> {
    /// The seed of the random part of the command.
    pub(crate) seed: Seed,
    /// The index among the commands in [`EnvironmentRanges`].
    pub(crate) pattern: usize,
    /// The place in each range of the pattern, from 0 to 1.
    pub(crate) command: &'c [f64],
    /// The place in each range of inputs and parameters, from 0 to 1.
    pub(crate) shares: &'c [f64],
}

impl Flights {
    /// Checks the section and draws one environment from each pattern. This reports wrong names and patterns before any
    /// flight.
    pub(super) fn new(text: &Text, reader: &Reader) -> Result<Self, Noted> {
        let varied = Varied {
            commands: text.commands.clone(),
            drawn: text.drawn.clone(),
            phases: text.phases.iter().map(|phase| phase.value.inputs.clone()).collect(),
        };
        let ranges = varied.check(reader);
        let other_plant = text.other_plant.as_ref().map(|text| OtherPlant::new(text, reader));
        let draws = other_plant::draws(reader, &text.draws, &[]);
        let wear = other_plant::draws(reader, reader.wear(), &[]);
        text.check(reader)?;
        ranges?;
        let other_plant = other_plant.transpose()?;
        varied.check_commands(reader, text.duration_s)?;
        let mut windows_s: Vec<f64> = text.windows_s.iter().map(|window| window.value).collect();
        windows_s.sort_by(f64::total_cmp);
        Ok(Flights {
            duration_s: text.duration_s,
            onset_s: text.onset_s.value,
            windows_s,
            limits: text.limits,
            other_plant,
            draws,
            wear,
            least_on: text.least_on.as_ref().map(|least| least.value),
            varied,
        })
    }
}

impl Text {
    fn check(&self, reader: &Reader) -> Result<(), Noted> {
        let d = self.duration_s;
        let At { value: [from, to], at } = &self.onset_s;
        let inside = *from >= 0.0 && *to < d;
        let allowed = "two times inside of the flight, in order";
        reader.range(("onset_s", at), *from, inside, allowed)?;
        let actuators = reader.text.actuators.len();
        if let Some(At { value: least, at }) = &self.least_on {
            let allowed = format!("0 … {actuators}, as there are actuators");
            let is_allowed = *least as usize <= actuators;
            reader.range(("least_on", at), f64::from(*least), is_allowed, allowed)?;
        }
        for At { value: phase, at } in &self.phases {
            let first = &self.phases[0].value.inputs;
            if !phase.inputs.keys().eq(first.keys()) {
                let names: Vec<&str> = first.keys().map(|name| name.value.as_str()).collect();
                let message =
                    format!("this phase has other inputs than the first one, {}", names.join(", "));
                return Err(reader.note(at, Diagnostic::new(message)));
            }
            if let Some((name, _)) =
                phase.inputs.iter().find(|(name, _)| self.drawn.inputs.contains_key(*name))
            {
                let message = format!("'{}' has a range for all phases, too", name.value);
                return Err(reader.note(&name.at, Diagnostic::new(message)));
            }
        }
        for At { value: window_s, at } in &self.windows_s {
            let fits = window_s * reader.text.sample_hz >= 10.0 && *window_s <= d - to;
            let allowed = "10 samples … what remains of a flight after the latest onset";
            reader.range(("windows_s", at), *window_s, fits, allowed)?;
        }
        Ok(())
    }
}

/// What varies between the environments of a suite.
#[derive(Clone, Debug, Default)]
pub(super) struct Varied {
    /// The patterns of the commands.
    pub(crate) commands: Vec<At<String>>,
    pub(super) drawn: DrawnRanges,
    /// Ranges of inputs that belong together, of which an environment has one.
    pub(crate) phases: Vec<Ranges>,
}

impl Varied {
    /// The same with the commands and ranges of a suite in place of those of the same name.
    pub(super) fn with(&self, commands: Option<&Vec<At<String>>>, given: &DrawnRanges) -> Self {
        let merged = |own: &Ranges, given: &Ranges| {
            let mut merged = given.clone();
            own.iter().for_each(|(name, range)| {
                merged.entry(name.clone()).or_insert_with(|| range.clone());
            });
            merged
        };
        let mut phases = self.phases.clone();
        phases.iter_mut().for_each(|own| own.retain(|name, _| !given.inputs.contains_key(name)));
        phases.retain(|own| !own.is_empty());
        let own = &self.drawn;
        let drawn = DrawnRanges {
            inputs: merged(&own.inputs, &given.inputs),
            actuator_inputs: merged(&own.actuator_inputs, &given.actuator_inputs),
            actuator_parameters: merged(&own.actuator_parameters, &given.actuator_parameters),
        };
        Varied { commands: commands.unwrap_or(&self.commands).clone(), drawn, phases }
    }

    /// The environment of the first command, in the middle of its ranges and of those of inputs that all actuators
    /// share. Everything else has its default.
    pub(super) fn shared_middle(
        &self,
        reader: &Reader,
        duration_s: f64,
    ) -> Result<Environment, Noted> {
        let Varied { commands, drawn: DrawnRanges { inputs, .. }, phases } = self.clone();
        let shared = DrawnRanges { inputs, ..DrawnRanges::default() };
        let shared = Varied { commands, drawn: shared, phases };
        shared.middle(reader, 0, duration_s)
    }

    /// The environment in the middle of the ranges of a command and of the phases.
    fn middle(
        &self,
        reader: &Reader,
        pattern: usize,
        duration_s: f64,
    ) -> Result<Environment, Noted> {
        let command = &vec![0.5; count_ranges(&self.commands[pattern])];
        let seed = Seed::of(0, "", pattern as u64);
        let pattern = pattern + self.commands.len() * (self.phases.len() / 2);
        let chosen = ChosenEnvironment { seed, pattern, command, shares: &[] };
        self.environment(reader, &chosen, String::new(), duration_s)
    }

    /// Checks every command at the ends of its ranges.
    pub(super) fn check_commands(&self, reader: &Reader, longest_s: f64) -> Result<(), Noted> {
        let driven = reader.command_input()?;
        for pattern in &self.commands {
            let _ = check_pattern(reader, pattern, driven, longest_s);
        }
        let one_each =
            (0..self.commands.len()).map(|pattern| self.middle(reader, pattern, longest_s));
        let all = reader.sound(one_each);
        if all.len() == self.commands.len() { Ok(()) } else { Err(Noted) }
    }

    /// Checks that both ends of every range are possible.
    pub(super) fn check(&self, reader: &Reader) -> Result<(), Noted> {
        let actuators = || reader.text.actuators.iter();
        let own = self.drawn.inputs.iter().chain(self.phases.iter().flatten());
        let own = own.map(|range| (String::new(), range));
        let of_actuators = self.drawn.actuator_inputs.iter();
        let of_actuators = of_actuators
            .flat_map(|range| actuators().map(move |actuator| (actuator.value.clone(), range)));
        for (actuator, (name, range)) in own.chain(of_actuators) {
            let input = reader.input(&name.at, &full_name(&actuator, name))?;
            for value in range.value {
                reader.constant((name, &range.at), input, value)?;
            }
        }
        for (name, range) in &self.drawn.actuator_parameters {
            for actuator in actuators() {
                let found = super::realism::find(reader, actuator, name)?;
                for value in range.value {
                    reader.parameter((name, &range.at), found, value)?;
                }
            }
        }
        Ok(())
    }

    /// What varies, with the names of the system.
    pub(super) fn ranges(
        &self,
        actuators: &[String],
        onset_s: [f64; 2],
        duration_s: f64,
    ) -> EnvironmentRanges {
        let of_actuators = |ranges: &Ranges| -> Vec<(String, [f64; 2])> {
            let names = ranges.iter().flat_map(|(name, range)| {
                actuators.iter().map(move |actuator| (full_name(actuator, name), range.value))
            });
            names.collect()
        };
        let shared =
            self.drawn.inputs.iter().map(|(name, range)| (name.value.clone(), range.value));
        let shared = shared.collect();
        let all_phases = |(name, range): (&At<String>, &At<[f64; 2]>)| {
            let own = self.phases.iter().filter_map(|phase| phase.get(name));
            let [low, high] = own.fold(range.value, |[low, high], own| {
                [low.min(own.value[0]), high.max(own.value[1])]
            });
            (name.value.clone(), [low, high])
        };
        let of_phases = self.phases.iter().take(1).flatten().map(all_phases).collect();
        let command = |phase: usize, command: &At<String>| {
            let name = match self.phases.is_empty() {
                true => command.value.clone(),
                false => format!("{} (phase {})", command.value, phase + 1),
            };
            (name, count_ranges(command))
        };
        let of_phase = |phase: usize| self.commands.iter().map(move |own| command(phase, own));
        EnvironmentRanges {
            commands: (0..self.phases.len().max(1)).flat_map(of_phase).collect(),
            ranges: [
                shared,
                of_actuators(&self.drawn.actuator_inputs),
                of_actuators(&self.drawn.actuator_parameters),
                of_phases,
            ]
            .concat(),
            onset_s,
            duration_s,
        }
    }

    /// The environment with a number. Its command is filled by points of Halton's sequence, shifted by `all`, the seed of
    /// all environments; everything else of it comes from its own seed.
    pub(super) fn drawn(
        &self,
        reader: &Reader,
        (name, number, longest_s): (String, usize, f64),
        (all, seed): (Seed, Seed),
    ) -> Result<Environment, Noted> {
        let patterns = self.commands.len();
        let pattern = number % patterns;
        let mut shifts = all.stream(Stream::Command);
        let mut shift = || shifts.unit();
        // Each pattern has shifts of its own.
        (0..pattern).for_each(|before| {
            for _ in 0..count_ranges(&self.commands[before]) {
                shift();
            }
        });
        let draw = number / patterns + 1;
        let command: Vec<f64> = (0..count_ranges(&self.commands[pattern]))
            .map(|place| (halton_in(draw as u64, place) + shift()) % 1.0)
            .collect();
        let mut random = seed.stream(Stream::Ranges);
        let count = |ranges: &Ranges| ranges.len() * reader.text.actuators.len();
        let of_phase = self.phases.first().map_or(0, |phase| phase.len());
        let shared = self.drawn.inputs.len() + of_phase;
        let ranges =
            shared + count(&self.drawn.actuator_inputs) + count(&self.drawn.actuator_parameters);
        let shares: Vec<f64> = (0..ranges).map(|_| random.unit()).collect();
        let phase = (number / patterns) % self.phases.len().max(1);
        let pattern = pattern + patterns * phase;
        let chosen = ChosenEnvironment { seed, pattern, command: &command, shares: &shares };
        self.environment(reader, &chosen, name, longest_s)
    }

    /// An environment from the places in all ranges; those that `shares` lacks are in the middle.
    pub(super) fn environment(
        &self,
        reader: &Reader,
        chosen: &ChosenEnvironment,
        name: String,
        longest_s: f64,
    ) -> Result<Environment, Noted> {
        let &ChosenEnvironment { seed, pattern: position, command, shares } = chosen;
        let pattern = &self.commands[position % self.commands.len()];
        let phase = self.phases.get(position / self.commands.len());
        let number = seed.choices(Stream::Noise).next_u64() % COMMANDS;
        let command = filled_at(pattern, number as usize, |place| command[place]);
        let mut inputs = reader.default_inputs();
        let driven = reader.command_input()?;
        // The twin reads the command as sent over the bus; no other part has more information.
        let signal = command.parse();
        let built = reader.signal((pattern, &pattern.at), signal, driven, longest_s)?;
        let period_s = 1.0 / reader.text.sample_hz;
        let sent = bus::sent(|time_s| built.value(time_s), period_s, longest_s);
        inputs[driven] = sent.expect("a signal is finite");
        let constant = |value: f64| Piecewise::constant(value).expect("a finite value");
        let mut shares = shares.iter().copied();
        let mut draw = |[low, high]: [f64; 2]| low + (high - low) * shares.next().unwrap_or(0.5);
        for (input, range) in &self.drawn.inputs {
            inputs[reader.input(&input.at, input)?] = constant(draw(range.value));
        }
        for (input, range) in &self.drawn.actuator_inputs {
            for actuator in &reader.text.actuators {
                let place = reader.input(&input.at, &full_name(actuator, input))?;
                inputs[place] = constant(draw(range.value));
            }
        }
        let mut parameters = vec![];
        for (parameter, range) in &self.drawn.actuator_parameters {
            for actuator in &reader.text.actuators {
                let (component, place) = super::realism::find(reader, actuator, parameter)?;
                parameters.push((component, place, draw(range.value)));
            }
        }
        for (input, range) in phase.into_iter().flatten() {
            inputs[reader.input(&input.at, input)?] = constant(draw(range.value));
        }
        Ok(Environment { name, command, inputs, parameters })
    }
}

/// The number of random commands that a pattern with `{n}` can have.
const COMMANDS: u64 = 1_000_000_000;
