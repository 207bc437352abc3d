//! A first-order low-pass filter.
//!
//! ```text
//! dy/dt = 2π f (x − y)                                                    (W1)
//! ```
//!
//! Source: a resistor and a capacitor.

use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Category, Unit, declare::*};
use crate::wiring::Wiring;

parameters! {
    bandwidth_hz: required((1e-6, 1e6), "corner frequency f"),
}

/// A low-pass filter; see the module documentation.
pub(crate) static LOW_PASS_FILTER: Component = Component {
    kind: "low_pass_filter",
    summary: "first-order low-pass filter of a dimensionless signal",
    parameters: &PARAMETERS,
    faults: &[fault("lag", Category::Lag, "the filter is slow: a changed capacitor").scales(
        "bandwidth_hz",
        0.1,
        (1e-5, 1.0),
    )],
    ports: &[
        input("input", Unit::None, "signal to filter"),
        output("output", Unit::None, "filtered signal"),
    ],
    states: &[state("filtered", 1.0, "filtered signal")],
    connect,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let filtered = wiring.state("filtered");
    wiring.set("output", filtered);
    let inputs = [wiring.signal("input"), filtered];
    let rate = wiring.rate("filtered");
    wiring.equation(FirstOrder, inputs, [rate]);
}

/// Equation (W1): (input, output) → rate of the output.
pub(crate) struct FirstOrder;

impl Equation<2, 1, 1> for FirstOrder {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 1] {
        [given[index::bandwidth_hz] * S::constant(core::f64::consts::TAU)]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 1], [input, output]: [S; 2]) -> [S; 1] {
        [(input - output) * c[0]]
    }
}
