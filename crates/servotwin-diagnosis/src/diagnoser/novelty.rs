//! Novelty: whether a row of features resembles the training data.
//!
//! ```text
//! e_j   = max(low_j − x_j, x_j − high_j, 0)/(high_j − low_j)
//! score = Σ_j min(e_j, 1)/limit
//! ```
//!
//! with low and high the range of feature j in the training rows of the chosen class. The sum counts the features
//! outside their range, each by at most one. The limit is a quantile of the same sum over held-out rows: the ranges
//! come from one half of the groups and the sums from the other, and vice versa. A row with a score above 1 is
//! *unknown*. The share of known rows above 1 is 1 − quantile.
//!
//! The classes are healthy and the actions. A fault is scored in the view of its actuator, so that identical actuators
//! share the learned ranges.

use super::tuning::Tuning;
use crate::error::{Error, require_sound};
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// The learned ranges of all classes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Novelty {
    /// The share of known rows with a score of at most 1.
    pub quantile: f64,
    /// Healthy, then the actions. A class without rows calls nothing unknown.
    pub classes: Vec<KnownRanges>,
}

/// The learned ranges of a class.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnownRanges {
    /// Smallest value of each feature.
    pub lows: Vec<f64>,
    /// Largest value of each feature.
    pub highs: Vec<f64>,
    /// Unit of each feature's distance from its range.
    pub widths: Vec<f64>,
    /// The largest sum of distances that counts as known.
    pub limit: f64,
}

impl Novelty {
    /// A novelty without classes, for which nothing is unknown.
    pub fn none() -> Self {
        Novelty { quantile: Tuning::default().known_share, classes: Vec::new() }
    }

    /// Distance of a row from the training data of a class, in parts of the limit. The row is in the actuator's view.
    /// The class is an action, or `None` for healthy. Does not allocate.
    pub fn score(&self, action: Option<u32>, row: &[f64]) -> f64 {
        let class = action.map_or(0, |action| action as usize + 1);
        self.classes.get(class).map_or(0.0, |known| known.distance(row) / known.limit)
    }

    /// Checks that the parts fit the numbers of actions and features.
    ///
    /// # Errors
    /// [`Error::CorruptModel`].
    pub fn check(&self, actions: usize, features: usize) -> Result<(), Error> {
        let fits = |known: &KnownRanges| {
            let lists = [&known.lows, &known.highs, &known.widths];
            let whole =
                lists.iter().all(|l| l.is_empty()) || lists.iter().all(|l| l.len() == features);
            let finite = lists.iter().all(|list| list.iter().all(|value| value.is_finite()));
            whole && finite && known.widths.iter().all(|&w| w > 0.0) && known.limit > 0.0
        };
        let count = self.classes.is_empty() || self.classes.len() == actions + 1;
        let sound = self.quantile > 0.0 && self.quantile < 1.0;
        let all_fit = count && sound && self.classes.iter().all(fits);
        require_sound(all_fit, "what is known of the classes does not fit them")
    }
}

impl KnownRanges {
    /// Sum of the distances outside the ranges, at most one for each feature. NaN counts as outside.
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
