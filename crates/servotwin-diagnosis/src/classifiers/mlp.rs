//! A multi-layer perceptron, trained: one hidden layer of rectifiers and a softmax output.

use super::Classifier;
use crate::error::{Error, same_length};
use crate::numeric::{add_scaled, dot, softmax};
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// The sizes of a network.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shape {
    /// Number of features in a row.
    pub features: usize,
    /// Number of hidden units.
    pub hidden: usize,
    /// Number of classes.
    pub classes: usize,
}

/// A trained multi-layer perceptron.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// The sizes.
    pub shape: Shape,
    /// Hidden unit-major: one weight per feature, including the standardization.
    pub hidden_weights: Vec<f64>,
    /// The intercept of each hidden unit.
    pub hidden_intercepts: Vec<f64>,
    /// Hidden unit-major: one weight per class; the intercepts follow at the end.
    pub output_weights: Vec<f64>,
    /// Number of training passes over the rows.
    pub epochs: usize,
    /// Mean loss of the last pass.
    pub loss: f64,
}

impl Classifier for Model {
    fn features(&self) -> usize {
        self.shape.features
    }

    fn classes(&self) -> usize {
        self.shape.classes
    }

    fn scores_into(&self, row: &[f64], scores: &mut [f64]) {
        let Shape { features, hidden, classes } = self.shape;
        let row = &row[..features];
        let (weights, intercepts) = self.output_weights.split_at(hidden * classes);
        scores.copy_from_slice(intercepts);
        let units = self.hidden_weights.chunks_exact(features).zip(&self.hidden_intercepts);
        for ((inner, intercept), outer) in units.zip(weights.chunks_exact(classes)) {
            let unit = dot(inner, row) + intercept;
            if unit > 0.0 {
                add_scaled(scores, unit, outer);
            }
        }
        softmax(scores);
    }

    fn check(&self) -> Result<(), Error> {
        let Shape { features, hidden, classes } = self.shape;
        same_length("hidden weights", features * hidden, self.hidden_weights.len())?;
        same_length("hidden intercepts", hidden, self.hidden_intercepts.len())?;
        same_length("output weights", (hidden + 1) * classes, self.output_weights.len())
    }
}
