//! Sequences of samples that lead through the decisions of a session: random disturbances as in the proof of the chain, and
//! beside them faults of the transmission and commands, for as long as the limits of the diagnosis ask for. More than half
//! of the sequences change between a few disturbances of whole actuators instead, and come back to those that raised an
//! action: so one action follows another.

use super::Step;
use crate::prove::samples::{Disturbance, Sample, Samples};
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_diagnosis::random::Random;

/// Digits of measured and twin values after the first one, so that the file of the vectors stays small.
const DIGITS: usize = 4;

/// The same for inputs, which move little but must not look frozen.
const INPUT_DIGITS: usize = 9;

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
    /// Nothing moves: the twin's values stay, and these sensors read this part of their scale more.
    Still(Vec<usize>, f64),
    /// These sensors read the twin's value times this.
    Gain(Vec<usize>, f64),
    /// All sensors read the twin's values, but one reads this part of its scale more.
    Alone(usize, f64),
    /// The boundary with this number reads wrong by this part of its sensor's value, and nothing else deviates.
    Reading(usize, f64),
}

/// Disturbances that follow each other.
struct Phases {
    left: u64,
    current: Vec<Disturbance>,
    /// Those that raised an action, with the actuator.
    raising: Vec<(usize, Vec<Disturbance>)>,
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
    last_twin: Vec<f64>,
    phases: Option<Phases>,
}

impl<'d> Script<'d> {
    /// The sequence of a seed.
    pub fn new(diagnoser: &'d Diagnoser, seed: u64) -> Self {
        let mut random = Random::stream(11, seed);
        let has_phases = random.unit() < 0.6;
        let samples = match has_phases || random.unit() < 0.2 {
            true => Samples::steady(diagnoser, seed),
            false => Samples::new(diagnoser, seed),
        };
        let share = SHARES[random.index(SHARES.len())];
        let phases = Phases { left: 0, current: Vec::new(), raising: Vec::new() };
        let mut script = Script {
            diagnoser,
            samples,
            share,
            overlay: None,
            to_undo: None,
            durations: durations(diagnoser),
            last_inputs: vec![f64::NAN; diagnoser.environment.inputs.len()],
            last_twin: Vec::new(),
            phases: has_phases.then_some(phases),
            random,
        };
        if script.random.unit() < 0.3 {
            // The first command comes before the first sample, and stays for long.
            let (command, actuators) =
                (2 * script.random.index(2), diagnoser.names().actuators.len());
            script.to_undo = Some((command, script.random.index(actuators), 0));
        }
        script
    }

