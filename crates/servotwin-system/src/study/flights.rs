//! Flights in varying environments, for training and evaluating the diagnosis in operation.
//!
//! ```toml
//! [flights]
//! duration_s = 20
//! onset_s = [5, 9]                   # range of a fault's onset
//! windows_s = [0.5, 2]               # lengths of the sliding windows
//! commands = ["noise:rms={1..5}deg,bandwidth={0.3..2}Hz,seed={n}", "step:size={2..9}deg,at=2s"]
//! inputs.load_factor = [0, 1]        # drawn for each environment
//! unit_inputs.supply_pressure = [19.6e6, 21.4e6]
//! unit_parameters."supply.temperature_k" = [253, 343]
//! other_plant = { ... }              # `other_plant.rs`
//! ```
//!
//! An *environment* is a command with values for everything else that varies. Faults and specimens are
//! flown in it beside one virtual twin. The twin knows the environment, because its boundary values are
//! measured, but not the specimen. How many flights there are, and for what, is said by suites ([`super::suites`]).

use super::faults::full_name;
use super::ground_test;
use super::keys::{FLIGHT_S, some};
use super::other_plant::{self, DrawText, OtherPlant, PlantDraw};
use super::reader::{Noted, Reader};
use super::seed::{Seed, Stream};
use super::training::{check_pattern, count_ranges, filled_at, halton_in};
use crate::document::KeyPath;
use crate::format::{Value, section};
use crate::signal::bus::as_sent;
use serde::Serialize;
use servotwin_diagnosis::features::MAX_ACTUATORS;
use servotwin_model::signal::Piecewise;
use std::collections::BTreeMap;

pub(super) type Ranges = BTreeMap<String, [f64; 2]>;

section! {
    /// The section of a study file.
    pub(super) struct Text {
        must pub(super) duration_s: f64 = FLIGHT_S, "length of a flight with a fault";
        must pub(super) onset_s: [f64; 2], "range of the onset of the fault, s";
        must pub(super) windows_s: Vec<f64> = Value::List(1, &Value::Number(1e-3, 1e4, "s")),
            "lengths of the sliding windows";
        must pub(super) commands: Vec<String> = some::<Vec<String>>(),
            "signals with {a..b} and {n}; the environments use them in turn";
        #[serde(default)]
        may pub(super) inputs: Ranges, "ranges of inputs, drawn for each environment";
        #[serde(default)]
        may pub(super) unit_inputs: Ranges, "ranges of inputs that every channel has";
        #[serde(default)]
        may pub(super) unit_parameters: Ranges, "ranges of parameters that every channel has";
        may pub(super) least_on: Option<u32> = Value::Whole(0.0, MAX_ACTUATORS as f64),
            "minimum number of channels that stay on; default 1, or 0 for a single channel";
        #[serde(default)]
        may pub(super) draws: Vec<DrawText>,
            "ranges from which each specimen with tolerances draws further parameters";
        may pub(super) other_plant: Option<other_plant::Text>,
            "plants that differ from their twin in structure, for the evaluation only";
        #[serde(default)]
        may pub(super) limits: Limits, "targets of the diagnosis";
    }
}

section! {
    /// The targets of the diagnosis at work.
    #[derive(Copy, PartialEq, Serialize)]
    #[serde(default)]
    pub struct Limits {
        may pub latency_s: f64 = Value::Number(0.0, 1e4, "s"),
            "latency limit for 95 % of visible shutdown faults";
        may pub latency_unfitted_s: f64 = Value::Number(0.0, 1e4, "s"),
            "the same limit for a twin that is not fitted";
        may pub false_alarms_per_h: f64 = Value::Number(0.0, 1e4, "1/h"),
            "limit on false alarms of healthy actuators";
        may pub wrong_shutdowns: f64 = Value::Number(0.0, 1e4, ""),
            "limit on shutdowns of the wrong actuator";
    }
}

