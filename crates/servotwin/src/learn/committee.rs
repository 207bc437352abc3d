//! The committee: boosted trees at every stage of the hierarchy, with calibrated probabilities and a confidence
//! threshold below which they should abstain.
//!
//! Both come from rows that were left out of training, whole commands at a time. They give the temperature of every
//! stage (`servotwin_learning::calibration`), and the threshold that the least certain answers do not reach.

use super::data_set::{DataRow, DataSet, TrainingFilter};
use super::error::EvaluationError;
use super::run::{self, Scope};
use crate::parallel::{self, Workers};
use servotwin_diagnosis::classifiers::{Classifier, Scores};
use servotwin_diagnosis::hierarchy::Hierarchy;
use servotwin_learning::calibration::temperature;
use servotwin_learning::hierarchy::HierarchySettings;
use servotwin_learning::splits::{Split, grouped_k_fold};
use std::collections::BTreeMap;

/// Number of cross-validation folds over commands.
const FOLDS: usize = 3;

/// The share of answers on left-out commands that the confidence threshold withholds.
pub(crate) const WITHHELD: f64 = 0.02;

/// Trains the committee on the given rows and calibrates it with commands left out. Also returns the confidence that all
/// but [`WITHHELD`] of the answers on left-out commands reach; `None` with too few commands.
///
/// # Errors
/// Training fails.
pub(crate) fn train(
    data: &DataSet,
    settings: &HierarchySettings,
    rows: &[usize],
    workers: Workers,
) -> Result<(Hierarchy, Option<f64>), EvaluationError> {
    let mut hierarchy = run::fit(data, settings, rows, Scope::All, workers)?;
    let groups: Vec<u32> = rows.iter().map(|&row| data.rows[row].flown).collect();
    let Ok(folds) = grouped_k_fold(&groups, FOLDS, 1) else {
        return Ok((hierarchy, None));
    };
    let of = |places: &[usize]| -> Vec<usize> { places.iter().map(|&place| rows[place]).collect() };
    let alone = Workers::new(1);
    let fit = |split: &Split| run::fit(data, settings, &of(&split.train), Scope::All, alone);
    let parts: Result<Vec<Hierarchy>, EvaluationError> =
        parallel::map(&folds, workers, fit)?.into_iter().collect();
    let mut parts = parts?;
    let mut seen = BTreeMap::new();
    let still = |split: &Split, wanted: &dyn Fn(&DataRow) -> bool| -> Vec<usize> {
        let rows = of(&split.test).into_iter();
        rows.filter(|&row| data.rows[row].moved == 0 && wanted(&data.rows[row])).collect()
    };
    for (part, split) in parts.iter().zip(&folds) {
        collect(data, part, &still(split, &|_| true), &mut seen)?;
    }
    for stage in parts.iter_mut().flat_map(|part| &mut part.stages).chain(&mut hierarchy.stages) {
        if let Some((scores, labels)) = seen.get(&stage.id).filter(|(_, labels)| !labels.is_empty())
        {
            stage.temperature = temperature(stage.classes.len(), scores, labels)?;
        }
    }
    let mut confidences = vec![];
    for (part, split) in parts.iter().zip(&folds) {
        let outcomes = run::ask(&data.examples, part, &still(split, &|row| !row.is_healthy))?;
        confidences.extend(outcomes.iter().map(|outcome| outcome.said.confidence));
    }
    confidences.sort_by(f64::total_cmp);
    let place = (WITHHELD * confidences.len() as f64) as usize;
    Ok((hierarchy, confidences.get(place).copied()))
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
        hierarchy.probabilities_into((&views[0], &views), &mut scratch, &mut shares)?;
        nats.push(((1.0 - shares[0]) / shares[0].max(f64::MIN_POSITIVE)).ln());
    }
    nats.sort_by(f64::total_cmp);
    Ok(nats[(nats.len() as f64 * LESS_SURE) as usize])
}

/// Scores and true classes of the rows that each stage decides.
type Seen = BTreeMap<String, (Vec<f64>, Vec<u32>)>;

fn collect(
    data: &DataSet,
    hierarchy: &Hierarchy,
    rows: &[usize],
    seen: &mut Seen,
) -> Result<(), EvaluationError> {
    let stages = hierarchy.stages.iter().filter(|stage| stage.model.scores() == Scores::Shares);
    for stage in stages {
        let (all, labels) = seen.entry(stage.id.clone()).or_default();
        let Some((samples, _)) = data.examples.samples(&stage.place, rows, false)? else {
            continue;
        };
        let (mut row, mut scores) = (vec![0.0; samples.features()], vec![0.0; samples.classes()]);
        for place in 0..samples.rows() {
            samples.row_into(place, &mut row);
            stage.model.scores_into(&row, &mut scores);
            all.extend_from_slice(&scores);
        }
        labels.extend_from_slice(samples.labels());
    }
    Ok(())
}
