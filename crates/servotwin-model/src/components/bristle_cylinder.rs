//! A double-acting cylinder whose seals stick as bristles do (LuGre's law).
//!
//! ```text
//! g(v) = F_c [1 + (κ − 1) e^{−(v/v_st)²}]                                  (BC1)
//! z'   = v − σ_0 |v| z/g(v)                                                (BC2)
//! F_f  = B (μ/μ_r) v + n (σ_0 z + σ_1 z')                                  (BC3)
//! ```
//!
//! All else is that of [`super::cylinder`], also `n`, the pressures' load on the seals. `z` is the mean deflection of
//! the bristles. While the rod slides, `z` tends to `g/σ_0` and the friction to `n g`. Below that, the
//! seal is a spring: the rod holds instead of creeping, and turns back with a hysteresis. With `κ` = 1 and
//! `σ_1` = 0 this is Dahl's law. `friction_smoothing_m_s` has no effect. Parameters of the cylinder, faults and ports are
//! the same, so that one kind can stand for the other.
//!
//! Source: the LuGre model as in Olsson 1998, with Dahl's model as its special case.

use super::cylinder::{
    FAULTS, PARAMETERS as SHARED, PORTS, STATES, check_volumes, connect_all_but_friction, index,
    seal_friction, seal_load, seal_load_constants, travel_m,
};
use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Parameter, State, declare::*};
use crate::wiring::{Output, Wiring};
use alloc::string::String;

/// The cylinder's parameters come first, at the same positions.
const STIFFNESS: usize = SHARED.len();
const DAMPING: usize = STIFFNESS + 1;

static PARAMETERS: [Parameter; DAMPING + 1] = with_more(
    SHARED,
    [
        parameter("bristle_stiffness_n_m", 1e7, (1e4, 1e10), "stiffness σ_0 of the bristles"),
        parameter("bristle_damping_n_s_m", 4.5e3, (0.0, 1e7), "damping σ_1 of the bristles"),
    ],
);

static ALL_STATES: [State; STATES.len() + 1] = {
    let [a, b, position, velocity] = STATES;
    let bristle = state("bristle_m", 1e-4, "deflection of the bristles");
    [a, b, position, velocity, bristle]
};

/// A double-acting cylinder with bristle friction; see the module documentation.
pub(crate) static BRISTLE_CYLINDER: Component = Component {
    kind: "bristle_cylinder",
    summary: "double-acting cylinder whose seals stick and yield (LuGre or Dahl)",
    parameters: &PARAMETERS,
    faults: &FAULTS,
    ports: &PORTS,
    states: &ALL_STATES,
    connect,
    check,
    travel_m,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let [velocity, p_a, p_b] = connect_all_but_friction(wiring);
    let inputs = [velocity, wiring.state("bristle_m"), p_a, p_b];
    let outputs = [
        wiring.rate("position_m"),
        wiring.rate("bristle_m"),
        Output::subtract(wiring.derivative("velocity_m_s")),
    ];
    wiring.equation(BristleFriction, inputs, outputs);
}

fn check(parameters: &[f64]) -> Result<(), String> {
    check_volumes(parameters)?;
    match parameters[index::coulomb_friction_n] > 0.0 {
        true => Ok(()),
        false => {
            Err("coulomb_friction_n must be above 0 N: bristles without friction never yield"
                .into())
        }
    }
}

/// Number of constants of [`BristleFriction`].
const BRISTLE_CONSTANTS: usize = 8;

/// Equations (BC1)–(BC3): (v, z, p_a, p_b) → (x', z', deceleration by friction).
pub(crate) struct BristleFriction;

impl Equation<4, 3, BRISTLE_CONSTANTS> for BristleFriction {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; BRISTLE_CONSTANTS] {
        let friction = seal_friction(given);
        let [per_pressure, rest] = seal_load_constants(given);
        let per_mass = S::constant(1.0) / given[index::mass_kg];
        [
            friction.viscous,
            friction.coulomb,
            friction.coulomb * (friction.static_ratio - S::constant(1.0)),
            S::constant(1.0) / friction.velocity,
            given[STIFFNESS] * per_mass,
            given[DAMPING] * per_mass,
            per_pressure,
            rest,
        ]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(
        &[viscous, coulomb, excess, per_stribeck, stiffness, damping, per_pressure, rest]: &[S::Base;
             BRISTLE_CONSTANTS],
        [v, z, p_a, p_b]: [S; 4],
    ) -> [S; 3] {
        let relative = v * per_stribeck;
        let level = (-(relative * relative)).exp() * excess + coulomb;
        let force = z * stiffness;
        let rate = v - v.abs() * force / level;
        let load = seal_load([p_a, p_b], [per_pressure, rest]);
        [v, rate, v * viscous + load * (force + rate * damping)]
    }
}

#[cfg(test)]
mod tests {
    use super::super::contract::constants;
    use super::*;

    /// Friction at a deflection that has settled at a velocity, N.
    fn sliding_n(velocity_m_s: f64) -> f64 {
        let changes = [("viscous_friction_n_s_m", 0.0)];
        let c = constants(BristleFriction, &BRISTLE_CYLINDER, &changes, 0);
        let (mut z, dt_s) = (0.0, 4e-6);
        for _ in 0..500_000 {
            z += dt_s * BristleFriction::evaluate(&c, [velocity_m_s, z, 1.06e7, 1.06e7])[1];
        }
        let mass_kg = 2.0;
        BristleFriction::evaluate(&c, [velocity_m_s, z, 1.06e7, 1.06e7])[2] * mass_kg
    }

    #[test]
    fn sliding_friction_is_stribecks_and_has_its_peak() {
        assert!((sliding_n(0.1) - 500.0).abs() < 0.5, "{}", sliding_n(0.1));
        let slow = 500.0 * (1.0 + 0.5 * (-0.04f64).exp());
        assert!((sliding_n(1e-3) / slow - 1.0).abs() < 1e-3, "{} {slow}", sliding_n(1e-3));
        assert_eq!(sliding_n(-0.1), -sliding_n(0.1));
    }

    #[test]
    fn a_rod_at_rest_is_held_by_a_spring() {
        let c = constants(BristleFriction, &BRISTLE_CYLINDER, &[], 0);
        let [_, rate, deceleration] = BristleFriction::evaluate(&c, [0.0, 2e-5, 1.06e7, 1.06e7]);
        assert_eq!(rate, 0.0);
        assert!((deceleration * 2.0 - 200.0).abs() < 1e-9, "1e7 N/m over 20 µm");
    }
}
