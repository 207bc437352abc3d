//! Sequences of samples that show modified condition/decision coverage (MC/DC) of the hand-written C code, for the user's
//! own rig.
//!
//! A copy of the export records which evaluations of each decision occur. Random sequences are searched, and the beginnings
//! of some are chosen that together show as many conditions as all of them. These are run once more, and the result counts
//! only what that run recorded. It is also compared with the trained diagnosis, sample by sample.

mod flight;
mod reasons;
mod recorder;
mod script;
mod table;

pub use table::{FileCoverage, OpenCondition};

use super::chain::{SessionAnswer, compare_sample, obey, push};
use super::library::{Build, Compiled};
use super::samples::Sample;
use super::{MOST_DIFFERENCES, Plan, ProofEvidence};
use crate::error::ExportError;
use crate::mcdc::{Decision, DecisionKind, Shown, Vector};
use crate::precision::Precision;
use recorder::{Evaluation, Recorder, Recording};
use script::Script;
use serde::Serialize;
use servotwin_diagnosis::diagnoser::{Diagnoser, Session};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// The longest sequence, in samples.
const LONGEST: u64 = 6000;

/// What a sequence costs beside its samples when sequences are chosen.
const COST: u64 = 20;

/// A condition with one of its values, to be decided by it.
type Half = (usize, usize, bool);

/// A sample, and the command of the flight control computer before it.
#[derive(Debug, Clone)]
struct Step {
    /// A command as `prove_command` of the C text numbers it, and its place.
    command: Option<(usize, usize)>,
    sample: Sample,
}

/// What receives the samples of a sequence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Entry {
    Session,
    Hybrid,
}

/// Samples from a start.
#[derive(Debug, Clone)]
struct Sequence {
    entry: Entry,
    steps: Vec<Step>,
    /// The outcome of each step: its integers and its numbers, as the trained diagnosis gives them; none if the twin cannot
    /// be simulated.
    outcomes: Vec<Option<([i64; 18], [f64; 3])>>,
}

/// Where an evaluation occurred first: the places of the sequence and of the sample, from 0.
type Spot = (usize, usize);

/// A condition, and how it was shown.
#[derive(Debug, Clone)]
struct Row {
    decision: usize,
    condition: usize,
    shown: Shown,
    /// The samples of a pair, with true first, or the one of a case.
    spots: Vec<Spot>,
    /// How often it was true and false.
    counts: [u64; 2],
    /// Whether the evaluations of the pair differ in nothing else.
    is_unique_cause: bool,
    reason: Option<&'static str>,
}

/// MC/DC of an export, and the samples that show it.
#[derive(Debug, Clone, Serialize)]
pub struct Vectors {
    /// Decisions of the measured files.
    pub decisions: usize,
    /// Their conditions, with the cases of `switch`.
    pub conditions: usize,
    /// Conditions whose independent effect is shown.
    pub shown: usize,
    /// Those of them whose two evaluations differ in no other condition.
    pub unique_cause: usize,
    /// Sequences, and their samples.
    pub sequences: usize,
    /// Samples of all sequences.
    pub samples: u64,
    /// Sequences that were searched.
    pub trials: u64,
    /// The same by file.
    pub files: BTreeMap<&'static str, FileCoverage>,
    /// Conditions that are not shown.
    pub open: Vec<OpenCondition>,
    /// Differences between the recording build and the trained diagnosis; none if it records the proven code.
    pub differences: Vec<super::RowDifference>,
    #[serde(skip)]
    all: Vec<Decision>,
    #[serde(skip)]
    rows: Vec<Row>,
    #[serde(skip)]
    chosen: Vec<Sequence>,
}

/// A sequence of the search: when it shows each half first.
struct Candidate {
    seed: u64,
    firsts: BTreeMap<Half, u64>,
}

