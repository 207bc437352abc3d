//! A signal times a number.
//!
//! ```text
//! y = k x                                                                 (G1)
//! ```

use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Spec, Unit, declare::*};
use crate::wiring::{Output, Wiring};

/// See the module.
pub struct Gain;

const GAIN: usize = 0;

static SPEC: Spec = Spec {
    kind: "gain",
    summary: "dimensionless signal times a number",
    parameters: &[required("gain", Unit::None, (-1e12, 1e12), "factor k")],
    faults: &[],
    ports: &[input("input", Unit::None, "x"), output("output", Unit::None, "k x")],
    states: &[],
    reference: false,
};

impl Component for Gain {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn connect(&self, wiring: &mut Wiring) {
        let input = wiring.signal("input");
        let output = wiring.internal();
        wiring.equation::<Product, 1, 1, 1>(0, [input], [Output::add(output)]);
        wiring.set("output", output.variable());
    }
}

/// Equation (G1): input → output.
pub struct Product;

impl Equation<1, 1, 1> for Product {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 1] {
        [given[GAIN]]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 1], [input]: [S; 1]) -> [S; 1] {
        [input * c[0]]
    }
}
