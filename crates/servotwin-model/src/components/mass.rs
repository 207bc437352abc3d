//! A mass that moves on a line, with optional end stops and without gravity.
//!
//! ```text
//! dx/dt = v,   m dv/dt = F − b v                                          (M1)
//! ```
//!
//! The stops at ± x_s exist if their stiffness is not zero. They are those of the cylinder, (Y6).
//!
//! Source: Newton's second law.

use super::contact::{END_STOP_CONSTANTS, end_stop, end_stop_constants};
use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Category, declare::*};
use crate::wiring::{Output, Wiring};

parameters! {
    mass_kg: required((1e-6, 1e6), "mass"),
    viscous_friction_n_s_m: parameter(0.0, (0.0, 1e9), "friction per velocity"),
    stroke_half_m: parameter(1.0, (1e-6, 1e3), "distance x_s of each stop from zero"),
    stop_stiffness_n_m: parameter(0.0, (0.0, 1e12), "stiffness of the stops; 0 for none"),
    stop_damping_n_s_m: parameter(0.0, (0.0, 1e9), "damping of the stops"),
}

/// A mass on a line; see the module documentation.
pub(crate) static MASS: Component = Component {
    kind: "mass",
    summary: "mass on a line, with optional end stops",
    parameters: &PARAMETERS,
    faults: &[
        fault("added_mass", Category::Dynamics, "ice, dirt or water moves with it").scales(
            "mass_kg",
            2.0,
            (1.0, 100.0),
        ),
        fault("friction", Category::Friction, "the guide is dry or clamps").adds(
            "viscous_friction_n_s_m",
            1e4,
            (0.0, 1e9),
        ),
    ],
    ports: &[moving("port", "parts that move with the mass")],
    states: &[
        state("position_m", 2e-2, "position"),
        state("velocity_m_s", 0.05, "velocity").with_error_weight(VELOCITY_ERROR_WEIGHT),
    ],
    connect,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let position = wiring.state("position_m");
    let velocity = wiring.state("velocity_m_s");
    wiring.set_motion("port", position, velocity);
    let force = wiring.force("port");
    let rates = [wiring.derivative("position_m"), wiring.derivative("velocity_m_s")];
    wiring.equation(MassMotion, [velocity, force.variable()], rates.map(Output::add));
    if wiring.structural("stop_stiffness_n_m") > 0.0 {
        let inputs = [position, velocity];
        wiring.equation(MassStops, inputs, [Output::add(force)]);
    }
}

/// Equation (M1): (velocity, force) → rates of position and velocity.
pub(crate) struct MassMotion;

impl Equation<2, 2, 2> for MassMotion {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 2] {
        [given[index::viscous_friction_n_s_m], S::constant(1.0) / given[index::mass_kg]]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 2], [velocity, force]: [S; 2]) -> [S; 2] {
        [velocity, (force - velocity * c[0]) * c[1]]
    }
}

/// Equation (Y6): (position, velocity) → force on the mass.
pub(crate) struct MassStops;

impl Equation<2, 1, END_STOP_CONSTANTS> for MassStops {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; END_STOP_CONSTANTS] {
        end_stop_constants(
            given[index::stroke_half_m],
            given[index::stop_stiffness_n_m],
            given[index::stop_damping_n_s_m],
        )
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; END_STOP_CONSTANTS], [x, v]: [S; 2]) -> [S; 1] {
        [-end_stop(x, v, c)]
    }
}
