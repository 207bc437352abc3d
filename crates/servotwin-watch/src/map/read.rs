//! Reads TOML into a [`Map`]. Mistakes are collected, and reading continues.

use super::{Channel, FORMAT, Map, Origin, Time};
use crate::sequencer::SequencerRules;
use crate::source::frame::numbered;
use crate::source::{DATE, Wanted};
use servotwin::format::{At, Key, Read, Value, section, usual};
use servotwin::system::System;
use servotwin::toml_text::{Collector, Diagnostic, Entry, TextSpan, TomlError, TomlText};
use servotwin::units::{self, NamedUnit};
use servotwin_io::moment;
use servotwin_model::spec::Unit;

/// The largest rate of rows, Hz.
pub(crate) const LARGEST_RATE_HZ: f64 = 1e6;

section! {
    /// A map file.
    pub(super) struct Text {
        must format: u32 = Value::Whole(FORMAT as f64, FORMAT as f64), "version of the file format";
        must time: At<TimeText>, "where the times of rows come from";
        may inputs: At<Channels>, "columns or values of the system's inputs";
        may sensors: At<Channels>, "columns of its sensors";
        may samples: SamplesText => usual(),
            "columns of a log without a header, and when samples are reordered or dropped";
    }
}

section! {
    struct TimeText {
        may column: Option<At<String>>, "column with the time; or `rate_hz`";
        may unit: Option<At<String>>, "its unit, or `date` for dates as text; default s";
        may rate_hz: Option<f64> = Value::Number(1e-3, LARGEST_RATE_HZ, "Hz"),
            "rows per second, where there is no column with the time";
    }
}

section! {
    struct ChannelText {
        may column: Option<At<String>>, "column of the log; or `value`";
        may value: Option<f64> = NUMBER, "the same value always";
        may unit: Option<At<String>>, "unit of the column or the value; default SI";
        may factor: f64 = NUMBER => 1.0, "factor before the unit; default 1";
        may offset: f64 = NUMBER => 0.0, "offset behind the factor, in the unit; default 0";
        may hold_s: f64 = Value::Number(0.0, 1e9, "s") => 0.0,
            "how long a value replaces missing ones behind it; default 0";
    }
}

section! {
    struct SamplesText {
        may columns: Option<Vec<String>>, "columns of a log that has no header";
        may wait_s: f64 = Value::Number(0.0, 10.0, "s") => SequencerRules::default().wait_s,
            "how long late samples are waited for";
        may longest_gap_s: f64 = Value::Number(0.01, 3600.0, "s") => SequencerRules::default().longest_gap_s,
            "behind a longer gap everything begins anew";
        may witnesses: usize = Value::Whole(2.0, 1e4) => SequencerRules::default().witnesses,
            "samples that make another clock believed";
    }
}

const NUMBER: Value = Value::Number(-1e300, 1e300, "");

/// Inputs or sensors by id. An id with points may be written as nested tables.
#[derive(Clone, Debug, Default)]
struct Channels(Vec<(At<String>, ChannelText)>);

impl Read for Channels {
    const VALUE: Value = Value::Names(0, &ChannelText::VALUE);

    fn read(entry: &Entry, key: Key, mistakes: &mut Collector) -> Option<Self> {
        let mut channels = Self::default();
        channels.add("", mistakes.table(entry)?, key, mistakes);
        Some(channels)
    }
}

impl Channels {
    fn add(&mut self, path: &str, all: Vec<Entry>, key: Key, mistakes: &mut Collector) {
        for entry in all {
            let id = format!("{path}{}", entry.key);
            let inner = entry.table().unwrap_or_default();
            if !inner.is_empty() && inner.iter().all(|entry| entry.table().is_some()) {
                self.add(&format!("{id}."), inner, key, mistakes);
            } else if let Some(channel) = ChannelText::read(&entry, key, mistakes) {
                self.0.push((At::new(id, entry.at), channel));
            }
        }
    }
}

/// Reads the text of a map file.
pub(super) fn read(text: &str, path: &str, system: &System) -> Result<Map, TomlError> {
    let mut reader = Reader::new(text, path, system);
    if let Some(document) = TomlText::parse(text, FORMAT, &mut reader.mistakes) {
        let text = Text::of(&document.root(), (&(0..0), "the file"), &mut reader.mistakes);
        text.into_iter().for_each(|text| reader.file(text));
    }
    reader.mark_flags();
    match reader.mistakes.is_empty() {
        true => Ok(reader.map),
        false => Err(reader.mistakes.refuse(path, text)),
    }
}

