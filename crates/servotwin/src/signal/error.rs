//! Errors in signals.

use crate::shown::Shown;
use crate::table::TableError;
use crate::text::rounded;
use crate::toml_text::{NumberWithUnit, Quantities};
use servotwin_model::signal::CurveError;
use servotwin_model::spec::Unit;

/// Why a signal is invalid.
#[derive(Debug, thiserror::Error)]
pub enum SignalError {
    /// The text is no signal, or its arguments or their units are impossible for this input and run.
    #[error("{0}")]
    Invalid(String),
    /// The numbers do not define a function of time.
    #[error(transparent)]
    Curve(#[from] CurveError),
    /// The file of a recorded signal cannot be read.
    #[error(transparent)]
    Table(Box<TableError>),
    /// The rows of a file do not define a function of time.
    #[error("{place}: {}", in_file(.error))]
    #[expect(missing_docs, reason = "the message names its fields")]
    Rows {
        place: String,
        #[source]
        error: CurveError,
    },
}

impl SignalError {
    pub(super) fn new(message: impl Into<String>) -> Self {
        Self::Invalid(message.into())
    }

    /// A signal leaves the range of its input; all numbers are in SI, and shown in a unit that suits the range.
    pub(crate) fn leaves(input: &str, value: f64, (min, max): (f64, f64), unit: Unit) -> Self {
        let bounds = [min.abs(), max.abs()].into_iter().filter(|bound| bound.is_finite());
        let read = Shown::of(unit, bounds.fold(0.0, f64::max));
        let [value, min, max] = [value, min, max].map(|si| rounded(read.value(si), 6));
        let value = NumberWithUnit(value, read.symbol());
        let range = Quantities(min, max, read.symbol());
        Self::Invalid(format!("'{input}' becomes {value}, but allowed are {range}"))
    }
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
