//! An elastic joint with play between two moving parts.
//!
//! ```text
//! δ = x_a − x_b − δ_0,   d = δ − clamp(δ, −b, b)                           (T1)
//! w = min((|d| + ε)/(b/10 + ε), 1)                                         (T2)
//! F = k d + c w (v_a − v_b)                                               (T3)
//! ```
//!
//! `F` pulls `a` back and drives `b`. Inside the play ±b the force is zero, except for a share ε/(b/10 + ε)
//! of the damping (ε = 1 nm: a share of 2e-5 at 0.5 mm). Beyond contact, the damping fades in over a tenth of
//! the play, so the force does not jump. Without play, `w` is exactly one and the joint is exactly linear.
//!
//! Source: the dead zone of Nordin & Gutman 2002, with damping. The way the damping fades in, (T2), is the
//! toolkit's own choice.

use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Category, declare::*};
use crate::wiring::{Output, Wiring};

parameters! {
    stiffness_n_m: parameter(2e7, (0.0, 1e12), "stiffness"),
    damping_n_s_m: parameter(2e3, (0.0, 1e9), "damping"),
    backlash_m: parameter(0.0, (0.0, 0.1), "half of the play"),
    offset_m: parameter(0.0, (-1e3, 1e3), "x_a − x_b of the unloaded joint"),
}

/// An elastic joint; see the module documentation.
pub(crate) static ATTACHMENT: Component = Component {
    kind: "attachment",
    summary: "elastic joint with play between two moving parts",
    parameters: &PARAMETERS,
    faults: &[
        fault("backlash", Category::Looseness, "worn bearings of the rod end").adds(
            "backlash_m",
            0.5e-3,
            (0.0, 0.1),
        ),
        fault("stiffness_loss", Category::Looseness, "cracked or loosened attachment").shrinks(
            "stiffness_n_m",
            0.01,
            (1e-6, 1.0),
        ),
    ],
    ports: &[translational("a", "one side"), translational("b", "other side")],
    connect,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let inputs =
        [wiring.position("a"), wiring.position("b"), wiring.velocity("a"), wiring.velocity("b")];
    let force = Output::transfer(wiring.force("a"), wiring.force("b"));
    wiring.equation(Joint, inputs, [force]);
}

/// Equations (T1)–(T3): (x_a, x_b, v_a, v_b) → force from a to b.
pub(crate) struct Joint;

impl Equation<4, 1, 6> for Joint {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 6] {
        let tiny = S::constant(1e-9);
        let ramp = given[index::backlash_m] * S::constant(0.1) + tiny;
        [
            given[index::stiffness_n_m],
            given[index::damping_n_s_m],
            given[index::backlash_m],
            given[index::offset_m],
            S::constant(1.0) / ramp,
            // Exactly one if there is no play.
            tiny / ramp,
        ]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 6], [x_a, x_b, v_a, v_b]: [S; 4]) -> [S; 1] {
        let play = S::from_base(c[2]);
        let stretch = x_a - x_b - c[3];
        let strain = stretch - stretch.clamp(-play, play);
        let contact = (strain.abs() * c[4] + c[5]).min(S::constant(1.0));
        [strain * c[0] + (v_a - v_b) * contact * c[1]]
    }
}
