//! Scores of probability forecasts, and temperature scaling.
//!
//! A forecast gives every class a probability; [`Forecasts`] holds many of them with the true classes. The scores are
//! weighted means over the rows:
//!
//! - **log loss** `−ln p(label)`: the loss that boosting minimizes. A confident wrong forecast costs most (Good,
//!   "Rational Decisions", 1952).
//! - **reliability**: the share of right answers among rows with similar probability. Its mean distance from the
//!   probability is the *expected calibration error* (Murphy and Winkler, "Reliability of Subjective Probability
//!   Forecasts", Applied Statistics 26, 1977; Guo, Pleiss, Sun, Weinberger, "On Calibration of Modern Neural Networks",
//!   ICML 2017).
//!
//! **Temperature scaling** (Guo et al.) divides the logarithms of the probabilities by one number T. T minimizes the
//! log loss on held-out rows. The order of the classes stays, so no answer changes. T above 1 lowers the confidence,
//! below 1 raises it.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::calibration::MIN_PROBABILITY;
use servotwin_diagnosis::error::{Error, require, same_length};
use servotwin_diagnosis::numeric::arg_max;

/// The search covers temperatures between the inverse of this and this.
const HOTTEST: f64 = 20.0;

/// Probabilities of many rows, with their true classes.
#[derive(Debug, Clone, Copy)]
pub struct Forecasts<'a> {
    classes: usize,
    /// Row-major: the probability of each class.
    shares: &'a [f64],
    labels: &'a [u32],
    weights: Option<&'a [f64]>,
}

/// Rows with similar probability of their answer.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReliabilityBin {
    /// Mean probability of the answers; an answer is the class with the largest probability.
    pub predicted: f64,
    /// Share of right answers.
    pub right: f64,
    /// Number of rows of positive weight.
    pub rows: u64,
    /// Share of the weight of all rows.
    pub share: f64,
}

impl<'a> Forecasts<'a> {
    /// Creates forecasts with `classes` probabilities a row (row-major), each with its true class.
    ///
    /// # Errors
    /// [`Error::NoSamples`] without a row, [`Error::LengthMismatch`], [`Error::LabelOutOfRange`],
    /// [`Error::SettingOutOfRange`] for a value that is no probability.
    pub fn new(classes: usize, shares: &'a [f64], labels: &'a [u32]) -> Result<Self, Error> {
        if labels.is_empty() {
            return Err(Error::NoSamples);
        }
        same_length("probabilities", labels.len() * classes, shares.len())?;
        if let Some(row) = labels.iter().position(|&label| label as usize >= classes) {
            return Err(Error::LabelOutOfRange { row, label: labels[row], classes });
        }
        let wrong = shares.iter().find(|share| !(0.0..=1.0 + 1e-9).contains(*share));
        require(wrong.is_none(), "probability", *wrong.unwrap_or(&0.0), "0 to 1")?;
        Ok(Forecasts { classes, shares, labels, weights: None })
    }

    /// Adds a weight for each row; a weight of 2 counts as two equal rows.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`], [`Error::WeightOutOfRange`], [`Error::NoSamples`] if all weights are zero.
    pub fn with_weights(mut self, weights: &'a [f64]) -> Result<Self, Error> {
        same_length("weights", self.labels.len(), weights.len())?;
        let is_wrong =
            |weight: &f64| !(0.0..=servotwin_diagnosis::numeric::MAX_VALUE).contains(weight);
        if let Some(row) = weights.iter().position(is_wrong) {
            return Err(Error::WeightOutOfRange { row, weight: weights[row] });
        }
        if weights.iter().all(|&weight| weight == 0.0) {
            return Err(Error::NoSamples);
        }
        self.weights = Some(weights);
        Ok(self)
    }

    /// The forecast of each row with its label and weight.
    fn rows(&self) -> impl Iterator<Item = (&'a [f64], usize, f64)> {
        let weight = |row: usize| self.weights.map_or(1.0, |weights| weights[row]);
        let rows = self.shares.chunks_exact(self.classes).zip(self.labels).enumerate();
        rows.map(move |(row, (shares, &label))| (shares, label as usize, weight(row)))
    }

    /// The weighted mean of a quantity over the rows.
    fn mean(&self, mut of_row: impl FnMut(&[f64], usize) -> f64) -> f64 {
        let (mut sum, mut total) = (0.0, 0.0);
        for (shares, label, weight) in self.rows() {
            sum += weight * of_row(shares, label);
            total += weight;
        }
        sum / total
    }

    /// Mean log loss, in nats.
    pub fn log_loss(&self) -> f64 {
        self.mean(|shares, label| -libm::log(shares[label].max(MIN_PROBABILITY)))
    }

    /// Groups the rows into bins of equal width by the probability of their answer, in ascending order. Omits bins
    /// without weight.
    pub fn reliability(&self, bins: usize) -> Vec<ReliabilityBin> {
        let empty = ReliabilityBin { predicted: 0.0, right: 0.0, rows: 0, share: 0.0 };
        let mut table = vec![empty; bins.max(1)];
        for (shares, label, weight) in self.rows() {
            let answer = arg_max(shares.iter().copied());
            let last = table.len() - 1;
            let bin = &mut table[((shares[answer] * bins as f64) as usize).min(last)];
            bin.predicted += weight * shares[answer];
            bin.right += weight * f64::from(answer == label);
            bin.rows += u64::from(weight > 0.0);
            bin.share += weight;
        }
        let total: f64 = table.iter().map(|bin| bin.share).sum();
        table.retain(|bin| bin.share > 0.0);
        for bin in &mut table {
            bin.predicted /= bin.share;
            bin.right /= bin.share;
            bin.share /= total;
        }
        table
    }

    /// The temperature with the smallest log loss, between 1/20 and 20.
    ///
    /// The loss is convex in 1/T, so its slope has one root, which bisection finds.
    pub fn temperature(&self) -> f64 {
        let logarithms: Vec<f64> =
            self.shares.iter().map(|p| libm::log(p.max(MIN_PROBABILITY))).collect();
        let of_logarithms = Forecasts { shares: &logarithms, ..*self };
        let (mut low, mut high) = (1.0 / HOTTEST, HOTTEST);
        // Geometric bisection: the last interval is as narrow as rounding.
        for _ in 0..60 {
            let middle = libm::sqrt(low * high);
            if of_logarithms.slope(middle) < 0.0 { low = middle } else { high = middle }
        }
        1.0 / libm::sqrt(low * high)
    }

    /// The derivative of the log loss with respect to the inverse temperature β: the mean over rows of the forecast's
    /// expected `ln p(class)`, minus `ln p(label)`. The forecasts must hold logarithms.
    fn slope(&self, inverse: f64) -> f64 {
        self.mean(|logarithms, label| {
            let largest = logarithms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let (mut sum, mut expected) = (0.0, 0.0);
            for logarithm in logarithms {
                let share = libm::exp(inverse * (logarithm - largest));
                sum += share;
                expected += share * logarithm;
            }
            expected / sum - logarithms[label]
        })
    }
}

/// The expected calibration error: mean distance of predicted probability and share of right answers, weighted by bin.
pub fn calibration_error(bins: &[ReliabilityBin]) -> f64 {
    bins.iter().map(|bin| bin.share * libm::fabs(bin.predicted - bin.right)).sum()
}
