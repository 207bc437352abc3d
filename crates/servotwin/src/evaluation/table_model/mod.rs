//! Classifiers for arbitrary feature tables: training, testing and prediction.
//!
//! A row is an example. One column holds the class; optional columns hold the group and the side of the split.
//! [`prepare`] selects the features among the other columns and explains which ones it does not use. [`PreparedTable`]
//! trains and tests.

mod columns;
mod error;
mod hold_out;
mod judge;
mod labels;
mod precision;
mod predict;

pub use columns::{FeatureSource, MOST_CATEGORIES, Unused};
pub use error::TableModelError;
pub use hold_out::HoldOut;
pub use judge::{Baseline, ClassResult, GroupResult, JudgedClassifier};
pub use labels::Coded;
pub use predict::{
    AnsweredQuestion, Explanation, Predicted, evaluate_table, explain, judge_table, predict,
    question,
};

pub(crate) use columns::texts;

use super::error::EvaluationError;
use crate::table::{Origin, Table};
use columns::{choose, encode};
use hold_out::SplitSide;
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::Error;
use servotwin_diagnosis::classifiers::{Classifier, Model, Scores};
use servotwin_learning::Samples;
use servotwin_learning::classifiers::{self, Fit};

/// The format of stored table models.
pub const FORMAT: &str = "servotwin classifier 2";

/// How the rows of each class are weighted in training.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum ClassWeights {
    /// All rows have the same weight.
    #[default]
    Equal,
    /// All classes have the same total weight.
    Balanced,
    /// Weights of the rows of named classes; 1 for all others.
    Given(Vec<(String, f64)>),
}

/// The roles of the columns.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Selection {
    /// The column with the class.
    pub label: String,
    /// Limits that divide a measured label into classes; empty for a label that is a class.
    pub label_limits: Vec<f64>,
    /// The column with the group; rows of one group are never on both sides of a split.
    pub group: Option<String>,
    /// The column that assigns rows to training and test.
    pub split: Option<String>,
    /// The value that marks test rows; `None` for `test` with `train` and the like.
    pub test_value: Option<String>,
    /// The columns to use as features; if empty, all other informative columns.
    pub features: Vec<String>,
    /// Columns to ignore.
    pub ignored: Vec<String>,
    /// Numeric columns with category codes: every number becomes a separate feature.
    pub categorical: Vec<String>,
    /// How the rows of each class are weighted in training.
    pub class_weights: ClassWeights,
}

impl Selection {
    /// The columns that are never features.
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
    /// The sources of its features, in the order of the model.
    pub inputs: Vec<FeatureSource>,
    /// The classes, in the order of the model.
    pub classes: Vec<String>,
    /// The training weight of each class; empty if all were equal.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub class_weights: Vec<f64>,
    /// The trained classifier.
    pub model: Model,
}

impl TableModel {
    /// Whether its scores are probabilities. AdaBoost's votes are not, once classes were weighted: they depend on the
    /// weights in an unknown way.
    pub fn gives_probabilities(&self) -> bool {
        let votes = matches!(self.model, Model::Adaboost(_));
        self.model.scores() == Scores::Shares && (self.class_weights.is_empty() || !votes)
    }

    /// Writes one score for each class.
    ///
    /// Class weights shift the decision but not the probabilities. A share in the weighted rows is divided by the
    /// weight of its class, and the shares are normalized. This restores the shares of the unweighted rows (the shift
    /// of priors after Elkan, 2001, with the priors of training).
    ///
    /// # Panics
    /// See [`Classifier::scores_into`].
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
    /// The error of [`Classifier::check`], or a wrong length.
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
        self.inputs.iter().map(FeatureSource::name).collect()
    }
}

/// The groups of the rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Groups {
    /// The name of the group column.
    pub column: String,
    /// The group of every row.
    pub coded: Coded,
}

/// A table prepared for training.
#[derive(Debug)]
pub struct PreparedTable {
    samples: Samples,
    inputs: Vec<FeatureSource>,
    selection: Selection,
    groups: Option<Groups>,
    sides: Option<Vec<SplitSide>>,
    /// The first row of each table, with its origin.
    origins: Vec<(usize, Origin)>,
    /// The unused columns, with reasons.
    pub unused: Vec<Unused>,
    /// Reasons why results may be less good than they look.
    pub warnings: Vec<String>,
}

/// Prepares a table for training: features, classes and groups. A second table, with test rows only, must have the same
/// columns and no additional classes.
///
/// # Errors
/// A column is missing or invalid, a row has no class or group, there is only one class, or there is no feature.
pub fn prepare(
    table: Table,
    test: Option<Table>,
    selection: &Selection,
) -> Result<PreparedTable, EvaluationError> {
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
            let side = |row| if row < first_rows { SplitSide::Train } else { SplitSide::Test };
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
    let names = chosen.inputs.iter().map(FeatureSource::name).collect();
    let samples = Samples::with_missing(names, classes.names, values, classes.codes)?;
    Ok(PreparedTable {
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

impl PreparedTable {
    /// The features and classes of all rows.
    pub fn samples(&self) -> &Samples {
        &self.samples
    }

    /// The groups of the rows.
    pub fn groups(&self) -> Option<&Groups> {
        self.groups.as_ref()
    }

    /// The sources of the features.
    pub fn inputs(&self) -> &[FeatureSource] {
        &self.inputs
    }

    /// Trains a classifier on all rows, or on the training rows of a fixed split.
    ///
    /// # Errors
    /// Training fails.
    pub fn train(&self, settings: &classifiers::Settings) -> Result<TableModel, EvaluationError> {
        let rows: Vec<usize> = match &self.sides {
            Some(sides) => (0..sides.len()).filter(|&row| sides[row] == SplitSide::Train).collect(),
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

    /// The weight of each class when training on the given rows.
    fn weights_of_classes(&self, rows: &[usize]) -> Result<Vec<f64>, EvaluationError> {
        let codes = rows.iter().map(|&row| self.samples.labels()[row]);
        let names = self.samples.class_names();
        Ok(labels::weights(&self.selection.class_weights, names, codes)?)
    }

    /// Trains on some of the rows. Trees skip rows without weight, so the table is not copied for them.
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

    /// Adds the place in the file to a missing value.
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
