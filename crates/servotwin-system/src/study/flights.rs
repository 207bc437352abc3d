//! Flights in varying environments, for training and evaluating the diagnosis in operation.
//!
//! ```toml
//! [flights]
//! seed = 1                           # of environments, specimens and noise
//! duration_s = 20
//! onset_s = [5, 9]                   # range of a fault's onset
//! windows_s = [0.5, 2]               # lengths of the sliding windows
//! commands = ["noise:rms={1..5}deg,bandwidth={0.3..2}Hz,seed=3{n}", "step:size={2..9}deg,at=2s"]
//! inputs.load_factor = [0, 1]        # drawn for each environment
//! unit_inputs.supply_pressure = [19.6e6, 21.4e6]
//! unit_parameters."supply.temperature_k" = [253, 343]
//! learn = { environments = 40, repeats = 4, healthy = 4, further = 200, further_duration_s = 60 }
//! judge = { environments = 20, repeats = 1, healthy = 10, healthy_duration_s = 300, foreign = 2 }
//! other_plant = { ... }              # `other_plant.rs`
//! full.learn = { ... }               # the sizes of `servotwin flights --full`
//! full.judge = { ... }
//! ```
//!
//! An *environment* is a command with values for everything else that varies. Faults and specimens are
//! flown in it beside one virtual twin. The twin knows the environment, because its boundary values are
//! measured, but not the specimen.

use super::faults::full_name;
use super::keys::{FLIGHT_S, FLIGHTS, MAX_ENVIRONMENTS, some};
use super::other_plant::{self, DrawText, OtherPlant, PlantDraw};
use super::reader::{Noted, Reader};
use super::training::{check_pattern, count_ranges, filled, filled_at};
use crate::document::KeyPath;
use crate::format::{Value, section};
use crate::signal::bus::as_sent;
use crate::signal::random::NormalDeviates;
use serde::Serialize;
use servotwin_diagnosis::features::MAX_ACTUATORS;
use servotwin_model::signal::Piecewise;
use std::collections::BTreeMap;
use std::ops::Range;

type Ranges = BTreeMap<String, [f64; 2]>;

section! {
    /// The section of a study file.
    pub(super) struct Text {
        #[serde(default)]
        may seed: u64 = Value::Whole(0.0, 999.0), "seed of environments, specimens and noise";
        must duration_s: f64 = FLIGHT_S, "length of a flight with a fault";
        must onset_s: [f64; 2], "range of the onset of the fault, s";
        must windows_s: Vec<f64> = Value::List(1, &Value::Number(1e-3, 1e4, "s")),
            "lengths of the sliding windows";
        must commands: Vec<String> = some::<Vec<String>>(),
            "signals with {a..b} and {n}; the environments use them in turn";
        #[serde(default)]
        may inputs: Ranges, "ranges of inputs, drawn for each environment";
        #[serde(default)]
        may unit_inputs: Ranges, "ranges of inputs that every channel has";
        #[serde(default)]
        may unit_parameters: Ranges, "ranges of parameters that every channel has";
        may least_on: Option<u32> = Value::Whole(0.0, MAX_ACTUATORS as f64),
            "minimum number of channels that stay on; default 1, or 0 for a single channel";
        #[serde(default)]
        may draws: Vec<DrawText>,
            "ranges from which each specimen with tolerances draws further parameters";
        must learn: Size, "number of flights for training";
        must judge: Size, "number of flights for the evaluation";
        may held_out: Option<usize> = FLIGHTS,
            "number of held-out environments, in which a trained diagnosis flies once without a fault; default 300";
        may full: Option<Full>, "sizes of `servotwin flights --full`";
        may other_plant: Option<other_plant::Text>,
            "plants that differ from their twin in structure, for the evaluation only";
        #[serde(default)]
        may limits: Limits, "targets of the diagnosis";
    }
}

section! {
    /// Other sizes.
    #[derive(Copy)]
    struct Full {
        must learn: Size, "number of flights for training";
        must judge: Size, "number of flights for the evaluation";
    }
}

