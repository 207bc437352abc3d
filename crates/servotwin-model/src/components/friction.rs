//! Stribeck friction between a moving part and the ground.
//!
//! ```text
//! F = B v + F_c [1 + (r_s − 1) exp(−(v/v_s)²)] tanh(v/v_t)                 (R1)
//! ```
//!
//! `r_s` is the ratio of static to Coulomb friction. tanh regularizes the law: a force below the static
//! friction lets the part creep at up to about `v_t` instead of holding it.
//!
//! Source: the law of Stribeck as in Olsson 1998, where it is one of the static models. Replacing the sign
//! function by tanh is usual.

use super::contact::{STRIBECK_CONSTANTS, Stribeck, stribeck, stribeck_constants};
use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Category, declare::*};
use crate::wiring::{Output, Wiring};

parameters! {
    coulomb_friction_n: parameter(500.0, (0.0, 1e9), "dry friction F_c"),
    static_friction_ratio: parameter(1.5, (1.0, 10.0), "ratio r_s of static to dry friction"),
    stribeck_velocity_m_s: parameter(
        5e-3,
        (1e-6, 10.0),
        "velocity v_s at which static friction has faded",
    ),
    friction_smoothing_m_s: parameter(
        5e-3,
        (1e-6, 10.0),
        "velocity v_t over which friction changes its sign",
    ),
    viscous_friction_n_s_m: parameter(6e3, (0.0, 1e9), "friction B per velocity"),
}

/// Stribeck friction; see the module documentation.
pub(crate) static FRICTION: Component = Component {
    kind: "friction",
    summary: "Stribeck friction against the ground",
    parameters: &PARAMETERS,
    faults: &[
        fault("friction", Category::Friction, "swollen seals or dry bearings").scales(
            "coulomb_friction_n",
            10.0,
            (1.0, 100.0),
        ),
        fault("viscous", Category::Friction, "thickened grease").scales(
            "viscous_friction_n_s_m",
            10.0,
            (1.0, 100.0),
        ),
    ],
    ports: &[translational("port", "part that rubs")],
    connect,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let velocity = wiring.velocity("port");
    let force = Output::subtract(wiring.force("port"));
    wiring.equation(Rubbing, [velocity], [force]);
}

/// Equation (R1): velocity → force that opposes it.
pub(crate) struct Rubbing;

impl Equation<1, 1, STRIBECK_CONSTANTS> for Rubbing {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; STRIBECK_CONSTANTS] {
        stribeck_constants(Stribeck {
            viscous: given[index::viscous_friction_n_s_m],
            coulomb: given[index::coulomb_friction_n],
            static_ratio: given[index::static_friction_ratio],
            velocity: given[index::stribeck_velocity_m_s],
            smoothing: given[index::friction_smoothing_m_s],
        })
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; STRIBECK_CONSTANTS], [velocity]: [S; 1]) -> [S; 1] {
        [stribeck(velocity, S::constant(1.0), c)]
    }
}
