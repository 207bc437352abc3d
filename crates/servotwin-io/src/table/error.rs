//! Errors of tables and of their files.

use std::path::PathBuf;

use super::parquet::{LIMIT_VARIABLE, Limits};
use super::{ALL, ColumnKind};
use crate::files::FileError;
use crate::sanitize;

/// Errors of reading, writing or using a table.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The file itself could not be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file's extension names no known format.
    #[error("{path}: no known table format; known are {}", known_formats())]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The file's content is no usable table.
    #[error("{path}: {problem}")]
    Content {
        /// The file.
        path: PathBuf,
        /// The problem with its content.
        #[source]
        problem: ContentError,
    },
    /// No column has this name.
    #[error("there is no column '{column}'; {}", advice(.nearest.as_deref(), .known))]
    UnknownColumn {
        /// The requested name.
        column: String,
        /// The most similar known name.
        nearest: Option<String>,
        /// All column names.
        known: Vec<String>,
    },
    /// A column of the file is not in the table.
    #[error("{reason}")]
    LeftOut {
        /// The column.
        column: String,
        /// Why it was left out.
        reason: String,
    },
    /// A column holds values of the wrong kind.
    #[error("column '{column}' holds {}, needed are {}", .found.name(), .expected.name())]
    WrongKind {
        /// The column.
        column: String,
        /// The kind needed.
        expected: ColumnKind,
        /// The kind found.
        found: ColumnKind,
    },
    /// Two columns would have the same name.
    #[error("there is already a column '{column}'")]
    DuplicateColumn {
        /// The repeated name.
        column: String,
    },
    /// A column has another number of rows than the first one.
    #[error("column '{column}' has {found} rows, the others have {expected}")]
    UnequalLength {
        /// The column.
        column: String,
        /// Its number of rows.
        found: usize,
        /// The number of rows of the first column.
        expected: usize,
    },
    /// A table to be appended has another number of columns.
    #[error("{found} columns cannot be appended to {expected}")]
    ColumnCount {
        /// Its number of columns.
        found: usize,
        /// The number of columns needed.
        expected: usize,
    },
    /// A table to be appended has a different column at this position.
    #[error("column '{found}' stands where '{expected}' is needed")]
    OtherColumn {
        /// The name found.
        found: String,
        /// The name needed.
        expected: String,
    },
    /// A number that must be finite is not.
    #[error("{place}, column '{column}': {value} is no finite number")]
    NotFinite {
        /// The column.
        column: String,
        /// The place, such as `log.csv: line 17`.
        place: String,
        /// The value.
        value: f64,
    },
    /// A whole number is negative or too large for an index.
    #[error("{place}, column '{column}': {value} is not in 0 … {}", u32::MAX)]
    OutOfRange {
        /// The column.
        column: String,
        /// The place, such as `log.csv: line 17`.
        place: String,
        /// The value.
        value: i64,
    },
}

/// Problems with a table file's content. Lines and rows count from 1.
#[derive(Debug, thiserror::Error)]
pub enum ContentError {
    /// The file is empty.
    #[error("the file is empty")]
    Empty,
    /// A line has more or fewer cells than the header.
    #[error("line {line} has {found} cells, the header has {expected}")]
    RaggedRow {
        /// The line.
        line: usize,
        /// Its number of cells.
        found: usize,
        /// Number of cells of the header.
        expected: usize,
    },
    /// A cell does not fit the kind of its column.
    #[error(
        "line {line}, column '{column}': '{text}' among {} (text between numbers is understood only in quotes, or in \
         a class or group)",
        .expected.name()
    )]
    BadCell {
        /// The line.
        line: usize,
        /// The column.
        column: String,
        /// The cell's text.
        text: String,
        /// Kind of the column.
        expected: ColumnKind,
    },
    /// A line is no JSON object.
    #[error("line {line} is no JSON object")]
    NoObject {
        /// The line.
        line: usize,
    },
    /// A value of an object does not fit the kind of its column.
    #[error("line {line}, column '{column}': {text} among {}", .expected.name())]
    BadValue {
        /// The line.
        line: usize,
        /// The column.
        column: String,
        /// The value as JSON.
        text: String,
        /// Kind of the column.
        expected: ColumnKind,
    },
    /// A quoted cell is not closed before the file ends.
    #[error("line {line}: a quote is opened and never closed")]
    OpenQuote {
        /// The line on which it starts.
        line: usize,
    },
    /// Text follows the closing quote of a cell.
    #[error("line {line}: a separator is needed after the closing quote")]
    TextAfterQuote {
        /// The line.
        line: usize,
    },
    /// The header has a column without a name.
    #[error("line 1: column {place} has no name")]
    UnnamedColumn {
        /// Position of the column, from 1.
        place: usize,
    },
    /// Two columns have the same name.
    #[error("two columns are named '{column}'")]
    DuplicateColumn {
        /// The name.
        column: String,
    },
    /// The text contains a zero byte.
    #[error("line {line} holds a byte zero: this is no text")]
    ZeroByte {
        /// The line.
        line: usize,
    },
    /// The file does not start and end like a Parquet file.
    #[error("this is no Parquet file, or its end is missing")]
    NotParquet,
    /// A table cannot hold the column's type.
    #[error(
        "column '{column}' has the type {found}; known are whole and real numbers, booleans, text, dictionaries of \
         these, moments, dates, times of day and durations"
    )]
    UnsupportedType {
        /// The column.
        column: String,
        /// The type's name in Parquet.
        found: String,
    },
    /// A column would take too much memory.
    #[error(
        "column '{column}' takes more than {} GB in memory, the limit of a column; set the environment variable \
         {LIMIT_VARIABLE} (now {}) higher to read it",
        gigabytes(*.limit_bytes), gigabytes(Limits::from_environment().table_bytes)
    )]
    LargeColumn {
        /// The column.
        column: String,
        /// The limit of a column, bytes.
        limit_bytes: u64,
    },
    /// A column and the previous ones would take too much memory.
    #[error(
        "with column '{column}' the table takes more than {} GB in memory, its limit; set the environment variable \
         {LIMIT_VARIABLE} higher to read it",
        gigabytes(*.limit_bytes)
    )]
    LargeTable {
        /// The column.
        column: String,
        /// The limit of a table, bytes.
        limit_bytes: u64,
    },
    /// The compression of a column is not supported.
    #[error(
        "column '{column}' is compressed with {codec}; known are Snappy, gzip, LZ4, Zstandard and none: write the \
         file with one of these"
    )]
    UnknownCodec {
        /// The column.
        column: String,
        /// The codec's name in Parquet.
        codec: String,
    },
    /// A value of a column is missing.
    #[error("row {row}, column '{column}': no value (null)")]
    Null {
        /// The column.
        column: String,
        /// The row.
        row: usize,
    },
    /// A whole number needs more than 63 bits.
    #[error("row {row}, column '{column}': {value} does not fit in 63 bits")]
    TooLarge {
        /// The column.
        column: String,
        /// The row.
        row: usize,
        /// The value.
        value: u64,
    },
    /// The Parquet library cannot decode the file.
    #[error("damaged or unreadable: {source}")]
    Damaged {
        /// The library's error.
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
