//! Features: quantities that an engineer would look at in a window of residuals.
//!
//! A family of features is one file and one word in the list below. Every feature has a name, a unit and a sentence that
//! explains it. All are functions of a [`Window`], so they cost nothing per sample.
//!
//! [`Sensors`] gives each sensor's quantity and actuator to the families. A family returns no features if the sensors
//! that it compares do not exist. So the same list serves two actuators, one, or a test rig with entirely different
//! sensors. With more than two actuators, comparisons relate each to the others.

mod balance;
mod comparison;
mod crest;
mod deviation;
mod gain;
mod law;
mod moments;
mod parity;
mod pressure;
mod proportion;
mod views;
mod vote;

use crate::number::{Number, sum};
use crate::residual::{Statistics, Window};
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

pub use parity::MAX_FOLLOWED;
pub use views::Views;

/// The quantity that a sensor measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Pressure of the chamber that extends the ram.
    PressureA,
    /// Pressure of the chamber that retracts it.
    PressureB,
    /// Ram position.
    Ram,
    /// Spool position of the servo valve.
    Spool,
    /// Pressure of the supply manifold.
    Supply,
    /// Pressure of the return manifold.
    Return,
    /// The current that drives the servo valve.
    Current,
    /// Stroke measured at the surface that all actuators move; it belongs to none.
    Surface,
    /// Anything else.
    Other,
}

impl Quantity {
    /// Every quantity with its name in a study file.
    pub const ALL: [(Quantity, &'static str); 9] = [
        (Quantity::PressureA, "pressure_a"),
        (Quantity::PressureB, "pressure_b"),
        (Quantity::Ram, "ram"),
        (Quantity::Spool, "spool"),
        (Quantity::Supply, "supply"),
        (Quantity::Return, "return"),
        (Quantity::Current, "current"),
        (Quantity::Surface, "surface"),
        (Quantity::Other, "other"),
    ];

    /// Its name in a study file.
    pub fn name(self) -> &'static str {
        let own = Quantity::ALL.into_iter().find(|(quantity, _)| *quantity == self);
        own.map_or("other", |(_, name)| name)
    }
}

/// A sensor with the data that features need.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// The id in the study, from which feature names are built, e.g. `p_a_1`.
    pub name: String,
    /// The measured quantity.
    pub quantity: Quantity,
    /// Index of its actuator; `None` for a sensor of the whole system.
    pub actuator: Option<usize>,
    /// Standard deviation of a sample by noise and quantization, in parts of scale; zero if unknown.
    pub noise: f64,
    /// Whether the samples contain this noise; those simulated with perfect sensors do not.
    pub is_noisy: bool,
    /// The sensors that it follows by a law: their indices, and its change for each, in parts of scale.
    pub follows: Vec<(usize, f64)>,
}

impl Sensor {
    /// The noise of a value that stands in for a measured one, in parts of scale.
    pub fn noise_of_stand_in(&self) -> f64 {
        if self.is_noisy { self.noise } else { 0.0 }
    }

    /// A feature of this sensor alone; `{}` in its meaning stands for the sensor.
    fn feature(&self, kind: &str, unit: &'static str, meaning: &str) -> Feature {
        let meaning = meaning.replace("{}", &self.name);
        let actuators = self.actuator.into_iter().collect();
        Feature::new(format!("{kind}_{}", self.name), unit, meaning, actuators)
    }
}

/// The sensors of a system, in the order of the window.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sensors(pub Vec<Sensor>);

impl Sensors {
    /// The first sensor of a quantity in an actuator.
    pub fn find(&self, quantity: Quantity, actuator: usize) -> Option<usize> {
        self.0.iter().position(|s| s.quantity == quantity && s.actuator == Some(actuator))
    }

    /// Number of actuators.
    pub(crate) fn actuators(&self) -> usize {
        self.0.iter().filter_map(|s| s.actuator).max().map_or(0, |last| last + 1)
    }

    /// The order of sensors with two actuators exchanged, for [`Window::reordered`]; `None` if their sensors do not
    /// correspond.
    pub(crate) fn exchanged(&self, a: usize, b: usize) -> Option<Vec<usize>> {
        self.in_place_of(|actuator| match actuator {
            u if u == a => b,
            u if u == b => a,
            u => u,
        })
    }

