//! Gaussian naive Bayes, trained.
//!
//! `log p(k, x) = log π_k − ½ Σ_j [log(2π v_kj) + (x_j − m_kj)² / v_kj]`

use super::linear::check_labels;
use super::{Classifier, sizes};
use crate::error::{Error, same_length};
use crate::numeric::{arg_max, softmax};
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// A trained Gaussian naive Bayes model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// Number of features in a row.
    pub features: usize,
    /// Number of classes.
    pub classes: usize,
    /// Labels of the trained classes, ascending.
    pub labels: Vec<u32>,
    /// The part of the logarithm that does not depend on the features, for each trained class.
    pub constants: Vec<f64>,
    /// Trained class-major: mean of each feature.
    pub means: Vec<f64>,
    /// Trained class-major: ½ / variance of each feature.
    pub half_precisions: Vec<f64>,
}

impl Model {
    /// `log p(k, x)` of each trained class, in the order of `labels`.
    fn log_densities<'a>(&'a self, row: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        let means = self.means.chunks_exact(self.features);
        let precisions = self.half_precisions.chunks_exact(self.features);
        means.zip(precisions).zip(&self.constants).map(move |((means, precisions), constant)| {
            let terms = row.iter().zip(means).zip(precisions);
            constant - terms.map(|((x, mean), p)| (x - mean) * (x - mean) * p).sum::<f64>()
        })
    }
}

impl Classifier for Model {
    sizes!();

    fn scores_into(&self, row: &[f64], scores: &mut [f64]) {
        scores.fill(f64::NEG_INFINITY);
        for (label, density) in self.labels.iter().zip(self.log_densities(row)) {
            scores[*label as usize] = density;
        }
        softmax(scores);
    }

    /// Compares logarithms; takes no exponential.
    fn predict_with(&self, row: &[f64], _scratch: &mut [f64]) -> u32 {
        self.labels[arg_max(self.log_densities(row))]
    }

    fn check(&self) -> Result<(), Error> {
        check_labels(&self.labels, self.classes)?;
        same_length("constants", self.labels.len(), self.constants.len())?;
        same_length("means", self.labels.len() * self.features, self.means.len())?;
        same_length("precisions", self.means.len(), self.half_precisions.len())
    }
}
