//! One of two displacements, as a controller is told.
//!
//! ```text
//! y = x_1 + s (x_2 − x_1)                                                 (SE1)
//! ```
//!
//! s is 0 for the first, 1 for the second: a position loop that no longer trusts its own sensor reads
//! another one.
//!
//! Source: an ideal element, by definition.

use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Spec, Unit, declare::*};
use crate::wiring::{Output, Wiring};

/// See the module.
pub struct Selector;

static SPEC: Spec = Spec {
    kind: "selector",
    summary: "one of two displacements, as a controller is told",
    parameters: &[parameter("select", Unit::None, 0.0, (0.0, 1.0), "0 the first, 1 the second, s")],
    faults: &[],
    ports: &[
        input("first", Unit::Metre, "x_1"),
        input("second", Unit::Metre, "x_2"),
        input_or("select", Unit::None, "select", "0 the first, 1 the second"),
        output("output", Unit::Metre, "the selected one, y"),
    ],
    states: &[],
    reference: false,
};

impl Component for Selector {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn connect(&self, wiring: &mut Wiring) {
        let inputs = ["first", "second", "select"].map(|port| wiring.signal(port));
        let output = wiring.internal();
        wiring.equation::<Selection, 3, 1, 0>(0, inputs, [Output::add(output)]);
        wiring.set("output", output.variable());
    }
}

/// Equation (SE1): (first, second, select) → output.
pub struct Selection;

impl Equation<3, 1, 0> for Selection {
    fn constants<S: Scalar<Base = S>>(_: &Given<S>) -> [S; 0] {
        []
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(_: &[S::Base; 0], [first, second, select]: [S; 3]) -> [S; 1] {
        [first + select * (second - first)]
    }
}
