//! What can be wrong with a signal.

use super::ALL;
use super::spec::Range;
use crate::document::{Quantities, Quantity};
use crate::shown::Shown;
use crate::table::TableError;
use servotwin_model::signal::CurveError;
use servotwin_model::spec::Unit;
use std::borrow::Cow;
use std::fmt;

/// What is wrong with a signal.
#[derive(Debug)]
pub enum SignalError {
    /// There is no text, or nothing beside a ` + `.
    Empty,
    /// No such kind.
    UnknownKind {
        /// What was written.
        given: String,
    },
    /// A table of a study file names no kind.
    NoKind,
    /// No such parameter.
    UnknownParameter {
        /// The kind.
        kind: &'static str,
        /// What was written.
        given: String,
        /// The parameters it has.
        known: Vec<&'static str>,
    },
    /// Not of the form `name=value`.
    NoEqualSign {
        /// The kind.
        kind: &'static str,
        /// What was written.
        given: String,
    },
    /// A parameter was given twice.
    Repeated {
        /// The kind.
        kind: &'static str,
        /// The parameter.
        parameter: &'static str,
    },
    /// A parameter that must be given was not.
    Missing {
        /// The kind.
        kind: &'static str,
        /// The parameter.
        parameter: &'static str,
        /// A text that has it.
        example: &'static str,
    },
    /// A value that does not begin with a number.
    NotANumber {
        /// The kind.
        kind: &'static str,
        /// The parameter.
        parameter: &'static str,
        /// What was written.
        given: String,
    },
    /// A unit that the parameter cannot have.
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
    Impossible {
        /// The kind.
        kind: &'static str,
        /// What does not fit.
        reason: Cow<'static, str>,
    },
    /// A run's duration that is not positive and finite.
    Duration {
        /// The duration.
        duration_s: f64,
    },
    /// The numbers make no function of time.
    Curve(CurveError),
    /// A file of a recorded signal cannot be read.
    Table(Box<TableError>),
    /// A column is in another unit than the input.
    ColumnUnit {
        /// The column.
        column: String,
        /// The unit that its name tells.
        found: Unit,
        /// The unit of the input.
        wanted: Unit,
    },
    /// The signal leaves what its input may be.
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
    Rows {
        /// The file, with the line where there is one.
        place: String,
        /// What is wrong.
        error: CurveError,
    },
}

impl From<CurveError> for SignalError {
    fn from(error: CurveError) -> Self {
        SignalError::Curve(error)
    }
}

impl fmt::Display for SignalError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kinds = || ALL.iter().map(|k| k.spec().kind).collect::<Vec<_>>().join(", ");
        match self {
            SignalError::Empty => write!(out, "a signal is missing; known kinds: {}", kinds()),
            SignalError::UnknownKind { given } => {
                write!(out, "unknown kind of signal '{given}'; known: {}", kinds())
            }
            SignalError::NoKind => write!(out, "a signal needs 'kind'; known: {}", kinds()),
            SignalError::UnknownParameter { kind, given, known } => {
                write!(out, "{kind} has no parameter '{given}'; it has: {}", known.join(", "))
            }
            SignalError::NoEqualSign { kind, given } => {
                write!(out, "{kind}: '{given}' is not of the form name=value")
            }
            SignalError::Repeated { kind, parameter } => {
                write!(out, "{kind}: '{parameter}' is given twice")
            }
            SignalError::Missing { kind, parameter, example } => {
                write!(out, "{kind}: '{parameter}' is missing, e.g. {example}")
            }
            SignalError::NotANumber { kind, parameter, given } => {
                write!(out, "{kind}: '{parameter}' needs a number, not '{given}'")
            }
            SignalError::WrongUnit { kind, parameter, given, allowed } => {
                write!(out, "{kind}: '{parameter}={given}' has a wrong unit; allowed: ")?;
                allowed.iter().try_for_each(|unit| write!(out, "{unit}, "))?;
                write!(out, "a plain number (SI)")
            }
            SignalError::UnknownWord { kind, parameter, given, known } => {
                write!(out, "{kind}: '{parameter}' cannot be '{given}'; it is ")?;
                write!(out, "{}", known.join(" or "))
            }
            SignalError::OutOfRange { kind, parameter, given, range, units } => {
                write!(out, "{kind}: '{parameter}={given}' is out of range: {range}")?;
                if units.is_empty() { Ok(()) } else { write!(out, " ({units})") }
            }
            SignalError::Impossible { kind, reason } => write!(out, "{kind}: {reason}"),
            SignalError::Duration { duration_s } => {
                write!(out, "a run of {duration_s} s is impossible: greater than 0 is needed")
            }
            SignalError::Curve(error) => write!(out, "{error}"),
            SignalError::Table(error) => write!(out, "{error}"),
            SignalError::ColumnUnit { column, found, wanted } => {
                let (found, wanted) = (found.symbol(), wanted.symbol());
                write!(out, "column '{column}' is in {found}, the input is in ")?;
                write!(out, "{}", if wanted.is_empty() { "no unit" } else { wanted })
            }
            SignalError::Leaves { input, value, min, max, unit } => {
                let bounds = [min.abs(), max.abs()].into_iter().filter(|bound| bound.is_finite());
                let read = Shown::of(*unit, bounds.fold(0.0, f64::max));
                let [value, min, max] =
                    [*value, *min, *max].map(|si| in_six_digits(read.value(si)));
                let (value, range) =
                    (Quantity(value, read.symbol()), Quantities(min, max, read.symbol()));
                write!(out, "'{input}' becomes {value}, but allowed are {range}")
            }
            SignalError::Rows { place, error: CurveError::Order { before_s, time_s, .. } } => {
                write!(out, "{place}: time {time_s} s is not after {before_s} s before it")
            }
            SignalError::Rows { place, error } => write!(out, "{place}: {error}"),
        }
    }
}

fn in_six_digits(shown: f64) -> f64 {
    format!("{shown:.5e}").parse().unwrap_or(shown)
}

impl std::error::Error for SignalError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            SignalError::Curve(error) | SignalError::Rows { error, .. } => Some(error),
            SignalError::Table(error) => Some(error.as_ref()),
            _ => None,
        }
    }
}
