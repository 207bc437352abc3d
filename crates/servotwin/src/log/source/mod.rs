//! Where samples come from: files and live streams behind one trait.
//!
//! A source knows which columns are wanted ([`Wanted`]) and gives their numbers row by row, in the units of
//! the log. What cannot be read is a [`Flaw`], never an end: only a file or a connection that cannot
//! be opened is an error.

pub mod cut;
pub mod frame;
mod lines;
mod mcap;
pub mod mqtt;
mod stdin;
mod survey;
mod table;
mod udp;

use super::counts::Kind;
use crate::files::FileError;
use crate::moment;
use crate::nearest::nearest;
use crate::quoted;
use crate::table::TableError;
use std::fmt;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;

pub use frame::Flaw;
pub use survey::{LogColumn, is_time_name};

/// The unit of a date as text.
pub const DATE: &str = "date";

/// How long a live source waits before it says that nothing came.
pub const PAUSE: Duration = Duration::from_millis(200);

/// The columns that are read, in this order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Wanted {
    /// Their names, each once.
    pub names: Vec<String>,
    /// Which of them is the time; without one, rows follow each other in the period of the log.
    pub time: Option<usize>,
    /// Whether the time is a date as text.
    pub dates: bool,
    /// The columns of lines without a header, from left to right.
    pub columns: Vec<String>,
    /// For each name whether words for on and off are numbers in it; where there is none, they are not.
    pub flags: Vec<bool>,
}

impl Wanted {
    /// The number that words stand for in a column: a date where it is the time, on and off where they are numbers.
    pub(super) fn number_of_words(&self, place: usize, text: &str) -> Option<f64> {
        if self.dates && self.time == Some(place) {
            return moment::seconds(text);
        }
        let is = |words: [&str; 3]| words.iter().any(|word| text.eq_ignore_ascii_case(word));
        match self.flags.get(place) {
            Some(true) if is(["on", "true", "yes"]) => Some(1.0),
            Some(true) if is(["off", "false", "no"]) => Some(0.0),
            _ => None,
        }
    }
}

/// A row as it came.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Row {
    /// Its line, row, datagram or message, from 1.
    pub place: u64,
    /// The wanted columns; NaN is missing.
    pub values: Vec<f64>,
    /// How many of them were there, but no finite number.
    pub bad: u64,
    /// The first of those.
    pub first_bad: Option<Bad>,
    /// How many rows before it were cut off.
    pub cut: u64,
}

/// A value that is no finite number.
#[derive(Debug, Clone, PartialEq)]
pub struct Bad {
    /// Its column among those wanted.
    pub column: usize,
    /// The beginning of what stands there, as it may be shown.
    pub text: String,
}

impl Row {
    /// Before the values of the next row are looked at.
    pub(super) fn forget_bad(&mut self) {
        (self.bad, self.first_bad) = (0, None);
    }

    /// Counts a value that is no finite number.
    pub(super) fn note_bad(&mut self, bad: Bad) {
        self.bad += 1;
        self.first_bad.get_or_insert(bad);
    }

    /// What was there instead of numbers, with the column of the first.
    pub fn bad_in_words(&self, wanted: &Wanted) -> String {
        let first = self.first_bad.as_ref();
        let column = first.and_then(|bad| Some((wanted.names.get(bad.column)?, &bad.text)));
        let first =
            column.map(|(name, text)| format!("column '{}' has '{text}'", quoted::text(name)));
        let count = format!("{} of {} values", self.bad, self.values.len());
        match first {
            Some(first) if self.bad == 1 => first,
            Some(first) => format!("{first}, {count}"),
            None => count,
        }
    }
}

/// What came of reading on.
#[derive(Debug, PartialEq)]
pub enum Read {
    /// A row.
    Row,
    /// Something that is no row.
    Flawed(Flaw),
    /// Something that says nothing, as a header.
    Nothing,
    /// A live stream is quiet.
    Pause,
    /// The connection was lost and made again.
    Reconnected,
    /// Nothing will come.
    End,
}

