//! A flow meter in a line with a 4–20 mA output, and its input in the computer.
//!
//! ```text
//! Δp = R q + K q|q|                                                       as (F1)
//! dq_m/dt = 2π f (q − q_m)                                                (FS1)
//! i = i(x) of (C2),   x = (q_m + q_FS)/(2 q_FS)                            (FS2)
//! reading = 2 q_FS x'(i) − q_FS,   x'(i) of (C3)                           (FS3)
//! ```
//!
//! The meter measures both directions: 12 mA is no flow. It resists the flow as a [`super::filter`] does.
//! The conversions are those of [`super::conversion`]. Leakage past the meter and the dead zone of a turbine at
//! small flows are left out.
//!
//! Source: the current loop of IEC 60381-1. The first order is usual for turbine and gear meters, whose rotor follows
//! the flow.

use super::conversion;
use super::filter::FilterFlow;
use crate::component::{Component, MeasuringSpan};
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Category, Unit, declare::*};
use crate::wiring::{Output, Wiring};

// The resistances come first, where the equation of a filter reads them.
parameters! {
    resistance_pa_s_m3: parameter(1e7, (1.0, 1e16), "laminar resistance at 40 °C"),
    quadratic_pa_s2_m6: parameter(4e11, (0.0, 1e20), "turbulent resistance K"),
    full_scale_m3_s: parameter(5e-4, (1e-9, 1.0), "largest flow q_FS in either direction"),
    bandwidth_hz: parameter(30.0, (1e-3, 1e5), "corner frequency f of the meter"),
    bias_electrical: conversion::bias_electrical(),
    gain_electrical: conversion::gain_electrical(),
    bias_digital: conversion::bias_digital(),
    gain_digital: conversion::gain_digital(),
    noise_sigma: conversion::noise_sigma(),
    bits: conversion::bits(),
}

/// A flow meter; see the module documentation.
pub(crate) static FLOW_SENSOR: Component = Component {
    kind: "flow_sensor",
    summary: "flow meter in a line with a 4-20 mA output",
    parameters: &PARAMETERS,
    faults: &conversion::faults(fault("lag", Category::Lag, "worn bearing of the rotor").shrinks(
        "bandwidth_hz",
        0.005,
        (1e-5, 1.0),
    )),
    ports: &[
        hydraulic("a", "one side; a flow from here to b is positive"),
        hydraulic("b", "other side"),
        output("reading", Unit::CubicMetrePerSecond, "flow that the computer reads"),
        output("electrical", Unit::Ampere, "current of the loop"),
    ],
    states: &[state("metered_m3_s", 1e-3, "flow q_m that the meter shows")],
    connect,
    span,
    ..Component::PLAIN
};

fn span(parameters: &[f64]) -> Option<MeasuringSpan> {
    let full_scale = parameters[index::full_scale_m3_s];
    Some(MeasuringSpan { full_scale, range: 2.0 * full_scale })
}

fn connect(wiring: &mut Wiring) {
    let [p_a, p_b] = [wiring.pressure("a"), wiring.pressure("b")];
    let flow = Output::transfer(wiring.flow("a"), wiring.flow("b"));
    wiring.equation(FilterFlow, [p_a, p_b], [flow]);
    let metered = wiring.state("metered_m3_s");
    let rate = wiring.rate("metered_m3_s");
    wiring.equation(Metering, [p_a, p_b, metered], [rate]);
    let current = wiring.output("electrical", FlowToCurrent, [metered]);
    wiring.output("reading", CurrentToFlow, [current]);
}

/// Equation (FS1): (p_a, p_b, metered flow) → rate of the metered flow.
pub(crate) struct Metering;

impl Equation<3, 1, 3> for Metering {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 3] {
        let [laminar, quadratic] = FilterFlow::constants(given);
        [laminar, quadratic, given[index::bandwidth_hz] * S::constant(core::f64::consts::TAU)]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 3], [p_a, p_b, metered]: [S; 3]) -> [S; 1] {
        let [flow] = FilterFlow::evaluate(&[c[0], c[1]], [p_a, p_b]);
        [(flow - metered) * c[2]]
    }
}

/// The reading at 4 mA and the range from there to 20 mA.
fn low_and_range<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 2] {
    let full_scale = given[index::full_scale_m3_s];
    [-full_scale, full_scale * S::constant(2.0)]
}

/// Equation (FS2): metered flow → current.
pub(crate) struct FlowToCurrent;

impl Equation<1, 1, 2> for FlowToCurrent {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 2] {
        let factor = conversion::factor(given, index::gain_electrical);
        let [low, range] = low_and_range(given);
        conversion::to_current_constants(factor, given[index::bias_electrical], low, range)
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 2], [metered]: [S; 1]) -> [S; 1] {
        [conversion::to_current_a(metered, c[0], c[1])]
    }
}

/// Equation (FS3): current → reading.
pub(crate) struct CurrentToFlow;

impl Equation<1, 1, 2> for CurrentToFlow {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 2] {
        let factor = conversion::factor(given, index::gain_digital);
        let [low, range] = low_and_range(given);
        conversion::from_current_constants(factor, given[index::bias_digital], low, range)
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 2], [current]: [S; 1]) -> [S; 1] {
        [current * c[0] + c[1]]
    }
}
