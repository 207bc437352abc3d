//! A running diagnosis: one call for each sample.

use crate::alarm::Memory;
use crate::boundary::Doubt;
use crate::decision::Evidence;
use crate::judge::{HEALTHY, Judgement, hypothesis_of, parts_of};
use crate::random::Random;
use crate::sizes::{
    ACTIONS, ACTUATORS, BOUNDARIES, FEATURES, HYPOTHESES, INPUTS, LENGTHS, SENSORS, VIEWS,
};
use crate::tables::{self, STREAM_PLANS, SWITCHES_OFF, TUNING};
use crate::trained::Sensor;
use crate::windows::{Baseline, Ring, Stream, Values};

/// Upper limit of residuals and twin signals in parts of scale; larger ones are no measurements.
const PLAUSIBLE: f64 = 1e6;

/// A finding. Its numbers are indices into the lists of names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Finding {
    /// Too few samples, or the twin is settling.
    Unjudged,
    Healthy,
    /// A deviation of unclear cause.
    Detected,
    /// A fault in an actuator, but the action is unclear.
    Actuator {
        actuator: usize,
    },
    Action {
        actuator: usize,
        action: usize,
    },
    Detail {
        actuator: usize,
        action: usize,
        detail: usize,
    },
    /// A deviation that resembles no training data.
    Unknown,
    /// An input is implausible, so nothing is judged.
    EnvironmentInvalid {
        input: usize,
        why: Why,
    },
}

/// The failed check of an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Why {
    Missing,
    NotFinite,
    OutOfRange,
    Frozen,
    Contradicts,
    /// A wrong reading would explain all deviations, and so would a fault.
    Doubtful,
}

/// The state of the alarm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Alarm {
    Normal,
    /// There is evidence, but not enough for an action.
    Pending,
    Raised,
    /// The evidence for the raised action has ended.
    Recovering,
    NoData,
    Error,
}

/// A raised action. One that switches off stays until it is confirmed or released.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Raised {
    pub actuator: usize,
    pub action: usize,
    pub detail: Option<usize>,
    /// The sample that raised it.
    pub sample: u64,
    /// The window length that confirmed it last, and its probability then.
    pub length: usize,
    pub confidence: f64,
}

/// The result after a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// Number of the sample, from 0.
    pub sample: u64,
    /// Since when finding and alarm are these.
    pub since_sample: u64,
    pub finding: Finding,
    pub alarm: Alarm,
    pub raised: Option<Raised>,
    /// Probability of the finding.
    pub confidence: f64,
    /// The window length that found it.
    pub length: Option<usize>,
    /// The largest residual in parts of its band, with its sensor.
    pub worst_sensor: Option<usize>,
    pub worst: f64,
    /// Number of lost sensors.
    pub lost: usize,
}

/// The state of a sensor.
#[derive(Clone, Copy)]
struct SensorState {
    is_taken_out: bool,
    is_lost: bool,
    /// Consecutive samples that contradict `is_lost`.
    against: u32,
}

impl SensorState {
    const PRESENT: SensorState = SensorState { is_taken_out: false, is_lost: false, against: 0 };

    /// Counts a sample with or without a usable value.
    fn notice(&mut self, is_there: bool) {
        if is_there != self.is_lost {
            self.against = 0;
            return;
        }
        let limits = [TUNING.until_lost_samples, TUNING.until_back_samples];
        self.against += 1;
        if self.against >= limits[usize::from(self.is_lost)] {
            *self = SensorState { is_lost: !self.is_lost, against: 0, ..*self };
        }
    }
}

/// Whether a value can be used.
#[derive(Clone, Copy, PartialEq)]
enum Usability {
    Usable,
    Missing,
    Wrong,
}

fn usability_of(value: f64, expected: f64, scale: f64) -> Usability {
    if value.is_nan() {
        Usability::Missing
    } else if ((value - expected) / scale).abs() > PLAUSIBLE {
        Usability::Wrong
    } else {
        Usability::Usable
    }
}

/// The twin's value with the noise of a healthy sensor. The same sensor and sample always give the same number.
fn stand_in(sensor: &Sensor, place: usize, sample: u64, expected: f64) -> f64 {
    let mut random = Random::stream(place as u64, sample);
    let sum = (0..12).fold(0.0, |sum, _| sum + random.unit());
    expected + sensor.scale * sensor.stand_in_noise * (sum - 6.0)
}

