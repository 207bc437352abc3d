//! Errors in signals.

use super::ALL;
use super::spec::Range;
use crate::document::{NumberWithUnit, Quantities};
use crate::shown::Shown;
use crate::table::TableError;
use servotwin_model::signal::CurveError;
use servotwin_model::spec::Unit;
use std::borrow::Cow;

/// Why a signal is invalid.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
pub enum SignalError {
    /// The text is empty, or nothing stands next to a ` + `.
    #[error("a signal is missing; known kinds: {}", kinds())]
    Empty,
    /// An unknown kind.
    #[error("unknown kind of signal '{given}'; known: {}", kinds())]
    UnknownKind { given: String },
    /// A table in a study file lacks the kind.
    #[error("a signal needs 'kind'; known: {}", kinds())]
    NoKind,
    /// An unknown parameter.
    #[error("{kind} has no parameter '{given}'; it has: {}", .known.join(", "))]
    UnknownParameter { kind: &'static str, given: String, known: Vec<&'static str> },
    /// An argument that is not of the form `name=value`.
    #[error("{kind}: '{given}' is not of the form name=value")]
    NoEqualSign { kind: &'static str, given: String },
    /// A parameter was given twice.
    #[error("{kind}: '{parameter}' is given twice")]
    Repeated { kind: &'static str, parameter: &'static str },
    /// A required parameter is missing.
    #[error("{kind}: '{parameter}' is missing, e.g. {example}")]
    Missing { kind: &'static str, parameter: &'static str, example: &'static str },
    /// A value does not begin with a number.
    #[error("{kind}: '{parameter}' needs a number, not '{given}'")]
    NotANumber { kind: &'static str, parameter: &'static str, given: String },
    /// A unit that does not suit the parameter.
    #[error(
        "{kind}: '{parameter}={given}' has a wrong unit; allowed: {}a plain number (SI)",
        .allowed.iter().map(|unit| format!("{unit}, ")).collect::<String>()
    )]
    WrongUnit { kind: &'static str, parameter: &'static str, given: String, allowed: Vec<String> },
    /// An unknown word.
    #[error("{kind}: '{parameter}' cannot be '{given}'; it is {}", .known.join(" or "))]
    UnknownWord {
        kind: &'static str,
        parameter: &'static str,
        given: String,
        known: &'static [&'static str],
    },
    /// A value outside the allowed range, which is in SI.
    #[error("{kind}: '{parameter}={given}' is out of range: {range}{}", in_brackets(.units))]
    OutOfRange {
        kind: &'static str,
        parameter: &'static str,
        given: String,
        range: Range,
        units: &'static str,
    },
    /// Arguments that are incompatible.
    #[error("{kind}: {reason}")]
    Impossible { kind: &'static str, reason: Cow<'static, str> },
    /// The duration of a run is not positive and finite.
    #[error("a run of {duration_s} s is impossible: greater than 0 is needed")]
    Duration { duration_s: f64 },
    /// The numbers do not define a function of time.
    #[error(transparent)]
    Curve(#[from] CurveError),
    /// The file of a recorded signal cannot be read.
    #[error(transparent)]
    Table(Box<TableError>),
    /// A column's unit differs from the input's.
    #[error(
        "column '{column}' is in {}, the input is in {}",
        .found.symbol(), symbol_or_none(*.wanted)
    )]
    ColumnUnit { column: String, found: Unit, wanted: Unit },
    /// The signal leaves the range of its input; the numbers are in SI, with their `unit`.
    #[error("'{input}' becomes {}", beyond(*.value, *.min, *.max, *.unit))]
    Leaves { input: String, value: f64, min: f64, max: f64, unit: Unit },
    /// The rows of a file do not define a function of time.
    #[error("{place}: {}", in_file(.error))]
    Rows {
        place: String,
        #[source]
        error: CurveError,
    },
}

fn kinds() -> String {
    ALL.iter().map(|k| k.spec().kind).collect::<Vec<_>>().join(", ")
}

fn in_brackets(units: &str) -> String {
    if units.is_empty() { String::new() } else { format!(" ({units})") }
}

fn symbol_or_none(unit: Unit) -> &'static str {
    if unit.symbol().is_empty() { "no unit" } else { unit.symbol() }
}

/// A value outside its range, in a unit that suits the range.
fn beyond(value: f64, min: f64, max: f64, unit: Unit) -> String {
    let bounds = [min.abs(), max.abs()].into_iter().filter(|bound| bound.is_finite());
    let read = Shown::of(unit, bounds.fold(0.0, f64::max));
    let [value, min, max] = [value, min, max].map(|si| in_six_digits(read.value(si)));
    let (value, range) =
        (NumberWithUnit(value, read.symbol()), Quantities(min, max, read.symbol()));
    format!("{value}, but allowed are {range}")
}

/// Omits the row number, because the place is already known.
fn in_file(error: &CurveError) -> String {
    match error {
        CurveError::Order { before_s, time_s, .. } => {
            format!("time {time_s} s is not after {before_s} s before it")
        }
        error => error.to_string(),
    }
}

fn in_six_digits(shown: f64) -> f64 {
    format!("{shown:.5e}").parse().unwrap_or(shown)
}
