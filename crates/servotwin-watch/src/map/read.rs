//! Reads TOML into a [`Map`]. Mistakes are collected, and reading continues.

use super::{Channel, FORMAT, Map, MapError, Mistake, Origin, Time};
use crate::sequencer::SequencerRules;
use crate::source::frame::numbered;
use crate::source::{DATE, Wanted};
use servotwin::system::System;
use servotwin::units::{self, NamedUnit};
use servotwin_io::document::{self, Collector, Entry, TextSpan, entries};
use servotwin_io::moment;
use servotwin_io::nearest::nearest;
use servotwin_model::spec::Unit;
use toml::de::DeTable;

/// Reads the text of a map file.
pub(super) fn read(text: &str, path: &str, system: &System) -> Result<Map, MapError> {
    let mut reader = Reader::new(system);
    reader.file(text);
    reader.mark_flags();
    let Reader { mistakes, time, channels, inputs, rules, wanted, places, .. } = reader;
    if !mistakes.is_empty() {
        return Err(MapError::Mistakes { path: path.into(), mistakes: mistakes.locate(text) });
    }
    let (path, text) = (path.to_owned(), text.to_owned());
    Ok(Map { path, text, time, channels, inputs, rules, wanted, places })
}

struct Reader<'s> {
    system: &'s System,
    mistakes: Collector<Mistake>,
    time: Time,
    channels: Vec<Channel>,
    inputs: usize,
    rules: SequencerRules,
    wanted: Wanted,
    places: Vec<TextSpan>,
}

/// The allowed keys of the file and of each section.
/// The largest rate of rows, Hz.
pub(crate) const LARGEST_RATE_HZ: f64 = 1e6;
const SECTIONS: [&str; 5] = ["format", "time", "inputs", "sensors", "samples"];
const TIME: [&str; 3] = ["column", "unit", "rate_hz"];
const CHANNEL: [&str; 6] = ["column", "value", "unit", "factor", "offset", "hold_s"];
const SAMPLES: [&str; 4] = ["columns", "wait_s", "longest_gap_s", "witnesses"];

impl<'s> Reader<'s> {
    fn new(system: &'s System) -> Self {
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
        let channels: Vec<Channel> = inputs.chain(sensors).collect();
        let inputs = system.network().inputs.len();
        Reader {
            system,
            mistakes: Collector::new(),
            time: Time::Rate { rate_hz: 1.0 },
            channels,
            inputs,
            rules: SequencerRules::default(),
            wanted: Wanted::default(),
            places: vec![],
        }
    }

    fn file(&mut self, text: &str) {
        let root = document::parse(text, &mut self.mistakes);
        if !self.mistakes.is_empty() {
            return;
        }
        let root = entries(root.get_ref());
        self.known(&root, "the file", &SECTIONS);
        if !self.format(&root) {
            return;
        }
        match get(&root, "time").map(Entry::table) {
            Some(Ok(table)) => self.time(&entries(table)),
            Some(Err(mistake)) => self.note(&at(&root, "time"), mistake),
            None => self.missing(&(0..0), "the file", "time", "[time] and column = \"…\""),
        }
        for (section, what) in [("inputs", "input"), ("sensors", "sensor")] {
            match get(&root, section).map(Entry::table) {
                Some(Ok(table)) => self.channels(table, what, ""),
                Some(Err(mistake)) => self.note(&at(&root, section), mistake),
                None => {}
            }
        }
        match get(&root, "samples").map(Entry::table) {
            Some(Ok(table)) => self.samples(&entries(table)),
            Some(Err(mistake)) => self.note(&at(&root, "samples"), mistake),
            None => {}
        }
        let measured = |channel: &Channel| matches!(channel.from, Origin::Column { .. });
        if self.mistakes.is_empty() && !self.channels[self.inputs..].iter().any(measured) {
            self.mistakes.note(&at(&root, "sensors"), Mistake::NoSensor);
        }
    }