impl Default for Limits {
    fn default() -> Self {
        Limits {
            latency_s: 1.0,
            latency_unfitted_s: 2.0,
            false_alarms_per_h: 1e-3,
            wrong_shutdowns: 0.0,
        }
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
    pub parameters: Vec<(usize, usize, f64)>,
}

/// What all flights of a study have in common.
#[derive(Clone, Debug)]
pub struct Flights {
    /// Length of a flight with a fault, s.
    pub duration_s: f64,
    /// The range of a fault's onset, s.
    pub onset_s: [f64; 2],
    /// Lengths of the windows, s, ascending.
    pub windows_s: Vec<f64>,
    /// The targets of the diagnosis.
    pub limits: Limits,
    /// Plants that differ from their twin in structure.
    pub other_plant: Option<OtherPlant>,
    /// What each specimen with tolerances draws, besides its tolerances.
    pub draws: Vec<PlantDraw>,
    /// What each test on the ground draws, besides what its specimen is: the changes since the first test. Empty in
    /// flight.
    pub wear: Vec<PlantDraw>,
    /// The minimum number of actuators that stay on; `None` for the usual one.
    pub(super) least_on: Option<u32>,
    pub(super) varied: Varied,
}

/// What varies between environments: the commands, and ranges of inputs and parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentRanges {
    /// The patterns of the commands, each with the number of its ranges.
    pub commands: Vec<(String, usize)>,
    /// Inputs and parameters of the system with their ranges, SI.
    pub ranges: Vec<(String, [f64; 2])>,
    /// The range of a fault's onset, s.
    pub onset_s: [f64; 2],
    /// Length of a flight, s.
    pub duration_s: f64,
}

/// An environment by its place in [`EnvironmentRanges`].
#[derive(Clone, Copy, Debug)]
pub struct ChosenEnvironment<'c> {
    /// The seed of the random part of the command.
    pub seed: Seed,
    /// The index of the pattern of the command.
    pub pattern: usize,
    /// The place in each range of the pattern, from 0 to 1.
    pub command: &'c [f64],
    /// The place in each range of inputs and parameters, from 0 to 1.
    pub shares: &'c [f64],
}

impl Flights {
    /// Checks the section and draws one environment from each pattern. This reports wrong names and patterns before any
    /// flight.
    pub(super) fn new(text: &Text, reader: &Reader) -> Result<Self, Noted> {
        let own = reader.section_of_flights();
        let section = at(&own);
        let varied = Varied::of(text, &own);
        let ranges = varied.check(reader);
        let other_plant = text.other_plant.as_ref().map(|text| OtherPlant::new(text, reader));
        let draws =
            other_plant::draws(reader, (&KeyPath::of(&["flights"]), "draws"), &text.draws, &[]);
        let wear = other_plant::draws(reader, (&section, "wear"), reader.wear(), &[]);
        text.check(reader)?;
        ranges?;
        let other_plant = other_plant.transpose()?;
        varied.check_commands(reader, text.duration_s)?;
        let mut windows_s = text.windows_s.clone();
        windows_s.sort_by(f64::total_cmp);
        Ok(Flights {
            duration_s: text.duration_s,
            onset_s: text.onset_s,
            windows_s,
            limits: text.limits,
            other_plant,
            draws,
            wear,
            least_on: text.least_on,
            varied,
        })
    }
}

impl Text {
    fn check(&self, reader: &Reader) -> Result<(), Noted> {
        let d = self.duration_s;
        let [from, to] = self.onset_s;
        let inside = from >= 0.0 && to < d;
        let own = reader.section_of_flights();
        let section = at(&own);
        let allowed = "two times inside of the flight, in order";
        reader.range(&section.key("onset_s"), from, inside, allowed)?;
        let units = reader.text.units.len();
        let least_on = self.least_on.unwrap_or(0);
        let allowed = format!("0 … {units}, as there are units");
        let at = section.key("least_on");
        reader.range(&at, f64::from(least_on), least_on as usize <= units, allowed)?;
        for (n, &w) in self.windows_s.iter().enumerate() {
            let samples = w * reader.text.sample_hz;
            let fits = samples >= 10.0 && w <= d - to;
            let allowed = "10 samples … what remains of a flight after the latest onset";
            reader.range(&section.key("windows_s").element(n), w, fits, allowed)?;
        }
        Ok(())
    }
}

/// The keys of a section of the file.
pub(super) type Section = Vec<String>;

pub(super) fn at(section: &Section) -> KeyPath<'_> {
    KeyPath::of(&section.iter().map(String::as_str).collect::<Vec<_>>())
}

