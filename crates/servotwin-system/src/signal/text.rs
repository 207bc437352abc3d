//! The compact text of a signal: `kind:name=value,name=value + …`.

use super::error::SignalError;
use super::spec::{Fallback, Parameter, SignalKind, Sort, Spec, check_range, check_unit};
use super::{Argument, Measure, Signal, Term, WrittenQuantity, find, units};
use servotwin_model::spec::Unit;
use std::fmt;
use std::str::FromStr;

impl FromStr for Signal {
    type Err = SignalError;

    fn from_str(text: &str) -> Result<Self, SignalError> {
        let terms = split_terms(text).into_iter().map(|term| term_of(term.trim()));
        Ok(Self { terms: terms.collect::<Result<_, _>>()? })
    }
}

impl fmt::Display for Signal {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, term) in self.terms.iter().enumerate() {
            write!(out, "{}{term}", if index == 0 { "" } else { " + " })?;
        }
        Ok(())
    }
}

impl fmt::Display for Term {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}", self.kind.spec().kind)?;
        for (index, (name, argument)) in self.arguments().enumerate() {
            write!(out, "{}{name}={argument}", if index == 0 { ":" } else { "," })?;
        }
        Ok(())
    }
}

impl fmt::Display for Argument {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Argument::Quantity(quantity) => write!(out, "{quantity}"),
            Argument::Word(word) => write!(out, "{word}"),
        }
    }
}

/// Splits at each `+` that follows a space (the one in `1e+3` does not).
fn split_terms(text: &str) -> Vec<&str> {
    let mut terms = Vec::new();
    let mut begin = 0;
    for (place, _) in text.match_indices('+') {
        if text[..place].ends_with(char::is_whitespace) {
            terms.push(&text[begin..place]);
            begin = place + 1;
        }
    }
    terms.push(&text[begin..]);
    terms
}

fn term_of(text: &str) -> Result<Term, SignalError> {
    if text.is_empty() {
        return Err(SignalError::Empty);
    }
    let (kind, rest) = match text.split_once(':') {
        Some((kind, rest)) => (kind.trim(), rest),
        None if text.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c)) => {
            let mut builder = Builder::new("constant")?;
            builder.set("value", text)?;
            return builder.finish();
        }
        None => (text, ""),
    };
    let mut builder = Builder::new(kind)?;
    let arguments = rest.split(',').map(str::trim);
    for argument in arguments.filter(|_| !rest.trim().is_empty()) {
        let Some((name, value)) = argument.split_once('=') else {
            let kind = builder.kind.spec().kind;
            return Err(SignalError::NoEqualSign { kind, given: argument.into() });
        };
        builder.set(name.trim(), value.trim())?;
    }
    builder.finish()
}

/// Why a text is not a number with a unit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
pub enum QuantityError {
    /// The text does not begin with a finite number.
    #[error("'{given}' is not a number")]
    NotANumber { given: String },
    /// Its unit is not known.
    #[error("'{given}' has an unknown unit; known: {}", usual_units(Sort::Value).join(", "))]
    UnknownUnit { given: String },
    /// Its unit is not allowed.
    #[error("'{given}' has a wrong unit; allowed: {}", .allowed.join(", "))]
    WrongUnit { given: String, allowed: Vec<String> },
}

impl FromStr for WrittenQuantity {
    type Err = QuantityError;

    fn from_str(text: &str) -> Result<Self, QuantityError> {
        let exponent = |place: usize| {
            let next = text[place + 1..].chars().next();
            next.is_some_and(|c| c.is_ascii_digit() || c == '-' || c == '+')
        };
        let end = text.char_indices().find(|&(place, c)| match c {
            '0'..='9' | '.' | '-' | '+' => false,
            'e' | 'E' => !exponent(place),
            _ => true,
        });
        let (number, unit) = text.split_at(end.map_or(text.len(), |(place, _)| place));
        let not_a_number = || QuantityError::NotANumber { given: text.into() };
        let number = number.parse().ok().filter(|n: &f64| n.is_finite());
        let number = number.ok_or_else(not_a_number)?;
        match units::find(unit.trim()) {
            _ if unit.trim().is_empty() => {
                Ok(WrittenQuantity { number, unit: None, per_second: false })
            }
            Some((unit, per_second)) => {
                Ok(WrittenQuantity { number, unit: Some(unit), per_second })
            }
            None => Err(QuantityError::UnknownUnit { given: text.into() }),
        }
    }
}

