//! Bands learned from healthy specimens, one for each kind of sensor.
//!
//! The seed paper compares every scaled residual with one band of ±3 % (its equation (4)). Sensors differ: with
//! manufacturing tolerances a spool exceeds 3 % without a fault, and a supply pressure never comes near it. The largest
//! residual x of a healthy record is nearly log-normal over specimens and commands. Each kind of sensor has a mean m
//! and a standard deviation s of ln x, pooled over like sensors of all actuators. Its learned band is
//!
//! ```text
//! b = exp(m + k s)
//! ```
//!
//! All sensors share one k, chosen so that at most [`ALARMS`] of the healthy training records leave any band. This
//! bounds the false alarm rate of all sensors together without assumptions on their correlation. It holds for flights
//! like those of training.
//!
//! Two rules keep a few outliers from widening every band. Records that began without a steady state are excluded. No
//! band is wider than [`MAX_OVER_LARGEST`] times the largest residual of the other records.

use super::data_set::{DataSet, Row};
use crate::study::Role;
use serde::{Deserialize, Serialize};

/// Share of the healthy training records that may leave a band.
pub const ALARMS: f64 = 0.015;

/// Maximum width of a band relative to the largest residual in its training records.
pub const MAX_OVER_LARGEST: f64 = 2.0;

/// The band of a sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Band {
    /// Name of the sensor.
    pub sensor: String,
    /// Half width, in parts of scale.
    pub half_width: f64,
    /// Number of healthy training records, pooled over like sensors.
    pub records: u64,
    /// Number of those records that leave the band.
    pub exceeded: u64,
}

/// Mean and standard deviation of the logarithm of the largest residuals.
#[derive(Clone, Copy)]
struct Spread {
    mean: f64,
    deviation: f64,
}

/// Learns the bands; `pools[i]` is equal for like sensors. Returns `None` with fewer than two usable healthy rows,
/// without sensors, or with too few `pools`.
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

/// The band half width of every sensor, learned from the largest residuals of healthy records, row by row. Returns
/// `None` for fewer than two records.
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
    // How many standard deviations the worst sensor of each record is above its mean.
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

/// ln of a size, floored at 1e-4, the error of a simulation.
fn logarithm(size: f64) -> f64 {
    size.max(1e-4).ln()
}

fn spread(logs: &[f64]) -> Spread {
    /// Floor of the deviation, for records that are all alike.
    const LEAST: f64 = 0.01;
    let n = logs.len() as f64;
    let mean = logs.iter().sum::<f64>() / n;
    let variance = logs.iter().map(|log| (log - mean).powi(2)).sum::<f64>() / (n - 1.0);
    Spread { mean, deviation: variance.sqrt().max(LEAST) }
}
