//! Compares sensors with their twins: factors, signs, exchanged pairs, and pressures without the atmosphere.
//!
//! These are mistakes of columns, not faults of the actuator. Each one is claimed only if it explains the difference
//! almost completely; a fault of a sensor or of a component leaves more.

use crate::system::Sensor;
use servotwin_model::spec::Unit;
use servotwin_system::units::ATMOSPHERE_PA;

/// Largest share of the difference that a mistake may leave unexplained.
const UNEXPLAINED: f64 = 0.05;
/// Fewer samples are no evidence.
const LEAST_SAMPLES: u64 = 20;
/// A difference or a motion below this share of a sensor's scale is no evidence.
const LEAST_SHARE: f64 = 0.01;
/// Signals that stand still are exchanged only if they differ by more than this share of a scale.
const CLEAR_SHARE: f64 = 0.5;
/// Largest error of an offset that counts as one atmosphere.
const NEARLY: f64 = 0.25;

/// Running sums of values.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Spread {
    /// Number of values.
    pub count: u64,
    sum: f64,
    square: f64,
}

impl Spread {
    /// Takes one finite value.
    pub fn take(&mut self, value: f64) {
        self.count += 1;
        self.sum += value;
        self.square += value * value;
    }

    /// The mean; 0 without a value.
    pub fn mean(&self) -> f64 {
        self.sum / self.count.max(1) as f64
    }

    /// The mean of the squares; 0 without a value.
    pub fn mean_square(&self) -> f64 {
        self.square / self.count.max(1) as f64
    }

    /// The variance; 0 without a value.
    pub fn variance(&self) -> f64 {
        (self.mean_square() - self.mean().powi(2)).max(0.0)
    }
}

/// Running comparison of a sensor's values with a twin's.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TwinComparison {
    /// Spread of the sensor's values.
    pub own: Spread,
    /// Spread of the twin's values.
    pub twin: Spread,
    product: f64,
}

impl TwinComparison {
    /// Takes one pair of values, unless one is missing (NaN).
    pub fn take(&mut self, own: f64, twin: f64) {
        if own.is_finite() && twin.is_finite() {
            self.own.take(own);
            self.twin.take(twin);
            self.product += own * twin;
        }
    }

    /// The mean of sensor minus twin.
    pub fn offset(&self) -> f64 {
        self.own.mean() - self.twin.mean()
    }

    /// The variance of `factor` times the sensor minus the twin.
    pub fn variance(&self, factor: f64) -> f64 {
        let product = self.product / self.own.count.max(1) as f64;
        let covariance = product - self.own.mean() * self.twin.mean();
        let (own, twin) = (self.own.variance(), self.twin.variance());
        (factor * factor * own - 2.0 * factor * covariance + twin).max(0.0)
    }

    /// The mean square of sensor minus twin.
    fn misfit(&self) -> f64 {
        self.variance(1.0) + self.offset().powi(2)
    }

    /// Whether the twin moves enough to compare motions.
    pub fn moves(&self, scale: f64) -> bool {
        self.own.count >= LEAST_SAMPLES && self.twin.variance().sqrt() > LEAST_SHARE * scale
    }

    /// Whether a flipped sign explains the difference: sensor plus twin hardly vary.
    pub fn is_turned(&self) -> bool {
        self.variance(-1.0) < UNEXPLAINED * self.variance(1.0)
    }
}

/// Every sensor beside the twin of every sensor.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Comparisons {
    width: usize,
    cells: Vec<TwinComparison>,
}

impl Comparisons {
    /// An empty comparison of a number of sensors.
    pub fn new(width: usize) -> Self {
        Comparisons { width, cells: vec![TwinComparison::default(); width * width] }
    }

