//! A long line with the inertia, friction and stiffness of its fluid.
//!
//! ```text
//! q' = (p_a − p_b − Δp_f)/L_h,   L_h = ρ l/A                               (L1)
//! s' = E(s)/(A l) (q + Σq_b),   p_b = max(s, p_v)                          (L2)
//! Δp_f = R q [1 + σ(φ − 1)],     R = 128 ρ ν l/(π d⁴)                       (L3)
//! φ  = 0.3164 Re^{3/4}/64,  Re = |q| d/(A ν),  σ = step((Re − 2300)/1700)    (L4)
//! ```
//!
//! The line is one section, with its inertia at `a` and its whole capacitance at `b`. The first mode is
//! `1/(2π √(L_h C_h))`, and the model is valid well below it. Friction follows Hagen–Poiseuille up to
//! Re = 2300, and Blasius for smooth pipes from 4000 to 1e5. The cubic step of [`crate::math::smooth_step`]
//! joins these two textbook laws for steady flow. Below the vapor pressure `p_v`, the state `s` is the size
//! of the cavity at `b` (equations (F4)–(F6) of [`crate::fluid`]): the column separates there, and rejoins
//! when the cavity is filled.
//!
//! Source: Hagen and Poiseuille for laminar flow, Blasius 1913 for turbulent flow; one lumped section of
//! inertia, resistance and capacitance.

use super::volume::fluid_pressure;
use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::fluid::{BULK_CONSTANTS, pressure_rate_pa_s};
use crate::math::{power, smooth_step};
use crate::scalar::{Scalar, lit};
use crate::spec::{Category, Spec, Start, Unit, declare::*};
use crate::wiring::{Output, Wiring};

/// A long line; see the module documentation.
pub struct LongLine;

parameters! {
    length_m: required(Unit::Metre, (1e-2, 1e3), "length"),
    diameter_m: required(Unit::Metre, (1e-4, 1.0), "inner diameter"),
    start_pa: parameter(Unit::Pascal, 1e7, (1e3, 1e8), "first guess for the steady state"),
}

static SPEC: Spec = Spec {
    kind: "long_line",
    summary: "line with inertia, friction and compressible fluid",
    parameters: &PARAMETERS,
    faults: &[scales(
        "clogging",
        "diameter_m",
        0.3,
        (0.01, 1.0),
        Category::Clogging,
        "deposits narrow the whole line",
    )],
    ports: &[
        hydraulic("a", "end with the inertia"),
        pressure("b", "end with the capacitance, which sets the pressure"),
    ],
    states: &[
        state("flow_m3_s", Unit::CubicMetrePerSecond, 2e-4, Start::Value(0.0), "flow from a to b"),
        pressure_state("pressure_pa", "start_pa", "pressure at b, absolute"),
    ],
    reference: false,
};

impl Component for LongLine {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn connect(&self, wiring: &mut Wiring) {
        let flow = wiring.state("flow_m3_s");
        let state = wiring.state("pressure_pa");
        let pressure = fluid_pressure(wiring, "pressure_pa");
        wiring.set("b", pressure);
        let inputs = [wiring.pressure("a"), pressure, flow];
        let outputs = [
            Output::add(wiring.derivative("flow_m3_s")),
            Output::transfer(wiring.flow("a"), wiring.flow("b")),
        ];
        wiring.equation::<LineFlow, 3, 2, 3>(0, inputs, outputs);
        let into = wiring.flow("b").variable();
        let rate = Output::add(wiring.derivative("pressure_pa"));
        wiring.equation::<LinePressure, 2, 1, 7>(0, [state, into], [rate]);
    }
}

fn section_m2<S: Scalar<Base = S>>(diameter_m: S) -> S {
    diameter_m * diameter_m * S::constant(core::f64::consts::FRAC_PI_4)
}

/// Equations (L1), (L3) and (L4): (p_a, p_b, q) → (q', q).
pub struct LineFlow;

impl Equation<3, 2, 3> for LineFlow {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 3] {
        let (length, diameter) = (given[index::length_m], given[index::diameter_m]);
        let area = section_m2(diameter);
        let viscosity = given.fluid.kinematic_viscosity_m2_s;
        let density = given.fluid.density_kg_m3;
        let square = diameter * diameter;
        let resistance = S::constant(128.0 / core::f64::consts::PI) * density * viscosity * length
            / (square * square);
        let reynolds_per_flow = diameter / (area * viscosity);
        let per_inertia = area / (density * length);
        [per_inertia, resistance, reynolds_per_flow]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 3], [p_a, p_b, q]: [S; 3]) -> [S; 2] {
        let one = lit::<S>(1.0);
        let reynolds = (q.abs() * c[2]).max(S::constant(1.0));
        let turbulent = smooth_step((reynolds - lit::<S>(2300.0)) * lit::<S>(1.0 / 1700.0));
        let blasius = power(reynolds, lit::<S>(0.75)) * lit::<S>(0.3164 / 64.0);
        let friction = q * (turbulent * (blasius - one) + one) * c[1];
        [(p_a - p_b - friction) * c[0], q]
    }
}

/// Equation (L2): (s, flow into the line's fluid) → s'.
pub struct LinePressure;

impl Equation<2, 1, { 1 + BULK_CONSTANTS }> for LinePressure {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 1 + BULK_CONSTANTS] {
        let [a, b, c, d, e, f] = given.fluid.bulk.to_array();
        [section_m2(given[index::diameter_m]) * given[index::length_m], a, b, c, d, e, f]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 1 + BULK_CONSTANTS], [p, flow]: [S; 2]) -> [S; 1] {
        [pressure_rate_pa_s(&c[1..], p, flow, S::from_base(c[0]))]
    }
}

#[cfg(test)]
mod tests {
    use super::super::contract::constants;
    use super::*;
    use crate::fluid::Fluid;

    const LINE: &[(&str, f64)] = &[("length_m", 10.0), ("diameter_m", 8e-3)];

    #[test]
    fn ten_metres_ring_at_nineteen_hertz() {
        let c = constants::<LineFlow, 3, 2, 3>(&LongLine, LINE, 0);
        let [per_inertia, _] = LineFlow::evaluate(&c, [1.0, 0.0, 0.0]);
        assert!((1.0 / per_inertia / 1.96e8 - 1.0).abs() < 2e-3);
        let c = constants::<LinePressure, 2, 1, 7>(&LongLine, LINE, 0);
        let [per_capacitance] = LinePressure::evaluate(&c, [2e7, 1.0]);
        let hertz = libm::sqrt(per_inertia * per_capacitance) / (2.0 * core::f64::consts::PI);
        assert!((19.0..19.6).contains(&hertz), "{hertz}");
    }

    #[test]
    fn friction_is_that_of_the_textbook() {
        let c = constants::<LineFlow, 3, 2, 3>(&LongLine, LINE, 0);
        let fluid = Fluid::default().at(313.15);
        let density: f64 = fluid.density_kg_m3;
        let area = core::f64::consts::FRAC_PI_4 * 64e-6;
        for (reynolds, factor) in [(1000.0, 0.064), (2300.0, 64.0 / 2300.0), (1e4, 0.03164)] {
            let velocity = reynolds * fluid.kinematic_viscosity_m2_s / 8e-3;
            let expected = factor * 10.0 / 8e-3 * 0.5 * density * velocity * velocity;
            let [rate, _] = LineFlow::evaluate(&c, [0.0, 0.0, velocity * area]);
            let drop = -rate * density * 10.0 / area;
            assert!((drop / expected - 1.0).abs() < 1e-9, "{drop} instead of {expected}");
        }
    }
}
