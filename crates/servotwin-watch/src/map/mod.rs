//! The map file: which column of a log is which input or sensor of a system, in which unit.
//!
//! The format is described in `docs/watch.md`. Mistakes are shown at their places, all at once.

mod guess;
mod mistake;
mod read;
mod words;

pub use guess::{Guess, Trust, guess};
pub use mistake::Mistake;

use super::sequencer::{Rules, Stamped};
use super::source::{Row, SourceError, Wanted};
use servotwin::system::System;
use servotwin_io::document::{Collector, Diagnostic, Span, write_mistakes};
use servotwin_io::files::{self, FileError};
use servotwin_io::nearest::nearest;
use std::path::Path;

/// The format of map files that this version reads.
pub const FORMAT: u32 = 1;

/// How the columns of a log become the signals of a system.
#[derive(Debug, Clone, PartialEq)]
pub struct Map {
    path: String,
    text: String,
    time: Time,
    /// The inputs of the system, then its sensors.
    channels: Vec<Channel>,
    inputs: usize,
    /// When samples are dropped.
    pub rules: Rules,
    wanted: Wanted,
    /// Where the file names each of the wanted columns.
    places: Vec<Span>,
}

/// Where times come from.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Time {
    /// A column of the log, and one of its unit in seconds.
    Column { place: usize, unit_s: f64 },
    /// Every row is one period later.
    Rate { rate_hz: f64 },
}

/// Where the values of an input or a sensor come from.
#[derive(Debug, Clone, PartialEq)]
struct Channel {
    id: String,
    from: Origin,
    /// How long a value stands for those that are missing behind it, s.
    hold_s: f64,
    /// Between which values it lies at all, SI.
    possible: (f64, f64),
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Origin {
    /// A column, and how its numbers become SI.
    Column { place: usize, factor: f64, offset: f64 },
    /// The same value always, SI.
    Value(f64),
    /// The same, because neither the log nor a person says another: the system's default.
    Default(f64),
    /// Nothing is known of it.
    Nothing,
}

/// Why there is no map.
#[derive(Debug, thiserror::Error)]
pub enum MapError {
    /// The file cannot be read.
    #[error(transparent)]
    File(FileError),
    /// It has mistakes.
    #[error(fmt = write_mistakes)]
    Mistakes {
        /// The file, as it was named.
        path: String,
        /// All that were found, in the order of the file.
        mistakes: Vec<Diagnostic>,
    },
}

/// A number of the log in SI units.
fn in_si(value: f64, factor: f64, offset: f64) -> f64 {
    let scaled = value * factor;
    // Adding zero would change the sign of zero.
    if offset == 0.0 { scaled } else { scaled + offset }
}

impl Map {
    /// Reads a map file for a system.
    ///
    /// # Errors
    /// It cannot be read, or has mistakes.
    pub fn read(path: impl AsRef<Path>, system: &System) -> Result<Self, MapError> {
        let path = path.as_ref();
        let text = files::read_text(path).map_err(MapError::File)?;
        Self::parse(&text, &path.display().to_string(), system)
    }

    /// Reads the text of a map file; `path` is only shown in mistakes.
    ///
    /// # Errors
    /// Every mistake that was found.
    pub fn parse(text: &str, path: &str, system: &System) -> Result<Self, MapError> {
        read::read(text, path, system)
    }

    /// The text of the file.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The columns of the log that are read.
    pub fn wanted(&self) -> &Wanted {
        &self.wanted
    }

    /// The number of inputs; the channels behind them are sensors.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// The number of inputs and sensors.
    pub fn width(&self) -> usize {
        self.channels.len()
    }

    /// The ids of sensors without a column.
    pub fn unmeasured(&self) -> impl Iterator<Item = &str> {
        let sensors = self.channels[self.inputs..].iter();
        sensors.filter(|c| c.from == Origin::Nothing).map(|channel| channel.id.as_str())
    }

    /// The time of a row, s; `rows` came before it, and those that were cut off. NaN where it has none.
    pub fn time_s(&self, row: &Row, rows: u64) -> f64 {
        match self.time {
            Time::Column { place, unit_s } => row.values[place] * unit_s,
            Time::Rate { rate_hz } => (rows + row.cut) as f64 / rate_hz,
        }
    }

    /// The column with the time and its unit in s; 1 for dates. `None` where rows follow each other at a rate.
    pub fn time_column(&self) -> Option<(&str, f64)> {
        match self.time {
            Time::Column { place, unit_s } => Some((&self.wanted.names[place], unit_s)),
            Time::Rate { .. } => None,
        }
    }

    /// A row as a sample; `rows` came before it.
    pub fn sample(&self, row: &Row, rows: u64) -> Stamped {
        let time_s = self.time_s(row, rows);
        let value = |channel: &Channel| match channel.from {
            Origin::Column { place, factor, offset } => in_si(row.values[place], factor, offset),
            Origin::Value(_) | Origin::Default(_) | Origin::Nothing => f64::NAN,
        };
        Stamped { place: row.place, time_s, values: self.channels.iter().map(value).collect() }
    }

    /// Makes values of a sample missing that nothing of the system can have; the first of them.
    pub fn leave_out(&self, sample: &mut Stamped) -> Option<(&str, f64)> {
        let mut first = None;
        for (channel, value) in self.channels.iter().zip(&mut sample.values) {
            let (low, high) = channel.possible;
            if *value < low || *value > high {
                first = first.or(Some((channel.id.as_str(), *value)));
                *value = f64::NAN;
            }
        }
        first
    }

    /// Whether a column of the log says what a channel is.
    pub fn is_column(&self, channel: usize) -> bool {
        matches!(self.channels[channel].from, Origin::Column { .. })
    }

    /// For each channel the constant that the map gives it.
    pub fn constant(&self, channel: usize) -> Option<f64> {
        match self.channels[channel].from {
            Origin::Value(value) | Origin::Default(value) => Some(value),
            _ => None,
        }
    }

    /// How long a value of a channel stands for those that are missing behind it, s.
    pub fn hold_s(&self, channel: usize) -> f64 {
        self.channels[channel].hold_s
    }

    /// Whether a channel has values at all.
    pub fn is_known(&self, channel: usize) -> bool {
        self.channels[channel].from != Origin::Nothing
    }

    /// Whether neither a column nor a person says what an input is.
    pub fn is_default(&self, channel: usize) -> bool {
        matches!(self.channels[channel].from, Origin::Default(_))
    }

    /// Between which values a channel lies at all, SI.
    pub fn possible(&self, channel: usize) -> (f64, f64) {
        self.channels[channel].possible
    }

    /// The id of a channel.
    pub fn id(&self, channel: usize) -> &str {
        &self.channels[channel].id
    }

    /// An error of a log told where this map makes it, if it does.
    ///
    /// # Errors
    /// It is no mistake of the map.
    pub fn explain(&self, error: SourceError) -> Result<MapError, SourceError> {
        let SourceError::Lacking { address, columns, known } = error else { return Err(error) };
        let mut mistakes = Collector::<Mistake>::new();
        for column in columns {
            let place = self.wanted.names.iter().position(|name| *name == column);
            let span = place.map_or(0..0, |place| self.places[place].clone());
            let nearest = nearest(&column, known.iter().map(String::as_str)).map(str::to_owned);
            let (log, known) = (address.clone(), known.clone());
            mistakes.note(&span, Mistake::NoColumn { log, column, nearest, known });
        }
        Ok(MapError::Mistakes { path: self.path.clone(), mistakes: mistakes.locate(&self.text) })
    }
}
