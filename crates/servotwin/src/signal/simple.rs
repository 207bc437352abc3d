//! Signals of straight lines: a constant, a step and a ramp.

use super::error::SignalError;
use super::spec::{Fallback::*, Given, Kind, Range::*, Sort::*, parameter};
use servotwin_model::signal::Piecewise;

/// A value that does not change.
pub(super) static CONSTANT: Kind = Kind {
    name: "constant",
    summary: "a value that does not change",
    example: "constant:value=5deg",
    parameters: &[parameter("value", Value, Any, Required, "the value")],
    build: |given| Ok(Piecewise::constant(given.number("value"))?),
};

/// A jump from zero.
pub(super) static STEP: Kind = Kind {
    name: "step",
    summary: "a step from zero",
    example: "step:size=10deg,at=0.1s",
    parameters: &[
        parameter("size", Value, Any, Required, "the value after the step"),
        parameter("at", Time, NotNegative, Number(0.1), "time of the step"),
    ],
    build: |given| {
        let (size, at_s) = (given.number("size"), given.number("at"));
        // A step at time zero starts from the steady state before it. A point at −1 s, before every run, keeps the first
        // value at zero.
        let rest_s = if at_s > 0.0 { 0.0 } else { -1.0 };
        Ok(Piecewise::steps(&[rest_s, at_s], &[0.0, size])?)
    },
};

/// A straight line from zero.
pub(super) static RAMP: Kind = Kind {
    name: "ramp",
    summary: "a straight line from zero, to a value or to the end of the run",
    example: "ramp:rate=20deg/s,to=15deg",
    parameters: &[
        parameter("rate", Rate, Any, Required, "the slope, with the sign of 'to'"),
        parameter(
            "to",
            Value,
            Any,
            Without("it continues to the end of the run"),
            "the value at which it stops",
        ),
        parameter("at", Time, NotNegative, Number(0.0), "start time"),
    ],
    build: ramp,
};

fn ramp(given: &Given) -> Result<Piecewise, SignalError> {
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
