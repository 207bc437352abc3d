//! A fluid temperature sensor with a 4–20 mA output, and its input in the
//! computer.
//!
//! ```text
//! dT_s/dt = (T − T_s)/τ                                                   (TS1)
//! i = i(x) of (C2),   x = (T_s − T_low)/(T_high − T_low)                   (TS2)
//! reading = T_low + (T_high − T_low) x'(i),   x'(i) of (C3)                (TS3)
//! ```
//!
//! `T_s` is the probe's own temperature. The conversions are those of
//! [`super::conversion`].
//!
//! Source: the current loop of IEC 60381-1. The first order is that of a body into which heat flows.

use super::conversion;
use crate::component::{Component, MeasuringSpan};
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Category, Start, Unit, declare::*};
use crate::wiring::Wiring;
use alloc::string::String;

parameters! {
    range_low_k: parameter(213.15, (100.0, 1000.0), "reading at 4 mA, T_low"),
    range_high_k: parameter(423.15, (100.0, 1000.0), "reading at 20 mA, T_high"),
    time_constant_s: parameter(5.0, (1e-4, 1e4), "time constant τ of the probe"),
    bias_electrical: conversion::bias_electrical(),
    gain_electrical: conversion::gain_electrical(),
    bias_digital: conversion::bias_digital(),
    gain_digital: conversion::gain_digital(),
    noise_sigma: conversion::noise_sigma(),
    bits: conversion::bits(),
}

/// A temperature sensor; see the module documentation.
pub(crate) static TEMPERATURE_SENSOR: Component = Component {
    kind: "temperature_sensor",
    summary: "fluid temperature sensor with a 4-20 mA output",
    parameters: &PARAMETERS,
    faults: &conversion::faults(fault("lag", Category::Lag, "deposit on the probe").shrinks(
        "time_constant_s",
        20.0,
        (1.0, 1e4),
    )),
    ports: &[
        hydraulic("port", "circuit whose temperature it measures"),
        output("reading", Unit::Kelvin, "temperature that the computer reads"),
        output("electrical", Unit::Ampere, "current of the loop"),
    ],
    states: &[state("probe_k", 100.0, "temperature T_s of the probe").from(Start::Value(313.15))],
    connect,
    check,
    span,
    ..Component::PLAIN
};

fn span(parameters: &[f64]) -> Option<MeasuringSpan> {
    let range = parameters[index::range_high_k] - parameters[index::range_low_k];
    Some(MeasuringSpan { full_scale: range, range })
}

fn connect(wiring: &mut Wiring) {
    let probe = wiring.state("probe_k");
    let inputs = [wiring.fluid_temperature(), probe];
    let rate = wiring.rate("probe_k");
    wiring.equation(Warming, inputs, [rate]);
    let current = wiring.output("electrical", TemperatureToCurrent, [probe]);
    wiring.output("reading", CurrentToTemperature, [current]);
}

fn check(parameters: &[f64]) -> Result<(), String> {
    if parameters[index::range_low_k] < parameters[index::range_high_k] {
        Ok(())
    } else {
        Err("range_low_k must be below range_high_k".into())
    }
}

/// Equation (TS1): (fluid, probe) → rate of the probe's temperature.
pub(crate) struct Warming;

impl Equation<2, 1, 1> for Warming {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 1] {
        [S::constant(1.0) / given[index::time_constant_s]]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 1], [fluid, probe]: [S; 2]) -> [S; 1] {
        [(fluid - probe) * c[0]]
    }
}

/// Equation (TS2): probe → current.
pub(crate) struct TemperatureToCurrent;

impl Equation<1, 1, 2> for TemperatureToCurrent {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 2] {
        let factor = conversion::factor(given, index::gain_electrical);
        let (low, range) =
            (given[index::range_low_k], given[index::range_high_k] - given[index::range_low_k]);
        conversion::to_current_constants(factor, given[index::bias_electrical], low, range)
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 2], [probe]: [S; 1]) -> [S; 1] {
        [conversion::to_current_a(probe, c[0], c[1])]
    }
}

/// Equation (TS3): current → reading.
pub(crate) struct CurrentToTemperature;

impl Equation<1, 1, 2> for CurrentToTemperature {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 2] {
        let factor = conversion::factor(given, index::gain_digital);
        let (low, range) =
            (given[index::range_low_k], given[index::range_high_k] - given[index::range_low_k]);
        conversion::from_current_constants(factor, given[index::bias_digital], low, range)
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 2], [current]: [S; 1]) -> [S; 1] {
        [current * c[0] + c[1]]
    }
}
