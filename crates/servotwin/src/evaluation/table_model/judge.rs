//! Evaluates a classifier on held-out rows: overall, by class, by group, and against the most frequent class.

use super::{HoldOut, PreparedTable};
use crate::evaluation::EvaluationError;
use crate::parallel::{self, Workers};
use serde::Serialize;
use servotwin_diagnosis::classifiers::{Classifier, Model};
use servotwin_learning::Samples;
use servotwin_learning::classifiers;
use servotwin_learning::metrics::{Confusion, Rate, Score, cluster_bootstrap};
use servotwin_learning::splits::Split;

/// Number of bootstrap resamples of the groups for an interval.
const RESAMPLES: usize = 2000;

/// Seed of the bootstrap.
const SEED: u64 = 1;

/// A row, its class, and the predicted class.
pub(super) type PredictedRow = (usize, u32, u32);

/// The result of answering with one class for every row.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Baseline {
    /// The most frequent class of the training rows; that of the first split if splits differ.
    pub class: String,
    /// Its accuracy on the held-out rows.
    pub accuracy: Option<f64>,
}

/// The result for one class.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClassResult {
    /// The name of the class.
    pub class: String,
    /// Share of its rows that were recognized.
    pub recall: Rate,
    /// Share of right answers among the rows predicted as this class.
    pub precision: Option<f64>,
}

/// The result for one group.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GroupResult {
    /// The name of the group.
    pub group: String,
    /// The classes in it.
    pub classes: Vec<String>,
    /// Number of held-out rows.
    pub rows: u64,
    /// Number of right predictions.
    pub right: u64,
}

/// The result of a classifier on held-out rows.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JudgedClassifier {
    /// The score over all held-out rows. With groups, the interval comes from resampling whole groups.
    pub score: Score,
    /// Whether the intervals come from a bootstrap over groups.
    pub intervals_over_groups: bool,
    /// The result of the most frequent class; `None` if nothing was trained.
    pub baseline: Option<Baseline>,
    /// Results by class.
    pub classes: Vec<ClassResult>,
    /// Results by held-out group.
    pub groups: Vec<GroupResult>,
    /// Reasons why the result may be less good than it looks.
    pub warnings: Vec<String>,
}

impl PreparedTable {
    /// Trains and tests a classifier over held-out rows.
    ///
    /// # Errors
    /// See [`PreparedTable::splits`]; or training fails.
    pub fn validate(
        &self,
        settings: &classifiers::Settings,
        hold_out: HoldOut,
        workers: Workers,
    ) -> Result<JudgedClassifier, EvaluationError> {
        let splits = self.splits(hold_out)?;
        let one = |split: &Split| -> Result<Vec<PredictedRow>, EvaluationError> {
            let model = self.fit(settings, &split.train)?;
            Ok(self.predictions(&model, &split.test))
        };
        let results = parallel::map(&splits, workers, one)?;
        let results = results.into_iter().collect::<Result<Vec<_>, _>>()?;
        let baseline = self.baseline(&splits);
        let mut judged = self.judged(&results, Some(baseline));
        judged.warnings.extend(self.never_trained(&splits));
        Ok(judged)
    }

    /// The predictions of a model for the given rows.
    pub(super) fn predictions(&self, model: &Model, rows: &[usize]) -> Vec<PredictedRow> {
        let said = predicted(model, &self.samples, rows);
        let truth = rows.iter().map(|&row| self.samples.labels()[row]);
        rows.iter().zip(truth).zip(said).map(|((&row, truth), said)| (row, truth, said)).collect()
    }

    /// Evaluates predictions, given by split.
    pub(super) fn judged(
        &self,
        splits: &[Vec<PredictedRow>],
        baseline: Option<Baseline>,
    ) -> JudgedClassifier {
        let all: Vec<PredictedRow> = splits.concat();
        let mut confusion = Confusion::new(self.samples.classes());
        all.iter().for_each(|&(_, truth, said)| confusion.count(truth, Some(said)));
        // Wilson's interval, or an interval over groups if there are any.
        let per_split = splits.iter().map(|split| Rate::of(split, is_right).share).collect();
        let names = self.samples.class_names().to_vec();
        let score = Score::new(names, self.rate(&all), &confusion, per_split);
        JudgedClassifier {
            classes: self.of_classes(&confusion, &all),
            groups: self.of_groups(&all),
            intervals_over_groups: self.groups.is_some(),
            baseline,
            warnings: self.warnings.clone(),
            score,
        }
    }

