//! Gradient-boosted trees, trained: each tree adds a number to the score of every class, and softmax turns the scores
//! into probabilities.

use super::{Classifier, sizes};
use crate::error::{Error, require_sound, same_length};
use crate::numeric::softmax;
use crate::tree::Branches;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// A trained model of gradient-boosted trees.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// Number of features in a row.
    pub features: usize,
    /// Number of classes.
    pub classes: usize,
    /// The classes with training rows, ascending.
    pub present: Vec<u32>,
    /// Initial score of each output: the logarithm of the class's share. With up to two classes, the first has none,
    /// because its score is always 0.
    pub priors: Vec<f64>,
    /// The trees; none if no feature varies or there is only one class.
    pub trees: Vec<AddingTree>,
}

/// A tree with its contribution to each output.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AddingTree {
    /// The tests of the tree.
    pub branches: Branches,
    /// Node-major contributions; 0 for inner nodes.
    pub values: Vec<f64>,
}

impl Model {
    /// The classes that the trees contribute to.
    pub fn outputs(&self) -> &[u32] {
        &self.present[self.present.len() - self.priors.len()..]
    }
}

impl Classifier for Model {
    sizes!();

    /// The probabilities; 0 for a class without training rows.
    fn scores_into(&self, row: &[f64], scores: &mut [f64]) {
        scores.fill(f64::NEG_INFINITY);
        self.present.iter().for_each(|&class| scores[class as usize] = 0.0);
        let outputs = self.outputs();
        for (&class, prior) in outputs.iter().zip(&self.priors) {
            scores[class as usize] = *prior;
        }
        for tree in &self.trees {
            let values = &tree.values[tree.branches.leaf_of(row) * outputs.len()..];
            for (&class, value) in outputs.iter().zip(values) {
                scores[class as usize] += value;
            }
        }
        softmax(scores);
    }

    fn check(&self) -> Result<(), Error> {
        let known = self.present.iter().all(|&class| (class as usize) < self.classes);
        let ascending = self.present.windows(2).all(|pair| pair[0] < pair[1]);
        let is_sound = known && ascending && !self.present.is_empty();
        require_sound(is_sound, "boosted trees must know ascending classes")?;
        let fixed = usize::from(self.present.len() <= 2);
        same_length("priors", self.present.len() - fixed, self.priors.len())?;
        for tree in &self.trees {
            tree.branches.check(self.features)?;
            let values = tree.branches.node_count() * self.priors.len();
            same_length("values of leaves", values, tree.values.len())?;
        }
        Ok(())
    }
}
