//! The declaration of a kind of signal, and access to its checked arguments.
//!
//! The parser, the help text, the ranges and the units all use these declarations.

use super::error::SignalError;
use super::units::Measure;
use super::{Argument, WrittenQuantity};
use servotwin_model::signal::Piecewise;
use servotwin_model::spec::Unit;
use std::borrow::Cow;
use std::fmt;

/// The type of a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sort {
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
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
pub enum Fallback {
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
pub struct Parameter {
    /// Its name in text and files.
    pub name: &'static str,
    /// Its type.
    pub sort: Sort,
    /// The allowed values.
    pub range: Range,
    /// Its default.
    pub fallback: Fallback,
    /// A one-line description.
    pub summary: &'static str,
}

impl Parameter {
    /// The unit of its values for an input in `unit`; `None` for a word.
    pub(crate) fn measure(&self, unit: Unit) -> Option<Measure> {
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

    fn units_for_people(&self) -> String {
        match self.sort {
            Sort::Value => "in the input's unit".into(),
            Sort::Rate => "in the input's unit per second".into(),
            Sort::Whole => "whole number".into(),
            Sort::Choice(words) => words.join(" or "),
            Sort::Text => "text".into(),
            _ => self.measure(Unit::None).map_or(vec![], Measure::allowed).join(", "),
        }
    }
}

/// The declaration of a kind of signal.
#[derive(Debug)]
pub struct Spec {
    /// Name in texts and files.
    pub kind: &'static str,
    /// A one-line description.
    pub summary: &'static str,
    /// A text that is valid for an angle.
    pub example: &'static str,
    /// Whether its value never jumps.
    pub continuous: bool,
    /// The parameters that it accepts.
    pub parameters: &'static [Parameter],
}

impl Spec {
    /// The index of a parameter by name.
    pub(crate) fn parameter(&self, name: &str) -> Option<usize> {
        self.parameters.iter().position(|p| p.name == name)
    }

    pub(super) fn help(&self) -> String {
        let mut text = format!("{}: {}; e.g. {}\n", self.kind, self.summary, self.example);
        for parameter in self.parameters {
            let fallback = match parameter.fallback {
                Fallback::Required => "required".to_string(),
                Fallback::Number(number) => format!("default {number}"),
                Fallback::Word(word) => format!("default {word}"),
                Fallback::Without(what) => format!("default: {what}"),
            };
            let range = match parameter.sort {
                Sort::Text | Sort::Choice(_) => String::new(),
                _ => format!(", {}", parameter.range),
            };
            text += &format!(
                "  {:<10} {} ({}{range}; {fallback})\n",
                parameter.name,
                parameter.summary,
                parameter.units_for_people(),
            );
        }
        text
    }
}

/// A kind of signal.
pub trait SignalKind: Sync {
    /// The declaration of the kind.
    fn spec(&self) -> &'static Spec;

    /// Builds the function of time from checked arguments.
    ///
    /// # Errors
    /// The arguments are incompatible.
    fn build(&self, given: &Given) -> Result<Piecewise, SignalError>;
}

/// The most points of a signal.
const MOST_POINTS: f64 = 1e7;

/// Checked arguments, in SI.
pub struct Given<'a> {
    spec: &'static Spec,
    arguments: &'a [Option<Argument>],
    /// The unit of the input.
    pub unit: Unit,
    /// Duration of the run, s.
    pub duration_s: f64,
}

impl<'a> Given<'a> {
    pub(super) fn new(
        spec: &'static Spec,
        arguments: &'a [Option<Argument>],
        unit: Unit,
        duration_s: f64,
    ) -> Result<Self, SignalError> {
        for (parameter, argument) in spec.parameters.iter().zip(arguments) {
            if let (Some(Argument::Quantity(quantity)), Some(measure)) =
                (argument, parameter.measure(unit))
            {
                check_unit(spec, parameter, quantity, measure)?;
            }
        }
        Ok(Self { spec, arguments, unit, duration_s })
    }

    fn place(&self, name: &str) -> usize {
        let place = self.spec.parameter(name);
        place.unwrap_or_else(|| panic!("{} declares no parameter '{name}'", self.spec.kind))
    }

    /// A number that is given or has a default; `None` otherwise.
    pub(crate) fn optional(&self, name: &str) -> Option<f64> {
        let place = self.place(name);
        match (&self.arguments[place], self.spec.parameters[place].fallback) {
            (Some(Argument::Quantity(quantity)), _) => Some(quantity.si()),
            (_, Fallback::Number(number)) => Some(number),
            _ => None,
        }
    }

    /// A number that is required or has a default.
    pub(crate) fn number(&self, name: &str) -> f64 {
        self.optional(name).expect("required parameters are checked when parsed")
    }

    /// A word or text that is given or has a default.
    pub(crate) fn word(&self, name: &str) -> &str {
        let place = self.place(name);
        match (&self.arguments[place], self.spec.parameters[place].fallback) {
            (Some(Argument::Word(word)), _) => word,
            (_, Fallback::Word(word)) => word,
            _ => panic!("'{name}' of {} is no word", self.spec.kind),
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
    pub(super) fn impossible(&self, reason: impl Into<Cow<'static, str>>) -> SignalError {
        SignalError::Impossible { kind: self.spec.kind, reason: reason.into() }
    }
}

/// Checks that a quantity has a unit of `measure`; a plain number always passes.
pub(super) fn check_unit(
    spec: &Spec,
    parameter: &Parameter,
    quantity: &WrittenQuantity,
    measure: Measure,
) -> Result<(), SignalError> {
    if quantity.measure().is_none_or(|own| own == measure) {
        return Ok(());
    }
    Err(SignalError::WrongUnit {
        kind: spec.kind,
        parameter: parameter.name,
        given: quantity.to_string(),
        allowed: measure.allowed(),
    })
}

/// Checks that a quantity is in the parameter's range.
pub(super) fn check_range(
    spec: &Spec,
    parameter: &Parameter,
    quantity: &WrittenQuantity,
) -> Result<(), SignalError> {
    let whole = parameter.sort != Sort::Whole || quantity.number.fract() == 0.0;
    if whole && parameter.range.contains(quantity.si()) {
        return Ok(());
    }
    let units = match parameter.sort {
        Sort::Angle => "rad",
        Sort::Time => "s",
        Sort::Frequency => "Hz",
        Sort::Whole => "whole number",
        Sort::Value | Sort::Rate | Sort::Text | Sort::Choice(_) => "",
    };
    Err(SignalError::OutOfRange {
        kind: spec.kind,
        parameter: parameter.name,
        given: quantity.to_string(),
        range: parameter.range,
        units,
    })
}
