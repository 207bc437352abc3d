//! The state of a parser that reads one study. It looks names up in the system and collects mistakes
//! with their places.

use super::mistake::StudyMistake;
use super::{StudyError, Text};
use crate::document::{self, Collector, KeyPath, TextSpan};
use crate::nearest::nearest;
use crate::signal::{Signal, SignalError};
use crate::system::System;
use servotwin_model::signal::Piecewise;
use std::cell::{OnceCell, RefCell};
use toml::Spanned;
use toml::de::DeTable;

/// Marks a mistake that has already been noted.
#[derive(Debug)]
pub(super) struct Noted;

/// The state of a parser that reads one study.
pub(super) struct Reader<'a> {
    pub path: &'a str,
    /// The text of the file.
    pub source: &'a str,
    pub text: &'a Text,
    pub system: &'a System,
    pub mistakes: RefCell<Collector<StudyMistake>>,
    /// The file as a document, parsed when a place in it is first needed.
    pub document: OnceCell<Spanned<DeTable<'a>>>,
    /// The keys whose unreadable value was replaced by a substitute.
    pub doubtful: Vec<&'static str>,
}

/// Describes valid names of a reaction.
pub(super) const OF_A_CLASS: &str = "command, or command/detail, of a class";
/// Describes sensors that a sensor may follow.
pub(super) const OTHER_SENSOR: &str = "other sensor";
/// Describes sensors that a reaction may take out.
pub(super) const OF_THE_STUDY: &str = "sensor of the study";

/// Stop computing suggestions after this many mistakes.
const TOLD: usize = 100;
/// Longer lists of valid names are left out of messages.
const LISTED: usize = 30;

impl<'a> Reader<'a> {
    /// Notes a mistake, at most one for each place. Mistakes that may come from a substitute are dropped.
    pub(crate) fn note(&self, at: &TextSpan, mistake: StudyMistake) -> Noted {
        let mut mistakes = self.mistakes.borrow_mut();
        if !mistakes.knows(at) && self.is_certain(&mistake) {
            mistakes.note(at, mistake);
        }
        Noted
    }

    /// Whether the mistake stands regardless of the unreadable keys.
    fn is_certain(&self, mistake: &StudyMistake) -> bool {
        match mistake {
            _ if self.doubtful.is_empty() => true,
            StudyMistake::Document(_) | StudyMistake::Signal { .. } => true,
            StudyMistake::Shared { .. } => self.is_sound(&["units"]),
            // Apart from the actuators' names, lookups in the system do not depend on the study.
            StudyMistake::Unknown { name, .. } if name.is_empty() => false,
            StudyMistake::Unknown { what: OF_A_CLASS, .. } => self.is_sound(&["classes"]),
            StudyMistake::Unknown { what: OTHER_SENSOR | OF_THE_STUDY, .. } => {
                self.is_sound(&["sensors"])
            }
            StudyMistake::Unknown { .. } => self.is_sound(&["units"]),
            _ => false,
        }
    }

    /// Whether all of the keys could be read.
    fn is_sound(&self, keys: &[&str]) -> bool {
        keys.iter().all(|key| !self.doubtful.contains(key))
    }

