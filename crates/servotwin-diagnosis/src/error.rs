//! The error type of this crate and of `servotwin-learning`.

use alloc::string::String;

use crate::numeric::MAX_VALUE;

/// Errors between a table of features and a trained model. Rows and indices count from zero.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
pub enum Error {
    /// A table without rows, or in which every row has weight zero.
    #[error("no samples with positive weight")]
    NoSamples,
    /// A table without feature columns, or with every column excluded.
    #[error("no feature columns")]
    NoFeatures,
    /// Two lengths that must agree do not.
    #[error("{what}: expected {expected}, found {found}")]
    LengthMismatch { what: &'static str, expected: usize, found: usize },
    /// A feature value is NaN, infinite, or larger than [`MAX_VALUE`].
    #[error("feature `{column}`, row {row}: value is not finite or too large")]
    NotFinite { column: String, row: usize },
    /// A feature value is missing, and the classifier cannot learn without it.
    #[error("feature `{column}`, row {row}: no value, which only trees learn from")]
    Missing { column: String, row: usize },
    /// A label points past the list of class names.
    #[error("row {row}: label {label}, but there are {classes} classes")]
    LabelOutOfRange { row: usize, label: u32, classes: usize },
    /// A sample weight is negative, NaN, infinite, or larger than [`MAX_VALUE`].
    #[error("row {row}: weight {weight} is not between 0 and {MAX_VALUE:e}")]
    WeightOutOfRange { row: usize, weight: f64 },
    /// An index is past the end of what it indexes.
    #[error("{what} {index} is past the end ({length})")]
    IndexOutOfRange { what: &'static str, index: usize, length: usize },
    /// A setting names a feature that the samples do not have.
    #[error("no feature is named `{name}`")]
    UnknownFeature { name: String },
    /// A setting is outside its range.
    #[error("setting `{setting}` is {value}, allowed: {allowed}")]
    SettingOutOfRange { setting: &'static str, value: f64, allowed: &'static str },
    /// There are fewer rows or groups than folds.
    #[error("{folds} folds asked for, but only {available} to fill them")]
    TooFewForFolds { folds: usize, available: usize },
    /// The parts of a stored model do not fit together.
    #[error("stored model is corrupt: {broken}")]
    CorruptModel { broken: &'static str },
}

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
///
/// # Errors
/// [`Error::CorruptModel`].
pub fn require_sound(holds: bool, broken: &'static str) -> Result<(), Error> {
    if holds { Ok(()) } else { Err(Error::CorruptModel { broken }) }
}
