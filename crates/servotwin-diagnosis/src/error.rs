//! The error type of this crate and of `servotwin-learning`.

use alloc::string::String;
use core::fmt;

use crate::numeric::MAX_VALUE;

/// Errors between a table of features and a trained model.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// A table without rows, or in which every row has weight zero.
    NoSamples,
    /// A table without feature columns, or with every column excluded.
    NoFeatures,
    /// Two lengths that must agree do not.
    LengthMismatch {
        /// What was counted, for example `labels`.
        what: &'static str,
        /// Expected length.
        expected: usize,
        /// Actual length.
        found: usize,
    },
    /// A feature value is NaN, infinite, or larger than [`crate::numeric::MAX_VALUE`].
    NotFinite {
        /// Name of the feature column.
        column: String,
        /// Row, counted from zero.
        row: usize,
    },
    /// A feature value is missing, and the classifier cannot learn without it.
    Missing {
        /// Name of the feature column.
        column: String,
        /// Row, counted from zero.
        row: usize,
    },
    /// A label points past the list of class names.
    LabelOutOfRange {
        /// Row, counted from zero.
        row: usize,
        /// The unknown label.
        label: u32,
        /// Number of classes.
        classes: usize,
    },
    /// A sample weight is negative, NaN, infinite, or larger than [`crate::numeric::MAX_VALUE`].
    WeightOutOfRange {
        /// Row, counted from zero.
        row: usize,
        /// The rejected weight.
        weight: f64,
    },
    /// An index is past the end of what it indexes.
    IndexOutOfRange {
        /// What was indexed, for example `row`.
        what: &'static str,
        /// The index used.
        index: usize,
        /// Number of items available.
        length: usize,
    },
    /// A setting names a feature that the samples do not have.
    UnknownFeature {
        /// Name of the missing feature.
        name: String,
    },
    /// A setting is outside its range.
    SettingOutOfRange {
        /// Name of the setting.
        setting: &'static str,
        /// The value found.
        value: f64,
        /// The allowed values, in words.
        allowed: &'static str,
    },
    /// There are fewer rows or groups than folds.
    TooFewForFolds {
        /// Number of folds.
        folds: usize,
        /// Rows or groups available.
        available: usize,
    },
    /// The parts of a stored model do not fit together.
    CorruptModel {
        /// The violated condition, in words.
        broken: &'static str,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::NoSamples => write!(out, "no samples with positive weight"),
            Error::NoFeatures => write!(out, "no feature columns"),
            Error::LengthMismatch { what, expected, found } => {
                write!(out, "{what}: expected {expected}, found {found}")
            }
            Error::NotFinite { column, row } => {
                write!(out, "feature `{column}`, row {row}: value is not finite or too large")
            }
            Error::Missing { column, row } => {
                write!(out, "feature `{column}`, row {row}: no value, which only trees learn from")
            }
            Error::LabelOutOfRange { row, label, classes } => {
                write!(out, "row {row}: label {label}, but there are {classes} classes")
            }
            Error::WeightOutOfRange { row, weight } => {
                write!(out, "row {row}: weight {weight} is not between 0 and {MAX_VALUE:e}")
            }
            Error::IndexOutOfRange { what, index, length } => {
                write!(out, "{what} {index} is past the end ({length})")
            }
            Error::UnknownFeature { name } => write!(out, "no feature is named `{name}`"),
            Error::SettingOutOfRange { setting, value, allowed } => {
                write!(out, "setting `{setting}` is {value}, allowed: {allowed}")
            }
            Error::TooFewForFolds { folds, available } => {
                write!(out, "{folds} folds asked for, but only {available} to fill them")
            }
            Error::CorruptModel { broken } => write!(out, "stored model is corrupt: {broken}"),
        }
    }
}

impl core::error::Error for Error {}

/// Checks the range of a setting.
///
/// # Errors
/// [`Error::SettingOutOfRange`] unless `holds`.
pub fn require(
    holds: bool,
    setting: &'static str,
    value: f64,
    allowed: &'static str,
) -> Result<(), Error> {
    if holds { Ok(()) } else { Err(Error::SettingOutOfRange { setting, value, allowed }) }
}

/// Checks that two lengths agree.
///
/// # Errors
/// [`Error::LengthMismatch`].
pub fn same_length(what: &'static str, expected: usize, found: usize) -> Result<(), Error> {
    if expected == found { Ok(()) } else { Err(Error::LengthMismatch { what, expected, found }) }
}

/// Checks a condition that the parts of a stored model must meet.
pub(crate) fn require_sound(holds: bool, broken: &'static str) -> Result<(), Error> {
    if holds { Ok(()) } else { Err(Error::CorruptModel { broken }) }
}
