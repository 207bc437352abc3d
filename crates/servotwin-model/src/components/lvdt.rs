//! A displacement sensor (LVDT) with ratio demodulation, and its input in the
//! computer.
//!
//! ```text
//! u = ½ clamp((1 + g_e) x/x_FS + b_e, −1.25, 1.25)                         (D1)
//! dy/dt = ω z,   dz/dt = ω (u − y − 2ζ z),   ω = 2π f                       (D2)
//! reading = x_FS ((1 + g_d) 2y + b_d)                                      (D3)
//! ```
//!
//! `y` is the ratio (V_a − V_b)/(V_a + V_b), ±0.5 at full scale, and `z` its rate per unit of ω. The faults
//! are those of [`super::conversion`].
//!
//! Source: demodulators form the ratio of difference and sum. The second order is usual.

use super::conversion;
use crate::component::{Component, MeasuringSpan};
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Category, Unit, declare::*};
use crate::wiring::{Output, Wiring};

parameters! {
    full_scale_m: required((1e-6, 10.0), "range ±x_FS"),
    bandwidth_hz: parameter(160.0, (1e-3, 1e5), "natural frequency f"),
    damping_ratio: parameter(0.6, (0.05, 5.0), "damping ratio ζ of the demodulator"),
    bias_electrical: conversion::bias_electrical(),
    gain_electrical: conversion::gain_electrical(),
    bias_digital: conversion::bias_digital(),
    gain_digital: conversion::gain_digital(),
    noise_sigma: conversion::noise_sigma(),
    bits: conversion::bits(),
}

/// A displacement sensor; see the module documentation.
pub(crate) static LVDT: Component = Component {
    kind: "lvdt",
    summary: "displacement sensor with ratio demodulation",
    parameters: &PARAMETERS,
    faults: &conversion::faults(fault("lag", Category::Lag, "slow demodulation").shrinks(
        "bandwidth_hz",
        0.005,
        (1e-5, 1.0),
    )),
    ports: &[
        input("position", Unit::Metre, "measured displacement"),
        output("reading", Unit::Metre, "position that the computer reads"),
        output("electrical", Unit::None, "voltage ratio"),
    ],
    states: &[
        state("ratio", 0.5, "voltage ratio y"),
        state("ratio_rate", 0.5, "rate z of the ratio, per unit of ω"),
    ],
    connect,
    span,
    ..Component::PLAIN
};

fn span(parameters: &[f64]) -> Option<MeasuringSpan> {
    Some(MeasuringSpan {
        full_scale: parameters[index::full_scale_m],
        range: 2.0 * parameters[index::full_scale_m],
    })
}

fn connect(wiring: &mut Wiring) {
    let ratio = wiring.state("ratio");
    wiring.set("electrical", ratio);
    let inputs = [wiring.signal("position"), ratio, wiring.state("ratio_rate")];
    let rates = [wiring.derivative("ratio"), wiring.derivative("ratio_rate")];
    wiring.equation(PositionToRatio, inputs, rates.map(Output::add));
    wiring.output("reading", RatioToPosition, [ratio]);
}

/// Equations (D1) and (D2): (position, ratio, its rate) → their rates.
pub(crate) struct PositionToRatio;

impl Equation<3, 2, 4> for PositionToRatio {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 4] {
        let half = S::constant(0.5);
        [
            conversion::factor(given, index::gain_electrical) * half / given[index::full_scale_m],
            given[index::bias_electrical] * half,
            given[index::bandwidth_hz] * S::constant(core::f64::consts::TAU),
            given[index::damping_ratio] * S::constant(2.0),
        ]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 4], [position, ratio, rate]: [S; 3]) -> [S; 2] {
        let half = position * c[0] + c[1];
        let target = half.clamp(S::constant(-0.625), S::constant(0.625));
        [rate * c[2], (target - ratio - rate * c[3]) * c[2]]
    }
}

/// Equation (D3): ratio → reading.
pub(crate) struct RatioToPosition;

impl Equation<1, 1, 2> for RatioToPosition {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 2] {
        let factor = conversion::factor(given, index::gain_digital) * S::constant(2.0);
        [
            given[index::full_scale_m] * factor,
            given[index::bias_digital] * given[index::full_scale_m],
        ]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 2], [ratio]: [S; 1]) -> [S; 1] {
        [ratio * c[0] + c[1]]
    }
}
