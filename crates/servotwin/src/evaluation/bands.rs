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

use super::data_set::DataSet;
use crate::study::Role;
use serde::{Deserialize, Serialize};

/// The share of healthy training records that may leave a band.
pub const ALARMS: f64 = 0.015;

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
    let rows = data.rows_where(Role::Training, |row| row.is_healthy && !row.is_moved);
    if rows.len() < 2 || data.sensors.is_empty() || pools.len() < data.sensors.len() {
        return None;
    }
    let sensors = 0..data.sensors.len();
    let alike = |sensor: usize| sensors.clone().filter(move |&s| pools[s] == pools[sensor]);
    let logs =
        |sensor: usize| rows.iter().map(move |&row| logarithm(data.rows[row].largest[sensor]));
    let of_pool = |sensor: usize| alike(sensor).flat_map(logs).collect::<Vec<f64>>();
    let spreads: Vec<Spread> = sensors.clone().map(|sensor| spread(&of_pool(sensor))).collect();
    // By how many deviations the worst sensor of each record is above its mean.
    let worst = |&row: &usize| {
        let above = spreads.iter().zip(&data.rows[row].largest);
        let above = above.map(|(spread, size)| (logarithm(*size) - spread.mean) / spread.deviation);
        above.fold(f64::NEG_INFINITY, f64::max)
    };
    let mut worst: Vec<f64> = rows.iter().map(worst).collect();
    worst.sort_by(|a, b| b.total_cmp(a));
    let k = worst[(ALARMS * worst.len() as f64) as usize];
    let band = |sensor: usize| {
        let Spread { mean, deviation } = spreads[sensor];
        let sizes = of_pool(sensor);
        let limit = mean + k * deviation;
        Band {
            sensor: data.sensors[sensor].clone(),
            half_width: limit.exp(),
            records: sizes.len() as u64,
            exceeded: sizes.iter().filter(|size| **size > limit).count() as u64,
        }
    };
    Some(sensors.clone().map(band).collect())
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
