//! A mode valve, which is active, or damped with the chambers joined through an orifice.
//!
//! ```text
//! m'   = (m_c − m)/τ,   m_c = m_0 + (m_1 − m_0) · command                  (M1)
//! m_e  = m + (1 − m) i                                                    (M2)
//! q_by = (1 − m) A_d v(p_A − p_B)                        a → b             (M3)
//! q_mk = A_k σ(Δp/Δp_k) v(Δp)                                              (M4)
//! q_k  = (1 − m) A_k σ(Δp/Δp_k) v(Δp)                                      (M5)
//! ```
//!
//! `m` is 1 when active and 0 when damped. `m_e` is the transmission, which multiplies the flows of the servo
//! valve, and `i` the leak of a closed valve. (M3) is the damping orifice, with `v` the velocity (O2) of
//! [`super::orifice`]. (M4) and (M5) are check valves that `σ`, the cubic step of [`crate::math::smooth_step`],
//! opens. The make-up valves (M4) lead from the return gallery into each chamber (Δp = p_return − p_chamber) in
//! either mode: they fill a chamber whose rod is pulled faster than the servo valve feeds it. In damped mode, the
//! reserve also fills the chambers, and the return gallery fills the reserve (M5). `m_0` and `m_1` are the
//! positions in which the valve comes to rest, 0 and 1 unless it is stuck.
//! Intermediate positions scale the areas linearly.
//!
//! Source: the orifice. The first order of `m`, and the areas linear in `m`, are the toolkit's own choice.

use super::orifice::{self, flow_m3_s, hole, scaled_velocity_pa_s_m};
use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::math::smooth_step;
use crate::scalar::Scalar;
use crate::spec::{Category, Start, Unit, declare::*};
use crate::wiring::{Output, Wiring};

parameters! {
    time_constant_s: parameter(0.02, (1e-4, 10.0), "time constant of switching"),
    damping_area_m2: parameter(2e-6, (0.0, 1e-3), "area of the damping orifice"),
    make_up_area_m2: parameter(1e-5, (0.0, 1e-3), "area of each make-up valve"),
    return_area_m2: parameter(1e-5, (0.0, 1e-3), "area of the valve from return to reserve"),
    make_up_range_pa: parameter(
        2e4,
        (1e2, 1e7),
        "pressure drop at which a check valve is fully open",
    ),
    isolation: parameter(0.002, (0.0, 1.0), "transmission when damped"),
    discharge_coefficient: orifice::discharge_coefficient(),
    transition_reynolds: orifice::transition_reynolds(),
    damped_position: parameter(0.0, (0.0, 1.0), "position at command 0"),
    active_position: parameter(1.0, (0.0, 1.0), "position at command 1"),
    command: parameter(1.0, (0.0, 1.0), "command if no signal is connected"),
}

/// A mode valve; see the module documentation.
pub(crate) static MODE_VALVE: Component =
    Component {
        kind: "mode_valve",
        summary: "active or damped: bypass orifice, make-up valves and reserve",
        parameters: &PARAMETERS,
        faults: &[
            fault("damping_clogging", Category::Clogging, "dirt narrows the damping orifice")
                .scales("damping_area_m2", 0.05, (0.0, 1.0)),
            fault("slow", Category::Dynamics, "switches slowly").shrinks(
                "time_constant_s",
                30.0,
                (1.0, 1e4),
            ),
            fault("stuck_active", Category::Jamming, "does not switch to damped").adds(
                "damped_position",
                1.0,
                (0.0, 1.0),
            ),
            fault("stuck_damped", Category::Jamming, "does not switch to active").scales(
                "active_position",
                0.0,
                (0.0, 1.0),
            ),
            fault("isolation_wear", Category::Wear, "leaks when damped").adds(
                "isolation",
                0.2,
                (0.0, 1.0),
            ),
        ],
        ports: &[
            hydraulic("a", "cylinder chamber A"),
            hydraulic("b", "cylinder chamber B"),
            hydraulic("reserve", "fluid reserve"),
            optional(hydraulic("return", "return gallery, which fills the reserve")),
            input_or("command", Unit::None, "command", "1 active, 0 damped"),
            output("active", Unit::None, "position: 1 active … 0 damped"),
            output("transmission", Unit::None, "factor on the flows of the servo valve"),
        ],
        states: &[state("position", 1.0, "1 active … 0 damped").from(Start::Parameter("command"))],
        connect,
        ..Component::PLAIN
    };

/// A check valve that acts only when damped.
fn reserve_valve(wiring: &mut Wiring, which: usize, up: &str, down: &str) {
    let inputs = [wiring.state("position"), wiring.pressure(up), wiring.pressure(down)];
    let flow = Output::transfer(wiring.flow(up), wiring.flow(down));
    wiring.equation_of(which, ReserveFlow, inputs, [flow]);
}

/// A check valve that acts in either mode.
fn make_up_valve(wiring: &mut Wiring, down: &str) {
    let inputs = [wiring.pressure("return"), wiring.pressure(down)];
    let flow = Output::transfer(wiring.flow("return"), wiring.flow(down));
    wiring.equation_of(index::make_up_area_m2, MakeUpFlow, inputs, [flow]);
}

fn connect(wiring: &mut Wiring) {
    let position = wiring.state("position");
    wiring.set("active", position);
    let command = wiring.signal("command");
    let rate = wiring.rate("position");
    wiring.equation(ModePosition, [command, position], [rate]);
    wiring.output("transmission", Transmission, [position]);
    let inputs = [position, wiring.pressure("a"), wiring.pressure("b")];
    let bypass = Output::transfer(wiring.flow("a"), wiring.flow("b"));
    wiring.equation(BypassFlow, inputs, [bypass]);
    reserve_valve(wiring, index::make_up_area_m2, "reserve", "a");
    reserve_valve(wiring, index::make_up_area_m2, "reserve", "b");
    if wiring.connected("return") {
        reserve_valve(wiring, index::return_area_m2, "return", "reserve");
        make_up_valve(wiring, "a");
        make_up_valve(wiring, "b");
    }
}

