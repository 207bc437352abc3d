//! The declaration of a kind of signal, and access to its checked arguments.
//!
//! The parser, the help text, the JSON Schema, the ranges and the units all use these declarations.

use super::error::SignalError;
use super::units::Measure;
use super::{Argument, WrittenQuantity};
use servotwin_model::signal::Piecewise;
use servotwin_model::spec::Unit;
use std::fmt;

/// The type of a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Sort {
    /// A value in the unit of the input that the signal drives.
    Value,
    /// A rate in that unit per second.
    Rate,
    /// An angle, rad.
    Angle,
    /// A time, s.
    Time,
    /// A frequency, Hz.
    Frequency,
    /// A nonnegative integer.
    Whole,
    /// A free text, e.g. a file name.
    Text,
    /// One of the given words.
    Choice(&'static [&'static str]),
}

/// The allowed values, in SI.
#[derive(Clone, Copy, Debug)]
pub(super) enum Range {
    /// Any finite number.
    Any,
    /// Greater than zero.
    Positive,
    /// Zero or greater.
    NotNegative,
    /// From the first to the second, both included.
    Between(f64, f64),
}

impl Range {
    fn contains(self, value: f64) -> bool {
        match self {
            Range::Any => value.is_finite(),
            Range::Positive => value > 0.0 && value.is_finite(),
            Range::NotNegative => value >= 0.0 && value.is_finite(),
            Range::Between(low, high) => (low..=high).contains(&value),
        }
    }
}

impl fmt::Display for Range {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Range::Any => write!(out, "any finite number"),
            Range::Positive => write!(out, "greater than 0"),
            Range::NotNegative => write!(out, "0 or greater"),
            Range::Between(low, high) => write!(out, "{low} to {high}"),
        }
    }
}

/// The default of a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Fallback {
    /// The parameter is required.
    Required,
    /// A number, SI.
    Number(f64),
    /// A word.
    Word(&'static str),
    /// No value; describes the behavior without it.
    Without(&'static str),
}

/// A parameter of a kind of signal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parameter {
    /// Its name in text and files.
    pub name: &'static str,
    /// Its type.
    pub(crate) sort: Sort,
    range: Range,
    /// Its default.
    pub(crate) fallback: Fallback,
    /// A one-line description.
    pub summary: &'static str,
}

/// A number.
pub(super) const fn parameter(
    name: &'static str,
    sort: Sort,
    range: Range,
    fallback: Fallback,
    summary: &'static str,
) -> Parameter {
    Parameter { name, sort, range, fallback, summary }
}

/// A text or one of several words.
pub(super) const fn words(
    name: &'static str,
    sort: Sort,
    fallback: Fallback,
    summary: &'static str,
) -> Parameter {
    parameter(name, sort, Range::Any, fallback, summary)
}

impl Parameter {
    /// The unit of its values for an input in `unit`; `None` for a word.
    pub(super) fn measure(&self, unit: Unit) -> Option<Measure> {
        match self.sort {
            Sort::Value => Some(Measure::of(unit)),
            Sort::Rate => Some(Measure { unit, per_second: true }),
            Sort::Angle => Some(Measure::of(Unit::Radian)),
            Sort::Time => Some(Measure::of(Unit::Second)),
            Sort::Frequency => Some(Measure::of(Unit::Hertz)),
            Sort::Whole => Some(Measure { unit: Unit::None, per_second: false }),
            Sort::Text | Sort::Choice(_) => None,
        }
    }

    fn help(&self) -> String {
        let unit = match self.sort {
            Sort::Value => "in the input's unit".into(),
            Sort::Rate => "in the input's unit per second".into(),
            Sort::Whole => "whole number".into(),
            Sort::Choice(words) => words.join(" or "),
            Sort::Text => "text".into(),
            _ => self.measure(Unit::None).map_or(vec![], Measure::allowed).join(", "),
        };
        let range = match self.sort {
            Sort::Text | Sort::Choice(_) => String::new(),
            _ => format!(", {}", self.range),
        };
        let fallback = match self.fallback {
            Fallback::Required => "required".to_string(),
            Fallback::Number(number) => format!("default {number}"),
            Fallback::Word(word) => format!("default {word}"),
            Fallback::Without(what) => format!("default: {what}"),
        };
        format!("  {:<10} {} ({unit}{range}; {fallback})\n", self.name, self.summary)
    }

    /// Checks that a quantity has a unit of `measure`; a plain number always passes.
    pub(super) fn check_unit(
        &self,
        kind: &Kind,
        quantity: &WrittenQuantity,
        measure: Measure,
    ) -> Result<(), SignalError> {
        if quantity.measure().is_none_or(|own| own == measure) {
            return Ok(());
        }
        Err(self.wrong_unit(kind, &quantity.to_string(), &measure.allowed()))
    }

