//! One linear function per class, the trained form of linear SVM, discriminant analysis and logistic regression.

use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use crate::error::{Error, require_sound, same_length};
use crate::numeric::{arg_max, dot, softmax};

/// `f_k(x) = w_k · x + b_k` for the trained classes; the largest wins.
///
/// The weights apply to unscaled features: they include the standardization.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinearFunctions {
    /// Number of features in a row.
    pub features: usize,
    /// Number of classes, including those without training rows.
    pub classes: usize,
    /// Labels of the trained classes, ascending.
    pub labels: Vec<u32>,
    /// Class-major: one weight per feature and trained class.
    pub weights: Vec<f64>,
    /// The intercept of each trained class.
    pub intercepts: Vec<f64>,
}

impl LinearFunctions {
    /// The weights of each trained class: (label, weights, intercept).
    pub(crate) fn functions(&self) -> impl Iterator<Item = (u32, &[f64], f64)> {
        let weights = self.weights.chunks_exact(self.features);
        self.labels.iter().zip(weights).zip(&self.intercepts).map(|((l, w), b)| (*l, w, *b))
    }

    /// The label with the largest value.
    pub(crate) fn predict(&self, row: &[f64]) -> u32 {
        let row = &row[..self.features];
        self.labels[arg_max(self.functions().map(|(_, weights, b)| dot(weights, row) + b))]
    }

    /// Writes the values; untrained classes get minus infinity.
    pub(crate) fn values_into(&self, row: &[f64], values: &mut [f64]) {
        let row = &row[..self.features];
        values.fill(f64::NEG_INFINITY);
        for (label, weights, intercept) in self.functions() {
            values[label as usize] = dot(weights, row) + intercept;
        }
    }

    /// Writes the values as probabilities, by the softmax.
    pub(crate) fn shares_into(&self, row: &[f64], shares: &mut [f64]) {
        self.values_into(row, shares);
        softmax(shares);
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        check_labels(&self.labels, self.classes)?;
        same_length("intercepts", self.labels.len(), self.intercepts.len())?;
        same_length("weights", self.labels.len() * self.features, self.weights.len())
    }
}

/// Checks the labels of the trained classes of a loaded model.
pub(crate) fn check_labels(labels: &[u32], classes: usize) -> Result<(), Error> {
    let known = !labels.is_empty() && labels.iter().all(|&label| (label as usize) < classes);
    require_sound(known, "labels must be known classes")
}
