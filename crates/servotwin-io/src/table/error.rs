//! What can be wrong with a table or with a table's file.

use std::fmt;
use std::path::PathBuf;

use super::parquet::{LIMIT_VARIABLE, Limits};
use super::{ALL, Kind};
use crate::files::FileError;
use crate::sanitize;

/// Why a table could not be read, written or used.
#[derive(Debug)]
pub enum TableError {
    /// The file itself could not be read or written.
    File(FileError),
    /// The file's extension names no known format.
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The file was read, but its content is no table that can be used.
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: ContentError,
    },
    /// No column has this name.
    UnknownColumn {
        /// The name asked for.
        column: String,
        /// The most similar name there is.
        nearest: Option<String>,
        /// The names there are.
        known: Vec<String>,
    },
    /// A column is in the file, but not in the table.
    LeftOut {
        /// The column.
        column: String,
        /// Why.
        reason: String,
    },
    /// A column holds values of another kind than is needed.
    WrongKind {
        /// The column.
        column: String,
        /// The kind needed.
        expected: Kind,
        /// The kind found.
        found: Kind,
    },
    /// Two columns would have the same name.
    DuplicateColumn {
        /// The name.
        column: String,
    },
    /// A column has another number of rows than the first one.
    UnequalLength {
        /// The column.
        column: String,
        /// Its number of rows.
        found: usize,
        /// The number of rows of the first column.
        expected: usize,
    },
    /// A table to be appended has another number of columns.
    ColumnCount {
        /// Its number of columns.
        found: usize,
        /// The number needed.
        expected: usize,
    },
    /// A table to be appended has another column in a place.
    OtherColumn {
        /// The name found.
        found: String,
        /// The name needed.
        expected: String,
    },
    /// A number is not finite where it must be.
    NotFinite {
        /// The column.
        column: String,
        /// The place, such as `log.csv: line 17`.
        place: String,
        /// The value.
        value: f64,
    },
    /// A whole number is negative or too large for an index.
    OutOfRange {
        /// The column.
        column: String,
        /// The place, such as `log.csv: line 17`.
        place: String,
        /// The value.
        value: i64,
    },
}

/// What is wrong with a table file's content. Lines and rows count from 1.
#[derive(Debug)]
pub enum ContentError {
    /// Nothing is in the file.
    Empty,
    /// A line has another number of cells than the header.
    RaggedRow {
        /// The line.
        line: usize,
        /// Its number of cells.
        found: usize,
        /// The header's.
        expected: usize,
    },
    /// A cell does not fit the kind that the first row gave to its column.
    BadCell {
        /// The line.
        line: usize,
        /// The column.
        column: String,
        /// The cell's text.
        text: String,
        /// What the column holds.
        expected: Kind,
    },
    /// A line that should be a JSON object is none.
    NoObject {
        /// The line.
        line: usize,
    },
    /// A value of an object is not what the column holds.
    BadValue {
        /// The line.
        line: usize,
        /// The column.
        column: String,
        /// The value as JSON.
        text: String,
        /// What the column holds.
        expected: Kind,
    },
    /// A quoted cell is not closed before the file ends.
    OpenQuote {
        /// The line on which it starts.
        line: usize,
    },
    /// Text follows the closing quote of a cell.
    TextAfterQuote {
        /// The line.
        line: usize,
    },
    /// The header has a column without a name.
    UnnamedColumn {
        /// Its place, from 1.
        place: usize,
    },
    /// Two columns have the same name.
    DuplicateColumn {
        /// The name.
        column: String,
    },
    /// A byte that is in no text.
    ZeroByte {
        /// The line.
        line: usize,
    },
    /// The file does not begin and end as a Parquet file does.
    NotParquet,
    /// A column's type has no place in a table.
    UnsupportedType {
        /// The column.
        column: String,
        /// The type's name in Parquet.
        found: String,
    },
    /// A column would take too much memory.
    LargeColumn {
        /// The column.
        column: String,
        /// The limit of a column, bytes.
        limit_bytes: u64,
    },
    /// A column and those before it would take too much memory.
    LargeTable {
        /// The column.
        column: String,
        /// The limit of a table, bytes.
        limit_bytes: u64,
    },
    /// A column is compressed in a way that is not known here.
    UnknownCodec {
        /// The column.
        column: String,
        /// The codec's name in Parquet.
        codec: String,
    },
    /// A column has an empty place.
    Null {
        /// The column.
        column: String,
        /// The row.
        row: usize,
    },
    /// A whole number needs more than 63 bits.
    TooLarge {
        /// The column.
        column: String,
        /// The row.
        row: usize,
        /// The value.
        value: u64,
    },
    /// The Parquet library cannot make sense of the file.
    Damaged {
        /// What it said.
        source: ::parquet::errors::ParquetError,
    },
    /// The Parquet library gave up in the middle of a damaged file.
    Unreadable,
}

impl ContentError {
    /// Whether a column is sound and only too large.
    pub(super) fn is_limit(&self) -> bool {
        matches!(self, ContentError::LargeColumn { .. } | ContentError::LargeTable { .. })
    }
}

fn gigabytes(bytes: u64) -> f64 {
    (bytes as f64 / 1e6).round() / 1e3
}

impl From<::parquet::errors::ParquetError> for ContentError {
    fn from(source: ::parquet::errors::ParquetError) -> Self {
        ContentError::Damaged { source }
    }
}

