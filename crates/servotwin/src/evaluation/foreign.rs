//! Any table of features: training a classifier from it, and judging one with it.
//!
//! A row is an example; a column holds the class, another (if there is one) the group, and all
//! other columns with numbers are features unless the features are named.

use super::error::EvaluationError;
use super::parallel::{self, Workers};
use super::score::{Prediction, Score};
use crate::table::{Table, Values};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::Samples;
use servotwin_diagnosis::classifiers::{self, Classifier, Fit, Model};
use servotwin_diagnosis::evaluation::{Split, grouped_k_fold, stratified_k_fold};

/// The word that a stored table model begins with.
pub const FORMAT: &str = "servotwin classifier 1";

/// Which columns are what.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Selection {
    /// The column with the class.
    pub label: String,
    /// The column with the group; rows of one group never stand on both sides of a split.
    pub group: Option<String>,
    /// The columns to learn from; none for all other columns with numbers.
    pub features: Vec<String>,
}

/// How rows of a table are held out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum HoldOut {
    /// Folds: of groups where there is a group column, else with equal shares of the classes.
    Folds {
        /// Number of folds.
        folds: usize,
        /// The seed.
        seed: u64,
    },
    /// The last part of each class, in the order of the table: for series in time.
    Last {
        /// The part, between 0 and 1.
        share: f64,
    },
}

/// A classifier with the names that its numbers stand for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TableModel {
    /// [`FORMAT`].
    pub format: String,
    /// The column with the class.
    pub label: String,
    /// The columns it reads, in the order of the model.
    pub features: Vec<String>,
    /// The classes, in the order of the model.
    pub classes: Vec<String>,
    /// The classifier.
    pub model: Model,
}

impl TableModel {
    /// Checks that the parts fit each other; for models that come from outside.
    ///
    /// # Errors
    /// What [`Classifier::check`] says, or that a length is wrong.
    pub fn check(&self) -> Result<(), servotwin_diagnosis::Error> {
        use servotwin_diagnosis::Error;
        let same = |what, expected, found| match expected == found {
            true => Ok(()),
            false => Err(Error::LengthMismatch { what, expected, found }),
        };
        if self.format != FORMAT {
            return Err(Error::CorruptModel { broken: "the format is another one" });
        }
        self.model.check()?;
        same("features", self.model.features(), self.features.len())?;
        same("classes", self.model.classes(), self.classes.len())
    }
}

/// The samples of a table, and the group of each row.
///
/// # Errors
/// A column is missing, holds text where numbers are needed or a number that is not finite; there
/// is only one class, or no feature.
pub fn samples(
    table: &Table,
    selection: &Selection,
) -> Result<(Samples, Option<Vec<u32>>), EvaluationError> {
    let texts = texts(table, &selection.label)?;
    let (classes, labels) = coded(&texts);
    if classes.len() < 2 {
        return Err(EvaluationError::OneClass {
            column: selection.label.clone(),
            class: classes.into_iter().next().unwrap_or_default(),
        });
    }
    let features = feature_columns(table, selection)?;
    let values = matrix(table, &features)?;
    let groups = match &selection.group {
        Some(column) => Some(coded(&self::texts(table, column)?).1),
        None => None,
    };
    Ok((Samples::from_columns(features, classes, values, labels)?, groups))
}

/// Trains a classifier with all rows of a table.
///
/// # Errors
/// As [`samples`], and what training says.
pub fn train_table(
    table: &Table,
    selection: &Selection,
    classifier: &classifiers::Settings,
) -> Result<TableModel, EvaluationError> {
    let (samples, _) = samples(table, selection)?;
    Ok(TableModel {
        format: FORMAT.into(),
        label: selection.label.clone(),
        features: samples.feature_names().to_vec(),
        classes: samples.class_names().to_vec(),
        model: classifier.fit(&samples)?,
    })
}

/// Judges a trained classifier with a table.
///
/// # Errors
/// A column is missing or unfit, or a class is not one that the model knows.
pub fn evaluate_table(table: &Table, model: &TableModel) -> Result<Score, EvaluationError> {
    let column = &model.label;
    let place = |class: &String| {
        let found = model.classes.iter().position(|known| known == class);
        found.map(|place| place as u32).ok_or_else(|| EvaluationError::UnknownClass {
            column: column.clone(),
            class: class.clone(),
            known: model.classes.clone(),
        })
    };
    let labels = texts(table, column)?.iter().map(place).collect::<Result<Vec<u32>, _>>()?;
    let values = matrix(table, &model.features)?;
    let samples =
        Samples::from_columns(model.features.clone(), model.classes.clone(), values, labels)?;
    let predicted = model.model.predict(&samples)?;
    Ok(Score::of(model.classes.clone(), &[predictions(samples.labels(), &predicted, |row| row)]))
}