    /// Takes one sample of all sensors and of their twins, SI; NaN is missing.
    pub fn take(&mut self, measured: &[f64], twin: &[f64]) {
        for (cells, &own) in self.cells.chunks_exact_mut(self.width.max(1)).zip(measured) {
            cells.iter_mut().zip(twin).for_each(|(cell, &twin)| cell.take(own, twin));
        }
    }

    /// A sensor beside its own twin.
    pub fn of(&self, sensor: usize) -> &TwinComparison {
        self.at(sensor, sensor)
    }

    fn at(&self, sensor: usize, twin: usize) -> &TwinComparison {
        &self.cells[sensor * self.width + twin]
    }

    /// Pairs of sensors that follow each other's twin instead of their own. A command of the wrong sign does the same
    /// to the chambers of a cylinder, so look at the signs first.
    pub fn exchanged(&self, sensors: &[&Sensor]) -> Vec<(usize, usize)> {
        let is_exchanged = |&(one, other): &(usize, usize)| {
            let cells = [(one, one), (other, other), (one, other), (other, one)];
            if cells.iter().any(|&(own, twin)| self.at(own, twin).own.count < LEAST_SAMPLES) {
                return false;
            }
            let moves = |sensor: usize| self.of(sensor).moves(sensors[sensor].scale);
            let parts = |of: fn(&TwinComparison) -> f64| {
                cells.map(|(own, twin)| of(self.at(own, twin)) / sensors[twin].scale.powi(2))
            };
            let explains = |[a, b, c, d]: [f64; 4]| c + d < UNEXPLAINED * (a + b);
            let whole = parts(TwinComparison::misfit);
            let least = whole[0].min(whole[1]).sqrt();
            // A fault may shift two chambers until each shows the level of the other, but not their motions.
            let is_clear = match moves(one) || moves(other) {
                true => least > LEAST_SHARE && explains(parts(|cell| cell.variance(1.0))),
                false => least > CLEAR_SHARE,
            };
            explains(whole) && is_clear
        };
        let pairs = (0..self.width).flat_map(|one| (one + 1..self.width).map(move |o| (one, o)));
        pairs.filter(|&(a, b)| sensors[a].unit == sensors[b].unit).filter(is_exchanged).collect()
    }

    /// The pressures that are all one atmosphere below (`-1.0`) or above (`1.0`) their twins.
    pub fn without_atmosphere(&self, sensors: &[&Sensor]) -> Option<(f64, Vec<usize>)> {
        let is_steady = |&sensor: &usize| {
            let own = self.of(sensor);
            let is_pressure = sensors[sensor].unit == Unit::Pascal;
            is_pressure
                && own.own.count >= LEAST_SAMPLES
                && own.variance(1.0).sqrt() < ATMOSPHERE_PA
        };
        let steady: Vec<usize> = (0..self.width).filter(is_steady).collect();
        let sign = self.of(*steady.first()?).offset().signum();
        let is_one = |&sensor: &usize| {
            (sign * self.of(sensor).offset() / ATMOSPHERE_PA - 1.0).abs() < NEARLY
        };
        (steady.len() > 1 && steady.iter().all(is_one)).then_some((sign, steady))
    }
}

/// Says which sensors look exchanged.
pub fn exchanged_in_words(pairs: &[(&str, &str)]) -> String {
    let each: Vec<String> =
        pairs.iter().map(|(one, other)| format!("{one} and {other} look exchanged")).collect();
    format!("{}: each follows the twin of the other", each.join(", "))
}

/// Says that pressures are not absolute, or are taken for gauge pressures.
pub fn atmosphere_in_words(sign: f64, names: &[&str]) -> String {
    let (where_is, what) = match sign < 0.0 {
        true => {
            ("below", "they seem to be gauge pressures; give them a unit with a g (barg, psig)")
        }
        false => ("above", "they seem to be absolute; give them a unit without a g (bar, psi)"),
    };
    let names = names.join(", ");
    format!(
        "{names} are all one atmosphere {where_is} the twin, whose pressures are absolute: {what}"
    )
}
