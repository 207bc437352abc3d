//! Training samples: a validated table of features with a class for each row.
//!
//! The table is column-major, because tree learning reads one feature at a time.

use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use servotwin_diagnosis::error::{Error, same_length};
use servotwin_diagnosis::numeric::MAX_VALUE;

/// A table of finite features (rows × features), one class label per row, and row weights.
///
/// Constructors check the contents, so that no classifier has to. There is at least one row and one feature, every
/// value is finite and at most [`MAX_VALUE`] in magnitude, and every label has a class name. Weights have the same
/// limit and are not all zero. Samples [with missing values](Samples::with_missing) hold NaN for unknown values; only
/// trees learn from them.
///
/// A clone shares the features, so that the same table with other weights needs no copy.
#[derive(Debug, Clone, PartialEq)]
pub struct Samples {
    feature_names: Vec<String>,
    class_names: Vec<String>,
    /// Column-major: the value of `row` in `column` is at `column * rows + row`.
    values: Arc<Vec<f64>>,
    labels: Vec<u32>,
    weights: Option<Vec<f64>>,
    has_missing: bool,
}

impl Samples {
    /// Creates samples from column-major values: all rows of the first feature, then of the second …
    ///
    /// # Errors
    /// [`Error::NoSamples`], [`Error::NoFeatures`], [`Error::LengthMismatch`] unless there are `labels.len() *
    /// feature_names.len()` values, [`Error::NotFinite`] with column and row, [`Error::LabelOutOfRange`].
    pub fn from_columns(
        feature_names: Vec<String>,
        class_names: Vec<String>,
        values: Vec<f64>,
        labels: Vec<u32>,
    ) -> Result<Self, Error> {
        Samples::checked(feature_names, class_names, values, labels, false)
    }

    /// Creates samples from column-major values, with NaN for unknown values. Only decision trees and their ensembles
    /// learn from missing values; see `Samples::complete`.
    ///
    /// # Errors
    /// As [`Samples::from_columns`], but [`Error::NotFinite`] only for infinities.
    pub fn with_missing(
        feature_names: Vec<String>,
        class_names: Vec<String>,
        mut values: Vec<f64>,
        labels: Vec<u32>,
    ) -> Result<Self, Error> {
        let mut has_missing = false;
        for value in values.iter_mut().filter(|value| value.is_nan()) {
            // The positive NaN sorts after every number.
            *value = f64::NAN.copysign(1.0);
            has_missing = true;
        }
        Samples::checked(feature_names, class_names, values, labels, has_missing)
    }

    fn checked(
        feature_names: Vec<String>,
        class_names: Vec<String>,
        values: Vec<f64>,
        labels: Vec<u32>,
        has_missing: bool,
    ) -> Result<Self, Error> {
        let values = Arc::new(values);
        let weights = None;
        let samples = Samples { feature_names, class_names, values, labels, weights, has_missing };
        samples.check()?;
        Ok(samples)
    }

    /// Adds a weight for each row. A weight of 2 counts as two equal rows; rows of weight 0 are ignored.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`], [`Error::WeightOutOfRange`], [`Error::NoSamples`] if all weights are zero.
    pub fn with_weights(mut self, weights: Vec<f64>) -> Result<Self, Error> {
        same_length("weights", self.rows(), weights.len())?;
        for (row, &weight) in weights.iter().enumerate() {
            if !(0.0..=MAX_VALUE).contains(&weight) {
                return Err(Error::WeightOutOfRange { row, weight });
            }
        }
        if weights.iter().all(|&weight| weight == 0.0) {
            return Err(Error::NoSamples);
        }
        self.weights = Some(weights);
        Ok(self)
    }

    /// Whether any value is missing.
    pub(crate) fn has_missing(&self) -> bool {
        self.has_missing
    }

    /// Checks that no value is missing, for classifiers that need complete rows.
    ///
    /// # Errors
    /// [`Error::Missing`] with the first missing value.
    pub(crate) fn complete(&self) -> Result<(), Error> {
        let mut columns = self.values.chunks_exact(self.rows()).enumerate();
        let first = columns.find_map(|(column, values)| {
            Some((column, values.iter().position(|value| value.is_nan())?))
        });
        match first.filter(|_| self.has_missing) {
            Some((column, row)) => {
                Err(Error::Missing { column: self.feature_names[column].clone(), row })
            }
            None => Ok(()),
        }
    }