/// The statistics of the windows, and what was found in them.
#[derive(Clone)]
struct Windows {
    /// Of residuals as they are, and beyond the baseline.
    streams: [Stream; 2],
    rings: [Ring; LENGTHS],
    baseline: Baseline,
    judgements: [Judgement; LENGTHS],
    evidence: [Evidence; LENGTHS],
    doubts: [[Doubt; BOUNDARIES]; LENGTHS],
    has_judged: bool,
}

impl Windows {
    const EMPTY: Windows = Windows {
        streams: [Stream::EMPTY; 2],
        rings: [Ring::EMPTY; LENGTHS],
        baseline: Baseline::EMPTY,
        judgements: [Judgement::NONE; LENGTHS],
        evidence: [Evidence::NONE; LENGTHS],
        doubts: [[Doubt::NONE; BOUNDARIES]; LENGTHS],
        has_judged: false,
    };
}

/// A running diagnosis.
#[derive(Clone)]
pub struct Session {
    samples: u64,
    /// Samples that are not judged, because the twin settles.
    settling: u32,
    /// Consecutive samples without usable values.
    gap: u32,
    /// The bits of each input, and how often they were repeated.
    last_inputs: [(u64, u32); INPUTS],
    sensors: [SensorState; SENSORS],
    /// Sensors with a stand-in value.
    stands_in: [bool; SENSORS],
    windows: Windows,
    /// The features of the last window outside its bands.
    rows: [[f64; FEATURES]; VIEWS],
    memory: Memory,
    outcome: Outcome,
}

impl Default for Session {
    fn default() -> Self {
        Session::new()
    }
}

impl Session {
    /// A session without samples. Use none where [`rounds_twice`](crate::rounds_twice) is false.
    pub const fn new() -> Self {
        Session {
            samples: 0,
            settling: 0,
            gap: 0,
            // No plausible input is NaN.
            last_inputs: [(f64::NAN.to_bits(), 0); INPUTS],
            sensors: [SensorState::PRESENT; SENSORS],
            stands_in: [false; SENSORS],
            windows: Windows::EMPTY,
            rows: [[0.0; FEATURES]; VIEWS],
            memory: Memory::NONE,
            outcome: Outcome {
                sample: 0,
                since_sample: 0,
                finding: Finding::Unjudged,
                alarm: Alarm::Normal,
                raised: None,
                confidence: 0.0,
                length: None,
                worst_sensor: None,
                worst: 0.0,
                lost: 0,
            },
        }
    }

    /// Takes one sample and returns the result. Values are in SI units, in the order of the names in
    /// [`tables`](crate::tables); NaN is a missing value.
    pub fn push(&mut self, inputs: &[f64; INPUTS], measured: &Values, twin: &Values) -> &Outcome {
        self.outcome.sample = self.samples;
        self.samples += 1;
        if let Some((input, why)) = self.find_implausible(inputs) {
            self.distrust(input, why);
        } else {
            let mut values = *measured;
            match self.check_measured(&mut values, twin) {
                Usability::Usable => self.take_sample(&values, twin),
                Usability::Missing => self.lack(Alarm::NoData),
                Usability::Wrong => self.lack(Alarm::Error),
            }
        }
        &self.outcome
    }

    /// The result after the last sample.
    pub fn outcome(&self) -> &Outcome {
        &self.outcome
    }

    /// The flight control computer switched an actuator off; it is no longer judged.
    ///
    /// # Panics
    /// Here and below, if there is no such actuator or sensor.
    pub fn switched_off(&mut self, actuator: usize) {
        self.set_off(actuator, true);
    }

    /// An actuator is on and judged again, and its raised action is withdrawn.
    pub fn release(&mut self, actuator: usize) {
        self.set_off(actuator, false);
    }

    fn set_off(&mut self, actuator: usize, is_off: bool) {
        self.memory.is_off[actuator] = is_off;
        self.memory.was_claimed_off[actuator] = is_off;
        self.memory.drop_raised_of(actuator);
        self.restart();
    }

    /// Stops or resumes judging an actuator that is on.
    pub fn inhibit(&mut self, actuator: usize, is_inhibited: bool) {
        self.memory.is_inhibited[actuator] = is_inhibited;
        if is_inhibited {
            self.memory.drop_raised_of(actuator);
        }
        self.restart();
    }

    /// Takes a sensor out of the diagnosis, or puts it back.
    pub fn take_out(&mut self, sensor: usize, is_out: bool) {
        self.sensors[sensor].is_taken_out = is_out;
        self.restart();
    }

