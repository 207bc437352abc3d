//! The most work that one sample can take of the diagnosis: a bound that follows from the structure of trees and windows,
//! and a sequence of samples that comes near it.
//!
//! Work is counted in what takes most of the time and differs from sample to sample:
//!
//! - tests of trees: a comparison of a feature with a threshold,
//! - windows that are judged outside their bands, each of which needs its features in every view,
//! - panes that are merged into a window.
//!
//! The bound takes the deepest leaf of every tree that a window can ask, and the windows that one sample can complete. The
//! lengths of a stream take turns, so at most one of them ends at a sample; whether lengths of both streams ever end
//! together follows from their periods. No row need reach the deepest leaves of all trees at once, so the sequence may
//! stay below the bound.

use super::ProofEvidence;
use super::chain::{SessionAnswer, compare_sample, is_judged};
use super::library::Compiled;
use super::models::trees;
use super::samples::{Disturbance, Sample, Samples};
use crate::error::ExportError;
use serde::Serialize;
use servotwin_diagnosis::diagnoser::{Diagnoser, Length, Session};
use servotwin_diagnosis::hierarchy::{Hierarchy, Question, Stage};
use servotwin_diagnosis::random::Random;
use servotwin_diagnosis::tree::Branches;
use std::sync::Arc;

/// The share of candidates that are drawn anew; the others change the best one.
const FRESH: f64 = 0.25;

/// The share of sensors that a change of the best candidate disturbs otherwise.
const CHANGED: f64 = 0.15;

/// The work of one sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Work {
    /// Tests of trees.
    pub tests: u64,
    /// Windows judged outside their bands.
    pub windows: u64,
    /// Rows of features.
    pub rows: u64,
    /// Panes merged.
    pub panes: u64,
}

impl Work {
    fn map2(self, other: Work, combine: fn(u64, u64) -> u64) -> Work {
        Work {
            tests: combine(self.tests, other.tests),
            windows: combine(self.windows, other.windows),
            rows: combine(self.rows, other.rows),
            panes: combine(self.panes, other.panes),
        }
    }

    fn plus(self, other: Work) -> Work {
        self.map2(other, |a, b| a + b)
    }

    /// The larger of each number.
    fn largest(self, other: Work) -> Work {
        self.map2(other, u64::max)
    }

    /// Whether no number is larger than that of a bound.
    fn is_within(self, bound: Work) -> bool {
        self.largest(bound) == bound
    }
}

/// The bound, and how near a sequence of samples comes.
#[derive(Debug, Clone, Serialize)]
pub struct WorstPath {
    /// No sample takes more of anything.
    pub bound: Work,
    /// The work of the last sample of the sequence.
    pub reached: Work,
    /// The number of samples of the sequence.
    pub samples: u64,
    /// The number of sequences that were tried.
    pub trials: u64,
    #[serde(skip)]
    pub(super) sequence: Vec<Sample>,
}

impl WorstPath {
    /// Tries so many sequences.
    ///
    /// # Errors
    /// Those of [`Session::new`].
    pub fn find(diagnoser: &Arc<Diagnoser>, trials: u64) -> Result<Self, ExportError> {
        let mut random = Random::new(6);
        let (mut best, mut reached) = (Candidate::draw(diagnoser, &mut random), None);
        for _ in 0..trials {
            let candidate = match random.unit() < FRESH {
                true => Candidate::draw(diagnoser, &mut random),
                false => best.changed(&mut random),
            };
            let found = candidate.busiest(diagnoser)?;
            if found.0.tests >= reached.map_or(0, |(work, _): (Work, u64)| work.tests) {
                (best, reached) = (candidate, Some(found));
            }
        }
        let (reached, samples) = reached.unwrap_or_default();
        let sequence = best.samples(diagnoser).take(samples as usize).collect();
        Ok(WorstPath { bound: bound(diagnoser), reached, samples, trials, sequence })
    }

    /// Whether the sequence stays within the bound, as it must.
    pub fn holds(&self) -> bool {
        self.reached.is_within(self.bound)
    }

