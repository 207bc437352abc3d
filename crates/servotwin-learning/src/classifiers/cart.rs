//! CART: one decision tree, with guards against implausible splits.
//!
//! There are three additions to the textbook (Breiman et al. 1984). Features can be excluded by name. A feature can
//! have a resolution; a split below it is implausible and is reported instead of used ([`Tree::rejected`]). Wrong
//! decisions can have unequal costs. The limits and defaults of growth are those of scikit-learn's
//! `DecisionTreeClassifier`. Ties, however, go to the lowest feature and threshold instead of a random one.

use alloc::borrow::Cow;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::Fit;
use crate::samples::Samples;
use crate::tree::{
    Bins, Criterion, Growth, Presorted, SplitCosts, SplitLimits, SplitRules, grow, grow_binned,
    prune,
};
use servotwin_diagnosis::error::{Error, require, same_length};
use servotwin_diagnosis::random::Random;
use servotwin_diagnosis::tree::Tree;

/// The resolution of a feature.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Resolution {
    /// Name of the feature.
    pub feature: String,
    /// Minimum difference of the two adjacent values that a threshold separates. Adjacent values of dense data are
    /// always close, so keep it near the noise of a single value.
    pub gap: f64,
    /// Minimum distance of the threshold from zero. For residuals, zero means healthy, and a threshold below the
    /// sensor's resolution would decide about noise.
    pub magnitude: f64,
}

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
    /// Complexity cost per leaf for pruning after growth; 0 prunes nothing.
    pub ccp_alpha: f64,
    /// Names of features that splits must not use.
    pub excluded_features: Vec<String>,
    /// Resolutions of features; those not listed have none.
    pub resolutions: Vec<Resolution>,
    /// `costs[true class][decided class]`, classes × classes; `None` for equal costs.
    pub costs: Option<Vec<Vec<f64>>>,
    /// Whether costs also influence the splits, through altered priors. Otherwise they only decide the class of each
    /// leaf.
    pub costs_alter_priors: bool,
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
            ccp_alpha: 0.0,
            excluded_features: vec![],
            resolutions: vec![],
            costs: None,
            costs_alter_priors: false,
        }
    }
}

impl Settings {
    fn check(&self) -> Result<(), Error> {
        require(
            self.min_samples_split >= 2,
            "min_samples_split",
            self.min_samples_split as f64,
            ">= 2",
        )?;
        require(
            self.min_samples_leaf >= 1,
            "min_samples_leaf",
            self.min_samples_leaf as f64,
            ">= 1",
        )?;
        not_negative("min_impurity_decrease", self.min_impurity_decrease)?;
        let bins = self.max_bins.unwrap_or(2);
        require((2..=256).contains(&bins), "max_bins", bins as f64, "2 to 256")?;
        not_negative("ccp_alpha", self.ccp_alpha)
    }

    fn rules(&self, samples: &Samples) -> Result<SplitRules, Error> {
        let features = self.allowed_features(samples)?;
        Ok(SplitRules {
            criterion: self.criterion,
            max_depth: self.max_depth.unwrap_or(usize::MAX),
            min_rows_split: self.min_samples_split,
            min_rows_leaf: self.min_samples_leaf,
            min_impurity_decrease: self.min_impurity_decrease,
            drawn_features: features.len(),
            features,
            limits: self.limits(samples)?,
            costs: self.checked_costs(samples.classes())?,
        })
    }

    fn allowed_features(&self, samples: &Samples) -> Result<Vec<usize>, Error> {
        let mut allowed = vec![true; samples.features()];
        for name in &self.excluded_features {
            allowed[samples.feature_index(name)?] = false;
        }
        let features: Vec<usize> =
            (0..samples.features()).filter(|&feature| allowed[feature]).collect();
        if features.is_empty() { Err(Error::NoFeatures) } else { Ok(features) }
    }

    fn limits(&self, samples: &Samples) -> Result<Vec<SplitLimits>, Error> {
        if self.resolutions.is_empty() {
            return Ok(vec![]);
        }
        let mut limits = vec![SplitLimits::default(); samples.features()];
        for Resolution { feature, gap, magnitude } in &self.resolutions {
            not_negative("gap", *gap)?;
            not_negative("magnitude", *magnitude)?;
            limits[samples.feature_index(feature)?] =
                SplitLimits { gap: *gap, magnitude: *magnitude };
        }
        Ok(limits)
    }

    fn checked_costs(&self, classes: usize) -> Result<Option<SplitCosts>, Error> {
        let Some(costs) = &self.costs else {
            return Ok(None);
        };
        same_length("costs", classes, costs.len())?;
        for row in costs {
            same_length("costs", classes, row.len())?;
            for &cost in row {
                not_negative("costs", cost)?;
            }
        }
        Ok(Some(SplitCosts(costs.clone())))
    }

    /// The row weights for the impurity.
    fn impurity_weights<'a>(
        &self,
        samples: &Samples,
        weights: &'a [f64],
        costs: &Option<SplitCosts>,
    ) -> Result<Cow<'a, [f64]>, Error> {
        let Some(costs) = costs.as_ref().filter(|_| self.costs_alter_priors) else {
            return Ok(Cow::Borrowed(weights));
        };
        let factors = costs.prior_factors();
        for &factor in &factors {
            require(factor > 0.0, "costs", factor, "with altered priors each row sums to > 0")?;
        }
        let altered = weights.iter().zip(samples.labels());
        Ok(altered.map(|(weight, &label)| weight * factors[label as usize]).collect())
    }
}

fn not_negative(setting: &'static str, value: f64) -> Result<(), Error> {
    require(value.is_finite() && value >= 0.0, setting, value, ">= 0")
}

impl Fit for Settings {
    type Model = Tree;

    /// # Errors
    /// [`Error::SettingOutOfRange`], [`Error::UnknownFeature`] for a name in `excluded_features`
    /// or `resolutions`, [`Error::NoFeatures`] if all are excluded, [`Error::LengthMismatch`] if
    /// `costs` is not classes × classes.
    fn fit(&self, samples: &Samples) -> Result<Tree, Error> {
        self.check()?;
        let rules = self.rules(samples)?;
        let weights: Vec<f64> = (0..samples.rows()).map(|row| samples.weight(row)).collect();
        let impurity_weights = self.impurity_weights(samples, &weights, &rules.costs)?;
        let impurity_weights = &impurity_weights;
        let growth = Growth { samples, weights: &weights, impurity_weights, rules: &rules };
        let may_bin = growth.is_counted() && !samples.has_missing();
        let tree = match self.max_bins.filter(|_| may_bin) {
            Some(bins) => grow_binned(&growth, &Bins::new(samples, &growth.rows(), bins)),
            // Every split tries all features, so nothing is drawn.
            None => grow(&growth, &Presorted::new(samples), &mut Random::new(0)),
        };
        Ok(if self.ccp_alpha > 0.0 { prune(&tree, self.ccp_alpha) } else { tree })
    }
}
