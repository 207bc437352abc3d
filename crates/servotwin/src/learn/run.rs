//! Trains and tests a hierarchy over the splits of a protocol.
//!
//! All results of a protocol are counted from [`RowOutcome`]s: the answers for each test row by the hierarchy trained on
//! the split's training rows.

use super::data_set::DataSet;
use super::error::EvaluationError;
use crate::parallel::{self, Workers};
use servotwin_diagnosis::hierarchy::{Diagnosis, Hierarchy, Question, Stage, StagePlace};
use servotwin_learning::hierarchy::{Examples, HierarchySettings};
use servotwin_learning::splits::Split;

/// Which stages are trained.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scope {
    /// All stages.
    All,
    /// Only the stages that find the actuator and the action. The detail of a kind without training has no right answer.
    Action,
}

/// The answers for a test row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RowOutcome {
    /// The index of the row.
    pub(crate) row: usize,
    /// The hierarchy's answer; each stage relies on the one above.
    pub(crate) said: Diagnosis,
    /// The action, given the true actuator.
    pub(crate) action: Option<u32>,
    /// The detail, given the true actuator and action.
    pub(crate) detail: Option<u32>,
    /// Whether the answer counts. Where it does not, the fault stays not isolated.
    pub(crate) is_decided: bool,
}

/// Trains on each split's training rows and tests on its test rows; one list per split.
///
/// # Errors
/// Training fails.
pub(crate) fn run(
    data: &DataSet,
    settings: &HierarchySettings,
    splits: &[Split],
    scope: Scope,
    workers: Workers,
) -> Result<Vec<Vec<RowOutcome>>, EvaluationError> {
    // The threads share the splits, or the stages of a single split.
    let within = if splits.len() == 1 { workers } else { Workers::new(1) };
    let one = |split: &Split| {
        ask(&data.examples, &fit(data, settings, &split.train, scope, within)?, &split.test)
    };
    parallel::map(splits, workers, one)?.into_iter().collect()
}

/// Disables settings that need views if the data set has none.
pub(crate) fn settled(data: &DataSet, settings: &HierarchySettings) -> HierarchySettings {
    let has_views = data.examples.views() == data.examples.names().actuators.len();
    HierarchySettings {
        mirror: settings.mirror && has_views,
        pool: settings.pool && has_views,
        ..settings.clone()
    }
}

/// Trains the stages on the given rows, several in parallel.
///
/// # Errors
/// Training fails.
pub(crate) fn fit(
    data: &DataSet,
    settings: &HierarchySettings,
    rows: &[usize],
    scope: Scope,
    workers: Workers,
) -> Result<Hierarchy, EvaluationError> {
    fit_stages(&data.examples, &settled(data, settings), rows, scope, workers)
}

/// As [`fit`], from examples alone.
pub(crate) fn fit_stages(
    examples: &Examples,
    settings: &HierarchySettings,
    rows: &[usize],
    scope: Scope,
    workers: Workers,
) -> Result<Hierarchy, EvaluationError> {
    let mut places = examples.places(settings.pool);
    places.retain(|p| scope != Scope::Action || p.question != Question::Detail);
    let one = |place: &StagePlace| settings.fit_stage(examples, rows, place);
    let stages: Result<Vec<_>, _> = parallel::map(&places, workers, one)?.into_iter().collect();
    let stages: Vec<Stage> = stages?.into_iter().flatten().collect();
    match stages.is_empty() {
        true => Err(servotwin_diagnosis::Error::NoSamples.into()),
        false => Ok(Hierarchy { names: examples.names().clone(), stages }),
    }
}

/// The answers of a trained hierarchy for the given rows.
///
/// # Errors
/// [`servotwin_diagnosis::Error::LengthMismatch`] if the hierarchy has other features.
pub(crate) fn ask(
    examples: &Examples,
    hierarchy: &Hierarchy,
    rows: &[usize],
) -> Result<Vec<RowOutcome>, EvaluationError> {
    let mut scratch = hierarchy.scratch();
    let names = examples.names();
    let mut values = vec![vec![0.0; names.features.len()]; examples.views()];
    let mut ask_row = |&row: &usize| {
        for (view, values) in values.iter_mut().enumerate() {
            examples.row_into(view, row, values);
        }
        let said = hierarchy.diagnose(&values, &mut scratch)?;
        let truth = examples.labels()[row];
        let mut below = |question| {
            let stage = hierarchy.stage(question, truth.actuator, truth.action);
            let stage = stage.filter(|_| truth.actuator != names.healthy())?;
            let view = &values[stage.place.view(truth.actuator)];
            Some(stage.answer(view, &mut scratch).class)
        };
        let (action, detail) = (below(Question::Action), below(Question::Detail));
        Ok(RowOutcome { row, said, action, detail, is_decided: true })
    };
    rows.iter().map(&mut ask_row).collect()
}

/// The first question that was answered wrongly.
pub(crate) fn first_error(data: &DataSet, outcome: &RowOutcome) -> Option<Question> {
    let truth = data.examples.labels()[outcome.row];
    let actuator = Some(truth.actuator).filter(|_| !data.rows[outcome.row].is_healthy);
    if outcome.said.actuator != actuator {
        Some(Question::Actuator)
    } else if data.rows[outcome.row].is_healthy {
        None
    } else if outcome.said.action != Some(truth.action) {
        Some(Question::Action)
    } else if outcome.said.detail != Some(truth.detail) {
        Some(Question::Detail)
    } else {
        None
    }
}
