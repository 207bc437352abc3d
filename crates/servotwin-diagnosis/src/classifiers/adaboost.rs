//! AdaBoost, trained: a weighted vote of trees.

use super::{Classifier, sizes};
use crate::error::{Error, require_sound, same_length};
use crate::tree::Branches;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// A trained AdaBoost model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// Number of features in a row.
    pub features: usize,
    /// Number of classes.
    pub classes: usize,
    /// The trees; at least one.
    pub trees: Vec<WeightedTree>,
}

/// A tree with the weight of its vote; the weights of all trees sum to 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WeightedTree {
    /// The weight of its vote.
    pub weight: f64,
    /// The tests of the tree.
    pub branches: Branches,
    /// The class decided at each node.
    pub decisions: Vec<u32>,
}

impl Classifier for Model {
    sizes!();

    /// The shares of the votes.
    fn scores_into(&self, row: &[f64], scores: &mut [f64]) {
        scores.fill(0.0);
        for tree in &self.trees {
            scores[tree.decisions[tree.branches.leaf_of(row)] as usize] += tree.weight;
        }
    }

    fn check(&self) -> Result<(), Error> {
        require_sound(!self.trees.is_empty(), "a boosted model has trees")?;
        for tree in &self.trees {
            tree.branches.check(self.features)?;
            same_length("decisions", tree.branches.node_count(), tree.decisions.len())?;
            let known = tree.decisions.iter().all(|&class| (class as usize) < self.classes);
            require_sound(known, "trees must decide known classes")?;
        }
        Ok(())
    }
}
