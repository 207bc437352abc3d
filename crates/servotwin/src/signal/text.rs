//! Signals as texts: `kind:name=value,name=value + …`. In a file a signal may also be a number, a constant in SI.

use super::error::SignalError;
use super::spec::{Fallback, Parameter, Sort};
use super::{ALL, Argument, Measure, Signal, Term, WrittenQuantity, find, units};
use crate::format::{Key, Read, Value};
use crate::toml_text::{Collector, Diagnostic, Entry};
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

impl Read for Signal {
    const VALUE: Value = Value::Signal;

    fn read(entry: &Entry, _key: Key, mistakes: &mut Collector) -> Option<Self> {
        let number = || entry.number().map(|number| number.to_string());
        let text = entry.text().map(str::to_owned).or_else(number);
        let text = mistakes.wanted(entry, text, "a signal: a text or a number")?;
        let note = |error: SignalError| {
            mistakes.note(&entry.value_at(), Diagnostic::new(error.to_string()));
        };
        text.parse().map_err(note).ok()
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
        write!(out, "{}", self.kind.name)?;
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

fn kinds() -> String {
    ALL.iter().map(|kind| kind.name).collect::<Vec<_>>().join(", ")
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
        return Err(SignalError::new(format!("a signal is missing; known kinds: {}", kinds())));
    }
    let is_number = text.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c));
    if is_number && !text.contains(':') {
        let mut term = Term::new("constant")?;
        term.set("value", text)?;
        return Ok(term);
    }
    let (kind, rest) = text.split_once(':').unwrap_or((text, ""));
    let mut term = Term::new(kind.trim())?;
    let arguments = rest.split(',').map(str::trim);
    for argument in arguments.filter(|_| !rest.trim().is_empty()) {
        let Some((name, value)) = argument.split_once('=') else {
            return Err(term.invalid(format!("'{argument}' is not of the form name=value")));
        };
        term.set(name.trim(), value.trim())?;
    }
    term.complete()
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
        let number = number.parse().ok().filter(|n: &f64| n.is_finite());
        let number = number.ok_or_else(|| QuantityError::NotANumber { given: text.into() })?;
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

impl Term {
    /// A term without arguments.
    fn new(kind: &str) -> Result<Self, SignalError> {
        let unknown =
            || SignalError::new(format!("unknown kind of signal '{kind}'; known: {}", kinds()));
        let kind = find(kind).ok_or_else(unknown)?;
        Ok(Self { kind, arguments: vec![None; kind.parameters.len()] })
    }

    fn invalid(&self, reason: String) -> SignalError {
        SignalError::Invalid(format!("{}: {reason}", self.kind.name))
    }

    /// Sets an argument given as text.
    fn set(&mut self, name: &str, text: &str) -> Result<(), SignalError> {
        let Some(place) = self.kind.parameter(name) else {
            let known: Vec<&str> = self.kind.parameters.iter().map(|p| p.name).collect();
            let (kind, known) = (self.kind.name, known.join(", "));
            let message = format!("{kind} has no parameter '{name}'; it has: {known}");
            return Err(SignalError::Invalid(message));
        };
        if self.arguments[place].is_some() {
            return Err(self.invalid(format!("'{name}' is given twice")));
        }
        let parameter = &self.kind.parameters[place];
        self.arguments[place] = Some(match parameter.sort {
            Sort::Choice(words) if !words.contains(&text) => {
                let known = words.join(" or ");
                return Err(self.invalid(format!("'{name}' cannot be '{text}'; it is {known}")));
            }
            Sort::Text | Sort::Choice(_) => Argument::Word(text.into()),
            _ => Argument::Quantity(self.checked_quantity(parameter, text)?),
        });
        Ok(())
    }

    /// Parses a quantity and checks its range, and its unit if that does not depend on the input.
    fn checked_quantity(
        &self,
        parameter: &Parameter,
        text: &str,
    ) -> Result<WrittenQuantity, SignalError> {
        let by_input = matches!(parameter.sort, Sort::Value | Sort::Rate);
        let measure = parameter.measure(Unit::None).filter(|_| !by_input);
        let quantity: WrittenQuantity = text.parse().map_err(|error| match error {
            QuantityError::NotANumber { given } => {
                self.invalid(format!("'{}' needs a number, not '{given}'", parameter.name))
            }
            QuantityError::UnknownUnit { given } | QuantityError::WrongUnit { given, .. } => {
                let usual = || usual_units(parameter.sort);
                let allowed = measure.map_or_else(usual, Measure::allowed);
                parameter.wrong_unit(self.kind, &given, &allowed)
            }
        })?;
        if let Some(measure) = measure {
            parameter.check_unit(self.kind, &quantity, measure)?;
        }
        parameter.check_range(self.kind, &quantity)?;
        Ok(quantity)
    }

    /// The term, if no required argument is missing.
    fn complete(self) -> Result<Self, SignalError> {
        let mut all = self.kind.parameters.iter().zip(&self.arguments);
        let lacks = |(parameter, argument): &(&Parameter, &Option<Argument>)| {
            argument.is_none() && parameter.fallback == Fallback::Required
        };
        if let Some((parameter, _)) = all.find(lacks) {
            let (name, example) = (parameter.name, self.kind.example);
            return Err(self.invalid(format!("'{name}' is missing, e.g. {example}")));
        }
        Ok(self)
    }
}

/// The units of usual inputs, as a value or a rate.
fn usual_units(sort: Sort) -> Vec<String> {
    let end = if sort == Sort::Rate { "/s" } else { "" };
    units::usual().map(|unit| format!("{}{end}", unit.symbol)).collect()
}
