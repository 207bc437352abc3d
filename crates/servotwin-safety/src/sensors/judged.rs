//! How well a set of sensors diagnoses: trees, trained on the training commands, and judged on the others.
//!
//! A tree finds the actuator, or that there is no fault; one more for each actuator finds the kind of its fault. They
//! read the features that the set leaves. They learn from the rows in which a residual of a kept sensor leaves its band,
//! also as seen from the other actuators. Of a judged row the action with the most weight in its leaf is taken. A fault
//! whose residuals all stay within their bands is not judged by a tree: it is neither isolated nor shut down. So all
//! rates have the same denominators for all sets: every judged fault, or every judged fault that needs a shutdown.

use super::candidates::{Candidates, SensorMask};
use super::runs::SensorRuns;
use crate::error::SafetyError;
use servotwin::evaluation::EvaluationError;
use servotwin::evaluation::protocol::trial;
use servotwin_diagnosis::classifiers::{Classifier, Model};
use servotwin_learning::Samples;
use servotwin_learning::classifiers::{Fit, Settings};
use servotwin_learning::metrics::Rate;

/// The sizes of groups to which a fault is isolated.
const GROUPS: usize = 3;

/// The answer of the trees to a judged fault.
#[derive(Debug, Clone, Copy, PartialEq)]
struct FaultAnswer {
    /// The row of the data set.
    row: usize,
    /// Whether a residual of a kept sensor leaves its band.
    is_detected: bool,
    /// The size of the smallest group of most probable faults that holds the right one; `None` above [`GROUPS`].
    group: Option<usize>,
    /// The actuator that is shut down.
    shut_down: Option<u32>,
}

/// The rates of a set of sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorRates {
    /// Faults in which a residual of a kept sensor leaves its band.
    pub detected: Rate,
    /// Healthy specimens in which one does.
    pub alarms: Rate,
    /// Faults that are among the 1, 2 and 3 most probable ones.
    pub isolated: [Rate; GROUPS],
    /// Faults for which another actuator is shut down.
    pub wrong_shutdown: Rate,
    /// Of the faults that need a shutdown: their actuator is not shut down.
    pub missed_shutdown: Rate,
}

/// Trains the trees of a set and counts their answers. Where no training row with a fault is detected, nothing is
/// isolated.
///
/// # Errors
/// Training fails.
pub(crate) fn rates(
    runs: &SensorRuns,
    candidates: &Candidates,
    set: SensorMask,
) -> Result<SensorRates, SafetyError> {
    let trees = match SetTrees::train(runs, candidates, set) {
        Err(EvaluationError::NothingDetectable { .. }) => None,
        trained => Some(trained?),
    };
    let values = vec![0.0; runs.data.features.len()];
    let mut judge = SetJudge { runs, set, trees, values };
    let answers: Vec<FaultAnswer> =
        runs.faults().into_iter().map(|row| judge.answer(row)).collect();
    let data = &runs.data;
    let label = |answer: &FaultAnswer| data.examples.labels()[answer.row];
    let rate_of = |holds: &dyn Fn(&FaultAnswer) -> bool| {
        let trials: Vec<_> = answers.iter().map(|a| trial(data, a.row, holds(a))).collect();
        Rate::clustered(&trials)
    };
    let needs = answers.iter().filter(|answer| runs.switches_off[label(answer).action as usize]);
    let is_missed = |answer: &FaultAnswer| answer.shut_down != Some(label(answer).actuator);
    let missed: Vec<_> = needs.map(|a| trial(data, a.row, is_missed(a))).collect();
    let is_within = |size: usize| move |a: &FaultAnswer| a.group.is_some_and(|own| own <= size);
    Ok(SensorRates {
        detected: rate_of(&|answer| answer.is_detected),
        alarms: Rate::of(&runs.healthy(), |&row| runs.beyond(row) & set != 0),
        isolated: [1, 2, 3].map(|size| rate_of(&is_within(size))),
        wrong_shutdown: rate_of(&|a| a.shut_down.is_some_and(|off| off != label(a).actuator)),
        missed_shutdown: Rate::clustered(&missed),
    })
}

/// A tree and the columns that it reads.
struct SetTree {
    model: Model,
    columns: Vec<usize>,
}

impl SetTree {
    /// Trains a tree on samples: a row, the view in which it is seen, and its class.
    fn train(
        runs: &SensorRuns,
        settings: &Settings,
        columns: Vec<usize>,
        samples: &[(usize, usize, u32)],
    ) -> Result<Self, EvaluationError> {
        let mut values = vec![0.0; columns.len() * samples.len()];
        let mut all = vec![0.0; runs.data.features.len()];
        for (sample, &(row, view, _)) in samples.iter().enumerate() {
            runs.data.examples.row_into(view, row, &mut all);
            for (place, &column) in columns.iter().enumerate() {
                values[place * samples.len() + sample] = all[column];
            }
        }
        let labels: Vec<u32> = samples.iter().map(|&(.., class)| class).collect();
        let classes = labels.iter().max().map_or(0, |most| most + 1);
        let names = columns.iter().map(|&column| runs.data.features[column].feature.name.clone());
        let classes = (0..classes).map(|class| class.to_string());
        let samples = Samples::from_columns(names.collect(), classes.collect(), values, labels)?;
        Ok(SetTree { model: settings.fit(&samples)?, columns })
    }

