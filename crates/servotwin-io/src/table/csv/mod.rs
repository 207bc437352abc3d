//! Tables as comma-separated text: one header line, then one line per row.
//!
//! The kind of a column is inferred. It is text if any of its cells is quoted, otherwise the kind of its first nonempty
//! cell. Whole numbers become floats if a later row needs it. The writer therefore quotes every text. It writes a float
//! with a point or an exponent, in the shortest form that reads back to the same bits. CSV loses metadata, units, the
//! difference between `u32` and `i64`, and the kinds of a table without rows. A text that a spreadsheet would compute
//! stands behind an apostrophe, which the reader takes away.
//!
//! The reader also accepts other dialects, and reports them in [`Origin::dialect`](super::Origin). These are semicolons
//! or tabs between cells, with commas in numbers ([`dialect`]), UTF-16 and Latin-1 ([`encoding`]). Empty cells and
//! words for missing numbers become NaN ([`growing`]).
//!
//! The file is read once, each cell directly into its column. Reading restarts only if a later row contradicts the
//! inference: a quoted text in a column of numbers, or a byte that is not UTF-8.

pub mod dialect;
pub mod encoding;
pub mod growing;
pub mod records;
pub mod texts;

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::io::{self, BufRead, Write};
use std::path::Path;

use super::{Column, ColumnKind, ContentError, Format, Origin, Table, TableError, Values};
use crate::files::{FileError, write_atomically};
use dialect::separator_of;
use growing::{Growing, Numbers};
use records::{Cell, Records};

/// The format's entry in [`ALL`](super::ALL).
pub(crate) const FORMAT: Format = Format { name: "CSV", extension: "csv", read, write };

/// Reads a CSV file.
pub(crate) fn read(path: &Path) -> Result<Table, TableError> {
    // Columns that are text although their first cells look different; every attempt except the last finds one.
    let mut texts = BTreeSet::new();
    loop {
        match attempt(path, &texts) {
            Err(Stop::Text(place)) => _ = texts.insert(place),
            read => return read.map_err(|stop| stop.in_file(path)),
        }
    }
}

/// Writes a CSV file atomically.
pub(crate) fn write(path: &Path, table: &Table) -> Result<(), TableError> {
    Ok(write_atomically(path, |out| write_to(out, table))?)
}

/// Writes a CSV file atomically for a spreadsheet, with a separator of one byte between two cells. It begins with a byte
/// order mark, without which spreadsheets take UTF-8 for Windows-1252.
pub fn write_sheet(path: &Path, table: &Table, separator: u8) -> Result<(), TableError> {
    Ok(write_atomically(path, |out| {
        out.write_all("\u{feff}".as_bytes())?;
        write_cells(out, table, separator)
    })?)
}

/// Writes a table as CSV text.
pub fn write_to(out: &mut dyn Write, table: &Table) -> io::Result<()> {
    write_cells(out, table, b',')
}

fn write_cells(out: &mut dyn Write, table: &Table, separator: u8) -> io::Result<()> {
    let separator = [separator];
    for (place, name) in table.names().enumerate() {
        out.write_all(if place == 0 { b"" } else { &separator })?;
        let marks = [',', ';', '\t', '"', '\n', '\r'];
        let plain = !name.contains(marks) && name.trim() == name && !is_formula(name);
        if plain { write!(out, "{name}")? } else { write_quoted(out, name)? }
    }
    out.write_all(b"\n")?;
    for row in 0..table.row_count() {
        for (place, column) in table.columns().iter().enumerate() {
            out.write_all(if place == 0 { b"" } else { &separator })?;
            write_cell(out, &column.values, row)?;
        }
        out.write_all(b"\n")?;
    }
    Ok(())
}

fn write_cell(out: &mut dyn Write, values: &Values, row: usize) -> io::Result<()> {
    match values {
        // `Debug` always writes a point or an exponent: the column stays a float.
        Values::Float(values) => write!(out, "{:?}", values[row]),
        Values::Integer(values) => write!(out, "{}", values[row]),
        Values::Unsigned(values) => write!(out, "{}", values[row]),
        Values::Flag(values) => write!(out, "{}", values[row]),
        Values::Text(values) => write_quoted(out, &values[row]),
    }
}

