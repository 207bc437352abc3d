//! Trains and tests a hierarchy over the splits of a protocol.
//!
//! All results of a protocol are counted from [`RowOutcome`]s: the answers for each test row by the hierarchy trained on
//! the split's training rows.

use super::data_set::DataSet;
use super::error::EvaluationError;
use crate::parallel::{self, Workers};
use servotwin_diagnosis::classifiers::Model;
use servotwin_diagnosis::hierarchy::{Diagnosis, Hierarchy, Question, Scratch, Stage, StagePlace};
use servotwin_learning::hierarchy::HierarchySettings;
use servotwin_learning::splits::Split;
use std::collections::BTreeMap;

/// Which stages are trained.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scope {
    /// All stages.
    All,
    /// Only the stages that find the actuator and the action. The detail of a kind without training has no right answer.
    Action,
    /// Every stage; wrong answers are traced to the kind of fault with which they were confused.
    AllTracing,
}

/// The answers for a test row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RowOutcome {
    /// The index of the row.
    pub row: usize,
    /// The hierarchy's answer; each stage relies on the one above.
    pub said: Diagnosis,
    /// The command, given the true actuator.
    pub command: Option<u32>,
    /// The detail, given the true actuator and command.
    pub detail: Option<u32>,
    /// For wrong answers: the most frequent kind of fault in the leaf where the row ended.
    pub confused_with: Option<u32>,
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
    let settings = &settled(data, settings);
    // The threads share the splits, or the stages of a single split.
    let within = if splits.len() == 1 { workers } else { Workers::new(1) };
    let one = |split: &Split| run_split(data, settings, split, scope, within);
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

fn run_split(
    data: &DataSet,
    settings: &HierarchySettings,
    split: &Split,
    scope: Scope,
    workers: Workers,
) -> Result<Vec<RowOutcome>, EvaluationError> {
    let hierarchy = fit_scope(data, settings, &split.train, scope, workers)?;
    let mut asking = Asking::new(data, &hierarchy);
    let outcomes: Result<Vec<RowOutcome>, _> =
        split.test.iter().map(|&row| asking.ask(row)).collect();
    let mut outcomes = outcomes?;
    if scope == Scope::AllTracing {
        trace(data, settings, &hierarchy, &split.train, &mut outcomes)?;
    }
    Ok(outcomes)
}

/// Trains every stage on the given rows, several stages in parallel.
///
/// # Errors
/// Training fails.
pub(crate) fn fit(
    data: &DataSet,
    settings: &HierarchySettings,
    rows: &[usize],
    workers: Workers,
) -> Result<Hierarchy, EvaluationError> {
    fit_scope(data, settings, rows, Scope::All, workers)
}

fn fit_scope(
    data: &DataSet,
    settings: &HierarchySettings,
    rows: &[usize],
    scope: Scope,
    workers: Workers,
) -> Result<Hierarchy, EvaluationError> {
    let mut places = data.examples.places(settings.pool);
    places.retain(|p| scope != Scope::Action || p.question != Question::Detail);
    let one = |place: &StagePlace| settings.fit_stage(&data.examples, rows, place);
    let stages: Result<Vec<_>, _> = parallel::map(&places, workers, one)?.into_iter().collect();
    let stages: Vec<Stage> = stages?.into_iter().flatten().collect();
    match stages.is_empty() {
        true => Err(servotwin_diagnosis::Error::NoSamples.into()),
        false => Ok(Hierarchy { names: data.examples.names().clone(), stages }),
    }
}

/// The answers of a trained hierarchy for the given rows.
///
/// # Errors
/// [`servotwin_diagnosis::Error::LengthMismatch`] if the hierarchy has other features.
pub(crate) fn ask(
    data: &DataSet,
    hierarchy: &Hierarchy,
    rows: &[usize],
) -> Result<Vec<RowOutcome>, EvaluationError> {
    let mut asking = Asking::new(data, hierarchy);
    rows.iter().map(|&row| asking.ask(row)).collect()
}

