//! What an engineer would look at in a window of residuals, as numbers.
//!
//! A family of features is one file and one line in [`ALL`]. Every feature has
//! a name, a unit and a sentence that says what it means. All are functions of
//! a [`Window`], so they cost nothing per sample.
//!
//! Families see the sensors through [`Sensors`]: what each measures and to
//! which unit it belongs. A family gives no features where the sensors it
//! compares do not exist, so that the same list serves two actuators, one, or a
//! test rig that has nothing in common with either. What compares two units compares
//! each of more with the others.

mod balance;
mod comparison;
mod crest;
mod deviation;
mod gain;
mod moments;
mod parity;
mod pressure;
mod proportion;
mod views;
mod vote;

use crate::residual::Window;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;
use serde::{Deserialize, Serialize};

pub use parity::MAX_FOLLOWED;
pub use views::Views;

/// What a sensor measures, where a family wants to know.
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
    /// Stroke measured at the surface that all units move; it belongs to none.
    Surface,
    /// Anything else.
    Other,
}

impl Quantity {
    /// Every quantity and its word in a study file.
    pub const ALL: [(Quantity, &'static str); 8] = [
        (Quantity::PressureA, "pressure_a"),
        (Quantity::PressureB, "pressure_b"),
        (Quantity::Ram, "ram"),
        (Quantity::Spool, "spool"),
        (Quantity::Supply, "supply"),
        (Quantity::Return, "return"),
        (Quantity::Surface, "surface"),
        (Quantity::Other, "other"),
    ];
}

/// One sensor, as features see it.
#[derive(Clone, PartialEq)]
pub struct Sensor {
    /// The name that features are built from, e.g. `p_A1`.
    pub name: String,
    /// What it measures.
    pub quantity: Quantity,
    /// Which of several like actuators it belongs to, from 0; `None` for a sensor of the whole.
    pub actuator: Option<usize>,
    /// Standard deviation that noise and quantisation give a sample, in parts of scale; zero
    /// where it is not known.
    pub noise: f64,
    /// Whether the samples carry it: those of a simulation with perfect sensors do not.
    pub is_noisy: bool,
    /// Which others it follows by a law: their places, and how far it moves for each, in parts of scale.
    pub follows: Vec<(usize, f64)>,
    /// Whether something stands in its place that looks healthy.
    pub stands_in: bool,
}

/// Fingerprints of stored campaigns are made of this text: the field keeps the name it had.
impl fmt::Debug for Sensor {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("Sensor")
            .field("name", &self.name)
            .field("quantity", &self.quantity)
            .field("unit", &self.actuator)
            .field("noise", &self.noise)
            .field("is_noisy", &self.is_noisy)
            .field("follows", &self.follows)
            .field("stands_in", &self.stands_in)
            .finish()
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

    /// Number of units.
    pub fn actuators(&self) -> usize {
        self.0.iter().filter_map(|s| s.actuator).max().map_or(0, |last| last + 1)
    }

    /// The order of sensors with two units exchanged, for
    /// [`Window::reordered`]; `None` where their sensors do not correspond.
    pub fn exchanged(&self, a: usize, b: usize) -> Option<Vec<usize>> {
        self.in_place_of(|actuator| match actuator {
            u if u == a => b,
            u if u == b => a,
            u => u,
        })
    }

    /// The order of sensors with so many units moved round, for [`Window::reordered`]: unit `by` stands
    /// where the first one stood, the next one where the second stood, and so on. `None` where their sensors do not
    /// correspond.
    pub fn rotated(&self, actuators: usize, by: usize) -> Option<Vec<usize>> {
        self.in_place_of(|actuator| (actuator + by) % actuators)
    }

    /// The order of sensors in each view beyond the first, in which unit `k` stands first; `None` where the sensors
    /// of so many units do not correspond.
    pub fn rotations(&self, actuators: usize) -> Option<Vec<Vec<usize>>> {
        (1..actuators).map(|by| self.rotated(actuators, by)).collect()
    }