/// Gives row by row.
pub trait Source {
    /// Reads on. `row` is the last one's, to be overwritten.
    ///
    /// # Errors
    /// The file or the connection fails.
    fn read(&mut self, row: &mut Row) -> Result<Read, SourceError>;

    /// What is counted: `line`, `row`, `datagram` or `message`.
    fn counted(&self) -> &'static str;

    /// Whether it goes on by the clock, and cannot be read again.
    fn is_live(&self) -> bool {
        false
    }

    /// How much of a file is read, from 0 to 1.
    fn share(&self) -> Option<f64> {
        None
    }
}

/// A source by its name.
#[derive(Debug, Clone, PartialEq)]
pub enum Address {
    /// A .parquet or .mcap file, or any other name for CSV or lines of JSON objects.
    File(PathBuf),
    /// Lines of standard input.
    Stdin,
    /// Datagrams sent to this address.
    Udp(SocketAddr),
    /// Messages of a broker.
    Mqtt(mqtt::Subscription),
}

impl Address {
    /// The source that a text names: a file, `-`, `udp://HOST:PORT`, or
    /// `mqtt://[USER:PASSWORD@]HOST[:PORT]/TOPICS[?qos=1]`.
    ///
    /// # Errors
    /// [`SourceError::Address`].
    pub fn parse(text: &str) -> Result<Self, SourceError> {
        let wrong = |needed| SourceError::Address { given: text.into(), needed };
        if text == "-" {
            return Ok(Address::Stdin);
        }
        if let Some(rest) = text.strip_prefix("udp://") {
            use std::net::ToSocketAddrs;
            let mut found = rest.to_socket_addrs().map_err(|_| wrong("udp://HOST:PORT"))?;
            return found.next().map(Address::Udp).ok_or_else(|| wrong("udp://HOST:PORT"));
        }
        if let Some(rest) = text.strip_prefix("mqtt://") {
            let found = mqtt::Subscription::parse(rest).map(Address::Mqtt);
            let needed = "mqtt://[USER:PASSWORD@]HOST[:PORT]/TOPICS[?qos=0 or 1]";
            return found.ok_or_else(|| wrong(needed));
        }
        if text.contains("://") {
            return Err(wrong("a file, -, udp://HOST:PORT, or mqtt://HOST/TOPICS"));
        }
        Ok(Address::File(PathBuf::from(text)))
    }

    /// Whether the source goes on by the clock.
    pub fn is_live(&self) -> bool {
        !matches!(self, Address::File(_))
    }

    /// Opens the source for some columns.
    ///
    /// # Errors
    /// It cannot be opened, or a file does not have the columns.
    pub fn open(&self, wanted: &Wanted) -> Result<Box<dyn Source>, SourceError> {
        Ok(match self {
            Address::File(path) if has_extension(path, "parquet") => {
                Box::new(table::Parquet::open(path, wanted)?)
            }
            Address::File(path) if has_extension(path, "mcap") => mcap::open(path, wanted)?,
            Address::File(path) => Box::new(lines::Lines::open(path, wanted)?),
            Address::Stdin => Box::new(stdin::Stdin::new(std::io::stdin(), wanted)),
            Address::Udp(address) => Box::new(udp::Udp::open(*address, wanted)?),
            Address::Mqtt(subscription) => Box::new(mqtt::Mqtt::open(subscription, wanted)?),
        })
    }

    /// The columns of a file, or of what comes first in a stream, with their units and first numbers where these are
    /// known. Objects and messages of a file are looked through to its end.
    ///
    /// # Errors
    /// It cannot be opened, or nothing in it is a header.
    pub fn columns(&self) -> Result<Vec<LogColumn>, SourceError> {
        let names = match self {
            Address::File(path) if has_extension(path, "parquet") => return table::columns(path),
            Address::File(path) if has_extension(path, "mcap") => return mcap::columns(path),
            Address::File(path) => return lines::columns(path),
            Address::Stdin => stdin::columns(std::io::stdin().lock())?,
            Address::Udp(address) => udp::columns(*address)?,
            Address::Mqtt(subscription) => mqtt::columns(subscription)?,
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
            Address::Mqtt(subscription) => write!(out, "{subscription}"),
        }
    }
}

