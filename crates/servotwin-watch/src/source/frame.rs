//! Parses one line, datagram or message into a row: cells in the order of a header, or a JSON object.
//!
//! A line that begins with `{` is an object. Its columns are its keys; nested keys and list indices are joined with
//! points (`measured.p_a_1`, `pressures.0`). Any other line is cells between commas, semicolons, tabs or, without any of
//! these, blanks. The first line that has all wanted names is the header, unless the map names the columns; it may stand
//! behind `#` and may be repeated. Blank lines and other lines that begin with `#` are skipped. A name that several
//! columns have gets a number (`p#1`, `p#2`), so that a map says which is meant.

use super::object::{Leaf, walk, without_special_numbers};
use super::{LogRow, Read, Wanted};
use crate::counts::{Flaw, Irregularity};
use servotwin_io::moment::{self, Clock};
use servotwin_io::sanitize;
use servotwin_io::table::csv::dialect::separator_of;
use servotwin_io::table::csv::growing::Numbers;
use servotwin_io::table::csv::records::{Cell, Cells};
use std::collections::BTreeMap;

/// Parses lines into rows.
pub struct Frames {
    wanted: Wanted,
    /// The index in a row of every wanted name.
    places: BTreeMap<String, usize>,
    header: Option<Header>,
    numbers: Numbers,
    clock: Clock,
}

/// The layout of the cells of a line.
struct Header {
    separator: u8,
    /// The number of cells, and without those at the end that have no name.
    cells: usize,
    named: usize,
    /// For each wanted column, the index of its cell.
    chosen: Vec<usize>,
}

impl Frames {
    /// Creates a parser for the wanted columns.
    pub fn new(wanted: &Wanted) -> Self {
        let places = wanted.names.iter().cloned().zip(0..).collect();
        let (numbers, clock) = (Numbers::new(false), Clock::default());
        Frames { wanted: wanted.clone(), places, header: None, numbers, clock }
    }

    /// The offset of the clock of its dates from UTC, s; `None` before the first one, or if it has no zone.
    pub(crate) fn zone_s(&self) -> Option<f64> {
        self.clock.zone_s()
    }

    /// Parses a line without its line end.
    pub fn read(&mut self, line: &[u8], row: &mut LogRow) -> Read {
        let text = line.trim_ascii();
        if text.is_empty() {
            return Read::Nothing;
        }
        if text.iter().any(|&byte| byte < b' ' && byte != b'\t') {
            return Read::Flawed(Irregularity::Noise.into());
        }
        if let Some(names) = behind_mark(text) {
            let _ = self.header.is_none() && self.find_header(names);
            return Read::Nothing;
        }
        row.begin(self.wanted.names.len());
        if let Some(object) = object(text) {
            return match self.add(object, row) {
                Ok(()) => {
                    self.wanted.continue_time(row, &mut self.clock);
                    with_time(&self.wanted, row)
                }
                Err(flaw) => Read::Flawed(flaw),
            };
        }
        // A tab at the end separates an empty last cell.
        self.cells(line, row).unwrap_or_else(Read::Flawed)
    }

    /// Adds the values of an object to a row.
    fn add(&mut self, text: &[u8], row: &mut LogRow) -> Result<(), Flaw> {
        let (before, mut twice) = (row.bad, None);
        let mut fill = |text: &[u8], row: &mut LogRow| {
            let mut filled = vec![false; self.places.len()];
            walk(text, &mut |path, leaf| {
                let place = self.places.get(path).copied();
                if let (Some(place), false) = (place, matches!(leaf, Leaf::Missing)) {
                    if std::mem::replace(&mut filled[place], true) {
                        twice = Some(place);
                    }
                    take(place, &leaf, row, &self.wanted, &mut self.clock);
                }
            })
        };
        let parsed = fill(text, row).or_else(|error| {
            let Some(plain) = without_special_numbers(text) else { return Err(error) };
            row.bad = before;
            fill(&plain, row)
        });
        if let Some(twice) = twice {
            let key = sanitize::text(&self.wanted.names[twice]);
            let cause = format!("the key '{key}' is there twice");
            return Err(Flaw::new(Irregularity::BadObject, cause));
        }
        parsed.map_err(|error| match (error.is_eof(), error.to_string()) {
            (true, _) => Irregularity::CutShort.into(),
            (_, cause) if text.starts_with(b"{") && cause.starts_with("trailing char") => {
                let cause = format!("several objects on one line ({cause}): one a line is needed");
                Flaw::new(Irregularity::BadObject, cause)
            }
            (_, cause) => Flaw::new(Irregularity::BadObject, cause),
        })
    }

