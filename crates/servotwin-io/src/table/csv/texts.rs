//! A CSV file as texts: every cell as it is written, with its line. Sheets that people fill in need that: a column may
//! hold numbers, words and empty cells, and nothing may change on the way.

use super::{Rows, Stop, TableError, texts_of, unnamed};
use std::path::Path;

/// The cells of a CSV file.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Texts {
    /// The names of the columns.
    pub columns: Vec<String>,
    /// The rows in the order of the file.
    pub rows: Vec<TextRow>,
    /// The byte between two cells.
    pub separator: u8,
}

/// A row of texts.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TextRow {
    /// The line on which the row begins, from 1.
    pub line: usize,
    /// One text for each column.
    pub cells: Vec<String>,
}

impl Texts {
    /// The index of a column.
    pub fn column(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|known| known == name)
    }
}

/// Reads a CSV file in any dialect that `super::read` understands.
///
/// # Errors
/// The file cannot be read, or its content is no CSV table.
pub fn read(path: &Path) -> Result<Texts, TableError> {
    all(path).map_err(|stop| stop.in_file(path))
}

fn all(path: &Path) -> Result<Texts, Stop> {
    let mut file = Rows::open(path)?;
    let columns: Vec<String> = file.names.iter().flatten().cloned().collect();
    let mut rows = vec![];
    while file.advance()? {
        let mut cells = texts_of(&file.records)?;
        // Only the last column may be without a name, and only if it is empty.
        if cells.len() > columns.len() && cells.pop().is_some_and(|cell| !cell.is_empty()) {
            return Err(unnamed(columns.len()).into());
        }
        rows.push(TextRow { line: file.records.line(), cells });
    }
    Ok(Texts { columns, rows, separator: file.separator })
}
