//! What can be wrong with an evaluation.

use super::table_model::TableModelError;
use crate::files::FileError;
use crate::sanitize;
use crate::table::TableError;
use std::fmt;
use std::path::PathBuf;

/// Why there is no evaluation or no model.
#[derive(Debug)]
#[non_exhaustive]
pub enum EvaluationError {
    /// The table cannot be read, or a column is not as it must be.
    Table(TableError),
    /// A file cannot be read or written.
    File(FileError),
    /// Training or prediction refused the data.
    Diagnosis(servotwin_diagnosis::Error),
    /// A table that somebody brings does not serve.
    TableModel(TableModelError),
    /// It was stopped from elsewhere.
    Cancelled,
    /// The data set has no row with a fault.
    NoFaults,
    /// No fault ever leaves the band of healthy residuals.
    NothingDetectable {
        /// Number of rows with a fault.
        faults: usize,
    },
    /// There is only one class to learn.
    OneClass {
        /// The column of the labels.
        column: String,
        /// The class.
        class: String,
    },
    /// No column is left to learn from.
    NoFeatures,
    /// There are fewer groups than a protocol needs.
    TooFewGroups {
        /// The column of the groups.
        column: String,
        /// Number of groups.
        found: usize,
        /// Number needed.
        needed: usize,
    },
    /// A stored model cannot be understood.
    Model {
        /// The file.
        path: PathBuf,
        /// What the reader of JSON says.
        source: serde_json::Error,
    },
    /// A stored model's parts do not fit each other.
    CorruptModel {
        /// The file.
        path: PathBuf,
        /// What does not fit.
        source: servotwin_diagnosis::Error,
    },
    /// The table to test with is not as the other one.
    InTest(Box<EvaluationError>),
    /// A class in a table that the model does not know.
    UnknownClass(Box<UnknownClass>),
}

/// A class that a model was not trained with.
#[derive(Debug)]
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

impl fmt::Display for UnknownClass {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { column, class, place, known } = self;
        write!(
            out,
            "{place}: column '{column}' holds '{}', which the model was not trained with; it knows {}",
            sanitize::text(class),
            sanitize::list(known)
        )
    }
}

impl fmt::Display for EvaluationError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            EvaluationError::Table(error) => write!(out, "{error}"),
            EvaluationError::File(error) => write!(out, "{error}"),
            EvaluationError::Diagnosis(error) => write!(out, "{error}"),
            EvaluationError::Cancelled => write!(out, "stopped"),
            EvaluationError::TableModel(error) => write!(out, "{error}"),
            EvaluationError::NoFaults => {
                write!(out, "the data set has no faults: there is nothing to learn")
            }
            EvaluationError::NothingDetectable { faults } => write!(
                out,
                "none of the {faults} faults leaves the band of healthy residuals: \
                 there is nothing to learn"
            ),
            EvaluationError::OneClass { column, class } => write!(
                out,
                "column '{column}' holds only '{class}': at least two classes are needed"
            ),
            EvaluationError::InTest(error) => write!(out, "the table to test with: {error}"),
            EvaluationError::NoFeatures => {
                write!(out, "no column is left to learn from")
            }
            EvaluationError::TooFewGroups { column, found, needed } => {
                write!(out, "column '{column}' has {found} groups, at least {needed} are needed")
            }
            EvaluationError::Model { path, source } => {
                write!(out, "{}: no model of servotwin: {source}", path.display())
            }
            EvaluationError::CorruptModel { path, source } => {
                write!(out, "{}: {source}", path.display())
            }
            EvaluationError::UnknownClass(unknown) => write!(out, "{unknown}"),
        }
    }
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

impl std::error::Error for EvaluationError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            EvaluationError::Table(error) => Some(error),
            EvaluationError::File(error) => Some(error),
            EvaluationError::Diagnosis(error) => Some(error),
            EvaluationError::Model { source, .. } => Some(source),
            EvaluationError::CorruptModel { source, .. } => Some(source),
            _ => None,
        }
    }
}

impl From<TableError> for EvaluationError {
    fn from(error: TableError) -> Self {
        EvaluationError::Table(error)
    }
}

impl From<TableModelError> for EvaluationError {
    fn from(error: TableModelError) -> Self {
        EvaluationError::TableModel(error)
    }
}

impl From<crate::parallel::Cancelled> for EvaluationError {
    fn from(_: crate::parallel::Cancelled) -> Self {
        EvaluationError::Cancelled
    }
}

impl From<FileError> for EvaluationError {
    fn from(error: FileError) -> Self {
        EvaluationError::File(error)
    }
}

impl From<servotwin_diagnosis::Error> for EvaluationError {
    fn from(error: servotwin_diagnosis::Error) -> Self {
        EvaluationError::Diagnosis(error)
    }
}
