//! The scatter of specimens that a diagnoser was trained for, and the test whether a log has more.
//!
//! The excess of a window is its largest residual relative to its band. The median of a flight's excesses measures how far
//! its specimen is from the twin. Training keeps the largest of these medians over its N healthy flights. A further flight of
//! the same scatter exceeds it with a probability of 1/(N + 1), whatever the distribution. A log gives only
//! some windows; each is above its flight's median with a probability of one half. So the log is wider if more of its
//! windows exceed the stored median than chance explains:
//!
//! ```text
//! Σ_{i ≥ k} C(n, i) 2^−n < SIGNIFICANCE                                    (SC1)
//! ```
//!
//! for k of n windows without a common sample. It is looked at after [`LEAST_WINDOWS`], and whenever their number has doubled.

use crate::error::{Error, require};
use alloc::string::String;
use serde::{Deserialize, Serialize};

/// The smallest number of windows that can show a difference.
pub(crate) const LEAST_WINDOWS: u64 = 10;

/// The probability in (SC1): 10 of 10 windows suffice, 9 do not.
const SIGNIFICANCE: f64 = 1e-3;

/// The largest number of windows that are counted.
const MOST_WINDOWS: u64 = 1 << 20;

/// The scatter of the specimens that a diagnoser was trained for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scatter {
    /// The scenario of the training: `noise` for specimens equal to their twin, `realistic` for tolerances.
    pub scenario: String,
    /// The number of healthy flights N.
    pub flights: u64,
    /// The largest median excess of these flights, in windows of the first length.
    pub median_excess: f64,
}

impl Scatter {
    pub(super) fn check(&self) -> Result<(), Error> {
        let excess = self.median_excess;
        require(excess >= 0.0 && excess.is_finite(), "median_excess", excess, "at least 0")
    }
}

/// The windows of a log, compared with a scatter.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ScatterTest {
    /// Number of windows.
    pub windows: u64,
    /// Number of those with a larger excess than the scatter's.
    pub wider: u64,
    /// Whether the log was found wider. It stays so.
    pub is_wider: bool,
}

impl ScatterTest {
    /// Takes the excess of a window that shares no sample with the one before.
    pub fn take(&mut self, excess: f64, scatter: &Scatter) {
        if self.windows >= MOST_WINDOWS || excess.is_nan() {
            return;
        }
        self.windows += 1;
        self.wider += u64::from(excess > scatter.median_excess);
        let looks = self.windows.is_multiple_of(LEAST_WINDOWS)
            && (self.windows / LEAST_WINDOWS).is_power_of_two();
        self.is_wider |= looks && at_least(self.wider, self.windows) < SIGNIFICANCE;
    }

    /// Whether the counts are possible.
    pub fn is_possible(&self) -> bool {
        self.wider <= self.windows && self.windows <= MOST_WINDOWS
    }
}

/// The probability of at least `count` of `of` events that are as likely as not.
fn at_least(count: u64, of: u64) -> f64 {
    // In logarithms, because the first terms of many events are too small for a number.
    let mut log_term = -(of as f64) * core::f64::consts::LN_2;
    let mut sum = if count == 0 { libm::exp(log_term) } else { 0.0 };
    for k in 1..=of {
        log_term += libm::log((of - k + 1) as f64) - libm::log(k as f64);
        if k >= count {
            sum += libm::exp(log_term);
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tail_is_that_of_a_fair_coin() {
        assert!((at_least(10, 10) - 1.0 / 1024.0).abs() < 1e-15);
        assert!((at_least(9, 10) - 11.0 / 1024.0).abs() < 1e-14);
        assert!((at_least(0, 20) - 1.0).abs() < 1e-12);
        assert!((at_least(5000, 10_000) - 0.503_99).abs() < 1e-4, "{}", at_least(5000, 10_000));
    }

    #[test]
    fn a_log_is_wider_only_with_more_windows_than_chance_explains() {
        let scatter = Scatter { scenario: "noise".into(), flights: 99, median_excess: 0.5 };
        let taken = |excesses: &[f64]| {
            let mut test = ScatterTest::default();
            excesses.iter().for_each(|excess| test.take(*excess, &scatter));
            test.is_wider
        };
        assert!(taken(&[0.6; 10]) && !taken(&[0.6; 9]) && !taken(&[0.4; 1000]));
        let one_narrow: [f64; 10] = core::array::from_fn(|k| if k == 3 { 0.4 } else { 0.6 });
        assert!(!taken(&one_narrow));
        // Every other window is what the widest flight of training had.
        let half: [f64; 640] = core::array::from_fn(|k| if k % 2 == 0 { 0.4 } else { 0.6 });
        assert!(!taken(&half));
        assert!(!taken(&[f64::NAN; 100]));
    }
}
