//! A filter, a cooler or a hose, whose resistance comes from a data sheet.
//!
//! ```text
//! Δp = R q + K q|q|,   R = R_r μ/μ_r                                       (F1)
//! q  = 2Δp / (R + √(R² + 4 K |Δp|))                                        (F2)
//! ```
//!
//! (F2) is (F1) solved for the flow. The laminar resistance `R_r` holds at 40 °C and grows with the dynamic
//! viscosity `μ` of the fluid. The turbulent resistance is used as given.
//!
//! Source: the sum of a laminar and a turbulent pressure drop, the usual fit to data sheets.

use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::{Scalar, lit};
use crate::spec::{Category, declare::*};
use crate::wiring::{Output, Wiring};

parameters! {
    resistance_pa_s_m3: parameter(3.84e9, (1.0, 1e16), "laminar resistance at 40 °C"),
    quadratic_pa_s2_m6: parameter(0.0, (0.0, 1e20), "turbulent resistance K"),
}

/// A filter, cooler or hose; see the module documentation.
pub(crate) static FILTER: Component = Component {
    kind: "filter",
    summary: "laminar and quadratic resistance of a filter or a line",
    parameters: &PARAMETERS,
    faults: &[fault("clogging", Category::Clogging, "the element fills with dirt").scales(
        "resistance_pa_s_m3",
        30.0,
        (1.0, 1e5),
    )],
    ports: &[hydraulic("a", "one side"), hydraulic("b", "other side")],
    connect,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let pressures = [wiring.pressure("a"), wiring.pressure("b")];
    let flow = Output::transfer(wiring.flow("a"), wiring.flow("b"));
    wiring.equation(FilterFlow, pressures, [flow]);
}

/// Equation (F2): (p_a, p_b) → flow from a to b.
pub(crate) struct FilterFlow;

impl Equation<2, 1, 2> for FilterFlow {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 2] {
        [
            given[index::resistance_pa_s_m3] * given.fluid.relative_viscosity,
            given[index::quadratic_pa_s2_m6] * S::constant(4.0),
        ]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 2], [p_a, p_b]: [S; 2]) -> [S; 1] {
        let drop = p_a - p_b;
        let root = (drop.abs() * c[1] + c[0] * c[0]).sqrt();
        // This form has no difference as in (O2), because a filter may have no quadratic part.
        [drop * lit::<S>(2.0) / (root + c[0])]
    }
}