    /// Evidence of a window length.
    pub fn evidence(&self, length: usize) -> &Evidence {
        &self.windows.evidence[length]
    }

    /// Probability of each hypothesis in the last window of a length.
    pub fn probabilities(&self, length: usize) -> &[f64; HYPOTHESES] {
        &self.windows.judgements[length].probabilities
    }

    /// The window of a length.
    pub fn ring(&self, length: usize) -> &Ring {
        &self.windows.rings[length]
    }

    /// The doubt of a window length about a boundary.
    pub fn doubt(&self, length: usize, boundary: usize) -> &Doubt {
        &self.windows.doubts[length][boundary]
    }

    /// The features of the last window outside its bands, in every view.
    pub fn rows(&self) -> &[[f64; FEATURES]; VIEWS] {
        &self.rows
    }
}

/// What is reported.
impl Session {
    /// Reports a finding. Those without a window have no confidence.
    fn report(&mut self, finding: Finding, alarm: Alarm) {
        let outcome = &mut self.outcome;
        if (outcome.finding, outcome.alarm) != (finding, alarm) {
            outcome.since_sample = outcome.sample;
        }
        (outcome.finding, outcome.alarm, outcome.raised) = (finding, alarm, self.memory.raised);
        if matches!(finding, Finding::Unjudged | Finding::EnvironmentInvalid { .. }) {
            (outcome.confidence, outcome.length) = (0.0, None);
            (outcome.worst, outcome.worst_sensor) = (0.0, None);
        }
    }

    /// Starts again with a twin that must settle first. A raised action stays.
    fn restart(&mut self) {
        self.windows = Windows::EMPTY;
        self.settling = TUNING.settle_samples;
        let alarm = if self.memory.raised.is_some() { Alarm::Raised } else { Alarm::Normal };
        self.report(Finding::Unjudged, alarm);
    }

    /// Handles an implausible input: what the twin computed since then means nothing.
    fn distrust(&mut self, input: usize, why: Why) {
        let finding = Finding::EnvironmentInvalid { input, why };
        if self.outcome.finding != finding || self.windows.has_judged {
            self.restart();
        }
        self.settling = TUNING.settle_samples;
        let alarm = if why == Why::Missing { Alarm::NoData } else { Alarm::Error };
        self.report(finding, alarm);
    }

    /// Handles a sample without usable values. A few are only counted; more clear the windows.
    fn lack(&mut self, alarm: Alarm) {
        let limit = TUNING.until_lost_samples;
        self.gap = self.gap.saturating_add(1);
        if self.gap >= limit {
            if self.windows.has_judged || self.gap == limit {
                self.windows = Windows::EMPTY;
            }
            self.report(Finding::Unjudged, alarm);
        }
    }
}

/// Inputs and sensors.
impl Session {
    /// The first implausible input. All are counted.
    fn find_implausible(&mut self, inputs: &[f64; INPUTS]) -> Option<(usize, Why)> {
        let mut found = None;
        for (input, &value) in inputs.iter().enumerate() {
            let why = self.check_input(input, value);
            found = found.or(why.map(|why| (input, why)));
        }
        found.or_else(|| {
            let mut differences = tables::DIFFERENCES.iter();
            let is_wrong = |d: &&crate::trained::Difference| {
                !(d.least..=d.largest).contains(&(inputs[d.of] - inputs[d.minus]))
            };
            differences.find(is_wrong).map(|difference| (difference.of, Why::Contradicts))
        })
    }

    fn check_input(&mut self, input: usize, value: f64) -> Option<Why> {
        let (limits, (last, repeats)) = (&tables::INPUTS[input], &mut self.last_inputs[input]);
        *repeats = if *last == value.to_bits() { repeats.saturating_add(1) } else { 0 };
        *last = value.to_bits();
        if value.is_nan() {
            Some(Why::Missing)
        } else if value.is_infinite() {
            Some(Why::NotFinite)
        } else if !(limits.least..=limits.largest).contains(&value) {
            Some(Why::OutOfRange)
        } else {
            let is_frozen = limits.frozen_after > 0 && *repeats >= limits.frozen_after;
            is_frozen.then_some(Why::Frozen)
        }
    }