/// Ranges by name, each with the section that declares it.
type Declared = BTreeMap<String, (Section, [f64; 2])>;

/// What varies between the environments of a suite.
#[derive(Clone, Debug, Default)]
pub(super) struct Varied {
    commands: (Section, Vec<String>),
    inputs: Declared,
    unit_inputs: Declared,
    unit_parameters: Declared,
}

impl Varied {
    fn of(text: &Text, section: &Section) -> Self {
        let declared = |ranges: &Ranges| {
            let entries = ranges.iter();
            entries.map(|(name, range)| (name.clone(), (section.clone(), *range))).collect()
        };
        Varied {
            inputs: declared(&text.inputs),
            unit_inputs: declared(&text.unit_inputs),
            unit_parameters: declared(&text.unit_parameters),
            commands: (section.clone(), text.commands.clone()),
        }
    }

    /// The same with the commands and ranges of a suite in place of those of the same name.
    pub(super) fn with(
        &self,
        section: Section,
        commands: Option<&Vec<String>>,
        [inputs, unit_inputs, unit_parameters]: [&Ranges; 3],
    ) -> Self {
        let mut varied = self.clone();
        if let Some(commands) = commands {
            varied.commands = (section.clone(), commands.clone());
        }
        for (own, given) in [
            (&mut varied.inputs, inputs),
            (&mut varied.unit_inputs, unit_inputs),
            (&mut varied.unit_parameters, unit_parameters),
        ] {
            let given = given.iter();
            own.extend(given.map(|(name, range)| (name.clone(), (section.clone(), *range))));
        }
        varied
    }

    /// The parameters of every actuator that vary.
    pub(super) fn parameters(&self) -> impl Iterator<Item = &String> {
        self.unit_parameters.keys()
    }

    /// The patterns of all commands with their places in the file.
    pub(super) fn patterns(&self) -> impl Iterator<Item = (KeyPath<'_>, &str)> {
        self.commands.1.iter().enumerate().map(|(n, text)| (self.command_at(n), text.as_str()))
    }

