//! A CSV file as texts: every cell as it is written, with its line. Sheets that people fill in need that: a column may
//! hold numbers, words and empty cells, and nothing may change on the way.

use super::dialect::Dialect;
use super::encoding::{self, Encoding};
use super::records::Records;
use super::{ContentError, Stop, TableError, column_names, unguarded};
use crate::files::FileError;
use std::io::BufRead;
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
    let unreadable = |cause| TableError::File(FileError::from_io(path, cause));
    let mut is_latin = false;
    loop {
        let (reader, found) = encoding::open(path)?;
        match attempt(reader, if is_latin { Encoding::Latin1 } else { found }) {
            Ok(texts) => return Ok(texts),
            Err(Stop::Again(_)) if !is_latin => is_latin = true,
            Err(Stop::Io(cause)) => return Err(unreadable(cause)),
            Err(Stop::Content(problem)) => {
                return Err(TableError::Content { path: path.to_path_buf(), problem });
            }
            Err(Stop::Again(_)) => {
                let problem = ContentError::Unreadable;
                return Err(TableError::Content { path: path.to_path_buf(), problem });
            }
        }
    }
}

fn attempt(mut reader: impl BufRead, encoding: Encoding) -> Result<Texts, Stop> {
    let dialect = Dialect::of(reader.fill_buf()?);
    let mut records = Records::new(reader, dialect.separator);
    if !records.advance()? {
        return Err(ContentError::Empty.into());
    }
    let names = column_names(texts_of(&records, encoding)?)?;
    let columns: Vec<String> = names.iter().flatten().cloned().collect();
    let mut rows = vec![];
    while records.advance()? {
        let line = records.line();
        let mut cells = texts_of(&records, encoding)?;
        if cells.len() != names.len() {
            let (found, expected) = (cells.len(), names.len());
            return Err(ContentError::RaggedRow { line, found, expected }.into());
        }
        // Only the last column may be without a name, and only if it is empty.
        if cells.len() > columns.len() && cells.pop().is_some_and(|cell| !cell.is_empty()) {
            return Err(ContentError::UnnamedColumn { place: names.len() }.into());
        }
        rows.push(TextRow { line, cells });
    }
    Ok(Texts { columns, rows, separator: dialect.separator })
}

/// The cells of the current record. Spaces around an unquoted cell do not count.
fn texts_of<R: BufRead>(records: &Records<R>, encoding: Encoding) -> Result<Vec<String>, Stop> {
    let line = records.line();
    let text = |(bytes, is_quoted): (&[u8], bool)| match encoding::text(bytes, encoding) {
        Some(text) if text.contains('\0') => Err(ContentError::ZeroByte { line }.into()),
        Some(text) => Ok(unguarded(if is_quoted { text } else { text.trim().to_owned() })),
        None => Err(Stop::Again(super::Known::default())),
    };
    records.cells().map(text).collect()
}