section! {
    /// The number of flights for one purpose. By default, healthy flights are as long as those with a fault, and
    /// flights in additional environments are as long as healthy flights. Of the additional flights, training keeps
    /// only the windows that leave their bands (hard negatives). Rare events appear in many environments, and seldom in
    /// many flights of a few environments.
    #[derive(Copy, PartialEq, Serialize)]
    pub struct Size {
        must pub environments: usize = SOME_FLIGHTS, "number of environments";
        must pub repeats: usize = FLIGHTS, "number of flights for each fault and intensity";
        must pub healthy: usize = FLIGHTS, "number of healthy flights in each environment";
        may pub healthy_duration_s: Option<f64> = FLIGHT_S,
            "length of a healthy flight; default: that of a flight with a fault";
        #[serde(default)]
        may pub further: usize = FLIGHTS,
            "number of additional environments with one healthy flight each";
        may pub further_duration_s: Option<f64> = FLIGHT_S,
            "length of these flights; default: that of the healthy flights";
        #[serde(default)]
        may pub foreign: usize = FLIGHTS,
            "number of environments for faults that training does not contain";
    }
}

const SOME_FLIGHTS: Value = Value::Whole(1.0, MAX_ENVIRONMENTS as f64);

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
    /// The name, `L007` for training (learn), `J007` for evaluation (judge), or `H007` for a single healthy flight.
    pub name: String,
    /// The command as text.
    pub command: String,
    /// One signal for each input of the system.
    pub inputs: Vec<Piecewise>,
    /// Parameters that the environment changes (temperatures): component, parameter, value.
    pub parameters: Vec<(usize, usize, f64)>,
}

/// The flights of a study.
#[derive(Clone, Debug)]
pub struct Flights {
    /// The seed of environments, specimens and noise.
    pub seed: u64,
    /// Length of a flight with a fault, s.
    pub duration_s: f64,
    /// The range of a fault's onset, s.
    pub onset_s: [f64; 2],
    /// Lengths of the windows, s, ascending.
    pub windows_s: Vec<f64>,
    /// The number of training flights.
    pub learn: Size,
    /// The number of evaluation flights.
    pub judge: Size,
    /// The targets of the diagnosis.
    pub limits: Limits,
    /// Plants that differ from their twin in structure.
    pub other_plant: Option<OtherPlant>,
    /// The training environments.
    pub learned: Vec<Environment>,
    /// The evaluation environments.
    pub judged: Vec<Environment>,
    /// The environments of the healthy flights that set the margin of a trained diagnosis.
    pub held_out: Vec<Environment>,
}

/// The usual number of held-out environments: without a shutdown in them, at most 1 % of environments have one (95 %, rule
/// of three).
pub const HELD_OUT: usize = 300;

/// The seed of held-out environments, specimens and noise. No study declares it, no [`HealthyDraw`] has it, and no sealed
/// opening draws it.
pub const HELD_OUT_SEED: u64 = 1000;

/// The seed of commands after which those of [`HealthyDraw`] begin: beyond all others, sealed ones included.
const HEALTHY_COMMANDS: usize = 20_000_000;

/// The commands of a seed that differ from those of every other seed, for each pattern.
const COMMANDS_OF_A_SEED: usize = 1_000_000;

/// The largest number of environments of a [`HealthyDraw`]: no command and no specimen is in those of another seed.
pub const MAX_HEALTHY: usize = COMMANDS_OF_A_SEED / 2;

/// Environments for healthy flights, each of which is flown once. Training and evaluation have none of their commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HealthyDraw {
    /// The seed of environments, specimens and noise, 0 to 999.
    pub seed: u64,
    /// Whether the flights are as long as the healthy ones of the full sizes.
    pub is_full: bool,
}

/// The seed of commands after which those of a [`ChosenEnvironment`] begin: beyond those of every [`HealthyDraw`].
const CHOSEN_COMMANDS: usize = 2_000_000_000;

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

