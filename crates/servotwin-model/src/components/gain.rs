//! A signal times a number.
//!
//! ```text
//! y = k x                                                                 (G1)
//! ```
//!
//! Source: an ideal element, by definition.

use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Category, Fault, Unit, declare::*};
use crate::wiring::Wiring;

/// Fault of an amplifier whose gain, a parameter, is too low.
pub(crate) const fn gain_low(parameter: &'static str) -> Fault {
    let summary = "the amplifier has lost gain";
    fault("gain_low", Category::Calibration, summary).scales(parameter, 0.2, (0.0, 1.0))
}

/// Fault of an amplifier whose gain, a parameter, is too high.
pub(crate) const fn gain_high(parameter: &'static str) -> Fault {
    let summary = "the amplifier has too much gain";
    fault("gain_high", Category::Calibration, summary).scales(parameter, 2.0, (1.0, 100.0))
}

parameters! {
    gain: required((-1e12, 1e12), "factor k"),
}

/// A gain; see the module documentation.
pub(crate) static GAIN: Component = Component {
    kind: "gain",
    summary: "dimensionless signal times a number",
    parameters: &PARAMETERS,
    faults: &[gain_low("gain"), gain_high("gain")],
    ports: &[input("input", Unit::None, "x"), output("output", Unit::None, "k x")],
    connect,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let input = wiring.signal("input");
    wiring.output("output", Product, [input]);
}

/// Equation (G1): input → output.
pub(crate) struct Product;

impl Equation<1, 1, 1> for Product {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 1] {
        [given[index::gain]]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 1], [input]: [S; 1]) -> [S; 1] {
        [input * c[0]]
    }
}
