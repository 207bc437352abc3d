//! Linear functions from weights for standardized features.

use alloc::vec;
use alloc::vec::Vec;

use crate::numeric::Standardiser;
use crate::samples::{PresentClasses, Samples};
use servotwin_diagnosis::classifiers::linear::LinearFunctions;
use servotwin_diagnosis::error::{Error, require};
use servotwin_diagnosis::numeric::dot;

/// Checks the rows and the settings of a linear classifier; returns the classes and the standardization.
///
/// # Errors
/// Missing values, settings outside their ranges.
pub(super) fn prepared(
    samples: &Samples,
    cost: f64,
    tolerance: f64,
    (name, passes): (&'static str, usize),
) -> Result<(PresentClasses, Standardiser), Error> {
    samples.complete()?;
    require(cost.is_finite() && cost > 0.0, "cost", cost, "> 0")?;
    require(tolerance > 0.0, "tolerance", tolerance, "> 0")?;
    require(passes >= 1, name, passes as f64, ">= 1")?;
    Ok((PresentClasses::new(samples), Standardiser::new(samples)))
}

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
