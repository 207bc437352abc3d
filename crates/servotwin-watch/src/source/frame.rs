//! Parses one line, datagram or message into a row: cells in the order of a header, or a JSON object.
//!
//! A line that begins with `{` is an object. Its columns are its keys; nested keys and list indices are joined with
//! points (`measured.p_a_1`, `pressures.0`). Any other line is cells between commas, semicolons or tabs. The first line
//! that has all wanted names is the header, unless the map names the columns; the header may be repeated. Blank lines
//! and lines that begin with `#` are skipped.

use super::{Bad, LogRow, Read, Wanted};
use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde_json::Value;
use servotwin_io::sanitize;
use servotwin_io::table::csv::dialect::Dialect;
use servotwin_io::table::csv::encoding::{self, Encoding};
use servotwin_io::table::csv::growing::{Numbers, is_missing};
use servotwin_io::table::json_lines;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

/// Why bytes are not a row.
#[derive(Debug, Clone, PartialEq)]
pub enum Flaw {
    /// They are not text.
    Noise,
    /// There are too many bytes.
    TooLong,
    /// The text ends too early.
    CutShort,
    /// The number of cells is wrong.
    WrongColumns {
        /// The number of cells in the line.
        found: usize,
        /// The number of cells in the header.
        needed: usize,
    },
    /// The columns have no names yet.
    NoHeader,
    /// Not JSON, or not an object.
    BadObject {
        /// The parser's message.
        cause: String,
    },
    /// The time is missing or not a number.
    NoTime {
        /// The text of the cell.
        text: String,
    },
    /// A retained message, which the broker had stored earlier.
    Retained {
        /// Its topic.
        topic: String,
    },
    /// The cells contain words but no number.
    NoNumber,
}

impl fmt::Display for Flaw {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Flaw::WrongColumns { found, needed } => {
                write!(out, "{found} cells, {needed} are needed")
            }
            Flaw::BadObject { cause } => write!(out, "{cause}"),
            Flaw::NoTime { text } if text.is_empty() => Ok(()),
            Flaw::NoTime { text } => write!(out, "'{text}'"),
            Flaw::Retained { topic } => write!(out, "topic {}", sanitize::text(topic)),
            Flaw::NoNumber => write!(out, "no number in the row, which is dropped"),
            _ => Ok(()),
        }
    }
}

/// Parses lines into rows.
pub struct Frames {
    wanted: Wanted,
    /// The index in a row of every wanted name.
    places: BTreeMap<String, usize>,
    header: Option<Header>,
    numbers: Numbers,
}

/// The layout of the cells of a line.
struct Header {
    separator: u8,
    cells: usize,
    /// For each wanted column, the index of its cell.
    chosen: Vec<usize>,
}

impl Frames {
    /// Creates a parser for the wanted columns.
    pub fn new(wanted: &Wanted) -> Self {
        let places = wanted.names.iter().cloned().zip(0..).collect();
        Frames { wanted: wanted.clone(), places, header: None, numbers: Numbers::new(true) }
    }

    /// Parses a line without its line end.
    pub fn read(&mut self, line: &[u8], row: &mut LogRow) -> Read {
        let text = line.trim_ascii();
        if text.is_empty() || text.starts_with(b"#") {
            return Read::Nothing;
        }
        if text.iter().any(|&byte| byte < b' ' && byte != b'\t') {
            return Read::Flawed(Flaw::Noise);
        }
        self.begin(row);
        if text.starts_with(b"{") {
            return match self.add("", text, row) {
                Ok(()) => self.end(row),
                Err(flaw) => Read::Flawed(flaw),
            };
        }
        // A tab at the end separates an empty last cell.
        let read = self.cells(line.strip_suffix(b"\r").unwrap_or(line), row);
        read.unwrap_or_else(Read::Flawed)
    }

    /// Resets a row.
    pub fn begin(&self, row: &mut LogRow) {
        row.values.clear();
        row.values.resize(self.wanted.names.len(), f64::NAN);
        row.forget_bad();
    }

