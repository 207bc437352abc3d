//! A displacement sensor (LVDT) with ratio demodulation, and its input in the
//! computer.
//!
//! ```text
//! u = ½ clamp((1 + g_e) x/x_FS + b_e, −1.25, 1.25)                         (D1)
//! dy/dt = ω z,   dz/dt = ω (u − y − 2ζ z),   ω = 2π f                       (D2)
//! reading = x_FS ((1 + g_d) 2y + b_d)                                      (D3)
//! ```
//!
//! `y` is the ratio (V_a − V_b)/(V_a + V_b), ±0.5 at full scale, `z` its rate
//! per unit of ω. Faults as in [`super::conversion`].
//!
//! Source: the ratio of difference and sum is how demodulators work; the second order is usual.

use super::conversion;
use crate::component::{Component, Span};
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Category, Spec, Start, Unit, declare::*};
use crate::wiring::{Output, Wiring};

/// See the module.
pub struct Lvdt;

const FULL_SCALE: usize = 0;
const BANDWIDTH: usize = 1;
const DAMPING: usize = 2;
const BIAS_ELECTRICAL: usize = 3;
const GAIN_ELECTRICAL: usize = 4;
const BIAS_DIGITAL: usize = 5;
const GAIN_DIGITAL: usize = 6;

static SPEC: Spec = Spec {
    kind: "lvdt",
    summary: "displacement sensor with ratio demodulation",
    parameters: &[
        required("full_scale_m", Unit::Metre, (1e-6, 10.0), "range ±x_FS"),
        parameter("bandwidth_hz", Unit::Hertz, 160.0, (1e-3, 1e5), "natural frequency f"),
        parameter("damping_ratio", Unit::None, 0.6, (0.05, 5.0), "of the demodulator, ζ"),
        conversion::BIAS_ELECTRICAL,
        conversion::GAIN_ELECTRICAL,
        conversion::BIAS_DIGITAL,
        conversion::GAIN_DIGITAL,
        conversion::NOISE_SIGMA,
        conversion::BITS,
    ],
    faults: &conversion::faults(shrinks(
        "lag",
        "bandwidth_hz",
        0.005,
        (1e-5, 1.0),
        Category::Lag,
        "slow demodulation",
    )),
    ports: &[
        input("position", Unit::Metre, "what it measures"),
        output("reading", Unit::Metre, "position as the computer has it"),
        output("electrical", Unit::None, "voltage ratio"),
    ],
    states: &[
        state("ratio", Unit::None, 0.5, Start::Value(0.0), "voltage ratio y"),
        state("ratio_rate", Unit::None, 0.5, Start::Value(0.0), "its rate per unit of ω, z"),
    ],
    reference: false,
};

impl Component for Lvdt {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn span(&self, parameters: &[f64]) -> Option<Span> {
        Some(Span { full_scale: parameters[FULL_SCALE], range: 2.0 * parameters[FULL_SCALE] })
    }

    fn connect(&self, wiring: &mut Wiring) {
        let ratio = wiring.state("ratio");
        wiring.set("electrical", ratio);
        let inputs = [wiring.signal("position"), ratio, wiring.state("ratio_rate")];
        let rates = [wiring.derivative("ratio"), wiring.derivative("ratio_rate")];
        wiring.equation::<PositionToRatio, 3, 2, 4>(0, inputs, rates.map(Output::add));
        let reading = wiring.internal();
        wiring.equation::<RatioToPosition, 1, 1, 2>(0, [ratio], [Output::add(reading)]);
        wiring.set("reading", reading.variable());
    }
}

/// Equations (D1) and (D2): (position, ratio, its rate) → their rates.
pub struct PositionToRatio;

impl Equation<3, 2, 4> for PositionToRatio {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 4] {
        let half = S::constant(0.5);
        [
            conversion::factor(given, GAIN_ELECTRICAL) * half / given[FULL_SCALE],
            given[BIAS_ELECTRICAL] * half,
            given[BANDWIDTH] * S::constant(core::f64::consts::TAU),
            given[DAMPING] * S::constant(2.0),
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
pub struct RatioToPosition;

impl Equation<1, 1, 2> for RatioToPosition {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 2] {
        let factor = conversion::factor(given, GAIN_DIGITAL) * S::constant(2.0);
        [given[FULL_SCALE] * factor, given[BIAS_DIGITAL] * given[FULL_SCALE]]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 2], [ratio]: [S; 1]) -> [S; 1] {
        [ratio * c[0] + c[1]]
    }
}
