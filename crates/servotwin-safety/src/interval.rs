//! Exact intervals of counts.

use servotwin_learning::metrics::{binomial_tail, clopper_pearson_upper, find_share, poisson_mean};

/// A quantity that was counted: its estimate and the ends of its interval.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct CountedValue {
    /// The estimate.
    pub point: f64,
    /// The lower end.
    pub low: f64,
    /// The upper end.
    pub high: f64,
}

/// The joint confidence of all counted intervals of a result together.
pub(crate) const CONFIDENCE: f64 = 0.95;

/// The confidence of each of so many intervals, with which all together have [`CONFIDENCE`] (Bonferroni).
pub(crate) fn confidence_of_each(intervals: usize) -> f64 {
    1.0 - (1.0 - CONFIDENCE) / intervals as f64
}

impl CountedValue {
    /// A number that was given, not counted.
    pub(crate) fn given(value: f64) -> Self {
        CountedValue { point: value, low: value, high: value }
    }
}

/// The two-sided interval of Clopper and Pearson for a share, after `count` successes in `of` independent trials, at a
/// `confidence` within 0 … 1. It covers the whole range 0 … 1 without trials; the estimate is then the upper end,
/// because nothing is known.
///
/// Source: Clopper and Pearson, Biometrika 26, 1934.
pub fn clopper_pearson(count: u64, of: u64, confidence: f64) -> CountedValue {
    if of == 0 {
        return CountedValue { point: 1.0, low: 0.0, high: 1.0 };
    }
    let tail = 0.5 * (1.0 - confidence);
    let low = match count {
        0 => 0.0,
        count => find_share(|share| binomial_tail(count, of, share), tail),
    };
    let high = clopper_pearson_upper(count, of, 1.0 - tail);
    CountedValue { point: count as f64 / of as f64, low, high }
}

/// The two-sided exact interval of a Poisson rate, per hour, after `count` events in `hours`. Without hours the rate is
/// unbounded; the caller must not ask.
///
/// Source: Garwood, Biometrika 28, 1936.
pub(crate) fn poisson_rate_per_h(count: u64, hours: f64, confidence: f64) -> CountedValue {
    let tail = 0.5 * (1.0 - confidence);
    let low = if count == 0 { 0.0 } else { poisson_mean(count - 1, 1.0 - tail) };
    let high = poisson_mean(count, tail);
    CountedValue { point: count as f64 / hours, low: low / hours, high: high / hours }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clopper_pearson_of_tables() {
        // Newcombe 1998, table I: 81 of 263 and 15 of 148 at 95 %; without an event 1 − (α/2)^(1/n).
        for (count, of, low, high) in [(81, 263, 0.2527, 0.3676), (15, 148, 0.0578, 0.1617)] {
            let found = clopper_pearson(count, of, 0.95);
            assert!(
                (found.low - low).abs() < 5e-5 && (found.high - high).abs() < 5e-5,
                "{found:?}"
            );
        }
        let none = clopper_pearson(0, 20, 0.95);
        assert!((none.high - (1.0 - 0.025_f64.powf(0.05))).abs() < 1e-9, "{none:?}");
        assert_eq!(clopper_pearson(20, 20, 0.95).high, 1.0);
        assert_eq!(clopper_pearson(0, 0, 0.95), CountedValue { point: 1.0, low: 0.0, high: 1.0 });
    }

    #[test]
    fn garwood_of_tables() {
        // Half of the chi-squared quantiles: 10 events have 4.7954 to 18.3904, none has at most 3.6889.
        let ten = poisson_rate_per_h(10, 2.0, 0.95);
        assert!((2.0 * ten.low - 4.7954).abs() < 1e-4 && (2.0 * ten.high - 18.3904).abs() < 1e-4);
        let none = poisson_rate_per_h(0, 1.0, 0.95);
        assert!(none.low == 0.0 && (none.high - 3.6889).abs() < 1e-4, "{none:?}");
    }
}
