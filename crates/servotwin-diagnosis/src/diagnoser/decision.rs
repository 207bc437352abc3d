//! The sequential test that raises actions.
//!
//! The hypotheses are h = 0, healthy, and one for each action of each actuator. At the end of each pane of a window
//! length, its committee gives each a probability p_h. For every pair
//!
//! ```text
//! z_hg = clip(ln p_h − ln p_g − a_hg, ±c)
//! S_hg ← clamp(S_hg + z_hg, 0, K b_hg)
//! S_hg ← 0 for every g where S_h0 = 0                           (1)
//! h may be raised where S_hg ≥ b_hg for every g ≠ h             (2)
//! ```
//!
//! with a_hg an allowance, and c a clip, so that no single window decides. Windows overlap, and each of them counts in full:
//! a later one sees the same sample in a new context.
//!
//! The allowance against health is larger for specimens with tolerances. Tolerances persist, and a fault that looks
//! slightly likelier than health would otherwise be raised some day, however high its limit. For the same reason the
//! allowance against another actuator is larger for an action that switches off.
//!
//! This is the matrix CuSum (Nikiforov, "A Simple Recursive Algorithm for Diagnosis of Abrupt Changes in Random
//! Signals", IEEE Trans. Information Theory 46, 2000; Oskiper, Poor, "Online Activity Detection in a Multiuser
//! Environment Using the Matrix CUSUM Algorithm", ibid. 48, 2002). Evidence must beat the *best other explanation*.
//! Rule (1) comes from the joint CuSum for a change that may be confused with another (Chen, Lin, Zou and others,
//! J-CuSum). Evidence against similar hypotheses, benign changes included, only counts while there is evidence of any
//! change.
//!
//! The limits follow from the chosen error rates and the costs of errors:
//!
//! ```text
//! b_h0 = ln(3600 s/h / (rate_per_h T)) + ln cost(healthy, h)
//! b_hg = ln(1/probability) + ln cost(g, h)
//! ```
//!
//! with T the length of the window. For likelihood ratios of independent windows, a CuSum with limit b crosses by
//! chance within m windows with a probability of at most m e^−b. This local false-alarm probability matters for
//! intermittent faults. Within an hour of windows of length T, false alarms then stay below the chosen rate. The
//! committee's probabilities are no likelihoods of independent windows, so the rates are targets, and a suite
//! measures the actual ones.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::tuning::Tuning;
use crate::error::{Error, require, same_length};
use crate::hierarchy::Names;

/// Lower limit of probabilities and costs before a logarithm is taken.
const LEAST_PROBABILITY: f64 = 1e-12;

/// Costs of errors. The error rates are meant for an error of cost 1.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Costs {
    /// `[truth][answer]` for the faulty actuator: healthy, then the actions.
    pub same_actuator: Vec<Vec<f64>>,
    /// For each action, given to an actuator while the fault is in another one.
    pub other_actuator: Vec<f64>,
}

impl Costs {
    /// Ten for switching off a healthy actuator, and a thousand if another actuator has the fault. Three for switching
    /// off when less would do, and one for every other error. `is_off` marks the actions that switch off.
    pub fn usual(is_off: &[bool]) -> Self {
        let answer = |truth: usize, answer: usize| match answer.checked_sub(1) {
            Some(action) if is_off[action] && truth == 0 => 10.0,
            Some(action) if is_off[action] => 3.0,
            _ => 1.0,
        };
        let all = 0..=is_off.len();
        let row = |truth: usize| all.clone().map(|a| answer(truth, a)).collect();
        let other = |off: &bool| if *off { 1000.0 } else { 1.0 };
        Costs {
            same_actuator: all.clone().map(row).collect(),
            other_actuator: is_off.iter().map(other).collect(),
        }
    }

