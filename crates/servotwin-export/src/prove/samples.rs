//! Random samples for the whole chain. They need not be flights: they must lead through all of the code.
//!
//! Every few seconds another disturbance begins: none, an offset or a wrong gain of a sensor, a wrong boundary reading
//! that moves or stays, or a leak behind it, offsets of all sensors of an actuator, noise, or less noise than declared. Now
//! and then values are missing, wild or frozen.

use crate::tables::center;
use servotwin_diagnosis::diagnoser::{DiagnosedSensor, Diagnoser};
use servotwin_diagnosis::random::Random;

/// Longest disturbance, in samples.
const LONGEST: usize = 1500;

/// The sizes of disturbances, in parts of scale: 1/1000 to 1/2, evenly on a logarithmic scale.
const SMALLEST_SIZE: f64 = -3.0;
const LARGEST_SIZE: f64 = -0.3;

/// Residuals above this part of their scale are no measurements.
const PLAUSIBLE: f64 = 1e6;

/// The share of samples with a fault of the transmission.
const BROKEN_SHARE: f64 = 5e-4;

/// One sample, in SI units.
#[derive(Debug, Clone)]
pub(super) struct Sample {
    pub(crate) inputs: Vec<f64>,
    pub(crate) measured: Vec<f64>,
    pub(crate) twin: Vec<f64>,
}

/// What disturbs a sensor: its offset, and its slope over the twin's signal, in parts of scale.
#[derive(Clone, Copy, Default)]
struct Disturbance {
    offset: f64,
    slope: f64,
    noise: f64,
    /// The part of its declared noise that it lacks.
    lacks: f64,
}

/// The size of a disturbance with its sign, in parts of scale.
fn draw_size(random: &mut Random) -> f64 {
    let exponent = random.between(SMALLEST_SIZE, LARGEST_SIZE);
    let sign = if random.unit() < 0.5 { -1.0 } else { 1.0 };
    sign * 10f64.powf(exponent)
}

/// The part of a sample that stays broken for a while.
#[derive(Clone, Copy)]
enum Broken {
    MissingSensor(usize),
    /// The sensors of an actuator; for `None` all sensors.
    MissingSensors(Option<u32>),
    /// Just plausible, or not at all.
    WildSensor(usize, bool),
    MissingInput(usize),
    /// Infinite, negative or positive.
    WildInput(usize, bool),
    WildTwin(usize),
    FrozenInput(usize),
    /// At an end of its range, where it may contradict another one.
    ExtremeInput(usize, bool),
}

/// A sequence of samples.
pub(super) struct Samples<'d> {
    diagnoser: &'d Diagnoser,
    random: Random,
    /// Plausible inputs, around which they move.
    center: Vec<f64>,
    /// Twin signals in parts of scale, and where they go.
    signals: Vec<f64>,
    goals: Vec<f64>,
    disturbances: Vec<Disturbance>,
    /// How far a disturbance moves each input, SI.
    moved: Vec<f64>,
    left: usize,
    broken: Option<(Broken, usize)>,
    sample: Sample,
}

impl<'d> Samples<'d> {
    pub(crate) fn new(diagnoser: &'d Diagnoser, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let (sensors, center) = (diagnoser.sensors.len(), center(diagnoser, &mut random));
        Samples {
            sample: Sample {
                inputs: center.clone(),
                measured: vec![0.0; sensors],
                twin: vec![0.0; sensors],
            },
            diagnoser,
            random,
            moved: vec![0.0; center.len()],
            center,
            signals: vec![0.5; sensors],
            goals: vec![0.5; sensors],
            disturbances: vec![Disturbance::default(); sensors],
            left: 0,
            broken: None,
        }
    }

    /// The next sample.
    pub(crate) fn next(&mut self) -> &Sample {
        if self.left == 0 {
            self.left = 100 + self.random.index(LONGEST);
            self.disturb();
        }
        self.left -= 1;
        for (place, input) in self.diagnoser.environment.inputs.iter().enumerate() {
            let width = 1e-6 * (input.largest - input.least);
            let value = self.center[place] + self.moved[place] + width * self.random.unit();
            self.sample.inputs[place] = value;
        }
        for (place, sensor) in self.diagnoser.sensors.iter().enumerate() {
            if self.random.unit() < 0.02 {
                self.goals[place] = self.random.unit();
            }
            self.signals[place] += 0.1 * (self.goals[place] - self.signals[place]);
            let Disturbance { offset, slope, noise, lacks } = self.disturbances[place];
            let noise = noise + (1.0 - lacks) * sensor.noise;
            let noise = noise * 2.0 * (self.random.unit() + self.random.unit() - 1.0);
            let signal = self.signals[place];
            self.sample.twin[place] = sensor.scale * signal;
            self.sample.measured[place] = sensor.scale * (signal + offset + slope * signal + noise);
        }
        self.break_something();
        &self.sample
    }

