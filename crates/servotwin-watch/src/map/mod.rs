//! The map file: it assigns columns of a log, with their units, to inputs and sensors of a system.
//!
//! `docs/watch.md` describes the format. All mistakes are reported at once, with their places.

mod guess;
mod read;
mod times;
mod words;

pub use guess::{Guess, Trust, guess};
pub(crate) use read::LARGEST_RATE_HZ;
pub(crate) use times::other_raster;

use super::sequencer::{SequencerRules, Stamped};
use super::source::{LogRow, SourceError, Wanted};
use servotwin::beside::InputMistake;
use servotwin::format::Key;
use servotwin::system::System;
use servotwin::units::NamedUnit;
use servotwin_io::files;
use servotwin_io::toml_text::{Collector, TextSpan, TomlError};
use std::path::Path;

/// The format of map files that this version reads.
pub(crate) const FORMAT: u32 = 1;

/// The keys of a map file.
pub fn keys() -> &'static [Key] {
    read::Text::KEYS
}

/// How columns of a log become signals of a system.
#[derive(Debug, Clone, PartialEq)]
pub struct Map {
    path: String,
    text: String,
    time: Time,
    /// The inputs of the system, followed by its sensors.
    channels: Vec<Channel>,
    inputs: usize,
    /// When samples are reordered or dropped.
    pub rules: SequencerRules,
    wanted: Wanted,
    /// Where the map file names each wanted column.
    places: Vec<TextSpan>,
}

/// The source of times.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Time {
    /// A column of the log; `unit_s` is its unit in seconds, and `zero_s` the time of its zero.
    Column { place: usize, unit_s: f64, zero_s: f64 },
    /// Each row is one period later than the one before.
    Rate { rate_hz: f64 },
}

/// An input or a sensor, with the source of its values.
#[derive(Debug, Clone, PartialEq)]
struct Channel {
    id: String,
    from: Origin,
    /// The unit in which its column is read.
    unit: &'static NamedUnit,
    /// How long a value replaces missing values after it, s.
    hold_s: f64,
    /// Its physical range, SI; values outside become missing.
    possible: (f64, f64),
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Origin {
    /// A column, with factor and offset to SI.
    Column { place: usize, factor: f64, offset: f64 },
    /// A constant from the map, SI.
    Value(f64),
    /// The system's default, SI: neither the log nor a person supplies a value.
    Default(f64),
    /// No value at all.
    Nothing,
}

/// Converts a number of the log to SI.
fn in_si(value: f64, factor: f64, offset: f64) -> f64 {
    let scaled = value * factor;
    // Adding zero would turn -0 into +0.
    if offset == 0.0 { scaled } else { scaled + offset }
}

impl Map {
    /// Reads a map file for a system.
    ///
    /// # Errors
    /// The file cannot be read, or has mistakes.
    pub fn read(path: impl AsRef<Path>, system: &System) -> Result<Self, TomlError> {
        let path = path.as_ref();
        let text = files::read_toml(path)?;
        Self::parse(&text, &path.display().to_string(), system)
    }

    /// Parses the text of a map file; `path` appears only in messages.
    ///
    /// # Errors
    /// All mistakes in the text.
    pub fn parse(text: &str, path: &str, system: &System) -> Result<Self, TomlError> {
        read::read(text, path, system)
    }

    /// The text of the file.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The columns of the log that this map reads.
    pub fn wanted(&self) -> &Wanted {
        &self.wanted
    }

    /// The number of inputs; the following channels are sensors.
    pub(crate) fn inputs(&self) -> usize {
        self.inputs
    }

    /// The number of inputs and sensors.
    pub(crate) fn width(&self) -> usize {
        self.channels.len()
    }

    /// The ids of sensors without a column.
    pub fn unmeasured(&self) -> impl Iterator<Item = &str> {
        let sensors = self.channels[self.inputs..].iter();
        sensors.filter(|c| c.from == Origin::Nothing).map(|channel| channel.id.as_str())
    }

    /// The time of a row, s; NaN if missing. `rows` counts the earlier rows except those cut off, which the row counts.
    pub fn time_s(&self, row: &LogRow, rows: u64) -> f64 {
        match self.time {
            Time::Column { place, unit_s, zero_s } => row.values[place] * unit_s + zero_s,
            Time::Rate { rate_hz } => (rows + row.cut) as f64 / rate_hz,
        }
    }

    /// The time column and its unit in s; 1 for dates. `None` where rows have a fixed rate.
    pub(crate) fn time_column(&self) -> Option<(&str, f64)> {
        match self.time {
            Time::Column { place, unit_s, .. } => Some((&self.wanted.names[place], unit_s)),
            Time::Rate { .. } => None,
        }
    }