    pub(super) fn check(&self, actions: usize) -> Result<(), Error> {
        same_length("costs of truths", actions + 1, self.same_actuator.len())?;
        same_length("costs of another actuator", actions, self.other_actuator.len())?;
        for row in &self.same_actuator {
            same_length("costs of answers", actions + 1, row.len())?;
        }
        let all = self.same_actuator.iter().flatten().chain(&self.other_actuator);
        let wrong = all.copied().find(|cost| !(*cost >= 0.0 && cost.is_finite()));
        require(wrong.is_none(), "costs", wrong.unwrap_or(0.0), "0 or more")
    }
}

/// The allowances of one window length, in nats.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Allowances {
    /// As [`Tuning::allowance_nats`].
    pub of_pairs_nats: f64,
    /// As [`Tuning::health_allowance_nats`].
    pub health_nats: f64,
    /// As [`Tuning::off_allowance_nats`].
    pub off_nats: f64,
    /// As [`Tuning::other_allowance_nats`].
    pub other_nats: f64,
}

impl Allowances {
    pub(super) fn check(&self) -> Result<(), Error> {
        let numbers = [
            ("of_pairs_nats", self.of_pairs_nats),
            ("health_nats", self.health_nats),
            ("off_nats", self.off_nats),
            ("other_nats", self.other_nats),
        ];
        numbers.into_iter().try_for_each(|(name, value)| {
            require((0.0..=1e6).contains(&value), name, value, "0 to 1,000,000")
        })
    }
}

/// The numbering of the hypotheses: 0 is healthy, then the actions follow actuator by actuator, in the order of
/// [`crate::hierarchy::Hierarchy::probabilities_into`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Hypotheses {
    pub(crate) actuators: usize,
    pub(crate) actions: usize,
}

impl Hypotheses {
    pub(crate) fn of(names: &Names) -> Self {
        Hypotheses { actuators: names.actuators.len(), actions: names.actions.len() }
    }

    pub(crate) fn count(self) -> usize {
        1 + self.actuators * self.actions
    }

    /// Actuator and action; `None` for healthy.
    pub(crate) fn split(self, hypothesis: usize) -> Option<(usize, usize)> {
        let place = hypothesis.checked_sub(1)?;
        Some((place / self.actions, place % self.actions))
    }

    pub(crate) fn place(self, actuator: usize, action: usize) -> usize {
        1 + actuator * self.actions + action
    }

    /// The hypotheses of an actuator.
    pub(crate) fn of_actuator(self, actuator: usize) -> core::ops::Range<usize> {
        self.place(actuator, 0)..self.place(actuator + 1, 0)
    }
}

/// The limits and allowances of one window length.
#[derive(Debug, Clone, PartialEq)]
pub struct DecisionLimits {
    hypotheses: Hypotheses,
    /// `b_hg`, row by row.
    of_pairs: Vec<f64>,
    /// The allowance of each hypothesis against each other, `a_hg`, row by row.
    allowances_nats: Vec<f64>,
    /// The limit against health for an error of cost 1, nats.
    pub of_change: f64,
}

impl DecisionLimits {
    /// `is_off` marks the actions that switch off.
    pub(super) fn new(
        tuning: &Tuning,
        hypotheses: Hypotheses,
        is_off: &[bool],
        window_s: f64,
    ) -> Self {
        let of_change = libm::log(3600.0 / (tuning.false_alarm_target_per_h * window_s));
        let of_isolation = -libm::log(tuning.wrong_isolation);
        let count = hypotheses.count();
        let limit = |claim: usize, other: usize| {
            let base = if other == 0 { of_change } else { of_isolation };
            let cost = cost(&tuning.costs, hypotheses, other, claim);
            (base + libm::log(cost.max(LEAST_PROBABILITY))).max(tuning.least_limit_nats)
        };
        let of_pairs = (0..count * count).map(|place| limit(place / count, place % count));
        let of_change = of_change.max(tuning.least_limit_nats);
        let allowance = |claim: usize, other: usize| {
            tuning.allowance_nats + besides(tuning, hypotheses, is_off, (claim, other))
        };
        DecisionLimits {
            hypotheses,
            of_pairs: of_pairs.collect(),
            allowances_nats: (0..count * count)
                .map(|place| allowance(place / count, place % count))
                .collect(),
            of_change,
        }
    }

