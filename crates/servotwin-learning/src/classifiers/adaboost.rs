//! AdaBoost for several classes (SAMME). Trees follow one another, and each gives more weight to rows that earlier ones
//! missed. A weighted vote decides.
//!
//! Source: Zhu, Zou, Rosset, Hastie, "Multi-class AdaBoost", Statistics and Its Interface 2, 2009. The rows are
//! weighted, not resampled by weight, so nothing is random.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::Fit;
use crate::samples::{PresentClasses, Samples};
use crate::tree::{Criterion, Growth, Presorted, SplitRules, grow};
use servotwin_diagnosis::classifiers::Classifier;
use servotwin_diagnosis::classifiers::adaboost::{Model, WeightedTree};
use servotwin_diagnosis::error::{Error, require};
use servotwin_diagnosis::random::Random;
use servotwin_diagnosis::tree::Tree;

/// Settings of AdaBoost.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Maximum number of rounds, each of which adds a tree; at least 1.
    pub(crate) rounds: usize,
    /// Depth of each tree; at least 1. `None` for the smallest depth with a leaf for every class: 1 for two classes, 4
    /// for thirteen. A tree without leaves for most classes is hardly better than chance, and so are many of them.
    pub max_depth: Option<usize>,
    /// Factor on the vote of each tree; above 0.
    pub learning_rate: f64,
    /// Impurity measure.
    pub criterion: Criterion,
}

impl Default for Settings {
    fn default() -> Self {
        Settings { rounds: 50, max_depth: None, learning_rate: 1.0, criterion: Criterion::Gini }
    }
}

impl Settings {
    fn rules(&self, samples: &Samples) -> Result<SplitRules, Error> {
        let rate = self.learning_rate;
        require(self.rounds >= 1, "rounds", self.rounds as f64, ">= 1")?;
        let classes = PresentClasses::new(samples).len();
        let max_depth =
            self.max_depth.unwrap_or(classes.next_power_of_two().ilog2().max(1) as usize);
        require(max_depth >= 1, "max_depth", max_depth as f64, ">= 1")?;
        require(rate.is_finite() && rate > 0.0, "learning_rate", rate, "> 0")?;
        Ok(SplitRules {
            criterion: self.criterion,
            max_depth,
            min_rows_split: 2,
            min_rows_leaf: 1,
            min_impurity_decrease: 0.0,
            drawn_features: samples.features(),
        })
    }
}

fn weighted(tree: &Tree, weight: f64) -> WeightedTree {
    let decisions = (0..tree.nodes()).map(|node| tree.decision(node)).collect();
    WeightedTree { weight, branches: tree.branches().clone(), decisions }
}

impl Fit for Settings {
    type Model = Model;

    fn fit(&self, samples: &Samples) -> Result<Model, Error> {
        let rules = self.rules(samples)?;
        let presorted = &Presorted::new(samples);
        let classes = PresentClasses::new(samples).len();
        let mut weights: Vec<f64> = (0..samples.rows()).map(|row| samples.weight(row)).collect();
        let mut trees: Vec<WeightedTree> = vec![];
        while trees.len() < self.rounds {
            normalise(&mut weights);
            let growth = Growth { samples, weights: &weights, rules: &rules };
            let tree = grow(&growth, presorted, &mut Random::new(0));
            let missed = missed_rows(&tree, samples);
            let error = weights.iter().zip(&missed).filter(|(_, missed)| **missed);
            let error: f64 = error.map(|(weight, _)| weight).sum();
            let useless = error >= 1.0 - 1.0 / classes as f64;
            if useless && !trees.is_empty() {
                break;
            }
            if useless || error <= f64::EPSILON {
                // No errors remain to learn from: this tree has an ordinary vote and is the last.
                trees.push(weighted(&tree, 1.0));
                break;
            }
            let odds = libm::log((1.0 - error) / error) + libm::log(classes as f64 - 1.0);
            let vote = self.learning_rate * odds;
            trees.push(weighted(&tree, vote));
            let factor = libm::exp(vote);
            let both = weights.iter_mut().zip(&missed).filter(|(_, missed)| **missed);
            both.for_each(|(weight, _)| *weight *= factor);
        }
        let total: f64 = trees.iter().map(|tree| tree.weight).sum();
        trees.iter_mut().for_each(|tree| tree.weight /= total);
        Ok(Model { features: samples.features(), classes: samples.classes(), trees })
    }
}

fn normalise(weights: &mut [f64]) {
    let total: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|weight| *weight /= total);
}

/// For each row, whether the tree decides wrongly.
fn missed_rows(tree: &Tree, samples: &Samples) -> Vec<bool> {
    let mut row_values = vec![0.0; samples.features()];
    let missed = |(row, &label): (usize, &u32)| {
        samples.row_into(row, &mut row_values);
        tree.predict_row(&row_values) != label
    };
    samples.labels().iter().enumerate().map(missed).collect()
}
