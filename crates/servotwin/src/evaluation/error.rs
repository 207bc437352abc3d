//! What can be wrong with an evaluation.

use super::table_model::TableModelError;
use crate::files::FileError;
use crate::sanitize;
use crate::table::TableError;
use std::path::PathBuf;

/// Why there is no evaluation or no model.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvaluationError {
    /// The table cannot be read, or a column is not as it must be.
    #[error(transparent)]
    Table(#[from] TableError),
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// Training or prediction refused the data.
    #[error(transparent)]
    Diagnosis(#[from] servotwin_diagnosis::Error),
    /// A table that somebody brings does not serve.
    #[error(transparent)]
    TableModel(#[from] TableModelError),
    /// It was stopped from elsewhere.
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
        /// The class.
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
        /// Number of groups.
        found: usize,
        /// Number needed.
        needed: usize,
    },
    /// A stored model cannot be understood.
    #[error("{path}: no model of servotwin: {source}")]
    Model {
        /// The file.
        path: PathBuf,
        /// What the reader of JSON says.
        source: serde_json::Error,
    },
    /// A stored model's parts do not fit each other.
    #[error("{path}: {source}")]
    CorruptModel {
        /// The file.
        path: PathBuf,
        /// What does not fit.
        source: servotwin_diagnosis::Error,
    },
    /// The table to test with is not as the other one.
    #[error("the table to test with: {0}")]
    InTest(Box<EvaluationError>),
    /// A class in a table that the model does not know.
    #[error(transparent)]
    UnknownClass(Box<UnknownClass>),
}

/// A class that a model was not trained with.
#[derive(Debug, thiserror::Error)]
#[error(
    "{place}: column '{column}' holds '{}', which the model was not trained with; it knows {}",
    sanitize::text(class),
    sanitize::list(known)
)]
pub struct UnknownClass {
    /// The column.
    pub column: String,
    /// The class found.
    pub class: String,
    /// Where: its line or row.
    pub place: String,
    /// Those the model knows.
    pub known: Vec<String>,
}

impl EvaluationError {
    /// The same of the table that stands at a place: behind the first they are to test with.
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
