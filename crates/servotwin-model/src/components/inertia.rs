//! A body that turns about a hinge, such as a control surface.
//!
//! ```text
//! dθ/dt = ω,   J dω/dt = M − B_h ω − M_f tanh(ω/ω_f)                       (J1)
//! ```
//!
//! The dry friction is regularized: a moment below `M_f` lets the body creep at up to about `ω_f` instead of
//! holding it.
//!
//! Source: Newton's second law for a rotation. Replacing the sign function by tanh is usual.

use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Category, declare::*};
use crate::wiring::{Output, Wiring};

parameters! {
    inertia_kg_m2: parameter(2.8, (1e-9, 1e9), "moment of inertia about the hinge"),
    viscous_nm_s: parameter(5.0, (0.0, 1e9), "friction moment per rate"),
    friction_nm: parameter(5.0, (0.0, 1e9), "dry friction moment"),
    friction_smoothing_rad_s: parameter(
        0.05,
        (1e-6, 10.0),
        "rate ω_f over which dry friction changes its sign",
    ),
}

/// A body about a hinge; see the module documentation.
pub(crate) static INERTIA: Component = Component {
    kind: "inertia",
    summary: "body turning about a hinge",
    parameters: &PARAMETERS,
    faults: &[fault("hinge_friction", Category::Friction, "dry or corroded hinge bearings")
        .scales("friction_nm", 100.0, (1.0, 1000.0))],
    ports: &[turning("shaft", "parts that turn with the body")],
    states: &[
        state("angle_rad", 0.4, "angle"),
        state("rate_rad_s", 1.0, "rate").with_error_weight(VELOCITY_ERROR_WEIGHT),
    ],
    connect,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let angle = wiring.state("angle_rad");
    let rate = wiring.state("rate_rad_s");
    wiring.set_motion("shaft", angle, rate);
    let moment = wiring.force("shaft").variable();
    let rates = [wiring.derivative("angle_rad"), wiring.derivative("rate_rad_s")];
    wiring.equation(Turning, [rate, moment], rates.map(Output::add));
}

/// Equation (J1): (rate, moment) → rates of angle and rate.
pub(crate) struct Turning;

impl Equation<2, 2, 4> for Turning {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 4] {
        let one = S::constant(1.0);
        [
            given[index::viscous_nm_s],
            given[index::friction_nm],
            one / given[index::friction_smoothing_rad_s],
            one / given[index::inertia_kg_m2],
        ]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 4], [rate, moment]: [S; 2]) -> [S; 2] {
        let friction = rate * c[0] + (rate * c[2]).tanh() * c[1];
        [rate, (moment - friction) * c[3]]
    }
}