/// An environment by its place in [`EnvironmentRanges`]. Neither training nor any evaluation has its command.
#[derive(Clone, Copy, Debug)]
pub struct ChosenEnvironment<'c> {
    /// The seed, 0 to 999, and a number, with which the random part of the command is drawn.
    pub draw: (usize, usize),
    /// The index of the pattern of the command.
    pub pattern: usize,
    /// The place in each range of the pattern, from 0 to 1.
    pub command: &'c [f64],
    /// The place in each range of inputs and parameters, from 0 to 1.
    pub shares: &'c [f64],
}

/// Other draws of evaluation flights than those of the study file.
#[derive(Clone, Copy, Debug, Default)]
pub struct Redraw {
    /// Another seed.
    pub seed: Option<u64>,
    /// Another number of additional environments.
    pub judged_further: Option<usize>,
}

impl Flights {
    pub(super) fn new(text: &Text, reader: &Reader) -> Result<Self, Noted> {
        let mut windows_s = text.windows_s.clone();
        windows_s.sort_by(f64::total_cmp);
        Ok(Flights {
            seed: text.seed,
            duration_s: text.duration_s,
            onset_s: text.onset_s,
            windows_s,
            learn: text.learn,
            judge: text.judge,
            limits: text.limits,
            other_plant: text.other_plant(reader)?,
            learned: text.environments(reader, 'L', text.learn)?,
            judged: text.environments(reader, 'J', text.judge)?,
            held_out: text
                .redrawn(Redraw { seed: Some(HELD_OUT_SEED), ..Redraw::default() })
                .healthy(reader, 0..text.held_out.unwrap_or(HELD_OUT))?,
        })
    }
}

impl Text {
    pub(super) fn least_on(&self) -> Option<u32> {
        self.least_on
    }

    pub(super) fn other_plant(&self, reader: &Reader) -> Result<Option<OtherPlant>, Noted> {
        self.other_plant.as_ref().map(|text| OtherPlant::new(text, reader)).transpose()
    }

    /// The patterns of all commands with their places in the file.
    pub(super) fn patterns(&self) -> impl Iterator<Item = (KeyPath<'static>, &str)> {
        self.commands.iter().enumerate().map(|(n, text)| (command_at(n), text.as_str()))
    }

    /// The parameters of every actuator that vary between environments.
    pub(super) fn varied_parameters(&self) -> impl Iterator<Item = &String> {
        self.unit_parameters.keys()
    }