    /// Whether a line is the header: it has all wanted names.
    fn find_header(&mut self, line: &[u8]) -> bool {
        let (separator, names) = header(line);
        let is_header = self.wanted.columns.is_empty()
            && self.wanted.names.iter().all(|name| names.contains(name));
        if is_header {
            self.set_header(separator, &names);
        }
        is_header
    }

    fn cells(&mut self, line: &[u8], row: &mut LogRow) -> Result<Read, Flaw> {
        if self.header.is_none() && !self.wanted.columns.is_empty() {
            self.set_header(separator(line), &self.wanted.columns.clone());
        }
        let Some(header) = &self.header else {
            return if self.find_header(line) {
                Ok(Read::Nothing)
            } else {
                Err(Irregularity::NoHeader.into())
            };
        };
        let mut cells: Vec<Cell> = Cells::new(line, header.separator).collect();
        // Separators at the ends of rows, which a header may lack.
        while cells.len() > header.cells
            && cells.last().is_some_and(|cell| cell.bytes.trim_ascii().is_empty())
        {
            cells.pop();
        }
        if !(header.named..=header.cells).contains(&cells.len()) {
            let seen = format!("{} cells, {} are needed", cells.len(), header.named);
            return Err(Flaw::new(Irregularity::WrongColumns, seen));
        }
        if self.is_header(&cells) {
            return Ok(Read::Nothing);
        }
        let Frames { wanted, numbers, clock, .. } = self;
        for (place, &cell) in header.chosen.iter().enumerate() {
            let text = cells[cell].text();
            let text = text.trim();
            let words = || wanted.number_of_words(place, text, clock);
            row.put_text(place, numbers.real(text).or_else(words), text);
            if wanted.time == Some(place) && row.values[place].is_nan() {
                return Err(no_time(&sanitize::text(text)));
            }
        }
        self.wanted.continue_time(row, &mut self.clock);
        // For example a row of units below a header without a time.
        match row.bad > 0 && row.values.iter().all(|value| value.is_nan()) {
            true => {
                let what = "no number in the row, which is dropped";
                Err(Flaw::new(Irregularity::BadValue, what))
            }
            false => Ok(Read::Row),
        }
    }

    /// Whether the cells repeat the header.
    fn is_header(&self, cells: &[Cell]) -> bool {
        let chosen = self.header.iter().flat_map(|header| &header.chosen);
        let mut pairs = chosen.zip(&self.wanted.names);
        pairs.all(|(&cell, name)| {
            let found = decoded(cells[cell]);
            found == *name || found == base(name)
        })
    }

    fn set_header(&mut self, separator: u8, names: &[String]) {
        let place = |wanted| names.iter().position(|name| name == wanted);
        let chosen: Option<Vec<usize>> = self.wanted.names.iter().map(place).collect();
        if let Some(chosen) = chosen {
            let (cells, named) = (names.len(), named(names));
            self.numbers = Numbers::new(separator == b',');
            self.header = Some(Header { separator, cells, named, chosen });
        }
    }
}

/// Takes a value of an object. A text may be a number or a known word.
fn take(place: usize, leaf: &Leaf, row: &mut LogRow, wanted: &Wanted, clock: &mut Clock) {
    match *leaf {
        Leaf::Number(value) => row.put_number(place, value),
        Leaf::Flag(value) => row.put_number(place, f64::from(u8::from(value))),
        Leaf::Text(text) => {
            let words = || wanted.number_of_words(place, text, clock);
            row.put_text(place, text.parse().ok().or_else(words), text);
        }
        Leaf::Missing => {}
    }
}

/// The flaw of a cell that is no time, with the reason if it is a date that is refused.
fn no_time(text: &str) -> Flaw {
    let detail = match moment::refusal(text) {
        _ if text.is_empty() => String::new(),
        Some(reason) => format!("'{text}': {reason}"),
        None => format!("'{text}'"),
    };
    Flaw::new(Irregularity::NoTime, detail)
}