    /// The next step. `accused` is the actuator with a raised action.
    pub fn next(&mut self, accused: Option<usize>) -> Step {
        self.change_phase(accused);
        let command = self.command(accused);
        let mut sample = self.samples.next().clone();
        for value in sample.measured.iter_mut().chain(&mut sample.twin) {
            *value = rounded(*value, DIGITS);
        }
        for value in &mut sample.inputs {
            *value = rounded(*value, INPUT_DIGITS);
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
        self.last_twin.clone_from(&sample.twin);
        Step { command, sample }
    }

    /// Begins another disturbance where one has lasted long enough.
    fn change_phase(&mut self, accused: Option<usize>) {
        let Some(mut phases) = self.phases.take() else { return };
        if let Some(accused) = accused
            && !phases.raising.iter().any(|(actuator, _)| *actuator == accused)
        {
            phases.raising.push((accused, phases.current.clone()));
        }
        if phases.left == 0 {
            phases.left = self.duration() + self.duration();
            let known = phases.raising.len();
            let dice = self.random.unit();
            phases.current = match known > 0 {
                true if dice < 0.5 => phases.raising[self.random.index(known)].1.clone(),
                // Quiet for so long that an alarm ends.
                true if dice < 0.7 => {
                    phases.left += self.durations.iter().max().copied().unwrap_or(0);
                    vec![Disturbance::default(); self.diagnoser.sensors.len()]
                }
                _ => self.disturbances(),
            };
            self.samples.disturb_with(&phases.current);
        }
        phases.left -= 1;
        self.phases = Some(phases);
    }

    /// Disturbances of some actuators, or of none.
    fn disturbances(&mut self) -> Vec<Disturbance> {
        let actuators = self.diagnoser.names().actuators.len();
        let is_disturbed: Vec<bool> = (0..actuators).map(|_| self.random.unit() < 0.4).collect();
        let sensors = self.diagnoser.sensors.iter().map(|sensor| {
            let of = sensor.actuator.and_then(|actuator| is_disturbed.get(actuator as usize));
            match of.is_some_and(|is_disturbed| *is_disturbed) {
                true => Disturbance::draw(&mut self.random),
                false => Disturbance::default(),
            }
        });
        sensors.collect()
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
        match self.random.index(14) {
            0 | 1 => Overlay::Measured(self.group(), f64::NAN),
            2 => Overlay::Measured(self.group(), WILD[self.random.index(WILD.len())]),
            3 => Overlay::Measured((0..sensors).collect(), 0.0),
            4 => Overlay::Measured(self.group(), self.random.between(-0.3, 0.3)),
            5 => Overlay::Measured((0..sensors).collect(), self.random.between(-0.3, 0.3)),
            6 => Overlay::Still(self.group(), self.random.between(-0.3, 0.3)),
            7 => Overlay::Gain(self.group(), [0.5, 0.75, 1.25, 1.5][self.random.index(4)]),
            8 => Overlay::Alone(self.random.index(sensors), self.random.between(-0.5, 0.5)),
            11 if !self.diagnoser.boundaries.is_empty() => {
                let boundary = self.random.index(self.diagnoser.boundaries.len());
                Overlay::Reading(boundary, [-0.5, -0.125, 0.125, 0.5][self.random.index(4)])
            }
            9 => Overlay::Twin(self.random.index(sensors), WILD[self.random.index(WILD.len())]),
            _ if self.last_inputs.is_empty() => Overlay::Measured(vec![0], f64::NAN),
            10 => Overlay::Frozen(input),
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
                    sample.measured[sensor] = rounded(value, DIGITS);
                }
            }
            Overlay::Still(sensors, part) => {
                if !self.last_twin.is_empty() {
                    sample.twin.clone_from(&self.last_twin);
                }
                sample.measured.clone_from(&sample.twin);
                for &sensor in sensors {
                    sample.measured[sensor] += part * self.diagnoser.sensors[sensor].scale;
                }
            }
            Overlay::Gain(sensors, gain) => {
                for &sensor in sensors {
                    sample.measured[sensor] = gain * sample.twin[sensor];
                }
            }
            Overlay::Alone(sensor, part) => {
                sample.measured.clone_from(&sample.twin);
                sample.measured[*sensor] += part * self.diagnoser.sensors[*sensor].scale;
            }
            Overlay::Reading(boundary, part) => self.lay_reading(*boundary, *part, sample),
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

impl Script<'_> {
    /// The effects of a wrong boundary reading, without noise.
    fn lay_reading(&self, boundary: usize, part: f64, sample: &mut Sample) {
        let Diagnoser { boundaries, sensors, .. } = self.diagnoser;
        let boundary = &boundaries[boundary];
        let own = boundary.sensor as usize;
        let Some(effect) = boundary.effect() else { return };
        sample.measured.clone_from(&sample.twin);
        for &(sensor, of_sensor) in &boundary.effects {
            let sensor = sensor as usize;
            let moved = part * sample.twin[own] / sensors[own].scale * (of_sensor / effect);
            sample.measured[sensor] = sample.twin[sensor] + moved * sensors[sensor].scale;
        }
        sample.measured[own] = sample.twin[own] + part * sample.twin[own];
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
    around.chain(windows).chain([1, 3, 30]).collect()
}

/// A value with few digits.
fn rounded(value: f64, digits: usize) -> f64 {
    format!("{value:.digits$e}").parse().unwrap_or(value)
}
