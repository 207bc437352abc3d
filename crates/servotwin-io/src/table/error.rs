//! Errors of tables and of their files.

use std::path::PathBuf;

use super::parquet::{LIMIT_VARIABLE, Limits};
use super::{ALL, ColumnKind};
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
    /// A column of the file is not in the table.
    #[error("{reason}")]
    LeftOut { column: String, reason: String },
    /// A column holds values of the wrong kind.
    #[error("column '{column}' holds {}, needed are {}", .found.name(), .expected.name())]
    WrongKind { column: String, expected: ColumnKind, found: ColumnKind },
    /// Two columns would have the same name.
    #[error("there is already a column '{column}'")]
    DuplicateColumn { column: String },
    /// A column has another number of rows than the first one.
    #[error("column '{column}' has {found} rows, the others have {expected}")]
    UnequalLength { column: String, found: usize, expected: usize },
    /// A table to be appended has another number of columns.
    #[error("{found} columns cannot be appended to {expected}")]
    ColumnCount { found: usize, expected: usize },
    /// A table to be appended has a different column at this position.
    #[error("column '{found}' stands where '{expected}' is needed")]
    OtherColumn { found: String, expected: String },
    /// A number that must be finite is not.
    #[error("{place}, column '{column}': {value} is no finite number")]
    NotFinite { column: String, place: String, value: f64 },
    /// A whole number is negative or too large for an index.
    #[error("{place}, column '{column}': {value} is not in 0 … {}", u32::MAX)]
    OutOfRange { column: String, place: String, value: i64 },
    /// A row holds a value that it may not have; rows count from 1.
    #[error("row {row}: {reason}")]
    BadRow { row: usize, reason: String },
}

/// Problems with a table file's content. Lines and rows count from 1.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
pub enum ContentError {
    /// The file is empty.
    #[error("the file is empty")]
    Empty,
    /// A line has more or fewer cells than the header.
    #[error("line {line} has {found} cells, the header has {expected}")]
    RaggedRow { line: usize, found: usize, expected: usize },
    /// A cell does not fit the kind of its column.
    #[error(
        "line {line}, column '{column}': '{text}' among {} (text between numbers is understood only in quotes, or in \
         a class or group)",
        .expected.name()
    )]
    BadCell { line: usize, column: String, text: String, expected: ColumnKind },
    /// A line is no JSON object.
    #[error("line {line} is no JSON object")]
    NoObject { line: usize },
    /// A value of an object does not fit the kind of its column.
    #[error("line {line}, column '{column}': {text} among {}", .expected.name())]
    BadValue { line: usize, column: String, text: String, expected: ColumnKind },
    /// A quoted cell is not closed before the file ends.
    #[error("line {line}: a quote is opened and never closed")]
    OpenQuote { line: usize },
    /// Text follows the closing quote of a cell.
    #[error("line {line}: a separator is needed after the closing quote")]
    TextAfterQuote { line: usize },
    /// The header has a column without a name.
    #[error("line 1: column {place} has no name")]
    UnnamedColumn { place: usize },
    /// Two columns have the same name.
    #[error("two columns are named '{column}'")]
    DuplicateColumn { column: String },
    /// The text contains a zero byte.
    #[error("line {line} holds a byte zero: this is no text")]
    ZeroByte { line: usize },
    /// The file does not start and end like a Parquet file.
    #[error("this is no Parquet file, or its end is missing")]
    NotParquet,
    /// A table cannot hold the column's type.
    #[error(
        "column '{column}' has the type {found}; known are whole and real numbers, booleans, text, dictionaries of \
         these, moments, dates, times of day and durations"
    )]
    UnsupportedType { column: String, found: String },
    /// A column would take too much memory.
    #[error(
        "column '{column}' takes more than {} GB in memory, the limit of a column; set the environment variable \
         {LIMIT_VARIABLE} (now {}) higher to read it",
        gigabytes(*.limit_bytes), gigabytes(Limits::from_environment().table_bytes)
    )]
    LargeColumn { column: String, limit_bytes: u64 },
    /// A column and the previous ones would take too much memory.
    #[error(
        "with column '{column}' the table takes more than {} GB in memory, its limit; set the environment variable \
         {LIMIT_VARIABLE} higher to read it",
        gigabytes(*.limit_bytes)
    )]
    LargeTable { column: String, limit_bytes: u64 },
    /// The compression of a column is not supported.
    #[error(
        "column '{column}' is compressed with {codec}; known are Snappy, gzip, LZ4, Zstandard and none: write the \
         file with one of these"
    )]
    UnknownCodec { column: String, codec: String },
    /// A value of a column is missing.
    #[error("row {row}, column '{column}': no value (null)")]
    Null { column: String, row: usize },
    /// A whole number needs more than 63 bits.
    #[error("row {row}, column '{column}': {value} does not fit in 63 bits")]
    TooLarge { column: String, row: usize, value: u64 },
    /// The Parquet library cannot decode the file.
    #[error("damaged or unreadable: {source}")]
    Damaged {
        #[from]
        source: ::parquet::errors::ParquetError,
    },
    /// The Parquet library panicked on a damaged file, or a size in it is invalid.
    #[error("damaged beyond reading")]
    Unreadable,
}

impl ContentError {
    /// Whether the column is valid but too large.
    pub(super) fn is_limit(&self) -> bool {
        matches!(self, ContentError::LargeColumn { .. } | ContentError::LargeTable { .. })
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

fn gigabytes(bytes: u64) -> f64 {
    (bytes as f64 / 1e6).round() / 1e3
}
