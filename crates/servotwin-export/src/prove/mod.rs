//! Proof that an export decides as its diagnoser does: it is compiled, loaded and compared bit by bit.

mod chain;
mod hybrid;
mod library;
mod models;
mod names;
mod points;
mod rows;
mod samples;
mod twin;

pub use library::Build;

use crate::error::ExportError;
use crate::source_file::SourceFile;
use crate::twin::ExportedTwin;
use library::Compiled;
use serde::Serialize;
use servotwin::study::Study;
use servotwin_diagnosis::diagnoser::Diagnoser;
use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::sync::Arc;

/// The number of differences after which nothing more is compared.
const MOST_DIFFERENCES: usize = 20;

/// Points at which the equations of the twin are evaluated.
const POINTS: u64 = 2000;

/// Samples through twin and diagnosis together.
const HYBRID_SAMPLES: u64 = 3000;

/// The duration of a variant of the twin, s.
const VARIANT_S: f64 = 90.0;

/// Rows of random values for each hierarchy of a proof.
const RANDOM_ROWS: usize = 20_000;

/// A row for which the export answers otherwise.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RowDifference {
    /// The model.
    pub place: String,
    /// Its answer, and the right one.
    pub(crate) what: String,
}

/// What one build was compared on.
#[derive(Debug, Clone, PartialEq, Serialize, Default)]
pub struct ProofEvidence {
    /// The compiler with its flags.
    pub(crate) command: String,
    /// The compiler's version.
    pub(crate) version: String,
    /// Whether the start test knows the answers of training.
    pub is_exact: bool,
    /// Leaves of all trees.
    pub(crate) leaves: u64,
    /// Leaves that no row reached, although one could.
    pub(crate) leaves_not_reached: u64,
    /// Nodes that no row can reach, because tests above them exclude each other.
    pub(crate) unreachable_nodes: u64,
    /// Thresholds of all trees, each compared one step below, at, and one step above, and without a value.
    pub thresholds: u64,
    /// Rows for leaves and thresholds.
    pub rows: u64,
    /// Random rows through whole hierarchies.
    pub(crate) random_rows: u64,
    /// Samples through the whole chain.
    pub samples: u64,
    /// Random points at which the equations of the twin and their gradients were compared.
    pub points: u64,
    /// Variants of the twin that were simulated to the end.
    pub variants: u64,
    /// Those of them that found no steady state to begin with.
    pub(crate) unsettled: u64,
    /// Samples of all variants.
    pub twin_samples: u64,
    /// Samples through twin and diagnosis together.
    pub(crate) hybrid_samples: u64,
    /// Actions that were raised on the way, with their number.
    pub raised: BTreeMap<String, u64>,
    /// The first differences.
    pub differences: Vec<RowDifference>,
}

impl fmt::Display for RowDifference {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}: {}", self.place, self.what)
    }
}

impl<'p> Plan<'p> {
    /// All three, if they belong together.
    fn subject(&self) -> Option<Subject<'p>> {
        let (study, twin) = self.study.zip(self.twin)?;
        Some(Subject { study, diagnoser: self.diagnoser, twin })
    }
}

impl ProofEvidence {
    /// Whether every answer was the same and every leaf was reached.
    pub fn holds(&self) -> bool {
        self.is_exact && self.leaves_not_reached == 0 && self.differences.is_empty()
    }

    /// The evidence of a compiler that refuses the text.
    pub fn refused(compiler: &str, messages: &str) -> Self {
        let mut evidence = ProofEvidence { command: compiler.into(), ..ProofEvidence::default() };
        evidence.differ("the compiler refuses the text".into(), messages.into());
        evidence
    }

    /// No evidence of a build yet.
    fn of(build: &Build) -> Self {
        ProofEvidence {
            command: build.command(),
            version: build.version(),
            ..ProofEvidence::default()
        }
    }

    /// Whether there are as many differences as anybody will read.
    fn has_enough(&self) -> bool {
        self.differences.len() >= MOST_DIFFERENCES
    }

