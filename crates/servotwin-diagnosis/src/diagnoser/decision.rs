//! The sequential test that alone may raise a command.
//!
//! Hypotheses are h = 0, nothing is wrong, and one for each command of each actuator. Where a pane of
//! a window length ends, its committee gives each a probability p_h, and for every pair
//!
//! ```text
//! z_hg = clip(ln p_h − ln p_g − a_hg, ±c) · w^q
//! S_hg ← clamp(S_hg + z_hg, 0, K b_hg)
//! S_hg ← 0 for every g where S_h0 = 0                           (1)
//! h may be raised where S_hg ≥ b_hg for every g ≠ h             (2)
//! ```
//!
//! with w the share of the window that is new (windows overlap: the same sample must not convince
//! twice; but a later window also sees it in other company, hence the exponent q), a_hg an allowance, and
//! c a clip, so that no single window decides. The allowance is larger against health where specimens have
//! tolerances: what they show lasts, and without it whatever is a little likelier than health is raised
//! some day, however high its limit. For the same reason it is larger against another actuator where a command
//! switches off. This is the matrix CuSum
//! (Nikiforov, "A Simple Recursive Algorithm for Diagnosis of Abrupt Changes in Random Signals", IEEE
//! Trans. Information Theory 46, 2000; Oskiper, Poor, "Online Activity Detection in a Multiuser
//! Environment Using the Matrix CUSUM Algorithm", ibid. 48, 2002): evidence must beat the *best other
//! explanation*. Rule (1) is the joint CuSum's for a change that may be confused with another (Chen,
//! Lin, Zou and others, J-CuSum): what tells a fault from its like, benign changes included, only
//! counts while there is evidence that something changed at all.
//!
//! The limits follow from the error rates that are chosen and from what errors cost:
//!
//! ```text
//! b_h0 = ln(3600 s/h / (rate_per_h T)) + ln cost(healthy, h)
//! b_hg = ln(1/probability) + ln cost(g, h)
//! ```
//!
//! with T the length of the window. For likelihood ratios of independent windows a CuSum with limit b
//! crosses by chance within m windows with a probability of at most m e^−b (the local probability of a
//! false alarm, which is what matters for faults that come and go), so within an hour of T-long
//! windows at most at the rate. The committee's probabilities are no likelihoods of independent
//! windows: the rates are what is aimed at, and a campaign measures what they are.

use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use crate::error::{Error, require, same_length};
use crate::hierarchy::Names;

/// No hypothesis is less likely than this.
const LEAST_PROBABILITY: f64 = 1e-12;

/// Every limit is at least so much, whatever the costs, in nats.
const LEAST_LIMIT: f64 = 1.0;

/// A statistic grows to at most so many times its limit: what it takes to fall again is bounded.
const CAP: f64 = 1.5;

/// What errors cost, relative to an error whose cost is 1, for which the error rates are meant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Costs {
    /// `[truth][answer]` in the actuator that is concerned: healthy, then the commands.
    pub same_actuator: Vec<Vec<f64>>,
    /// Of each command given to an actuator while the fault is in another one.
    pub other_actuator: Vec<f64>,
}

impl Costs {
    /// Ten for switching off what is healthy, a thousand for switching off the healthy one of several
    /// actuators, three for switching off where less would do, and one for every other error.
    /// `is_off` says of each command whether it switches off.
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