    /// Marks on/off columns: words for on and off become numbers for an input that lies between 0 and 1.
    fn mark_flags(&mut self) {
        self.wanted.flags = vec![false; self.wanted.names.len()];
        for (input, channel) in self.channels[..self.inputs].iter().enumerate() {
            let network = self.system.network();
            let is_flag = network.inputs[input].unit == Unit::None
                && network.input_range(input) == (0.0, 1.0);
            if let Origin::Column { place, .. } = channel.from {
                self.wanted.flags[place] |= is_flag;
            }
        }
    }

    fn format(&mut self, root: &[Entry]) -> bool {
        let Some(entry) = get(root, "format") else {
            self.missing(&(0..0), "the file", "format", &format!("format = {FORMAT}"));
            return true;
        };
        match entry.number() {
            Ok(found) if found == f64::from(FORMAT) => return true,
            Ok(found) => {
                let mistake = document::TomlMistake::Format { found, supported: FORMAT };
                self.note(&entry.value_at(), mistake);
            }
            Err(mistake) => self.note(&entry.value_at(), mistake),
        }
        false
    }

    fn time(&mut self, entries: &[Entry]) {
        self.known(entries, "[time]", &TIME);
        let rate = self.number(entries, "rate_hz", (1e-3, LARGEST_RATE_HZ), "rows per second");
        match (get(entries, "column"), rate) {
            (Some(column), None) => {
                let place = self.column(column);
                let (unit_s, zero_s) = self.time_unit(entries);
                self.wanted.time = Some(place);
                let is_number = !self.wanted.dates && zero_s == 0.0;
                self.wanted.day = is_number.then_some(moment::DAY_S / unit_s);
                self.time = Time::Column { place, unit_s, zero_s };
            }
            (None, Some(rate_hz)) => self.time = Time::Rate { rate_hz },
            (None, None) if get(entries, "rate_hz").is_some() => {}
            _ => {
                let span = entries.first().map_or(0..0, |entry| entry.at.clone());
                let (place, keys) = ("[time]".into(), ("column", "rate_hz"));
                self.mistakes.note(&span, Mistake::OneOf { place, keys });
            }
        }
    }

    /// The time unit in seconds, and the time of its zero since 1970.
    fn time_unit(&mut self, entries: &[Entry]) -> (f64, f64) {
        let Some((entry, word)) = self.text(entries, "unit") else { return (1.0, 0.0) };
        if word == DATE {
            self.wanted.dates = true;
            return (1.0, 0.0);
        }
        match units::find(word).and_then(|row| row.to(Unit::Second)) {
            Some(unit) => unit,
            None => {
                let mut known = units::spellings(Unit::Second);
                known.push(DATE.into());
                let word = word.to_owned();
                self.mistakes.note(&entry.value_at(), Mistake::UnknownUnit { word, known });
                (1.0, 0.0)
            }
        }
    }

    /// Reads a section with inputs or sensors. An id with points may be written as nested tables; `path` is the prefix
    /// so far.
    fn channels(&mut self, table: &DeTable, what: &'static str, path: &str) {
        for entry in entries(table) {
            let range = match what {
                "input" => 0..self.inputs,
                _ => self.inputs..self.channels.len(),
            };
            let id = format!("{path}{}", entry.key);
            let known = self.channels[range.clone()].iter().map(|channel| channel.id.clone());
            let known: Vec<String> = known.collect();
            let begins = format!("{id}.");
            match (known.iter().position(|known| *known == id), entry.table()) {
                (Some(place), Ok(table)) => {
                    self.channel(range.start + place, &id, &entry.at, &entries(table));
                }
                (Some(_), Err(mistake)) => self.note(&entry.value_at(), mistake),
                (None, Ok(table)) if known.iter().any(|known| known.starts_with(&begins)) => {
                    self.channels(table, what, &begins);
                }
                (None, _) => {
                    let near = nearest(&id, known.iter().map(String::as_str));
                    let nearest = near.map(str::to_owned);
                    self.mistakes.note(&entry.at, Mistake::UnknownId { what, id, nearest, known });
                }
            }
        }
    }

