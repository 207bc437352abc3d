//! What a diagnosis in single precision decides differently than the trained one: counted, and listed row by row.

use crate::prove::chain::SessionAnswer;
use serde::Serialize;
use servotwin_diagnosis::diagnoser::Diagnoser;
use std::fmt::Write;

/// The longest time for which both may have different raised actions, in samples; then the flight control computer withdraws
/// them, so that one difference does not hide others.
const LONGEST: u64 = 1000;

/// The integers of [`Said`] that are decisions: the finding with its parts, the alarm, and the raised action with its detail.
const DECISION: std::ops::Range<usize> = 2..13;

/// The names of findings and alarms, by the numbers of the C text.
const FINDINGS: [&str; 8] = [
    "not judged",
    "healthy",
    "detected",
    "actuator",
    "action",
    "detail",
    "unknown",
    "input invalid",
];
const ALARMS: [&str; 6] = ["normal", "pending", "raised", "recovering", "no data", "error"];

/// What a diagnosis decided at a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Decision([i64; 11]);

/// A raised action: actuator and action.
pub(super) type Raised = Option<(i64, i64)>;

impl Decision {
    /// The decision of everything that was said.
    pub fn of(said: &SessionAnswer) -> Self {
        let mut decision = [0; 11];
        decision.copy_from_slice(&said.integers[DECISION]);
        Decision(decision)
    }

    /// The raised action.
    pub fn raised(self) -> Raised {
        let [.., is_raised, actuator, action, _] = self.0;
        (is_raised == 1).then_some((actuator, action))
    }

    /// The names of what differs from another one.
    fn differing(self, other: Decision) -> String {
        let parts = [
            ("finding", 0..1),
            ("actuator", 1..2),
            ("action", 2..3),
            ("detail", 3..4),
            ("input", 4..6),
            ("alarm", 6..7),
            ("raised", 7..10),
            ("raised detail", 10..11),
        ];
        let differing = parts.into_iter().filter(|(_, places)| {
            let places = places.clone();
            self.0[places.clone()] != other.0[places]
        });
        differing.map(|(name, _)| name).collect::<Vec<_>>().join(" ")
    }

    /// The decision in words.
    fn describe(self, diagnoser: &Diagnoser) -> [String; 3] {
        let names = diagnoser.names();
        let name = |list: &[String], place: i64| {
            let known = usize::try_from(place).ok().and_then(|place| list.get(place));
            known.map_or(String::new(), |name| format!(" {name}"))
        };
        let [
            kind,
            actuator,
            action,
            detail,
            input,
            _,
            alarm,
            is_raised,
            its_actuator,
            its_action,
            its_detail,
        ] = self.0;
        let inputs: Vec<String> =
            diagnoser.environment.inputs.iter().map(|input| input.name.clone()).collect();
        let parts = |actuator, action, detail| {
            let of_actuator = name(&names.actuators, actuator);
            of_actuator + &name(&names.actions, action) + &name(&names.details, detail)
        };
        let finding = FINDINGS.get(kind as usize).copied().unwrap_or_default();
        let raised = parts(its_actuator, its_action, its_detail).trim().to_owned();
        [
            format!("{finding}{}{}", parts(actuator, action, detail), name(&inputs, input)),
            ALARMS.get(alarm as usize).copied().unwrap_or_default().into(),
            if is_raised == 1 { raised } else { String::new() },
        ]
    }
}

/// Where the numbers of [`Said`] stand.
struct Layout {
    actuators: usize,
    actions: usize,
    lengths: usize,
    boundaries: usize,
}

impl Layout {
    fn hypotheses(&self) -> usize {
        self.actuators * self.actions
    }

    fn start(&self, length: usize) -> usize {
        let each = 3 + 2 * self.hypotheses() + 2 * self.actuators + 2 * self.boundaries;
        3 + length * each
    }

    /// The evidence that decides about a finding, in parts of its limit: the largest of all window lengths.
    fn deciding(&self, said: &SessionAnswer, of: Decision) -> f64 {
        let [kind, actuator, action, ..] = of.0;
        let (actuator, action) = (actuator.max(0) as usize, action.max(0) as usize);
        let hypotheses = self.hypotheses();
        let place = match kind {
            3 => 3 + 2 * hypotheses + 2 * actuator,
            4 | 5 => 3 + hypotheses + actuator * self.actions + action,
            6 => 1,
            _ => 0,
        };
        let of_lengths = (0..self.lengths).map(|length| said.numbers[self.start(length) + place]);
        of_lengths.fold(f64::NEG_INFINITY, f64::max)
    }

