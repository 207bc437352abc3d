//! Bands learned from healthy specimens, one for each kind of sensor.
//!
//! The seed paper holds every scaled residual against one band of ±3 % (its equation (4)). Sensors
//! differ: where specimens differ by their tolerances a spool leaves 3 % without any fault, and a
//! supply pressure never comes near it. The largest residual x of a healthy record varies with specimen
//! and command, nearly as a log-normal variable. With mean m and deviation s of ln x for each kind of
//! sensor (like sensors of several actuators are pooled) the learned band is
//!
//! ```text
//! b = exp(m + k s)
//! ```
//!
//! with the one k, the same for all sensors, with which at most [`ALARMS`] of the healthy training records
//! leave any band. So what is promised is the rate of false alarms of all sensors together, and nothing
//! is assumed of how they hang together. It holds for flights like those of training.
//!
//! Two rules keep a few strange records from widening every band. Records that began without a steady state do not
//! teach. And no band is wider than [`MAX_OVER_LARGEST`] times the largest residual of the records that do.

use super::data_set::{DataSet, Row};
use crate::study::Role;
use serde::{Deserialize, Serialize};

/// The share of healthy training records that may leave a band.
pub const ALARMS: f64 = 0.015;

/// How many times as wide as the largest residual that taught it a band may be.
pub const MAX_OVER_LARGEST: f64 = 2.0;

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

/// The mean and deviation of the logarithm of largest residuals.
#[derive(Clone, Copy)]
struct Spread {
    mean: f64,
    deviation: f64,
}

/// Learns the bands; `pools[i]` is the same for sensors that are alike. `None` without healthy
/// specimens to learn from.
pub fn learn(data: &DataSet, pools: &[usize]) -> Option<Vec<Band>> {
    let teaches = |row: &Row| row.is_healthy && row.moved == 0 && !row.began_on_the_move;
    let rows = data.rows_where(Role::Training, teaches);
    if rows.len() < 2 || data.sensors.is_empty() || pools.len() < data.sensors.len() {
        return None;
    }
    let largest: Vec<&[f64]> = rows.iter().map(|&row| data.rows[row].largest.as_slice()).collect();
    let sizes = half_widths(&largest, pools)?.into_iter().enumerate();
    let band = |(sensor, half_width): (usize, f64)| {
        let alike = |s: &usize| pools[*s] == pools[sensor];
        let alike: Vec<usize> = (0..data.sensors.len()).filter(alike).collect();
        let sizes = largest.iter().flat_map(|row| alike.iter().map(|&s| row[s]));
        Band {
            sensor: data.sensors[sensor].clone(),
            half_width,
            records: (alike.len() * largest.len()) as u64,
            exceeded: sizes.filter(|size| logarithm(*size) > half_width.ln()).count() as u64,
        }
    };
    Some(sizes.map(band).collect())
}

/// The half width of the band of every sensor, learned from the largest residuals of healthy records, row by row.
/// `None` of too few.
pub fn half_widths(largest: &[&[f64]], pools: &[usize]) -> Option<Vec<f64>> {
    let count = largest.first()?.len();
    if largest.len() < 2 || count == 0 || pools.len() < count {
        return None;
    }
    let sensors = 0..count;
    let alike = |sensor: usize| sensors.clone().filter(move |&s| pools[s] == pools[sensor]);
    let logs = |sensor: usize| largest.iter().map(move |row| logarithm(row[sensor]));
    let of_pool = |sensor: usize| alike(sensor).flat_map(logs).collect::<Vec<f64>>();
    let spreads: Vec<Spread> = sensors.clone().map(|sensor| spread(&of_pool(sensor))).collect();
    // By how many deviations the worst sensor of each record is above its mean.
    let worst = |row: &&[f64]| {
        let above = spreads.iter().zip(row.iter());
        let above = above.map(|(spread, size)| (logarithm(*size) - spread.mean) / spread.deviation);
        above.fold(f64::NEG_INFINITY, f64::max)
    };
    let mut worst: Vec<f64> = largest.iter().map(worst).collect();
    worst.sort_by(|a, b| b.total_cmp(a));
    let k = worst[(ALARMS * worst.len() as f64) as usize];
    let half_width = |sensor: usize| {
        let Spread { mean, deviation } = spreads[sensor];
        let largest = of_pool(sensor).into_iter().fold(f64::NEG_INFINITY, f64::max).exp();
        (mean + k * deviation).exp().min(MAX_OVER_LARGEST * largest)
    };
    Some(sensors.clone().map(half_width).collect())
}

/// Nothing is smaller than the error of a simulation.
fn logarithm(size: f64) -> f64 {
    size.max(1e-4).ln()
}

fn spread(logs: &[f64]) -> Spread {
    /// Records that are all alike differ by a hundredth.
    const LEAST: f64 = 0.01;
    let n = logs.len() as f64;
    let mean = logs.iter().sum::<f64>() / n;
    let variance = logs.iter().map(|log| (log - mean).powi(2)).sum::<f64>() / (n - 1.0);
    Spread { mean, deviation: variance.sqrt().max(LEAST) }
}