/// A row, unless it lacks a required time.
pub(super) fn with_time(wanted: &Wanted, row: &LogRow) -> Read {
    match wanted.time {
        Some(time) if row.values[time].is_nan() => Read::Flawed(Irregularity::NoTime.into()),
        _ => Read::Row,
    }
}

/// The columns of a line: the names in a header, or the keys of an object.
pub fn columns(line: &[u8]) -> Option<Vec<String>> {
    let text = line.trim_ascii();
    if text.is_empty() || text.starts_with(b"#") {
        return None;
    }
    if let Some(object) = object(text) {
        let mut keys = vec![];
        return walk(object, &mut |path, _| keys.push(path.to_owned())).ok().map(|()| keys);
    }
    let (_, names) = header(line);
    // A row of numbers is not a header, even if decimal commas split its cells.
    let is_name = |name: &&String| name.starts_with(|c: char| c.is_alphabetic() || c == '_');
    let filled = named(&names);
    let named = names.iter().filter(is_name).count();
    (named > 0 && 2 * named >= filled).then_some(names)
}

/// The columns of a line that may stand behind the mark of a comment.
pub(crate) fn marked_columns(line: &[u8]) -> Option<Vec<String>> {
    columns(behind_mark(line).unwrap_or(line))
}

/// What stands behind the mark of a comment.
pub(crate) fn behind_mark(line: &[u8]) -> Option<&[u8]> {
    let rest = line.trim_ascii_start().strip_prefix(b"#")?;
    Some(rest.trim_ascii_start())
}

/// The JSON object of a line, which may stand in a list of one object a line.
pub(crate) fn object(line: &[u8]) -> Option<&[u8]> {
    let text = line.trim_ascii();
    let text = text.strip_prefix(b"[").map_or(text, <[u8]>::trim_ascii_start);
    let end = text.iter().rposition(|byte| !matches!(byte, b',' | b']' | b' ' | b'\t' | b'\r'))?;
    // A list within a cut object ends as the list around it does: only an object ends with a brace.
    let text = if text[end] == b'}' { &text[..=end] } else { text };
    text.starts_with(b"{").then_some(text)
}

/// The separator of a header, and its names.
pub(super) fn header(line: &[u8]) -> (u8, Vec<String>) {
    let line = behind_mark(line).unwrap_or(line);
    let separator = separator(line);
    (separator, numbered(texts(line, separator)))
}

/// Names that several columns have, with a number behind each: `p#1`, `p#2`.
pub(crate) fn numbered(names: Vec<String>) -> Vec<String> {
    let mut counts: BTreeMap<String, (usize, usize)> = BTreeMap::new();
    names.iter().for_each(|name| counts.entry(name.clone()).or_default().0 += 1);
    let number = |name: String| match counts.get_mut(&name) {
        Some((all, own)) if *all > 1 && !name.is_empty() => {
            *own += 1;
            format!("{name}#{own}")
        }
        _ => name,
    };
    names.into_iter().map(number).collect()
}

/// A name without the number of [`numbered`].
pub(crate) fn base(name: &str) -> &str {
    let found = name.rsplit_once('#').filter(|(_, number)| number.parse::<u32>().is_ok());
    found.map_or(name, |(base, _)| base)
}

/// The number of names without the empty ones at the end.
pub(super) fn named(names: &[String]) -> usize {
    names.iter().rposition(|name| !name.is_empty()).map_or(0, |last| last + 1)
}

/// The separator of a line: blanks only if there is no other.
fn separator(line: &[u8]) -> u8 {
    let text = line.trim_ascii();
    let has = |marks: &[u8]| text.iter().any(|byte| marks.contains(byte));
    match !has(b",;\t") && has(b" ") {
        true => b' ',
        false => separator_of(line),
    }
}

/// The cells of a line as text.
pub(super) fn texts(line: &[u8], separator: u8) -> Vec<String> {
    Cells::new(line, separator).map(decoded).collect()
}

fn decoded(cell: Cell) -> String {
    cell.text().trim().to_owned()
}