    fn command_at(&self, position: usize) -> KeyPath<'_> {
        let section = at(&self.commands.0);
        match &self.commands.0[..] {
            [own] if own == ground_test::SECTION => section.key("command"),
            _ => section.key("commands").element(position),
        }
    }

    /// The environment of the first command, in the middle of its ranges and of those of inputs that all actuators
    /// share. Everything else has its default.
    pub(super) fn shared_middle(
        &self,
        reader: &Reader,
        duration_s: f64,
    ) -> Result<Environment, Noted> {
        let (commands, inputs) = (self.commands.clone(), self.inputs.clone());
        let shared = Varied { commands, inputs, ..Varied::default() };
        shared.middle(reader, 0, duration_s)
    }

    /// The environment in the middle of the ranges of a command.
    fn middle(
        &self,
        reader: &Reader,
        pattern: usize,
        duration_s: f64,
    ) -> Result<Environment, Noted> {
        let command = &vec![0.5; count_ranges(&self.commands.1[pattern])];
        let seed = Seed::of(0, "", pattern as u64);
        let chosen = ChosenEnvironment { seed, pattern, command, shares: &[] };
        self.environment(reader, &chosen, String::new(), duration_s)
    }

    /// Checks every command at the ends of its ranges.
    pub(super) fn check_commands(&self, reader: &Reader, longest_s: f64) -> Result<(), Noted> {
        let driven = reader.command_input()?;
        for (at, pattern) in self.patterns() {
            let _ = check_pattern(reader, &at, pattern, driven, longest_s);
        }
        let one_each =
            (0..self.commands.1.len()).map(|pattern| self.middle(reader, pattern, longest_s));
        let all = reader.sound(one_each);
        if all.len() == self.commands.1.len() { Ok(()) } else { Err(Noted) }
    }

    /// Checks that both ends of every range are possible.
    pub(super) fn check(&self, reader: &Reader) -> Result<(), Noted> {
        let units = || reader.text.units.iter();
        let own = self.inputs.iter().map(|range| ("inputs", String::new(), range));
        let of_units = self
            .unit_inputs
            .iter()
            .flat_map(|range| units().map(move |unit| ("unit_inputs", unit.clone(), range)));
        for (key, unit, (name, (section, range))) in own.chain(of_units) {
            let at = at(section).key(key).key(name);
            let input = reader.input(&at.name(), &full_name(&unit, name))?;
            for value in range {
                reader.constant(&at, input, *value)?;
            }
        }
        for (name, (section, range)) in &self.unit_parameters {
            for unit in units() {
                let at = at(section).key("unit_parameters").key(name);
                let (component, place) = super::realism::find(reader, &at.name(), unit, name)?;
                for value in range {
                    reader.parameter(&at, (component, place), *value)?;
                }
            }
        }
        Ok(())
    }

    /// What varies, with the names of the system.
    pub(super) fn ranges(
        &self,
        units: &[String],
        onset_s: [f64; 2],
        duration_s: f64,
    ) -> EnvironmentRanges {
        let of_units = |ranges: &Declared| -> Vec<(String, [f64; 2])> {
            let names = ranges.iter().flat_map(|(name, (_, range))| {
                units.iter().map(move |unit| (full_name(unit, name), *range))
            });
            names.collect()
        };
        let shared = self.inputs.iter().map(|(name, (_, range))| (name.clone(), *range)).collect();
        let commands = self.commands.1.iter();
        EnvironmentRanges {
            commands: commands.map(|command| (command.clone(), count_ranges(command))).collect(),
            ranges: [shared, of_units(&self.unit_inputs), of_units(&self.unit_parameters)].concat(),
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
        let patterns = self.commands.1.len();
        let pattern = number % patterns;
        let mut shifts = all.stream(Stream::Command);
        let mut shift = || shifts.unit();
        // Each pattern has shifts of its own.
        (0..pattern).for_each(|before| {
            for _ in 0..count_ranges(&self.commands.1[before]) {
                shift();
            }
        });
        let draw = number / patterns + 1;
        let command: Vec<f64> = (0..count_ranges(&self.commands.1[pattern]))
            .map(|place| (halton_in(draw as u64, place) + shift()) % 1.0)
            .collect();
        let mut random = seed.stream(Stream::Ranges);
        let count = |ranges: &Declared| ranges.len() * reader.text.units.len();
        let ranges = self.inputs.len() + count(&self.unit_inputs) + count(&self.unit_parameters);
        let shares: Vec<f64> = (0..ranges).map(|_| random.unit()).collect();
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
        let pattern = &self.commands.1[position];
        let number = seed.choices(Stream::Noise).next_u64() % COMMANDS;
        let command = filled_at(pattern, number as usize, |place| command[place]);
        let mut inputs = reader.default_inputs();
        let driven = reader.command_input()?;
        // The twin reads the command as sent over the bus; no other part has more information.
        let signal = command.parse();
        let place = self.command_at(position);
        let built = reader.signal(&place, pattern, signal, driven, longest_s)?;
        let sent = as_sent(&built, 1.0 / reader.text.sample_hz, longest_s);
        inputs[driven] = sent.expect("a signal is finite");
        let constant = |value: f64| Piecewise::constant(value).expect("a finite value");
        let mut shares = shares.iter().copied();
        let mut draw = |[low, high]: [f64; 2]| low + (high - low) * shares.next().unwrap_or(0.5);
        for (input, (section, range)) in &self.inputs {
            let at = at(section).key("inputs").key(input).name();
            inputs[reader.input(&at, input)?] = constant(draw(*range));
        }
        for (input, (section, range)) in &self.unit_inputs {
            for unit in &reader.text.units {
                let at = at(section).key("unit_inputs").key(input).name();
                let input = reader.input(&at, &full_name(unit, input))?;
                inputs[input] = constant(draw(*range));
            }
        }
        let mut parameters = vec![];
        for (parameter, (section, range)) in &self.unit_parameters {
            for unit in &reader.text.units {
                let at = at(section).key("unit_parameters").key(parameter).name();
                let (component, place) = super::realism::find(reader, &at, unit, parameter)?;
                parameters.push((component, place, draw(*range)));
            }
        }
        Ok(Environment { name, command, inputs, parameters })
    }
}

/// The number of random commands that a pattern with `{n}` can have.
const COMMANDS: u64 = 1_000_000_000;