    /// The order of sensors with the actuators rotated, for [`Window::reordered`]: actuator `by` takes the first place,
    /// the next one the second, and so on. `None` if their sensors do not correspond.
    fn rotated(&self, actuators: usize, by: usize) -> Option<Vec<usize>> {
        self.in_place_of(|actuator| (actuator + by) % actuators)
    }

    /// The order of sensors in each view beyond the first, with actuator `k` in the first place. `None` if the
    /// actuators' sensors do not correspond.
    pub fn rotations(&self, actuators: usize) -> Option<Vec<Vec<usize>>> {
        (1..actuators).map(|by| self.rotated(actuators, by)).collect()
    }

    /// The order of sensors when each actuator is replaced by another one.
    fn in_place_of(&self, other: impl Fn(usize) -> usize) -> Option<Vec<usize>> {
        let like = |sensor: &Sensor| {
            let actuator = sensor.actuator.map(&other);
            // The k-th sensors of a quantity correspond to each other.
            let same = |s: &&Sensor| s.quantity == sensor.quantity && s.actuator == sensor.actuator;
            let rank = self.0.iter().filter(same).position(|s| core::ptr::eq(s, sensor))?;
            let matching =
                |(_, s): &(usize, &Sensor)| s.quantity == sensor.quantity && s.actuator == actuator;
            self.0.iter().enumerate().filter(matching).nth(rank).map(|(i, _)| i)
        };
        self.0.iter().map(like).collect()
    }

    /// The sensors of a quantity, one of each actuator that has it.
    fn like_sensors(&self, quantity: Quantity) -> LikeSensors {
        let mut like_sensors =
            LikeSensors { actuators: [0; MAX_ACTUATORS], sensors: [0; MAX_ACTUATORS], count: 0 };
        let found = (0..self.actuators())
            .filter_map(|actuator| Some((actuator, self.find(quantity, actuator)?)));
        for (actuator, sensor) in found.take(MAX_ACTUATORS) {
            (
                like_sensors.actuators[like_sensors.count],
                like_sensors.sensors[like_sensors.count],
            ) = (actuator, sensor);
            like_sensors.count += 1;
        }
        like_sensors
    }

    /// Actuators that have a sensor of each of the quantities.
    fn with<'s>(&'s self, quantities: &'s [Quantity]) -> impl Iterator<Item = usize> + 's {
        let complete =
            |&actuator: &usize| quantities.iter().all(|&q| self.find(q, actuator).is_some());
        (0..self.actuators()).filter(complete)
    }
}

/// Largest number of actuators that can be compared.
pub const MAX_ACTUATORS: usize = 16;

/// Corresponding sensors of several actuators.
struct LikeSensors {
    actuators: [usize; MAX_ACTUATORS],
    sensors: [usize; MAX_ACTUATORS],
    count: usize,
}

impl LikeSensors {
    fn actuators(&self) -> &[usize] {
        &self.actuators[..self.count]
    }

    fn sensors(&self) -> &[usize] {
        &self.sensors[..self.count]
    }
}

/// Number of comparisons among this many actuators: none for one. For two, one, because the other would only change the
/// sign.
fn compared(count: usize) -> usize {
    match count {
        0 | 1 => 0,
        2 => 1,
        more => more,
    }
}

/// A comparison's feature name: with the actuator number if there are more than two.
fn name_of(name: &str, actuators: &[usize], own: usize) -> String {
    if actuators.len() > 2 { format!("{name}_{}", actuators[own] + 1) } else { name.into() }
}

/// The comparison in words.
fn against(actuators: &[usize], own: usize) -> String {
    match actuators {
        [first, second] => format!("{} against {}", first + 1, second + 1),
        _ => format!("{} against the largest of the others", actuators[own] + 1),
    }
}

/// The largest value of all others; 0 without others.
fn largest_other<N: Number>(values: &[N], own: usize) -> N {
    let others = values.iter().enumerate().filter(|(place, _)| *place != own);
    others.map(|(_, value)| *value).reduce(N::larger).unwrap_or(N::constant(0.0))
}

/// The description of a feature.
#[derive(Clone, Debug, PartialEq)]
pub struct Feature {
    /// Unique name, e.g. `mean_p_a_1`.
    pub name: String,
    /// The unit: `of scale` for fractions of the sensors' scale, `1` for ratios, and so on.
    pub unit: &'static str,
    /// One sentence that explains it.
    pub meaning: String,
    /// Indices of the actuators that it describes.
    pub actuators: Vec<usize>,
    /// The models that learn from it.
    pub teaches: Teaches,
}

