//! The committee: boosted trees at every stage of the hierarchy, with calibrated probabilities and a confidence
//! threshold below which they should abstain.
//!
//! Both come from rows that were left out of training, whole commands at a time. They give the temperature of every
//! stage (`servotwin_learning::calibration`), and the threshold that the least certain answers do not reach.

use super::data_set::{DataRow, DataSet, TrainingFilter};
use super::error::EvaluationError;
use super::run::{self, RowOutcome, settled};
use crate::parallel::{self, Workers};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::classifiers::{Classifier, Scores};
use servotwin_diagnosis::hierarchy::{Hierarchy, Question, Stage};
use servotwin_learning::calibration::Forecasts;
use servotwin_learning::hierarchy::HierarchySettings;
use servotwin_learning::splits::{Split, grouped_k_fold};
use std::collections::BTreeMap;

/// Number of cross-validation folds over commands.
const FOLDS: usize = 3;

/// The share of answers on left-out commands that the confidence threshold withholds.
pub(crate) const WITHHELD: f64 = 0.02;

/// A trained committee.
#[derive(Debug, Clone, PartialEq)]
pub struct Committee {
    /// Calibrated boosted trees.
    pub hierarchy: Hierarchy,
    /// The confidence that all but `WITHHELD` of the answers on left-out commands reach; `None` with too few
    /// commands.
    pub least_confidence: Option<f64>,
}

/// Quality of the probabilities of the action.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Reliability {
    /// Bins of answers by confidence: mean confidence, share of right answers, number.
    pub bins: Vec<(f64, f64, u64)>,
    /// Brier score: mean squared difference between confidence and correctness.
    pub brier: f64,
    /// Mean difference between confidence and share of right answers, over the bins.
    pub calibration_error: f64,
}

/// Trains the committee on the given rows and calibrates it with commands left out.
///
/// # Errors
/// Training fails.
pub(crate) fn train(
    data: &DataSet,
    settings: &HierarchySettings,
    rows: &[usize],
    workers: Workers,
) -> Result<Committee, EvaluationError> {
    let settings = &settled(data, settings);
    let mut hierarchy = run::fit(data, settings, rows, workers)?;
    let groups: Vec<u32> = rows.iter().map(|&row| data.rows[row].flown).collect();
    let Ok(folds) = grouped_k_fold(&groups, FOLDS, 1) else {
        return Ok(Committee { hierarchy, least_confidence: None });
    };
    let of = |places: &[usize]| -> Vec<usize> { places.iter().map(|&place| rows[place]).collect() };
    let fit = |split: &Split| Ok(settings.fit(&data.examples, &of(&split.train))?);
    let parts: Result<Vec<Hierarchy>, EvaluationError> =
        parallel::map(&folds, workers, fit)?.into_iter().collect();
    let mut parts = parts?;
    let mut seen = BTreeMap::new();
    let still = |split: &Split, wanted: &dyn Fn(&DataRow) -> bool| -> Vec<usize> {
        let rows = of(&split.test).into_iter();
        rows.filter(|&row| data.rows[row].moved == 0 && wanted(&data.rows[row])).collect()
    };
    for (part, split) in parts.iter().zip(&folds) {
        collect(data, part, &still(split, &|_| true), &mut seen);
    }
    for stage in parts.iter_mut().flat_map(|part| &mut part.stages).chain(&mut hierarchy.stages) {
        if let Some((scores, labels)) = seen.get(&stage.id).filter(|(_, labels)| !labels.is_empty())
        {
            let forecasts = Forecasts::new(stage.classes.len(), scores, labels)?;
            stage.temperature = forecasts.temperature();
        }
    }
    let mut confidences = vec![];
    for (part, split) in parts.iter().zip(&folds) {
        let outcomes = run::ask(data, part, &still(split, &|row| !row.is_healthy))?;
        confidences.extend(outcomes.iter().map(|outcome| outcome.said.confidence));
    }
    confidences.sort_by(f64::total_cmp);
    let place = (WITHHELD * confidences.len() as f64) as usize;
    Ok(Committee { hierarchy, least_confidence: confidences.get(place).copied() })
}

/// The share of all rows whose evidence is below [`evidence_quantile`].
const LESS_SURE: f64 = 0.6;

