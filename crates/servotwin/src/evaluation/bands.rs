//! Bands learned from healthy specimens, one for each kind of sensor.
//!
//! The seed paper holds every scaled residual against one band of ±3 % (its equation (4)). Sensors
//! differ: where specimens differ by their tolerances a spool leaves 3 % without any fault, and a
//! supply pressure never comes near it. A learned band is the larger of two bounds, each meant to be left by
//! [`EXCEEDED`] of healthy records.
//!
//! *Between records* the largest residual of a record varies with specimen and command, nearly as a
//! log-normal variable: with mean m and deviation s of its logarithm over n healthy training records
//!
//! ```text
//! b = exp(m + k s),   k = (z_p + √(z_p² − a c))/a,   a = 1 − z_γ²/(2(n − 1)),   c = z_p² − z_γ²/n
//! ```
//!
//! is the upper confidence bound (γ = 95 %) of its quantile p = 1 − EXCEEDED (one-sided tolerance
//! factor: Natrella, Experimental Statistics, NBS Handbook 91, 1963, section 2-2.3.2).
//!
//! *Within a record* of N samples noise alone has its largest value, whose distribution has another
//! tail: `b = t σ` with `N P(|z| > t) = EXCEEDED`.
//!
//! Like sensors of several actuators are pooled.

use super::data_set::DataSet;
use crate::study::Role;
use serde::{Deserialize, Serialize};

/// The share of healthy records in which one sensor leaves its band.
pub const EXCEEDED: f64 = 3e-4;

/// The standard normal deviate that is exceeded with this probability.
const Z_EXCEEDED: f64 = 3.431_614_403_623_9;

/// The one that is exceeded with 5 %.
const Z_95: f64 = 1.644_853_626_951_5;

/// What is known beforehand of a sensor that is watched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Watched {
    /// The same number for like sensors.
    pub pool: usize,
    /// Standard deviation that noise gives a sample, in parts of scale.
    pub noise: f64,
    /// Samples of a judged record.
    pub samples: usize,
}

/// The band of a sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Band {
    /// The sensor.
    pub sensor: String,
    /// Half width, in parts of scale.
    pub half_width: f64,
    /// Healthy records from which it was learned, like sensors pooled.
    pub records: u64,
    /// How many of them leave it.
    pub exceeded: u64,
}

/// Learns the bands of the sensors of a data set. `None` without healthy specimens to learn from.
pub fn learn(data: &DataSet, watched: &[Watched]) -> Option<Vec<Band>> {
    let rows = data.rows_where(Role::Training, |row| row.is_healthy && !row.is_moved);
    if rows.len() < 2 || data.sensors.is_empty() || watched.len() < data.sensors.len() {
        return None;
    }
    let band = |sensor: usize| {
        let own = watched[sensor];
        let alike = (0..data.sensors.len()).filter(|&other| watched[other].pool == own.pool);
        let alike: Vec<usize> = alike.collect();
        let of = |row: &usize| alike.iter().map(|&s| data.rows[*row].largest[s]).collect::<Vec<_>>();
        let sizes: Vec<f64> = rows.iter().flat_map(of).collect();
        let half_width = between_records(&sizes).max(within_a_record(own));
        Band {
            sensor: data.sensors[sensor].clone(),
            half_width,
            records: sizes.len() as u64,
            exceeded: sizes.iter().filter(|size| **size > half_width).count() as u64,
        }
    };
    Some((0..data.sensors.len()).map(band).collect())
}

/// The bound on the largest residuals of records.
fn between_records(sizes: &[f64]) -> f64 {
    /// Nothing is smaller than the error of a simulation.
    const LEAST: f64 = 1e-4;
    let n = sizes.len() as f64;
    let logs: Vec<f64> = sizes.iter().map(|size| size.max(LEAST).ln()).collect();
    let mean = logs.iter().sum::<f64>() / n;
    let variance = logs.iter().map(|log| (log - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean + factor(n) * variance.sqrt()).exp()
}

/// The one-sided tolerance factor k of so many values.
fn factor(n: f64) -> f64 {
    let a = (1.0 - Z_95 * Z_95 / (2.0 * (n - 1.0))).max(0.1);
    let c = Z_EXCEEDED * Z_EXCEEDED - Z_95 * Z_95 / n;
    (Z_EXCEEDED + (Z_EXCEEDED * Z_EXCEEDED - a * c).max(0.0).sqrt()) / a
}

/// The bound on the largest of the samples of noise.
fn within_a_record(sensor: Watched) -> f64 {
    let each = EXCEEDED / sensor.samples.max(1) as f64;
    // P(|z| > t) < √(2/π) exp(−t²/2)/t (Mills' ratio): a few steps of the fixed point.
    let mut t = 4.0_f64;
    for _ in 0..20 {
        t = (2.0 * ((2.0 / std::f64::consts::PI).sqrt() / (each * t)).ln()).max(1.0).sqrt();
    }
    t * sensor.noise
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_factor_is_that_of_the_tables() {
        // For many values the deviate itself; for few more. Natrella's table A-7 gives 4.14 for
        // p = 0.999, γ = 0.95, n = 30; the formula is right within a percent, ours has p = 0.9997.
        assert!((factor(1e9) - Z_EXCEEDED).abs() < 1e-3);
        assert!(factor(30.0) > 4.3 && factor(30.0) < 4.8, "{}", factor(30.0));
    }

    #[test]
    fn noise_alone_leaves_its_bound_seldom() {
        let sensor = Watched { pool: 0, noise: 1.0, samples: 9001 };
        // P(|z| > 5.51) = 3.6e-8, times 9001 samples.
        assert!((within_a_record(sensor) - 5.51).abs() < 0.03, "{}", within_a_record(sensor));
        assert_eq!(within_a_record(Watched { noise: 0.0, ..sensor }), 0.0);
    }
}