    /// The order of sensors in which each is that of the unit that stands in place of its own.
    fn in_place_of(&self, other: impl Fn(usize) -> usize) -> Option<Vec<usize>> {
        let like = |sensor: &Sensor| {
            let actuator = sensor.actuator.map(&other);
            // The k-th sensor of a quantity corresponds to the k-th.
            let same = |s: &&Sensor| s.quantity == sensor.quantity && s.actuator == sensor.actuator;
            let rank = self.0.iter().filter(same).position(|s| core::ptr::eq(s, sensor))?;
            let matching =
                |(_, s): &(usize, &Sensor)| s.quantity == sensor.quantity && s.actuator == actuator;
            self.0.iter().enumerate().filter(matching).nth(rank).map(|(i, _)| i)
        };
        self.0.iter().map(like).collect()
    }

    /// The sensors of a quantity, one of each unit that has it.
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

    /// Units that have a sensor of each of the quantities.
    fn with<'s>(&'s self, quantities: &'s [Quantity]) -> impl Iterator<Item = usize> + 's {
        let complete =
            |&actuator: &usize| quantities.iter().all(|&q| self.find(q, actuator).is_some());
        (0..self.actuators()).filter(complete)
    }
}

/// As many like units can be compared.
pub const MAX_ACTUATORS: usize = 16;

/// Like sensors of several units.
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

/// How many comparisons of one unit with the others so many give: none of one, and of two the first one's, because
/// the second one's is the same with the other sign.
fn compared(count: usize) -> usize {
    match count {
        0 | 1 => 0,
        2 => 1,
        more => more,
    }
}

/// A feature's name for a comparison of one of these units: with its number where there are more than two.
fn name_of(name: &str, actuators: &[usize], own: usize) -> String {
    if actuators.len() > 2 { format!("{name}_{}", actuators[own] + 1) } else { name.into() }
}

/// Which comparison that is, in words.
fn against(actuators: &[usize], own: usize) -> String {
    match actuators {
        [first, second] => format!("{} against {}", first + 1, second + 1),
        _ => format!("{} against the largest of the others", actuators[own] + 1),
    }
}

/// The largest of what the others but one have.
fn largest_other(values: &[f64], own: usize) -> f64 {
    let others = values.iter().enumerate().filter(|(place, _)| *place != own);
    others.map(|(_, value)| *value).reduce(f64::max).unwrap_or(0.0)
}

/// One feature: its name and what it means.
#[derive(Clone, Debug, PartialEq)]
pub struct Feature {
    /// Unique name, e.g. `mean_p_A1`.
    pub name: String,
    /// `%` of the sensors' scale as a fraction, `1` for ratios, and so on.
    pub unit: &'static str,
    /// One sentence for people.
    pub meaning: String,
    /// The units (actuators) that the feature looks at.
    pub actuators: Vec<usize>,
    /// Who should learn from it.
    pub teaches: Teaches,
}

/// Who should learn from a feature.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Teaches {
    /// Nobody: the seed paper's variances and indicators say what logarithms say better, and the
    /// largest size grows with the length of a record.
    Nobody,
    /// The nine trees that judge records: not the committee, which has other ways to know and guesses
    /// worse beyond the intensities it has met; not windows that slide, which are shorter than what
    /// lies between two bursts.
    TreesOfRecords,
    /// The trees and the committee that judge windows that slide: not those of records, for which it was not measured.
    Windows,
    /// Everybody.
    Everybody,
}

impl Teaches {
    /// Whether a diagnosis of records learns from it.
    pub fn of_records(self) -> bool {
        matches!(self, Teaches::Everybody | Teaches::TreesOfRecords)
    }

    /// Whether a diagnosis of windows that slide does.
    pub fn of_windows(self) -> bool {
        matches!(self, Teaches::Everybody | Teaches::Windows)
    }
}

/// A family of features.
pub trait Family: Sync {
    /// The word in a study file.
    fn name(&self) -> &'static str;
    /// One sentence for people.
    fn summary(&self) -> &'static str;
    /// The features for these sensors.
    fn features(&self, sensors: &Sensors) -> Vec<Feature>;
    /// Their values, in the same order, appended to `values`. Does not allocate where these have
    /// room.
    fn compute(&self, sensors: &Sensors, window: &Window, values: &mut Vec<f64>);
}