    /// Compares the sequence in all builds.
    pub(super) fn compare(
        &self,
        diagnoser: &Arc<Diagnoser>,
        compiled: &[Compiled],
        evidence: &mut [ProofEvidence],
    ) -> Result<(), ExportError> {
        let mut session = Session::new(diagnoser.clone())?;
        let mut others = compiled.iter().map(Compiled::session).collect::<Result<Vec<_>, _>>()?;
        let mut said = <[SessionAnswer; 2]>::default();
        for (number, sample) in self.sequence.iter().enumerate() {
            let sample = (number as u64, sample);
            if !compare_sample(&mut session, &mut others, sample, &mut said, evidence) {
                break;
            }
            evidence.iter_mut().for_each(|evidence| evidence.worst_path_samples += 1);
        }
        Ok(())
    }

    /// The sequence as CSV: a column for each input, measured value and value of the twin, SI.
    pub fn csv(&self, diagnoser: &Diagnoser) -> String {
        let inputs = diagnoser.environment.inputs.iter().map(|input| input.name.clone());
        let sensors = || diagnoser.sensors.iter().map(|sensor| sensor.name.as_str());
        let measured = sensors().map(|name| format!("measured {name}"));
        let twin = sensors().map(|name| format!("twin {name}"));
        let head = inputs.chain(measured).chain(twin).collect::<Vec<_>>().join(",");
        let line = |Sample { inputs, measured, twin }: &Sample| {
            let values = inputs.iter().chain(measured).chain(twin);
            values.map(|value| format!("{value:?}")).collect::<Vec<_>>().join(",")
        };
        let lines = self.sequence.iter().map(line);
        std::iter::once(head).chain(lines).map(|line| line + "\n").collect()
    }
}

/// A sequence that is quiet until the baseline is known, and disturbed from then on.
#[derive(Clone)]
struct Candidate {
    seed: u64,
    disturbances: Vec<Disturbance>,
}

impl Candidate {
    fn draw(diagnoser: &Diagnoser, random: &mut Random) -> Self {
        let disturbances = diagnoser.sensors.iter().map(|_| Disturbance::draw(random));
        Candidate { disturbances: disturbances.collect(), seed: random.index(1 << 30) as u64 }
    }

    fn changed(&self, random: &mut Random) -> Self {
        let mut changed = self.clone();
        for disturbance in &mut changed.disturbances {
            if random.unit() < CHANGED {
                *disturbance = Disturbance::draw(random);
            }
        }
        changed
    }

    /// Its samples: long enough that every window is full of the disturbance, and is completed in every order.
    fn samples(&self, diagnoser: &Diagnoser) -> impl Iterator<Item = Sample> {
        let settle = diagnoser.samples(diagnoser.tuning.settle_s);
        let baseline = diagnoser.baseline.map_or(0, |settings| u64::from(settings.settle_samples));
        let lengths = diagnoser.lengths.iter().filter_map(|length| length.span.samples());
        let (quiet, window) = (settle + baseline + 1, lengths.max().unwrap_or(1));
        let mut samples = Samples::steady(diagnoser, self.seed);
        (0..quiet + 2 * window).map(move |sample| {
            if sample == quiet {
                samples.disturb_with(&self.disturbances);
            }
            samples.next().clone()
        })
    }

    /// The work of the sample with the most tests, and the number of samples up to it.
    fn busiest(&self, diagnoser: &Arc<Diagnoser>) -> Result<(Work, u64), ExportError> {
        let mut session = Session::new(diagnoser.clone())?;
        let mut most = (Work::default(), 0);
        for (number, sample) in self.samples(diagnoser).enumerate() {
            session.push(&sample.inputs, &sample.measured, &sample.twin);
            let work = work_of_sample(&session);
            if work.tests >= most.0.tests {
                most = (work, number as u64 + 1);
            }
        }
        Ok(most)
    }
}

/// The work that the newest sample took.
fn work_of_sample(session: &Session) -> Work {
    let lengths = session.diagnoser().lengths.iter().enumerate();
    let ended = lengths.filter(|(place, _)| session.has_new_window(*place));
    ended.fold(Work::default(), |sum, (place, length)| {
        let panes = u64::from(length.span.panes.unwrap_or(0)) + 1;
        let judged = match is_judged(session, place) {
            true => work_of_window(session, place),
            false => Work::default(),
        };
        sum.plus(judged).plus(Work { panes, ..Work::default() })
    })
}

