//! A value that does not change.

use super::error::SignalError;
use super::spec::{Fallback, Given, Parameter, Range, SignalKind, Sort, Spec};
use servotwin_model::signal::Piecewise;

/// A value that does not change.
pub(crate) struct Constant;

static SPEC: Spec = Spec {
    kind: "constant",
    summary: "a value that does not change",
    example: "constant:value=5deg",
    continuous: true,
    parameters: &[Parameter {
        name: "value",
        sort: Sort::Value,
        range: Range::Any,
        fallback: Fallback::Required,
        summary: "the value",
    }],
};

impl SignalKind for Constant {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn build(&self, given: &Given) -> Result<Piecewise, SignalError> {
        Ok(Piecewise::constant(given.number("value"))?)
    }
}