    /// Notes an unknown name at a place.
    pub(crate) fn unknown<'n>(
        &self,
        at: &KeyPath,
        what: &'static str,
        name: &str,
        known: impl IntoIterator<Item = &'n str>,
    ) -> Noted {
        let known: Vec<&str> = known.into_iter().collect();
        // Mistakes beyond the limit are not shown, so they need no suggestion.
        let is_told = self.mistakes.borrow().len() < TOLD;
        let nearest = is_told.then(|| nearest(name, known.iter().copied())).flatten();
        let nearest = nearest.map(Into::into);
        let few = known.len() <= LISTED;
        let known = if few { known.into_iter().map(Into::into).collect() } else { vec![] };
        let mistake = StudyMistake::Unknown { what, name: name.into(), nearest, known };
        self.note(&self.span(at), mistake)
    }

    /// Notes a name of something that all actuators share, where each actuator needs its own.
    pub(crate) fn shared(&self, at: &KeyPath, what: &'static str, unit: &str, name: &str) -> Noted {
        let mistake = StudyMistake::Shared { what, name: name.into(), unit: unit.into() };
        self.note(&self.span(at), mistake)
    }

    /// Notes a mistake in a text.
    pub(crate) fn in_text(&self, at: &KeyPath, mistake: document::TomlMistake) -> Noted {
        self.note(&self.span(at), mistake.into())
    }

    /// Checks that a number lies within its range.
    pub(crate) fn range(
        &self,
        at: &KeyPath,
        value: f64,
        ok: bool,
        allowed: impl Into<String>,
    ) -> Result<(), Noted> {
        if ok {
            return Ok(());
        }
        let mistake =
            StudyMistake::OutOfRange { field: at.to_string(), value, allowed: allowed.into() };
        Err(self.note(&self.span(at), mistake))
    }

    /// Checks that a component's parameter allows a value.
    pub(crate) fn parameter(
        &self,
        at: &KeyPath,
        (component, parameter): (usize, usize),
        value: f64,
    ) -> Result<(), Noted> {
        let allowed = self.system.allows(component, parameter, value);
        self.range(at, value, allowed.is_ok(), allowed.err().unwrap_or_default())
    }

    /// Notes an empty value at its place.
    pub(crate) fn empty(&self, at: &KeyPath, field: &'static str) -> Noted {
        self.note(&self.span(at), StudyMistake::Empty { field })
    }

    /// The index of the input that is named at a place.
    pub(crate) fn input(&self, at: &KeyPath, id: &str) -> Result<usize, Noted> {
        let inputs = &self.system.network().inputs;
        let position = inputs.iter().position(|i| i.id == id);
        let known = inputs.iter().map(|i| i.id.as_str());
        position.ok_or_else(|| self.unknown(at, "input of the system", id, known))
    }

    /// The index of the input that the commands drive.
    pub(crate) fn command_input(&self) -> Result<usize, Noted> {
        self.input(&KeyPath::of(&["command", "input"]), &self.text.command.input)
    }

    /// A constant signal for an input, checked against its range.
    pub(crate) fn constant(
        &self,
        at: &KeyPath,
        input: usize,
        value: f64,
    ) -> Result<Piecewise, Noted> {
        let (min, max) = self.system.network().input_range(input);
        let unit = self.system.network().inputs[input].unit.symbol();
        let allowed = format!("{}", crate::document::Quantities(min, max, unit));
        self.range(at, value, (min..=max).contains(&value), allowed)?;
        Ok(Piecewise::constant(value).expect("a finite value"))
    }

    /// Builds the signal of an input for a duration.
    pub(crate) fn signal(
        &self,
        at: &KeyPath,
        name: &str,
        signal: Result<Signal, SignalError>,
        input: usize,
        duration_s: f64,
    ) -> Result<Piecewise, Noted> {
        let built = signal.and_then(|signal| self.system.driven(input, &signal, duration_s));
        built.map_err(|error| {
            // A wrong unit is wrong for any duration.
            let is_certain = matches!(error, SignalError::WrongUnit { .. });
            if !is_certain && !self.is_sound(&["duration_s", "sample_hz", at.section()]) {
                return Noted;
            }
            let mistake = StudyMistake::Signal { name: name.into(), error: error.to_string() };
            self.note(&self.span(at), mistake)
        })
    }

    /// Keeps the successful results. The mistakes of the others are already noted.
    pub(crate) fn sound<T>(&self, all: impl IntoIterator<Item = Result<T, Noted>>) -> Vec<T> {
        all.into_iter().filter_map(Result::ok).collect()
    }

    /// Returns the result if no mistake was noted.
    pub(crate) fn finish<T>(self, result: Result<T, Noted>) -> Result<T, StudyError> {
        let mistakes = self.mistakes.into_inner();
        match result {
            Ok(result) if mistakes.is_empty() => Ok(result),
            _ => {
                let mistakes = mistakes.locate(self.source);
                Err(StudyError::Mistakes { path: self.path.into(), mistakes })
            }
        }
    }

    /// The byte range of a place in the file.
    pub(crate) fn span(&self, at: &KeyPath) -> TextSpan {
        let root = self.document.get_or_init(|| DeTable::parse_recoverable(self.source).0);
        at.find(root.get_ref())
    }
}
