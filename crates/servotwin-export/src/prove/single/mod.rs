//! The proof of an export in single precision.
//!
//! Its sums are rounded differently than in training, so equal bits cannot be demanded. The proof has four parts:
//!
//! - the hand-written files, with the arithmetic and the tables of double precision, give the bits of training,
//! - the printed files and the arithmetic are those that servotwin writes,
//! - every tree takes the trained way for every row of single precision, and its leaves have the nearest numbers,
//! - all builds give the same bits as each other.
//!
//! What is decided differently is then counted and listed, over random samples and over flights.

mod decisions;
mod flights;

pub use decisions::Decisions;
pub use flights::FlightDecisions;

use super::chain::{Commands, SessionAnswer, is_same, obey, push};
use super::library::{Build, Compiled, RunningSession};
use super::samples::{Sample, Samples};
use super::{Plan, ProofEvidence, RANDOM_ROWS, chain, compare_parts, compile};
use crate::c;
use crate::error::ExportError;
use crate::precision::Precision;
use decisions::{HEAD, Tracker};
use serde::Serialize;
use servotwin_diagnosis::diagnoser::{Diagnoser, Session};
use std::slice;
use std::sync::Arc;

/// What an export in single precision decides differently than it was trained to. All builds decide the same.
#[derive(Debug, Clone, Default, Serialize)]
pub struct SingleEvidence {
    /// Over random samples.
    pub chain: Decisions,
    /// How often different raised actions were withdrawn from both, because they had lasted for 1000 samples.
    pub withdrawn: u64,
    /// Over flights; `None` if none were flown.
    pub flights: Option<FlightDecisions>,
    /// The rows of all differing decisions.
    #[serde(skip)]
    rows: String,
}

impl SingleEvidence {
    /// Each run of samples with the same differing decisions, as CSV.
    pub fn csv(&self) -> String {
        [HEAD, &self.rows].concat()
    }
}

/// Proves an export in single precision, and flies so many flights beside it. The last evidence is that of the hand-written
/// files in double precision. `tell` hears what was done, and its share.
///
/// # Errors
/// As [`super::prove`].
pub fn prove_single(
    plan: &Plan,
    builds: &[Build],
    flights: u64,
    tell: &mut dyn FnMut(&str, f64),
) -> Result<(Vec<ProofEvidence>, SingleEvidence), ExportError> {
    let (compiled, mut all) = compile(plan, builds, tell)?;
    let mut single = SingleEvidence::default();
    let share = |done: u64, of: u64| done as f64 / of.max(1) as f64;
    let tell_chain = &mut |done| tell("comparing the whole chain", share(done, plan.samples));
    compare_chain(plan, &compiled, (&mut all, &mut single), tell_chain)?;
    if let Some(study) = plan.study.filter(|_| flights > 0) {
        let tell_flights = &mut |done| tell("flying", share(done, flights));
        flights::compare(
            study,
            plan.diagnoser,
            &compiled,
            flights,
            (&mut all, &mut single),
            tell_flights,
        )?;
    }
    if let Some(build) = builds.first() {
        let tell_text =
            &mut |done| tell("comparing the text in double precision", share(done, plan.samples));
        all.push(prove_text(plan, build, tell_text)?);
    }
    Ok((all, single))
}

/// Compares the hand-written files with the trained diagnosis, in double precision and bit by bit.
fn prove_text(
    plan: &Plan,
    build: &Build,
    tell: &mut dyn FnMut(u64),
) -> Result<ProofEvidence, ExportError> {
    let mut files = plan.files.to_vec();
    for right in c::files_of_precision(plan.diagnoser, Precision::F64)? {
        if let Some(own) = files.iter_mut().find(|file| file.name == right.name) {
            *own = right;
        }
    }
    let compiled = Compiled::new(&files, build, None)?;
    let mut evidence = ProofEvidence::of(build);
    evidence.command += " (the hand-written files in double precision)";
    compare_parts(plan.diagnoser, (&compiled, Precision::F64), RANDOM_ROWS, &mut evidence)?;
    let (compiled, all) = (slice::from_ref(&compiled), slice::from_mut(&mut evidence));
    chain::compare(plan.diagnoser, compiled, plan.samples, all, tell)?;
    Ok(evidence)
}

/// The trained session, and those of all builds.
struct Beside<'c> {
    trained: Session,
    others: Vec<RunningSession<'c>>,
    said: [SessionAnswer; 3],
}

impl<'c> Beside<'c> {
    fn new(diagnoser: &Arc<Diagnoser>, compiled: &'c [Compiled]) -> Result<Self, ExportError> {
        let others = compiled.iter().map(Compiled::session).collect::<Result<Vec<_>, _>>()?;
        Ok(Beside { trained: Session::new(diagnoser.clone())?, others, said: Default::default() })
    }

    /// Passes a command of the flight control computer to all.
    fn obey(&mut self, (command, place): (usize, usize)) -> Result<(), ExportError> {
        obey(&mut self.trained, (command, place))?;
        self.others.iter_mut().for_each(|other| other.command(command as i32, place as i32));
        Ok(())
    }

    /// Gives a sample to all; returns what training and single precision say. `None` if the builds differ.
    fn push(
        &mut self,
        name: impl Fn() -> String,
        sample: &Sample,
        all: &mut [ProofEvidence],
    ) -> Option<(&SessionAnswer, &SessionAnswer)> {
        let [trained, first, other] = &mut self.said;
        push(&mut self.trained, sample, trained);
        for (place, (session, evidence)) in self.others.iter_mut().zip(all).enumerate() {
            let said = if place == 0 { &mut *first } else { &mut *other };
            session.push(sample, trained, said);
            if place > 0 && !is_same(first, other) {
                evidence.differ(name(), "other bits than in the first build".into());
                return None;
            }
        }
        Some((trained, first))
    }
}

/// Runs random samples, as for double precision.
fn compare_chain(
    plan: &Plan,
    compiled: &[Compiled],
    (all, single): (&mut [ProofEvidence], &mut SingleEvidence),
    tell: &mut dyn FnMut(u64),
) -> Result<(), ExportError> {
    let mut beside = Beside::new(plan.diagnoser, compiled)?;
    let mut generated = Samples::new(plan.diagnoser, 1);
    let mut commands = Commands::new();
    let mut tracker = Tracker::new(plan.diagnoser);
    for k in 0..plan.samples {
        if let Some(command) = commands.next(&beside.trained) {
            beside.obey(command)?;
        }
        let name = || format!("whole chain, sample {k}");
        let Some((trained, said)) = beside.push(name, generated.next(), all) else { break };
        let accused = tracker.compare(k, trained, said);
        single.withdrawn += u64::from(!accused.is_empty());
        for actuator in accused {
            beside.obey((1, actuator))?;
        }
        all.iter_mut().for_each(|evidence| evidence.samples += 1);
        if k % 100_000 == 0 {
            tell(k);
        }
    }
    single.rows += &tracker.rows("random");
    single.chain = tracker.counts;
    Ok(())
}
