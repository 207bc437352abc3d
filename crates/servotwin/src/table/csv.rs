//! Tables as comma-separated text: one header line, then one line per row.
//!
//! The kind of a column is inferred: text if any of its cells is quoted, else what the first
//! row's cell looks like, whole numbers being widened to real ones where a later row needs it. The
//! writer therefore quotes every text, and writes a real number with a point or an exponent, in
//! the shortest form that reads back to the same bits. What is lost in CSV: metadata, units, the
//! difference between `u32` and `i64`, and the kinds of a table without rows.
//!
//! From other writers an empty cell among numbers is read as NaN.

use std::io::{self, Write};
use std::path::Path;

use super::{Column, ContentError, Format, Kind, Table, TableError, Values};
use crate::files::{read_text, write_atomically};

/// The format's entry in [`ALL`](super::ALL).
pub const FORMAT: Format = Format { name: "CSV", extension: "csv", read, write };

/// Reads a CSV file.
pub fn read(path: &Path) -> Result<Table, TableError> {
    let text = read_text(path)?;
    parse(&text).map_err(|problem| TableError::Content { path: path.to_path_buf(), problem })
}

/// Writes a CSV file atomically.
pub fn write(path: &Path, table: &Table) -> Result<(), TableError> {
    Ok(write_atomically(path, |out| write_to(out, table))?)
}

/// Writes a table as CSV text.
pub fn write_to(out: &mut dyn Write, table: &Table) -> io::Result<()> {
    for (place, name) in table.names().enumerate() {
        out.write_all(if place == 0 { b"" } else { b"," })?;
        let plain = name.chars().all(|letter| !matches!(letter, ',' | '"' | '\n' | '\r'));
        if plain && name.trim() == name { write!(out, "{name}")? } else { write_quoted(out, name)? }
    }
    out.write_all(b"\n")?;
    for row in 0..table.row_count() {
        for (place, column) in table.columns().iter().enumerate() {
            out.write_all(if place == 0 { b"" } else { b"," })?;
            write_cell(out, &column.values, row)?;
        }
        out.write_all(b"\n")?;
    }
    Ok(())
}

fn write_cell(out: &mut dyn Write, values: &Values, row: usize) -> io::Result<()> {
    match values {
        // `Debug` always shows a point or an exponent: the column stays real.
        Values::Float(values) => write!(out, "{:?}", values[row]),
        Values::Integer(values) => write!(out, "{}", values[row]),
        Values::Unsigned(values) => write!(out, "{}", values[row]),
        Values::Flag(values) => write!(out, "{}", values[row]),
        Values::Text(values) => write_quoted(out, &values[row]),
    }
}

fn write_quoted(out: &mut dyn Write, text: &str) -> io::Result<()> {
    write!(out, "\"{}\"", text.replace('"', "\"\""))
}

/// Reads CSV text.
pub fn parse(text: &str) -> Result<Table, ContentError> {
    let mut rows = Rows { rest: text, line: 1 };
    let header = rows.next_row()?.ok_or(ContentError::Empty)?;
    let names = column_names(&header)?;
    let mut cells: Vec<Vec<Cell>> = vec![Vec::new(); names.len()];
    while let Some(row) = rows.next_row()? {
        if row.cells.len() != names.len() {
            let (line, found) = (row.line, row.cells.len());
            return Err(ContentError::RaggedRow { line, found, expected: names.len() });
        }
        for (column, mut cell) in cells.iter_mut().zip(row.cells) {
            cell.line = row.line;
            column.push(cell);
        }
    }
    let mut table = Table::new();
    for (name, cells) in names.into_iter().zip(cells) {
        let values = infer(&name, cells)?;
        // Names were compared and lengths are equal, so nothing can be refused here.
        let _ = table.push(Column { name, unit: String::new(), values });
    }
    Ok(table)
}

fn column_names(header: &Row) -> Result<Vec<String>, ContentError> {
    if let [only] = header.cells.as_slice()
        && let Some(found) = only.text.chars().find(|letter| matches!(letter, ';' | '\t'))
        && !only.quoted
    {
        return Err(ContentError::Separator { found });
    }
    if header.cells.len() == 1 && header.cells[0].text.trim().is_empty() {
        return Err(ContentError::Empty);
    }
    let mut names: Vec<String> = Vec::with_capacity(header.cells.len());
    for (place, cell) in header.cells.iter().enumerate() {
        let name = if cell.quoted { &cell.text } else { cell.text.trim() };
        if name.is_empty() {
            return Err(ContentError::UnnamedColumn { place: place + 1 });
        }
        if names.iter().any(|known| known == name) {
            return Err(ContentError::DuplicateColumn { column: name.to_owned() });
        }
        names.push(name.to_owned());
    }
    Ok(names)
}

