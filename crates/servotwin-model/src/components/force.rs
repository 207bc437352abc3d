//! An external force on a moving part.
//!
//! ```text
//! F = F_signal                                                            (P1)
//! ```
//!
//! Source: an ideal element, by definition. The origin of the force is not modeled.

use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Spec, Unit, declare::*};
use crate::wiring::{Output, Wiring};

/// An external force; see the module documentation.
pub(crate) struct Force;

parameters! {
    force_n: parameter(Unit::Newton, 0.0, (-1e9, 1e9), "constant force"),
}

static SPEC: Spec = Spec {
    kind: "force",
    summary: "force from outside",
    parameters: &PARAMETERS,
    faults: &[],
    ports: &[
        translational("port", "part on which the force acts"),
        input_or("force", Unit::Newton, "force_n", "force along the coordinate"),
    ],
    states: &[],
    reference: false,
};

impl Component for Force {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn connect(&self, wiring: &mut Wiring) {
        let force = wiring.signal("force");
        let sum = Output::add(wiring.force("port"));
        wiring.equation::<Applied, 1, 1, 0>(0, [force], [sum]);
    }
}

/// Equation (P1): signal → force.
pub(crate) struct Applied;

impl Equation<1, 1, 0> for Applied {
    fn constants<S: Scalar<Base = S>>(_: &Given<S>) -> [S; 0] {
        []
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(_: &[S::Base; 0], [force]: [S; 1]) -> [S; 1] {
        [force]
    }
}