    /// Number of rows, at least 1.
    pub fn rows(&self) -> usize {
        self.labels.len()
    }

    /// Number of feature columns, at least 1.
    pub fn features(&self) -> usize {
        self.feature_names.len()
    }

    /// Number of class names. Some classes may have no rows.
    pub fn classes(&self) -> usize {
        self.class_names.len()
    }

    /// Names of the feature columns.
    pub fn feature_names(&self) -> &[String] {
        &self.feature_names
    }

    /// Names of the classes; label `k` is the class `class_names()[k]`.
    pub fn class_names(&self) -> &[String] {
        &self.class_names
    }

    /// One feature of all rows.
    ///
    /// # Panics
    /// If `column` is not below [`Samples::features`].
    pub fn column(&self, column: usize) -> &[f64] {
        let rows = self.rows();
        &self.values[column * rows..(column + 1) * rows]
    }

    /// Copies the features of one row into `out`.
    ///
    /// # Panics
    /// If `row` is not below [`Samples::rows`].
    pub fn row_into(&self, row: usize, out: &mut [f64]) {
        let rows = self.rows();
        for (slot, column) in out.iter_mut().zip(self.values.chunks_exact(rows)) {
            *slot = column[row];
        }
    }

    /// The label of every row, each below [`Samples::classes`].
    pub fn labels(&self) -> &[u32] {
        &self.labels
    }

    /// The weight of every row, if weights were given.
    pub fn weights(&self) -> Option<&[f64]> {
        self.weights.as_deref()
    }

    /// The weight of one row; 1 without weights.
    ///
    /// # Panics
    /// If `row` is not below [`Samples::rows`].
    pub fn weight(&self, row: usize) -> f64 {
        self.weights.as_ref().map_or(1.0, |weights| weights[row])
    }

    /// Weight of each class over all rows.
    pub(crate) fn class_weights(&self) -> Vec<f64> {
        let mut totals = vec![0.0; self.classes()];
        for (row, &label) in self.labels.iter().enumerate() {
            totals[label as usize] += self.weight(row);
        }
        totals
    }

    fn check(&self) -> Result<(), Error> {
        if self.labels.is_empty() {
            return Err(Error::NoSamples);
        }
        if self.feature_names.is_empty() {
            return Err(Error::NoFeatures);
        }
        same_length("values", self.rows() * self.features(), self.values.len())?;
        for (column, values) in self.values.chunks_exact(self.rows()).enumerate() {
            let allowed = |value: &f64| {
                (-MAX_VALUE..=MAX_VALUE).contains(value) || (self.has_missing && value.is_nan())
            };
            if let Some(row) = values.iter().position(|value| !allowed(value)) {
                return Err(Error::NotFinite { column: self.feature_names[column].clone(), row });
            }
        }
        let classes = self.classes();
        match self.labels.iter().position(|&label| label as usize >= classes) {
            Some(row) => Err(Error::LabelOutOfRange { row, label: self.labels[row], classes }),
            None => Ok(()),
        }
    }
}

/// The classes that have rows of positive weight, renumbered without gaps.
///
/// Classifiers with parameters per class learn only these, so that an empty class cannot cause a division by zero.
pub(crate) struct PresentClasses {
    /// The original label of each present class, ascending.
    pub(crate) labels: Vec<u32>,
    /// For every row, the index of its label in `labels`; 0 for rows of a class without weight.
    pub(crate) of_row: Vec<usize>,
    /// The weight of each present class, positive.
    pub(crate) weights: Vec<f64>,
}

impl PresentClasses {
    pub(crate) fn new(samples: &Samples) -> Self {
        let totals = samples.class_weights();
        let mut place = vec![0; totals.len()];
        let mut present = PresentClasses { labels: vec![], of_row: vec![], weights: vec![] };
        for (label, &weight) in totals.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
            place[label] = present.labels.len();
            present.labels.push(label as u32);
            present.weights.push(weight);
        }
        present.of_row = samples.labels().iter().map(|&label| place[label as usize]).collect();
        present
    }

    pub(crate) fn len(&self) -> usize {
        self.labels.len()
    }

    /// Weight of all rows, positive.
    pub(crate) fn total_weight(&self) -> f64 {
        self.weights.iter().sum()
    }
}