/// Asks a hierarchy about rows, one after the other.
struct Asking<'a> {
    data: &'a DataSet,
    hierarchy: &'a Hierarchy,
    scratch: Scratch,
    views: Vec<Vec<f64>>,
}

impl<'a> Asking<'a> {
    fn new(data: &'a DataSet, hierarchy: &'a Hierarchy) -> Self {
        let empty = vec![0.0; data.features.len()];
        Asking {
            data,
            hierarchy,
            scratch: hierarchy.scratch(),
            views: vec![empty; data.examples.views()],
        }
    }

    fn ask(&mut self, row: usize) -> Result<RowOutcome, EvaluationError> {
        for (view, values) in self.views.iter_mut().enumerate() {
            self.data.examples.row_into(view, row, values);
        }
        let views: Vec<&[f64]> = self.views.iter().map(Vec::as_slice).collect();
        let said = self.hierarchy.diagnose(&views, &mut self.scratch)?;
        let truth = self.data.examples.labels()[row];
        let is_healthy = self.data.rows[row].is_healthy;
        let mut given = |question| {
            let stage = self.hierarchy.stage(question, truth.actuator, truth.action)?;
            let view = views[stage.place.view(truth.actuator)];
            Some(stage.answer(view, &mut self.scratch).class)
        };
        let mut below = |question| if is_healthy { None } else { given(question) };
        let (command, detail) = (below(Question::Action), below(Question::Detail));
        Ok(RowOutcome { row, said, command, detail, confused_with: None })
    }
}

/// Finds, for each wrong outcome, the most frequent kind of fault among the leaf's training rows with the decided
/// class.
fn trace(
    data: &DataSet,
    settings: &HierarchySettings,
    hierarchy: &Hierarchy,
    train: &[usize],
    outcomes: &mut [RowOutcome],
) -> Result<(), EvaluationError> {
    for stage in &hierarchy.stages {
        let Some(kinds) = leaf_kinds(data, settings, stage, train)? else {
            continue;
        };
        let mut values = vec![0.0; data.features.len()];
        for outcome in outcomes.iter_mut() {
            let truth = data.examples.labels()[outcome.row];
            let asked = stage.place.is_asked(truth.actuator, truth.action);
            if !asked || first_error(data, outcome) != Some(stage.place.question) {
                continue;
            }
            let view = stage.place.view(truth.actuator);
            data.examples.row_into(view, outcome.row, &mut values);
            let leaf = stage.path(&values).last().copied().unwrap_or(0);
            outcome.confused_with = kinds.get(&leaf).copied();
        }
    }
    Ok(())
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

/// For each leaf of a tree, the most frequent kind of fault among the training rows of its class.
fn leaf_kinds(
    data: &DataSet,
    settings: &HierarchySettings,
    stage: &Stage,
    train: &[usize],
) -> Result<Option<BTreeMap<usize, u32>>, EvaluationError> {
    let Model::Cart(tree) = &stage.model else {
        return Ok(None);
    };
    let Some((samples, origins)) = data.examples.samples(&stage.place, train, settings.mirror)?
    else {
        return Ok(None);
    };
    let mut counts: BTreeMap<(usize, u32), u32> = BTreeMap::new();
    let mut values = vec![0.0; samples.features()];
    for (sample, &origin) in origins.iter().enumerate() {
        samples.row_into(sample, &mut values);
        let leaf = tree.branches().leaf_of(&values);
        if tree.decision(leaf) == samples.labels()[sample] {
            *counts.entry((leaf, data.rows[origin].kind)).or_default() += 1;
        }
    }
    let mut best: BTreeMap<usize, (u32, u32)> = BTreeMap::new();
    for ((leaf, kind), count) in counts {
        let entry = best.entry(leaf).or_insert((0, kind));
        if count > entry.0 {
            *entry = (count, kind);
        }
    }
    Ok(Some(best.into_iter().map(|(leaf, (_, kind))| (leaf, kind)).collect()))
}
