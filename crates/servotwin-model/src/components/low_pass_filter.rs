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
use crate::spec::{Category, Spec, Start, Unit, declare::*};
use crate::wiring::{Output, Wiring};

/// A low-pass filter; see the module documentation.
pub(crate) struct LowPassFilter;

parameters! {
    bandwidth_hz: required(Unit::Hertz, (1e-6, 1e6), "corner frequency f"),
}

static SPEC: Spec = Spec {
    kind: "low_pass_filter",
    summary: "first-order low-pass filter of a dimensionless signal",
    parameters: &PARAMETERS,
    faults: &[scales(
        "lag",
        "bandwidth_hz",
        0.1,
        (1e-5, 1.0),
        Category::Lag,
        "the filter is slow: a changed capacitor",
    )],
    ports: &[
        input("input", Unit::None, "signal to filter"),
        output("output", Unit::None, "filtered signal"),
    ],
    states: &[state("filtered", Unit::None, 1.0, Start::Value(0.0), "filtered signal")],
    reference: false,
};

impl Component for LowPassFilter {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn connect(&self, wiring: &mut Wiring) {
        let filtered = wiring.state("filtered");
        wiring.set("output", filtered);
        let inputs = [wiring.signal("input"), filtered];
        let rate = Output::add(wiring.derivative("filtered"));
        wiring.equation::<FirstOrder, 2, 1, 1>(0, inputs, [rate]);
    }
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