    /// Adds the values of an object to a row; `prefix` precedes the names of its columns.
    pub fn add(&self, prefix: &str, text: &[u8], row: &mut LogRow) -> Result<(), Flaw> {
        let before = row.bad;
        let parsed = self.parse(prefix, text, row).or_else(|error| {
            // Some writers emit NaN and Infinity, which JSON does not allow.
            let Some(plain) = without_special_numbers(text) else { return Err(error) };
            row.bad = before;
            self.parse(prefix, &plain, row)
        });
        parsed.map_err(|error| match error.is_eof() {
            true => Flaw::CutShort,
            false => Flaw::BadObject { cause: error.to_string() },
        })
    }

    /// Checks that a row assembled from objects has a time.
    pub fn end(&self, row: &LogRow) -> Read {
        with_time(&self.wanted, row)
    }

    fn cells(&mut self, line: &[u8], row: &mut LogRow) -> Result<Read, Flaw> {
        if self.header.is_none() && !self.wanted.columns.is_empty() {
            let separator = Dialect::of(line).separator;
            self.set_header(separator, &self.wanted.columns.clone());
        }
        let Some(header) = &self.header else {
            let separator = Dialect::of(line).separator;
            let names = names(line, separator);
            return match self.wanted.names.iter().all(|name| names.contains(name)) {
                true => {
                    self.set_header(separator, &names);
                    Ok(Read::Nothing)
                }
                false => Err(Flaw::NoHeader),
            };
        };
        let cells: Vec<&[u8]> = Cells { line: Some(line), separator: header.separator }.collect();
        if cells.len() != header.cells {
            return Err(Flaw::WrongColumns { found: cells.len(), needed: header.cells });
        }
        if self.is_header(&cells) {
            return Ok(Read::Nothing);
        }
        let Frames { wanted, numbers, .. } = self;
        for (place, &cell) in header.chosen.iter().enumerate() {
            let bytes = cells[cell];
            let text = std::str::from_utf8(bytes).unwrap_or("").trim();
            let is_time = wanted.time == Some(place);
            let value = numbers.real(text).or_else(|| wanted.number_of_words(place, text));
            row.values[place] = match value.filter(|value| value.is_finite()) {
                Some(value) => value,
                None if is_time => return Err(Flaw::NoTime { text: shown(bytes) }),
                None => {
                    if !is_missing(bytes) {
                        row.note_bad(Bad { column: place, text: shown(bytes) });
                    }
                    f64::NAN
                }
            };
        }
        // For example a row of units below a header without a time.
        match row.bad > 0 && row.values.iter().all(|value| value.is_nan()) {
            true => Err(Flaw::NoNumber),
            false => Ok(Read::Row),
        }
    }

    /// Whether the cells repeat the header.
    fn is_header(&self, cells: &[&[u8]]) -> bool {
        let chosen = self.header.iter().flat_map(|header| &header.chosen);
        let mut pairs = chosen.zip(&self.wanted.names);
        pairs.all(|(&cell, name)| decoded(cells[cell]) == *name)
    }

    fn set_header(&mut self, separator: u8, names: &[String]) {
        let place = |wanted| names.iter().position(|name| name == wanted);
        let chosen: Option<Vec<usize>> = self.wanted.names.iter().map(place).collect();
        if let Some(chosen) = chosen {
            self.numbers = Numbers::new(separator != b',');
            self.header = Some(Header { separator, cells: names.len(), chosen });
        }
    }

    fn parse(&self, prefix: &str, text: &[u8], row: &mut LogRow) -> Result<(), serde_json::Error> {
        let mut parser = serde_json::Deserializer::from_slice(text);
        let mut path = prefix.to_owned();
        Node { frames: self, path: &mut path, row }.deserialize(&mut parser)?;
        parser.end()
    }
}

/// A row, unless it lacks a required time.
pub(super) fn with_time(wanted: &Wanted, row: &LogRow) -> Read {
    match wanted.time {
        Some(time) if row.values[time].is_nan() => {
            Read::Flawed(Flaw::NoTime { text: String::new() })
        }
        _ => Read::Row,
    }
}

