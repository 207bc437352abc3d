//! Whether a row of features is like anything that was trained on.
//!
//! ```text
//! e_j   = max(low_j − x_j, x_j − high_j, 0)/(high_j − low_j)
//! score = Σ_j min(e_j, 1)/limit
//! ```
//!
//! with low and high the range that feature j had in the training rows of the class that was decided.
//! The sum says how many features lie outside, each counting for one at most. The limit is a quantile
//! of the same sum over training rows that had no part in the ranges: these are learnt from one half
//! of the groups and the sums taken over the other, and the other way round. A row with a score above
//! 1 is *unknown*: of known rows it is only one in 1/(1 − quantile).
//!
//! Classes are healthy and the commands; a fault is looked at in the view of its actuator, so like
//! actuators share what was learnt.

use crate::error::Error;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// The share of known rows that may be called unknown.
pub const QUANTILE: f64 = 0.999;

/// What each class looked like in training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Novelty {
    /// The share of known rows with a score of at most 1.
    pub quantile: f64,
    /// Healthy, then the commands; a class without rows knows nothing and calls nothing unknown.
    pub classes: Vec<Known>,
}

/// What a class looked like.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Known {
    /// The least value of each feature.
    pub lows: Vec<f64>,
    /// The largest.
    pub highs: Vec<f64>,
    /// What a feature's distance from its range is measured in.
    pub widths: Vec<f64>,
    /// The sum of distances that is still known.
    pub limit: f64,
}

impl Novelty {
    /// Knows nothing, so nothing is unknown to it.
    pub fn none() -> Self {
        Novelty { quantile: QUANTILE, classes: Vec::new() }
    }

    /// How far a row is from what a class looked like, in parts of what is still known. The row is
    /// in the view of the actuator; the class is `None` for healthy, or the command. Does not
    /// allocate.
    pub fn score(&self, action: Option<u32>, row: &[f64]) -> f64 {
        let class = action.map_or(0, |action| action as usize + 1);
        self.classes.get(class).map_or(0.0, |known| known.distance(row) / known.limit)
    }

    /// Checks that the parts fit so many commands and features.
    ///
    /// # Errors
    /// [`Error::CorruptModel`].
    pub fn check(&self, actions: usize, features: usize) -> Result<(), Error> {
        let fits = |known: &Known| {
            let lists = [&known.lows, &known.highs, &known.widths];
            let whole =
                lists.iter().all(|l| l.is_empty()) || lists.iter().all(|l| l.len() == features);
            let finite = lists.iter().all(|list| list.iter().all(|value| value.is_finite()));
            whole && finite && known.widths.iter().all(|&w| w > 0.0) && known.limit > 0.0
        };
        let count = self.classes.is_empty() || self.classes.len() == actions + 1;
        let sound = self.quantile > 0.0 && self.quantile < 1.0;
        if count && sound && self.classes.iter().all(fits) {
            Ok(())
        } else {
            Err(Error::CorruptModel { broken: "what is known of the classes does not fit them" })
        }
    }
}

impl Known {
    /// How many features lie outside their range, each counting for one at most. What is no number
    /// is outside.
    pub fn distance(&self, row: &[f64]) -> f64 {
        let ranges = self.lows.iter().zip(&self.highs).zip(&self.widths);
        let outside = |(((low, high), width), x): (((&f64, &f64), &f64), &f64)| {
            let inside = *x >= *low && *x <= *high;
            let excess = if *x > *high { x - high } else { low - x };
            if inside { 0.0 } else { (excess / width).min(1.0) }
        };
        ranges.zip(row).map(outside).sum()
    }
}