struct Reader<'s> {
    system: &'s System,
    mistakes: Collector,
    map: Map,
}

impl<'s> Reader<'s> {
    fn new(text: &str, path: &str, system: &'s System) -> Self {
        let channel = |id: &String, unit, from, possible| {
            let (id, unit) = (id.clone(), NamedUnit::of_si(unit));
            Channel { id, from, unit, hold_s: 0.0, possible }
        };
        let inputs = system.network().inputs.iter().enumerate().map(|(n, input)| {
            let from = Origin::Default(input.default);
            channel(&input.id, input.unit, from, system.accepted_range(n))
        });
        let sensors = system.sensors.iter().enumerate().map(|(n, sensor)| {
            channel(&sensor.id, sensor.unit, Origin::Nothing, system.readable(n))
        });
        let map = Map {
            path: path.to_owned(),
            text: text.to_owned(),
            time: Time::Rate { rate_hz: 1.0 },
            channels: inputs.chain(sensors).collect(),
            inputs: system.network().inputs.len(),
            rules: SequencerRules::default(),
            wanted: Wanted::default(),
            places: vec![],
        };
        Reader { system, mistakes: Collector::default(), map }
    }

    fn file(&mut self, text: Text) {
        self.time(text.time);
        let sensors = text.sensors.at.clone();
        self.channels("input", text.inputs.value);
        self.channels("sensor", text.sensors.value);
        let SamplesText { columns, wait_s, longest_gap_s, witnesses } = text.samples;
        self.map.rules = SequencerRules { wait_s, longest_gap_s, witnesses };
        if let Some(columns) = columns {
            self.map.wanted.columns = numbered(columns);
            self.require_columns();
        }
        let measured = |channel: &Channel| matches!(channel.from, Origin::Column { .. });
        if self.mistakes.is_empty() && !self.map.channels[self.map.inputs..].iter().any(measured) {
            let mistake = Diagnostic::new("no sensor has a column: there is nothing to watch");
            let help = "write: [sensors] and NAME = { column = \"…\" }";
            self.mistakes.note(&sensors, mistake.with_help(help));
        }
    }

    /// Marks on/off columns: words for on and off become numbers for an input that lies between 0 and 1.
    fn mark_flags(&mut self) {
        self.map.wanted.flags = vec![false; self.map.wanted.names.len()];
        for (input, channel) in self.map.channels[..self.map.inputs].iter().enumerate() {
            let network = self.system.network();
            let is_flag = network.inputs[input].unit == Unit::None
                && network.input_range(input) == (0.0, 1.0);
            if let Origin::Column { place, .. } = channel.from {
                self.map.wanted.flags[place] |= is_flag;
            }
        }
    }

    fn time(&mut self, At { value: TimeText { column, unit, rate_hz }, at }: At<TimeText>) {
        match (column, rate_hz) {
            (Some(column), None) => {
                let place = self.column(&column);
                let (unit_s, zero_s) = self.time_unit(unit);
                self.map.wanted.time = Some(place);
                let is_number = !self.map.wanted.dates && zero_s == 0.0;
                self.map.wanted.day = is_number.then_some(moment::DAY_S / unit_s);
                self.map.time = Time::Column { place, unit_s, zero_s };
            }
            (None, Some(rate_hz)) => self.map.time = Time::Rate { rate_hz },
            _ => self.one_of(&at, "[time]", ["column", "rate_hz"]),
        }
    }

    /// Both or neither of two alternative keys.
    fn one_of(&mut self, at: &TextSpan, place: &str, [one, other]: [&str; 2]) {
        let message = format!("{place} needs either '{one}' or '{other}'");
        self.mistakes.note(at, Diagnostic::new(message));
    }

    /// The time unit in seconds, and the time of its zero since 1970.
    fn time_unit(&mut self, unit: Option<At<String>>) -> (f64, f64) {
        let Some(word) = unit else { return (1.0, 0.0) };
        if word.value == DATE {
            self.map.wanted.dates = true;
            return (1.0, 0.0);
        }
        let known = units::find(&word).and_then(|row| row.to(Unit::Second));
        known.unwrap_or_else(|| {
            let mut known = units::spellings(Unit::Second);
            known.push(DATE.into());
            self.unknown_unit(&word, &known);
            (1.0, 0.0)
        })
    }

