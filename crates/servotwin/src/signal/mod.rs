//! Signals: commands, loads and boundary values as functions of time.
//!
//! A [`Signal`] is written as text. For an input with a known unit and
//! a run of known duration, it becomes a [`Piecewise`] function. Terms joined by ` + ` are added.
//!
//! A new kind needs a declaration here and a line in `ALL`.

pub mod bus;
#[cfg(test)]
mod contract;
mod error;
mod noise;
pub mod random;
mod simple;
mod sine;
mod spec;
mod sweep;
mod table;
mod text;
mod units;

pub use error::SignalError;
use spec::Kind;
pub(crate) use spec::Sort;
pub use text::QuantityError;

use crate::units::NamedUnit;
use servotwin_model::signal::Piecewise;
use servotwin_model::spec::Unit;
use spec::Given;
use std::fmt;
use units::Measure;

/// Every kind of signal, in the order of the documentation.
pub(crate) static ALL: [&Kind; 7] = [
    &simple::CONSTANT,
    &simple::STEP,
    &simple::RAMP,
    &sine::SINE,
    &sweep::SWEEP,
    &noise::NOISE,
    &table::TABLE,
];

/// The kind with a given name.
fn find(name: &str) -> Option<&'static Kind> {
    ALL.iter().copied().find(|kind| kind.name == name)
}

/// A number as the user wrote it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrittenQuantity {
    /// The number before the unit.
    pub(crate) number: f64,
    /// The unit; `None` means SI.
    pub(crate) unit: Option<&'static NamedUnit>,
    /// Whether the unit is per second.
    pub(crate) per_second: bool,
}

impl WrittenQuantity {
    /// The measure of its unit; `None` for a plain number.
    fn measure(&self) -> Option<Measure> {
        self.unit.map(|unit| Measure::per(unit.unit, self.per_second))
    }

    /// The number in SI.
    pub(crate) fn si(&self) -> f64 {
        self.number * self.unit.map_or(1.0, |unit| unit.si)
    }
}

impl fmt::Display for WrittenQuantity {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}{}", self.number, self.unit.map_or("", |unit| unit.symbol))?;
        if self.per_second { write!(out, "/s") } else { Ok(()) }
    }
}

/// The argument of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Argument {
    /// A number with or without a unit.
    Quantity(WrittenQuantity),
    /// A word, e.g. a file name.
    Word(String),
}

/// One term of a signal: a kind with its arguments, checked as far as possible without the input's unit.
#[derive(Clone)]
pub(crate) struct Term {
    /// The kind of signal.
    pub(crate) kind: &'static Kind,
    /// One entry per declared parameter.
    arguments: Vec<Option<Argument>>,
}

impl Term {
    /// The given arguments, with the names of their parameters.
    pub(crate) fn arguments(&self) -> impl Iterator<Item = (&'static str, &Argument)> {
        let parameters = self.kind.parameters.iter();
        parameters.zip(&self.arguments).filter_map(|(p, a)| a.as_ref().map(|a| (p.name, a)))
    }

    fn build(&self, unit: Unit, duration_s: f64) -> Result<Piecewise, SignalError> {
        (self.kind.build)(&Given::new(self.kind, &self.arguments, unit, duration_s)?)
    }
}

impl PartialEq for Term {
    fn eq(&self, other: &Self) -> bool {
        self.kind.name == other.kind.name && self.arguments == other.arguments
    }
}

impl fmt::Debug for Term {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{self}")
    }
}

/// A sum of terms.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    terms: Vec<Term>,
}

impl Signal {
    /// The terms as ordered in the text.
    pub(crate) fn terms(&self) -> &[Term] {
        &self.terms
    }

    /// The names of the files that it reads.
    pub fn files(&self) -> Vec<String> {
        let arguments = self.terms.iter().flat_map(Term::arguments);
        let file = |(name, argument): (&str, &Argument)| match argument {
            Argument::Word(word) if name == table::FILE => Some(word.clone()),
            _ => None,
        };
        arguments.filter_map(file).collect()
    }

    /// The function of time for an input of this unit, from 0 to `duration_s`.
    ///
    /// # Errors
    /// A unit does not suit the input, or a value is out of range.
    pub fn build(&self, unit: Unit, duration_s: f64) -> Result<Piecewise, SignalError> {
        if !(duration_s > 0.0 && duration_s.is_finite()) {
            let message =
                format!("a run of {duration_s} s is impossible: greater than 0 is needed");
            return Err(SignalError::Invalid(message));
        }
        let mut sum = self.terms[0].build(unit, duration_s)?;
        for term in &self.terms[1..] {
            sum = sum.plus(&term.build(unit, duration_s)?)?;
        }
        Ok(sum)
    }
}

/// Help text: all kinds with parameters, units, ranges and an example.
pub fn help() -> String {
    let kinds = ALL.iter().map(|kind| kind.help());
    let units: Vec<&str> = units::usual().map(|unit| unit.symbol).collect();
    kinds.collect::<String>()
        + &format!(
            "Units: {} (rates with /s, e.g. deg/s); a number without a unit is in SI units.\n\
             Several signals joined by ' + ' are added. A number alone is a constant.\n",
            units.join(", ")
        )
}
