//! Balances the forces of two actuators on one surface.
//!
//! ```text
//! dz/dt = (m_1 m_2 [(p_A1 − p_B1) − (p_A2 − p_B2)] − z)/τ                    (Q1)
//! x_corr = clamp(K z/2, −x_max, x_max),   −x_corr to 1, +x_corr to 2         (Q2)
//! ```
//!
//! `m_1`, `m_2` are the modes (1 active): with one actuator passive the
//! correction fades.
//!
//! Source: the toolkit's own choice, as simple as takes a lasting force fight out; that filtered differential
//! pressures are compared is usual.

use super::gain::{gain_high, gain_low};
use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Spec, Start, Unit, declare::*};
use crate::wiring::{Output, Wiring};

/// See the module.
pub struct ForceFightEqualiser;

const GAIN: usize = 0;
const TIME: usize = 1;
const LIMIT: usize = 2;

static SPEC: Spec = Spec {
    kind: "force_fight_equaliser",
    summary: "balances the forces of two actuators on one surface",
    parameters: &[
        parameter("gain_m_pa", Unit::MetrePerPascal, 2.5e-10, (0.0, 1e-6), "gain K"),
        parameter("time_constant_s", Unit::Second, 0.3, (1e-4, 1e3), "filter τ"),
        parameter("limit_m", Unit::Metre, 0.8e-3, (0.0, 1.0), "authority x_max"),
        parameter("mode_1", Unit::None, 1.0, (0.0, 1.0), "actuator 1: 1 active"),
        parameter("mode_2", Unit::None, 1.0, (0.0, 1.0), "actuator 2: 1 active"),
    ],
    faults: &[gain_low("gain_m_pa"), gain_high("gain_m_pa")],
    ports: &[
        input("pressure_a_1", Unit::Pascal, "measured p_A of actuator 1"),
        input("pressure_b_1", Unit::Pascal, "measured p_B of actuator 1"),
        input("pressure_a_2", Unit::Pascal, "measured p_A of actuator 2"),
        input("pressure_b_2", Unit::Pascal, "measured p_B of actuator 2"),
        input_or("mode_1", Unit::None, "mode_1", "actuator 1: 1 active, 0 passive"),
        input_or("mode_2", Unit::None, "mode_2", "actuator 2: 1 active, 0 passive"),
        output("correction_1", Unit::Metre, "to the controller of actuator 1"),
        output("correction_2", Unit::Metre, "to the controller of actuator 2"),
    ],
    states: &[state(
        "difference_pa",
        Unit::Pascal,
        2e7,
        Start::Value(0.0),
        "filtered difference of the differential pressures, z",
    )],
    reference: false,
};

impl Component for ForceFightEqualiser {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn connect(&self, wiring: &mut Wiring) {
        let difference = wiring.internal();
        let first = ["pressure_a_1", "pressure_b_1"].map(|p| wiring.signal(p));
        let second = ["pressure_a_2", "pressure_b_2"].map(|p| wiring.signal(p));
        wiring.equation::<PressureDifference, 2, 1, 0>(0, first, [Output::add(difference)]);
        wiring.equation::<PressureDifference, 2, 1, 0>(0, second, [Output::subtract(difference)]);
        let state = wiring.state("difference_pa");
        let [mode_1, mode_2] = ["mode_1", "mode_2"].map(|p| wiring.signal(p));
        let inputs = [difference.variable(), mode_1, mode_2, state];
        let rate = Output::add(wiring.derivative("difference_pa"));
        wiring.equation::<FightFilter, 4, 1, 1>(0, inputs, [rate]);
        let [to_1, to_2] = [wiring.internal(), wiring.internal()];
        wiring.equation::<FightCorrection, 1, 1, 2>(0, [state], [Output::transfer(to_1, to_2)]);
        wiring.set("correction_1", to_1.variable());
        wiring.set("correction_2", to_2.variable());
    }
}

/// (p_A, p_B) → p_A − p_B.
pub struct PressureDifference;

impl Equation<2, 1, 0> for PressureDifference {
    fn constants<S: Scalar<Base = S>>(_: &Given<S>) -> [S; 0] {
        []
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(_: &[S::Base; 0], [p_a, p_b]: [S; 2]) -> [S; 1] {
        [p_a - p_b]
    }
}

/// Equation (Q1): (difference, modes, z) → rate of z.
pub struct FightFilter;

impl Equation<4, 1, 1> for FightFilter {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 1] {
        [S::constant(1.0) / given[TIME]]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 1], [raw, mode_1, mode_2, z]: [S; 4]) -> [S; 1] {
        [(raw * (mode_1 * mode_2) - z) * c[0]]
    }
}

/// Equation (Q2): z → correction.
pub struct FightCorrection;

impl Equation<1, 1, 2> for FightCorrection {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 2] {
        [given[GAIN] * S::constant(0.5), given[LIMIT]]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 2], [z]: [S; 1]) -> [S; 1] {
        let limit = S::from_base(c[1]);
        [(z * c[0]).clamp(-limit, limit)]
    }
}