    fn check(&self, actions: usize) -> Result<(), Error> {
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

/// How sure a decision must be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// False alarms of a command in an hour without a fault, for an error of cost 1.
    pub false_alarms_per_h: f64,
    /// Probability that a fault raises another command than its own, for an error of cost 1.
    pub wrong_isolation: f64,
    /// What errors cost.
    pub costs: Costs,
    /// The most that one window counts, in nats.
    pub clip_nats: f64,
    /// What is taken off the evidence of every window, in nats.
    pub allowance_nats: f64,
    /// What is taken off the evidence against health besides, in nats: as much as healthy specimens may look like
    /// a fault for ever.
    #[serde(default)]
    pub health_allowance_nats: f64,
    /// What is taken off besides for a command that switches off, in nats.
    #[serde(default)]
    pub off_allowance_nats: f64,
    /// What is taken off besides of the evidence against another actuator for a command that switches off, in nats: what
    /// looks a little more like the fault of one than of the other may do so for long, too.
    #[serde(default)]
    pub other_allowance_nats: f64,
    /// What a window in which every residual stays in its band counts for health, in nats.
    pub in_band_nats: f64,
    /// How much overlapping windows count: the exponent q of the share that is new. 1 counts every
    /// sample once, 0 every window in full; the latency is in between, too.
    pub overlap_exponent: f64,
    /// The share of what deviates that actuators may have in common, above which it is like nothing
    /// known: one half is a fault of one of them, one is none.
    #[serde(default = "max_common_mode", rename = "most_alike")]
    pub max_common_mode: f64,
    /// The part of a limit from which an alarm is pending, and below which a raised one recovers.
    pub pending_share: f64,
    /// How long a raised alarm must have been recovering before it is over, in s.
    pub recover_s: f64,
    /// The least probability of a detail that is named.
    pub least_detail_confidence: f64,
    /// How long nothing is judged after the twin was driven by something wrong or changed its mode,
    /// in s.
    pub settle_s: f64,
    /// How long measured values may be missing before there is no data, in s.
    pub no_data_after_s: f64,
    /// The commands that switch an actuator off.
    #[serde(rename = "off_commands")]
    pub off_actions: Vec<String>,
    /// How many actuators must stay on, whatever is found: one of several, none of a single one, which may be
    /// stopped where its study says that it is.
    pub least_on: u32,
}

/// What is taken off the evidence of every window, in nats.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Allowances {
    /// As [`Settings::allowance_nats`].
    pub of_pairs_nats: f64,
    /// As [`Settings::health_allowance_nats`].
    pub health_nats: f64,
    /// As [`Settings::off_allowance_nats`].
    pub off_nats: f64,
    /// As [`Settings::other_allowance_nats`].
    #[serde(default)]
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

/// How many of so many actuators must stay on where nothing else is said: one of several, none of a single one.
pub fn usual_least_on(actuators: usize) -> u32 {
    u32::from(actuators > 1)
}

fn max_common_mode() -> f64 {
    0.9
}

impl Settings {
    /// Settings to begin with for these names; `off_commands` switch an actuator off.
    pub fn usual(names: &Names, off_actions: &[&str]) -> Self {
        let is_off: Vec<bool> =
            names.actions.iter().map(|c| off_actions.contains(&c.as_str())).collect();
        Settings {
            false_alarms_per_h: 1e-3,
            wrong_isolation: 1e-3,
            costs: Costs::usual(&is_off),
            clip_nats: 8.0,
            allowance_nats: 0.5,
            health_allowance_nats: 0.0,
            off_allowance_nats: 0.0,
            other_allowance_nats: 0.0,
            in_band_nats: 4.0,
            overlap_exponent: 0.5,
            max_common_mode: max_common_mode(),
            pending_share: 0.5,
            recover_s: 5.0,
            least_detail_confidence: 0.5,
            settle_s: 1.0,
            no_data_after_s: 0.1,
            off_actions: off_actions.iter().map(|&c| c.into()).collect(),
            least_on: usual_least_on(names.actuators.len()),
        }
    }

    /// The same with other allowances.
    pub fn allowing(&self, allowances: &Allowances) -> Self {
        Settings {
            allowance_nats: allowances.of_pairs_nats,
            health_allowance_nats: allowances.health_nats,
            off_allowance_nats: allowances.off_nats,
            other_allowance_nats: allowances.other_nats,
            ..self.clone()
        }
    }