/// The work of a window that was judged outside its bands.
fn work_of_window(session: &Session, place: usize) -> Work {
    let (diagnoser, rows) = (session.diagnoser(), session.features(place));
    let panel = &diagnoser.lengths[place].panel;
    let committee = &panel.committee;
    let mut tests = tests_of_diagnosis(&panel.trees, rows);
    for (stage, actuator) in stages_of_probabilities(committee) {
        tests += tests_of(stage, &rows[stage.place.view(actuator)]);
    }
    if let Some((actuator, action)) = likeliest(session, place) {
        let stage = committee.stage(Question::Detail, actuator, action);
        tests += stage.map_or(0, |stage| tests_of(stage, &rows[stage.place.view(actuator)]));
    }
    let views = diagnoser.views_of(&diagnoser.lengths[place]) as u64;
    Work { tests, windows: 1, rows: views, panes: 0 }
}

/// The likeliest hypothesis; `None` for healthy.
fn likeliest(session: &Session, place: usize) -> Option<(u32, u32)> {
    let names = session.diagnoser().names();
    let (actuators, actions) = (names.actuators.len(), names.actions.len());
    let all = (0..actuators).flat_map(|actuator| (0..actions).map(move |a| (actuator, a)));
    let mut best = (None, session.probability(place, None));
    for (actuator, action) in all {
        let share = session.probability(place, Some((actuator, action)));
        if share > best.1 {
            best = (Some((actuator as u32, action as u32)), share);
        }
    }
    best.0
}

/// The stages that the probabilities of all hypotheses ask, with the actuator for which they are asked.
fn stages_of_probabilities(hierarchy: &Hierarchy) -> impl Iterator<Item = (&Stage, u32)> {
    let first = hierarchy.stage(Question::Actuator, 0, 0).map(|stage| (stage, 0));
    let actuators = 0..hierarchy.names.actuators.len() as u32;
    let of_actions = actuators
        .filter_map(|actuator| Some((hierarchy.stage(Question::Action, actuator, 0)?, actuator)));
    first.into_iter().chain(of_actions)
}

/// The tests on the way of a row through trees of the hierarchy.
fn tests_of_diagnosis(hierarchy: &Hierarchy, rows: &[Vec<f64>]) -> u64 {
    let Ok(diagnosis) = hierarchy.diagnose(rows, &mut hierarchy.scratch()) else { return 0 };
    let actuator = diagnosis.actuator;
    let asked = [
        hierarchy.stage(Question::Actuator, 0, 0),
        actuator.and_then(|actuator| hierarchy.stage(Question::Action, actuator, 0)),
        actuator
            .zip(diagnosis.action)
            .and_then(|(actuator, action)| hierarchy.stage(Question::Detail, actuator, action)),
    ];
    let view = |stage: &Stage| &rows[stage.place.view(actuator.unwrap_or(0))];
    asked.into_iter().flatten().map(|stage| tests_of(stage, view(stage))).sum()
}

/// The tests of all trees of a stage for a row.
fn tests_of(stage: &Stage, row: &[f64]) -> u64 {
    let own: Vec<f64> = stage.columns.iter().map(|&column| row[column as usize]).collect();
    // Each node of a path but the leaf is a test.
    let tests = |branches: &Branches| branches.path(&own).count() as u64 - 1;
    trees(&stage.model).into_iter().map(tests).sum()
}

/// The tests above the deepest leaf of a tree.
fn deepest(branches: &Branches) -> u64 {
    let mut depth = vec![0; branches.len()];
    // Children come after their parents.
    for node in 0..branches.len() {
        if let Some((left, right)) = branches.children(node) {
            (depth[left], depth[right]) = (depth[node] + 1, depth[node] + 1);
        }
    }
    depth.into_iter().max().unwrap_or(0)
}

/// The most tests of a stage.
fn most_tests(stage: Option<&Stage>) -> u64 {
    stage.map_or(0, |stage| trees(&stage.model).into_iter().map(deepest).sum())
}

/// When the windows of a length are completed, counted in samples since the windows were cleared, and the most work of one.
struct Turn {
    is_corrected: bool,
    /// The number of a sample that completes a window; the others follow at a distance of `period`.
    phase: u64,
    period: u64,
    work: Work,
}