    /// The share of right predictions, with its interval.
    fn rate(&self, predictions: &[PredictedRow]) -> Rate {
        let plain = Rate::of(predictions, is_right);
        let Some(groups) = self.groups.as_ref().filter(|_| !predictions.is_empty()) else {
            return plain;
        };
        let clusters: Vec<u32> =
            predictions.iter().map(|(row, ..)| groups.coded.codes[*row]).collect();
        let right = |said: &PredictedRow| f64::from(u8::from(is_right(said)));
        let count: Vec<f64> = predictions.iter().map(right).collect();
        let ones = vec![1.0; count.len()];
        let (low, high) = cluster_bootstrap(&clusters, &count, &ones, RESAMPLES, SEED);
        Rate { low, high, ..plain }
    }

    fn of_classes(&self, confusion: &Confusion, all: &[PredictedRow]) -> Vec<ClassResult> {
        let names = self.samples.class_names().iter().enumerate();
        let result = |(class, name): (usize, &String)| {
            let of_class: Vec<PredictedRow> =
                all.iter().filter(|(_, truth, _)| *truth as usize == class).copied().collect();
            let (recall, precision) = (self.rate(&of_class), confusion.precision(class));
            ClassResult { class: name.clone(), recall, precision }
        };
        names.map(result).collect()
    }

    fn of_groups(&self, all: &[PredictedRow]) -> Vec<GroupResult> {
        let Some(groups) = &self.groups else {
            return vec![];
        };
        let empty =
            |name: &String| GroupResult { group: name.clone(), classes: vec![], rows: 0, right: 0 };
        let mut results: Vec<GroupResult> = groups.coded.names.iter().map(empty).collect();
        for &(row, truth, said) in all {
            let result = &mut results[groups.coded.codes[row] as usize];
            result.rows += 1;
            result.right += u64::from(said == truth);
            let class = &self.samples.class_names()[truth as usize];
            if !result.classes.contains(class) {
                result.classes.push(class.clone());
            }
        }
        results.retain(|result| result.rows > 0);
        results
    }

    /// The most frequent class of each split's training rows, tested on its test rows.
    fn baseline(&self, splits: &[Split]) -> Baseline {
        let labels = self.samples.labels();
        let (mut right, mut of, mut first) = (0, 0, None);
        for split in splits {
            let mut counts = vec![0u64; self.samples.classes()];
            split.train.iter().for_each(|&row| counts[labels[row] as usize] += 1);
            let most = counts.iter().max().copied().unwrap_or(0);
            let class = counts.iter().position(|&count| count == most).unwrap_or(0);
            first.get_or_insert(class);
            right += split.test.iter().filter(|&&row| labels[row] as usize == class).count() as u64;
            of += split.test.len() as u64;
        }
        let class = self.samples.class_names()[first.unwrap_or(0)].clone();
        Baseline { class, accuracy: Rate::new(right, of).share }
    }

    /// A warning about classes that are tested in a split without being trained there.
    fn never_trained(&self, splits: &[Split]) -> Option<String> {
        let labels = self.samples.labels();
        let mut missing = vec![false; self.samples.classes()];
        for split in splits {
            let mut trained = vec![false; missing.len()];
            split.train.iter().for_each(|&row| trained[labels[row] as usize] = true);
            let tested = split.test.iter().map(|&row| labels[row] as usize);
            tested.filter(|&class| !trained[class]).for_each(|class| missing[class] = true);
        }
        let names = self.samples.class_names().iter().zip(&missing);
        let names: Vec<&str> =
            names.filter(|(_, missing)| **missing).map(|(name, _)| name.as_str()).collect();
        (!names.is_empty()).then(|| {
            format!("tested without having been trained in some split: {}", names.join(", "))
        })
    }
}

fn is_right((_, truth, said): &PredictedRow) -> bool {
    truth == said
}

/// The class that a model predicts for each row.
pub(super) fn predicted(model: &Model, samples: &Samples, rows: &[usize]) -> Vec<u32> {
    let mut values = vec![0.0; samples.features()];
    let mut scratch = vec![0.0; model.classes()];
    let one = |&row: &usize| {
        samples.row_into(row, &mut values);
        model.predict_with(&values, &mut scratch)
    };
    rows.iter().map(one).collect()
}
