//! An external force on a moving part.
//!
//! ```text
//! F = F_signal                                                            (P1)
//! ```
//!
//! Source: an ideal element, by definition. The origin of the force is not modeled.

use crate::component::Component;
use crate::equation::Equation;
use crate::scalar::Scalar;
use crate::spec::{Unit, declare::*};
use crate::wiring::{Output, Wiring};

parameters! {
    force_n: parameter(0.0, (-1e9, 1e9), "constant force"),
}

/// An external force; see the module documentation.
pub(crate) static FORCE: Component = Component {
    kind: "force",
    summary: "force from outside",
    parameters: &PARAMETERS,
    ports: &[
        translational("port", "part on which the force acts"),
        input_or("force", Unit::Newton, "force_n", "force along the coordinate"),
    ],
    connect,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let force = wiring.signal("force");
    let sum = Output::add(wiring.force("port"));
    wiring.equation(Applied, [force], [sum]);
}

/// Equation (P1): signal → force.
pub(crate) struct Applied;

impl Equation<1, 1, 0> for Applied {
    #[inline(always)]
    fn evaluate<S: Scalar>(_: &[S::Base; 0], [force]: [S; 1]) -> [S; 1] {
        [force]
    }
}