    /// The limits `b_hg` of all pairs of hypotheses, row by row, nats.
    pub fn of_pairs(&self) -> &[f64] {
        &self.of_pairs
    }

    /// The allowances `a_hg` of all pairs of hypotheses, row by row, nats.
    pub fn allowances_nats(&self) -> &[f64] {
        &self.allowances_nats
    }

    fn row(&self, claim: usize) -> &[f64] {
        let count = self.hypotheses.count();
        &self.of_pairs[claim * count..(claim + 1) * count]
    }

    fn allowances(&self, claim: usize) -> &[f64] {
        let count = self.hypotheses.count();
        &self.allowances_nats[claim * count..(claim + 1) * count]
    }
}

/// The additional allowance of a claim against another hypothesis.
fn besides(
    tuning: &Tuning,
    hypotheses: Hypotheses,
    is_off: &[bool],
    (claim, other): (usize, usize),
) -> f64 {
    let Some((own, action)) = hypotheses.split(claim) else { return 0.0 };
    let (of_off, of_other) = match is_off[action] {
        true => (tuning.off_allowance_nats, tuning.other_allowance_nats),
        false => (0.0, 0.0),
    };
    match hypotheses.split(other) {
        None => tuning.health_allowance_nats + of_off,
        Some((actuator, _)) if actuator != own => of_other,
        Some(_) => 0.0,
    }
}

fn cost(costs: &Costs, hypotheses: Hypotheses, truth: usize, answer: usize) -> f64 {
    match (hypotheses.split(truth), hypotheses.split(answer)) {
        (Some((faulty, _)), Some((named, action))) if faulty != named => {
            costs.other_actuator[action]
        }
        (truth, answer) => {
            let class = |split: Option<(usize, usize)>| split.map_or(0, |(_, action)| action + 1);
            costs.same_actuator[class(truth)][class(answer)]
        }
    }
}

/// The answer of one window.
#[derive(Debug, Clone, Copy)]
pub(super) enum WindowAnswer<'p> {
    /// Every residual is in its band.
    InBand,
    /// The probability of each hypothesis, and the novelty of the window.
    Probabilities(&'p [f64], IsNovel),
}

/// Whether a row is unlike all training data, and how rare that is.
#[derive(Debug, Clone, Copy)]
pub struct IsNovel {
    /// Whether it is.
    pub novel: bool,
    /// The share of known rows that count as novel.
    pub share_of_known: f64,
}

/// The evidence of one window length: the statistics `S_hg`, and two separate ones.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PairSums {
    of_pairs: Vec<f64>,
    /// Statistic for any change.
    change: f64,
    /// Statistic for an unknown change.
    unknown: f64,
}

impl PairSums {
    pub(crate) fn new(hypotheses: Hypotheses) -> Self {
        let count = hypotheses.count();
        PairSums { of_pairs: vec![0.0; count * count], change: 0.0, unknown: 0.0 }
    }

    pub(crate) fn clear(&mut self) {
        self.of_pairs.fill(0.0);
        (self.change, self.unknown) = (0.0, 0.0);
    }

    pub(crate) fn fits(&self, hypotheses: Hypotheses) -> bool {
        self.of_pairs.len() == hypotheses.count() * hypotheses.count()
            && self.of_pairs.iter().chain([&self.change, &self.unknown]).all(|sum| sum.is_finite())
    }