    /// Checks the values, and replaces those of masked and lost sensors.
    fn check_measured(&mut self, values: &mut Values, twin: &Values) -> Usability {
        let mut all = Usability::Usable;
        for (place, value) in values.iter_mut().enumerate() {
            let own = self.check_sensor(place, value, twin[place]);
            if all == Usability::Usable || !is_sound(place, twin[place]) {
                all = own;
            }
        }
        let lost = self.sensors.iter().filter(|sensor| sensor.is_lost).count();
        if lost < self.outcome.lost {
            self.windows = Windows::EMPTY;
        }
        self.outcome.lost = lost;
        let is_blind = all == Usability::Usable && lost > 0 && self.is_blind();
        if is_blind { Usability::Missing } else { all }
    }

    /// Checks a value, or replaces it. Without a sound value of the twin, nobody knows what it should be.
    fn check_sensor(&mut self, place: usize, value: &mut f64, expected: f64) -> Usability {
        let sensor = &tables::SENSORS[place];
        let is_masked =
            sensor.actuator.is_some_and(|actuator| self.memory.is_masked(usize::from(actuator)));
        let state = &mut self.sensors[place];
        let (is_out, is_sound) = (state.is_taken_out || is_masked, is_sound(place, expected));
        if is_out {
            (state.is_lost, state.against) = (false, 0);
        } else if is_sound {
            state.notice(usability_of(*value, expected, sensor.scale) == Usability::Usable);
        }
        self.stands_in[place] = is_out || state.is_lost;
        if self.stands_in[place] {
            *value = stand_in(sensor, place, self.samples, expected);
        }
        if is_sound { usability_of(*value, expected, sensor.scale) } else { Usability::Wrong }
    }

    /// Whether most sensors are lost, of all or of an actuator.
    fn is_blind(&self) -> bool {
        let has_lost_most = |actuator: Option<u8>| {
            let sensors = tables::SENSORS.iter().zip(&self.sensors);
            let own = sensors.filter(|(known, _)| actuator.is_none() || known.actuator == actuator);
            let (count, lost) = own.fold((0, 0), |(count, lost), (_, state)| {
                (count + 1, lost + u32::from(state.is_lost))
            });
            f64::from(lost) > TUNING.most_lost * f64::from(count)
        };
        has_lost_most(None) || (0..ACTUATORS as u8).any(|actuator| has_lost_most(Some(actuator)))
    }
}

/// Whether a value of the twin can be compared.
fn is_sound(sensor: usize, expected: f64) -> bool {
    (expected / tables::SENSORS[sensor].scale).abs() <= PLAUSIBLE
}

/// Windows.
impl Session {
    fn take_sample(&mut self, measured: &Values, twin: &Values) {
        let is_lacking = matches!(self.outcome.alarm, Alarm::NoData | Alarm::Error);
        self.gap = 0;
        if self.settling > 0 {
            self.settling -= 1;
            self.report(Finding::Unjudged, self.memory.state(false));
            return;
        }
        let has_new = self.add_to_windows(measured, twin);
        if has_new {
            self.judge_windows();
        }
        if has_new && self.windows.has_judged {
            self.decide();
        } else if is_lacking || !self.windows.has_judged {
            self.report(Finding::Unjudged, self.memory.state(false));
        }
    }

    /// Adds the sample to all windows; returns whether any is complete.
    fn add_to_windows(&mut self, measured: &Values, twin: &Values) -> bool {
        let Windows { streams: [plain, corrected], rings, baseline, .. } = &mut self.windows;
        let has_new = plain.add(rings, &STREAM_PLANS[0], measured, twin);
        if STREAM_PLANS[1].places.is_empty() {
            return has_new;
        }
        let is_settled = baseline.is_settled();
        if !is_settled || self.outcome.alarm == Alarm::Normal {
            baseline.learn(measured, twin);
        }
        if !is_settled {
            return has_new;
        }
        let mean = |i: usize| if self.stands_in[i] { 0.0 } else { baseline.means[i] };
        let values = core::array::from_fn(|i| measured[i] - mean(i));
        corrected.add(rings, &STREAM_PLANS[1], &values, twin) || has_new
    }

    fn judge_windows(&mut self) {
        let is_masked = core::array::from_fn(|actuator| self.memory.is_masked(actuator));
        let windows = &mut self.windows;
        for (place, length) in tables::LENGTHS.iter().enumerate() {
            let ring = &windows.rings[place];
            if !ring.has_ended || !ring.is_full(&length.span) {
                continue;
            }
            let window = &ring.window;
            let judgement =
                Judgement::of(window, length, &is_masked, &self.stands_in, &mut self.rows);
            windows.evidence[place].take(length, &judgement);
            windows.judgements[place] = judgement;
            windows.has_judged = true;
            for (doubt, boundary) in windows.doubts[place].iter_mut().zip(&tables::BOUNDARIES) {
                doubt.take(boundary, length, window);
            }
        }
    }
}

