//! Classifiers for any feature table: training, judging and prediction.
//!
//! Each row is an example. One column holds the class, an optional one the group, and an optional one marks test rows.
//! [`prepare`] chooses the features among the other columns and reports which columns it leaves out and why.
//! [`Prepared`] trains and judges.

mod columns;
mod error;
mod hold_out;
mod judge;
mod labels;
mod precision;
mod predict;

pub use columns::{Input, MOST_CATEGORIES, Unused};
pub use error::TableModelError;
pub use hold_out::HoldOut;
pub use judge::{Baseline, ClassResult, GroupResult, Judged};
pub use labels::Coded;
pub use predict::{
    Explanation, Predicted, Step, evaluate_table, explain, judge_table, predict, question,
};

pub(crate) use columns::texts;

use super::error::EvaluationError;
use crate::table::{Origin, Table};
use columns::{choose, encode};
use hold_out::Side;
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::Error;
use servotwin_diagnosis::classifiers::{Classifier, Model, Scores};
use servotwin_learning::Samples;
use servotwin_learning::classifiers::{self, Fit};

/// Format string of a stored table model.
pub const FORMAT: &str = "servotwin classifier 2";

/// Weights of the classes in training.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum ClassWeights {
    /// Every row has the same weight.
    #[default]
    Equal,
    /// Every class has the same total weight.
    Balanced,
    /// Row weights for the named classes; 1 for all others.
    Given(Vec<(String, f64)>),
}

/// The roles of the columns.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Selection {
    /// The column with the class.
    pub label: String,
    /// Limits that divide a measured label into classes; empty if the label is a class already.
    pub label_limits: Vec<f64>,
    /// The column with the group. All rows of a group stay on one side of a split.
    pub group: Option<String>,
    /// The column that marks training and test rows.
    pub split: Option<String>,
    /// The value of that column that marks test rows. Without it, word pairs such as `test` and `train` apply.
    pub test_value: Option<String>,
    /// The feature columns; empty for all other columns that may carry information.
    pub features: Vec<String>,
    /// Columns to leave out.
    pub ignored: Vec<String>,
    /// Columns whose numbers are names: every number becomes a feature of its own.
    pub categorical: Vec<String>,
    /// Weights of the classes in training.
    pub class_weights: ClassWeights,
}

impl Selection {
    /// The columns that can never be features.
    fn reserved(&self) -> Vec<&str> {
        let others = [&self.group, &self.split];
        std::iter::once(self.label.as_str())
            .chain(others.into_iter().flatten().map(String::as_str))
            .collect()
    }
}

/// A classifier with the names of its features and classes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TableModel {
    /// Must equal [`FORMAT`].
    pub format: String,
    /// The column with the class.
    pub label: String,
    /// Limits that divide a measured label into classes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub label_limits: Vec<f64>,
    /// The source of each feature, in the order of the model.
    pub inputs: Vec<Input>,
    /// The classes, in the order of the model.
    pub classes: Vec<String>,
    /// The row weight of each class in training; empty if all were equal.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub class_weights: Vec<f64>,
    /// The trained classifier.
    pub model: Model,
}

impl TableModel {
    /// Whether the scores are probabilities. AdaBoost's votes are not if classes were weighted, because no rule
    /// corrects them.
    pub fn gives_probabilities(&self) -> bool {
        let votes = matches!(self.model, Model::Adaboost(_));
        self.model.scores() == Scores::Shares && (self.class_weights.is_empty() || !votes)
    }

    /// Writes one score for each class.
    ///
    /// Class weights shift the decision, but not the probabilities. Each share is divided by the weight of its class,
    /// and the shares are scaled to the sum 1. This restores the shares of the unweighted rows (prior correction after
    /// Elkan, 2001, with the priors of training).
    ///
    /// # Panics
    /// As [`Classifier::scores_into`].
    pub fn scores_into(&self, row: &[f64], scores: &mut [f64]) {
        self.model.scores_into(row, scores);
        if self.class_weights.is_empty() || !self.gives_probabilities() {
            return;
        }
        scores.iter_mut().zip(&self.class_weights).for_each(|(score, weight)| *score /= weight);
        let total: f64 = scores.iter().sum();
        if total > 0.0 {
            scores.iter_mut().for_each(|score| *score /= total);
        }
    }

    /// Checks that the parts are consistent, for models from outside.
    ///
    /// # Errors
    /// Errors of [`Classifier::check`], a wrong length, another format, or a class weight that is not positive.
    pub fn check(&self) -> Result<(), Error> {
        let same = |what, expected, found| match expected == found {
            true => Ok(()),
            false => Err(Error::LengthMismatch { what, expected, found }),
        };
        if self.format != FORMAT {
            return Err(Error::CorruptModel { broken: "the format is another one" });
        }
        self.model.check()?;
        same("features", self.model.features(), self.inputs.len())?;
        same("classes", self.model.classes(), self.classes.len())?;
        if !self.class_weights.is_empty() {
            same("class weights", self.classes.len(), self.class_weights.len())?;
        }
        match self.class_weights.iter().all(|weight| *weight > 0.0 && weight.is_finite()) {
            true => Ok(()),
            false => Err(Error::CorruptModel { broken: "a class weight is not above 0" }),
        }
    }

    /// The names of the features.
    pub fn features(&self) -> Vec<String> {
        self.inputs.iter().map(Input::name).collect()
    }
}

/// The groups of the rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Groups {
    /// Name of the group column.
    pub column: String,
    /// Group names, and a code for every row.
    pub coded: Coded,
}

