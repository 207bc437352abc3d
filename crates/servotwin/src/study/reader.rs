//! What a parser knows while it reads one study: names are looked up in the system, and what is wrong is
//! noted at its place.

use super::mistake::Mistake;
use super::{StudyError, Text};
use crate::document::{self, Collector, Entry, Span, entries};
use crate::nearest::nearest;
use crate::signal::{Signal, SignalError};
use crate::system::System;
use servotwin_model::signal::Piecewise;
use std::cell::{OnceCell, RefCell};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Something is wrong, and it was noted.
#[derive(Debug)]
pub(super) struct Noted;

/// See the module.
pub(super) struct Reader<'a> {
    pub path: &'a str,
    /// The file.
    pub source: &'a str,
    pub text: &'a Text,
    pub system: &'a System,
    pub mistakes: RefCell<Collector<Mistake>>,
    /// The file as a document, once somebody asks for a place in it.
    pub document: OnceCell<Spanned<DeTable<'a>>>,
    /// The keys of the file in which something stands in for what cannot be read.
    pub doubtful: Vec<&'static str>,
}

/// What a reaction is for.
pub(super) const OF_A_CLASS: &str = "command, or command/detail, of a class";
/// What a sensor may follow.
pub(super) const OTHER_SENSOR: &str = "other sensor";

/// Beyond so many mistakes none comes with advice; fewer are told.
const TOLD: usize = 100;
/// More names than these are not listed in a message.
const LISTED: usize = 30;

impl<'a> Reader<'a> {
    /// Notes a mistake; of every place one is told, and none that comes of what stands in for another.
    pub fn note(&self, at: &Span, mistake: Mistake) -> Noted {
        let mut mistakes = self.mistakes.borrow_mut();
        if !mistakes.knows(at) && self.is_certain(&mistake) {
            mistakes.note(at, mistake);
        }
        Noted
    }

    /// Whether a mistake would be one whatever else the file should say.
    fn is_certain(&self, mistake: &Mistake) -> bool {
        match mistake {
            _ if self.doubtful.is_empty() => true,
            Mistake::Document(_) | Mistake::Signal { .. } => true,
            Mistake::Shared { .. } => self.is_sound(&["units"]),
            // Of what is looked up in the system, nothing but the units stands in the study.
            Mistake::Unknown { name, .. } if name.is_empty() => false,
            Mistake::Unknown { what: OF_A_CLASS, .. } => self.is_sound(&["classes"]),
            Mistake::Unknown { what: OTHER_SENSOR, .. } => self.is_sound(&["sensors"]),
            Mistake::Unknown { .. } => self.is_sound(&["units"]),
            _ => false,
        }
    }

    /// Whether all of some keys of the file could be read.
    fn is_sound(&self, keys: &[&str]) -> bool {
        keys.iter().all(|key| !self.doubtful.contains(key))
    }

