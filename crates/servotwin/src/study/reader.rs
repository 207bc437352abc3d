//! The state of a parser that reads one study. It looks names up in the system and collects mistakes
//! with their places.

use super::Text;
use crate::format::At;
use crate::signal::{Signal, SignalError};
use crate::system::System;
use crate::toml_text::{Collector, Diagnostic, NumberWithUnit, Quantities, TextSpan, TomlError};
use servotwin_model::signal::Piecewise;
use std::cell::RefCell;

/// Marks a mistake that has already been noted.
#[derive(Debug)]
pub(super) struct Noted;

/// The state of a parser that reads one study.
pub(super) struct Reader<'a> {
    pub(crate) path: &'a str,
    /// The text of the file.
    pub(crate) source: &'a str,
    pub(crate) text: &'a Text,
    pub(crate) system: &'a System,
    pub(crate) mistakes: RefCell<Collector>,
}

impl<'a> Reader<'a> {
    /// Notes a mistake, at most one for each place.
    pub(crate) fn note(&self, at: &TextSpan, mistake: Diagnostic) -> Noted {
        let mut mistakes = self.mistakes.borrow_mut();
        if !mistakes.knows(at) {
            mistakes.note(at, mistake);
        }
        Noted
    }

    /// Notes an unknown name.
    pub(crate) fn unknown<'n>(
        &self,
        at: &TextSpan,
        (what, name): (&str, &str),
        known: impl IntoIterator<Item = &'n str>,
    ) -> Noted {
        // Mistakes beyond the limit are not shown, so they need no suggestion.
        if self.mistakes.borrow().is_full() {
            return Noted;
        }
        self.note(at, Diagnostic::unknown(format!("there is no {what} '{name}'"), name, known))
    }

    /// Notes a name of something that all actuators share, where each actuator needs its own.
    pub(crate) fn shared(&self, what: &str, actuator: &str, name: &At<String>) -> Noted {
        let message = format!(
            "the {what} '{}' is of a component that actuators share: a name here stands for one of every actuator, \
             '{actuator}.{}' and so on",
            **name, **name
        );
        let help = "a diagnosis says which actuator is at fault, and of what actuators share it is none: leave it out, or \
                    write a second study with actuators = [\"\"], in which the whole system is one actuator";
        self.note(&name.at, Diagnostic::new(message).with_help(help))
    }

    /// Checks that a number lies within its range.
    pub(crate) fn range(
        &self,
        (key, at): (&str, &TextSpan),
        value: f64,
        ok: bool,
        allowed: impl Into<String>,
    ) -> Result<(), Noted> {
        if ok {
            return Ok(());
        }
        Err(self.note(at, Diagnostic::not_allowed(key, NumberWithUnit(value, ""), allowed)))
    }

    /// Checks that a component's parameter allows a value.
    pub(crate) fn parameter(
        &self,
        (key, at): (&str, &TextSpan),
        (component, parameter): (usize, usize),
        value: f64,
    ) -> Result<(), Noted> {
        let allowed = self.system.allows(component, parameter, value);
        self.range((key, at), value, allowed.is_ok(), allowed.err().unwrap_or_default())
    }

    /// Notes an empty value at its place.
    pub(crate) fn empty(&self, at: &TextSpan, field: &str) -> Noted {
        self.note(at, Diagnostic::new(format!("'{field}' is empty")))
    }

    /// Notes a name that occurs twice.
    pub(crate) fn repeated(&self, what: &str, at: &TextSpan, name: &str) -> Noted {
        self.note(at, Diagnostic::new(format!("the {what} '{name}' stands twice")))
    }

    /// The index of the input that is named at a place.
    pub(crate) fn input(&self, at: &TextSpan, id: &str) -> Result<usize, Noted> {
        let inputs = &self.system.network().inputs;
        let position = inputs.iter().position(|i| i.id == id);
        let known = inputs.iter().map(|i| i.id.as_str());
        position.ok_or_else(|| self.unknown(at, ("input of the system", id), known))
    }

    /// The index of the input that the commands drive.
    pub(crate) fn command_input(&self) -> Result<usize, Noted> {
        let input = &self.text.command.input;
        self.input(&input.at, input)
    }

    /// A constant signal for an input, checked against its range.
    pub(crate) fn constant(
        &self,
        (key, at): (&str, &TextSpan),
        input: usize,
        value: f64,
    ) -> Result<Piecewise, Noted> {
        let (min, max) = self.system.network().input_range(input);
        let unit = self.system.network().inputs[input].unit.symbol();
        let is_allowed = (min..=max).contains(&value);
        self.range((key, at), value, is_allowed, Quantities(min, max, unit).to_string())?;
        Ok(Piecewise::constant(value).expect("a finite value"))
    }

    /// Builds the signal of an input for a duration.
    pub(crate) fn signal(
        &self,
        (name, at): (&str, &TextSpan),
        signal: Result<Signal, SignalError>,
        input: usize,
        duration_s: f64,
    ) -> Result<Piecewise, Noted> {
        let built = signal.and_then(|signal| self.system.driven(input, &signal, duration_s));
        built.map_err(|error| self.note(at, Diagnostic::new(format!("signal '{name}': {error}"))))
    }

    /// Keeps the successful results. The mistakes of the others are already noted.
    pub(crate) fn sound<T>(&self, all: impl IntoIterator<Item = Result<T, Noted>>) -> Vec<T> {
        all.into_iter().filter_map(Result::ok).collect()
    }

    /// Returns the result if no mistake was noted.
    pub(crate) fn finish<T>(self, result: Result<T, Noted>) -> Result<T, TomlError> {
        let mistakes = self.mistakes.into_inner();
        match result {
            Ok(result) if mistakes.is_empty() => Ok(result),
            _ => Err(mistakes.refuse(self.path, self.source)),
        }
    }
}