fn has_extension(path: &Path, wanted: &str) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(wanted))
}

/// Why there is no source, or no more of it.
#[derive(Debug)]
pub enum SourceError {
    /// The name of the source cannot be understood.
    Address {
        /// What was written.
        given: String,
        /// What is possible.
        needed: &'static str,
    },
    /// A file.
    File(FileError),
    /// A table.
    Table(TableError),
    /// A connection.
    Connection {
        /// To what.
        address: String,
        /// What happened.
        cause: String,
    },
    /// There is nothing in it.
    Empty {
        /// The file.
        address: String,
    },
    /// Nothing in it names columns.
    NoHeader {
        /// The source.
        address: String,
    },
    /// A file that is not in the order of its times has more numbers than are sorted.
    Unsorted {
        /// The file.
        address: String,
        /// How many are sorted at most.
        most: usize,
    },
    /// Nothing of a log lies in the time that was asked for.
    Cut(cut::CutError),
    /// Columns that the map names are not there.
    Lacking {
        /// The log.
        address: String,
        /// The columns.
        columns: Vec<String>,
        /// All there are.
        known: Vec<String>,
    },
}

impl SourceError {
    /// The error for wanted names that are not among those there, if there are any.
    pub(super) fn lacking(address: &str, wanted: &Wanted, known: &[String]) -> Option<Self> {
        let columns = wanted.names.iter().filter(|name| !known.contains(name));
        let columns: Vec<String> = columns.cloned().collect();
        let error = || SourceError::Lacking {
            address: address.to_owned(),
            known: known.to_vec(),
            columns: columns.clone(),
        };
        (!columns.is_empty()).then(error)
    }
}

impl fmt::Display for SourceError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SourceError::Address { given, needed } => {
                write!(out, "'{given}' names no source: {needed} is needed")
            }
            SourceError::File(error) => write!(out, "{error}"),
            SourceError::Table(error) => write!(out, "{error}"),
            SourceError::Connection { address, cause } => write!(out, "{address}: {cause}"),
            SourceError::Empty { address } => write!(out, "{address}: the file is empty"),
            SourceError::NoHeader { address } => {
                write!(out, "{address}: no line with the names of columns, and no JSON object")
            }
            SourceError::Cut(error) => write!(out, "{error}"),
            SourceError::Unsorted { address, most } => write!(
                out,
                "{address} is not in the order of its times and has more than {most} numbers to sort: sort it by log time first"
            ),
            SourceError::Lacking { address, columns, known } => {
                write!(out, "{address} has no column '{}'; ", columns.join("', '"))?;
                match nearest(&columns[0], known.iter().map(String::as_str)) {
                    Some(name) => write!(out, "did you mean '{name}'?"),
                    None => write!(out, "it has: {}", quoted::list(known)),
                }
            }
        }
    }
}

impl std::error::Error for SourceError {}

impl From<FileError> for SourceError {
    fn from(error: FileError) -> Self {
        SourceError::File(error)
    }
}

impl From<TableError> for SourceError {
    fn from(error: TableError) -> Self {
        SourceError::Table(error)
    }
}

impl Flaw {
    /// The kind under which it is counted.
    pub fn kind(&self) -> Kind {
        match self {
            Flaw::Noise => Kind::Noise,
            Flaw::TooLong => Kind::TooLong,
            Flaw::CutShort => Kind::CutShort,
            Flaw::WrongColumns { .. } => Kind::WrongColumns,
            Flaw::NoHeader => Kind::NoHeader,
            Flaw::BadObject { .. } => Kind::BadObject,
            Flaw::NoTime { .. } => Kind::NoTime,
            Flaw::NoNumber => Kind::BadValue,
        }
    }
}