/// The columns of a line: the names in a header, or the keys of an object.
pub fn columns(line: &[u8]) -> Option<Vec<String>> {
    let text = line.trim_ascii();
    if text.is_empty() || text.starts_with(b"#") {
        return None;
    }
    if is_object(text) {
        return leaves(text);
    }
    let names = names(line, Dialect::of(line).separator);
    // A row of numbers is not a header, even if decimal commas split its cells.
    let is_name = |name: &&String| name.starts_with(|c: char| c.is_alphabetic() || c == '_');
    let named = names.iter().filter(is_name).count();
    (named > 0 && 2 * named >= names.len()).then_some(names)
}

/// Whether a line is a JSON object.
pub fn is_object(line: &[u8]) -> bool {
    line.trim_ascii_start().starts_with(b"{")
}

/// The keys of an object including nested ones; `None` if it is not an object.
fn leaves(line: &[u8]) -> Option<Vec<String>> {
    let value: Value = serde_json::from_slice(line.trim_ascii()).ok()?;
    let mut found = vec![];
    json_lines::leaves(value, String::new(), &mut found);
    Some(found.into_iter().map(|(key, _)| key).collect())
}

/// The separator of a header, and its names.
pub(super) fn header(line: &[u8]) -> (u8, Vec<String>) {
    let separator = Dialect::of(line).separator;
    (separator, names(line, separator))
}

/// The cells of a line as text.
pub(super) fn names(line: &[u8], separator: u8) -> Vec<String> {
    let line = line.strip_suffix(b"\r").unwrap_or(line);
    Cells { line: Some(line), separator }.map(decoded).collect()
}

fn decoded(cell: &[u8]) -> String {
    let text = encoding::text(cell, Encoding::Utf8);
    let text = text.or_else(|| encoding::text(cell, Encoding::Latin1)).unwrap_or_default();
    text.trim().replace("\"\"", "\"")
}

/// The text of a cell, sanitized for a message.
fn shown(cell: &[u8]) -> String {
    sanitize::text(&decoded(cell))
}

/// The cells of a line, without their quotes.
struct Cells<'l> {
    line: Option<&'l [u8]>,
    separator: u8,
}

impl<'l> Iterator for Cells<'l> {
    type Item = &'l [u8];

    fn next(&mut self) -> Option<&'l [u8]> {
        let line = self.line?;
        if let Some(quoted) = line.strip_prefix(b"\"") {
            let mut place = 0;
            while let Some(quote) = quoted[place..].iter().position(|&byte| byte == b'"') {
                let end = place + quote;
                match quoted.get(end + 1) {
                    Some(b'"') => place = end + 2,
                    Some(&byte) if byte != self.separator => break,
                    next => {
                        self.line = next.map(|_| &quoted[end + 2..]);
                        return Some(&quoted[..end]);
                    }
                }
            }
        }
        match line.iter().position(|&byte| byte == self.separator) {
            Some(end) => {
                self.line = Some(&line[end + 1..]);
                Some(&line[..end])
            }
            None => {
                self.line = None;
                Some(line)
            }
        }
    }
}

/// Replaces `NaN`, `Infinity` and `-Infinity` by `null`; `None` if there are none.
pub(super) fn without_special_numbers(text: &[u8]) -> Option<Vec<u8>> {
    let text = std::str::from_utf8(text).ok()?;
    if !text.contains("NaN") && !text.contains("Infinity") {
        return None;
    }
    let plain = text.replace("NaN", "null").replace("-Infinity", "null");
    Some(plain.replace("Infinity", "null").into_bytes())
}

/// A value within an object, with its path.
struct Node<'n> {
    frames: &'n Frames,
    path: &'n mut String,
    row: &'n mut LogRow,
}

impl Node<'_> {
    fn set(self, value: f64) {
        let Some(&place) = self.frames.places.get(self.path.as_str()) else { return };
        match value.is_finite() {
            true => self.row.values[place] = value,
            false => self.row.note_bad(Bad { column: place, text: value.to_string() }),
        }
    }

    /// Sets the value from a text that is a number or a known word.
    fn set_text(self, text: &str) {
        let text = text.trim();
        let Some(&place) = self.frames.places.get(self.path.as_str()) else { return };
        let words = || self.frames.wanted.number_of_words(place, text);
        match text.parse().ok().or_else(words).filter(|value: &f64| value.is_finite()) {
            Some(value) => self.row.values[place] = value,
            None if is_missing(text.as_bytes()) => {}
            None => self.row.note_bad(Bad { column: place, text: sanitize::text(text) }),
        }
    }

    /// Reads a nested value under a key or list index.
    fn below<T, E>(
        &mut self,
        key: &str,
        read: impl FnOnce(Node<'_>) -> Result<T, E>,
    ) -> Result<T, E>
    where
        E: Error,
    {
        let length = self.path.len();
        if length > 0 && !self.path.ends_with('.') {
            self.path.push('.');
        }
        self.path.push_str(key);
        let result = read(Node { frames: self.frames, path: &mut *self.path, row: &mut *self.row });
        self.path.truncate(length);
        result
    }
}