impl Vectors {
    /// Checks that vectors can be found for the text of a build.
    ///
    /// # Errors
    /// [`ExportError::Unsupported`] for an export as Rust or in single precision.
    pub fn check(build: &Build, precision: Precision) -> Result<(), ExportError> {
        let why =
            "vectors are found for an export as C in double precision alone: leave '--vectors' out";
        let can_be_found = !build.is_rust() && precision == Precision::F64;
        if can_be_found { Ok(()) } else { Err(ExportError::Unsupported(why)) }
    }

    /// Searches so many sequences. `tell` hears how many so far.
    ///
    /// # Errors
    /// Those of [`Vectors::check`]; [`ExportError::NotUnderstood`] for a text whose decisions are not certain; those of
    /// [`super::prove`].
    pub fn find(
        plan: &Plan,
        build: &Build,
        trials: u64,
        tell: &mut dyn FnMut(u64),
    ) -> Result<Self, ExportError> {
        Self::check(build, plan.precision)?;
        // Any level gives the same bits, and this one is fast.
        let recording = Recording::new(plan.files, &Build { level: "-O2", ..build.clone() })?;
        let mut candidates = Vec::new();
        for seed in 0..trials {
            candidates.push(try_script(plan.diagnoser, &recording, seed)?);
            tell(seed + 1);
        }
        let mut chosen = choose(&candidates)
            .into_iter()
            .map(|(seed, samples)| script(plan.diagnoser, &recording, seed, samples))
            .collect::<Result<Vec<_>, _>>()?;
        if let Some(subject) = plan.subject() {
            chosen.push(flight::sequence(&subject)?);
        }
        Self::measure(plan, &recording, chosen, trials)
    }

    /// Runs the chosen sequences and counts what they show.
    fn measure(
        plan: &Plan,
        recording: &Recording,
        mut chosen: Vec<Sequence>,
        trials: u64,
    ) -> Result<Self, ExportError> {
        let mut recorder = recording.recorder()?;
        recorder.forget();
        let mut evidence = [ProofEvidence::until(MOST_DIFFERENCES)];
        let mut found: BTreeMap<usize, Vec<(Vector, Spot)>> = BTreeMap::new();
        for (place, sequence) in chosen.iter_mut().enumerate() {
            let compiled = std::slice::from_ref(&recording.compiled);
            let mut note = |sample: usize| {
                for Evaluation { decision, vector } in recorder.take_new()? {
                    found.entry(decision).or_default().push((vector, (place, sample)));
                }
                Ok(())
            };
            sequence.run(plan, compiled, &mut evidence, &mut note)?;
        }
        let [ProofEvidence { differences, .. }] = evidence;
        let rows = rows(&recording.decisions, &found, &recorder, plan.diagnoser);
        let count = |keep: &dyn Fn(&Row) -> bool| rows.iter().filter(|row| keep(row)).count();
        Ok(Vectors {
            decisions: recording.decisions.len(),
            conditions: rows.len(),
            shown: count(&Row::is_shown),
            unique_cause: count(&|row| row.is_shown() && row.is_unique_cause),
            sequences: chosen.len(),
            samples: chosen.iter().map(|sequence| sequence.steps.len() as u64).sum(),
            trials,
            files: table::by_file(&recording.decisions, &rows),
            open: table::open(&recording.decisions, &rows),
            differences,
            all: recording.decisions.clone(),
            rows,
            chosen,
        })
    }

    /// Whether the recording build answers as trained, and every reason for an open condition is true.
    pub fn holds(&self) -> bool {
        let is_refuted = |row: &Row| row.is_shown() && row.reason.is_some();
        self.differences.is_empty() && !self.rows.iter().any(is_refuted)
    }

    /// Compares the sequences in all builds.
    pub(super) fn compare(
        &self,
        plan: &Plan,
        compiled: &[Compiled],
        evidence: &mut [ProofEvidence],
    ) -> Result<(), ExportError> {
        for sequence in &self.chosen {
            sequence.clone().run(plan, compiled, evidence, &mut |_| Ok(()))?;
            let samples = sequence.steps.len() as u64;
            evidence.iter_mut().for_each(|evidence| evidence.vector_samples += samples);
        }
        Ok(())
    }

