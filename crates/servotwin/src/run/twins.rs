//! Runs that are kept whole: the twins of an experiment, and the plants of calibration flights.

use super::RunError;
use crate::ensemble::{Ensemble, Variant};
use servotwin_model::program::Program;
use servotwin_model::solver::{SolverFailure, Statistics};
use std::collections::{BTreeMap, BTreeSet};

/// A run from its first sample to its last.
pub(crate) struct RecordedRun {
    /// The recorded values, ordered by sample.
    pub(crate) samples: Vec<f64>,
    /// The solver's work.
    pub(crate) work: Statistics,
    /// Number of recorded values.
    width: usize,
}

impl RecordedRun {
    /// The recorded values at a sample.
    pub(crate) fn at(&self, index: usize) -> &[f64] {
        &self.samples[index * self.width..][..self.width]
    }

    /// Whether this twin or its plant, given by its solver's work, began without a steady state.
    pub(crate) fn is_on_the_move(&self, plant: &Statistics) -> bool {
        plant.unsettled > 0 || self.work.unsettled > 0
    }
}

/// The twins of an experiment by what distinguishes them, such as operating case and specimen.
pub(crate) type Twins<K> = BTreeMap<K, RecordedRun>;

/// Simulates the twins that are wanted. `case_name` names the operating case of one that fails.
///
/// # Errors
/// [`RunError::Twin`] or [`RunError::Cancelled`].
pub(crate) fn simulate_twins<'v, 'n, K: Copy + Ord + Sync>(
    ensemble: &Ensemble,
    wanted: BTreeSet<K>,
    variant: impl Fn(K) -> Variant<'v> + Sync,
    case_name: impl Fn(K) -> &'n str,
) -> Result<Twins<K>, RunError> {
    let keys: Vec<K> = wanted.into_iter().collect();
    let error = |twin: usize, reason| {
        let case = case_name(keys[twin]).into();
        RunError::Twin { case, reason }
    };
    let runs = record_runs(ensemble, keys.len(), |twin| variant(keys[twin]), error)?;
    Ok(keys.iter().copied().zip(runs).collect())
}

/// Simulates variants and keeps all of their samples. `error` describes the first variant that failed, by its place and
/// the reason.
///
/// # Errors
/// A variant failed, or the ensemble was cancelled.
pub(super) fn record_runs<'v>(
    ensemble: &Ensemble,
    count: usize,
    variant: impl Fn(usize) -> Variant<'v> + Sync,
    error: impl FnOnce(usize, String) -> RunError,
) -> Result<Vec<RecordedRun>, RunError> {
    let width = ensemble.record.len();
    let mut runs: Vec<Option<Result<RecordedRun, SolverFailure>>> = vec![];
    runs.resize_with(count, || None);
    ensemble.run(
        count,
        variant,
        |_| Vec::<f64>::new(),
        |run, mut samples, outcome| {
            samples.shrink_to_fit();
            runs[run] = Some(outcome.map(|work| RecordedRun { samples, work, width }));
        },
    );
    let mut ended = vec![];
    for (run, outcome) in runs.into_iter().enumerate() {
        match outcome.ok_or(RunError::Cancelled)? {
            Ok(recorded) => ended.push(recorded),
            Err(failure) => return Err(error(run, describe(ensemble.program, &failure))),
        }
    }
    Ok(ended)
}

/// Describes why and where a run of a program ended early.
pub(crate) fn describe(program: &Program, failure: &SolverFailure) -> String {
    let state = &program.states()[failure.state].name;
    format!("{} at {:.4} s in {state}", failure.cause, failure.time_s)
}