impl Feature {
    /// A feature from which all models learn.
    fn new(name: String, unit: &'static str, meaning: String, actuators: Vec<usize>) -> Self {
        Feature { name, unit, meaning, actuators, teaches: Teaches::Everybody }
    }

    fn teaching(self, teaches: Teaches) -> Self {
        Feature { teaches, ..self }
    }
}

/// The models that learn from a feature.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Teaches {
    /// None. Logarithms serve better than the seed paper's variances and indicators, and the largest magnitude grows
    /// with the length of a record.
    Nobody,
    /// The nine trees that judge records. The committee has other evidence, and extrapolates worse beyond the trained
    /// intensities. Sliding windows are shorter than the gap between two bursts.
    TreesOfRecords,
    /// The trees and the committee that judge sliding windows; its use for records was not measured.
    Windows,
    /// All models.
    Everybody,
}

impl Teaches {
    /// Whether models of records learn from it.
    pub fn of_records(self) -> bool {
        matches!(self, Teaches::Everybody | Teaches::TreesOfRecords)
    }

    /// Whether models of sliding windows learn from it.
    pub fn of_windows(self) -> bool {
        matches!(self, Teaches::Everybody | Teaches::Windows)
    }
}

/// Receives the features of a family, one after the other.
trait Sink<N> {
    /// Takes the value of a feature, and its description where that is wanted.
    fn put(&mut self, value: N, describe: impl FnOnce() -> Feature);
}

/// Values alone. Does not allocate if the capacity suffices.
impl<N: Number> Sink<N> for Vec<N> {
    fn put(&mut self, value: N, _: impl FnOnce() -> Feature) {
        self.push(value);
    }
}

/// Descriptions alone.
impl Sink<f64> for Vec<Feature> {
    fn put(&mut self, _: f64, describe: impl FnOnce() -> Feature) {
        self.push(describe());
    }
}

/// A family of features.
pub struct Family {
    /// Its name in a study file.
    pub name: &'static str,
    /// One sentence that explains it.
    pub summary: &'static str,
    describe: fn(&Sensors, &Window, &mut Vec<Feature>),
    compute: fn(&Sensors, &Window, &mut Vec<f64>),
}

impl Family {
    /// The features for these sensors.
    pub fn features(&self, sensors: &Sensors) -> Vec<Feature> {
        let mut features = Vec::new();
        (self.describe)(sensors, &Window::new(sensors.0.len()), &mut features);
        features
    }

    /// Their values, in the same order.
    pub fn values(&self, sensors: &Sensors, window: &Window) -> Vec<f64> {
        let mut values = Vec::new();
        (self.compute)(sensors, window, &mut values);
        values
    }
}

macro_rules! families {
    ($($family:ident $summary:literal,)*) => {
        /// Every family, in the order of the documentation.
        pub static ALL: &[Family] = &[$(Family {
            name: stringify!($family),
            summary: $summary,
            describe: $family::list,
            compute: $family::list,
        },)*];

        /// Replaces the content of `values` by all features of a window, in the order of [`ALL`]. Does not allocate if
        /// the capacity suffices.
        pub fn values_into<W: Statistics>(
            sensors: &Sensors,
            window: &W,
            values: &mut Vec<W::Number>,
        ) {
            values.clear();
            $($family::list(sensors, window, values);)*
        }
    };
}

// The one list: file and sentence. The function `list` of a file puts features into a sink.
families! {
    moments "mean, variance and no-deviation indicator of each residual (the paper's)",
    deviation "logarithm of the standard deviation, and largest magnitude, of each residual",
    gain "slope, offset and correlation of each residual against the twin's own signal",
    pressure "common-mode and differential pressure of each actuator",
    proportion "which signal of each actuator is disturbed most",
    comparison "magnitudes of corresponding residuals of the actuators against each other",
    balance "change of load, force fight and disagreement of the ram sensors",
    vote "each ram sensor against a third stroke sensor",
    crest "crest factor: whether each residual is steady or comes in bursts",
    parity "parity residuals: each sensor against the law by which it follows others",
    law "each spool against the current that drives it: gain, offset and lag",
}

