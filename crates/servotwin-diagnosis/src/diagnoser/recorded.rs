//! What a diagnoser of recordings needs to know of its records: without a map and a study's system, it computes the
//! nominal values of a log by itself.

use alloc::collections::BTreeMap;
use alloc::string::String;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// The study of recordings that taught a diagnoser, with what it learned besides.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recorded {
    /// The text of the study.
    pub study: String,
    /// The text of the twin's system, if there is a twin.
    pub system: Option<String>,
    /// The learned nominal values.
    pub nominals: Nominals,
}

/// For each sensor, one nominal value for each combination of the values of the study's conditions; `None` for a sensor
/// with a nominal column.
pub type Nominals = Vec<Option<BTreeMap<String, Nominal>>>;

/// A nominal value that depends linearly on some inputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Nominal {
    /// The value at the means of the inputs.
    pub offset: f64,
    /// The mean of each input.
    pub means: Vec<f64>,
    /// The change with each input.
    pub slopes: Vec<f64>,
    /// Standard deviation of measured minus nominal over the healthy rows.
    pub deviation: f64,
    /// Standard deviation of the measured signal over the same rows.
    pub spread: f64,
    /// Number of healthy rows it was learned from.
    pub rows: u64,
}

impl Nominal {
    /// The nominal value for given inputs.
    pub fn at(&self, inputs: &[f64]) -> f64 {
        let terms = self.slopes.iter().zip(&self.means).zip(inputs);
        self.offset + terms.map(|((slope, mean), input)| slope * (input - mean)).sum::<f64>()
    }
}
