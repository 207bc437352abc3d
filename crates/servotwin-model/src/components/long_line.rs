//! A long line with the inertia, friction and stiffness of its fluid.
//!
//! ```text
//! q_1' = (p_a − p_m − Δp_f)/L_1,   q_2' = (p_m − p_b − Δp_f)/L_2            (L1)
//! s_m' = E(s_m)/V_m (q_1 − q_2),   s_b' = E(s_b)/V_b (q_2 + Σq_b)           (L2)
//! L_1 = ρ l/(3A), L_2 = 2 L_1,   V_m = 2 A l/3, V_b = A l/3,   p = max(s, p_v)
//! Δp_f = R_i q [1 + σ(φ − 1)],   R_i = 128 ρ ν l_i/(π d⁴)                    (L3)
//! φ  = 0.3164 Re^{3/4}/64,  Re = |q| d/(A ν),  σ = step((Re − 2300)/1700)    (L4)
//! ```
//!
//! The pressure of the line is known at a third of its length and at `b`. Each of the two holds the fluid up to the middle
//! between them: two thirds and one third. With a constant pressure at `a` and a closed end `b`, the first mode is
//! 1.5 c/(2π l), 4.5 % below the quarter wave c/(4 l) of a line whose waves travel with c. The model is valid below it;
//! the pressure rise of a sudden closure, ρ c v, is overshot by up to 47 %. Friction follows Hagen–Poiseuille up to
//! Re = 2300, and Blasius for smooth pipes from 4000 to 1e5. The cubic step of [`crate::math::smooth_step`]
//! joins these two textbook laws for steady flow. Below the vapor pressure `p_v`, the state `s` is the size
//! of the cavity there (equations (F4)–(F6) of [`crate::fluid`]): the column separates there, and rejoins
//! when the cavity is filled.
//!
//! Source: Hagen and Poiseuille for laminar flow, Blasius 1913 for turbulent flow; a finite volume around each pressure,
//! with the inertia and resistance between them.

use super::volume::fluid_pressure;
use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::fluid::{BULK_CONSTANTS, pressure_rate_pa_s};
use crate::math::{power, smooth_step};
use crate::scalar::{Scalar, lit};
use crate::spec::{Category, declare::*};
use crate::wiring::{Output, Wiring};

/// Shares of the line: its length in the sections from `a` on, its volume in the middle and at `b`.
const LENGTHS: [f64; 2] = [1.0 / 3.0, 2.0 / 3.0];
const VOLUMES: [f64; 2] = [2.0 / 3.0, 1.0 / 3.0];

parameters! {
    length_m: required((1e-2, 1e3), "length"),
    diameter_m: required((1e-4, 1.0), "inner diameter"),
    start_pa: parameter(1e7, (1e3, 1e8), "first guess for the steady state"),
}

/// A long line; see the module documentation.
pub(crate) static LONG_LINE: Component = Component {
    kind: "long_line",
    summary: "line with inertia, friction and compressible fluid",
    parameters: &PARAMETERS,
    faults: &[fault("clogging", Category::Clogging, "deposits narrow the whole line").scales(
        "diameter_m",
        0.3,
        (0.01, 1.0),
    )],
    ports: &[
        hydraulic("a", "end with an inertia"),
        pressure("b", "end with a capacitance, which sets the pressure"),
    ],
    states: &[
        state("flow_m3_s", 2e-4, "flow into a"),
        state("flow_to_b_m3_s", 2e-4, "flow from the middle to b"),
        pressure_state("middle_pressure_pa", "start_pa", "pressure in the middle, absolute"),
        pressure_state("pressure_pa", "start_pa", "pressure at b, absolute"),
    ],
    connect,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let middle = fluid_pressure(wiring, "middle_pressure_pa");
    let end = fluid_pressure(wiring, "pressure_pa");
    wiring.set("b", end);
    let content = wiring.internal();
    let sections = [
        ("flow_m3_s", [wiring.pressure("a"), middle], wiring.flow("a"), content),
        ("flow_to_b_m3_s", [middle, end], content, wiring.flow("b")),
    ];
    for (which, (state, [up, down], from, to)) in sections.into_iter().enumerate() {
        let inputs = [up, down, wiring.state(state)];
        let outputs = [wiring.rate(state), Output::transfer(from, to)];
        wiring.equation_of(which, LineFlow, inputs, outputs);
    }
    let volumes = [("middle_pressure_pa", content), ("pressure_pa", wiring.flow("b"))];
    for (which, (state, into)) in volumes.into_iter().enumerate() {
        let inputs = [wiring.state(state), into.variable()];
        let rate = wiring.rate(state);
        wiring.equation_of(which, LinePressure, inputs, [rate]);
    }
}