/// Equation (M1): (command, m) → m'.
pub(crate) struct ModePosition;

impl Equation<2, 1, 3> for ModePosition {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 3] {
        let damped = given[index::damped_position];
        [
            damped,
            given[index::active_position] - damped,
            S::constant(1.0) / given[index::time_constant_s],
        ]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 3], [command, m]: [S; 2]) -> [S; 1] {
        [(command * c[1] + c[0] - m) * c[2]]
    }
}

/// Equation (M2): (m) → transmission.
pub(crate) struct Transmission;

impl Equation<1, 1, 1> for Transmission {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 1] {
        [given[index::isolation]]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 1], [m]: [S; 1]) -> [S; 1] {
        [m + damped(m) * c[0]]
    }
}

/// `1 − m`, at least zero.
#[inline(always)]
fn damped<S: Scalar>(m: S) -> S {
    (S::constant(1.0) - m).max(S::constant(0.0))
}

/// Equation (M3): (m, p_a, p_b) → flow from a to b.
pub(crate) struct BypassFlow;

impl Equation<3, 1, 3> for BypassFlow {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 3] {
        hole(
            given[index::damping_area_m2],
            given[index::discharge_coefficient],
            given[index::transition_reynolds],
            given.fluid,
        )
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 3], [m, p_a, p_b]: [S; 3]) -> [S; 1] {
        [damped(m) * flow_m3_s(p_a - p_b, c)]
    }
}

/// The constants of a check valve. `which` is the index of the area's parameter.
fn check_valve_constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 4] {
    let [factor, r, four_k] = hole(
        given[given.which],
        given[index::discharge_coefficient],
        given[index::transition_reynolds],
        given.fluid,
    );
    [factor, r, four_k, S::constant(1.0) / given[index::make_up_range_pa]]
}

/// The flow through a check valve, which is closed at a negative drop, m³/s.
#[inline(always)]
fn check_valve_flow<S: Scalar>(c: &[S::Base; 4], up: S, down: S) -> S {
    let drop = (up - down).max(S::constant(0.0));
    let opening = smooth_step(drop * c[3]) * c[0];
    opening * scaled_velocity_pa_s_m(drop, S::from_base(c[1]), c[2])
}

/// Equation (M4): (p_return, p_chamber) → flow.
pub(crate) struct MakeUpFlow;

impl Equation<2, 1, 4> for MakeUpFlow {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 4] {
        check_valve_constants(given)
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 4], [up, down]: [S; 2]) -> [S; 1] {
        [check_valve_flow(c, up, down)]
    }
}

/// Equation (M5): (m, p_up, p_down) → flow.
pub(crate) struct ReserveFlow;

impl Equation<3, 1, 4> for ReserveFlow {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 4] {
        check_valve_constants(given)
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 4], [m, up, down]: [S; 3]) -> [S; 1] {
        [damped(m) * check_valve_flow(c, up, down)]
    }
}

#[cfg(test)]
mod tests {
    use super::super::contract::constants;
    use super::*;

    #[test]
    fn damping_resists_with_the_square_of_the_velocity() {
        let c = constants(BypassFlow, &MODE_VALVE, &[], 0);
        let area = 2.2723e-3;
        // Velocity in mm/s and force in N: the law without its laminar part.
        for (velocity, force) in [(10.0, 342.0), (30.0, 3070.0), (60.0, 12.3e3), (90.0, 27.7e3)] {
            let [flow] = BypassFlow::evaluate(&c, [0.0, 1e5 + force / area, 1e5]);
            let reached = flow / area * 1e3;
            let error: f64 = reached / velocity - 1.0;
            assert!(error.abs() < 0.08 && error < 0.0, "{reached} mm/s at {force} N");
        }
        assert_eq!(BypassFlow::evaluate(&c, [1.0, 2e7, 1e5]), [0.0]);
    }

    #[test]
    fn the_reserve_only_gives() {
        let c = constants(ReserveFlow, &MODE_VALVE, &[], index::make_up_area_m2);
        assert!(ReserveFlow::evaluate(&c, [0.0, 15e5, 14e5])[0] > 0.0);
        assert_eq!(ReserveFlow::evaluate(&c, [0.0, 15e5, 16e5])[0], 0.0);
        assert_eq!(ReserveFlow::evaluate(&c, [1.0, 15e5, 14e5])[0], 0.0);
    }

    #[test]
    fn the_return_line_fills_a_chamber_in_either_mode() {
        let c = constants(MakeUpFlow, &MODE_VALVE, &[], index::make_up_area_m2);
        assert!(MakeUpFlow::evaluate(&c, [6e5, 5e5])[0] > 0.0);
        assert_eq!(MakeUpFlow::evaluate(&c, [6e5, 7e5])[0], 0.0);
    }

    #[test]
    fn a_stuck_valve_stays() {
        let rate = |changes: &[(&str, f64)], inputs: [f64; 2]| {
            let c = constants(ModePosition, &MODE_VALVE, changes, 0);
            ModePosition::evaluate(&c, inputs)[0]
        };
        assert_eq!(rate(&[("damped_position", 1.0)], [0.0, 1.0]), 0.0);
        assert_eq!(rate(&[("active_position", 0.0)], [1.0, 0.0]), 0.0);
    }
}