/// Decision.
impl Session {
    fn margin(&self, length: usize, claim: usize) -> f64 {
        self.windows.evidence[length].margin(&tables::LENGTHS[length], claim)
    }

    /// Whether an actuator may be accused: all other judged actuators have all their sensors.
    fn is_comparable(&self, actuator: usize) -> bool {
        let mut sensors = tables::SENSORS.iter().zip(&self.sensors);
        sensors.all(|(known, state)| {
            let own = known.actuator.map(usize::from);
            let is_judged = own.is_none_or(|own| !self.memory.is_masked(own));
            let is_missing = state.is_taken_out || state.is_lost;
            own == Some(actuator) || !is_judged || !is_missing
        })
    }

    /// The input whose wrong reading would explain all that an actuator shows.
    fn doubtful_input(&self, actuator: usize) -> Option<usize> {
        let is_own =
            |sensor: usize| tables::SENSORS[sensor].actuator.map(usize::from) == Some(actuator);
        self.windows.doubts.iter().find_map(|doubts| {
            let mut known = tables::BOUNDARIES.iter().zip(doubts);
            let found = known
                .find(|(boundary, doubt)| is_own(boundary.sensor) && doubt.is_present(boundary));
            found.map(|(boundary, _)| boundary.input)
        })
    }

    /// The input that a shutdown waits for.
    fn doubtful_shutdown(&self, claim: usize) -> Option<usize> {
        let (actuator, _) = parts_of(claim).filter(|(_, action)| SWITCHES_OFF[*action])?;
        self.doubtful_input(actuator)
    }

    /// The doubtful input of a shutdown for which there would be enough evidence.
    fn withheld_input(&self) -> Option<usize> {
        let is_claimed = |claim| (0..LENGTHS).any(|length| self.margin(length, claim) >= 1.0);
        (1..HYPOTHESES)
            .filter(|&claim| is_claimed(claim))
            .find_map(|claim| self.doubtful_shutdown(claim))
    }

    /// Whether another length claims another actuator, or a longer one another action.
    fn is_contradicted(&self, length: usize, claim: usize) -> bool {
        let samples = |length: usize| self.windows.rings[length].window.samples;
        let actuator_of = |claim| parts_of(claim).map(|(actuator, _)| actuator);
        let mut others = (0..LENGTHS).filter(|&other| other != length);
        others.any(|other| {
            let is_longer = samples(other) > samples(length);
            let mut rivals = (1..HYPOTHESES).filter(|&rival| {
                rival != claim && (is_longer || actuator_of(rival) != actuator_of(claim))
            });
            rivals.any(|rival| self.margin(other, rival) >= 1.0)
        })
    }

    fn may_raise(&self, length: usize, claim: usize, actuator: usize) -> bool {
        let known = &tables::LENGTHS[length];
        self.memory.allows(claim)
            && self.is_comparable(actuator)
            && self.windows.judgements[length].agrees_on(known, claim)
            && self.windows.evidence[length].of_unknown(known) < 1.0
            && !self.is_contradicted(length, claim)
            && self.doubtful_shutdown(claim).is_none()
    }

    /// The action that a new window raises: of the longest window first, then the one with the largest margin.
    fn find_candidate(&self) -> Option<Raised> {
        let mut best = (0, 0.0);
        let mut candidate = None;
        for length in (0..LENGTHS).filter(|&length| self.windows.rings[length].has_ended) {
            let samples = self.windows.rings[length].window.samples;
            for claim in 1..HYPOTHESES {
                let own = (samples, self.margin(length, claim));
                let is_better = own.1 >= 1.0 && (candidate.is_none() || own > best);
                let parts = parts_of(claim).filter(|_| is_better);
                if let Some((actuator, action)) =
                    parts.filter(|&(actuator, _)| self.may_raise(length, claim, actuator))
                {
                    let judgement = &self.windows.judgements[length];
                    let (sample, confidence) =
                        (self.outcome.sample, judgement.probabilities[claim]);
                    let detail = judgement.agreed_detail();
                    best = own;
                    candidate =
                        Some(Raised { actuator, action, detail, sample, length, confidence });
                }
            }
        }
        candidate
    }