    /// The largest differences of evidence, in parts of its limit, and of a probability.
    fn differences(&self, double: &SessionAnswer, single: &SessionAnswer) -> [f64; 2] {
        let hypotheses = self.hypotheses();
        let mut largest = [0.0_f64; 2];
        for length in 0..self.lengths {
            let start = self.start(length);
            let mut note = |kind: usize, place: usize| {
                let difference = (double.numbers[place] - single.numbers[place]).abs();
                largest[kind] = largest[kind].max(difference);
            };
            let probabilities = start + 2..start + 3 + hypotheses;
            let margins = probabilities.end..probabilities.end + hypotheses;
            probabilities.for_each(|place| note(1, place));
            (start..start + 2).chain(margins).for_each(|place| note(0, place));
        }
        largest
    }
}

/// How raised actions differ: by name, and in which order they count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum RaisedKind {
    /// Another action or another actuator that is not switched off.
    Other,
    /// Single precision raises an action, and training raises none.
    FalseAlarm,
    /// Training switches an actuator off, and single precision does not.
    MissedShutdown,
    /// Single precision switches off an actuator that training leaves on, and accuses another one.
    WrongShutdown,
}

impl RaisedKind {
    /// How two different raised actions differ.
    pub fn of(switches_off: &[bool], double: Raised, single: Raised) -> Self {
        let shutdown = |raised: Raised| {
            raised
                .filter(|(_, action)| switches_off[*action as usize])
                .map(|(actuator, _)| actuator)
        };
        match (double, single) {
            (None, Some(_)) => RaisedKind::FalseAlarm,
            (Some((accused, _)), _) if shutdown(single).is_some_and(|off| off != accused) => {
                RaisedKind::WrongShutdown
            }
            _ if shutdown(double).is_some() => RaisedKind::MissedShutdown,
            _ => RaisedKind::Other,
        }
    }
}

/// What single precision decided differently.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Decisions {
    /// Compared samples.
    pub samples: u64,
    /// Those with another finding, alarm or raised action.
    pub differing_samples: u64,
    /// Runs of such samples.
    pub differing_runs: u64,
    /// Actions that both raised.
    pub raised: u64,
    /// Those that single precision raised at another sample.
    pub shifted: u64,
    /// By how many samples at most.
    pub largest_shift: u64,
    /// Shutdowns of an actuator that training leaves on, while it accuses another one.
    pub wrong_shutdowns: u64,
    /// Shutdowns that single precision does not raise.
    pub missed_shutdowns: u64,
    /// Actions while training raises none.
    pub false_alarms: u64,
    /// Other differences of the raised action.
    pub other_actions: u64,
    /// The largest difference of evidence while both decided the same, in parts of its limit.
    pub largest_evidence: f64,
    /// The largest difference of a probability while both decided the same.
    pub largest_probability: f64,
}

impl Decisions {
    /// Counts a lasting difference of the raised action.
    pub(super) fn count(&mut self, kind: RaisedKind) {
        *match kind {
            RaisedKind::Other => &mut self.other_actions,
            RaisedKind::FalseAlarm => &mut self.false_alarms,
            RaisedKind::MissedShutdown => &mut self.missed_shutdowns,
            RaisedKind::WrongShutdown => &mut self.wrong_shutdowns,
        } += 1;
    }
}

/// Consecutive samples with the same two decisions.
#[derive(Debug, Clone, PartialEq)]
struct Run {
    first: u64,
    samples: u64,
    double: Decision,
    single: Decision,
    /// The evidence that decided, at the first sample.
    evidence: [f64; 2],
    limit: f64,
}

/// Different raised actions that last.
struct Episode {
    first: u64,
    kind: RaisedKind,
}

/// Compares decisions sample by sample.
pub(super) struct Tracker<'d> {
    diagnoser: &'d Diagnoser,
    layout: Layout,
    switches_off: Vec<bool>,
    runs: Vec<Run>,
    is_open: bool,
    episode: Option<Episode>,
    last_raised: Raised,
    /// The counts so far.
    pub counts: Decisions,
}

impl<'d> Tracker<'d> {
    /// Nothing compared yet.
    pub fn new(diagnoser: &'d Diagnoser) -> Self {
        let names = diagnoser.names();
        Tracker {
            layout: Layout {
                actuators: names.actuators.len(),
                actions: names.actions.len(),
                lengths: diagnoser.lengths.len(),
                boundaries: diagnoser.boundaries.len(),
            },
            switches_off: diagnoser.tuning.switches_off(names),
            diagnoser,
            runs: Vec::new(),
            is_open: false,
            episode: None,
            last_raised: None,
            counts: Decisions::default(),
        }
    }