    fn channel(&mut self, index: usize, id: &str, at: &TextSpan, entries: &[Entry]) {
        self.known(entries, &format!("'{id}'"), &CHANNEL);
        let unit = match index.checked_sub(self.inputs) {
            None => self.system.network().inputs[index].unit,
            Some(sensor) => self.system.sensors[sensor].unit,
        };
        let named = self.unit(entries, id, unit);
        let (si, zero) = named.to(unit).unwrap_or((1.0, 0.0));
        self.channels[index].unit = named;
        let all = (-1e300, 1e300);
        let factor = self.number(entries, "factor", all, "before the unit").unwrap_or(1.0);
        let shift = self.number(entries, "offset", all, "behind the factor").unwrap_or(0.0);
        let hold_s = self.number(entries, "hold_s", (0.0, 1e9), "how long a value stands, s");
        self.channels[index].hold_s = hold_s.unwrap_or(0.0);
        let value = self.number(entries, "value", all, "the same always");
        match (get(entries, "column"), get(entries, "value")) {
            (Some(column), None) => {
                let place = self.column(column);
                let is_taken = |channel: &&Channel| matches!(channel.from, Origin::Column { place: other, .. } if other == place);
                // One sensor may also give the pressure that is an input.
                if index >= self.inputs
                    && let Some(other) = self.channels[self.inputs..].iter().find(is_taken)
                {
                    let (column, other) = (self.wanted.names[place].clone(), other.id.clone());
                    let id = id.to_owned();
                    self.mistakes.note(at, Mistake::SameColumn { column, id, other });
                }
                let (factor, offset) = (factor * si, shift * si + zero);
                self.channels[index].from = Origin::Column { place, factor, offset };
            }
            (None, Some(_)) => {
                let si = (value.unwrap_or(0.0) * factor + shift) * si + zero;
                self.channels[index].from = Origin::Value(si);
            }
            _ => {
                let (place, keys) = (format!("'{id}'"), ("column", "value"));
                self.mistakes.note(at, Mistake::OneOf { place, keys });
            }
        }
    }