    /// Whether any length still has some evidence for the raised action.
    fn has_evidence(&self) -> bool {
        self.memory.raised.is_some_and(|raised| {
            let claim = hypothesis_of(raised.actuator, raised.action);
            (0..LENGTHS).any(|length| self.margin(length, claim) >= TUNING.pending_share)
        })
    }

    /// The actuator that at least one length is sure of, with the first such length, unless two disagree.
    fn find_actuator(&self) -> Option<(Finding, usize)> {
        let is_sure = |length: usize, actuator: usize| {
            let evidence = &self.windows.evidence[length];
            self.is_comparable(actuator)
                && evidence.margin_of_actuator(&tables::LENGTHS[length], actuator) >= 1.0
        };
        let pairs = (0..LENGTHS).flat_map(|length| (0..ACTUATORS).map(move |a| (length, a)));
        let mut sure = pairs.filter(|&(length, actuator)| is_sure(length, actuator));
        let (length, actuator) = sure.next()?;
        sure.all(|(_, other)| other == actuator).then_some((Finding::Actuator { actuator }, length))
    }

    /// The first length whose evidence reaches its limit.
    fn first_over(
        &self,
        evidence_of: fn(&Evidence, &crate::trained::Length) -> f64,
    ) -> Option<usize> {
        let mut lengths = self.windows.evidence.iter().zip(&tables::LENGTHS);
        lengths.position(|(evidence, length)| evidence_of(evidence, length) >= 1.0)
    }

    /// The finding without a raised action, and the length that found it.
    fn find_without_action(&self) -> (Finding, usize) {
        let with = |finding| move |length| (finding, length);
        let first_judged =
            || self.windows.judgements.iter().position(|judgement| judgement.has_judged);
        self.first_over(Evidence::of_unknown)
            .map(with(Finding::Unknown))
            .or_else(|| self.find_actuator())
            .or_else(|| self.first_over(Evidence::of_change).map(with(Finding::Detected)))
            .unwrap_or_else(|| (Finding::Healthy, first_judged().unwrap_or(0)))
    }

    fn is_any_pending(&self) -> bool {
        let mut lengths = self.windows.evidence.iter().zip(&tables::LENGTHS);
        lengths.any(|(evidence, length)| {
            evidence.of_change(length).max(evidence.of_unknown(length)) >= TUNING.pending_share
        })
    }

    /// Raises, holds or drops an action, and updates the finding.
    fn decide(&mut self) {
        let withheld = self.withheld_input();
        match self.find_candidate() {
            Some(candidate) => self.memory.raise(candidate),
            None => self.memory.hold(self.has_evidence(), self.outcome.sample),
        }
        let (finding, length) = match (self.memory.raised, withheld) {
            (Some(Raised { actuator, action, detail, length, .. }), _) => {
                let action_alone = Finding::Action { actuator, action };
                let with_detail = |detail| Finding::Detail { actuator, action, detail };
                (detail.map_or(action_alone, with_detail), length)
            }
            (None, Some(input)) => (Finding::EnvironmentInvalid { input, why: Why::Doubtful }, 0),
            (None, None) => self.find_without_action(),
        };
        self.report(finding, self.memory.state(self.is_any_pending()));
        self.report_window(length);
    }

    /// Reports the window length of the finding, and its confidence.
    fn report_window(&mut self, length: usize) {
        let judgement = &self.windows.judgements[length];
        let probability = |hypothesis: usize| judgement.probabilities[hypothesis];
        let outcome = &mut self.outcome;
        outcome.confidence = match outcome.finding {
            Finding::Healthy => probability(HEALTHY),
            Finding::Detected | Finding::Unknown => 1.0 - probability(HEALTHY),
            Finding::Actuator { actuator } => (0..ACTIONS)
                .map(|action| probability(hypothesis_of(actuator, action)))
                .fold(-0.0, |sum, own| sum + own),
            Finding::Action { .. } | Finding::Detail { .. } => {
                outcome.raised.map_or(0.0, |raised| raised.confidence)
            }
            Finding::Unjudged | Finding::EnvironmentInvalid { .. } => 0.0,
        };
        outcome.length = Some(length);
        if judgement.has_judged {
            (outcome.worst, outcome.worst_sensor) = (judgement.worst, Some(judgement.worst_sensor));
        }
    }
}