    fn unknown_unit(&mut self, word: &At<String>, known: &[String]) {
        let mistake = Diagnostic::new(format!("unknown unit '{}'", **word));
        let help = format!("known: {}", known.join(", "));
        self.mistakes.note(&word.at, mistake.with_help(help));
    }

    fn channels(&mut self, what: &str, Channels(all): Channels) {
        let range = if what == "input" {
            0..self.map.inputs
        } else {
            self.map.inputs..self.map.channels.len()
        };
        for (id, text) in all {
            let channels = &self.map.channels[range.clone()];
            match channels.iter().position(|channel| channel.id == id.value) {
                Some(place) => self.channel(range.start + place, &id, text),
                None => {
                    let known = channels.iter().map(|channel| channel.id.as_str());
                    let message = format!("the system has no {what} '{}'", *id);
                    self.mistakes.note(&id.at, Diagnostic::unknown(message, &id, known));
                }
            }
        }
    }

    fn channel(&mut self, index: usize, id: &At<String>, text: ChannelText) {
        let unit = match index.checked_sub(self.map.inputs) {
            None => self.system.network().inputs[index].unit,
            Some(sensor) => self.system.sensors[sensor].unit,
        };
        let named = self.unit(text.unit, id, unit);
        let (si, zero) = named.to(unit).unwrap_or((1.0, 0.0));
        let ChannelText { factor, offset, hold_s, .. } = text;
        (self.map.channels[index].unit, self.map.channels[index].hold_s) = (named, hold_s);
        match (text.column, text.value) {
            (Some(column), None) => {
                let place = self.column(&column);
                let is_taken = |channel: &&Channel| matches!(channel.from, Origin::Column { place: other, .. } if other == place);
                // One sensor may also give the pressure that is an input.
                if index >= self.map.inputs
                    && let Some(other) = self.map.channels[self.map.inputs..].iter().find(is_taken)
                {
                    let (other, id_of, column) = (&other.id, id.as_str(), column.as_str());
                    let message =
                        format!("'{other}' and '{id_of}' have the same column '{column}'");
                    self.mistakes.note(&id.at, Diagnostic::new(message));
                }
                let (factor, offset) = (factor * si, offset * si + zero);
                self.map.channels[index].from = Origin::Column { place, factor, offset };
            }
            (None, Some(value)) => {
                self.map.channels[index].from =
                    Origin::Value((value * factor + offset) * si + zero);
            }
            _ => self.one_of(&id.at, &format!("'{}'", **id), ["column", "value"]),
        }
    }

    /// The named unit of the dimension of `unit`; SI without one.
    fn unit(
        &mut self,
        word: Option<At<String>>,
        id: &At<String>,
        unit: Unit,
    ) -> &'static NamedUnit {
        let si = NamedUnit::of_si(unit);
        let Some(word) = word else { return si };
        let (known, found) = (units::spellings(unit), units::find(&word));
        match found {
            Some(row) if row.to(unit).is_some() => return row,
            Some(_) => {
                let (wrong, id, symbol) = (&*word, id.as_str(), unit.symbol());
                let message = format!("'{wrong}' is no unit of '{id}', which is in {symbol}");
                let help = format!("known: {}", known.join(", "));
                self.mistakes.note(&word.at, Diagnostic::new(message).with_help(help));
            }
            None => self.unknown_unit(&word, &known),
        }
        si
    }

    /// Checks that a log without a header lists all columns in use.
    fn require_columns(&mut self) {
        let known = &self.map.wanted.columns;
        let pairs = self.map.wanted.names.iter().zip(&self.map.places);
        for (column, place) in pairs.filter(|(name, _)| !known.contains(name)) {
            self.mistakes.note(place, no_column("the list 'columns'", column, known));
        }
    }

    /// The index of a column among those wanted; adds a new one.
    fn column(&mut self, column: &At<String>) -> usize {
        let place = self.map.wanted.names.iter().position(|known| *known == column.value);
        place.unwrap_or_else(|| {
            self.map.wanted.names.push(column.value.clone());
            self.map.places.push(column.at.clone());
            self.map.wanted.names.len() - 1
        })
    }
}

/// The mistake that a log has no such column.
pub(super) fn no_column(log: &str, column: &str, known: &[String]) -> Diagnostic {
    let known = known.iter().map(String::as_str);
    Diagnostic::unknown(format!("{log} has no column '{column}'"), column, known)
}