    /// The weight of every class for a row.
    fn shares(&self, row: &[f64]) -> Vec<f64> {
        let own: Vec<f64> = self.columns.iter().map(|&column| row[column]).collect();
        let mut shares = vec![0.0; self.model.classes()];
        self.model.scores_into(&own, &mut shares);
        shares
    }
}

/// The trained trees of one set.
struct SetTrees {
    /// Decides the actuator, or that there is no fault.
    actuator: SetTree,
    /// For each actuator, decides the kind of its fault; `None` without a fault to learn from.
    kinds: Vec<Option<SetTree>>,
}

impl SetTrees {
    fn train(
        runs: &SensorRuns,
        candidates: &Candidates,
        set: SensorMask,
    ) -> Result<Self, EvaluationError> {
        let bands = runs.bands.iter().enumerate();
        let bands: Vec<f64> = bands
            .map(|(sensor, &band)| if set >> sensor & 1 == 1 { band } else { f64::INFINITY })
            .collect();
        let rows = runs.data.with_bands(&bands).learnt_from(runs.lessons)?;
        let columns = runs.columns_of(candidates, set);
        let names = runs.data.examples.names();
        let mut seen = vec![];
        for &row in &rows {
            for view in 0..runs.data.examples.views() {
                let actuator = runs.data.examples.labels()[row].actuator;
                seen.push((row, view, names.seen_from(view as u32, actuator)));
            }
        }
        let actuator = SetTree::train(runs, &runs.tree, columns.clone(), &seen)?;
        let kind_tree = |unit: usize| {
            let mut samples = seen.clone();
            samples.retain(|&(.., actuator)| actuator == unit as u32);
            samples.iter_mut().for_each(|(row, _, class)| *class = runs.data.rows[*row].kind);
            let is_own = |column: &usize| runs.data.features[*column].feature.actuators == [unit];
            let mut readable = columns.clone();
            if names.actuators.len() > 1 && columns.iter().any(is_own) {
                readable.retain(is_own);
            }
            let train = || SetTree::train(runs, &runs.kind_tree, readable, &samples);
            (!samples.is_empty()).then(train).transpose()
        };
        let kinds = (0..names.actuators.len()).map(kind_tree).collect::<Result<_, _>>()?;
        Ok(SetTrees { actuator, kinds })
    }
}

/// Asks the trees of a set about rows.
struct SetJudge<'r> {
    runs: &'r SensorRuns,
    set: SensorMask,
    trees: Option<SetTrees>,
    values: Vec<f64>,
}

impl SetJudge<'_> {
    fn answer(&mut self, row: usize) -> FaultAnswer {
        let is_detected = self.runs.beyond(row) & self.set != 0;
        let none = FaultAnswer { row, is_detected, group: None, shut_down: None };
        if !is_detected {
            return none;
        }
        self.runs.data.examples.row_into(0, row, &mut self.values);
        let Some(trees) = &self.trees else { return none };
        let actuator = arg_max(&trees.actuator.shares(&self.values));
        let Some(Some(tree)) = trees.kinds.get(actuator) else { return none };
        let shares = tree.shares(&self.values);
        let mut order: Vec<usize> = (0..shares.len()).filter(|&kind| shares[kind] > 0.0).collect();
        order.sort_by(|&a, &b| shares[b].total_cmp(&shares[a]));
        let (label, kind) = (self.runs.data.examples.labels()[row], self.runs.data.rows[row].kind);
        let place = order.iter().position(|&own| own == kind as usize);
        let place = place.filter(|_| actuator == label.actuator as usize);
        let actuator = actuator as u32;
        FaultAnswer {
            group: place.map(|place| place + 1).filter(|size| *size <= GROUPS),
            shut_down: self.is_shut_down(&shares).then_some(actuator),
            ..none
        }
    }

    /// Whether the action with the most weight switches the actuator off.
    fn is_shut_down(&self, shares: &[f64]) -> bool {
        let mut weights = vec![0.0; self.runs.switches_off.len()];
        for (share, &action) in shares.iter().zip(&self.runs.actions) {
            weights[action as usize] += share;
        }
        self.runs.switches_off[arg_max(&weights)]
    }
}

/// The place of the largest value, the lowest in a tie.
fn arg_max(values: &[f64]) -> usize {
    (1..values.len()).fold(0, |best, place| if values[place] > values[best] { place } else { best })
}