/// Every family, in the order of the documentation.
pub static ALL: &[&dyn Family] = &[
    &moments::Moments,
    &deviation::Deviation,
    &gain::Gain,
    &pressure::Pressure,
    &proportion::Proportion,
    &comparison::Comparison,
    &balance::Balance,
    &vote::Vote,
    &crest::Crest,
    &parity::Parity,
];

/// The family of a name.
pub fn find(name: &str) -> Option<&'static dyn Family> {
    ALL.iter().copied().find(|f| f.name() == name)
}

/// The values of all features of a window, in the order of [`ALL`].
pub fn values(sensors: &Sensors, window: &Window) -> Vec<f64> {
    let mut values = Vec::new();
    values_into(sensors, window, &mut values);
    values
}

/// As [`values`], in place of what was in `values`. Does not allocate where these have room.
pub fn values_into(sensors: &Sensors, window: &Window, values: &mut Vec<f64>) {
    values.clear();
    for family in ALL {
        family.compute(sensors, window, values);
    }
}

/// All features of the sensors, in the order of [`values`].
pub fn features(sensors: &Sensors) -> Vec<Feature> {
    ALL.iter().flat_map(|family| family.features(sensors)).collect()
}

/// Means and deviations below this part of scale are not told apart: the solver
/// of a campaign is no more exact, sign and all.
const FLOOR: f64 = 1e-4;

/// A quotient needs a denominator of so many standard errors to be a number.
const SURE: f64 = 3.0;

/// A linear combination of residuals: sensor and weight.
type Combination<'c> = &'c [(usize, f64)];

impl Sensors {
    /// The variance that noise and quantisation give a sample of a combination of residuals.
    fn noise_variance(&self, combination: Combination) -> f64 {
        combination.iter().map(|&(sensor, weight)| square(weight * self.0[sensor].noise)).sum()
    }

    /// What noise has to do with the variance of a combination of residuals.
    fn noise(&self, combination: Combination) -> Noise {
        let is_noisy = combination.iter().any(|&(sensor, _)| self.0[sensor].is_noisy);
        let resolved = self.noise_variance(combination);
        Noise { carried: if is_noisy { resolved } else { 0.0 }, resolved }
    }

    /// The standard error of a combination's mean over a window: noise averaged over its samples,
    /// and the solver's error, which stays.
    fn error_of_mean(&self, window: &Window, combination: Combination) -> f64 {
        let count = (window.count() as f64).max(1.0);
        let solver: f64 = combination.iter().map(|&(_, weight)| square(weight * FLOOR)).sum();
        libm::sqrt(self.noise_variance(combination) / count + solver)
    }
}

fn square(value: f64) -> f64 {
    value * value
}

/// The variance that noise gives a sample.
#[derive(Clone, Copy, Default)]
struct Noise {
    /// In these samples.
    carried: f64,
    /// In those of a real sensor.
    resolved: f64,
}

impl Noise {
    /// A variance as a real sensor would show it: what the samples carry of its noise is in it, and
    /// what they do not is added. So deviations far below the noise are not told apart, and perfect and
    /// real sensors give the same.
    fn shown(self, variance: f64) -> f64 {
        variance.max(0.0) + (self.resolved - self.carried) + square(FLOOR)
    }

    /// The standard deviation that a real sensor shows where there is nothing.
    fn least_deviation(self) -> f64 {
        libm::sqrt(self.resolved + square(FLOOR))
    }
}

/// The logarithm of a standard deviation (base ten).
fn log_deviation(variance: f64, noise: Noise) -> f64 {
    0.5 * libm::log10(noise.shown(variance))
}

/// `(a − b)/(a + b)` of two sizes: −1 … 1, zero where both are nothing but error.
fn contrast(a: f64, b: f64, error: f64) -> f64 {
    (a - b) / (a + b + SURE * error)
}

/// `a / b`, and zero where `b` is nothing but error: its sign would decide.
fn ratio(a: f64, b: f64, error_of_b: f64) -> f64 {
    a * b / (b * b + square(SURE * error_of_b))
}

/// Correlation from covariances, zero where a deviation is nothing but error.
fn correlation(covariance: f64, variances: [f64; 2], noise: [Noise; 2]) -> f64 {
    let [a, b] = [0, 1].map(|i| noise[i].shown(variances[i]));
    covariance / libm::sqrt(a * b)
}

#[cfg(test)]
mod contract;