impl<'de> DeserializeSeed<'de> for Node<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<(), D::Error> {
        from.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Node<'_> {
    type Value = ();

    fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "JSON")
    }

    fn visit_f64<E>(self, value: f64) -> Result<(), E> {
        self.set(value);
        Ok(())
    }

    fn visit_i64<E>(self, value: i64) -> Result<(), E> {
        self.set(value as f64);
        Ok(())
    }

    fn visit_u64<E>(self, value: u64) -> Result<(), E> {
        self.set(value as f64);
        Ok(())
    }

    fn visit_bool<E>(self, value: bool) -> Result<(), E> {
        self.set(f64::from(u8::from(value)));
        Ok(())
    }

    // JSON null: the value is missing.
    fn visit_unit<E>(self) -> Result<(), E> {
        Ok(())
    }

    fn visit_str<E>(self, text: &str) -> Result<(), E> {
        self.set_text(text);
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(mut self, mut map: A) -> Result<(), A::Error> {
        while let Some(key) = map.next_key::<Cow<str>>()? {
            self.below(&key, |node| map.next_value_seed(node))?;
        }
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut list: A) -> Result<(), A::Error> {
        for place in 0_usize.. {
            let more = self.below(&place.to_string(), |node| list.next_element_seed(node))?;
            if more.is_none() {
                break;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wanted(names: &[&str]) -> Wanted {
        let names = names.iter().map(|name| name.to_string()).collect();
        Wanted { names, time: Some(0), ..Wanted::default() }
    }

    fn read(frames: &mut Frames, line: &str) -> (Read, Vec<f64>, u64) {
        let mut row = LogRow::default();
        let read = frames.read(line.as_bytes(), &mut row);
        (read, row.values, row.bad)
    }

    #[test]
    fn cells_are_found_by_their_names() {
        let mut frames = Frames::new(&wanted(&["t", "p [bar]"]));
        assert_eq!(read(&mut frames, "measured on a Friday").0, Read::Flawed(Flaw::NoHeader));
        assert_eq!(read(&mut frames, "# note").0, Read::Nothing);
        assert_eq!(read(&mut frames, "\"p [bar]\";x;t\r").0, Read::Nothing);
        assert_eq!(read(&mut frames, "1,5;;2\r"), (Read::Row, vec![2.0, 1.5], 0));
        assert_eq!(read(&mut frames, "\"p [bar]\";x;t").0, Read::Nothing);
        assert_eq!(read(&mut frames, "\"2,5\";a;\"3\"").1, [3.0, 2.5]);
        let (found, values, bad) = read(&mut frames, "abc;;4");
        assert_eq!((found, values[0], bad), (Read::Row, 4.0, 1));
        assert!(values[1].is_nan());
        assert_eq!(read(&mut frames, ";;4").2, 0, "missing is no mistake");
        let short = Flaw::WrongColumns { found: 2, needed: 3 };
        assert_eq!(read(&mut frames, "1;2").0, Read::Flawed(short));
        let no_time = Flaw::NoTime { text: "x".into() };
        assert_eq!(read(&mut frames, "1;2;x").0, Read::Flawed(no_time));
        assert_eq!(read(&mut frames, "1;\u{0};3").0, Read::Flawed(Flaw::Noise));
    }

    #[test]
    fn numbers_with_decimal_commas_name_nothing() {
        let header = columns(b"time_s;\"p [bar]\";x_m");
        assert_eq!(header, Some(["time_s", "p [bar]", "x_m"].map(String::from).to_vec()));
        for row in ["0,01;-3,17e-5;1,0", "0.5,1e-3,abc", "1;2;3"] {
            assert_eq!(columns(row.as_bytes()), None, "{row}");
        }
    }

    #[test]
    fn columns_without_a_header_are_named_by_the_map() {
        let columns = ["p", "t"].map(String::from).to_vec();
        let mut frames = Frames::new(&Wanted { columns, ..wanted(&["t", "p"]) });
        assert_eq!(read(&mut frames, "7,0.5").1, [0.5, 7.0]);
        assert_eq!(read(&mut frames, "p,t").0, Read::Nothing, "a header that is sent anyway");
    }

    #[test]
    fn objects_are_read_with_what_is_in_them() {
        let mut frames = Frames::new(&wanted(&["t", "m.p", "v.1"]));
        let line = r#"{"t": 1.25, "m": {"p": "3e5", "q": [1]}, "v": [1, 2.5], "t2": "x"}"#;
        assert_eq!(read(&mut frames, line), (Read::Row, vec![1.25, 3e5, 2.5], 0));
        let (found, values, bad) = read(&mut frames, r#"{"t": 1, "m": {"p": NaN}, "v": {}}"#);
        assert_eq!((found, bad), (Read::Row, 0));
        assert!(values[1].is_nan() && values[2].is_nan());
        assert_eq!(read(&mut frames, r#"{"t": 1, "m""#).0, Read::Flawed(Flaw::CutShort));
        assert!(matches!(
            read(&mut frames, r#"{"t": 1}}"#).0,
            Read::Flawed(Flaw::BadObject { .. })
        ));
        assert!(matches!(read(&mut frames, "{}").0, Read::Flawed(Flaw::NoTime { .. })));
    }

    #[test]
    fn dates_are_times_where_the_map_says_so() {
        let mut frames = Frames::new(&Wanted { dates: true, ..wanted(&["t"]) });
        let (found, values, _) = read(&mut frames, r#"{"t": "1970-01-01T00:01:00.5Z"}"#);
        assert_eq!((found, values), (Read::Row, vec![60.5]));
        read(&mut frames, "t,x");
        assert_eq!(read(&mut frames, "1970-01-01 00:01:00.5,1").1, [60.5]);
    }

    #[test]
    fn words_for_on_and_off_are_numbers_of_an_input_from_0_to_1_and_bad_elsewhere() {
        let flags = vec![false, true, false];
        let mut frames = Frames::new(&Wanted { flags, ..wanted(&["t", "mode", "p"]) });
        let mut row = LogRow::default();
        let line = br#"{"t": "1759967600000", "mode": "on", "p": "101.60"}"#;
        assert_eq!(frames.read(line, &mut row), Read::Row);
        assert_eq!((row.values.clone(), row.bad), (vec![1_759_967_600_000.0, 1.0, 101.6], 0));
        frames.read(br#"{"t": 1, "mode": "stand-by", "p": "on"}"#, &mut row);
        let bad = row.bad_in_words(&frames.wanted);
        assert_eq!(bad, "column 'mode' has 'stand-by', 2 of 3 values");
        frames.read(b"t,mode,p", &mut row);
        frames.read(b"1,OFF,true", &mut row);
        assert_eq!((row.values[1], row.bad), (0.0, 1));
        assert_eq!(row.bad_in_words(&frames.wanted), "column 'p' has 'true'");
    }

    #[test]
    fn a_row_of_units_is_no_sample_even_without_a_time() {
        let mut frames = Frames::new(&Wanted { time: None, ..wanted(&["p", "x"]) });
        read(&mut frames, "p;x;n");
        assert_eq!(read(&mut frames, "bar;mm;-").0, Read::Flawed(Flaw::NoNumber));
        assert_eq!(read(&mut frames, "1;;-").0, Read::Row);
    }

    #[test]
    fn columns_of_a_line() {
        let columns = |line: &str| super::columns(line.as_bytes());
        assert_eq!(columns("a, b ;c").unwrap(), ["a, b", "c"]);
        assert_eq!(columns(r#"{"a": {"b": 1, "c": [2, 3]}}"#).unwrap(), ["a.b", "a.c.0", "a.c.1"]);
        assert_eq!(columns("1,2"), None);
        assert_eq!(columns("# x"), None);
    }
}