    /// The sequences as CSV: commands, samples and outcomes.
    pub fn csv(&self, diagnoser: &Diagnoser) -> String {
        table::sequences(&self.chosen, diagnoser)
    }

    /// All conditions as CSV, with the samples that show each.
    pub fn decisions_csv(&self) -> String {
        table::conditions(&self.all, &self.rows)
    }
}

impl Row {
    fn is_shown(&self) -> bool {
        !matches!(self.shown, Shown::Missing { .. })
    }
}

impl Sequence {
    /// Runs it in the trained diagnosis, which gives its outcomes, and beside that in all builds. `note` hears the place of
    /// each sample.
    fn run(
        &mut self,
        plan: &Plan,
        compiled: &[Compiled],
        evidence: &mut [ProofEvidence],
        note: &mut dyn FnMut(usize) -> Result<(), ExportError>,
    ) -> Result<(), ExportError> {
        match (self.entry, plan.subject()) {
            (Entry::Session, _) => self.run_session(plan.diagnoser, compiled, evidence, note),
            (Entry::Hybrid, Some(subject)) => flight::run(self, &subject, compiled, evidence, note),
            (Entry::Hybrid, None) => Ok(()),
        }
    }

    fn run_session(
        &mut self,
        diagnoser: &Arc<Diagnoser>,
        compiled: &[Compiled],
        evidence: &mut [ProofEvidence],
        note: &mut dyn FnMut(usize) -> Result<(), ExportError>,
    ) -> Result<(), ExportError> {
        let mut session = Session::new(diagnoser.clone())?;
        let mut others = compiled.iter().map(Compiled::session).collect::<Result<Vec<_>, _>>()?;
        let mut said = <[SessionAnswer; 2]>::default();
        self.outcomes.clear();
        for (number, Step { command, sample }) in self.steps.iter().enumerate() {
            if let Some((command, place)) = *command {
                obey(&mut session, (command, place))?;
                others.iter_mut().for_each(|other| other.command(command as i32, place as i32));
            }
            let numbered = (number as u64, sample);
            if !compare_sample(&mut session, &mut others, numbered, &mut said, evidence) {
                break;
            }
            note(number)?;
            self.outcomes.push(Some(table::outcome(session.outcome())));
        }
        Ok(())
    }
}

/// The steps of a script, with the answers of a recording session.
fn follow(
    diagnoser: &Arc<Diagnoser>,
    recording: &Recording,
    seed: u64,
    samples: u64,
    hear: &mut dyn FnMut(u64, Step) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    let mut script = Script::new(diagnoser, seed);
    let mut session = recording.compiled.session()?;
    let (mut like, mut said) = (SessionAnswer::default(), SessionAnswer::default());
    let mut accused = None;
    for number in 0..samples {
        let step = script.next(accused);
        if number == 0 {
            // The lists of what is said are as long as those of the diagnoser.
            push(&mut Session::new(diagnoser.clone())?, &step.sample, &mut like);
        }
        if let Some((command, place)) = step.command {
            session.command(command as i32, place as i32);
        }
        session.push(&step.sample, &like, &mut said);
        accused = table::accused(&said.integers);
        hear(number, step)?;
    }
    Ok(())
}

fn try_script(
    diagnoser: &Arc<Diagnoser>,
    recording: &Recording,
    seed: u64,
) -> Result<Candidate, ExportError> {
    let mut recorder = recording.recorder()?;
    recorder.forget();
    let mut firsts = BTreeMap::new();
    follow(diagnoser, recording, seed, LONGEST, &mut |number, _| {
        for evaluation in recorder.take_new()? {
            for half in halves(&recording.decisions, evaluation) {
                firsts.entry(half).or_insert(number);
            }
        }
        Ok(())
    })?;
    Ok(Candidate { seed, firsts })
}

