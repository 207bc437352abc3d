//! CART, trained: one decision tree.

use super::Classifier;
use crate::error::Error;
use crate::tree::Tree;

/// The trained model is the tree.
pub type Model = Tree;

impl Classifier for Tree {
    fn features(&self) -> usize {
        Tree::features(self)
    }

    fn classes(&self) -> usize {
        Tree::classes(self)
    }

    /// The class shares in the leaf. With a cost matrix the decided class may have a smaller share
    /// than another.
    fn scores_into(&self, row: &[f64], scores: &mut [f64]) {
        self.shares_into(row, scores);
    }

    fn predict_with(&self, row: &[f64], _scratch: &mut [f64]) -> u32 {
        self.predict_row(row)
    }

    /// Walks to the leaf; does not allocate.
    fn predict_row(&self, row: &[f64]) -> u32 {
        self.decision(self.branches().leaf_of(row))
    }

    fn check(&self) -> Result<(), Error> {
        Tree::check(self)
    }
}
