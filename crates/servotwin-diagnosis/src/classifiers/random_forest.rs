//! Random forest: many trees, each grown on a bootstrap of the rows with features drawn anew at
//! every split; the mean of their class shares decides.
//!
//! Source: Breiman, "Random Forests", Machine Learning 45, 2001; shares are averaged (not voted)
//! as in scikit-learn's `RandomForestClassifier`.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::{Classifier, Fit};
use crate::data::Samples;
use crate::error::{Error, require, same_length};
use crate::random::Random;
use crate::tree::{Branches, Criterion, Growth, Presorted, Rules, Tree, grow};

/// How many features are drawn for each split.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DrawnFeatures {
    /// The square root of their number, rounded down, at least 1.
    #[default]
    Sqrt,
    /// All: bagged trees.
    All,
    /// So many, at least 1, at most all.
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
    /// Largest number of questions above a leaf; `None` for no limit.
    pub max_depth: Option<usize>,
    /// A node with fewer different rows is not split; at least 2.
    pub min_samples_split: usize,
    /// Both sides of a split need so many different rows; at least 1.
    pub min_samples_leaf: usize,
    /// How many features are drawn for each split.
    pub drawn_features: DrawnFeatures,
    /// Whether each tree draws its rows with replacement; otherwise it takes all.
    pub bootstrap: bool,
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
    fn rules(&self, samples: &Samples) -> Result<Rules, Error> {
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
        Ok(Rules {
            criterion: self.criterion,
            max_depth: self.max_depth.unwrap_or(usize::MAX),
            min_rows_split: split,
            min_rows_leaf: leaf,
            min_impurity_decrease: 0.0,
            features: (0..features).collect(),
            drawn_features,
            limits: vec![],
            costs: None,
        })
    }

    /// How often each row was drawn, times its weight.
    fn drawn_weights(&self, samples: &Samples, random: &mut Random) -> Vec<f64> {
        if !self.bootstrap {
            return (0..samples.rows()).map(|row| samples.weight(row)).collect();
        }
        // Rows without weight are not there; one of the others is always drawn.
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

/// A trained random forest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    features: usize,
    classes: usize,
    trees: Vec<VotingTree>,
}

/// A tree with the class shares of its leaves, leaving out zeros.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct VotingTree {
    branches: Branches,
    /// Where the shares of each node begin; one more entry for the end.
    starts: Vec<u32>,
    classes: Vec<u32>,
    shares: Vec<f64>,
}

impl VotingTree {
    fn new(tree: &Tree) -> Self {
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

    fn add_vote(&self, row: &[f64], factor: f64, scores: &mut [f64]) {
        let leaf = self.branches.leaf_of(row);
        let range = self.starts[leaf] as usize..self.starts[leaf + 1] as usize;
        for (&class, share) in self.classes[range.clone()].iter().zip(&self.shares[range]) {
            scores[class as usize] += factor * share;
        }
    }

    fn check(&self, features: usize, classes: usize) -> Result<(), Error> {
        self.branches.check(features)?;
        same_length("starts", self.branches.len() + 1, self.starts.len())?;
        same_length("shares", self.classes.len(), self.shares.len())?;
        let ascending = self.starts.windows(2).all(|pair| pair[0] <= pair[1]);
        let ends = self.starts[self.branches.len()] as usize == self.shares.len();
        let known = self.classes.iter().all(|&class| (class as usize) < classes);
        if ascending && ends && known {
            Ok(())
        } else {
            Err(Error::CorruptModel { broken: "leaf shares must be listed node by node" })
        }
    }
}

impl Model {
    /// The questions of all trees as (feature, threshold).
    pub fn splits(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.trees.iter().flat_map(|tree| tree.branches.splits())
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
        let presorted = &Presorted::with_ranks(samples);
        let one_tree = |place| {
            let mut random = Random::stream(self.seed, place as u64);
            let weights = &self.drawn_weights(samples, &mut random);
            let growth = Growth { samples, weights, impurity_weights: weights, rules: &rules };
            VotingTree::new(&grow(&growth, presorted, &mut random))
        };
        Ok(Model {
            features: samples.features(),
            classes: samples.classes(),
            trees: (0..self.trees).map(one_tree).collect(),
        })
    }
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

    fn scores_into(&self, row: &[f64], scores: &mut [f64]) {
        scores.fill(0.0);
        let factor = 1.0 / self.trees.len() as f64;
        for tree in &self.trees {
            tree.add_vote(row, factor, scores);
        }
    }

    fn check(&self) -> Result<(), Error> {
        if self.trees.is_empty() {
            return Err(Error::CorruptModel { broken: "a forest has trees" });
        }
        self.trees.iter().try_for_each(|tree| tree.check(self.features, self.classes))
    }
}
