//! A jump from zero.

use super::error::SignalError;
use super::spec::{Fallback, Given, Parameter, Range, SignalKind, Sort, Spec};
use servotwin_model::signal::Piecewise;

/// A jump from zero.
pub(crate) struct StepSignal;

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
            fallback: Fallback::Number(0.1),
            summary: "time of the step",
        },
    ],
};

impl SignalKind for StepSignal {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn build(&self, given: &Given) -> Result<Piecewise, SignalError> {
        let (size, at_s) = (given.number("size"), given.number("at"));
        // A step at time zero starts from the steady state before it. A point at −1 s, before every run, keeps the first
        // value at zero.
        let rest_s = if at_s > 0.0 { 0.0 } else { -1.0 };
        Ok(Piecewise::steps(&[rest_s, at_s], &[0.0, size])?)
    }
}
