//! Sources of samples: files and live streams behind one trait.
//!
//! A source knows the wanted columns ([`Wanted`]) and returns their numbers row by row, in the units of the log.
//! Unreadable input is a [`Flaw`] and never ends the stream. Only a file or connection that cannot be opened is an
//! error.

mod formats;
pub mod frame;
mod lines;
mod live;
mod object;
mod stdin;
mod survey;
pub mod table;
mod udp;

use super::counts::Flaw;
use crate::span::CutError;
use servotwin_io::files::FileError;
use servotwin_io::moment::Clock;
use servotwin_io::nearest::nearest;
use servotwin_io::sanitize;
use servotwin_io::table::TableError;
use servotwin_io::table::csv::growing::is_missing;
use std::fmt;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;

pub use formats::{extensions, is_log};
pub use survey::LogColumn;
pub(crate) use survey::is_time_name;

/// The unit of a date as text.
pub(crate) const DATE: &str = "date";

/// How long a live source waits before it reports a pause.
pub(crate) const PAUSE: Duration = Duration::from_millis(200);

/// The columns to read, in this order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Wanted {
    /// The column names, without duplicates.
    pub names: Vec<String>,
    /// The index of the time column; without one, rows follow each other at a fixed rate.
    pub time: Option<usize>,
    /// Whether the time is a date as text.
    pub dates: bool,
    /// A day in the unit of times that are numbers; `None` if they cannot begin anew at midnight.
    pub day: Option<f64>,
    /// The columns of lines without a header, from left to right; empty if the log has one.
    pub columns: Vec<String>,
    /// For each name, whether words for on and off are numbers in it; missing entries mean no.
    pub flags: Vec<bool>,
}

impl Wanted {
    /// The number for a word in a column: a date in the time column, on and off where the column allows them.
    pub(super) fn number_of_words(
        &self,
        place: usize,
        text: &str,
        clock: &mut Clock,
    ) -> Option<f64> {
        if self.dates && self.time == Some(place) {
            return clock.read(text);
        }
        let is = |words: [&str; 3]| words.iter().any(|word| text.eq_ignore_ascii_case(word));
        match self.flags.get(place) {
            Some(true) if is(["on", "true", "yes"]) => Some(1.0),
            Some(true) if is(["off", "false", "no"]) => Some(0.0),
            _ => None,
        }
    }

    /// Lets a time that is a number go on behind midnight.
    pub(super) fn continue_time(&self, row: &mut LogRow, clock: &mut Clock) {
        if let Some((time, day)) = self.time.zip(self.day) {
            row.values[time] = clock.number(row.values[time], day);
        }
    }
}

/// One row of a log.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LogRow {
    /// Its line, row, datagram or message number, from 1.
    pub place: u64,
    /// The wanted columns; NaN means missing.
    pub values: Vec<f64>,
    /// How many values were present but not finite numbers.
    pub bad: u64,
    /// The first of these values.
    pub first_bad: Option<Bad>,
    /// How many earlier rows were cut off by the time span.
    pub cut: u64,
}

/// A value that is not a finite number.
#[derive(Debug, Clone, PartialEq)]
pub struct Bad {
    /// The index of its column among those wanted.
    pub column: usize,
    /// Its text, shortened and sanitized for messages.
    pub text: String,
}

impl LogRow {
    /// Begins a row of so many values, which are missing so far.
    pub(super) fn begin(&mut self, width: usize) {
        self.values.clear();
        self.values.resize(width, f64::NAN);
        (self.bad, self.first_bad) = (0, None);
    }

    /// Puts a number into a column; NaN is missing.
    pub(super) fn put_number(&mut self, column: usize, value: f64) {
        if !value.is_nan() {
            self.put_text(column, Some(value), if value > 0.0 { "inf" } else { "-inf" });
        }
    }

    /// Puts the `value` of a text into a column. A text without one is missing if it is a word for that, and else bad.
    pub(super) fn put_text(&mut self, column: usize, value: Option<f64>, text: &str) {
        if let Some(value) = value.filter(|value| value.is_finite()) {
            self.values[column] = value;
        } else if !is_missing(text.as_bytes()) {
            self.bad += 1;
            self.first_bad.get_or_insert_with(|| Bad { column, text: sanitize::text(text) });
        }
    }

    /// Describes the invalid values, with the column of the first.
    pub fn bad_in_words(&self, wanted: &Wanted) -> String {
        let first = self.first_bad.as_ref();
        let column = first.and_then(|bad| Some((wanted.names.get(bad.column)?, &bad.text)));
        let first =
            column.map(|(name, text)| format!("column '{}' has '{text}'", sanitize::text(name)));
        let count = format!("{} of {} values", self.bad, self.values.len());
        match first {
            Some(first) if self.bad == 1 => first,
            Some(first) => format!("{first}, {count}"),
            None => count,
        }
    }
}

/// The result of reading the next item.
#[derive(Debug, PartialEq)]
pub enum Read {
    /// A row was read; its values are in `row`.
    Row,
    /// Input that is not a row.
    Flawed(Flaw),
    /// Input without data, such as a header.
    Nothing,
    /// A live stream has sent nothing for `PAUSE`.
    Pause,
    /// Input that the source has dropped before it was read; it is no row, and takes no time.
    Dropped(Flaw),
    /// The source has ended.
    End,
}

/// Returns the rows of a log or stream.
pub trait Source: Send {
    /// Reads the next item. `row` is overwritten.
    ///
    /// # Errors
    /// The file or the connection fails.
    fn read(&mut self, row: &mut LogRow) -> Result<Read, SourceError>;

    /// The unit of counting: `line`, `row`, `datagram` or `message`.
    fn counted(&self) -> &'static str;

