//! A pressure transducer with a 4–20 mA output, and its input in the computer.
//!
//! ```text
//! di/dt = 2π f (i(p/p_FS) − i),   i(x) of (C2)                             (PS1)
//! reading = p_FS · x'(i),   x'(i) of (C3)                                  (PS2)
//! ```
//!
//! The conversions are those of [`super::conversion`]. The output is limited to
//! 0 … full scale.
//!
//! Source: the current loop of IEC 60381-1. The first order is usual for transducers.

use super::conversion;
use crate::component::{Component, MeasuringSpan};
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Category, Fault, Port, Start, State, Unit, declare::*};
use crate::wiring::{Variable, Wiring};

parameters! {
    // 5000 psi: chambers exceed a supply of 3000 psi, and a sensor at its end shows a constant.
    full_scale_pa: parameter(34.474e6, (1e3, 1e9), "range p_FS"),
    bandwidth_hz: parameter(125.0, (1e-3, 1e5), "corner frequency f"),
    bias_electrical: conversion::bias_electrical(),
    gain_electrical: conversion::gain_electrical(),
    bias_digital: conversion::bias_digital(),
    gain_digital: conversion::gain_digital(),
    noise_sigma: conversion::noise_sigma(),
    bits: conversion::bits(),
}

/// The faults of a transducer, with or without a tapping line.
pub(super) const FAULTS: [Fault; 9] =
    conversion::faults(fault("lag", Category::Lag, "clogged pressure tapping").shrinks(
        "bandwidth_hz",
        0.005,
        (1e-5, 1.0),
    ));

/// The ports of a transducer.
pub(super) const PORTS: [Port; 3] = [
    hydraulic("port", "node whose pressure it measures"),
    output("reading", Unit::Pascal, "pressure that the computer reads"),
    output("electrical", Unit::Ampere, "current of the loop"),
];

/// The current of the loop.
pub(super) const CURRENT: State =
    state("current_a", 20e-3, "current of the loop").from(Start::Value(conversion::ZERO_A));

/// A pressure transducer; see the module documentation.
pub(crate) static PRESSURE_SENSOR: Component = Component {
    kind: "pressure_sensor",
    summary: "pressure transducer with a 4-20 mA output",
    parameters: &PARAMETERS,
    faults: &FAULTS,
    ports: &PORTS,
    states: &[CURRENT],
    connect,
    span,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let pressure = wiring.pressure("port");
    connect_transducer(wiring, pressure);
}

/// The measuring span of a transducer.
pub(super) fn span(parameters: &[f64]) -> Option<MeasuringSpan> {
    let full_scale = parameters[index::full_scale_pa];
    Some(MeasuringSpan { full_scale, range: full_scale })
}

/// Wires a transducer that measures a pressure.
pub(super) fn connect_transducer(wiring: &mut Wiring, pressure: Variable) {
    let current = wiring.state("current_a");
    wiring.set("electrical", current);
    let rate = wiring.rate("current_a");
    wiring.equation(PressureToCurrent, [pressure, current], [rate]);
    wiring.output("reading", CurrentToPressure, [current]);
}

/// Equation (PS1): (pressure, current) → rate of the current.
pub(crate) struct PressureToCurrent;

impl Equation<2, 1, 3> for PressureToCurrent {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 3] {
        let factor = conversion::factor(given, index::gain_electrical);
        let (bias, zero) = (given[index::bias_electrical], S::constant(0.0));
        let [gain, offset] =
            conversion::to_current_constants(factor, bias, zero, given[index::full_scale_pa]);
        [gain, offset, given[index::bandwidth_hz] * S::constant(core::f64::consts::TAU)]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 3], [pressure, current]: [S; 2]) -> [S; 1] {
        [(conversion::to_current_a(pressure, c[0], c[1]) - current) * c[2]]
    }
}

/// Equation (PS2): current → reading.
pub(crate) struct CurrentToPressure;

impl Equation<1, 1, 2> for CurrentToPressure {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 2] {
        let factor = conversion::factor(given, index::gain_digital);
        let (bias, zero) = (given[index::bias_digital], S::constant(0.0));
        conversion::from_current_constants(factor, bias, zero, given[index::full_scale_pa])
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 2], [current]: [S; 1]) -> [S; 1] {
        [current * c[0] + c[1]]
    }
}