    pub(super) fn wrong_unit(&self, kind: &Kind, given: &str, allowed: &[String]) -> SignalError {
        let (kind, name) = (kind.name, self.name);
        let allowed: String = allowed.iter().map(|unit| format!("{unit}, ")).collect();
        SignalError::Invalid(format!(
            "{kind}: '{name}={given}' has a wrong unit; allowed: {allowed}a plain number (SI)"
        ))
    }

    /// Checks that a quantity is in the parameter's range.
    pub(super) fn check_range(
        &self,
        kind: &Kind,
        quantity: &WrittenQuantity,
    ) -> Result<(), SignalError> {
        let whole = self.sort != Sort::Whole || quantity.number.fract() == 0.0;
        if whole && self.range.contains(quantity.si()) {
            return Ok(());
        }
        let unit = match self.sort {
            Sort::Angle => " (rad)",
            Sort::Time => " (s)",
            Sort::Frequency => " (Hz)",
            Sort::Whole => " (whole number)",
            Sort::Value | Sort::Rate | Sort::Text | Sort::Choice(_) => "",
        };
        let (kind, name, range) = (kind.name, self.name, self.range);
        let message = format!("{kind}: '{name}={quantity}' is out of range: {range}{unit}");
        Err(SignalError::Invalid(message))
    }
}

/// The declaration of a kind of signal.
#[derive(Debug)]
pub(crate) struct Kind {
    /// Name in texts and files.
    pub(crate) name: &'static str,
    /// A one-line description.
    pub(crate) summary: &'static str,
    /// A text that is valid for an angle.
    pub(crate) example: &'static str,
    /// The parameters that it accepts.
    pub(crate) parameters: &'static [Parameter],
    /// Builds the function of time from checked arguments. Fails if they are incompatible.
    pub(super) build: fn(&Given) -> Result<Piecewise, SignalError>,
}

impl Kind {
    /// The index of a parameter by name.
    pub(crate) fn parameter(&self, name: &str) -> Option<usize> {
        self.parameters.iter().position(|p| p.name == name)
    }

    pub(super) fn help(&self) -> String {
        let parameters: String = self.parameters.iter().map(Parameter::help).collect();
        format!("{}: {}; e.g. {}\n{parameters}", self.name, self.summary, self.example)
    }
}

/// The most points of a signal.
const MOST_POINTS: f64 = 1e7;

/// Checked arguments, in SI.
pub(super) struct Given<'a> {
    kind: &'static Kind,
    arguments: &'a [Option<Argument>],
    /// The unit of the input.
    pub(crate) unit: Unit,
    /// Duration of the run, s.
    pub(crate) duration_s: f64,
}

impl<'a> Given<'a> {
    pub(super) fn new(
        kind: &'static Kind,
        arguments: &'a [Option<Argument>],
        unit: Unit,
        duration_s: f64,
    ) -> Result<Self, SignalError> {
        for (parameter, argument) in kind.parameters.iter().zip(arguments) {
            if let (Some(Argument::Quantity(quantity)), Some(measure)) =
                (argument, parameter.measure(unit))
            {
                parameter.check_unit(kind, quantity, measure)?;
            }
        }
        Ok(Self { kind, arguments, unit, duration_s })
    }

    fn argument(&self, name: &str) -> (Option<&Argument>, Fallback) {
        let place = self.kind.parameter(name);
        let place =
            place.unwrap_or_else(|| panic!("{} declares no parameter '{name}'", self.kind.name));
        (self.arguments[place].as_ref(), self.kind.parameters[place].fallback)
    }

    /// A number that is given or has a default; `None` otherwise.
    pub(super) fn optional(&self, name: &str) -> Option<f64> {
        match self.argument(name) {
            (Some(Argument::Quantity(quantity)), _) => Some(quantity.si()),
            (_, Fallback::Number(number)) => Some(number),
            _ => None,
        }
    }

    /// A number that is required or has a default.
    pub(super) fn number(&self, name: &str) -> f64 {
        self.optional(name).expect("required parameters are checked when parsed")
    }

    /// A word or text that is given or has a default.
    pub(super) fn word(&self, name: &str) -> &str {
        match self.argument(name) {
            (Some(Argument::Word(word)), _) => word,
            (_, Fallback::Word(word)) => word,
            _ => panic!("'{name}' of {} is no word", self.kind.name),
        }
    }

    /// Limits the number of points, to avoid exhausting memory.
    pub(super) fn few_points(&self, count: f64) -> Result<(), SignalError> {
        if count <= MOST_POINTS {
            return Ok(());
        }
        Err(self.impossible(format!(
            "that is more than {} million points: a shorter run or window, or a lower frequency",
            MOST_POINTS / 1e6
        )))
    }

    /// The error for incompatible arguments.
    pub(super) fn impossible(&self, reason: impl fmt::Display) -> SignalError {
        SignalError::Invalid(format!("{}: {reason}", self.kind.name))
    }
}
