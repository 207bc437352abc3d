//! What can be wrong with a signal.

use super::ALL;
use super::spec::Range;
use crate::document::{Quantities, Quantity};
use crate::shown::Shown;
use crate::table::TableError;
use servotwin_model::signal::CurveError;
use servotwin_model::spec::Unit;
use std::borrow::Cow;

/// What is wrong with a signal.
#[derive(Debug, thiserror::Error)]
pub enum SignalError {
    /// There is no text, or nothing beside a ` + `.
    #[error("a signal is missing; known kinds: {}", kinds())]
    Empty,
    /// No such kind.
    #[error("unknown kind of signal '{given}'; known: {}", kinds())]
    UnknownKind {
        /// What was written.
        given: String,
    },
    /// A table of a study file names no kind.
    #[error("a signal needs 'kind'; known: {}", kinds())]
    NoKind,
    /// No such parameter.
    #[error("{kind} has no parameter '{given}'; it has: {}", .known.join(", "))]
    UnknownParameter {
        /// The kind.
        kind: &'static str,
        /// What was written.
        given: String,
        /// The parameters it has.
        known: Vec<&'static str>,
    },
    /// Not of the form `name=value`.
    #[error("{kind}: '{given}' is not of the form name=value")]
    NoEqualSign {
        /// The kind.
        kind: &'static str,
        /// What was written.
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
    /// A parameter that must be given was not.
    #[error("{kind}: '{parameter}' is missing, e.g. {example}")]
    Missing {
        /// The kind.
        kind: &'static str,
        /// The parameter.
        parameter: &'static str,
        /// A text that has it.
        example: &'static str,
    },
    /// A value that does not begin with a number.
    #[error("{kind}: '{parameter}' needs a number, not '{given}'")]
    NotANumber {
        /// The kind.
        kind: &'static str,
        /// The parameter.
        parameter: &'static str,
        /// What was written.
        given: String,
    },
    /// A unit that the parameter cannot have.
    #[error(
        "{kind}: '{parameter}={given}' has a wrong unit; allowed: {}a plain number (SI)",
        .allowed.iter().map(|unit| format!("{unit}, ")).collect::<String>()
    )]
    WrongUnit {
        /// The kind.
        kind: &'static str,
        /// The parameter.
        parameter: &'static str,
        /// What was written.
        given: String,
        /// The units it can have.
        allowed: Vec<String>,
    },
    /// A word that is none of those possible.
    #[error("{kind}: '{parameter}' cannot be '{given}'; it is {}", .known.join(" or "))]
    UnknownWord {
        /// The kind.
        kind: &'static str,
        /// The parameter.
        parameter: &'static str,
        /// What was written.
        given: String,
        /// The words possible.
        known: &'static [&'static str],
    },
    /// A value outside its range.
    #[error("{kind}: '{parameter}={given}' is out of range: {range}{}", in_brackets(.units))]
    OutOfRange {
        /// The kind.
        kind: &'static str,
        /// The parameter.
        parameter: &'static str,
        /// What was written.
        given: String,
        /// The range, SI.
        range: Range,
        /// The unit of the range, or nothing.
        units: &'static str,
    },
    /// Arguments that do not go together.
    #[error("{kind}: {reason}")]
    Impossible {
        /// The kind.
        kind: &'static str,
        /// What does not fit.
        reason: Cow<'static, str>,
    },
    /// A run's duration that is not positive and finite.
    #[error("a run of {duration_s} s is impossible: greater than 0 is needed")]
    Duration {
        /// The duration.
        duration_s: f64,
    },
    /// The numbers make no function of time.
    #[error(transparent)]
    Curve(#[from] CurveError),
    /// A file of a recorded signal cannot be read.
    #[error(transparent)]
    Table(Box<TableError>),
    /// A column is in another unit than the input.
    #[error(
        "column '{column}' is in {}, the input is in {}",
        .found.symbol(), symbol_or_none(*.wanted)
    )]
    ColumnUnit {
        /// The column.
        column: String,
        /// The unit that its name tells.
        found: Unit,
        /// The unit of the input.
        wanted: Unit,
    },
    /// The signal leaves what its input may be.
    #[error("'{input}' becomes {}", beyond(*.value, *.min, *.max, *.unit))]
    Leaves {
        /// The input.
        input: String,
        /// The value farthest outside, SI.
        value: f64,
        /// The least allowed.
        min: f64,
        /// The largest allowed.
        max: f64,
        /// The unit.
        unit: Unit,
    },
    /// The rows of a file make no function of time.
    #[error("{place}: {}", in_file(.error))]
    Rows {
        /// The file, with the line where there is one.
        place: String,
        /// What is wrong.
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

/// The place is known, so the number of the row is not repeated.
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
