//! How near healthy flights that training did not see come to a shutdown.
//!
//! Trees that learned from few healthy environments are too sure of a fault in others, and no plant deviates from its twin
//! just as a study declares. So a trained diagnoser flies once in each of N held-out environments, by specimens that
//! deviate more than declared, and the allowance of a shutdown grows until no flight has more than half of the evidence
//! that a shutdown needs. It grows alike for windows of all kinds: held-out plants have the twin's own structure, so they do
//! not show how far baseline-corrected windows of other plants deviate. Within one environment, a CuSum exceeds a limit b
//! with a probability that falls as e^−b. So if half of the limit is exceeded with a probability of at most p, the limit is
//! exceeded with about p².

use crate::error::{Error, require};
use serde::{Deserialize, Serialize};

/// The evidence of held-out healthy flights.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HealthyEvidence {
    /// Number of environments in training, those of hard negatives included.
    pub learned: u64,
    /// Number of held-out environments with a finished flight, N.
    pub held_out: u64,
    /// Number of those whose flight could not be finished. A study with any is refused.
    pub failed: u64,
    /// How many times as large as declared the tolerances and draws of their specimens were.
    pub scatter: f64,
    /// Number of finished ones with a shutdown at the usual allowances.
    pub shutdowns_before: u64,
    /// What the allowances of a shutdown have grown by, nats.
    pub added_nats: f64,
    /// The largest evidence for a shutdown with these allowances, in parts of its limit.
    pub largest: f64,
}

impl HealthyEvidence {
    pub(super) fn check(&self) -> Result<(), Error> {
        let numbers =
            [("scatter", self.scatter), ("added_nats", self.added_nats), ("largest", self.largest)];
        numbers.into_iter().try_for_each(|(name, value)| {
            require((0.0..=1e6).contains(&value), name, value, "0 to 1e6")
        })
    }
}