impl Turn {
    /// Whether any sample completes a window of both.
    fn meets(&self, other: &Turn) -> bool {
        let (mut divisor, mut rest) = (self.period, other.period);
        while rest > 0 {
            (divisor, rest) = (rest, divisor % rest);
        }
        self.phase % divisor == other.phase % divisor
    }
}

/// The turns of the lengths of a stream: each takes a base pane one sample after the length before it.
fn turns(diagnoser: &Diagnoser, is_corrected: bool) -> Vec<Turn> {
    let is_own = |length: &&Length| length.baseline_corrected.is_some() == is_corrected;
    let own: Vec<&Length> = diagnoser.lengths.iter().filter(is_own).collect();
    let base = own.iter().map(|length| length.span.pane_samples).min().unwrap_or(1);
    let settle = diagnoser.baseline.map_or(0, |settings| u64::from(settings.settle_samples));
    let start = if is_corrected { settle } else { 0 };
    let turn = |(order, length): (usize, &&Length)| Turn {
        is_corrected,
        phase: start + order as u64,
        period: u64::from(length.span.pane_samples.div_ceil(base)) * u64::from(base),
        work: bound_of_window(diagnoser, length),
    };
    own.iter().enumerate().map(turn).collect()
}

/// The most work of one sample. With more lengths than samples in a base pane several may end at once; then all do.
fn bound(diagnoser: &Diagnoser) -> Work {
    let turns: Vec<Turn> =
        [false, true].into_iter().flat_map(|stream| turns(diagnoser, stream)).collect();
    let crowded = turns.iter().any(|turn| turns.len() as u64 > turn.period);
    if crowded {
        return turns.iter().fold(Work::default(), |sum, turn| sum.plus(turn.work));
    }
    let pairs = turns.iter().flat_map(|one| turns.iter().map(move |other| (one, other)));
    let met =
        pairs.filter(|(one, other)| one.is_corrected != other.is_corrected && one.meets(other));
    let of_pairs = met.map(|(one, other)| one.work.plus(other.work));
    turns.iter().map(|turn| turn.work).chain(of_pairs).fold(Work::default(), Work::largest)
}

/// The most work of a window.
fn bound_of_window(diagnoser: &Diagnoser, length: &Length) -> Work {
    let names = diagnoser.names();
    let (actuators, actions) = (names.actuators.len() as u32, names.actions.len() as u32);
    let trees = &length.panel.trees;
    let most_detail = |hierarchy: &Hierarchy, actuator: u32| {
        let stage = |action| most_tests(hierarchy.stage(Question::Detail, actuator, action));
        (0..actions).map(stage).max().unwrap_or(0)
    };
    let of_actuator = |actuator: u32| {
        most_tests(trees.stage(Question::Action, actuator, 0)) + most_detail(trees, actuator)
    };
    let of_trees = most_tests(trees.stage(Question::Actuator, 0, 0))
        + (0..actuators).map(of_actuator).max().unwrap_or(0);
    let committee = &length.panel.committee;
    let of_committee: u64 =
        stages_of_probabilities(committee).map(|(stage, _)| most_tests(Some(stage))).sum();
    let of_detail = (0..actuators).map(|actuator| most_detail(committee, actuator)).max();
    Work {
        tests: of_trees + of_committee + of_detail.unwrap_or(0),
        windows: 1,
        rows: diagnoser.views_of(length) as u64,
        panes: u64::from(length.span.panes.unwrap_or(0)) + 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_meet_where_a_sample_completes_both() {
        let turn =
            |phase, period| Turn { is_corrected: false, phase, period, work: Work::default() };
        for (one, other) in
            [((0, 10), (405, 10)), ((1, 40), (30, 10)), ((1, 40), (405, 6)), ((0, 4), (2, 6))]
        {
            let meet = (0..1000_u64).any(|sample| {
                [one, other]
                    .iter()
                    .all(|(phase, period)| sample >= *phase && (sample - phase) % period == 0)
            });
            let (one, other) = (turn(one.0, one.1), turn(other.0, other.1));
            assert_eq!(one.meets(&other), meet, "{} {}", other.phase, other.period);
        }
    }
}
