//! A random forest, trained: the mean of the trees' class shares decides.

use super::{Classifier, sizes};
use crate::error::{Error, require_sound, same_length};
use crate::tree::Branches;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// A trained random forest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// Number of features in a row.
    pub features: usize,
    /// Number of classes.
    pub classes: usize,
    /// The trees; at least one.
    pub trees: Vec<VotingTree>,
}

/// A tree with the nonzero class shares of its leaves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VotingTree {
    /// The tests of the tree.
    pub branches: Branches,
    /// Start of each node's shares, plus one entry for the end.
    pub starts: Vec<u32>,
    /// The classes of all leaves, node by node.
    pub classes: Vec<u32>,
    /// Their shares.
    pub shares: Vec<f64>,
}

impl VotingTree {
    fn add_vote(&self, row: &[f64], factor: f64, scores: &mut [f64]) {
        let leaf = self.branches.leaf_of(row);
        let range = self.starts[leaf] as usize..self.starts[leaf + 1] as usize;
        for (&class, share) in self.classes[range.clone()].iter().zip(&self.shares[range]) {
            scores[class as usize] += factor * share;
        }
    }

    fn check(&self, features: usize, classes: usize) -> Result<(), Error> {
        self.branches.check(features)?;
        same_length("starts", self.branches.node_count() + 1, self.starts.len())?;
        same_length("shares", self.classes.len(), self.shares.len())?;
        let ascending = self.starts.windows(2).all(|pair| pair[0] <= pair[1]);
        let ends = self.starts[self.branches.node_count()] as usize == self.shares.len();
        let known = self.classes.iter().all(|&class| (class as usize) < classes);
        require_sound(ascending && ends && known, "leaf shares must be listed node by node")
    }
}

impl Classifier for Model {
    sizes!();

    fn scores_into(&self, row: &[f64], scores: &mut [f64]) {
        scores.fill(0.0);
        let factor = 1.0 / self.trees.len() as f64;
        for tree in &self.trees {
            tree.add_vote(row, factor, scores);
        }
    }

    fn check(&self) -> Result<(), Error> {
        require_sound(!self.trees.is_empty(), "a forest has trees")?;
        self.trees.iter().try_for_each(|tree| tree.check(self.features, self.classes))
    }
}
