//! Linear discriminant analysis: normal classes with one covariance, pooled within the classes.
//!
//! `f_k(x) = x · Σ⁻¹ m_k − ½ m_k · Σ⁻¹ m_k + log π_k`, solved by Cholesky on the within-class correlations (Hastie,
//! Tibshirani, Friedman, "The Elements of Statistical Learning", 2009, section 4.3). If the correlations are singular,
//! their diagonal gets a ridge, the smallest of a fixed series that makes them positive definite.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::Fit;
use super::linear::from_standardised;
use crate::numeric::{Standardiser, cholesky, cholesky_solve};
use crate::samples::{PresentClasses, Samples};
use servotwin_diagnosis::classifiers::linear_discriminant::Model;
use servotwin_diagnosis::error::{Error, require};
use servotwin_diagnosis::numeric::{add_scaled, dot};

/// Pivots of the correlations below this count as singular.
const MIN_PIVOT: f64 = 1e-10;

/// Factor from one ridge of the series to the next.
const RIDGE_STEP: f64 = 10.0;

/// Below this share of a feature's deviation, the within-class deviation is rounding.
const NEGLIGIBLE: f64 = 1e-9;

/// Settings of linear discriminant analysis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Initial ridge on the diagonal of the within-class correlations; 0 or more.
    pub(crate) ridge: f64,
    /// First ridge for singular correlations; above 0.
    pub(crate) first_ridge: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Settings { ridge: 0.0, first_ridge: 1e-6 }
    }
}

impl Fit for Settings {
    type Model = Model;

    fn fit(&self, samples: &Samples) -> Result<Model, Error> {
        samples.complete()?;
        require(self.ridge.is_finite() && self.ridge >= 0.0, "ridge", self.ridge, ">= 0")?;
        let first = self.first_ridge;
        require(first.is_finite() && first > 0.0, "first_ridge", first, "> 0")?;
        let features = samples.features();
        let present = PresentClasses::new(samples);
        let mut scatter = Scatter::new(samples, &present);
        let correlations = scatter.correlations(samples, &present);
        let (factor, ridge) = self.factorise(&correlations, features);
        let mut weights = Vec::with_capacity(present.len() * features);
        let mut intercepts = Vec::with_capacity(present.len());
        for (class, means) in scatter.means.chunks_exact(features).enumerate() {
            let mut solved = means.to_vec();
            cholesky_solve(&factor, features, &mut solved);
            let log_prior = libm::log(present.weights[class] / present.total_weight());
            intercepts.push(log_prior - 0.5 * dot(means, &solved));
            weights.extend(solved);
        }
        let functions = from_standardised(
            samples.classes(),
            present.labels,
            &scatter.standardiser,
            weights,
            intercepts,
        );
        Ok(Model { functions, ridge })
    }
}

impl Settings {
    /// The Cholesky factor of the correlations with the smallest sufficient ridge.
    fn factorise(&self, correlations: &[f64], features: usize) -> (Vec<f64>, f64) {
        let mut ridge = self.ridge;
        loop {
            let mut factor = correlations.to_vec();
            for feature in 0..features {
                factor[feature * features + feature] += ridge;
            }
            if cholesky(&mut factor, features, |_| MIN_PIVOT, dot) {
                return (factor, ridge);
            }
            // Terminates: a ridge above the number of features dominates every correlation.
            ridge = if ridge > 0.0 { ridge * RIDGE_STEP } else { self.first_ridge };
        }
    }
}

/// The class means and the within-class scales.
struct Scatter {
    /// Shift to the overall means, scale to deviation 1 within the classes.
    standardiser: Standardiser,
    /// Class-major: the scaled mean of each feature.
    means: Vec<f64>,
}

impl Scatter {
    fn new(samples: &Samples, present: &PresentClasses) -> Self {
        let features = samples.features();
        let standardiser = Standardiser::new(samples);
        let table = standardiser.rows(samples, features);
        let mut means = vec![0.0; present.len() * features];
        for (row, values) in table.chunks_exact(features).enumerate() {
            let class = present.of_row[row];
            let share = samples.weight(row) / present.weights[class];
            add_scaled(&mut means[class * features..(class + 1) * features], share, values);
        }
        Scatter { standardiser, means }
    }

    /// The pooled within-class covariance, scaled to correlations (row-major). Rescales `self` to match. Features that
    /// are constant within the classes keep their overall scale and get a zero diagonal, so that the ridge sets their
    /// influence.
    fn correlations(&mut self, samples: &Samples, present: &PresentClasses) -> Vec<f64> {
        let features = samples.features();
        let mut covariance = self.covariance(samples, present);
        let scales: Vec<f64> = (0..features)
            .map(|feature| libm::sqrt(covariance[feature * features + feature].max(0.0)))
            .map(|deviation| if deviation > NEGLIGIBLE { 1.0 / deviation } else { 1.0 })
            .collect();
        for row in 0..features {
            for column in 0..features {
                covariance[row * features + column] *= scales[row] * scales[column];
            }
            self.standardiser.scales[row] *= scales[row];
        }
        for means in self.means.chunks_exact_mut(features) {
            means.iter_mut().zip(&scales).for_each(|(mean, scale)| *mean *= scale);
        }
        covariance
    }

    /// Within-class covariance with the divisor rows − classes; only the lower half is filled.
    fn covariance(&self, samples: &Samples, present: &PresentClasses) -> Vec<f64> {
        let features = samples.features();
        let rows = (0..samples.rows()).filter(|&row| samples.weight(row) > 0.0).count();
        let freedom = if rows > present.len() { rows - present.len() } else { rows };
        let divisor = present.total_weight() * freedom as f64 / rows as f64;
        let mut covariance = vec![0.0; features * features];
        let mut table = self.standardiser.rows(samples, features);
        for (row, values) in table.chunks_exact_mut(features).enumerate() {
            let class = present.of_row[row];
            add_scaled(values, -1.0, &self.means[class * features..(class + 1) * features]);
            let share = samples.weight(row) / divisor;
            for feature in 0..features {
                let target = &mut covariance[feature * features..feature * features + feature + 1];
                add_scaled(target, share * values[feature], values);
            }
        }
        covariance
    }
}