    /// Whether data arrive in real time and cannot be read again.
    fn is_live(&self) -> bool {
        false
    }

    /// The share of a file read so far, from 0 to 1.
    fn share(&self) -> Option<f64> {
        None
    }

    /// The offset from UTC of the clock of dates that were read, s; `None` if they have no zone.
    fn zone_s(&self) -> Option<f64> {
        None
    }
}

/// The address of a source.
#[derive(Debug, Clone, PartialEq)]
pub enum Address {
    /// A file; its first bytes or its extension give its format.
    File(PathBuf),
    /// Lines of standard input.
    Stdin,
    /// UDP datagrams sent to this address.
    Udp(SocketAddr),
}

impl Address {
    /// Parses an address: a file, `-`, or `udp://HOST:PORT`.
    ///
    /// # Errors
    /// [`SourceError::Address`].
    pub fn parse(text: &str) -> Result<Self, SourceError> {
        let wrong = |needed| SourceError::Address { given: without_user(text), needed };
        if text == "-" {
            return Ok(Address::Stdin);
        }
        if let Some(rest) = text.strip_prefix("udp://") {
            use std::net::ToSocketAddrs;
            let mut found = rest.to_socket_addrs().map_err(|_| wrong("udp://HOST:PORT"))?;
            return found.next().map(Address::Udp).ok_or_else(|| wrong("udp://HOST:PORT"));
        }
        if text.contains("://") {
            return Err(wrong("a file, -, or udp://HOST:PORT"));
        }
        Ok(Address::File(PathBuf::from(text)))
    }

    /// Whether data arrive in real time.
    pub fn is_live(&self) -> bool {
        !matches!(self, Address::File(_))
    }

    /// Whether the writer of the source waits until it is read, so that nothing must be dropped.
    pub fn waits(&self) -> bool {
        matches!(self, Address::File(_) | Address::Stdin)
    }

    /// Opens the source for the wanted columns.
    ///
    /// # Errors
    /// The source cannot be opened, or a file lacks a column.
    pub fn open(&self, wanted: &Wanted) -> Result<Box<dyn Source>, SourceError> {
        Ok(match self {
            Address::File(path) => (formats::reader_of(path)?.open)(path, wanted)?,
            Address::Stdin => stdin::open(std::io::stdin(), wanted),
            Address::Udp(address) => udp::open(*address, wanted)?,
        })
    }

    /// The columns of a file, or of the first data in a stream, with units and first numbers if known. Objects and
    /// messages of a file are scanned to its end.
    ///
    /// # Errors
    /// The source cannot be opened, or has no header.
    pub fn columns(&self) -> Result<Vec<LogColumn>, SourceError> {
        let names = match self {
            Address::File(path) => return (formats::reader_of(path)?.columns)(path),
            Address::Stdin => stdin::columns(std::io::stdin().lock())?,
            Address::Udp(address) => udp::columns(*address)?,
        };
        Ok(names.into_iter().map(LogColumn::named).collect())
    }
}

impl fmt::Display for Address {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Address::File(path) => write!(out, "{}", path.display()),
            Address::Stdin => write!(out, "standard input"),
            Address::Udp(address) => write!(out, "udp://{address}"),
        }
    }
}

/// An address without user and password, for messages.
fn without_user(text: &str) -> String {
    match (text.find("://"), text.rfind('@')) {
        (Some(mark), Some(at)) if at > mark => format!("{}…{}", &text[..mark + 3], &text[at..]),
        _ => text.to_owned(),
    }
}

/// Why a source cannot be opened or read further.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
pub enum SourceError {
    /// The text is not a source.
    #[error("'{given}' names no source: {needed} is needed")]
    Address { given: String, needed: &'static str },
    /// A file cannot be opened or read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A Parquet table cannot be read.
    #[error(transparent)]
    Table(#[from] TableError),
    /// A connection cannot be made, or has ended.
    #[error("{address}: {cause}")]
    Connection { address: String, cause: String },
    /// The file contains no data.
    #[error("{address}: the file is empty")]
    Empty { address: String },
    /// No line names columns.
    #[error("{address}: no line with the names of columns, and no JSON object: {seen}")]
    NoHeader { address: String, seen: String },
    /// No row of the log lies in the requested time span.
    #[error(transparent)]
    Cut(CutError),
    /// Columns that the map names are missing.
    #[error(
        "{address} has no column '{}'; {}",
        .columns.join("', '"), advice(&.columns[0], .known)
    )]
    Lacking { address: String, columns: Vec<String>, known: Vec<String> },
}

impl Wanted {
    /// Checks that a log has all of these columns.
    ///
    /// # Errors
    /// [`SourceError::Lacking`].
    pub(super) fn require(&self, address: &str, known: Vec<String>) -> Result<(), SourceError> {
        let columns = self.names.iter().filter(|name| !known.contains(name));
        let columns: Vec<String> = columns.cloned().collect();
        match columns.is_empty() {
            true => Ok(()),
            false => Err(SourceError::Lacking { address: address.to_owned(), columns, known }),
        }
    }

    /// The same for the columns of a file.
    fn require_columns(&self, path: &Path, known: Vec<LogColumn>) -> Result<(), SourceError> {
        let known = known.into_iter().map(|column| column.name).collect();
        self.require(&path.display().to_string(), known)
    }
}

/// Suggests the most similar column, or lists all.
fn advice(column: &str, known: &[String]) -> String {
    match nearest(column, known.iter().map(String::as_str)) {
        Some(name) => format!("did you mean '{name}'?"),
        None => format!("it has: {}", sanitize::list(known)),
    }
}
