//! CART: one decision tree.
//!
//! The limits and defaults of growth are those of scikit-learn's `DecisionTreeClassifier`. Ties, however, go to the
//! lowest feature and threshold instead of a random one.
//!
//! Source: Breiman, Friedman, Olshen, Stone, "Classification and Regression Trees", 1984.

use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::Fit;
use crate::samples::Samples;
use crate::tree::{Bins, Criterion, Growth, Presorted, SplitRules, grow, grow_binned};
use servotwin_diagnosis::error::{Error, require};
use servotwin_diagnosis::random::Random;
use servotwin_diagnosis::tree::Tree;

/// Settings of a CART tree.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Impurity measure.
    pub criterion: Criterion,
    /// Maximum number of tests above a leaf; `None` for no limit.
    pub max_depth: Option<usize>,
    /// A node with fewer rows is not split; at least 2.
    pub min_samples_split: usize,
    /// Minimum number of rows on both sides of a split; at least 1.
    pub min_samples_leaf: usize,
    /// Minimum impurity decrease of a split, weighted by the share of samples at the node.
    pub min_impurity_decrease: f64,
    /// Maximum number of bins of a feature's values, 2 to 256. Thresholds then lie between bins, which is much faster
    /// for many rows. `None` tries thresholds between all values. Rows with unequal weights or missing values are never
    /// binned.
    pub max_bins: Option<usize>,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            criterion: Criterion::Gini,
            max_depth: None,
            min_samples_split: 2,
            min_samples_leaf: 1,
            min_impurity_decrease: 0.0,
            max_bins: None,
        }
    }
}

impl Settings {
    fn rules(&self, samples: &Samples) -> Result<SplitRules, Error> {
        let (split, leaf) = (self.min_samples_split, self.min_samples_leaf);
        let (decrease, bins) = (self.min_impurity_decrease, self.max_bins.unwrap_or(2));
        require(split >= 2, "min_samples_split", split as f64, ">= 2")?;
        require(leaf >= 1, "min_samples_leaf", leaf as f64, ">= 1")?;
        let is_decrease = decrease.is_finite() && decrease >= 0.0;
        require(is_decrease, "min_impurity_decrease", decrease, ">= 0")?;
        require((2..=256).contains(&bins), "max_bins", bins as f64, "2 to 256")?;
        Ok(SplitRules {
            criterion: self.criterion,
            max_depth: self.max_depth.unwrap_or(usize::MAX),
            min_rows_split: split,
            min_rows_leaf: leaf,
            min_impurity_decrease: decrease,
            drawn_features: samples.features(),
        })
    }
}

impl Fit for Settings {
    type Model = Tree;

    fn fit(&self, samples: &Samples) -> Result<Tree, Error> {
        let rules = self.rules(samples)?;
        let weights: Vec<f64> = (0..samples.rows()).map(|row| samples.weight(row)).collect();
        let growth = Growth { samples, weights: &weights, rules: &rules };
        let may_bin = growth.is_counted() && !samples.has_missing();
        Ok(match self.max_bins.filter(|_| may_bin) {
            Some(bins) => grow_binned(&growth, &Bins::new(samples, &growth.rows(), bins)),
            // Every split tries all features, so nothing is drawn.
            None => grow(&growth, &Presorted::new(samples), &mut Random::new(0)),
        })
    }
}
