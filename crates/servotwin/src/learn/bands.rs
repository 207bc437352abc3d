//! Bands learned from healthy specimens, one for each kind of sensor.
//!
//! The seed paper compares every scaled residual with one band of ±3 % (its equation (4)). Sensors differ: due to
//! tolerances, a spool exceeds 3 % without any fault, while a supply pressure stays far below it. The largest residual
//! x of a healthy record varies with specimen and command, nearly log-normally. With mean m and deviation s of ln x for
//! each kind of sensor (pooled over like sensors of all actuators), the learned band is
//!
//! ```text
//! b = exp(m + k s)
//! ```
//!
//! where k is common to all sensors. It is the smallest k with which at most a share ([`ALARMS`], `SPECIMEN_ALARMS`) of the
//! healthy training records leave any band. The guarantee covers the false alarms of all sensors together, without assumptions about their
//! correlation. It holds for flights like those of training.
//!
//! Two rules keep a few unusual records from widening every band. Records that began without a steady state are
//! excluded. And no band is wider than [`MAX_OVER_LARGEST`] times the largest residual of the other records.

use super::data_set::{DataRow, DataSet};
use crate::study::Purpose;
use serde::{Deserialize, Serialize};

/// Share of the healthy training records that may leave a band.
pub const ALARMS: f64 = 0.015;

/// The share in flight where specimens differ from their twin: plants of another structure differ more than those of
/// training. With 0.9 %, one of 2,400 healthy flights of such plants ended with a shutdown.
pub(crate) const SPECIMEN_ALARMS: f64 = 0.005;

/// The largest width of a band, relative to the largest residual it was learned from.
pub const MAX_OVER_LARGEST: f64 = 2.0;

/// The band of a sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Band {
    /// The sensor's name.
    pub sensor: String,
    /// Half width, as a fraction of the sensor's scale.
    pub half_width: f64,
    /// Number of healthy records it was learned from, with like sensors pooled.
    pub records: u64,
    /// Number of these records that leave it.
    pub exceeded: u64,
}

/// Mean and standard deviation of the logarithm of largest residuals.
#[derive(Clone, Copy)]
struct Spread {
    mean: f64,
    deviation: f64,
}

/// Learns the bands; like sensors have the same `pools[i]`, and the share `alarms` of the healthy records may leave one.
/// `None` without healthy specimens.
pub fn learn(data: &DataSet, pools: &[usize], alarms: f64) -> Option<Vec<Band>> {
    let teaches = |row: &DataRow| row.is_healthy && row.moved == 0 && !row.began_on_the_move;
    let rows = data.rows_where(Purpose::Train, teaches);
    if rows.len() < 2 || data.sensors.is_empty() || pools.len() < data.sensors.len() {
        return None;
    }
    let largest: Vec<&[f64]> = rows.iter().map(|&row| data.rows[row].largest.as_slice()).collect();
    let sizes = half_widths(&largest, pools, alarms)?.into_iter().enumerate();
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

/// The half width of every sensor's band, learned from the largest residuals of healthy records (one slice per record).
/// `None` for too few records.
pub fn half_widths(largest: &[&[f64]], pools: &[usize], alarms: f64) -> Option<Vec<f64>> {
    let count = largest.first()?.len();
    if largest.len() < 2 || count == 0 || pools.len() < count {
        return None;
    }
    let sensors = 0..count;
    let alike = |sensor: usize| sensors.clone().filter(move |&s| pools[s] == pools[sensor]);
    let logs = |sensor: usize| largest.iter().map(move |row| logarithm(row[sensor]));
    let of_pool = |sensor: usize| alike(sensor).flat_map(logs).collect::<Vec<f64>>();
    let spreads: Vec<Spread> = sensors.clone().map(|sensor| spread(&of_pool(sensor))).collect();
    // How many deviations the worst sensor of each record exceeds its mean.
    let worst = |row: &&[f64]| {
        let above = spreads.iter().zip(row.iter());
        let above = above.map(|(spread, size)| (logarithm(*size) - spread.mean) / spread.deviation);
        above.fold(f64::NEG_INFINITY, f64::max)
    };
    let mut worst: Vec<f64> = largest.iter().map(worst).collect();
    worst.sort_by(|a, b| b.total_cmp(a));
    let k = worst[(alarms * worst.len() as f64) as usize];
    let half_width = |sensor: usize| {
        let Spread { mean, deviation } = spreads[sensor];
        let largest = of_pool(sensor).into_iter().fold(f64::NEG_INFINITY, f64::max).exp();
        (mean + k * deviation).exp().min(MAX_OVER_LARGEST * largest)
    };
    Some(sensors.clone().map(half_width).collect())
}

/// Smaller residuals are below the error of a simulation.
fn logarithm(size: f64) -> f64 {
    size.max(1e-4).ln()
}

fn spread(logs: &[f64]) -> Spread {
    /// Minimum deviation, for nearly identical records.
    const LEAST: f64 = 0.01;
    let n = logs.len() as f64;
    let mean = logs.iter().sum::<f64>() / n;
    let variance = logs.iter().map(|log| (log - mean).powi(2)).sum::<f64>() / (n - 1.0);
    Spread { mean, deviation: variance.sqrt().max(LEAST) }
}
