//! Errors of an evaluation.

use super::table_model::TableModelError;
use crate::files::FileError;
use crate::sanitize;
use crate::table::TableError;
use std::path::PathBuf;

/// Why an evaluation or a model is not available.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
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
    /// A user's table cannot be used.
    #[error(transparent)]
    TableModel(#[from] TableModelError),
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
    NothingDetectable {
        /// Number of rows with a fault.
        faults: usize,
    },
    /// There is only one class to learn.
    #[error("column '{column}' holds only '{class}': at least two classes are needed")]
    OneClass {
        /// The column of the labels.
        column: String,
        /// The only class.
        class: String,
    },
    /// No column is left to learn from.
    #[error("no column is left to learn from")]
    NoFeatures,
    /// There are fewer groups than a protocol needs.
    #[error("column '{column}' has {found} groups, at least {needed} are needed")]
    TooFewGroups {
        /// The column of the groups.
        column: String,
        /// Number of groups found.
        found: usize,
        /// Number of groups needed.
        needed: usize,
    },
    /// A stored model cannot be parsed.
    #[error("{path}: no model of servotwin: {source}")]
    Model {
        /// The path of the model file.
        path: PathBuf,
        /// The JSON parser's message.
        source: serde_json::Error,
    },
    /// The parts of a stored model are inconsistent.
    #[error("{path}: {source}")]
    CorruptModel {
        /// The path of the model file.
        path: PathBuf,
        /// The inconsistency.
        source: servotwin_diagnosis::Error,
    },
    /// The test table is invalid.
    #[error("the table to test with: {0}")]
    InTest(Box<EvaluationError>),
    /// A table contains a class that the model does not know.
    #[error(transparent)]
    UnknownClass(Box<UnknownClass>),
}

/// A class that the model was not trained with.
#[derive(Debug, thiserror::Error)]
#[error(
    "{place}: column '{column}' holds '{}', which the model was not trained with; it knows {}",
    sanitize::text(class),
    sanitize::list(known)
)]
pub struct UnknownClass {
    /// The column with the labels.
    pub column: String,
    /// The unknown class.
    pub class: String,
    /// Its line or row.
    pub place: String,
    /// The classes that the model knows.
    pub known: Vec<String>,
}

impl EvaluationError {
    /// Marks errors of tables after the first one as errors of the test table.
    pub(crate) fn of_table(place: usize) -> impl Fn(EvaluationError) -> EvaluationError {
        move |error| match place {
            0 => error,
            _ => EvaluationError::InTest(error.into()),
        }
    }
}

impl From<crate::parallel::Cancelled> for EvaluationError {
    fn from(_: crate::parallel::Cancelled) -> Self {
        EvaluationError::Cancelled
    }
}