    /// Adds the evidence of a window.
    pub(crate) fn take(&mut self, said: WindowAnswer, tuning: &Tuning, limits: &DecisionLimits) {
        let (clip, cap) = (tuning.clip_nats, tuning.evidence_cap);
        let count = limits.hypotheses.count();
        let log = |hypothesis: usize| match said {
            WindowAnswer::InBand => {
                if hypothesis == 0 {
                    tuning.in_band_nats
                } else {
                    0.0
                }
            }
            WindowAnswer::Probabilities(p, _) => libm::log(p[hypothesis].max(LEAST_PROBABILITY)),
        };
        let clipped = |nats: f64| nats.clamp(-clip, clip);
        for claim in 0..count {
            let (own, row) = (log(claim), limits.row(claim).iter().zip(limits.allowances(claim)));
            let statistics = &mut self.of_pairs[claim * count..(claim + 1) * count];
            for (other, (statistic, (limit, allowed))) in statistics.iter_mut().zip(row).enumerate()
            {
                *statistic = add(*statistic, clipped(own - log(other) - allowed), cap * limit);
            }
            if claim > 0 && statistics[0] == 0.0 {
                statistics.fill(0.0);
            }
        }
        let (change, unknown) = match said {
            WindowAnswer::InBand => (-tuning.in_band_nats, -tuning.in_band_nats),
            WindowAnswer::Probabilities(p, novelty) => {
                (log_odds(1.0 - p[0]) - tuning.change_allowance_nats(), novelty.nats())
            }
        };
        let clipped = |nats: f64| clipped(nats - tuning.allowance_nats);
        self.change = add(self.change, clipped(change), cap * limits.of_change);
        self.unknown = add(self.unknown, clipped(unknown), cap * limits.of_change);
    }

    /// The smallest evidence for a hypothesis against any other, in parts of the limit. It may be raised from 1 on.
    pub(crate) fn margin(&self, claim: usize, limits: &DecisionLimits) -> f64 {
        self.least(claim, limits, |other| other != claim)
    }

    /// Evidence for a fault of an actuator, whatever the action: against health and all other actuators.
    pub(crate) fn margin_of_actuator(&self, actuator: usize, limits: &DecisionLimits) -> f64 {
        let own = limits.hypotheses.of_actuator(actuator);
        let margin = |claim| self.least(claim, limits, |other| !own.contains(&other));
        own.clone().map(margin).fold(0.0, f64::max)
    }

    /// Evidence of any change, in parts of its limit.
    pub(crate) fn of_change(&self, limits: &DecisionLimits) -> f64 {
        self.change / limits.of_change
    }

    /// Evidence of an unknown change, in parts of its limit.
    pub(crate) fn of_unknown(&self, limits: &DecisionLimits) -> f64 {
        self.unknown / limits.of_change
    }

    fn least(&self, claim: usize, limits: &DecisionLimits, counts: impl Fn(usize) -> bool) -> f64 {
        let row = limits.row(claim);
        let own = &self.of_pairs[claim * row.len()..(claim + 1) * row.len()];
        let parts = own.iter().zip(row).enumerate().filter(|(other, _)| counts(*other));
        parts.map(|(_, (statistic, limit))| statistic / limit).fold(f64::MAX, f64::min)
    }
}

fn add(statistic: f64, nats: f64, most: f64) -> f64 {
    (statistic + nats).clamp(0.0, most)
}

/// ln p/(1 − p)
fn log_odds(probability: f64) -> f64 {
    let p = probability.clamp(LEAST_PROBABILITY, 1.0 - LEAST_PROBABILITY);
    libm::log(p / (1.0 - p))
}