impl From<FileError> for TableError {
    fn from(error: FileError) -> Self {
        TableError::File(error)
    }
}

impl fmt::Display for TableError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TableError::File(error) => error.fmt(out),
            TableError::UnknownFormat { path } => {
                let known = ALL.map(|format| format!(".{} ({})", format.extension, format.name));
                let path = path.display();
                write!(out, "{path}: no known table format; known are {}", known.join(", "))
            }
            TableError::Content { path, problem } => write!(out, "{}: {problem}", path.display()),
            TableError::UnknownColumn { column, nearest, known } => {
                write!(out, "there is no column '{column}'")?;
                match nearest {
                    _ if known.is_empty() => write!(out, "; the table has no columns"),
                    Some(name) => write!(
                        out,
                        "; did you mean '{name}'? The table has {}",
                        sanitize::list(known)
                    ),
                    None => write!(out, "; the table has {}", sanitize::list(known)),
                }
            }
            TableError::LeftOut { reason, .. } => write!(out, "{reason}"),
            TableError::WrongKind { column, expected, found } => {
                let (expected, found) = (expected.name(), found.name());
                write!(out, "column '{column}' holds {found}, needed are {expected}")
            }
            TableError::DuplicateColumn { column } => {
                write!(out, "there is already a column '{column}'")
            }
            TableError::UnequalLength { column, found, expected } => {
                write!(out, "column '{column}' has {found} rows, the others have {expected}")
            }
            TableError::ColumnCount { found, expected } => {
                write!(out, "{found} columns cannot be appended to {expected}")
            }
            TableError::OtherColumn { found, expected } => {
                write!(out, "column '{found}' stands where '{expected}' is needed")
            }
            TableError::NotFinite { column, place, value } => {
                write!(out, "{place}, column '{column}': {value} is no finite number")
            }
            TableError::OutOfRange { column, place, value } => {
                write!(out, "{place}, column '{column}': {value} is not in 0 … {}", u32::MAX)
            }
        }
    }
}

impl fmt::Display for ContentError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ContentError::Empty => write!(out, "the file is empty"),
            ContentError::RaggedRow { line, found, expected } => {
                write!(out, "line {line} has {found} cells, the header has {expected}")
            }
            ContentError::BadCell { line, column, text, expected } => {
                write!(out, "line {line}, column '{column}': '{text}' among {}", expected.name())?;
                write!(
                    out,
                    " (text between numbers is understood only in quotes, or in a class or group)"
                )
            }
            ContentError::NoObject { line } => write!(out, "line {line} is no JSON object"),
            ContentError::BadValue { line, column, text, expected } => {
                write!(out, "line {line}, column '{column}': {text} among {}", expected.name())
            }
            ContentError::OpenQuote { line } => {
                write!(out, "line {line}: a quote is opened and never closed")
            }
            ContentError::TextAfterQuote { line } => {
                write!(out, "line {line}: a separator is needed after the closing quote")
            }
            ContentError::UnnamedColumn { place } => {
                write!(out, "line 1: column {place} has no name")
            }
            ContentError::DuplicateColumn { column } => {
                write!(out, "two columns are named '{column}'")
            }
            ContentError::ZeroByte { line } => {
                write!(out, "line {line} holds a byte zero: this is no text")
            }
            ContentError::NotParquet => {
                write!(out, "this is no Parquet file, or its end is missing")
            }
            ContentError::UnsupportedType { column, found } => {
                write!(out, "column '{column}' has the type {found}; known are ")?;
                write!(
                    out,
                    "whole and real numbers, booleans, text, dictionaries of these, moments, dates, \
                     times of day and durations"
                )
            }
            ContentError::LargeColumn { column, limit_bytes } => write!(
                out,
                "column '{column}' takes more than {} GB in memory, the limit of a column; \
                 set the environment variable {LIMIT_VARIABLE} (now {}) higher to read it",
                gigabytes(*limit_bytes),
                gigabytes(Limits::from_environment().table_bytes)
            ),
            ContentError::LargeTable { column, limit_bytes } => write!(
                out,
                "with column '{column}' the table takes more than {} GB in memory, its limit; \
                 set the environment variable {LIMIT_VARIABLE} higher to read it",
                gigabytes(*limit_bytes)
            ),
            ContentError::UnknownCodec { column, codec } => {
                write!(out, "column '{column}' is compressed with {codec}; ")?;
                write!(out, "known are Snappy, gzip, LZ4, Zstandard and none: ")?;
                write!(out, "write the file with one of these")
            }
            ContentError::Null { column, row } => {
                write!(out, "row {row}, column '{column}': no value (null)")
            }
            ContentError::TooLarge { column, row, value } => {
                write!(out, "row {row}, column '{column}': {value} does not fit in 63 bits")
            }
            ContentError::Damaged { source } => write!(out, "damaged or unreadable: {source}"),
            ContentError::Unreadable => write!(out, "damaged beyond reading"),
        }
    }
}

impl std::error::Error for TableError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            TableError::File(error) => Some(error),
            TableError::Content { problem, .. } => Some(problem),
            _ => None,
        }
    }
}

impl std::error::Error for ContentError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            ContentError::Damaged { source } => Some(source),
            _ => None,
        }
    }
}
