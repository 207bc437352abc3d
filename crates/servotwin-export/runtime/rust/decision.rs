//! The sequential test that raises actions (matrix CuSum): evidence for each hypothesis against every other one gathers
//! from window to window, and an action may be raised where all of it reaches its limits.

use crate::judge::{HEALTHY, Judgement, hypothesis_of, parts_of};
use crate::sizes::{ACTIONS, HYPOTHESES};
use crate::tables::TUNING;
use crate::trained::Length;
use libm::log;

/// Lower limit of probabilities before a logarithm is taken.
const LEAST_PROBABILITY: f64 = 1e-12;

/// The evidence of one window length, nats.
#[derive(Clone)]
pub struct Evidence {
    of_pairs: [[f64; HYPOTHESES]; HYPOTHESES],
    /// For any change.
    change: f64,
    /// For a change that resembles no training data.
    unknown: f64,
}

/// Adds nats to a statistic, within 0 and a number of limits.
fn gather(statistic: &mut f64, nats: f64, limit: f64, weight: f64) {
    let clipped = nats.max(-TUNING.clip_nats).min(TUNING.clip_nats);
    *statistic = (*statistic + clipped * weight).max(0.0).min(TUNING.evidence_cap * limit);
}

fn log_odds(probability: f64) -> f64 {
    let p = probability.max(LEAST_PROBABILITY).min(1.0 - LEAST_PROBABILITY);
    log(p / (1.0 - p))
}

/// The logarithm of the probability of each hypothesis.
fn logarithms(judgement: &Judgement) -> [f64; HYPOTHESES] {
    if judgement.is_in_band {
        let mut all = [0.0; HYPOTHESES];
        all[HEALTHY] = TUNING.in_band_nats;
        return all;
    }
    judgement.probabilities.map(|probability| log(probability.max(LEAST_PROBABILITY)))
}

impl Evidence {
    pub const NONE: Evidence =
        Evidence { of_pairs: [[0.0; HYPOTHESES]; HYPOTHESES], change: 0.0, unknown: 0.0 };

    /// Adds the evidence of a new window.
    pub fn take(&mut self, length: &Length, judgement: &Judgement) {
        let logarithms = logarithms(judgement);
        for (claim, row) in self.of_pairs.iter_mut().enumerate() {
            for (other, statistic) in row.iter_mut().enumerate() {
                let place = claim * HYPOTHESES + other;
                let nats = logarithms[claim] - logarithms[other] - length.allowances[place];
                gather(statistic, nats, length.limits[place], length.weight);
            }
            // Evidence against similar hypotheses counts only while there is evidence against health.
            if claim != HEALTHY && row[HEALTHY] == 0.0 {
                row.fill(0.0);
            }
        }
        let (mut change, mut unknown) = (-TUNING.in_band_nats, -TUNING.in_band_nats);
        if !judgement.is_in_band {
            let odds = log_odds(1.0 - judgement.probabilities[HEALTHY]);
            change = odds - length.allowed_change;
            unknown = if judgement.is_novel { length.novel_nats } else { length.known_nats };
        }
        for (statistic, nats) in [(&mut self.change, change), (&mut self.unknown, unknown)] {
            gather(statistic, nats - length.allowance, length.limit_of_change, length.weight);
        }
    }

    /// The smallest evidence for a hypothesis against some others, in parts of its limit.
    fn least(&self, length: &Length, claim: usize, is_rival: impl Fn(usize) -> bool) -> f64 {
        let limits = &length.limits[claim * HYPOTHESES..];
        let pairs = self.of_pairs[claim].iter().zip(limits).enumerate();
        let parts =
            pairs.filter(|(other, _)| is_rival(*other)).map(|(_, (nats, limit))| nats / limit);
        parts.fold(f64::MAX, f64::min)
    }

    /// The smallest evidence for a hypothesis against any other, in parts of its limit. It may be raised from 1 on.
    pub fn margin(&self, length: &Length, claim: usize) -> f64 {
        self.least(length, claim, |other| other != claim)
    }

    /// The same for a fault of an actuator, whatever the action.
    pub fn margin_of_actuator(&self, length: &Length, actuator: usize) -> f64 {
        let is_rival = |other| parts_of(other).is_none_or(|(rival, _)| rival != actuator);
        let claims = (0..ACTIONS).map(|action| hypothesis_of(actuator, action));
        claims.map(|claim| self.least(length, claim, is_rival)).fold(0.0, f64::max)
    }

    /// Evidence of any change, in parts of the limit.
    pub fn of_change(&self, length: &Length) -> f64 {
        self.change / length.limit_of_change
    }

    /// Evidence of an unknown change, in parts of the limit.
    pub fn of_unknown(&self, length: &Length) -> f64 {
        self.unknown / length.limit_of_change
    }
}