impl IsNovel {
    /// Evidence for an unknown change, nats: an unknown row is novel every second time, a known one rarely.
    pub fn nats(self) -> f64 {
        let known = if self.novel { self.share_of_known } else { 1.0 - self.share_of_known };
        libm::log(0.5 / known.max(LEAST_PROBABILITY))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::format;

    fn names() -> Names {
        let list =
            |letter: &str, count: usize| (0..count).map(|i| format!("{letter}{i}")).collect();
        Names {
            features: vec![],
            actuators: list("a", 2),
            actions: list("c", 3),
            details: list("d", 1),
        }
    }

    /// The actions are `c0`, `c1`, …; only the first switches off.
    const IS_OFF: [bool; 8] = [true, false, false, false, false, false, false, false];

    /// Small allowances.
    fn generic(names: &Names) -> Tuning {
        Tuning {
            allowance_nats: 0.5,
            health_allowance_nats: 0.0,
            off_allowance_nats: 0.0,
            other_allowance_nats: 0.0,
            ..Tuning::usual(names, &["c0"])
        }
    }

    fn setup() -> (Tuning, Hypotheses, DecisionLimits) {
        let names = names();
        let tuning = generic(&names);
        tuning.check(&names).unwrap();
        let hypotheses = Hypotheses::of(&names);
        let limits = DecisionLimits::new(&tuning, hypotheses, &IS_OFF, 0.5);
        (tuning, hypotheses, limits)
    }

    const KNOWN: IsNovel = IsNovel { novel: false, share_of_known: 0.001 };

    fn sure_of(hypothesis: usize, share: f64) -> Vec<f64> {
        let rest = (1.0 - share) / 6.0;
        (0..7).map(|h| if h == hypothesis { share } else { rest }).collect()
    }

    #[test]
    fn steady_evidence_raises_its_own_hypothesis_and_no_other() {
        let (tuning, hypotheses, limits) = setup();
        for truth in 1..7 {
            let mut evidence = PairSums::new(hypotheses);
            let said = sure_of(truth, 0.99);
            for _ in 0..40 {
                evidence.take(WindowAnswer::Probabilities(&said, KNOWN), &tuning, &limits);
            }
            for claim in 1..7 {
                let raised = evidence.margin(claim, &limits) >= 1.0;
                assert_eq!(raised, claim == truth, "{truth} {claim}");
            }
            let (actuator, _) = hypotheses.split(truth).unwrap();
            assert!(evidence.margin_of_actuator(actuator, &limits) >= 1.0);
            assert!(evidence.margin_of_actuator(1 - actuator, &limits) < 1.0);
            assert!(evidence.of_unknown(&limits) < 1.0);
        }
    }

    #[test]
    fn two_that_look_alike_are_detected_and_not_told_apart() {
        let (tuning, hypotheses, limits) = setup();
        let mut evidence = PairSums::new(hypotheses);
        let mut said = sure_of(1, 0.495);
        said.fill(0.002);
        (said[2], said[5]) = (0.495, 0.495);
        for _ in 0..200 {
            evidence.take(WindowAnswer::Probabilities(&said, KNOWN), &tuning, &limits);
        }
        assert!(evidence.of_change(&limits) >= 1.0);
        assert!((1..7).all(|claim| evidence.margin(claim, &limits) < 1.0));
        assert!((0..2).all(|a| evidence.margin_of_actuator(a, &limits) < 1.0));
    }

    #[test]
    fn switching_the_healthy_one_off_needs_the_most() {
        let (_, _, limits) = setup();
        let hypotheses = limits.hypotheses;
        let shut_2 = hypotheses.place(1, 0);
        let row = limits.row(shut_2);
        let most = row[hypotheses.place(0, 1)];
        assert!(row[hypotheses.place(1, 1)] < most);
        assert!(limits.row(hypotheses.place(1, 1))[hypotheses.place(0, 1)] < most);
        assert_eq!(most, libm::log(1e3) + libm::log(1e3));
    }

    #[test]
    fn rare_windows_of_another_mind_do_not_raise() {
        let (tuning, hypotheses, limits) = setup();
        let mut evidence = PairSums::new(hypotheses);
        let (healthy, faulty) = (sure_of(0, 0.9), sure_of(3, 0.999_999));
        for window in 0..100_000 {
            let said = if window % 20 == 0 { &faulty } else { &healthy };
            evidence.take(WindowAnswer::Probabilities(said, KNOWN), &tuning, &limits);
            assert!(evidence.margin(3, &limits) < 1.0);
        }
    }

    /// A specimen's tolerances give the same evidence in every window.
    #[test]
    fn what_is_a_little_likelier_than_health_is_raised_unless_it_is_allowed_for() {
        let (usual, hypotheses, _) = setup();
        let windows_to_raise = |allowance: f64, share: f64| {
            let tuning = Tuning { health_allowance_nats: allowance, ..usual.clone() };
            let limits = DecisionLimits::new(&tuning, hypotheses, &IS_OFF, 0.5);
            let mut evidence = PairSums::new(hypotheses);
            let mut said = sure_of(2, share);
            (said[0], said[1]) = (0.9 * (1.0 - share), 0.1 * (1.0 - share));
            said[3..].fill(1e-9);
            (0..10_000).position(|_| {
                evidence.take(WindowAnswer::Probabilities(&said, KNOWN), &tuning, &limits);
                evidence.margin(2, &limits) >= 1.0
            })
        };
        assert!(windows_to_raise(0.0, 0.9).is_some());
        assert_eq!(windows_to_raise(3.0, 0.9), None);
        let (before, after) = (windows_to_raise(0.0, 0.9999), windows_to_raise(3.0, 0.9999));
        assert!(before < after && after.unwrap() <= 2 * before.unwrap(), "{before:?} {after:?}");
    }

    #[test]
    fn what_switches_off_pays_more_against_health() {
        let (usual, hypotheses, _) = setup();
        let tuning =
            Tuning { health_allowance_nats: 1.0, off_allowance_nats: 6.0, ..usual.clone() };
        let limits = DecisionLimits::new(&tuning, hypotheses, &IS_OFF, 0.5);
        let mut evidence = PairSums::new(hypotheses);
        for _ in 0..1000 {
            for claim in [1, 2] {
                let mut said = sure_of(claim, 0.99);
                (said[0], said[3 - claim]) = (0.01, 1e-9);
                evidence.take(WindowAnswer::Probabilities(&said, KNOWN), &tuning, &limits);
            }
        }
        // Both are equally likely, four and a half nats above health.
        assert_eq!(evidence.of_pairs[hypotheses.count()], 0.0);
        let mut evidence = PairSums::new(hypotheses);
        for _ in 0..1000 {
            let mut said = sure_of(2, 0.99);
            said[0] = 0.01;
            evidence.take(WindowAnswer::Probabilities(&said, KNOWN), &tuning, &limits);
        }
        assert!(evidence.of_pairs[2 * hypotheses.count()] > 0.0);
    }

    /// A hundred windows, each of which favors actuator 1 over 0 by about 1.4 nats.
    #[test]
    fn what_is_hardly_told_from_another_actuator_never_switches_off() {
        let (usual, hypotheses, _) = setup();
        let most = |other_allowance_nats: f64, claim: usize| {
            let tuning = Tuning { other_allowance_nats, ..usual.clone() };
            let limits = DecisionLimits::new(&tuning, hypotheses, &IS_OFF, 0.5);
            let mut evidence = PairSums::new(hypotheses);
            let mut said = vec![1e-6; 7];
            let rival = hypotheses.place(0, hypotheses.split(claim).unwrap().1);
            (said[claim], said[rival]) = (0.8, 0.2);
            let margins = (0..100).map(|_| {
                evidence.take(WindowAnswer::Probabilities(&said, KNOWN), &tuning, &limits);
                evidence.margin(claim, &limits)
            });
            margins.fold(0.0, f64::max)
        };
        let (off, other) = (hypotheses.place(1, 0), hypotheses.place(1, 1));
        assert!(most(0.0, off) >= 1.0 && most(1.5, off) == 0.0);
        assert!(most(1.5, other) >= 1.0, "what does not switch off is raised as before");
    }

    #[test]
    fn windows_in_band_take_evidence_away_and_novel_ones_gather_their_own() {
        let (tuning, hypotheses, limits) = setup();
        let mut evidence = PairSums::new(hypotheses);
        let said = sure_of(4, 0.99);
        let novel = IsNovel { novel: true, share_of_known: 0.001 };
        for _ in 0..40 {
            evidence.take(WindowAnswer::Probabilities(&said, novel), &tuning, &limits);
        }
        assert!(evidence.margin(4, &limits) >= 1.0 && evidence.of_unknown(&limits) >= 1.0);
        for _ in 0..60 {
            evidence.take(WindowAnswer::InBand, &tuning, &limits);
        }
        assert!(evidence.margin(4, &limits) == 0.0 && evidence.of_unknown(&limits) == 0.0);
        assert!(evidence.of_change(&limits) == 0.0);
    }
}