fn write_quoted(out: &mut dyn Write, text: &str) -> io::Result<()> {
    let guard = if is_formula(text) { "'" } else { "" };
    write!(out, "\"{guard}{}\"", text.replace('"', "\"\""))
}

/// Whether a spreadsheet would compute a text, or the writer has put apostrophes before such a text.
fn is_formula(text: &str) -> bool {
    let text = text.trim_start_matches('\'');
    text.starts_with(['=', '+', '-', '@', '\t', '\r']) && text.parse::<f64>().is_err()
}

/// A text without the apostrophe that [`write_quoted`] puts before a formula.
fn unguarded(text: Cow<'_, str>) -> Cow<'_, str> {
    match text.strip_prefix('\'') {
        Some(rest) if is_formula(rest) => rest.to_owned().into(),
        _ => text,
    }
}

/// Why an attempt to read ended early.
enum Stop {
    /// The content is invalid.
    Content(ContentError),
    /// The file cannot be opened.
    File(FileError),
    /// The file cannot be read.
    Io(io::Error),
    /// The column at this place is text; a new attempt with this knowledge can succeed.
    Text(usize),
}

impl Stop {
    fn in_file(self, path: &Path) -> TableError {
        let content = |problem| TableError::Content { path: path.to_path_buf(), problem };
        match self {
            Stop::Content(problem) => content(problem),
            Stop::File(error) => error.into(),
            Stop::Io(cause) => FileError::from_io(path, cause).into(),
            Stop::Text(_) => content(ContentError::unreadable()),
        }
    }
}

impl From<ContentError> for Stop {
    fn from(problem: ContentError) -> Self {
        Stop::Content(problem)
    }
}

impl From<io::Error> for Stop {
    fn from(cause: io::Error) -> Self {
        Stop::Io(cause)
    }
}

/// The rows of a CSV file below its header.
struct Rows {
    records: Records<Box<dyn BufRead + Send>>,
    names: Vec<Option<String>>,
    separator: u8,
    is_utf16: bool,
    /// Whether a byte of the header is not UTF-8.
    is_latin: bool,
}

impl Rows {
    fn open(path: &Path) -> Result<Self, Stop> {
        let (mut reader, is_utf16) = encoding::open(path).map_err(Stop::File)?;
        let separator = separator_of(reader.fill_buf()?);
        let mut records = Records::new(reader, separator);
        if !records.advance()? {
            return Err(ContentError::empty().into());
        }
        let names = column_names(texts_of(&records)?)?;
        let is_latin = records.cells().any(|cell| !is_utf8(cell));
        Ok(Rows { records, names, separator, is_utf16, is_latin })
    }

    /// Reads the next row, which has as many cells as the header; `false` at the end.
    fn advance(&mut self) -> Result<bool, Stop> {
        let is_row = self.records.advance()?;
        let (line, found, expected) =
            (self.records.line(), self.records.cells().len(), self.names.len());
        if is_row && found != expected {
            let problem = format!(" has {found} cells, the header has {expected}");
            return Err(ContentError::line(line, problem).into());
        }
        Ok(is_row)
    }

    /// A description of the text if it differs from this toolkit's.
    fn dialect(&self, is_latin: bool, has_comma: bool) -> Option<String> {
        let parts = [
            (self.separator == b';', "semicolons between cells"),
            (self.separator == b'\t', "tabs between cells"),
            (has_comma, "decimal commas"),
            (self.is_utf16, "UTF-16"),
            (is_latin && !self.is_utf16, "Latin-1"),
        ];
        let found: Vec<&str> = parts.iter().filter(|part| part.0).map(|part| part.1).collect();
        (!found.is_empty()).then(|| found.join(", "))
    }
}

/// The text of a cell on a line, without the apostrophe of [`write_quoted`].
fn text_of(cell: Cell<'_>, line: usize) -> Result<Cow<'_, str>, ContentError> {
    match cell.text() {
        text if text.contains('\0') => {
            Err(ContentError::line(line, " holds a byte zero: this is no text"))
        }
        text => Ok(unguarded(text)),
    }
}

fn is_utf8(cell: Cell) -> bool {
    std::str::from_utf8(cell.bytes).is_ok()
}

/// The cells of the current record. Spaces around an unquoted cell do not count.
fn texts_of<R: BufRead>(records: &Records<R>) -> Result<Vec<String>, ContentError> {
    let text = |cell: Cell| {
        let text = text_of(cell, records.line())?;
        Ok(if cell.is_quoted { text.into_owned() } else { text.trim().to_owned() })
    };
    records.cells().map(text).collect()
}

fn attempt(path: &Path, texts: &BTreeSet<usize>) -> Result<Table, Stop> {
    let mut file = Rows::open(path)?;
    let mut numbers = Numbers::new(file.separator == b',');
    let column = |place| Growing::new(texts.contains(&place));
    let mut columns: Vec<Growing> = (0..file.names.len()).map(column).collect();
    let (mut origin, mut rows, mut is_latin) = (Origin::default(), 0, file.is_latin);
    while file.advance()? {
        let line = file.records.line();
        for (place, cell) in file.records.cells().enumerate() {
            let text = text_of(cell, line)?;
            is_latin |= matches!(text, Cow::Owned(_)) && !is_utf8(cell);
            let pushed = columns[place].push(&text, cell.is_quoted, &mut numbers);
            let Err(expected) = pushed else { continue };
            // True, false and a missing value together are text.
            let no_flag = expected == ColumnKind::Flag && growing::is_missing(cell.bytes);
            if cell.is_quoted || no_flag {
                return Err(Stop::Text(place));
            }
            let column = file.names[place].as_deref().unwrap_or_default();
            let problem = format!(
                ", column '{column}': '{text}' among {} (text between numbers is understood only in quotes, or in a \
                 class or group)",
                expected.name()
            );
            return Err(ContentError::line(line, problem).into());
        }
        origin.push_line(rows, line);
        rows += 1;
    }
    origin.dialect = file.dialect(is_latin, numbers.has_comma());
    table_of(file.names, columns, origin)
}

fn table_of(
    names: Vec<Option<String>>,
    columns: Vec<Growing>,
    origin: Origin,
) -> Result<Table, Stop> {
    let mut table = Table { origin, ..Table::new() };
    for (place, (name, column)) in names.into_iter().zip(columns).enumerate() {
        let values = column.finish();
        let Some(name) = name else {
            // Cells without a name: only a separator at the end of every line.
            if is_empty(&values) {
                continue;
            }
            return Err(unnamed(place).into());
        };
        // Names are unique and lengths are equal, so this cannot fail.
        let _ = table.push(Column::new(name, "", values));
    }
    Ok(table)
}

fn is_empty(values: &Values) -> bool {
    match values {
        Values::Float(values) => values.iter().all(|value| value.is_nan()),
        Values::Text(values) => values.iter().all(String::is_empty),
        _ => false,
    }
}

/// The error for a column without a name.
fn unnamed(place: usize) -> ContentError {
    ContentError::line(1, format!(": column {} has no name", place + 1))
}

/// The names of the columns. The first one may be unnamed, like the index of a data frame. So may the last one if it is
/// empty; it is `None` until that is known.
fn column_names(heads: Vec<String>) -> Result<Vec<Option<String>>, ContentError> {
    let count = heads.len();
    if count == 1 && heads[0].trim().is_empty() {
        return Err(ContentError::empty());
    }
    let mut seen = BTreeSet::new();
    let mut names = Vec::with_capacity(count);
    for (place, head) in heads.into_iter().enumerate() {
        let name = match head.trim().is_empty() {
            true if place == 0 => "column 1".to_owned(),
            true if place + 1 == count => {
                names.push(None);
                continue;
            }
            true => return Err(unnamed(place)),
            false => head,
        };
        if !seen.insert(name.clone()) {
            return Err(ContentError::duplicate(&name));
        }
        names.push(Some(name));
    }
    Ok(names)
}
