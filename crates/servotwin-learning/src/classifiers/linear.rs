//! Linear functions from weights for standardized features.

use alloc::vec;
use alloc::vec::Vec;

use crate::numeric::Standardiser;
use servotwin_diagnosis::classifiers::linear::LinearFunctions;
use servotwin_diagnosis::numeric::dot;

/// Folds the standardization into the weights, one row of `features` per label.
pub(super) fn from_standardised(
    classes: usize,
    labels: Vec<u32>,
    standardiser: &Standardiser,
    mut weights: Vec<f64>,
    mut intercepts: Vec<f64>,
) -> LinearFunctions {
    let features = standardiser.means.len();
    for (weights, intercept) in weights.chunks_exact_mut(features).zip(&mut intercepts) {
        for (weight, scale) in weights.iter_mut().zip(&standardiser.scales) {
            *weight *= scale;
        }
        *intercept -= dot(weights, &standardiser.means);
    }
    LinearFunctions { features, classes, labels, weights, intercepts }
}

/// Both functions of a two-class problem: the first is the negative of the second.
pub(super) fn mirrored(weights: Vec<f64>, intercept: f64) -> (Vec<f64>, Vec<f64>) {
    let mut both: Vec<f64> = weights.iter().map(|weight| -weight).collect();
    both.extend(weights);
    (both, vec![-intercept, intercept])
}
