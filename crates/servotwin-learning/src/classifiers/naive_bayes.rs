//! Gaussian naive Bayes: every feature of every class has an independent normal distribution.
//!
//! `log p(k, x) = log π_k − ½ Σ_j [log(2π v_kj) + (x_j − m_kj)² / v_kj]`. Every variance is increased by a share of the
//! largest feature variance, as in scikit-learn's `GaussianNB`. The features should therefore have similar scales,
//! which scaled residuals have.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::Fit;
use crate::numeric::mean_and_deviation;
use crate::samples::{PresentClasses, Samples};
use servotwin_diagnosis::classifiers::naive_bayes::Model;
use servotwin_diagnosis::error::{Error, require};

/// Settings of Gaussian naive Bayes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Share of the largest feature variance that is added to every variance; above 0.
    pub(crate) variance_smoothing: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Settings { variance_smoothing: 1e-9 }
    }
}

impl Fit for Settings {
    type Model = Model;

    fn fit(&self, samples: &Samples) -> Result<Model, Error> {
        samples.complete()?;
        let smoothing = self.variance_smoothing;
        require(smoothing.is_finite() && smoothing > 0.0, "variance_smoothing", smoothing, "> 0")?;
        let (means, mut variances) = class_moments(samples);
        let added = smoothing * largest_variance(samples);
        // Prevents division by zero for extremely small features.
        let added = if added >= f64::MIN_POSITIVE { added } else { smoothing };
        variances.iter_mut().for_each(|variance| *variance += added);
        let present = PresentClasses::new(samples);
        let log_prior = |class: usize| libm::log(present.weights[class] / present.total_weight());
        let two_pi = 2.0 * core::f64::consts::PI;
        let constants = variances.chunks_exact(samples.features()).enumerate();
        Ok(Model {
            features: samples.features(),
            classes: samples.classes(),
            constants: constants
                .map(|(class, variances)| {
                    let logs: f64 = variances.iter().map(|v| libm::log(two_pi * v)).sum();
                    log_prior(class) - 0.5 * logs
                })
                .collect(),
            labels: present.labels,
            means,
            half_precisions: variances.iter().map(|variance| 0.5 / variance).collect(),
        })
    }
}

/// The largest variance of a feature over all classes.
fn largest_variance(samples: &Samples) -> f64 {
    let variance = |feature| {
        let (_, deviation) = mean_and_deviation(samples.column(feature), |row| samples.weight(row));
        deviation * deviation
    };
    (0..samples.features()).map(variance).fold(0.0, f64::max)
}

/// Mean and variance of each feature in each present class, class-major.
fn class_moments(samples: &Samples) -> (Vec<f64>, Vec<f64>) {
    let present = PresentClasses::new(samples);
    let features = samples.features();
    let mut means = vec![0.0; present.len() * features];
    let mut variances = means.clone();
    for feature in 0..features {
        let column = samples.column(feature);
        for (row, value) in column.iter().enumerate() {
            means[present.of_row[row] * features + feature] += samples.weight(row) * value;
        }
        for (class, weight) in present.weights.iter().enumerate() {
            means[class * features + feature] /= weight;
        }
        for (row, value) in column.iter().enumerate() {
            let place = present.of_row[row] * features + feature;
            let distance = value - means[place];
            variances[place] += samples.weight(row) * distance * distance;
        }
        for (class, weight) in present.weights.iter().enumerate() {
            variances[class * features + feature] /= weight;
        }
    }
    (means, variances)
}
