//! Sequences of samples that lead through the decisions of a session: random disturbances as in the proof of the chain, and
//! beside them faults of the transmission and commands, for as long as the limits of the diagnosis ask for.

use super::Step;
use crate::prove::samples::{Sample, Samples};
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_diagnosis::random::Random;

/// Digits of measured and twin values after the first one, so that the file of the vectors stays small.
const DIGITS: usize = 6;

/// The share of samples with which a fault of the transmission or a command begins: of quiet sequences, and of busy ones.
const SHARES: [f64; 3] = [0.0, 0.002, 0.02];

/// The same for commands while an action is raised.
const ANSWER_SHARE: f64 = 0.01;

/// Residuals of the limit of plausible values, in parts of scale.
const WILD: [f64; 4] = [0.9e6, 1.1e6, f64::INFINITY, f64::NAN];

/// A fault of the transmission, or a deviation that takes the place of the random ones.
#[derive(Clone)]
enum Overlay {
    /// Measured values of these sensors are the twin's and this part of their scale more; `NaN` for missing ones.
    Measured(Vec<usize>, f64),
    /// The twin's value of a sensor, in parts of scale.
    Twin(usize, f64),
    /// An input reads this.
    Input(usize, f64),
    /// An input repeats its last value.
    Frozen(usize),
}

/// A sequence without an end.
pub(super) struct Script<'d> {
    diagnoser: &'d Diagnoser,
    random: Random,
    samples: Samples<'d>,
    share: f64,
    overlay: Option<(Overlay, u64)>,
    /// A command that takes another one back, its place, and the samples until then.
    to_undo: Option<(usize, usize, u64)>,
    durations: Vec<u64>,
    last_inputs: Vec<f64>,
}

impl<'d> Script<'d> {
    /// The sequence of a seed.
    pub fn new(diagnoser: &'d Diagnoser, seed: u64) -> Self {
        let mut random = Random::stream(11, seed);
        let samples = match random.unit() < 0.2 {
            true => Samples::steady(diagnoser, seed),
            false => Samples::new(diagnoser, seed),
        };
        let share = SHARES[random.index(SHARES.len())];
        let last_inputs = vec![f64::NAN; diagnoser.environment.inputs.len()];
        let durations = durations(diagnoser);
        let (overlay, to_undo) = (None, None);
        Script { diagnoser, random, samples, share, overlay, to_undo, durations, last_inputs }
    }

    /// The next step, after which an action against this actuator was raised before it.
    pub fn next(&mut self, accused: Option<usize>) -> Step {
        let command = self.command(accused);
        let mut sample = self.samples.next().clone();
        for value in sample.measured.iter_mut().chain(&mut sample.twin) {
            *value = rounded(*value);
        }
        if self.overlay.is_none() && self.random.unit() < self.share {
            let duration = self.duration();
            self.overlay = Some((self.draw(), duration));
        }
        if let Some((overlay, left)) = self.overlay.take() {
            self.lay(&overlay, &mut sample);
            self.overlay = (left > 1).then(|| (overlay, left - 1));
        }
        self.last_inputs.copy_from_slice(&sample.inputs);
        Step { command, sample }
    }

    fn duration(&mut self) -> u64 {
        self.durations[self.random.index(self.durations.len())]
    }

    /// A command before the next sample, with its place: an even one takes something away, the next number gives it back.
    fn command(&mut self, accused: Option<usize>) -> Option<(usize, usize)> {
        if let Some((command, place, left)) = self.to_undo {
            self.to_undo = (left > 0).then_some((command, place, left.saturating_sub(1)));
            return (left == 0).then_some((command, place));
        }
        let share = if accused.is_some() { ANSWER_SHARE } else { self.share / 10.0 };
        if self.random.unit() >= share {
            return None;
        }
        let actuators = self.diagnoser.names().actuators.len();
        let command = 2 * self.random.index(3);
        let place = match (command, accused) {
            (4, _) => self.random.index(self.diagnoser.sensors.len()),
            (_, Some(accused)) if self.random.unit() < 0.7 => accused,
            _ => self.random.index(actuators),
        };
        if command == 0 && self.random.unit() < 0.4 {
            return Some((1, place));
        }
        // Some commands stay.
        if self.random.unit() < 0.9 {
            self.to_undo = Some((command + 1, place, self.duration()));
        }
        Some((command, place))
    }