/// A table prepared for training.
#[derive(Debug)]
pub struct Prepared {
    samples: Samples,
    inputs: Vec<Input>,
    selection: Selection,
    groups: Option<Groups>,
    sides: Option<Vec<Side>>,
    /// For each table, its first row and its origin.
    origins: Vec<(usize, Origin)>,
    /// The unused columns with reasons.
    pub unused: Vec<Unused>,
    /// Reasons why results may be optimistic.
    pub warnings: Vec<String>,
}

/// Prepares a table for training: features, classes and groups. A second table holds test rows only. It must have the
/// same columns and no class that the first lacks.
///
/// # Errors
/// A column is missing or has the wrong content, a row has no class or group, or there is only one class or no feature.
pub fn prepare(
    table: Table,
    test: Option<Table>,
    selection: &Selection,
) -> Result<Prepared, EvaluationError> {
    let first_rows = table.row_count();
    let mut tables = vec![table];
    tables.extend(test);
    let classes = labels::classes(&tables, selection)?;
    let chosen = choose(&tables[0], selection, &classes.codes[..first_rows])?;
    let groups = match &selection.group {
        Some(column) => {
            let texts: Result<Vec<_>, _> =
                tables.iter().map(|table| labels::filled(table, column, "group")).collect();
            Some(Groups { column: column.clone(), coded: Coded::of(&texts?.concat()) })
        }
        None => None,
    };
    let sides = match (&selection.split, tables.len()) {
        (Some(column), _) => {
            let texts = labels::filled(&tables[0], column, "value")?;
            Some(hold_out::sides(&texts, column, selection.test_value.as_deref())?)
        }
        (None, 1) => None,
        (None, _) => {
            let side = |row| if row < first_rows { Side::Train } else { Side::Test };
            Some((0..classes.codes.len()).map(side).collect())
        }
    };
    let mut warnings = chosen.warnings;
    if let Some(Groups { column, coded }) = &groups {
        warnings.extend(labels::warnings(&classes, coded, column));
    }
    let starts = [0, first_rows];
    let origins = starts.into_iter().zip(tables.iter().map(|t| t.origin().clone())).collect();
    let values = encode(&mut tables, &chosen.inputs)?;
    drop(tables);
    let names = chosen.inputs.iter().map(Input::name).collect();
    let samples = Samples::with_missing(names, classes.names, values, classes.codes)?;
    Ok(Prepared {
        samples,
        inputs: chosen.inputs,
        selection: selection.clone(),
        groups,
        sides,
        origins,
        unused: chosen.unused,
        warnings,
    })
}

impl Prepared {
    /// The features and classes of all rows.
    pub fn samples(&self) -> &Samples {
        &self.samples
    }

    /// The groups of the rows.
    pub fn groups(&self) -> Option<&Groups> {
        self.groups.as_ref()
    }

    /// The source of each feature.
    pub fn inputs(&self) -> &[Input] {
        &self.inputs
    }

    /// Trains a classifier on all rows, or with a fixed split on its training rows.
    ///
    /// # Errors
    /// Errors of training.
    pub fn train(&self, settings: &classifiers::Settings) -> Result<TableModel, EvaluationError> {
        let rows: Vec<usize> = match &self.sides {
            Some(sides) => (0..sides.len()).filter(|&row| sides[row] == Side::Train).collect(),
            None => (0..self.samples.rows()).collect(),
        };
        Ok(TableModel {
            format: FORMAT.into(),
            label: self.selection.label.clone(),
            label_limits: self.selection.label_limits.clone(),
            inputs: self.inputs.clone(),
            classes: self.samples.class_names().to_vec(),
            class_weights: match self.selection.class_weights {
                ClassWeights::Equal => vec![],
                _ => self.weights_of_classes(&rows)?,
            },
            model: self.fit(settings, &rows)?,
        })
    }

    /// The row weight of each class when some rows train.
    fn weights_of_classes(&self, rows: &[usize]) -> Result<Vec<f64>, EvaluationError> {
        let codes = rows.iter().map(|&row| self.samples.labels()[row]);
        let names = self.samples.class_names();
        Ok(labels::weights(&self.selection.class_weights, names, codes)?)
    }

    /// Trains on some of the rows. Classifiers that learn from missing values get weight 0 for the other rows, which
    /// avoids copying the table.
    fn fit(
        &self,
        settings: &classifiers::Settings,
        rows: &[usize],
    ) -> Result<Model, EvaluationError> {
        let labels = self.samples.labels();
        let of_class = self.weights_of_classes(rows)?;
        let weighted = match settings.kind().learns_from_missing() {
            true => {
                let mut weights = vec![0.0; labels.len()];
                rows.iter().for_each(|&row| weights[row] = of_class[labels[row] as usize]);
                self.samples.clone().with_weights(weights)?
            }
            false => {
                let selected = self.samples.select_rows(rows)?;
                selected.complete().map_err(|error| self.in_words(error, rows))?;
                match self.selection.class_weights {
                    ClassWeights::Equal => selected,
                    _ => {
                        let weight = |&label: &u32| of_class[label as usize];
                        let weights = selected.labels().iter().map(weight).collect();
                        selected.with_weights(weights)?
                    }
                }
            }
        };
        Ok(settings.fit(&weighted)?)
    }

    /// Adds the place in the file to an error about a missing value.
    fn in_words(&self, error: Error, rows: &[usize]) -> EvaluationError {
        match error {
            Error::Missing { column, row } => {
                let reason = "only cart, random_forest and adaboost learn from missing values";
                let place = self.place(rows[row]);
                TableModelError::Missing { column, place, reason }.into()
            }
            error => error.into(),
        }
    }

    /// The place of a row in its file.
    fn place(&self, row: usize) -> String {
        let of = self.origins.iter().rev().find(|(first, _)| *first <= row);
        of.map_or_else(
            || format!("row {}", row + 1),
            |(first, origin)| origin.place_in_file(row - first),
        )
    }
}