    /// Begins another disturbance.
    fn disturb(&mut self) {
        self.disturbances.fill(Disturbance::default());
        self.moved.fill(0.0);
        let sensors = self.diagnoser.sensors.len();
        let (sensor, size) = (self.random.index(sensors), draw_size(&mut self.random));
        match self.random.index(8) {
            0 => {}
            1 => self.disturbances[sensor].offset = size,
            2 => self.disturbances[sensor].slope = size,
            3 | 4 => self.disturb_boundary(size),
            5 => {
                let of = self.diagnoser.sensors[sensor].actuator;
                let own = |(_, other): &(usize, &DiagnosedSensor)| other.actuator == of;
                let places = self.diagnoser.sensors.iter().enumerate().filter(own);
                for place in places.map(|(place, _)| place).collect::<Vec<_>>() {
                    self.disturbances[place].offset = draw_size(&mut self.random);
                }
            }
            6 => self.disturbances[sensor].noise = size.abs(),
            _ => {
                let lacks = self.random.between(0.3, 1.0);
                self.disturbances.iter_mut().for_each(|own| own.lacks = lacks);
            }
        }
    }

    /// A wrong boundary reading, which may move and still be plausible, or with a slope a leak behind the boundary.
    fn disturb_boundary(&mut self, size: f64) {
        let boundaries = &self.diagnoser.boundaries;
        if boundaries.is_empty() {
            return;
        }
        let boundary = &boundaries[self.random.index(boundaries.len())];
        let slope = if self.random.unit() < 0.5 { 0.0 } else { self.random.between(-1.0, 1.0) };
        let own = boundary.effect().unwrap_or(1.0);
        if self.random.unit() < 0.5 {
            let input = boundary.input as usize;
            let known = &self.diagnoser.environment.inputs[input];
            let center = self.center[input];
            let (least, largest) = (known.least - center, known.largest - center);
            self.moved[input] = (-size / own).clamp(0.9 * least, 0.9 * largest);
        }
        for &(sensor, effect) in &boundary.effects {
            let part = size * effect / own;
            let disturbance =
                Disturbance { offset: part, slope: slope * part, ..Disturbance::default() };
            self.disturbances[sensor as usize] = disturbance;
        }
    }

    /// Breaks a value for up to two seconds, now and then.
    fn break_something(&mut self) {
        if self.broken.is_none() && self.random.unit() < BROKEN_SHARE {
            let sensor = self.random.index(self.diagnoser.sensors.len());
            let input = self.random.index(self.center.len());
            let is_least = self.random.unit() < 0.5;
            let what = match self.random.index(10) {
                0 => Broken::MissingSensor(sensor),
                1..=3 => Broken::WildSensor(sensor, is_least),
                8 if is_least => Broken::MissingSensors(None),
                8 => Broken::MissingSensors(self.diagnoser.sensors[sensor].actuator),
                _ if self.center.is_empty() => Broken::MissingSensor(sensor),
                4 => Broken::MissingInput(input),
                5 => Broken::WildInput(input, is_least),
                6 => Broken::FrozenInput(input),
                7 => Broken::ExtremeInput(input, is_least),
                _ => Broken::WildTwin(sensor),
            };
            self.broken = Some((what, 1 + self.random.index(200)));
        }
        let Some((what, left)) = self.broken else { return };
        match what {
            Broken::MissingSensor(sensor) => self.sample.measured[sensor] = f64::NAN,
            Broken::WildSensor(sensor, is_plausible) => {
                let (scale, twin) =
                    (self.diagnoser.sensors[sensor].scale, self.sample.twin[sensor]);
                let edge = twin + (PLAUSIBLE * scale - 0.5 * twin.abs());
                self.sample.measured[sensor] = if is_plausible { edge } else { 1e300 };
            }
            Broken::MissingInput(input) => self.sample.inputs[input] = f64::NAN,
            Broken::MissingSensors(of) => {
                let places = self.diagnoser.sensors.iter().zip(&mut self.sample.measured);
                let broken = places.filter(|(sensor, _)| of.is_none() || sensor.actuator == of);
                broken.for_each(|(_, value)| *value = f64::NAN);
            }
            Broken::WildInput(input, is_least) => {
                self.sample.inputs[input] =
                    if is_least { f64::NEG_INFINITY } else { f64::INFINITY };
            }
            Broken::WildTwin(sensor) => self.sample.twin[sensor] = 1e300,
            Broken::FrozenInput(input) => self.sample.inputs[input] = self.center[input],
            Broken::ExtremeInput(input, is_least) => {
                let known = &self.diagnoser.environment.inputs[input];
                self.sample.inputs[input] = if is_least { known.least } else { known.largest };
            }
        }
        self.broken = (left > 1).then_some((what, left - 1));
    }
}