    fn draw(&mut self) -> Overlay {
        let sensors = self.diagnoser.sensors.len();
        let input = self.random.index(self.last_inputs.len().max(1));
        match self.random.index(10) {
            0 | 1 => Overlay::Measured(self.group(), f64::NAN),
            2 => Overlay::Measured(self.group(), WILD[self.random.index(WILD.len())]),
            3 => Overlay::Measured((0..sensors).collect(), 0.0),
            4 => Overlay::Measured(self.group(), self.random.between(-0.3, 0.3)),
            5 => Overlay::Measured((0..sensors).collect(), self.random.between(-0.3, 0.3)),
            6 => Overlay::Twin(self.random.index(sensors), WILD[self.random.index(WILD.len())]),
            _ if self.last_inputs.is_empty() => Overlay::Measured(vec![0], f64::NAN),
            7 => Overlay::Frozen(input),
            _ => Overlay::Input(input, self.wrong(input)),
        }
    }

    /// Sensors that fail together.
    fn group(&mut self) -> Vec<usize> {
        let count = self.diagnoser.sensors.len();
        let of = self.diagnoser.sensors[self.random.index(count)].actuator;
        match self.random.index(4) {
            0 => (0..count).collect(),
            1 => (0..count).filter(|place| self.diagnoser.sensors[*place].actuator == of).collect(),
            2 => (0..count).filter(|_| self.random.unit() < 0.3).collect(),
            _ => vec![self.random.index(count)],
        }
    }

    /// A wrong value of an input, or one at the end of its range, which may contradict another input.
    fn wrong(&mut self, input: usize) -> f64 {
        let known = &self.diagnoser.environment.inputs[input];
        let width = known.largest - known.least;
        let values = [
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            known.least - width,
            known.largest + width,
            known.least,
            known.largest,
        ];
        values[self.random.index(values.len())]
    }

    fn lay(&self, overlay: &Overlay, sample: &mut Sample) {
        match overlay {
            Overlay::Measured(sensors, part) => {
                for &sensor in sensors {
                    let value = sample.twin[sensor] + part * self.diagnoser.sensors[sensor].scale;
                    sample.measured[sensor] = rounded(value);
                }
            }
            Overlay::Twin(sensor, part) => {
                sample.twin[*sensor] = part * self.diagnoser.sensors[*sensor].scale;
            }
            Overlay::Input(input, value) => sample.inputs[*input] = *value,
            Overlay::Frozen(input) => {
                let last = self.last_inputs[*input];
                if !last.is_nan() {
                    sample.inputs[*input] = last;
                }
            }
        }
    }
}

/// How long something lasts, in samples: around every limit that the diagnosis counts to.
fn durations(diagnoser: &Diagnoser) -> Vec<u64> {
    let tuning = &diagnoser.tuning;
    let limits = [tuning.no_data_after_s, tuning.settle_s, tuning.recover_s];
    let limits = limits.map(|limit_s| diagnoser.samples(limit_s).max(1));
    let frozen = diagnoser.environment.inputs.iter();
    let frozen = frozen.filter_map(|input| input.frozen_after_samples(diagnoser.period_s));
    let around = limits.into_iter().chain(frozen).flat_map(|limit| [limit - 1, limit, limit + 2]);
    let windows = diagnoser.lengths.iter().filter_map(|length| length.span.samples());
    around.chain(windows.map(u64::from)).chain([1, 3, 30]).collect()
}

/// A value with few digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.DIGITS$e}").parse().unwrap_or(value)
}