    /// A name in a section that is none of those known.
    pub fn unknown<'n>(
        &self,
        section: &str,
        what: &'static str,
        name: &str,
        known: impl IntoIterator<Item = &'n str>,
    ) -> Noted {
        let known: Vec<&str> = known.into_iter().collect();
        // What is not told needs no advice.
        let is_told = self.mistakes.borrow().len() < TOLD;
        let nearest = is_told.then(|| nearest(name, known.iter().copied())).flatten();
        let nearest = nearest.map(Into::into);
        let few = known.len() <= LISTED;
        let known = if few { known.into_iter().map(Into::into).collect() } else { vec![] };
        let mistake = Mistake::Unknown { what, name: name.into(), nearest, known };
        self.note(&self.place(section, name), mistake)
    }

    /// The name of something that all units share, where one of each unit is meant.
    pub fn shared(&self, section: &str, what: &'static str, unit: &str, name: &str) -> Noted {
        let mistake = Mistake::Shared { what, name: name.into(), unit: unit.into() };
        self.note(&self.place(section, name), mistake)
    }

    /// What is wrong with a text of a section.
    pub fn in_text(&self, section: &str, text: &str, mistake: document::Mistake) -> Noted {
        self.note(&self.place(section, text), mistake.into())
    }

    /// That a number of a field is as it must be.
    pub fn range(
        &self,
        field: &str,
        value: f64,
        ok: bool,
        allowed: impl Into<String>,
    ) -> Result<(), Noted> {
        if ok {
            return Ok(());
        }
        let mistake = Mistake::OutOfRange { field: field.into(), value, allowed: allowed.into() };
        Err(self.note(&self.place(field, ""), mistake))
    }

    /// That a component's parameter may have the value of a field.
    pub fn parameter(
        &self,
        field: &str,
        (component, parameter): (usize, usize),
        value: f64,
    ) -> Result<(), Noted> {
        let allowed = self.system.allows(component, parameter, value);
        self.range(field, value, allowed.is_ok(), allowed.err().unwrap_or_default())
    }

    /// That something of a section is missing.
    pub fn empty(&self, section: &str, field: &'static str) -> Noted {
        self.note(&self.place(section, ""), Mistake::Empty { field })
    }

    /// The place of an input.
    pub fn input(&self, section: &str, id: &str) -> Result<usize, Noted> {
        let inputs = &self.system.network().inputs;
        let position = inputs.iter().position(|i| i.id == id);
        let known = inputs.iter().map(|i| i.id.as_str());
        position.ok_or_else(|| self.unknown(section, "input of the system", id, known))
    }

    /// An input's value for a whole run.
    pub fn constant(&self, field: &str, input: usize, value: f64) -> Result<Piecewise, Noted> {
        let (min, max) = self.system.network().input_range(input);
        let unit = self.system.network().inputs[input].unit.symbol();
        let allowed = format!("{}", crate::document::Quantities(min, max, unit));
        self.range(field, value, (min..=max).contains(&value), allowed)?;
        Ok(Piecewise::constant(value).expect("a finite value"))
    }

    /// What a signal does to an input in so many seconds.
    pub fn signal(
        &self,
        section: &str,
        name: &str,
        signal: Result<Signal, SignalError>,
        input: usize,
        duration_s: f64,
    ) -> Result<Piecewise, Noted> {
        let built = signal.and_then(|signal| self.system.driven(input, &signal, duration_s));
        built.map_err(|error| {
            // What is wrong with a unit is so in runs of any length.
            let is_certain = matches!(error, SignalError::WrongUnit { .. });
            if !is_certain && !self.is_sound(&["duration_s", "sample_hz", first(section)]) {
                return Noted;
            }
            let mistake = Mistake::Signal { name: name.into(), error: error.to_string() };
            self.note(&self.place(section, name), mistake)
        })
    }

    /// What of some results is there; the others were noted.
    pub fn sound<T>(&self, all: impl IntoIterator<Item = Result<T, Noted>>) -> Vec<T> {
        all.into_iter().filter_map(Result::ok).collect()
    }

    /// The result, if nothing is wrong at all.
    pub fn finish<T>(self, result: Result<T, Noted>) -> Result<T, StudyError> {
        let mistakes = self.mistakes.into_inner();
        match result {
            Ok(result) if mistakes.is_empty() => Ok(result),
            _ => {
                let mistakes = mistakes.locate(self.source);
                Err(StudyError::Mistakes { path: self.path.into(), mistakes })
            }
        }
    }

    /// Where a name stands in a field: as a text first, then as a key.
    pub fn place(&self, field: &str, name: &str) -> Span {
        let root = self.document.get_or_init(|| DeTable::parse_recoverable(self.source).0);
        let mut found = 0..0;
        let mut all = entries(root.get_ref());
        let mut rest = field;
        let mut inside: Option<Entry> = None;
        // Keys may have dots themselves.
        while let Some(entry) = all.iter().find(|entry| begins(rest, entry.key)).cloned() {
            found = entry.at.clone();
            rest = rest[entry.key.len()..].trim_start_matches('.');
            all = entry.table().map(entries).unwrap_or_default();
            inside = Some(entry);
        }
        if name.is_empty() {
            return match inside {
                Some(entry) if entry.table().is_err() => entry.value_at(),
                _ => found,
            };
        }
        let within = |texts: bool| match &inside {
            Some(entry) => search(entry, name, texts),
            None => all.iter().find_map(|entry| search(entry, name, texts)),
        };
        within(true).or_else(|| within(false)).unwrap_or(found)
    }
}

/// The key of the file that a path begins with.
fn first(path: &str) -> &str {
    path.split('.').next().unwrap_or(path)
}

/// Whether a path goes on with a key.
fn begins(path: &str, key: &str) -> bool {
    path.strip_prefix(key).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

/// Where a name stands below an entry: as a text, or as a key. A name may have its unit before it.
fn search(entry: &Entry, name: &str, texts: bool) -> Option<Span> {
    let is_name = |text: &str| {
        name.strip_suffix(text).is_some_and(|unit| unit.is_empty() || unit.ends_with('.'))
            && !text.is_empty()
    };
    if !texts && is_name(entry.key) {
        return Some(entry.at.clone());
    }
    match entry.value.get_ref() {
        DeValue::String(text) if texts && is_name(text) => Some(entry.value_at()),
        DeValue::Table(table) => entries(table).iter().find_map(|e| search(e, name, texts)),
        DeValue::Array(list) => {
            list.iter().find_map(|value| search(&Entry::element("", value), name, texts))
        }
        _ => None,
    }
}