/// The family with a name.
pub fn find(name: &str) -> Option<&'static Family> {
    ALL.iter().find(|family| family.name == name)
}

/// The values of all features of a window, in the order of [`ALL`].
pub fn values(sensors: &Sensors, window: &Window) -> Vec<f64> {
    let mut values = Vec::new();
    values_into(sensors, window, &mut values);
    values
}

/// All features of the sensors, in the order of [`values`].
pub fn features(sensors: &Sensors) -> Vec<Feature> {
    ALL.iter().flat_map(|family| family.features(sensors)).collect()
}

/// Floor of means and deviations, in parts of scale: the solver of runs resolves no smaller ones.
const FLOOR: f64 = 1e-4;

/// A denominator must exceed this many standard errors to give a ratio.
const SURE: f64 = 3.0;

/// A linear combination of residuals: sensor and weight.
type Combination<'c> = &'c [(usize, f64)];

impl Sensors {
    /// Noise and quantization variance of a sample of a combination of residuals.
    fn noise_variance(&self, combination: Combination) -> f64 {
        combination.iter().map(|&(sensor, weight)| square(weight * self.0[sensor].noise)).sum()
    }

    /// The noise in the variance of a combination of residuals.
    fn noise(&self, combination: Combination) -> Noise {
        let is_noisy = combination.iter().any(|&(sensor, _)| self.0[sensor].is_noisy);
        let resolved = self.noise_variance(combination);
        Noise { carried: if is_noisy { resolved } else { 0.0 }, resolved }
    }

    /// The standard error of a combination's mean over a window: averaged noise, plus the constant error of the solver.
    fn error_of_mean<W: Statistics>(&self, window: &W, combination: Combination) -> W::Number {
        let number = W::Number::constant;
        let solver: f64 = combination.iter().map(|&(_, weight)| square(weight * FLOOR)).sum();
        (number(self.noise_variance(combination)) / window.samples() + number(solver)).sqrt()
    }
}

fn square<N: Number>(value: N) -> N {
    value * value
}

/// Noise variance of a sample.
#[derive(Clone, Copy, Default)]
struct Noise {
    /// Contained in these samples.
    carried: f64,
    /// Contained in those of a real sensor.
    resolved: f64,
}

impl Noise {
    /// The variance that a real sensor would show: noise that the samples lack is added. So deviations far below the
    /// noise become indistinguishable, and perfect and real sensors give the same value.
    fn shown<N: Number>(self, variance: N) -> N {
        let lacking = self.resolved - self.carried;
        variance.larger(N::constant(0.0)) + N::constant(lacking) + N::constant(square(FLOOR))
    }

    /// The standard deviation of a real sensor without any deviation.
    fn least_deviation(self) -> f64 {
        libm::sqrt(self.resolved + square(FLOOR))
    }
}

/// A value of a law between sensors. A stand-in value does not follow the law, so the law counts as fulfilled then.
fn of_law<W: Statistics>(
    window: &W,
    sensors: impl Iterator<Item = usize>,
    value: W::Number,
    fulfilled: f64,
) -> W::Number {
    let number = W::Number::constant;
    let stand_ins = sum(sensors.map(|sensor| window.stands_in(sensor)));
    number(0.0).if_less(stand_ins, number(fulfilled), value)
}

/// The logarithm of a standard deviation (base ten).
fn log_deviation<N: Number>(variance: N, noise: Noise) -> N {
    N::constant(0.5) * noise.shown(variance).log10()
}

/// `(a − b)/(a + b)` of two magnitudes: −1 … 1, near zero if both are within their error.
fn contrast<N: Number>(a: N, b: N, error: N) -> N {
    (a - b) / (a + b + N::constant(SURE) * error)
}

/// `a / b`, and near zero if `b` is within its error, because its sign would be random.
fn ratio<N: Number>(a: N, b: N, error_of_b: N) -> N {
    a * b / (b * b + square(N::constant(SURE) * error_of_b))
}

/// Correlation from covariances, near zero if a deviation is within its error.
fn correlation<N: Number>(covariance: N, variances: [N; 2], noise: [Noise; 2]) -> N {
    let [a, b] = [0, 1].map(|i| noise[i].shown(variances[i]));
    covariance / (a * b).sqrt()
}

#[cfg(test)]
mod contract;