    /// Converts a row to a sample; `rows` counts the earlier rows.
    pub(crate) fn sample(&self, row: &LogRow, rows: u64) -> Stamped {
        let time_s = self.time_s(row, rows);
        let value = |channel: &Channel| match channel.from {
            Origin::Column { place, factor, offset } => in_si(row.values[place], factor, offset),
            Origin::Value(_) | Origin::Default(_) | Origin::Nothing => f64::NAN,
        };
        Stamped { place: row.place, time_s, values: self.channels.iter().map(value).collect() }
    }

    /// The first value outside its physical range.
    pub(crate) fn impossible(&self, sample: &Stamped) -> Option<(&str, f64)> {
        let values = sample.values.iter().enumerate();
        let mut outside = values.filter(|(n, value)| !value.is_nan() && !self.can_be(*n, **value));
        outside.next().map(|(channel, value)| (self.id(channel), *value))
    }

    /// Whether a value lies in the physical range of its channel.
    pub(crate) fn can_be(&self, channel: usize, value: f64) -> bool {
        let (low, high) = self.possible(channel);
        (low..=high).contains(&value)
    }

    /// Whether a column of the log supplies a channel.
    pub(crate) fn is_column(&self, channel: usize) -> bool {
        matches!(self.channels[channel].from, Origin::Column { .. })
    }

    /// The constant that the map or the system gives a channel.
    pub(crate) fn constant(&self, channel: usize) -> Option<f64> {
        match self.channels[channel].from {
            Origin::Value(value) | Origin::Default(value) => Some(value),
            _ => None,
        }
    }

    /// How long a value of a channel replaces missing values after it, s.
    pub(crate) fn hold_s(&self, channel: usize) -> f64 {
        self.channels[channel].hold_s
    }

    /// Whether a channel has values at all.
    pub(crate) fn is_known(&self, channel: usize) -> bool {
        self.channels[channel].from != Origin::Nothing
    }

    /// Whether an input uses the system's default, because neither a column nor a person supplies it.
    pub(crate) fn is_default(&self, channel: usize) -> bool {
        matches!(self.channels[channel].from, Origin::Default(_))
    }

    /// The physical range of a channel, SI.
    pub(crate) fn possible(&self, channel: usize) -> (f64, f64) {
        self.channels[channel].possible
    }

    /// The map with a mistake of the column of an input undone; `None` if the log has no such column.
    pub(crate) fn without_mistake(&self, input: usize, mistake: &InputMistake) -> Option<Self> {
        let mut map = self.clone();
        let Origin::Column { place, factor, offset } = &mut map.channels[input].from else {
            return None;
        };
        match mistake {
            InputMistake::Unit(misread) => *factor *= misread.factor(),
            InputMistake::Exchanged(sensor) => {
                let Origin::Column { place: other, .. } = self.channels[self.inputs + *sensor].from
                else {
                    return None;
                };
                let own = std::mem::replace(place, other);
                if let Origin::Column { place, .. } = &mut map.channels[self.inputs + *sensor].from
                {
                    *place = own;
                }
            }
            // A map has no rates.
            InputMistake::Still { lead_s, .. } if *lead_s > 0.0 => return None,
            &InputMistake::Still { sensor, factor: share, .. } => {
                let flown = self.channels[self.inputs + sensor].from;
                let Origin::Column { place: own, factor: si, offset: zero } = flown else {
                    return None;
                };
                (*place, *factor, *offset) = (own, share * si, share * zero);
                map.channels[input].possible = (f64::NEG_INFINITY, f64::INFINITY);
            }
        }
        Some(map)
    }

    /// The unit in which the column of a channel is read.
    pub(crate) fn unit(&self, channel: usize) -> &'static NamedUnit {
        self.channels[channel].unit
    }

    /// The id of a channel.
    pub fn id(&self, channel: usize) -> &str {
        &self.channels[channel].id
    }

    /// Turns a log's missing columns into mistakes at their places in this map.
    ///
    /// # Errors
    /// Returns every other error unchanged.
    pub fn explain(&self, error: SourceError) -> Result<TomlError, SourceError> {
        let SourceError::Lacking { address, columns, known } = error else { return Err(error) };
        let mut mistakes = Collector::default();
        for column in columns {
            let place = self.wanted.names.iter().position(|name| *name == column);
            let span = place.map_or(0..0, |place| self.places[place].clone());
            mistakes.note(&span, read::no_column(&address, &column, &known));
        }
        Ok(mistakes.refuse(&self.path, &self.text))
    }
}
