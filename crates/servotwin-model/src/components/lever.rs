//! A lever: the horn between a hinge and a rod.
//!
//! ```text
//! x = r sin θ,   v = r cos θ · ω                                          (L1)
//! M = r cos θ · F                                                         (L2)
//! ```
//!
//! `F` is the force on the rod's end of the lever, and `M` the moment on the shaft. The rod stays parallel to
//! itself: for a rod of length l, the error of (L1) is about r²(1 − cos θ)²/(2 l). Angles are within ±π.
//!
//! Source: kinematics, and the conservation of power: M ω = F v.

use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Unit, declare::*};
use crate::wiring::{Output, Wiring};

parameters! {
    arm_m: parameter(0.0525, (1e-4, 100.0), "length of the arm"),
}

/// A lever; see the module documentation.
pub(crate) static LEVER: Component = Component {
    kind: "lever",
    summary: "horn between a hinge and a rod",
    parameters: &PARAMETERS,
    ports: &[
        rotational("shaft", "the hinge"),
        moving("rod", "the end of the arm"),
        output("position", Unit::Metre, "position of the end of the arm"),
    ],
    connect,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let turning = [wiring.position("shaft"), wiring.velocity("shaft")];
    let [position, velocity, arm] = core::array::from_fn(|_| wiring.internal());
    let motion = [position, velocity, arm].map(Output::add);
    wiring.equation(LeverMotion, turning, motion);
    wiring.set_motion("rod", position.variable(), velocity.variable());
    wiring.set("position", position.variable());
    let force = wiring.force("rod").variable();
    let moment = Output::add(wiring.force("shaft"));
    wiring.equation(LeverMoment, [arm.variable(), force], [moment]);
}

/// Equation (L1): (angle, rate) → position, velocity and effective arm r cos θ.
pub(crate) struct LeverMotion;

impl Equation<2, 3, 1> for LeverMotion {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 1] {
        [given[index::arm_m]]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 1], [angle, rate]: [S; 2]) -> [S; 3] {
        let arm = angle.cos() * c[0];
        [angle.sin() * c[0], arm * rate, arm]
    }
}

/// Equation (L2): (effective arm, force) → moment.
pub(crate) struct LeverMoment;

impl Equation<2, 1, 0> for LeverMoment {
    #[inline(always)]
    fn evaluate<S: Scalar>(_: &[S::Base; 0], [arm, force]: [S; 2]) -> [S; 1] {
        [arm * force]
    }
}