    /// The named unit of the dimension of `unit`; SI without one.
    fn unit(&mut self, entries: &[Entry], id: &str, unit: Unit) -> &'static NamedUnit {
        let si = NamedUnit::of_si(unit);
        let Some((entry, word)) = self.text(entries, "unit") else { return si };
        let (word, known) = (word.to_owned(), units::spellings(unit));
        let found = units::find(&word);
        if let Some(row) = found.filter(|row| row.to(unit).is_some()) {
            return row;
        }
        match found {
            Some(_) => {
                let id = id.to_owned();
                self.mistakes.note(&entry.value_at(), Mistake::WrongUnit { word, id, unit, known });
            }
            None => {
                self.mistakes.note(&entry.value_at(), Mistake::UnknownUnit { word, known });
            }
        }
        si
    }

    fn samples(&mut self, entries: &[Entry]) {
        self.known(entries, "[samples]", &SAMPLES);
        let wait = "how long late samples are waited for";
        if let Some(wait_s) = self.number(entries, "wait_s", (0.0, 10.0), wait) {
            self.rules.wait_s = wait_s;
        }
        let gap = "behind a longer gap everything begins anew";
        if let Some(gap_s) = self.number(entries, "longest_gap_s", (0.01, 3600.0), gap) {
            self.rules.longest_gap_s = gap_s;
        }
        let witnesses = "samples that make another clock believed";
        if let Some(count) = self.number(entries, "witnesses", (2.0, 1e4), witnesses) {
            self.rules.witnesses = count as usize;
        }
        let Some(list) = get(entries, "columns") else { return };
        match list.list() {
            Ok(elements) => {
                for element in elements {
                    match Entry::element(list.key, element).text() {
                        Ok(name) => self.wanted.columns.push(name.to_owned()),
                        Err(mistake) => self.note(&element.span(), mistake),
                    }
                }
                self.wanted.columns = numbered(std::mem::take(&mut self.wanted.columns));
                self.require_columns();
            }
            Err(mistake) => self.note(&list.value_at(), mistake),
        }
    }

    /// Checks that a log without a header lists all columns in use.
    fn require_columns(&mut self) {
        let known = self.wanted.columns.clone();
        let pairs = self.wanted.names.iter().zip(&self.places);
        for (column, place) in pairs.filter(|(name, _)| !known.contains(name)) {
            let near = nearest(column, known.iter().map(String::as_str)).map(str::to_owned);
            let (log, known) = ("the list 'columns'".into(), known.clone());
            let column = column.clone();
            self.mistakes.note(place, Mistake::NoColumn { log, column, nearest: near, known });
        }
    }

    /// The index of a column among those wanted; adds a new one.
    fn column(&mut self, entry: &Entry) -> usize {
        let name = match entry.text() {
            Ok(name) => name,
            Err(mistake) => {
                self.note(&entry.value_at(), mistake);
                ""
            }
        };
        match self.wanted.names.iter().position(|known| known == name) {
            Some(place) => place,
            None => {
                self.wanted.names.push(name.to_owned());
                self.places.push(entry.value_at());
                self.wanted.names.len() - 1
            }
        }
    }

    fn text<'e, 'a>(
        &mut self,
        entries: &'e [Entry<'a>],
        key: &str,
    ) -> Option<(&'e Entry<'a>, &'a str)> {
        let entry = get(entries, key)?;
        match entry.text() {
            Ok(text) => Some((entry, text)),
            Err(mistake) => {
                self.note(&entry.value_at(), mistake);
                None
            }
        }
    }

    fn number(
        &mut self,
        entries: &[Entry],
        key: &str,
        (min, max): (f64, f64),
        summary: &'static str,
    ) -> Option<f64> {
        let entry = get(entries, key)?;
        match entry.number() {
            Ok(value) if (min..=max).contains(&value) => return Some(value),
            Ok(value) => {
                let (key, unit) = (key.to_owned(), "");
                let mistake =
                    document::TomlMistake::OutOfRange { key, value, min, max, unit, summary };
                self.note(&entry.value_at(), mistake);
            }
            Err(mistake) => self.note(&entry.value_at(), mistake),
        }
        None
    }

    /// Reports unknown keys of a table.
    fn known(&mut self, entries: &[Entry], place: &str, known: &[&str]) {
        for entry in entries.iter().filter(|entry| !known.contains(&entry.key)) {
            let mistake = document::TomlMistake::UnknownKey {
                key: entry.key.into(),
                place: place.into(),
                nearest: nearest(entry.key, known.iter().copied()).map(str::to_owned),
                known: known.iter().map(|key| key.to_string()).collect(),
            };
            self.note(&entry.at, mistake);
        }
    }

    fn missing(&mut self, span: &TextSpan, place: &str, key: &'static str, write: &str) {
        let (place, write) = (place.to_owned(), write.to_owned());
        self.note(span, document::TomlMistake::Missing { place, key, write });
    }

    fn note(&mut self, span: &TextSpan, mistake: document::TomlMistake) {
        self.mistakes.note(span, mistake);
    }
}

fn get<'e, 'a>(entries: &'e [Entry<'a>], key: &str) -> Option<&'e Entry<'a>> {
    entries.iter().find(|entry| entry.key == key)
}

/// The span of a key, or the beginning of the file.
fn at(entries: &[Entry], key: &str) -> TextSpan {
    get(entries, key).map_or(0..0, |entry| entry.at.clone())
}