fn section_m2<S: Scalar<Base = S>>(diameter_m: S) -> S {
    diameter_m * diameter_m * S::constant(core::f64::consts::FRAC_PI_4)
}

/// Equations (L1), (L3) and (L4): (p_a, p_b, q) → (q', q).
pub(crate) struct LineFlow;

impl Equation<3, 2, 3> for LineFlow {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 3] {
        let length = given[index::length_m] * S::constant(LENGTHS[given.which]);
        let diameter = given[index::diameter_m];
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
pub(crate) struct LinePressure;

impl Equation<2, 1, { 1 + BULK_CONSTANTS }> for LinePressure {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 1 + BULK_CONSTANTS] {
        let [a, b, c, d, e, f] = given.fluid.bulk.to_array();
        let volume = section_m2(given[index::diameter_m]) * given[index::length_m];
        [volume * S::constant(VOLUMES[given.which]), a, b, c, d, e, f]
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
    fn the_first_mode_is_that_of_a_quarter_wave() {
        let per_inertia = [0, 1].map(|which| {
            let c = constants(LineFlow, &LONG_LINE, LINE, which);
            LineFlow::evaluate(&c, [1.0, 0.0, 0.0])[0]
        });
        let per_capacitance = [0, 1].map(|which| {
            let c = constants(LinePressure, &LONG_LINE, LINE, which);
            LinePressure::evaluate(&c, [2e7, 1.0])[0]
        });
        // Inertia and capacitance are those of the whole line.
        let whole = |per: [f64; 2]| 1.0 / per[0] + 1.0 / per[1];
        let (inertia, capacitance) = (whole(per_inertia), whole(per_capacitance));
        assert!((inertia / 1.96e8 - 1.0).abs() < 2e-3);
        let quarter_wave_hz = 0.25 / libm::sqrt(inertia * capacitance);
        assert!((29.8..30.8).contains(&quarter_wave_hz), "{quarter_wave_hz}");
        // The squares of the angular frequencies solve λ² − sum λ + product = 0, with a at a constant pressure.
        let [l_1, l_2] = per_inertia;
        let [c_m, c_b] = per_capacitance;
        let sum = c_m * (l_1 + l_2) + c_b * l_2;
        let product = c_m * c_b * l_1 * l_2;
        let lowest = 0.5 * (sum - libm::sqrt(sum * sum - 4.0 * product));
        let hertz = libm::sqrt(lowest) / (2.0 * core::f64::consts::PI);
        assert!((hertz / quarter_wave_hz - 0.955).abs() < 1e-3, "{hertz} {quarter_wave_hz}");
    }

    #[test]
    fn friction_is_that_of_the_textbook() {
        let sections = [0, 1].map(|which| constants(LineFlow, &LONG_LINE, LINE, which));
        let fluid = Fluid::default().at(313.15);
        let density: f64 = fluid.density_kg_m3;
        let area = core::f64::consts::FRAC_PI_4 * 64e-6;
        for (reynolds, factor) in [(1000.0, 0.064), (2300.0, 64.0 / 2300.0), (1e4, 0.03164)] {
            let velocity = reynolds * fluid.kinematic_viscosity_m2_s / 8e-3;
            let expected = factor * 10.0 / 8e-3 * 0.5 * density * velocity * velocity;
            let drop = |which: usize| {
                let [rate, _] = LineFlow::evaluate(&sections[which], [0.0, 0.0, velocity * area]);
                -rate * density * 10.0 * LENGTHS[which] / area
            };
            let drop = drop(0) + drop(1);
            assert!((drop / expected - 1.0).abs() < 1e-9, "{drop} instead of {expected}");
        }
    }
}
