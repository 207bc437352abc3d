//! Errors of signals.

use super::ALL;
use super::spec::Range;
use crate::document::{Quantities, Quantity};
use crate::shown::Shown;
use crate::table::TableError;
use servotwin_model::signal::CurveError;
use servotwin_model::spec::Unit;
use std::borrow::Cow;

/// Why a signal is invalid.
#[derive(Debug, thiserror::Error)]
pub enum SignalError {
    /// The text or a term is empty.
    #[error("a signal is missing; known kinds: {}", kinds())]
    Empty,
    /// The kind does not exist.
    #[error("unknown kind of signal '{given}'; known: {}", kinds())]
    UnknownKind {
        /// The unknown kind.
        given: String,
    },
    /// A table of a study file names no kind.
    #[error("a signal needs 'kind'; known: {}", kinds())]
    NoKind,
    /// The kind has no such parameter.
    #[error("{kind} has no parameter '{given}'; it has: {}", .known.join(", "))]
    UnknownParameter {
        /// The kind.
        kind: &'static str,
        /// The unknown name.
        given: String,
        /// The kind's parameters.
        known: Vec<&'static str>,
    },
    /// An argument is not of the form `name=value`.
    #[error("{kind}: '{given}' is not of the form name=value")]
    NoEqualSign {
        /// The kind.
        kind: &'static str,
        /// The argument as written.
        given: String,
    },
    /// A parameter was given twice.
    #[error("{kind}: '{parameter}' is given twice")]
    Repeated {
        /// The kind.
        kind: &'static str,
        /// The parameter.
        parameter: &'static str,
    },
    /// A required parameter is missing.
    #[error("{kind}: '{parameter}' is missing, e.g. {example}")]
    Missing {
        /// The kind.
        kind: &'static str,
        /// The parameter.
        parameter: &'static str,
        /// An example text with it.
        example: &'static str,
    },
    /// A value does not begin with a number.
    #[error("{kind}: '{parameter}' needs a number, not '{given}'")]
    NotANumber {
        /// The kind.
        kind: &'static str,
        /// The parameter.
        parameter: &'static str,
        /// The value as written.
        given: String,
    },
    /// A value has a unit that does not suit the parameter.
    #[error(
        "{kind}: '{parameter}={given}' has a wrong unit; allowed: {}a plain number (SI)",
        .allowed.iter().map(|unit| format!("{unit}, ")).collect::<String>()
    )]
    WrongUnit {
        /// The kind.
        kind: &'static str,
        /// The parameter.
        parameter: &'static str,
        /// The value as written.
        given: String,
        /// The allowed units.
        allowed: Vec<String>,
    },
    /// A word is not one of the allowed ones.
    #[error("{kind}: '{parameter}' cannot be '{given}'; it is {}", .known.join(" or "))]
    UnknownWord {
        /// The kind.
        kind: &'static str,
        /// The parameter.
        parameter: &'static str,
        /// The word as written.
        given: String,
        /// The allowed words.
        known: &'static [&'static str],
    },
    /// A value is outside its range.
    #[error("{kind}: '{parameter}={given}' is out of range: {range}{}", in_brackets(.units))]
    OutOfRange {
        /// The kind.
        kind: &'static str,
        /// The parameter.
        parameter: &'static str,
        /// The value as written.
        given: String,
        /// The allowed range, SI.
        range: Range,
        /// The unit of the range, or empty.
        units: &'static str,
    },
    /// Arguments contradict each other.
    #[error("{kind}: {reason}")]
    Impossible {
        /// The kind.
        kind: &'static str,
        /// The contradiction.
        reason: Cow<'static, str>,
    },
    /// The duration of a run is not positive and finite.
    #[error("a run of {duration_s} s is impossible: greater than 0 is needed")]
    Duration {
        /// The duration, s.
        duration_s: f64,
    },
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
    ColumnUnit {
        /// The column.
        column: String,
        /// The unit given by the column's name.
        found: Unit,
        /// The unit of the input.
        wanted: Unit,
    },
    /// The signal leaves the range of its input.
    #[error("'{input}' becomes {}", beyond(*.value, *.min, *.max, *.unit))]
    Leaves {
        /// Name of the input.
        input: String,
        /// The value farthest outside, SI.
        value: f64,
        /// Smallest allowed value, SI.
        min: f64,
        /// Largest allowed value, SI.
        max: f64,
        /// The unit of these values.
        unit: Unit,
    },
    /// The rows of a file do not define a function of time.
    #[error("{place}: {}", in_file(.error))]
    Rows {
        /// The file, with the line if known.
        place: String,
        /// The error in the rows.
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

/// A value that leaves its range, in a unit that fits the range.
fn beyond(value: f64, min: f64, max: f64, unit: Unit) -> String {
    let bounds = [min.abs(), max.abs()].into_iter().filter(|bound| bound.is_finite());
    let read = Shown::of(unit, bounds.fold(0.0, f64::max));
    let [value, min, max] = [value, min, max].map(|si| in_six_digits(read.value(si)));
    let (value, range) = (Quantity(value, read.symbol()), Quantities(min, max, read.symbol()));
    format!("{value}, but allowed are {range}")
}

/// The error without the row number, because the message names the place already.
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