/// The evidence against health, in nats, that two of five fault rows exceed. It is a quantile of `ln((1 − p)/p)` over
/// the training faults, where p is the probability of health.
///
/// # Errors
/// [`EvaluationError::NothingDetectable`] without training faults.
pub fn evidence_quantile(
    data: &DataSet,
    hierarchy: &Hierarchy,
    lessons: TrainingFilter,
) -> Result<f64, EvaluationError> {
    let rows = data.learnt_from(lessons)?;
    let mut scratch = hierarchy.scratch();
    let mut views = vec![vec![0.0; data.features.len()]; data.examples.views()];
    let names = &hierarchy.names;
    let mut shares = vec![0.0; 1 + names.actuators.len() * names.actions.len()];
    let mut nats = vec![];
    for &row in rows.iter().filter(|&&row| !data.rows[row].is_healthy) {
        for (view, values) in views.iter_mut().enumerate() {
            data.examples.row_into(view, row, values);
        }
        hierarchy.probabilities_into(&views, &mut scratch, &mut shares)?;
        nats.push(((1.0 - shares[0]) / shares[0].max(f64::MIN_POSITIVE)).ln());
    }
    nats.sort_by(f64::total_cmp);
    Ok(nats[(nats.len() as f64 * LESS_SURE) as usize])
}

/// Scores and true classes of the rows that each stage decides.
type Seen = BTreeMap<String, (Vec<f64>, Vec<u32>)>;

fn collect(data: &DataSet, hierarchy: &Hierarchy, rows: &[usize], seen: &mut Seen) {
    let mut values = vec![0.0; data.features.len()];
    for stage in &hierarchy.stages {
        if stage.model.scores() != Scores::Shares {
            continue;
        }
        let mut scores = vec![0.0; stage.classes.len()];
        let (all, labels) = seen.entry(stage.id.clone()).or_default();
        for &row in rows {
            let Some(class) = true_class(data, stage, row) else { continue };
            let view = stage.place.view(data.examples.labels()[row].actuator);
            data.examples.row_into(view, row, &mut values);
            let own: Vec<f64> = stage.columns.iter().map(|&c| values[c as usize]).collect();
            stage.model.scores_into(&own, &mut scores);
            all.extend_from_slice(&scores);
            labels.push(class);
        }
    }
}

/// The true class of a row as an index of the stage's classes; `None` if the stage is not asked about the row.
fn true_class(data: &DataSet, stage: &Stage, row: usize) -> Option<u32> {
    let label = data.examples.labels()[row];
    let asks_on = stage.place.question != Question::Actuator;
    let is_asked = stage.place.is_asked(label.actuator, label.action);
    if !is_asked || (asks_on && data.rows[row].is_healthy) {
        return None;
    }
    let class = match stage.place.question {
        Question::Actuator => label.actuator,
        Question::Action => label.action,
        Question::Detail => label.detail,
    };
    stage.classes.iter().position(|known| *known == class).map(|class| class as u32)
}

/// Measures the calibration of the outcomes' confidence.
pub(crate) fn reliability(
    outcomes: &[RowOutcome],
    is_right: impl Fn(&RowOutcome) -> bool,
) -> Reliability {
    const BINS: usize = 10;
    let mut bins = vec![(0.0, 0u64, 0u64); BINS];
    let mut squares = 0.0;
    for outcome in outcomes {
        let confidence = outcome.said.confidence;
        let right = is_right(outcome);
        let bin = &mut bins[((confidence * BINS as f64) as usize).min(BINS - 1)];
        *bin = (bin.0 + confidence, bin.1 + u64::from(right), bin.2 + 1);
        squares += (confidence - f64::from(u8::from(right))).powi(2);
    }
    let count = outcomes.len().max(1) as f64;
    bins.retain(|(_, _, of)| *of > 0);
    let bins: Vec<(f64, f64, u64)> = bins
        .iter()
        .map(|&(sum, right, of)| (sum / of as f64, right as f64 / of as f64, of))
        .collect();
    let errors = bins.iter().map(|(mean, share, of)| (mean - share).abs() * *of as f64);
    Reliability { brier: squares / count, calibration_error: errors.sum::<f64>() / count, bins }
}