impl WrittenQuantity {
    /// The SI value of a text, which must be in `unit` or a plain number.
    ///
    /// # Errors
    /// The text is not a number, or has another unit.
    pub fn in_unit(text: &str, unit: Unit) -> Result<f64, QuantityError> {
        let quantity: WrittenQuantity = text.parse()?;
        let measure = Measure::of(unit);
        match quantity.measure() {
            Some(found) if found != measure => {
                Err(QuantityError::WrongUnit { given: text.into(), allowed: measure.allowed() })
            }
            _ => Ok(quantity.si()),
        }
    }
}

/// A term under construction from names and values.
pub(super) struct Builder {
    kind: &'static dyn SignalKind,
    arguments: Vec<Option<Argument>>,
}

impl Builder {
    pub(crate) fn new(kind: &str) -> Result<Self, SignalError> {
        let found = find(kind).ok_or_else(|| SignalError::UnknownKind { given: kind.into() })?;
        Ok(Self { kind: found, arguments: vec![None; found.spec().parameters.len()] })
    }

    /// Sets an argument given as text.
    pub(crate) fn set(&mut self, name: &str, text: &str) -> Result<(), SignalError> {
        let place = self.free_place(name)?;
        let spec = self.kind.spec();
        let parameter = &spec.parameters[place];
        let argument = match parameter.sort {
            Sort::Text => Argument::Word(text.into()),
            Sort::Choice(words) => word(spec, parameter, text, words)?,
            _ => Argument::Quantity(checked_quantity(spec, parameter, text)?),
        };
        self.arguments[place] = Some(argument);
        Ok(())
    }

    fn free_place(&self, name: &str) -> Result<usize, SignalError> {
        let spec = self.kind.spec();
        let place = spec.parameter(name).ok_or_else(|| SignalError::UnknownParameter {
            kind: spec.kind,
            given: name.into(),
            known: spec.parameters.iter().map(|p| p.name).collect(),
        })?;
        match self.arguments[place] {
            None => Ok(place),
            Some(_) => Err(SignalError::Repeated {
                kind: spec.kind,
                parameter: spec.parameters[place].name,
            }),
        }
    }

    pub(crate) fn finish(self) -> Result<Term, SignalError> {
        let spec = self.kind.spec();
        for (parameter, argument) in spec.parameters.iter().zip(&self.arguments) {
            if argument.is_none() && parameter.fallback == Fallback::Required {
                return Err(SignalError::Missing {
                    kind: spec.kind,
                    parameter: parameter.name,
                    example: spec.example,
                });
            }
        }
        Ok(Term { kind: self.kind, arguments: self.arguments })
    }
}

fn word(
    spec: &Spec,
    parameter: &Parameter,
    text: &str,
    known: &'static [&'static str],
) -> Result<Argument, SignalError> {
    if known.contains(&text) {
        return Ok(Argument::Word(text.into()));
    }
    let (kind, parameter) = (spec.kind, parameter.name);
    Err(SignalError::UnknownWord { kind, parameter, given: text.into(), known })
}

/// Parses a quantity and checks its range, and its unit if that does not depend on the input.
fn checked_quantity(
    spec: &Spec,
    parameter: &Parameter,
    text: &str,
) -> Result<WrittenQuantity, SignalError> {
    let by_input = matches!(parameter.sort, Sort::Value | Sort::Rate);
    let measure = parameter.measure(Unit::None);
    let (kind, name) = (spec.kind, parameter.name);
    let quantity: WrittenQuantity = text.parse().map_err(|error| match error {
        QuantityError::NotANumber { given } => {
            SignalError::NotANumber { kind, parameter: name, given }
        }
        QuantityError::UnknownUnit { given } | QuantityError::WrongUnit { given, .. } => {
            let allowed = match measure {
                Some(measure) if !by_input => measure.allowed(),
                _ => usual_units(parameter.sort),
            };
            SignalError::WrongUnit { kind, parameter: name, given, allowed }
        }
    })?;
    if let Some(measure) = measure.filter(|_| !by_input) {
        check_unit(spec, parameter, &quantity, measure)?;
    }
    check_range(spec, parameter, &quantity)?;
    Ok(quantity)
}

/// The units of usual inputs, as a value or a rate.
fn usual_units(sort: Sort) -> Vec<String> {
    let end = if sort == Sort::Rate { "/s" } else { "" };
    units::usual().map(|unit| format!("{}{end}", unit.symbol)).collect()
}