    /// Compares a sample. Returns the actuators whose raised actions must be withdrawn from both, because they have differed
    /// for too long.
    pub fn compare(
        &mut self,
        sample: u64,
        double: &SessionAnswer,
        single: &SessionAnswer,
    ) -> Vec<usize> {
        let (own, other) = (Decision::of(double), Decision::of(single));
        self.counts.samples += 1;
        if own == other {
            let [evidence, probability] = self.layout.differences(double, single);
            self.counts.largest_evidence = self.counts.largest_evidence.max(evidence);
            self.counts.largest_probability = self.counts.largest_probability.max(probability);
            self.is_open = false;
        } else {
            self.differ(sample, (own, double), (other, single));
        }
        self.follow(sample, own.raised(), other.raised())
    }

    fn differ(
        &mut self,
        sample: u64,
        (own, double): (Decision, &SessionAnswer),
        (other, single): (Decision, &SessionAnswer),
    ) {
        self.counts.differing_samples += 1;
        let last = self.runs.last_mut().filter(|_| self.is_open);
        if let Some(run) = last.filter(|run| (run.double, run.single) == (own, other)) {
            run.samples += 1;
            return;
        }
        self.counts.differing_runs += 1;
        self.is_open = true;
        // The more specific finding needs the evidence.
        let decided = if other.0[0] > own.0[0] { other } else { own };
        let is_pending = own.0[0] == other.0[0];
        self.runs.push(Run {
            first: sample,
            samples: 1,
            double: own,
            single: other,
            evidence: [double, single].map(|said| self.layout.deciding(said, decided)),
            limit: if is_pending { self.diagnoser.tuning.pending_share } else { 1.0 },
        });
    }

    /// Follows the raised actions of both.
    fn follow(&mut self, sample: u64, double: Raised, single: Raised) -> Vec<usize> {
        let is_new = double.is_some() && double != self.last_raised;
        self.counts.raised += u64::from(is_new);
        self.last_raised = double;
        if double == single {
            if let Some(Episode { first, kind }) = self.episode.take() {
                match double {
                    Some(_) => {
                        self.counts.shifted += 1;
                        self.counts.largest_shift = self.counts.largest_shift.max(sample - first);
                    }
                    None => self.counts.count(kind),
                }
            }
            return Vec::new();
        }
        let now = RaisedKind::of(&self.switches_off, double, single);
        let episode = self.episode.get_or_insert(Episode { first: sample, kind: now });
        episode.kind = episode.kind.max(now);
        if sample - episode.first < LONGEST {
            return Vec::new();
        }
        let kind = episode.kind;
        self.counts.count(kind);
        self.episode = None;
        let mut accused: Vec<usize> =
            [double, single].into_iter().flatten().map(|(actuator, _)| actuator as usize).collect();
        accused.dedup();
        accused
    }

    /// The rows of all differing decisions of a run with a name, as CSV without a head.
    pub fn rows(&self, name: &str) -> String {
        let mut text = String::new();
        for run in &self.runs {
            let [finding, alarm, raised] = run.double.describe(self.diagnoser);
            let [its_finding, its_alarm, its_raised] = run.single.describe(self.diagnoser);
            let [evidence, its_evidence] = run.evidence;
            let differing = run.double.differing(run.single);
            let time_s = run.first as f64 * self.diagnoser.period_s;
            let _ = writeln!(
                text,
                "{name},{},{time_s:.3},{},{differing},{finding},{its_finding},{alarm},{its_alarm},{raised},{its_raised},\
                 {evidence:.7},{its_evidence:.7},{:.3e}",
                run.first,
                run.samples,
                (evidence - run.limit).abs()
            );
        }
        text
    }
}

/// The head of [`Tracker::rows`].
pub(super) const HEAD: &str = "run,sample,time_s,samples,differs,finding,single_finding,alarm,single_alarm,raised,\
                               single_raised,evidence,single_evidence,distance_from_limit\n";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn raised_actions_that_differ_have_names() {
        let off = [true, false];
        let kind = |double, single| RaisedKind::of(&off, double, single);
        assert_eq!(kind(None, Some((0, 0))), RaisedKind::FalseAlarm);
        assert_eq!(kind(Some((1, 0)), Some((0, 0))), RaisedKind::WrongShutdown);
        assert_eq!(kind(Some((1, 1)), Some((0, 0))), RaisedKind::WrongShutdown);
        assert_eq!(kind(Some((0, 0)), None), RaisedKind::MissedShutdown);
        assert_eq!(kind(Some((0, 0)), Some((0, 1))), RaisedKind::MissedShutdown);
        assert_eq!(kind(Some((0, 1)), None), RaisedKind::Other);
    }
}