    /// The places of sizes without any training flight with a fault.
    pub(super) fn without_faults_to_learn(&self) -> Vec<KeyPath<'static>> {
        let own = (KeyPath::of(&["flights", "learn", "repeats"]), self.learn);
        let full =
            self.full.map(|of| (KeyPath::of(&["flights", "full", "learn", "repeats"]), of.learn));
        let all = [Some(own), full].into_iter().flatten();
        all.filter(|(_, size)| size.repeats == 0).map(|(at, _)| at).collect()
    }

    /// The same section with other draws of the evaluation flights.
    pub(super) fn redrawn(&self, draw: Redraw) -> Text {
        let further = draw.judged_further.unwrap_or(self.judge.further);
        let judge = Size { further, ..self.judge };
        Text { seed: draw.seed.unwrap_or(self.seed), judge, ..self.clone() }
    }

    /// The same section with the full sizes.
    pub(super) fn full(&self) -> Option<Text> {
        let Full { learn, judge } = self.full?;
        Some(Text { learn, judge, full: None, ..self.clone() })
    }

    /// Checks this section and its full sizes, and draws one environment from each pattern. This reports wrong names
    /// and patterns before any flight. Returns what each specimen draws.
    pub(super) fn check_all(&self, reader: &Reader) -> Result<Vec<PlantDraw>, Noted> {
        let (ranges, other_plant) = (self.check_ranges(reader), self.other_plant(reader));
        let draws = other_plant::draws(reader, &KeyPath::of(&["flights"]), &self.draws, &[]);
        self.check(reader)?;
        ranges?;
        other_plant?;
        let driven = reader.command_input()?;
        for (at, pattern) in self.patterns() {
            let _ = check_pattern(reader, &at, pattern, driven, self.duration_s);
        }
        let one_each = Size { environments: self.commands.len(), further: 0, ..self.learn };
        self.environments(reader, 'L', one_each)?;
        Ok(draws)
    }

    fn check(&self, reader: &Reader) -> Result<(), Noted> {
        let d = self.duration_s;
        let [from, to] = self.onset_s;
        let inside = from >= 0.0 && to < d;
        let section = KeyPath::of(&["flights"]);
        reader.range(
            &section.key("onset_s"),
            from,
            inside,
            "two times inside of the flight, in order",
        )?;
        let units = reader.text.units.len();
        let least_on = self.least_on.unwrap_or(0);
        let allowed = format!("0 … {units}, as there are units");
        reader.range(
            &section.key("least_on"),
            f64::from(least_on),
            least_on as usize <= units,
            allowed,
        )?;
        for (n, &w) in self.windows_s.iter().enumerate() {
            let samples = w * reader.text.sample_hz;
            let fits = samples >= 10.0 && w <= d - to;
            let allowed = "10 samples … what remains of a flight after the latest onset";
            reader.range(&section.key("windows_s").element(n), w, fits, allowed)?;
        }
        Ok(())
    }

    /// Checks that both ends of every range are possible.
    fn check_ranges(&self, reader: &Reader) -> Result<(), Noted> {
        let units = || reader.text.units.iter();
        let own = self.inputs.iter().map(|(name, range)| ("inputs", String::new(), name, range));
        let of_units = self.unit_inputs.iter().flat_map(|(name, range)| {
            units().map(move |unit| ("unit_inputs", unit.clone(), name, range))
        });
        for (section, unit, name, range) in own.chain(of_units) {
            let at = KeyPath::of(&["flights", section, name]);
            let input = reader.input(&at.name(), &full_name(&unit, name))?;
            for value in range {
                reader.constant(&at, input, *value)?;
            }
        }
        for (name, range) in &self.unit_parameters {
            for unit in units() {
                let at = KeyPath::of(&["flights", "unit_parameters", name]);
                let (component, place) = super::realism::find(reader, &at.name(), unit, name)?;
                for value in range {
                    reader.parameter(&at, (component, place), *value)?;
                }
            }
        }
        Ok(())
    }

    /// The duration of a healthy evaluation flight, s.
    pub(super) fn healthy_duration_s(&self) -> f64 {
        self.judge.healthy_duration_s.unwrap_or(self.duration_s)
    }

    /// Environments of a [`HealthyDraw`] by their numbers.
    pub(super) fn healthy(
        &self,
        reader: &Reader,
        numbers: Range<usize>,
    ) -> Result<Vec<Environment>, Noted> {
        let count = numbers.len();
        let all = reader.sound(numbers.map(|n| self.environment(reader, 'H', n, self.judge)));
        if all.len() == count { Ok(all) } else { Err(Noted) }
    }

    /// What varies between environments.
    pub(super) fn environment_ranges(&self, units: &[String]) -> EnvironmentRanges {
        let of_units = |ranges: &Ranges| -> Vec<(String, [f64; 2])> {
            let names = ranges.iter().flat_map(|(name, range)| {
                units.iter().map(move |unit| (full_name(unit, name), *range))
            });
            names.collect()
        };
        let shared = self.inputs.iter().map(|(name, range)| (name.clone(), *range)).collect();
        EnvironmentRanges {
            commands: self.commands.iter().map(|c| (c.clone(), count_ranges(c))).collect(),
            ranges: [shared, of_units(&self.unit_inputs), of_units(&self.unit_parameters)].concat(),
            onset_s: self.onset_s,
            duration_s: self.duration_s,
        }
    }

    /// Environments by their places in [`EnvironmentRanges`].
    pub(super) fn chosen(
        &self,
        reader: &Reader,
        chosen: &[ChosenEnvironment],
    ) -> Result<Vec<Environment>, Noted> {
        let all = reader.sound(chosen.iter().map(|chosen| {
            let (seed, number) = chosen.draw;
            let draw = CHOSEN_COMMANDS + COMMANDS_OF_A_SEED * seed + number;
            let command =
                filled_at(&self.commands[chosen.pattern], draw, |place| chosen.command[place]);
            let name = format!("W{seed}.{number:03}");
            let mut shares = chosen.shares.iter().copied();
            let mut share = || shares.next().expect("one share for each range");
            let flown = (name, chosen.pattern, command, self.duration_s);
            self.with_shares(reader, flown, &mut share)
        }));
        if all.len() == chosen.len() { Ok(all) } else { Err(Noted) }
    }

    fn environments(
        &self,
        reader: &Reader,
        letter: char,
        size: Size,
    ) -> Result<Vec<Environment>, Noted> {
        let of = |number| self.environment(reader, letter, number, size);
        let count = size.environments + size.further;
        let all = reader.sound((0..count).map(of));
        if all.len() == count { Ok(all) } else { Err(Noted) }
    }

    fn environment(
        &self,
        reader: &Reader,
        letter: char,
        number: usize,
        size: Size,
    ) -> Result<Environment, Noted> {
        let name = format!("{letter}{number:03}");
        let position = number % self.commands.len();
        let pattern = &self.commands[position];
        let first = first_command(letter, self.seed as usize);
        let command = filled(pattern, first + number / self.commands.len());
        let durations_s = [size.healthy_duration_s, size.further_duration_s];
        let longest_s = durations_s.into_iter().flatten().fold(self.duration_s, f64::max);
        let mut random = NormalDeviates::new(
            u64::from(u32::from(letter)) << 32 | number as u64 ^ self.seed << 40,
        );
        let flown = (name, position, command, longest_s);
        self.with_shares(reader, flown, &mut || random.unit())
    }

    /// An environment from its name, the position of its pattern, its command and the length of its signal. `share` gives
    /// the place in each range, from 0 to 1, in the order of [`EnvironmentRanges::ranges`].
    fn with_shares(
        &self,
        reader: &Reader,
        (name, position, command, longest_s): (String, usize, String, f64),
        share: &mut dyn FnMut() -> f64,
    ) -> Result<Environment, Noted> {
        let pattern = &self.commands[position];
        let mut inputs = reader.default_inputs();
        let driven = reader.command_input()?;
        // The twin reads the command as sent over the bus; no other part has more information.
        let signal = command.parse();
        let built = reader.signal(&command_at(position), pattern, signal, driven, longest_s)?;
        let sent = as_sent(&built, 1.0 / reader.text.sample_hz, longest_s);
        inputs[driven] = sent.expect("a signal is finite");
        let constant = |value: f64| Piecewise::constant(value).expect("a finite value");
        let mut draw = |[low, high]: [f64; 2]| low + (high - low) * share();
        for (input, range) in &self.inputs {
            let at = KeyPath::of(&["flights", "inputs", input]).name();
            inputs[reader.input(&at, input)?] = constant(draw(*range));
        }
        for (input, range) in &self.unit_inputs {
            for unit in &reader.text.units {
                let at = KeyPath::of(&["flights", "unit_inputs", input]).name();
                let input = reader.input(&at, &full_name(unit, input))?;
                inputs[input] = constant(draw(*range));
            }
        }
        let mut parameters = vec![];
        for (parameter, range) in &self.unit_parameters {
            for unit in &reader.text.units {
                let at = KeyPath::of(&["flights", "unit_parameters", parameter]).name();
                let (component, place) = super::realism::find(reader, &at, unit, parameter)?;
                parameters.push((component, place, draw(*range)));
            }
        }
        Ok(Environment { name, command, inputs, parameters })
    }
}

/// The seed of the first command of an environment: evaluation uses other draws than training, and healthy flights in
/// environments of their own use others again.
fn first_command(letter: char, seed: usize) -> usize {
    match letter {
        'L' => 1 + MAX_ENVIRONMENTS / 100 * seed,
        'H' => HEALTHY_COMMANDS + COMMANDS_OF_A_SEED * seed,
        _ => 1 + MAX_ENVIRONMENTS + MAX_ENVIRONMENTS / 100 * seed,
    }
}

/// The place of a pattern of commands.
fn command_at(position: usize) -> KeyPath<'static> {
    KeyPath::of(&["flights", "commands"]).element(position)
}
