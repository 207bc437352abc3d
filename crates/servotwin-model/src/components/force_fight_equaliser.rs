//! Balances the forces of two, three or four actuators on one surface.
//!
//! ```text
//! two actuators:    d_i = p_Ai − p_Bi
//! dz/dt = [m_1 m_2 (d_1 − d_2) − z]/τ                                        (Q1)
//! x_corr = clamp(K z/2, −x_max, x_max),   −x_corr to 1, +x_corr to 2         (Q2)
//!
//! three or four actuators, each compared with the mean of the other active ones:
//! dz_i/dt = [m_i Σ_j m_j (d_i − d_j)/max(Σ_j m_j, 1) − z_i]/τ,   j ≠ i        (Q3)
//! x_corr,i = −clamp(K z_i/2, −x_max, x_max)                                  (Q4)
//! ```
//!
//! `m_i` are the modes (1 active). The correction of a passive actuator fades, and the others no longer
//! follow its pressures. For two actuators, (Q3) and (Q4) are (Q1) and (Q2).
//!
//! The kind states the number of actuators: `force_fight_equaliser` has two, `force_fight_equaliser_3` three,
//! and `force_fight_equaliser_4` four.
//!
//! Source: the toolkit's own choice, the simplest law that removes a lasting force fight. Comparing filtered
//! differential pressures is usual.

use super::gain::{gain_high, gain_low};
use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Unit, declare::*};
use crate::wiring::{Output, Variable, Wiring};

parameters! {
    gain_m_pa: parameter(2.5e-10, (0.0, 1e-6), "gain K"),
    time_constant_s: parameter(0.3, (1e-4, 1e3), "filter τ"),
    limit_m: parameter(0.8e-3, (0.0, 1.0), "authority x_max"),
    mode_1: parameter(1.0, (0.0, 1.0), "mode of actuator 1: 1 active, 0 passive"),
    mode_2: parameter(1.0, (0.0, 1.0), "mode of actuator 2: 1 active, 0 passive"),
}

/// The equalizer of two actuators; see the module documentation.
pub(crate) static FORCE_FIGHT_EQUALISER: Component = Component {
    kind: "force_fight_equaliser",
    summary: "balances the forces of two actuators on one surface",
    parameters: &PARAMETERS,
    faults: &[gain_low("gain_m_pa"), gain_high("gain_m_pa")],
    ports: &[
        input("pressure_a_1", Unit::Pascal, "measured p_A of actuator 1"),
        input("pressure_b_1", Unit::Pascal, "measured p_B of actuator 1"),
        input("pressure_a_2", Unit::Pascal, "measured p_A of actuator 2"),
        input("pressure_b_2", Unit::Pascal, "measured p_B of actuator 2"),
        input_or("mode_1", Unit::None, "mode_1", "mode of actuator 1: 1 active, 0 passive"),
        input_or("mode_2", Unit::None, "mode_2", "mode of actuator 2: 1 active, 0 passive"),
        output("correction_1", Unit::Metre, "correction for the controller of actuator 1"),
        output("correction_2", Unit::Metre, "correction for the controller of actuator 2"),
    ],
    states: &[state("difference_pa", 2e7, "filtered difference z of the differential pressures")],
    connect: connect_two,
    ..Component::PLAIN
};

fn connect_two(wiring: &mut Wiring) {
    let difference = wiring.internal();
    let first = ["pressure_a_1", "pressure_b_1"].map(|p| wiring.signal(p));
    let second = ["pressure_a_2", "pressure_b_2"].map(|p| wiring.signal(p));
    wiring.equation(PressureDifference, first, [Output::add(difference)]);
    wiring.equation(PressureDifference, second, [Output::subtract(difference)]);
    let state = wiring.state("difference_pa");
    let [mode_1, mode_2] = ["mode_1", "mode_2"].map(|p| wiring.signal(p));
    let inputs = [difference.variable(), mode_1, mode_2, state];
    let rate = wiring.rate("difference_pa");
    wiring.equation(FightFilter, inputs, [rate]);
    let [to_1, to_2] = [wiring.internal(), wiring.internal()];
    wiring.equation(FightCorrection, [state], [Output::transfer(to_1, to_2)]);
    wiring.set("correction_1", to_1.variable());
    wiring.set("correction_2", to_2.variable());
}

