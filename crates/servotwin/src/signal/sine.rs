//! A sine in Hermite cubics.
//!
//! (SS1)  s(t) = A sin(2π (f (t − t_0) + φ/2π)),  t ≥ t_0; before t_0 its first value
//!
//! With `n` = 256 pieces per period the error is at most (2π/n)⁴/384 = 9.5e-10
//! of the amplitude.

use super::error::SignalError;
use super::spec::{Fallback::*, Given, Kind, Range::*, Sort::*, parameter};
use servotwin_model::math::sin_cos;
use servotwin_model::signal::Piecewise;
use std::f64::consts::TAU;

const PIECES_PER_PERIOD: f64 = 256.0;

pub(super) static SINE: Kind = Kind {
    name: "sine",
    summary: "a sine wave",
    example: "sine:amplitude=5deg,frequency=1Hz",
    parameters: &[
        parameter("amplitude", Value, Any, Required, "peak value"),
        parameter("frequency", Frequency, Between(1e-4, 1e3), Required, "oscillations per second"),
        parameter("phase", Angle, Any, Number(0.0), "angle at the start"),
        parameter("at", Time, NotNegative, Number(0.0), "start time"),
    ],
    build,
};

/// Sine and cosine of an angle in periods.
pub(super) fn sin_cos_of_periods(periods: f64) -> (f64, f64) {
    sin_cos(TAU * (periods - periods.round_ties_even()))
}

fn build(given: &Given) -> Result<Piecewise, SignalError> {
    let (amplitude, frequency_hz) = (given.number("amplitude"), given.number("frequency"));
    let (phase, at_s) = (given.number("phase") / TAU, given.number("at"));
    let per_second = frequency_hz * PIECES_PER_PERIOD;
    given.few_points(given.duration_s * per_second)?;
    let count = ((given.duration_s - at_s).max(0.0) * per_second).ceil() as usize + 1;
    let mut points = (vec![], vec![], vec![]);
    for k in 0..=count {
        let (sin, cos) = sin_cos_of_periods(phase + k as f64 / PIECES_PER_PERIOD);
        points.0.push(at_s + k as f64 / per_second);
        points.1.push(amplitude * sin);
        points.2.push(amplitude * TAU * frequency_hz * cos);
    }
    Ok(Piecewise::hermite(&points.0, &points.1, &points.2)?)
}
