//! AdaBoost for several classes (SAMME): trees one after the other, each on rows weighted by how
//! often they were missed before; a weighted vote decides.
//!
//! Source: Zhu, Zou, Rosset, Hastie, "Multi-class AdaBoost", Statistics and Its Interface 2, 2009.
//! The rows are truly weighted, not drawn again by weight, so nothing is random.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::{Classifier, Fit};
use crate::data::{PresentClasses, Samples};
use crate::error::{Error, require, same_length};
use crate::random::Random;
use crate::tree::{Branches, Criterion, Growth, Presorted, Rules, Tree, grow};

/// Settings of AdaBoost.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Largest number of rounds, each of which adds a tree; at least 1.
    #[serde(alias = "trees")]
    pub rounds: usize,
    /// Depth of each tree; at least 1. `None` for the smallest depth whose leaves can name every
    /// class: 1 for two classes, 4 for thirteen. A tree that cannot name most classes is hardly
    /// better than chance, and so are many of them.
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
    fn rules(&self, samples: &Samples) -> Result<Rules, Error> {
        let rate = self.learning_rate;
        require(self.rounds >= 1, "rounds", self.rounds as f64, ">= 1")?;
        let classes = PresentClasses::new(samples).len();
        let max_depth =
            self.max_depth.unwrap_or(classes.next_power_of_two().ilog2().max(1) as usize);
        require(max_depth >= 1, "max_depth", max_depth as f64, ">= 1")?;
        require(rate.is_finite() && rate > 0.0, "learning_rate", rate, "> 0")?;
        Ok(Rules {
            criterion: self.criterion,
            max_depth,
            min_rows_split: 2,
            min_rows_leaf: 1,
            min_impurity_decrease: 0.0,
            features: (0..samples.features()).collect(),
            drawn_features: samples.features(),
            limits: vec![],
            costs: None,
        })
    }
}

/// A trained AdaBoost model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    features: usize,
    classes: usize,
    trees: Vec<WeightedTree>,
}

/// A tree with the weight of its vote; the weights of all trees sum to 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct WeightedTree {
    weight: f64,
    branches: Branches,
    /// The class decided at each node.
    decisions: Vec<u32>,
}

impl WeightedTree {
    fn new(tree: &Tree, weight: f64) -> Self {
        let decisions = (0..tree.nodes()).map(|node| tree.decision(node)).collect();
        WeightedTree { weight, branches: tree.branches().clone(), decisions }
    }
}

impl Model {
    /// The questions of all trees as (feature, threshold).
    pub fn splits(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.trees.iter().flat_map(|tree| tree.branches.splits())
    }

    /// Number of trees; fewer than asked for if one was perfect or useless.
    pub fn trees(&self) -> usize {
        self.trees.len()
    }

    /// Whether it was trained with rows without a value.
    pub fn knows_missing(&self) -> bool {
        self.trees.iter().any(|tree| tree.branches.knows_missing())
    }
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
            let growth =
                Growth { samples, weights: &weights, impurity_weights: &weights, rules: &rules };
            let tree = grow(&growth, presorted, &mut Random::new(0));
            let missed = missed_rows(&tree, samples);
            let error = weights.iter().zip(&missed).filter(|(_, missed)| **missed);
            let error: f64 = error.map(|(weight, _)| weight).sum();
            let useless = error >= 1.0 - 1.0 / classes as f64;
            if useless && !trees.is_empty() {
                break;
            }
            if useless || error <= f64::EPSILON {
                // Nothing is left to learn from: this tree has an ordinary vote and is the last.
                trees.push(WeightedTree::new(&tree, 1.0));
                break;
            }
            let odds = libm::log((1.0 - error) / error) + libm::log(classes as f64 - 1.0);
            let vote = self.learning_rate * odds;
            trees.push(WeightedTree::new(&tree, vote));
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

/// Whether the tree decides wrongly, for each row.
fn missed_rows(tree: &Tree, samples: &Samples) -> Vec<bool> {
    let mut row_values = vec![0.0; samples.features()];
    let missed = |(row, &label): (usize, &u32)| {
        samples.row_into(row, &mut row_values);
        tree.predict_row(&row_values) != label
    };
    samples.labels().iter().enumerate().map(missed).collect()
}

impl Classifier for Model {
    fn features(&self) -> usize {
        self.features
    }

    fn classes(&self) -> usize {
        self.classes
    }

    fn reads(&self, feature: usize) -> bool {
        self.trees.iter().any(|tree| tree.branches.reads(feature))
    }

    /// The shares of the votes.
    fn scores_into(&self, row: &[f64], scores: &mut [f64]) {
        scores.fill(0.0);
        for tree in &self.trees {
            scores[tree.decisions[tree.branches.leaf_of(row)] as usize] += tree.weight;
        }
    }

    fn check(&self) -> Result<(), Error> {
        if self.trees.is_empty() {
            return Err(Error::CorruptModel { broken: "a boosted model has trees" });
        }
        for tree in &self.trees {
            tree.branches.check(self.features)?;
            same_length("decisions", tree.branches.len(), tree.decisions.len())?;
            if tree.decisions.iter().any(|&class| class as usize >= self.classes) {
                return Err(Error::CorruptModel { broken: "trees must decide known classes" });
            }
        }
        Ok(())
    }
}
