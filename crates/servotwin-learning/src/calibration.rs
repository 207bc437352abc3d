//! Whether probabilities mean what they say, and one number that makes them.
//!
//! A forecast gives every class a probability; [`Forecasts`] holds many, with what was then the
//! case. Weighted means over rows of one forecast's
//!
//! - **log loss** `−ln p(label)`: what boosting minimises; a sure and wrong forecast costs most
//!   (Good, "Rational Decisions", 1952);
//! - **Brier score** `Σ (p(class) − [is label])²` over classes, 0 to 2 (Brier, "Verification of
//!   Forecasts Expressed in Terms of Probability", Monthly Weather Review 78, 1950);
//! - **reliability**: among rows answered with like probability, how many answers are right; and
//!   the mean distance of the two, the *expected calibration error* (Murphy and Winkler,
//!   "Reliability of Subjective Probability Forecasts", Applied Statistics 26, 1977; Guo, Pleiss,
//!   Sun, Weinberger, "On Calibration of Modern Neural Networks", ICML 2017).
//!
//! **Temperature scaling** (Guo et al.) divides the logarithms of the probabilities by one number T,
//! found as that of the least log loss on rows that were not trained with. The order of the classes
//! stays, so no answer changes: T above 1 makes all of them less sure, below 1 surer.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::calibration::MIN_PROBABILITY;
use servotwin_diagnosis::error::{Error, require, same_length};
use servotwin_diagnosis::numeric::arg_max;

/// Temperatures are sought between this and its inverse.
const HOTTEST: f64 = 20.0;

/// Probabilities of many rows, with the classes that were right.
#[derive(Debug, Clone, Copy)]
pub struct Forecasts<'a> {
    classes: usize,
    /// Row-major: the probability of each class.
    shares: &'a [f64],
    labels: &'a [u32],
    weights: Option<&'a [f64]>,
}

/// Rows that were answered with like probability.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReliabilityBin {
    /// Mean probability of the answers, the class of the largest.
    pub predicted: f64,
    /// Share of them that are right.
    pub right: f64,
    /// Number of rows of positive weight.
    pub rows: u64,
    /// Share of the weight of all rows.
    pub share: f64,
}

impl<'a> Forecasts<'a> {
    /// Forecasts of `classes` probabilities a row (row-major), each with the class that was right.
    ///
    /// # Errors
    /// [`Error::NoSamples`] without a row, [`Error::LengthMismatch`], [`Error::LabelOutOfRange`],
    /// [`Error::SettingOutOfRange`] if something is no probability.
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

    /// The same with a weight for each row; a weight of 2 counts as two equal rows.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`], [`Error::WeightOutOfRange`], [`Error::NoSamples`] when all weights
    /// are zero.
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

    /// The weighted mean of a number for each row.
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

    /// Mean Brier score.
    pub fn brier_score(&self) -> f64 {
        self.mean(|shares, label| {
            let distance = |(class, share): (usize, &f64)| share - f64::from(class == label);
            shares.iter().enumerate().map(distance).map(|distance| distance * distance).sum()
        })
    }

    /// The rows in bins of equal width of the probability of their answer, the least sure first;
    /// bins without weight are left out.
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

    /// The temperature of the least log loss, between 1/20 and 20.
    ///
    /// The loss is convex in 1/T, so its slope has one root, found by halving.
    pub fn temperature(&self) -> f64 {
        let logarithms: Vec<f64> =
            self.shares.iter().map(|p| libm::log(p.max(MIN_PROBABILITY))).collect();
        let of_logarithms = Forecasts { shares: &logarithms, ..*self };
        let (mut low, mut high) = (1.0 / HOTTEST, HOTTEST);
        // Halving in proportion: the last interval is as narrow as rounding.
        for _ in 0..60 {
            let middle = libm::sqrt(low * high);
            if of_logarithms.slope(middle) < 0.0 { low = middle } else { high = middle }
        }
        1.0 / libm::sqrt(low * high)
    }

    /// The derivative of the log loss by the inverse temperature β: the mean over rows of what the
    /// forecast expects of `ln p(class)`, minus `ln p(label)`. For forecasts that hold these logarithms.
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

/// The mean distance of predicted probability and share of right answers, by the weight of bins
/// (expected calibration error).
pub fn calibration_error(bins: &[ReliabilityBin]) -> f64 {
    bins.iter().map(|bin| bin.share * libm::fabs(bin.predicted - bin.right)).sum()
}
