//! A check valve that opens smoothly over a range of pressure drop.
//!
//! ```text
//! A = A_0 σ((p_a − p_b − p_c)/Δp_r) + A_l                                  (K1)
//! q = A v(p_a − p_b)                                                      (K2)
//! ```
//!
//! `σ` is the cubic step of [`crate::math::smooth_step`], and `v` the velocity (O2) of [`super::orifice`].
//! The valve begins to open at the cracking pressure `p_c` and is fully open at `p_c + Δp_r`. `A_l` is a leak
//! through the seat, in both directions. The inertia of the valve is neglected. The laminar part is that of
//! the open valve.
//!
//! The relief valve is the same valve with a higher spring force, and uses the same equation.
//!
//! Source: the orifice. The growth of the area by the cubic step is the toolkit's own choice.

use super::orifice::{self, hole, scaled_velocity_pa_s_m};
use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::math::smooth_step;
use crate::scalar::Scalar;
use crate::spec::{Category, declare::*};
use crate::wiring::{Output, Wiring};

parameters! {
    area_m2: parameter(1e-5, (0.0, 1e-2), "flow area when open"),
    cracking_pa: parameter(5e4, (0.0, 1e7), "pressure drop at which the valve begins to open"),
    range_pa: parameter(1e5, (1e2, 1e7), "further pressure drop until the valve is open"),
    leak_area_m2: parameter(0.0, (0.0, 1e-2), "leak through the seat"),
    discharge_coefficient: orifice::discharge_coefficient(),
    transition_reynolds: orifice::transition_reynolds(),
}

/// A check valve; see the module documentation.
pub(crate) static CHECK_VALVE: Component = Component {
    kind: "check_valve",
    summary: "check valve with smooth opening",
    parameters: &PARAMETERS,
    faults: &[
        fault("stuck_open", Category::Jamming, "does not close and passes fluid back").adds(
            "leak_area_m2",
            1e-6,
            (0.0, 1e-2),
        ),
        fault("clogging", Category::Clogging, "does not open far enough").scales(
            "area_m2",
            0.05,
            (0.0, 1.0),
        ),
    ],
    ports: &[hydraulic("a", "inlet"), hydraulic("b", "outlet")],
    connect,
    ..Component::PLAIN
};

/// Wires (K1) and (K2) between the ports `a` and `b`.
pub(super) fn connect(wiring: &mut Wiring) {
    let pressures = [wiring.pressure("a"), wiring.pressure("b")];
    let flow = Output::transfer(wiring.flow("a"), wiring.flow("b"));
    wiring.equation(OneWayFlow, pressures, [flow]);
}

/// Equations (K1) and (K2): (p_a, p_b) → flow from a to b.
pub(crate) struct OneWayFlow;

impl Equation<2, 1, 6> for OneWayFlow {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 6] {
        let [factor, r, four_k] = hole(
            given[index::area_m2],
            given[index::discharge_coefficient],
            given[index::transition_reynolds],
            given.fluid,
        );
        let per_range = S::constant(1.0) / given[index::range_pa];
        let leak = given[index::leak_area_m2] * S::constant(2.0) / four_k;
        [factor, r, four_k, given[index::cracking_pa], per_range, leak]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 6], [p_a, p_b]: [S; 2]) -> [S; 1] {
        let drop = p_a - p_b;
        let factor = smooth_step((drop - c[3]) * c[4]) * c[0] + c[5];
        let laminar = S::from_base(c[1]);
        [factor * scaled_velocity_pa_s_m(drop.abs(), laminar, c[2]) * drop.sign()]
    }
}
