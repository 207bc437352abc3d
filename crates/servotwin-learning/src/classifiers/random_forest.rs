//! Random forest: each tree grows on a bootstrap of the rows, with features drawn at every split. The mean of the class
//! shares decides.
//!
//! Source: Breiman, "Random Forests", Machine Learning 45, 2001. Shares are averaged instead of voted on, as in
//! scikit-learn's `RandomForestClassifier`.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::Fit;
use crate::samples::Samples;
use crate::tree::{Criterion, Growth, Presorted, SplitRules, grow};
use servotwin_diagnosis::classifiers::random_forest::{Model, VotingTree};
use servotwin_diagnosis::error::{Error, require};
use servotwin_diagnosis::random::Random;
use servotwin_diagnosis::tree::Tree;

/// Number of features drawn for each split.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum DrawnFeatures {
    /// The square root of their number, rounded down, at least 1.
    #[default]
    Sqrt,
    /// All: bagged trees.
    All,
    /// This many, at least 1, at most all.
    Count(usize),
}

/// Settings of a random forest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Number of trees; at least 1.
    pub trees: usize,
    /// Impurity measure.
    pub criterion: Criterion,
    /// Maximum number of tests above a leaf; `None` for no limit.
    pub max_depth: Option<usize>,
    /// A node with fewer different rows is not split; at least 2.
    pub min_samples_split: usize,
    /// Minimum number of different rows on both sides of a split; at least 1.
    pub min_samples_leaf: usize,
    /// Number of features drawn for each split.
    pub(crate) drawn_features: DrawnFeatures,
    /// Whether each tree draws its rows with replacement; otherwise it takes all.
    pub(crate) bootstrap: bool,
    /// Seed; each tree has its own stream.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            trees: 100,
            criterion: Criterion::Gini,
            max_depth: None,
            min_samples_split: 2,
            min_samples_leaf: 1,
            drawn_features: DrawnFeatures::Sqrt,
            bootstrap: true,
            seed: 0,
        }
    }
}

impl Settings {
    fn rules(&self, samples: &Samples) -> Result<SplitRules, Error> {
        require(self.trees >= 1, "trees", self.trees as f64, ">= 1")?;
        let (split, leaf) = (self.min_samples_split, self.min_samples_leaf);
        require(split >= 2, "min_samples_split", split as f64, ">= 2")?;
        require(leaf >= 1, "min_samples_leaf", leaf as f64, ">= 1")?;
        let features = samples.features();
        let drawn_features = match self.drawn_features {
            DrawnFeatures::Sqrt => features.isqrt().max(1),
            DrawnFeatures::All => features,
            DrawnFeatures::Count(count) => {
                require(count >= 1, "drawn_features", count as f64, ">= 1")?;
                count
            }
        };
        Ok(SplitRules {
            criterion: self.criterion,
            max_depth: self.max_depth.unwrap_or(usize::MAX),
            min_rows_split: split,
            min_rows_leaf: leaf,
            min_impurity_decrease: 0.0,
            drawn_features,
        })
    }

    /// How often each row was drawn, times its weight.
    fn drawn_weights(&self, samples: &Samples, random: &mut Random) -> Vec<f64> {
        if !self.bootstrap {
            return (0..samples.rows()).map(|row| samples.weight(row)).collect();
        }
        // Rows of zero weight are ignored; there is always another one to draw.
        let used: Vec<usize> =
            (0..samples.rows()).filter(|&row| samples.weight(row) > 0.0).collect();
        let mut weights = vec![0.0; samples.rows()];
        for _ in 0..used.len() {
            let row = used[random.index(used.len())];
            weights[row] += samples.weight(row);
        }
        weights
    }
}

/// A tree with the class shares of its leaves.
fn voting(tree: &Tree) -> VotingTree {
    let mut voting = VotingTree {
        branches: tree.branches().clone(),
        starts: vec![0],
        classes: vec![],
        shares: vec![],
    };
    for node in 0..tree.nodes() {
        if tree.split(node).is_none() {
            let weights = tree.weights(node);
            let total: f64 = weights.iter().sum();
            for (class, weight) in (0..).zip(weights).filter(|(_, weight)| **weight > 0.0) {
                voting.classes.push(class);
                voting.shares.push(weight / total);
            }
        }
        voting.starts.push(voting.classes.len() as u32);
    }
    voting
}

impl Fit for Settings {
    type Model = Model;

    fn fit(&self, samples: &Samples) -> Result<Model, Error> {
        let rules = self.rules(samples)?;
        let presorted = &Presorted::with_ranks(samples);
        let one_tree = |place| {
            let mut random = Random::stream(self.seed, place as u64);
            let weights = &self.drawn_weights(samples, &mut random);
            let growth = Growth { samples, weights, rules: &rules };
            voting(&grow(&growth, presorted, &mut random))
        };
        Ok(Model {
            features: samples.features(),
            classes: samples.classes(),
            trees: (0..self.trees).map(one_tree).collect(),
        })
    }
}
