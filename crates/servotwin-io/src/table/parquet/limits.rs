//! How much a Parquet file may take in memory: a few kilobytes can hold gigabytes of equal values.

use super::super::ContentError;

/// The environment variable that raises the limits.
pub const VARIABLE: &str = "SERVOTWIN_TABLE_GB";

/// The limit of a table without that variable, GB.
const DEFAULT_GB: f64 = 8.0;

/// Bytes in a gigabyte.
const GB: f64 = 1e9;

/// One column may take this part of a table.
const COLUMN_PART: u64 = 4;

/// The memory of a text beside its bytes.
const TEXT_BYTES: u64 = 48;

/// How many bytes a table may take in memory when it is read from a Parquet file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// All columns together.
    pub table_bytes: u64,
    /// One column.
    pub column_bytes: u64,
}

impl Limits {
    /// Limits of so many bytes for a table, and a quarter of them for a column.
    pub fn of_table(table_bytes: u64) -> Self {
        Limits { table_bytes, column_bytes: table_bytes / COLUMN_PART }
    }

    /// 8 GB for a table and 2 GB for a column, or what the environment variable [`VARIABLE`] says: gigabytes for a
    /// table, a quarter of them for a column. A value that is no number above zero counts as none.
    pub fn from_environment() -> Self {
        let given = std::env::var(VARIABLE).ok().and_then(|text| text.trim().parse::<f64>().ok());
        let gigabytes = given.filter(|gigabytes| *gigabytes > 0.0).unwrap_or(DEFAULT_GB);
        Self::of_table((gigabytes * GB) as u64)
    }
}

/// The remaining limits while the columns of a table are read one after the other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Budget {
    limits: Limits,
    used_bytes: u64,
}

impl Budget {
    pub(super) fn new(limits: Limits) -> Self {
        Budget { limits, used_bytes: 0 }
    }

    /// Checks that a column may take so many bytes.
    pub(super) fn allow(self, column: &str, bytes: u64) -> Result<(), ContentError> {
        let Limits { table_bytes, column_bytes } = self.limits;
        let column = || column.to_owned();
        if bytes > column_bytes {
            return Err(ContentError::LargeColumn { column: column(), limit_bytes: column_bytes });
        }
        if self.used_bytes.saturating_add(bytes) > table_bytes {
            return Err(ContentError::LargeTable { column: column(), limit_bytes: table_bytes });
        }
        Ok(())
    }

    /// Notes a column that was read.
    pub(super) fn spend(&mut self, bytes: u64) {
        self.used_bytes = self.used_bytes.saturating_add(bytes);
    }
}

/// The memory of a text with so many bytes.
pub(super) fn text_bytes(length: usize) -> u64 {
    TEXT_BYTES + length as u64
}
