//! A jump from zero.

use super::error::SignalError;
use super::spec::{Fallback, Given, Kind, Parameter, Range, Sort, Spec};
use servotwin_model::signal::Piecewise;

/// A jump from zero.
pub struct Step;

static SPEC: Spec = Spec {
    kind: "step",
    summary: "a step from zero",
    example: "step:size=10deg,at=0.1s",
    continuous: false,
    parameters: &[
        Parameter {
            name: "size",
            sort: Sort::Value,
            range: Range::Any,
            fallback: Fallback::Required,
            summary: "the value after the step",
        },
        Parameter {
            name: "at",
            sort: Sort::Time,
            range: Range::NotNegative,
            // Later than the initial steady state, which would otherwise be the one after the jump.
            fallback: Fallback::Number(0.1),
            summary: "time of the step",
        },
    ],
};

impl Kind for Step {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn build(&self, given: &Given) -> Result<Piecewise, SignalError> {
        let (size, at_s) = (given.number("size"), given.number("at"));
        // A jump at time 0 still starts from rest: time −1 s precedes every run and keeps the first value at zero.
        let rest_s = if at_s > 0.0 { 0.0 } else { -1.0 };
        Ok(Piecewise::steps(&[rest_s, at_s], &[0.0, size])?)
    }
}
