//! Memory limits for Parquet files: a few kilobytes can hold gigabytes of equal values.

use super::super::ContentError;

/// The environment variable that sets the limits.
const VARIABLE: &str = "SERVOTWIN_TABLE_GB";

/// The default limit of a table, GB.
const DEFAULT_GB: f64 = 8.0;

/// Bytes in a gigabyte.
const GB: f64 = 1e9;

/// One column may take a quarter of a table's limit.
const COLUMN_PART: u64 = 4;

/// Memory overhead of a text, bytes.
const TEXT_BYTES: u64 = 48;

/// Limits of a table's memory when it is read from a Parquet file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Limit of all columns together.
    pub table_bytes: u64,
    /// Limit of one column.
    pub column_bytes: u64,
}

impl Limits {
    /// Limits of this many bytes for a table, and a quarter of it for a column.
    pub fn of_table(table_bytes: u64) -> Self {
        Limits { table_bytes, column_bytes: table_bytes / COLUMN_PART }
    }

    /// 8 GB for a table and 2 GB for a column. The environment variable [`VARIABLE`] replaces the 8 GB; a column gets a
    /// quarter of it. Values that are no positive number are ignored.
    pub(crate) fn from_environment() -> Self {
        let given = std::env::var(VARIABLE).ok().and_then(|text| text.trim().parse::<f64>().ok());
        let gigabytes = given.filter(|gigabytes| *gigabytes > 0.0).unwrap_or(DEFAULT_GB);
        Self::of_table((gigabytes * GB) as u64)
    }
}

/// The remaining limits while the columns of a table are read one after another.
#[derive(Debug, Clone, Copy)]
pub(super) struct Budget {
    limits: Limits,
    used_bytes: u64,
    /// The bytes of the column that is being read.
    begun_bytes: u64,
}

impl Budget {
    pub(super) fn new(limits: Limits) -> Self {
        Budget { limits, used_bytes: 0, begun_bytes: 0 }
    }

    /// The budget for the rest of a column that has this many bytes so far.
    pub(super) fn begun(self, begun_bytes: u64) -> Self {
        Budget { begun_bytes, ..self }
    }

    /// Checks that a column may take this many bytes more.
    pub(super) fn allow(self, column: &str, bytes: u64) -> Result<(), ContentError> {
        let Limits { table_bytes, column_bytes } = self.limits;
        let bytes = bytes.saturating_add(self.begun_bytes);
        if bytes > column_bytes {
            return Err(ContentError::TooLarge(format!(
                "column '{column}' takes more than {} GB in memory, the limit of a column; set the environment \
                 variable {VARIABLE} (now {}) higher to read it",
                gigabytes(column_bytes),
                gigabytes(Limits::from_environment().table_bytes)
            )));
        }
        if self.used_bytes.saturating_add(bytes) > table_bytes {
            return Err(ContentError::TooLarge(format!(
                "with column '{column}' the table takes more than {} GB in memory, its limit; set the environment \
                 variable {VARIABLE} higher to read it",
                gigabytes(table_bytes)
            )));
        }
        Ok(())
    }

    /// Subtracts a column that was read.
    pub(super) fn spend(&mut self, bytes: u64) {
        self.used_bytes = self.used_bytes.saturating_add(bytes);
    }
}

fn gigabytes(bytes: u64) -> f64 {
    (bytes as f64 / 1e6).round() / 1e3
}

/// Memory of a text with this length, bytes.
pub(super) fn text_bytes(length: usize) -> u64 {
    TEXT_BYTES + length as u64
}
