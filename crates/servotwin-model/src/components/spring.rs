//! A spring with a damper between a moving part and the ground.
//!
//! ```text
//! F = F_0 − k x − c v                                                     (S1)
//! ```
//!
//! Source: Hooke's law, and a linear damper.

use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Category, declare::*};
use crate::wiring::{Output, Wiring};

parameters! {
    stiffness_n_m: required((0.0, 1e12), "stiffness"),
    damping_n_s_m: parameter(0.0, (0.0, 1e9), "damping"),
    preload_n: parameter(0.0, (-1e9, 1e9), "force on the part at x = 0"),
}

/// A spring with a damper; see the module documentation.
pub(crate) static SPRING: Component = Component {
    kind: "spring",
    summary: "spring and damper to the ground",
    parameters: &PARAMETERS,
    faults: &[fault("stiffness_loss", Category::Looseness, "broken coils").shrinks(
        "stiffness_n_m",
        0.1,
        (1e-6, 1.0),
    )],
    ports: &[translational("port", "part that the spring pushes")],
    connect,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let motion = [wiring.position("port"), wiring.velocity("port")];
    let force = Output::subtract(wiring.force("port"));
    wiring.equation(Spreading, motion, [force]);
}

/// Equation (S1) with the opposite sign: (position, velocity) → force that opposes it.
pub(crate) struct Spreading;

impl Equation<2, 1, 3> for Spreading {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 3] {
        [given[index::stiffness_n_m], given[index::damping_n_s_m], given[index::preload_n]]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 3], [position, velocity]: [S; 2]) -> [S; 1] {
        [position * c[0] + velocity * c[1] - c[2]]
    }
}
