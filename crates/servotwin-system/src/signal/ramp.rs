//! A straight line from zero, to a value or to the end of the run.

use super::error::SignalError;
use super::spec::{Fallback, Given, Parameter, Range, SignalKind, Sort, Spec};
use servotwin_model::signal::Piecewise;

/// A straight line from zero.
pub(crate) struct Ramp;

static SPEC: Spec = Spec {
    kind: "ramp",
    summary: "a straight line from zero, to a value or to the end of the run",
    example: "ramp:rate=20deg/s,to=15deg",
    continuous: true,
    parameters: &[
        Parameter {
            name: "rate",
            sort: Sort::Rate,
            range: Range::Any,
            fallback: Fallback::Required,
            summary: "the slope, with the sign of 'to'",
        },
        Parameter {
            name: "to",
            sort: Sort::Value,
            range: Range::Any,
            fallback: Fallback::Without("it continues to the end of the run"),
            summary: "the value at which it stops",
        },
        Parameter {
            name: "at",
            sort: Sort::Time,
            range: Range::NotNegative,
            fallback: Fallback::Number(0.0),
            summary: "start time",
        },
    ],
};

impl SignalKind for Ramp {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn build(&self, given: &Given) -> Result<Piecewise, SignalError> {
        let (rate, at_s) = (given.number("rate"), given.number("at"));
        let Some(to) = given.optional("to") else {
            return Ok(Piecewise::new(vec![at_s], vec![[0.0, rate, 0.0, 0.0]])?);
        };
        if to == 0.0 {
            return Ok(Piecewise::constant(0.0)?);
        }
        let length_s = to / rate;
        if length_s <= 0.0 || !length_s.is_finite() {
            return Err(given.impossible("'rate' must not be zero and must have the sign of 'to'"));
        }
        Ok(Piecewise::linear(&[at_s, at_s + length_s], &[0.0, to])?)
    }
}