    /// Checks the settings.
    ///
    /// # Errors
    /// [`Error::SettingOutOfRange`], [`Error::LengthMismatch`], [`Error::CorruptModel`].
    pub fn check(&self, names: &Names) -> Result<(), Error> {
        self.costs.check(names.actions.len())?;
        let rate = self.false_alarms_per_h;
        require(rate > 0.0 && rate <= 3600.0, "false_alarms_per_h", rate, "above 0, at most 3600")?;
        let share = self.wrong_isolation;
        require(share > 0.0 && share <= 1.0, "wrong_isolation", share, "above 0, at most 1")?;
        let clip = self.clip_nats;
        require(clip > 0.0 && clip <= 100.0, "clip_nats", clip, "above 0, at most 100")?;
        let common_mode = self.max_common_mode;
        require((0.5..=1.0).contains(&common_mode), "most_alike", common_mode, "0.5 to 1")?;
        let part = self.pending_share;
        require(part > 0.0 && part < 1.0, "pending_share", part, "between 0 and 1")?;
        let numbers = [
            ("allowance_nats", self.allowance_nats),
            ("health_allowance_nats", self.health_allowance_nats),
            ("off_allowance_nats", self.off_allowance_nats),
            ("other_allowance_nats", self.other_allowance_nats),
            ("in_band_nats", self.in_band_nats),
            ("overlap_exponent", self.overlap_exponent),
            ("recover_s", self.recover_s),
            ("least_detail_confidence", self.least_detail_confidence),
            ("settle_s", self.settle_s),
            ("no_data_after_s", self.no_data_after_s),
        ];
        for (name, value) in numbers {
            require((0.0..=1e6).contains(&value), name, value, "0 to 1,000,000")?;
        }
        let actuators = names.actuators.len() as u32;
        let kept = f64::from(self.least_on);
        require(self.least_on <= actuators, "least_on", kept, "at most the number of actuators")?;
        let known = self.off_actions.iter().all(|c| names.actions.contains(c));
        let broken = "a command that switches off is none of the commands";
        if known { Ok(()) } else { Err(Error::CorruptModel { broken }) }
    }
}

/// The hypotheses by number: 0 that nothing is wrong, then the commands actuator by actuator, as
/// [`crate::hierarchy::Hierarchy::probabilities_into`] writes them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Hypotheses {
    pub actuators: usize,
    pub actions: usize,
}

impl Hypotheses {
    pub fn of(names: &Names) -> Self {
        Hypotheses { actuators: names.actuators.len(), actions: names.actions.len() }
    }

    pub fn count(self) -> usize {
        1 + self.actuators * self.actions
    }

    /// Actuator and command; `None` for health.
    pub fn split(self, hypothesis: usize) -> Option<(usize, usize)> {
        let place = hypothesis.checked_sub(1)?;
        Some((place / self.actions, place % self.actions))
    }

    pub fn place(self, actuator: usize, action: usize) -> usize {
        1 + actuator * self.actions + action
    }

    /// The hypotheses of an actuator.
    pub fn of_actuator(self, actuator: usize) -> core::ops::Range<usize> {
        self.place(actuator, 0)..self.place(actuator + 1, 0)
    }
}

/// The limits of one window length: `b_hg`, row by row.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Limits {
    hypotheses: Hypotheses,
    of_pairs: Vec<f64>,
    /// What is taken off the evidence of each hypothesis against each other: `a_hg`, row by row.
    allowances_nats: Vec<f64>,
    /// The limit against health of an error of cost 1.
    pub of_change: f64,
}

