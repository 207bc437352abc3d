//! Temperature scaling: divides the logarithms of probabilities by one number T.
//!
//! T minimizes the log loss `−ln p(label)` on held-out rows. The order of the classes stays, so no answer changes. T above
//! 1 lowers the confidence, below 1 raises it.
//!
//! Source: Guo, Pleiss, Sun, Weinberger, "On Calibration of Modern Neural Networks", ICML 2017.

use alloc::vec::Vec;
use servotwin_diagnosis::calibration::MIN_PROBABILITY;
use servotwin_diagnosis::error::{Error, require, same_length};

/// The search covers temperatures between the inverse of this and this.
const HOTTEST: f64 = 20.0;

/// The temperature with the smallest log loss, between 1/20 and 20, for rows with `classes` probabilities each
/// (row-major) and their true classes.
///
/// The loss is convex in 1/T, so its slope has one root, which bisection finds.
///
/// # Errors
/// [`Error::NoSamples`] without a row, [`Error::LengthMismatch`], [`Error::LabelOutOfRange`],
/// [`Error::SettingOutOfRange`] for a value that is no probability.
pub fn temperature(classes: usize, shares: &[f64], labels: &[u32]) -> Result<f64, Error> {
    if labels.is_empty() {
        return Err(Error::NoSamples);
    }
    same_length("probabilities", labels.len() * classes, shares.len())?;
    if let Some(row) = labels.iter().position(|&label| label as usize >= classes) {
        return Err(Error::LabelOutOfRange { row, label: labels[row], classes });
    }
    let wrong = shares.iter().find(|share| !(0.0..=1.0 + 1e-9).contains(*share));
    require(wrong.is_none(), "probability", *wrong.unwrap_or(&0.0), "0 to 1")?;
    let logarithms: Vec<f64> = shares.iter().map(|p| libm::log(p.max(MIN_PROBABILITY))).collect();
    let (mut low, mut high) = (1.0 / HOTTEST, HOTTEST);
    // Geometric bisection: the last interval is as narrow as rounding.
    for _ in 0..60 {
        let middle = libm::sqrt(low * high);
        let is_falling = slope(classes, &logarithms, labels, middle) < 0.0;
        if is_falling { low = middle } else { high = middle }
    }
    Ok(1.0 / libm::sqrt(low * high))
}

/// The derivative of the log loss with respect to the inverse temperature β: the mean over rows of the forecast's
/// expected `ln p(class)`, minus `ln p(label)`.
fn slope(classes: usize, logarithms: &[f64], labels: &[u32], inverse: f64) -> f64 {
    let of_row = |(logarithms, &label): (&[f64], &u32)| {
        let largest = logarithms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let (mut sum, mut expected) = (0.0, 0.0);
        for logarithm in logarithms {
            let share = libm::exp(inverse * (logarithm - largest));
            sum += share;
            expected += share * logarithm;
        }
        expected / sum - logarithms[label as usize]
    };
    let rows = logarithms.chunks_exact(classes).zip(labels);
    rows.map(of_row).sum::<f64>() / labels.len() as f64
}