fn infer(name: &str, cells: Vec<Cell>) -> Result<Values, ContentError> {
    let quoted = cells.iter().any(|cell| cell.quoted);
    let first = cells.iter().map(|cell| cell.text.trim()).find(|text| !text.is_empty());
    let bad = |cell: &Cell, expected| ContentError::BadCell {
        line: cell.line,
        column: name.to_owned(),
        text: cell.text.clone(),
        expected,
    };
    let kind = if quoted { Kind::Text } else { first.map_or(Kind::Float, kind_of) };
    match kind {
        Kind::Text => Ok(Values::Text(cells.into_iter().map(|cell| cell.text).collect())),
        Kind::Flag => {
            let flag = |cell: &Cell| flag(&cell.text).ok_or_else(|| bad(cell, Kind::Flag));
            cells.iter().map(flag).collect::<Result<_, _>>().map(Values::Flag)
        }
        _ => {
            let whole = |cell: &Cell| cell.text.trim().parse::<i64>().ok();
            if kind == Kind::Integer
                && let Some(values) = cells.iter().map(whole).collect()
            {
                return Ok(Values::Integer(values));
            }
            let real = |cell: &Cell| real(&cell.text).ok_or_else(|| bad(cell, Kind::Float));
            cells.iter().map(real).collect::<Result<_, _>>().map(Values::Float)
        }
    }
}

fn kind_of(text: &str) -> Kind {
    match text {
        _ if text.parse::<i64>().is_ok() => Kind::Integer,
        _ if real(text).is_some() => Kind::Float,
        _ if flag(text).is_some() => Kind::Flag,
        _ => Kind::Text,
    }
}

fn real(text: &str) -> Option<f64> {
    match text.trim() {
        "" => Some(f64::NAN),
        text => text.parse().ok(),
    }
}

fn flag(text: &str) -> Option<bool> {
    match text.trim() {
        "true" | "True" | "TRUE" => Some(true),
        "false" | "False" | "FALSE" => Some(false),
        _ => None,
    }
}

#[derive(Debug, Clone, Default)]
struct Cell {
    text: String,
    quoted: bool,
    line: usize,
}

struct Row {
    cells: Vec<Cell>,
    line: usize,
}

/// The text still to be read, and the number of its first line.
struct Rows<'a> {
    rest: &'a str,
    line: usize,
}

impl Rows<'_> {
    fn next_row(&mut self) -> Result<Option<Row>, ContentError> {
        // Blank lines mean nothing: an empty text would be quoted.
        while self.skip("\r\n") || self.skip("\n") {
            self.line += 1;
        }
        if self.rest.is_empty() {
            return Ok(None);
        }
        let mut row = Row { cells: Vec::new(), line: self.line };
        loop {
            row.cells.push(self.next_cell()?);
            if !self.skip(",") {
                break;
            }
        }
        if !self.skip("\r\n") {
            self.skip("\n");
        }
        self.line += 1;
        Ok(Some(row))
    }

    fn next_cell(&mut self) -> Result<Cell, ContentError> {
        if self.skip("\"") {
            return self.quoted_cell();
        }
        let end = self.rest.find([',', '\n']).unwrap_or(self.rest.len());
        let (text, rest) = self.rest.split_at(end);
        // Of a Windows line end only the line feed ended the cell.
        let text = if rest.starts_with(',') { text } else { text.trim_end_matches('\r') };
        self.rest = rest;
        Ok(Cell { text: text.to_owned(), ..Cell::default() })
    }

    /// The cell after its opening quote; a doubled quote inside stands for one.
    fn quoted_cell(&mut self) -> Result<Cell, ContentError> {
        let start = self.line;
        let mut text = String::new();
        loop {
            let end = self.rest.find('"').ok_or(ContentError::OpenQuote { line: start })?;
            text.push_str(&self.rest[..end]);
            self.line += self.rest[..end].matches('\n').count();
            self.rest = &self.rest[end + 1..];
            if !self.skip("\"") {
                break;
            }
            text.push('"');
        }
        let ends = |end: &&str| self.rest.starts_with(end);
        if !self.rest.is_empty() && ![",", "\n", "\r\n"].iter().any(ends) {
            return Err(ContentError::TextAfterQuote { line: self.line });
        }
        Ok(Cell { text, quoted: true, line: start })
    }

    fn skip(&mut self, start: &str) -> bool {
        let after = self.rest.strip_prefix(start);
        self.rest = after.unwrap_or(self.rest);
        after.is_some()
    }
}