fn script(
    diagnoser: &Arc<Diagnoser>,
    recording: &Recording,
    seed: u64,
    samples: u64,
) -> Result<Sequence, ExportError> {
    let mut steps = Vec::new();
    follow(diagnoser, recording, seed, samples, &mut |_, step| {
        steps.push(step);
        Ok(())
    })?;
    Ok(Sequence { entry: Entry::Session, steps, outcomes: Vec::new() })
}

/// The conditions that decided an evaluation, with their values.
fn halves(decisions: &[Decision], evaluation: Evaluation) -> impl Iterator<Item = Half> {
    let Evaluation { decision, vector } = evaluation;
    let known = &decisions[decision];
    (0..known.conditions.len()).filter_map(move |condition| {
        let value = vector.value(condition)?;
        known.tree.is_decided_by(condition, &vector).then_some((decision, condition, value))
    })
}

/// Beginnings of sequences that together show what all do: again and again the one that shows the most for its length.
fn choose(candidates: &[Candidate]) -> Vec<(u64, u64)> {
    let mut left: BTreeSet<Half> =
        candidates.iter().flat_map(|candidate| candidate.firsts.keys().copied()).collect();
    let mut lengths: BTreeMap<u64, u64> = BTreeMap::new();
    while !left.is_empty() {
        let best = candidates
            .iter()
            .filter_map(|candidate| {
                let done = lengths.get(&candidate.seed).copied();
                best_beginning(candidate, &left, done).map(|found| (found, candidate))
            })
            .max_by(|((a, _), _), ((b, _), _)| a.total_cmp(b));
        let Some(((_, length), candidate)) = best else { break };
        left.retain(|half| candidate.firsts.get(half).is_none_or(|first| *first >= length));
        lengths.insert(candidate.seed, length);
    }
    lengths.into_iter().collect()
}

/// The beginning of a sequence that shows the most new halves for the samples that it adds, and their ratio.
fn best_beginning(
    candidate: &Candidate,
    left: &BTreeSet<Half>,
    done: Option<u64>,
) -> Option<(f64, u64)> {
    let mut firsts: Vec<u64> = candidate
        .firsts
        .iter()
        .filter(|(half, _)| left.contains(half))
        .map(|(_, first)| *first)
        .collect();
    firsts.sort_unstable();
    let cost = |length: u64| match done {
        Some(done) => length.saturating_sub(done) + 1,
        None => length + COST,
    };
    let ratios = firsts.iter().enumerate().map(|(place, first)| {
        let length = first + 1;
        ((place + 1) as f64 / cost(length) as f64, length)
    });
    ratios.max_by(|(a, _), (b, _)| a.total_cmp(b))
}

/// All conditions with what the evaluations show of them.
fn rows(
    decisions: &[Decision],
    found: &BTreeMap<usize, Vec<(Vector, Spot)>>,
    recorder: &Recorder,
    diagnoser: &Diagnoser,
) -> Vec<Row> {
    let mut rows = Vec::new();
    for (number, decision) in decisions.iter().enumerate() {
        let seen = found.get(&number).map_or(&[][..], Vec::as_slice);
        let vectors: Vec<Vector> = seen.iter().map(|(vector, _)| *vector).collect();
        for condition in 0..decision.conditions.len() {
            let shown = decision.find(condition, &vectors);
            let places = match shown {
                Shown::Pair(pair) => pair.to_vec(),
                Shown::Case(case) => vec![case],
                Shown::Missing { .. } => vec![],
            };
            let mut counts = [0; 2];
            for (place, vector) in vectors.iter().enumerate() {
                if let Some(value) = vector.value(condition) {
                    counts[usize::from(!value)] += recorder.count(number, place);
                }
            }
            let is_unique_cause = match shown {
                Shown::Pair([a, b]) => vectors[a].differs_only_in(&vectors[b], condition),
                _ => decision.kind == DecisionKind::Switch,
            };
            let reason = reasons::of(decision, condition, diagnoser);
            let spots = places.into_iter().map(|place| seen[place].1).collect();
            rows.push(Row {
                decision: number,
                condition,
                shown,
                spots,
                counts,
                is_unique_cause,
                reason,
            });
        }
    }
    rows
}
