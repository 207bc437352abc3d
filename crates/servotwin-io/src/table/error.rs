//! Errors of tables and of their files.

use std::path::PathBuf;

use super::ALL;
use crate::files::FileError;
use crate::sanitize;

/// Errors of reading, writing or using a table.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
pub enum TableError {
    /// The file itself could not be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file's extension names no known format.
    #[error("{path}: no known table format; known are {}", known_formats())]
    UnknownFormat { path: PathBuf },
    /// The file's content is no usable table.
    #[error("{path}: {problem}")]
    Content {
        path: PathBuf,
        #[source]
        problem: ContentError,
    },
    /// No column has this name.
    #[error("there is no column '{column}'; {}", advice(.nearest.as_deref(), .known))]
    UnknownColumn { column: String, nearest: Option<String>, known: Vec<String> },
    /// The columns or values of a table do not suit their use.
    #[error("{0}")]
    Unsuitable(String),
}

/// Problems with a table file's content.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
pub enum ContentError {
    /// A line of a text, from 1, and what is wrong with it.
    #[error("line {line}{problem}")]
    Line { line: usize, problem: String },
    /// The file, or a column or row of it, cannot be in a table.
    #[error("{0}")]
    Unusable(String),
    /// A column is valid but would take too much memory.
    #[error("{0}")]
    TooLarge(String),
    /// The Parquet library cannot decode the file.
    #[error("damaged or unreadable: {0}")]
    Damaged(#[from] ::parquet::errors::ParquetError),
}

impl ContentError {
    /// What is wrong with a line, such as `: a quote is opened and never closed`.
    pub(super) fn line(line: usize, problem: impl Into<String>) -> Self {
        ContentError::Line { line, problem: problem.into() }
    }

    pub(super) fn empty() -> Self {
        ContentError::Unusable("the file is empty".into())
    }

    /// The Parquet library panicked on a damaged file, or a size in it is invalid.
    pub(super) fn unreadable() -> Self {
        ContentError::Unusable("damaged beyond reading".into())
    }

    pub(super) fn duplicate(column: &str) -> Self {
        ContentError::Unusable(format!("two columns are named '{column}'"))
    }
}

fn known_formats() -> String {
    ALL.map(|format| format!(".{} ({})", format.extension, format.name)).join(", ")
}

/// Lists the columns of a table, the most similar one first.
fn advice(nearest: Option<&str>, known: &[String]) -> String {
    match nearest {
        _ if known.is_empty() => "the table has no columns".to_owned(),
        Some(name) => format!("did you mean '{name}'? The table has {}", sanitize::list(known)),
        None => format!("the table has {}", sanitize::list(known)),
    }
}