    fn differ(&mut self, place: String, what: String) {
        if !self.has_enough() {
            self.differences.push(RowDifference { place, what });
        }
    }
}

/// A study with its diagnoser and its twin.
pub(crate) struct Subject<'s> {
    /// The study.
    pub(crate) study: &'s Study,
    /// The diagnoser.
    pub(crate) diagnoser: &'s Arc<Diagnoser>,
    /// The twin.
    pub(crate) twin: &'s ExportedTwin<'s>,
}

/// The scope of a proof.
pub struct Plan<'p> {
    /// The diagnoser.
    pub diagnoser: &'p Arc<Diagnoser>,
    /// The twin, if the files have one.
    pub twin: Option<&'p ExportedTwin<'p>>,
    /// The study, if twin and diagnoser belong to one.
    pub study: Option<&'p Study>,
    /// The export.
    pub files: &'p [SourceFile],
    /// Samples through the whole chain of the diagnosis.
    pub samples: u64,
    /// Variants of the twin, each of 90 s.
    pub variants: u64,
    /// The folder that keeps what is compiled, in a folder for each build: `1`, `2` …
    pub kept: Option<&'p Path>,
}

impl<'p> Plan<'p> {
    /// The comparison of trees alone: no twin, and no samples.
    pub fn new(diagnoser: &'p Arc<Diagnoser>, files: &'p [SourceFile]) -> Self {
        Plan { diagnoser, twin: None, study: None, files, samples: 0, variants: 0, kept: None }
    }
}

/// Compiles an export in every build and compares it with its diagnoser and its twin. `tell` hears what was done, and its
/// share.
///
/// # Errors
/// [`ExportError::NoCompiler`], [`ExportError::Refused`], [`ExportError::Load`], [`ExportError::File`]. A difference is
/// no error; [`ProofEvidence::holds`] is then false.
pub fn prove(
    plan: &Plan,
    builds: &[Build],
    tell: &mut dyn FnMut(&str, f64),
) -> Result<Vec<ProofEvidence>, ExportError> {
    tell("compiling", 0.0);
    let compiled = builds.iter().enumerate().map(|(number, build)| {
        let kept = plan.kept.map(|folder| folder.join((number + 1).to_string()));
        Compiled::new(plan.files, build, kept.as_deref())
    });
    let compiled = compiled.collect::<Result<Vec<_>, _>>()?;
    let mut all = Vec::new();
    for (number, (build, compiled)) in builds.iter().zip(&compiled).enumerate() {
        tell("comparing trees", number as f64 / builds.len() as f64);
        let mut evidence = ProofEvidence::of(build);
        compare_parts(plan.diagnoser, compiled, &mut evidence)?;
        all.push(evidence);
    }
    if let Some(twin) = plan.twin {
        points::compare(twin, &compiled, POINTS, &mut all)?;
        let share = |done| done as f64 / plan.variants.max(1) as f64;
        let tell = &mut |done| tell("comparing twins", share(done));
        twin::compare(twin, &compiled, (plan.variants, VARIANT_S), &mut all, tell)?;
    }
    if let Some(subject) = plan.subject() {
        hybrid::compare(&subject, &compiled, HYBRID_SAMPLES, &mut all)?;
    }
    let tell =
        &mut |done| tell("comparing the whole chain", done as f64 / plan.samples.max(1) as f64);
    chain::compare(plan.diagnoser, &compiled, plan.samples, &mut all, tell)?;
    Ok(all)
}

/// Compares start test, names and trees.
fn compare_parts(
    diagnoser: &Diagnoser,
    compiled: &Compiled,
    evidence: &mut ProofEvidence,
) -> Result<(), ExportError> {
    evidence.is_exact = compiled.is_exact();
    if !evidence.is_exact {
        evidence
            .differ("start test".into(), "this build computes otherwise than in training".into());
    }
    names::compare(diagnoser, compiled, evidence)?;
    models::compare(diagnoser, compiled, RANDOM_ROWS, evidence)
}
