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
mod records;
pub mod texts;

use std::collections::BTreeSet;
use std::io::{self, BufRead, Write};
use std::path::Path;

use super::{Column, ColumnKind, ContentError, Format, Origin, Table, TableError, Values};
use crate::files::{FileError, write_atomically};
use dialect::Dialect;
use encoding::Encoding;
use growing::{Growing, Numbers, Refused};
use records::Records;

/// The format's entry in [`ALL`](super::ALL).
pub(crate) const FORMAT: Format = Format { name: "CSV", extension: "csv", read, write };

/// Reads a CSV file.
pub(crate) fn read(path: &Path) -> Result<Table, TableError> {
    let unreadable = |cause| TableError::File(FileError::from_io(path, cause));
    let open = || Ok(encoding::open(path)?);
    read_again(open, unreadable, &|problem| TableError::Content {
        path: path.to_path_buf(),
        problem,
    })
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
fn unguarded(text: String) -> String {
    match text.strip_prefix('\'') {
        Some(rest) if is_formula(rest) => rest.to_owned(),
        _ => text,
    }
}

/// Reads CSV text.
pub fn parse(text: &str) -> Result<Table, ContentError> {
    let open = || Ok((text.as_bytes(), Encoding::Utf8));
    // Reading from memory cannot fail.
    read_again(open, |_| ContentError::Empty, &|problem| problem)
}

/// Knowledge from previous attempts to read.
#[derive(Default)]
struct Known {
    /// Not all bytes are UTF-8.
    latin: bool,
    /// Indices of columns that are text although their first cells look different.
    text: BTreeSet<usize>,
}

/// Why an attempt to read ended early.
enum Stop {
    /// The content is invalid.
    Content(ContentError),
    /// The file cannot be read.
    Io(io::Error),
    /// A new attempt with this knowledge can succeed.
    Again(Known),
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

fn read_again<R: BufRead, E>(
    open: impl Fn() -> Result<(R, Encoding), E>,
    unreadable: impl Fn(io::Error) -> E,
    wrong: &dyn Fn(ContentError) -> E,
) -> Result<Table, E> {
    let mut known = Known::default();
    // Every attempt except the last adds knowledge, so there are few.
    loop {
        let (reader, encoding) = open()?;
        match attempt(reader, encoding, known) {
            Ok(table) => return Ok(table),
            Err(Stop::Content(problem)) => return Err(wrong(problem)),
            Err(Stop::Io(cause)) => return Err(unreadable(cause)),
            Err(Stop::Again(more)) => known = more,
        }
    }
}

fn attempt(mut reader: impl BufRead, encoding: Encoding, mut known: Known) -> Result<Table, Stop> {
    let encoding = if known.latin { Encoding::Latin1 } else { encoding };
    let dialect = Dialect::of(reader.fill_buf()?);
    let mut records = Records::new(reader, dialect.separator);
    if !records.advance()? {
        return Err(ContentError::Empty.into());
    }
    let decode = |bytes: &[u8]| encoding::text(bytes, encoding).map(unguarded);
    let decoded = |bytes: &[u8], line| match decode(bytes) {
        Some(text) if text.contains('\0') => Err(Stop::Content(ContentError::ZeroByte { line })),
        Some(text) => Ok(Some(text)),
        None => Ok(None),
    };
    let mut heads = vec![];
    for (cell, quoted) in records.cells() {
        let Some(text) = decoded(cell, records.line())? else {
            return Err(Stop::Again(Known { latin: true, ..known }));
        };
        heads.push(if quoted { text } else { text.trim().to_owned() });
    }
    let names = column_names(heads)?;
    let mut numbers = Numbers::new(dialect.separator == b',');
    let column = |place| Growing::new(known.text.contains(&place));
    let mut columns: Vec<Growing> = (0..names.len()).map(column).collect();
    let (mut origin, mut rows) = (Origin::default(), 0);
    while records.advance()? {
        let (line, found) = (records.line(), records.cells().count());
        if found != names.len() {
            return Err(ContentError::RaggedRow { line, found, expected: names.len() }.into());
        }
        for (place, (cell, quoted)) in records.cells().enumerate() {
            match columns[place].push(cell, quoted, &mut numbers, &decode) {
                Ok(()) => {}
                Err(Refused::NoUtf8) => return Err(Stop::Again(Known { latin: true, ..known })),
                Err(Refused::Contradiction(expected)) => {
                    let name = names[place].as_deref().unwrap_or_default();
                    // True, false and a missing value together are text.
                    let no_flag = expected == ColumnKind::Flag && growing::is_missing(cell);
                    if quoted || no_flag {
                        known.text.insert(place);
                        return Err(Stop::Again(known));
                    }
                    let text = decoded(cell, line)?.unwrap_or_default();
                    let column = name.to_owned();
                    return Err(ContentError::BadCell { line, column, text, expected }.into());
                }
            }
        }
        origin.push_line(rows, line);
        rows += 1;
    }
    origin.dialect = dialect.in_words(encoding, numbers.has_comma());
    table_of(names, columns, origin)
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
            return Err(ContentError::UnnamedColumn { place: place + 1 }.into());
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

/// The names of the columns. The first one may be unnamed, like the index of a data frame. So may the last one if it is
/// empty; it is `None` until that is known.
fn column_names(heads: Vec<String>) -> Result<Vec<Option<String>>, ContentError> {
    let count = heads.len();
    if count == 1 && heads[0].trim().is_empty() {
        return Err(ContentError::Empty);
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
            true => return Err(ContentError::UnnamedColumn { place: place + 1 }),
            false => head,
        };
        if !seen.insert(name.clone()) {
            return Err(ContentError::DuplicateColumn { column: name });
        }
        names.push(Some(name));
    }
    Ok(names)
}
