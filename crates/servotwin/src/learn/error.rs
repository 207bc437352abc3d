//! Errors of an evaluation.

use crate::files::FileError;
use crate::table::TableError;
use std::path::PathBuf;

/// Why an evaluation or a model is not available.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
pub enum EvaluationError {
    /// The table cannot be read, or a column is invalid.
    #[error(transparent)]
    Table(#[from] TableError),
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// Training or prediction refused the data.
    #[error(transparent)]
    Diagnosis(#[from] servotwin_diagnosis::Error),
    /// The run was stopped.
    #[error("stopped")]
    Cancelled,
    /// The data set has no row with a fault.
    #[error("the data set has no faults: there is nothing to learn")]
    NoFaults,
    /// No fault ever leaves the band of healthy residuals.
    #[error(
        "none of the {faults} faults leaves the band of healthy residuals: there is nothing to learn"
    )]
    NothingDetectable { faults: usize },
    /// No column is left to learn from.
    #[error("no column is left to learn from")]
    NoFeatures,
    /// A stored model cannot be parsed.
    #[error("{path}: no model of servotwin: {source}")]
    Model { path: PathBuf, source: serde_json::Error },
    /// The parts of a stored model are inconsistent.
    #[error("{path}: {source}")]
    CorruptModel { path: PathBuf, source: servotwin_diagnosis::Error },
}

impl From<crate::parallel::Cancelled> for EvaluationError {
    fn from(_: crate::parallel::Cancelled) -> Self {
        EvaluationError::Cancelled
    }
}