/// Declares the equalizer of more than two actuators.
macro_rules! equaliser {
    (
        $component:ident, $kind:literal, $words:literal, $block:ident, $actuators:literal, $inputs:literal,
        [$($n:literal),*]
    ) => {
        /// An equalizer of more than two actuators; see the module documentation.
        pub(crate) static $component: Component = Component {
            kind: $kind,
            summary: concat!("balances the forces of ", $words, " actuators on one surface"),
            // The first three parameters are those of two actuators, at the same positions.
            parameters: &{
                let [gain, time_constant, limit, ..] = PARAMETERS;
                [
                    gain,
                    time_constant,
                    limit,
                    $(parameter(
                        concat!("mode_", $n),
                        1.0,
                        (0.0, 1.0),
                        concat!("mode of actuator ", $n, ": 1 active, 0 passive"),
                    ),)*
                ]
            },
            faults: &[gain_low("gain_m_pa"), gain_high("gain_m_pa")],
            ports: &[
                $(
                    input(
                        concat!("pressure_a_", $n),
                        Unit::Pascal,
                        concat!("measured p_A of actuator ", $n),
                    ),
                    input(
                        concat!("pressure_b_", $n),
                        Unit::Pascal,
                        concat!("measured p_B of actuator ", $n),
                    ),
                )*
                $(input_or(
                    concat!("mode_", $n),
                    Unit::None,
                    concat!("mode_", $n),
                    concat!("mode of actuator ", $n, ": 1 active, 0 passive"),
                ),)*
                $(output(
                    concat!("correction_", $n),
                    Unit::Metre,
                    concat!("correction for the controller of actuator ", $n),
                ),)*
            ],
            states: &[$(state(
                concat!("difference_", $n, "_pa"),
                2e7,
                concat!("filtered difference z_", $n, " of actuator ", $n, " and the others"),
            ),)*],
            connect: |wiring| {
                let differences = [$(difference(
                    wiring,
                    [concat!("pressure_a_", $n), concat!("pressure_b_", $n)],
                )),*];
                let modes = [$(wiring.signal(concat!("mode_", $n))),*];
                let names = [$((concat!("difference_", $n, "_pa"), concat!("correction_", $n))),*];
                for (own, (z, correction)) in names.into_iter().enumerate() {
                    let state = wiring.state(z);
                    // The actuator's own inputs come first, then those of the others, and z comes last.
                    let turned = |k: usize| (own + k) % $actuators;
                    let inputs = core::array::from_fn(|k| match k {
                        k if k < $actuators => differences[turned(k)],
                        k if k < 2 * $actuators => modes[turned(k - $actuators)],
                        _ => state,
                    });
                    let rate = wiring.rate(z);
                    wiring.equation_of(own, $block, inputs, [rate]);
                    let to = wiring.internal();
                    let output = [Output::subtract(to)];
                    wiring.equation_of(own, FightCorrection, [state], output);
                    wiring.set(correction, to.variable());
                }
            },
            ..Component::PLAIN
        };

        /// Equation (Q3): (differences, modes, z), the actuator's own first → rate of its z.
        pub(crate) struct $block;

        impl Equation<$inputs, 1, 1> for $block {
            fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 1] {
                [S::constant(1.0) / given[index::time_constant_s]]
            }

            #[inline(always)]
            fn evaluate<S: Scalar>(c: &[S::Base; 1], inputs: [S; $inputs]) -> [S; 1] {
                let (differences, others) = inputs.split_at($actuators);
                let (modes, z) = others.split_at($actuators);
                let mut fight = S::constant(0.0);
                let mut active = S::constant(0.0);
                for other in 1..$actuators {
                    fight = fight + modes[other] * (differences[0] - differences[other]);
                    active = active + modes[other];
                }
                let against_mean = modes[0] * fight / active.max(S::constant(1.0));
                [(against_mean - z[0]) * c[0]]
            }
        }
    };
}

equaliser!(
    FORCE_FIGHT_EQUALISER_3,
    "force_fight_equaliser_3",
    "three",
    FightOfThree,
    3,
    7,
    [1, 2, 3]
);
equaliser!(
    FORCE_FIGHT_EQUALISER_4,
    "force_fight_equaliser_4",
    "four",
    FightOfFour,
    4,
    9,
    [1, 2, 3, 4]
);

/// Wires the pressure difference d of an actuator from its two ports.
fn difference(wiring: &mut Wiring, ports: [&str; 2]) -> Variable {
    let difference = wiring.internal();
    let pressures = ports.map(|port| wiring.signal(port));
    wiring.equation(PressureDifference, pressures, [Output::add(difference)]);
    difference.variable()
}

/// (p_A, p_B) → p_A − p_B.
pub(crate) struct PressureDifference;

impl Equation<2, 1, 0> for PressureDifference {
    #[inline(always)]
    fn evaluate<S: Scalar>(_: &[S::Base; 0], [p_a, p_b]: [S; 2]) -> [S; 1] {
        [p_a - p_b]
    }
}

/// Equation (Q1): (difference, modes, z) → rate of z.
pub(crate) struct FightFilter;

impl Equation<4, 1, 1> for FightFilter {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 1] {
        [S::constant(1.0) / given[index::time_constant_s]]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 1], [raw, mode_1, mode_2, z]: [S; 4]) -> [S; 1] {
        [(raw * (mode_1 * mode_2) - z) * c[0]]
    }
}

/// Equation (Q2): z → correction.
pub(crate) struct FightCorrection;

impl Equation<1, 1, 2> for FightCorrection {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 2] {
        [given[index::gain_m_pa] * S::constant(0.5), given[index::limit_m]]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 2], [z]: [S; 1]) -> [S; 1] {
        let limit = S::from_base(c[1]);
        [(z * c[0]).clamp(-limit, limit)]
    }
}

#[cfg(test)]
mod tests {
    use super::super::contract::constants;
    use super::*;

    fn rate_pa_s(differences: [f64; 3], modes: [f64; 3]) -> f64 {
        let c = constants(FightOfThree, &FORCE_FIGHT_EQUALISER_3, &[], 0);
        let ([a, b, d], [k, l, m]) = (differences, modes);
        FightOfThree::evaluate(&c, [a, b, d, k, l, m, 0.0])[0] * 0.3
    }

    #[test]
    fn an_actuator_is_compared_with_the_mean_of_the_others_that_are_active() {
        let near = |value: f64, expected: f64| assert!((value - expected).abs() < 1e-6, "{value}");
        near(rate_pa_s([6e5, 1e5, 3e5], [1.0; 3]), 4e5);
        near(rate_pa_s([6e5, 1e5, 3e5], [1.0, 1.0, 0.0]), 5e5);
        near(rate_pa_s([6e5, 1e5, 3e5], [0.0, 1.0, 1.0]), 0.0);
        near(rate_pa_s([6e5, 1e5, 3e5], [1.0, 0.0, 0.0]), 0.0);
        near(rate_pa_s([2e5, 2e5, 2e5], [1.0; 3]), 0.0);
    }
}