/// Trains and tests a classifier over held-out rows.
///
/// # Errors
/// As [`samples`]; [`EvaluationError::TooFewGroups`]; what training says.
pub fn validate_table(
    table: &Table,
    selection: &Selection,
    classifier: &classifiers::Settings,
    hold_out: HoldOut,
    workers: Workers,
) -> Result<Score, EvaluationError> {
    let (samples, groups) = samples(table, selection)?;
    let splits = splits(&samples, groups.as_deref(), selection, hold_out)?;
    let one = |split: &Split| -> Result<Vec<Prediction>, EvaluationError> {
        let model = classifier.fit(&samples.select_rows(&split.train)?)?;
        let test = samples.select_rows(&split.test)?;
        let predicted = model.predict(&test)?;
        Ok(predictions(test.labels(), &predicted, |place| split.test[place]))
    };
    let results = parallel::map(&splits, workers, one)?;
    let results: Result<Vec<Vec<Prediction>>, _> = results.into_iter().collect();
    Ok(Score::of(samples.class_names().to_vec(), &results?))
}

fn predictions(truth: &[u32], predicted: &[u32], row: impl Fn(usize) -> usize) -> Vec<Prediction> {
    let pairs = truth.iter().zip(predicted).enumerate();
    // Every row is a cluster of its own.
    let one = |(place, (&truth, &said)): (usize, (&u32, &u32))| {
        let row = row(place) as u32;
        Prediction { cluster: row, kind: row, truth, said: Some(said) }
    };
    pairs.map(one).collect()
}

fn splits(
    samples: &Samples,
    groups: Option<&[u32]>,
    selection: &Selection,
    hold_out: HoldOut,
) -> Result<Vec<Split>, EvaluationError> {
    match (hold_out, groups) {
        (HoldOut::Folds { folds, seed }, Some(groups)) => {
            let found = groups.iter().max().map_or(0, |last| *last as usize + 1);
            if found < folds {
                let column = selection.group.clone().unwrap_or_default();
                return Err(EvaluationError::TooFewGroups { column, found, needed: folds });
            }
            Ok(grouped_k_fold(groups, folds, seed)?)
        }
        (HoldOut::Folds { folds, seed }, None) => {
            Ok(stratified_k_fold(samples.labels(), folds, seed)?)
        }
        (HoldOut::Last { share }, _) => Ok(vec![last_of_each_class(samples, share)?]),
    }
}

fn last_of_each_class(samples: &Samples, share: f64) -> Result<Split, EvaluationError> {
    if !(share > 0.0 && share < 1.0) {
        let (setting, allowed) = ("held out", "between 0 and 1");
        let error =
            servotwin_diagnosis::Error::SettingOutOfRange { setting, value: share, allowed };
        return Err(error.into());
    }
    let mut split = Split { train: vec![], test: vec![] };
    for class in 0..samples.classes() as u32 {
        let rows: Vec<usize> =
            (0..samples.rows()).filter(|&row| samples.labels()[row] == class).collect();
        let first = rows.len() - (rows.len() as f64 * share).floor() as usize;
        split.train.extend(&rows[..first]);
        split.test.extend(&rows[first..]);
    }
    split.train.sort_unstable();
    split.test.sort_unstable();
    Ok(split)
}

/// The columns to learn from.
fn feature_columns(table: &Table, selection: &Selection) -> Result<Vec<String>, EvaluationError> {
    if !selection.features.is_empty() {
        return Ok(selection.features.clone());
    }
    let numbers = |values: &Values| {
        matches!(values, Values::Float(_) | Values::Integer(_) | Values::Unsigned(_))
    };
    let reserved = |name: &String| {
        *name == selection.label || selection.group.as_ref().is_some_and(|group| group == name)
    };
    let columns = table.columns().iter().filter(|column| numbers(&column.values));
    let names: Vec<String> =
        columns.map(|column| column.name.clone()).filter(|name| !reserved(name)).collect();
    match names.is_empty() {
        true => Err(EvaluationError::NoFeatures),
        false => Ok(names),
    }
}

fn matrix(table: &Table, features: &[String]) -> Result<Vec<f64>, EvaluationError> {
    let mut values = Vec::with_capacity(features.len() * table.row_count());
    for feature in features {
        values.extend_from_slice(&table.finite_f64(feature)?);
    }
    Ok(values)
}

/// The values of any column as text.
pub(super) fn texts(table: &Table, name: &str) -> Result<Vec<String>, EvaluationError> {
    let column = table.column(name)?;
    Ok(match &column.values {
        Values::Float(values) => values.iter().map(f64::to_string).collect(),
        Values::Integer(values) => values.iter().map(i64::to_string).collect(),
        Values::Unsigned(values) => values.iter().map(u32::to_string).collect(),
        Values::Flag(values) => values.iter().map(bool::to_string).collect(),
        Values::Text(values) => values.clone(),
    })
}

/// Texts sorted and numbered.
fn coded(texts: &[String]) -> (Vec<String>, Vec<u32>) {
    let mut names = texts.to_vec();
    names.sort();
    names.dedup();
    let code = |text: &String| names.binary_search(text).unwrap_or(0) as u32;
    let codes = texts.iter().map(code).collect();
    (names, codes)
}
