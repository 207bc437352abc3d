//! Errors of evaluations.

use super::table_model::TableModelError;
use crate::files::FileError;
use crate::sanitize;
use crate::table::TableError;
use std::path::PathBuf;

/// Why an evaluation or a training fails.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvaluationError {
    /// The table cannot be read, or a column is missing or has the wrong type.
    #[error(transparent)]
    Table(#[from] TableError),
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// Training or prediction refused the data.
    #[error(transparent)]
    Diagnosis(#[from] servotwin_diagnosis::Error),
    /// A user's table cannot be used for training or prediction.
    #[error(transparent)]
    TableModel(#[from] TableModelError),
    /// The caller cancelled the work.
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
        /// The only class found.
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
    /// A stored model is not valid JSON of a model.
    #[error("{path}: no model of servotwin: {source}")]
    Model {
        /// The file.
        path: PathBuf,
        /// Error of the JSON reader.
        source: serde_json::Error,
    },
    /// The parts of a stored model are inconsistent.
    #[error("{path}: {source}")]
    CorruptModel {
        /// The file.
        path: PathBuf,
        /// The inconsistency found.
        source: servotwin_diagnosis::Error,
    },
    /// An error in the test table.
    #[error("the table to test with: {0}")]
    InTest(Box<EvaluationError>),
    /// The table holds a class that the model does not know.
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
    /// Name of the class column.
    pub column: String,
    /// The class found.
    pub class: String,
    /// Line or row of the table.
    pub place: String,
    /// The classes that the model knows.
    pub known: Vec<String>,
}

impl EvaluationError {
    /// Wraps errors of the second and later tables in [`Self::InTest`]; the first table is the training table.
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
