//! Bands learned from healthy specimens, one for each kind of sensor.
//!
//! The seed paper holds every scaled residual against one band of ±3 % (its equation (4)). Sensors
//! differ: where specimens differ by their tolerances a spool leaves 3 % without any fault, and a
//! supply pressure never comes near it. A learned band is the largest residual that any healthy
//! specimen of the training commands showed. Of n exchangeable specimens a new one exceeds the largest
//! with probability 1/(n + 1), whatever the distribution; and with 95 % confidence the share of
//! specimens that exceed it is at most 1 − 0.05^(1/n) (Wilks, Annals of Mathematical Statistics 12,
//! 1941). Like sensors of several actuators are pooled.

use super::data_set::DataSet;
use crate::study::Role;
use serde::{Deserialize, Serialize};

/// The band of a sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Band {
    /// The sensor.
    pub sensor: String,
    /// Half width, in parts of scale.
    pub half_width: f64,
    /// Healthy records from which it was learned, like sensors pooled.
    pub records: u64,
    /// With 95 % confidence at most this share of healthy records exceeds it.
    pub exceeded_at_most: f64,
}

/// Learns the bands; `pools[i]` is the same for sensors that are alike. `None` without healthy
/// specimens to learn from.
pub fn learn(data: &DataSet, pools: &[usize]) -> Option<Vec<Band>> {
    let rows = data.rows_where(Role::Training, |row| row.is_healthy && !row.is_moved);
    if rows.is_empty() || data.sensors.is_empty() || pools.len() < data.sensors.len() {
        return None;
    }
    let band = |sensor: usize| {
        let alike = (0..data.sensors.len()).filter(|&other| pools[other] == pools[sensor]);
        let alike: Vec<usize> = alike.collect();
        let records = (alike.len() * rows.len()) as u64;
        let sizes = rows.iter().flat_map(|&row| alike.iter().map(move |&s| (row, s)));
        let largest = sizes.map(|(row, s)| data.rows[row].largest[s]).fold(0.0, f64::max);
        Band {
            sensor: data.sensors[sensor].clone(),
            half_width: largest,
            records,
            exceeded_at_most: 1.0 - 0.05_f64.powf(1.0 / records as f64),
        }
    };
    Some((0..data.sensors.len()).map(band).collect())
}