impl Limits {
    /// `is_off` says of each command whether it switches off.
    pub fn new(
        settings: &Settings,
        hypotheses: Hypotheses,
        is_off: &[bool],
        window_s: f64,
    ) -> Self {
        let of_change = libm::log(3600.0 / (settings.false_alarms_per_h * window_s));
        let of_isolation = -libm::log(settings.wrong_isolation);
        let count = hypotheses.count();
        let limit = |claim: usize, other: usize| {
            let base = if other == 0 { of_change } else { of_isolation };
            let cost = cost(&settings.costs, hypotheses, other, claim);
            (base + libm::log(cost.max(LEAST_PROBABILITY))).max(LEAST_LIMIT)
        };
        let of_pairs = (0..count * count).map(|place| limit(place / count, place % count));
        let of_change = of_change.max(LEAST_LIMIT);
        let allowance = |claim: usize, other: usize| {
            settings.allowance_nats + besides(settings, hypotheses, is_off, (claim, other))
        };
        Limits {
            hypotheses,
            of_pairs: of_pairs.collect(),
            allowances_nats: (0..count * count)
                .map(|place| allowance(place / count, place % count))
                .collect(),
            of_change,
        }
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

/// What is taken off the evidence of a claim against another one, beside what is taken off that of every pair.
fn besides(
    settings: &Settings,
    hypotheses: Hypotheses,
    is_off: &[bool],
    (claim, other): (usize, usize),
) -> f64 {
    let Some((own, action)) = hypotheses.split(claim) else { return 0.0 };
    let (of_off, of_other) = match is_off[action] {
        true => (settings.off_allowance_nats, settings.other_allowance_nats),
        false => (0.0, 0.0),
    };
    match hypotheses.split(other) {
        None => settings.health_allowance_nats + of_off,
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

/// What one window says, before it is weighed.
#[derive(Debug, Clone, Copy)]
pub(super) enum Said<'p> {
    /// Every residual is in its band.
    InBand,
    /// The probability of each hypothesis, and whether it is like nothing that was trained on.
    Probabilities(&'p [f64], IsNovel),
}

/// Whether a row is like nothing that was trained on, and how rare that is of known rows.
#[derive(Debug, Clone, Copy)]
pub(super) struct IsNovel {
    pub novel: bool,
    /// The share of known rows that are called novel.
    pub share_of_known: f64,
}

/// The evidence of one window length: the statistics `S_hg`, and two of a kind.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Evidence {
    of_pairs: Vec<f64>,
    /// That anything changed.
    change: f64,
    /// That what changed is like nothing known.
    unknown: f64,
}

impl Evidence {
    pub fn new(hypotheses: Hypotheses) -> Self {
        let count = hypotheses.count();
        Evidence { of_pairs: vec![0.0; count * count], change: 0.0, unknown: 0.0 }
    }

    pub fn clear(&mut self) {
        self.of_pairs.fill(0.0);
        (self.change, self.unknown) = (0.0, 0.0);
    }

    pub fn fits(&self, hypotheses: Hypotheses) -> bool {
        self.of_pairs.len() == hypotheses.count() * hypotheses.count()
            && self.of_pairs.iter().chain([&self.change, &self.unknown]).all(|sum| sum.is_finite())
    }

    /// Takes in what a window says, of which `share` is new.
    pub fn take(&mut self, said: Said, share: f64, settings: &Settings, limits: &Limits) {
        let weight = libm::pow(share, settings.overlap_exponent);
        let clip = settings.clip_nats;
        let count = limits.hypotheses.count();
        let log = |hypothesis: usize| match said {
            Said::InBand => {
                if hypothesis == 0 {
                    settings.in_band_nats
                } else {
                    0.0
                }
            }
            Said::Probabilities(p, _) => libm::log(p[hypothesis].max(LEAST_PROBABILITY)),
        };
        let weigh = |nats: f64| nats.clamp(-clip, clip) * weight;
        for claim in 0..count {
            let (own, row) = (log(claim), limits.row(claim).iter().zip(limits.allowances(claim)));
            let statistics = &mut self.of_pairs[claim * count..(claim + 1) * count];
            for (other, (statistic, (limit, allowed))) in statistics.iter_mut().zip(row).enumerate()
            {
                *statistic = add(*statistic, weigh(own - log(other) - allowed), *limit);
            }
            if claim > 0 && statistics[0] == 0.0 {
                statistics.fill(0.0);
            }
        }
        let (change, unknown) = match said {
            Said::InBand => (-settings.in_band_nats, -settings.in_band_nats),
            Said::Probabilities(p, novelty) => {
                let allowed = settings.health_allowance_nats + settings.off_allowance_nats;
                (log_odds(1.0 - p[0]) - allowed, novelty.nats())
            }
        };
        let weigh = |nats: f64| weigh(nats - settings.allowance_nats);
        self.change = add(self.change, weigh(change), limits.of_change);
        self.unknown = add(self.unknown, weigh(unknown), limits.of_change);
    }

    /// The least evidence for a hypothesis against any other, in parts of the limit: it may be
    /// raised from 1 on.
    pub fn margin(&self, claim: usize, limits: &Limits) -> f64 {
        self.least(claim, limits, |other| other != claim)
    }

    /// Evidence that an actuator is at fault, whatever its command: against health and all others.
    pub fn margin_of_actuator(&self, actuator: usize, limits: &Limits) -> f64 {
        let own = limits.hypotheses.of_actuator(actuator);
        let margin = |claim| self.least(claim, limits, |other| !own.contains(&other));
        own.clone().map(margin).fold(0.0, f64::max)
    }

    /// Evidence that anything changed.
    pub fn of_change(&self, limits: &Limits) -> f64 {
        self.change / limits.of_change
    }

    /// Evidence that what changed is like nothing known.
    pub fn of_unknown(&self, limits: &Limits) -> f64 {
        self.unknown / limits.of_change
    }

    fn least(&self, claim: usize, limits: &Limits, counts: impl Fn(usize) -> bool) -> f64 {
        let row = limits.row(claim);
        let own = &self.of_pairs[claim * row.len()..(claim + 1) * row.len()];
        let parts = own.iter().zip(row).enumerate().filter(|(other, _)| counts(*other));
        parts.map(|(_, (statistic, limit))| statistic / limit).fold(f64::MAX, f64::min)
    }
}

fn add(statistic: f64, nats: f64, limit: f64) -> f64 {
    (statistic + nats).clamp(0.0, CAP * limit)
}

/// ln p/(1 − p)
fn log_odds(probability: f64) -> f64 {
    let p = probability.clamp(LEAST_PROBABILITY, 1.0 - LEAST_PROBABILITY);
    libm::log(p / (1.0 - p))
}

impl IsNovel {
    /// A row of something unknown is novel every second time, one of something known seldom.
    fn nats(self) -> f64 {
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

    /// Of `c0`, `c1`, ...: the first.
    const IS_OFF: [bool; 8] = [true, false, false, false, false, false, false, false];

    fn setup() -> (Settings, Hypotheses, Limits) {
        let names = names();
        let settings = Settings::usual(&names, &["c0"]);
        settings.check(&names).unwrap();
        let hypotheses = Hypotheses::of(&names);
        let limits = Limits::new(&settings, hypotheses, &IS_OFF, 0.5);
        (settings, hypotheses, limits)
    }

    const KNOWN: IsNovel = IsNovel { novel: false, share_of_known: 0.001 };

    fn sure_of(hypothesis: usize, share: f64) -> Vec<f64> {
        let rest = (1.0 - share) / 6.0;
        (0..7).map(|h| if h == hypothesis { share } else { rest }).collect()
    }

    #[test]
    fn steady_evidence_raises_its_own_hypothesis_and_no_other() {
        let (settings, hypotheses, limits) = setup();
        for truth in 1..7 {
            let mut evidence = Evidence::new(hypotheses);
            let said = sure_of(truth, 0.99);
            for _ in 0..40 {
                evidence.take(Said::Probabilities(&said, KNOWN), 0.2, &settings, &limits);
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
        let (settings, hypotheses, limits) = setup();
        let mut evidence = Evidence::new(hypotheses);
        let mut said = sure_of(1, 0.495);
        said.fill(0.002);
        (said[2], said[5]) = (0.495, 0.495);
        for _ in 0..200 {
            evidence.take(Said::Probabilities(&said, KNOWN), 0.2, &settings, &limits);
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
        let (settings, hypotheses, limits) = setup();
        let mut evidence = Evidence::new(hypotheses);
        let (healthy, faulty) = (sure_of(0, 0.9), sure_of(3, 0.999_999));
        let mut random = crate::random::Random::new(1);
        for _ in 0..100_000 {
            let said = if random.unit() < 0.05 { &faulty } else { &healthy };
            evidence.take(Said::Probabilities(said, KNOWN), 0.2, &settings, &limits);
            assert!(evidence.margin(3, &limits) < 1.0);
        }
    }

    /// A specimen's tolerances say the same in every window.
    #[test]
    fn what_is_a_little_likelier_than_health_is_raised_unless_it_is_allowed_for() {
        let (usual, hypotheses, _) = setup();
        let windows_to_raise = |allowance: f64, share: f64| {
            let settings = Settings { health_allowance_nats: allowance, ..usual.clone() };
            let limits = Limits::new(&settings, hypotheses, &IS_OFF, 0.5);
            let mut evidence = Evidence::new(hypotheses);
            let mut said = sure_of(2, share);
            (said[0], said[1]) = (0.9 * (1.0 - share), 0.1 * (1.0 - share));
            said[3..].fill(1e-9);
            (0..10_000).position(|_| {
                evidence.take(Said::Probabilities(&said, KNOWN), 0.2, &settings, &limits);
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
        let settings =
            Settings { health_allowance_nats: 1.0, off_allowance_nats: 6.0, ..usual.clone() };
        let limits = Limits::new(&settings, hypotheses, &IS_OFF, 0.5);
        let mut evidence = Evidence::new(hypotheses);
        for _ in 0..1000 {
            for claim in [1, 2] {
                let mut said = sure_of(claim, 0.99);
                (said[0], said[3 - claim]) = (0.01, 1e-9);
                evidence.take(Said::Probabilities(&said, KNOWN), 0.2, &settings, &limits);
            }
        }
        // Both are as likely, four and a half nats against health.
        assert_eq!(evidence.of_pairs[hypotheses.count()], 0.0);
        let mut evidence = Evidence::new(hypotheses);
        for _ in 0..1000 {
            let mut said = sure_of(2, 0.99);
            said[0] = 0.01;
            evidence.take(Said::Probabilities(&said, KNOWN), 0.2, &settings, &limits);
        }
        assert!(evidence.of_pairs[2 * hypotheses.count()] > 0.0);
    }

    /// A hundred windows, each of which says that it is actuator 1 rather than 0 by some 1.4 nats.
    #[test]
    fn what_is_hardly_told_from_another_actuator_never_switches_off() {
        let (usual, hypotheses, _) = setup();
        let most = |other_allowance_nats: f64, claim: usize| {
            let settings = Settings { other_allowance_nats, ..usual.clone() };
            let limits = Limits::new(&settings, hypotheses, &IS_OFF, 0.5);
            let mut evidence = Evidence::new(hypotheses);
            let mut said = vec![1e-6; 7];
            let rival = hypotheses.place(0, hypotheses.split(claim).unwrap().1);
            (said[claim], said[rival]) = (0.8, 0.2);
            let margins = (0..100).map(|_| {
                evidence.take(Said::Probabilities(&said, KNOWN), 1.0, &settings, &limits);
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
        let (settings, hypotheses, limits) = setup();
        let mut evidence = Evidence::new(hypotheses);
        let said = sure_of(4, 0.99);
        let novel = IsNovel { novel: true, share_of_known: 0.001 };
        for _ in 0..40 {
            evidence.take(Said::Probabilities(&said, novel), 0.2, &settings, &limits);
        }
        assert!(evidence.margin(4, &limits) >= 1.0 && evidence.of_unknown(&limits) >= 1.0);
        for _ in 0..60 {
            evidence.take(Said::InBand, 0.2, &settings, &limits);
        }
        assert!(evidence.margin(4, &limits) == 0.0 && evidence.of_unknown(&limits) == 0.0);
        assert!(evidence.of_change(&limits) == 0.0);
    }

    #[test]
    fn settings_out_of_range_are_refused() {
        let names = names();
        let good = Settings::usual(&names, &["c0"]);
        let bad = [
            Settings { false_alarms_per_h: 0.0, ..good.clone() },
            Settings { wrong_isolation: f64::NAN, ..good.clone() },
            Settings { pending_share: 1.0, ..good.clone() },
            Settings { recover_s: -1.0, ..good.clone() },
            Settings { least_on: 3, ..good.clone() },
            Settings { off_actions: vec!["c9".into()], ..good.clone() },
            Settings { costs: Costs::usual(&[true]), ..good.clone() },
        ];
        for settings in bad {
            assert!(settings.check(&names).is_err(), "{settings:?}");
        }
    }
}
