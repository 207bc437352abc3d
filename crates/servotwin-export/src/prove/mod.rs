//! Proof that an export decides as its diagnoser does: it is compiled, loaded and compared bit by bit.

mod chain;
mod library;
mod models;
mod rows;
mod samples;

pub use library::Build;

use crate::c::CFile;
use crate::error::ExportError;
use library::{Compiled, Place};
use serde::Serialize;
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_diagnosis::hierarchy::Stage;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Differences that are kept; the others are counted only in their number of rows.
const MOST_DIFFERENCES: usize = 20;

/// A row for which the export answers otherwise.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// The model.
    pub place: String,
    /// What it says, and what it should say.
    pub what: String,
}

/// What one build was compared on.
#[derive(Debug, Clone, PartialEq, Serialize, Default)]
pub struct Evidence {
    /// The compiler with its flags.
    pub command: String,
    /// The compiler's version.
    pub version: String,
    /// Whether products and sums round separately.
    pub rounds_twice: bool,
    /// Leaves of all trees.
    pub leaves: u64,
    /// Leaves that no row reached, although one could.
    pub leaves_not_reached: u64,
    /// Nodes that no row can reach, because tests above them exclude each other.
    pub unreachable_nodes: u64,
    /// Thresholds of all trees, each compared one step below, at, and one step above, and without a value.
    pub thresholds: u64,
    /// Rows for leaves and thresholds.
    pub rows: u64,
    /// Random rows through whole hierarchies.
    pub random_rows: u64,
    /// Samples through the whole chain.
    pub samples: u64,
    /// Actions that were raised on the way, with their number.
    pub raised: BTreeMap<String, u64>,
    /// The first differences.
    pub differences: Vec<Difference>,
}

impl Evidence {
    /// Whether every answer was the same and every leaf was reached.
    pub fn holds(&self) -> bool {
        self.rounds_twice && self.leaves_not_reached == 0 && self.differences.is_empty()
    }

    fn differ(&mut self, stage: &Stage, at: Place, what: String) {
        if self.differences.len() < MOST_DIFFERENCES {
            self.differences
                .push(Difference { place: format!("{}, stage {}", name_of(at), stage.id), what });
        }
    }
}

fn name_of(at: Place) -> String {
    let kind = if at.is_committee { "boosted trees" } else { "trees" };
    format!("{kind} of window length {}", at.length + 1)
}

/// Compiles an export in every build and compares it with its diagnoser: all trees, then this many samples through the
/// whole chain. `tell` hears the number of samples so far.
///
/// # Errors
/// [`ExportError::NoCompiler`], [`ExportError::Refused`], [`ExportError::Load`], [`ExportError::File`]. A difference is
/// no error; [`Evidence::holds`] is then false.
pub fn prove(
    diagnoser: &Arc<Diagnoser>,
    files: &[CFile],
    builds: &[Build],
    samples: u64,
    tell: &mut dyn FnMut(u64),
) -> Result<Vec<Evidence>, ExportError> {
    let compiled = builds.iter().map(|build| Compiled::new(files, build));
    let compiled = compiled.collect::<Result<Vec<_>, _>>()?;
    let mut all = Vec::new();
    for (build, compiled) in builds.iter().zip(&compiled) {
        let mut evidence = Evidence {
            command: build.command(),
            version: build.version(),
            rounds_twice: compiled.rounds_twice()?,
            ..Evidence::default()
        };
        models::compare(diagnoser, compiled, &mut evidence)?;
        all.push(evidence);
    }
    chain::compare(diagnoser, &compiled, samples, &mut all, tell)?;
    Ok(all)
}
