//! A shut-off valve with a filter and a line in series, such as a supply valve or a tank valve.
//!
//! ```text
//! A = u A_0,   u = max(opening, 0)                                         (S1)
//! q = A/(2k) · sgn(Δp) (√(r² + 4 k |Δp|) − r),   r = r_t + R_s (μ/μ_r) A     (S2)
//! ```
//!
//! (S2) is (O2) of [`super::orifice`] with the series resistance `R_s` of filter and line, which holds at 40 °C
//! and grows with the dynamic viscosity `μ`. `r_t` is taken at
//! the hydraulic diameter of the open valve. While the valve closes, this underestimates the share of laminar
//! flow, which matters below about one percent of opening.
//!
//! Source: the orifice.

use super::orifice::{self, hole, scaled_velocity_pa_s_m};
use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Category, Unit, declare::*};
use crate::wiring::{Output, Wiring};

parameters! {
    area_m2: parameter(1.6e-5, (0.0, 1e-2), "flow area when open"),
    series_resistance_pa_s_m3: parameter(
        0.0,
        (0.0, 1e15),
        "laminar resistance of filter and line at 40 °C",
    ),
    discharge_coefficient: orifice::discharge_coefficient(),
    transition_reynolds: orifice::transition_reynolds(),
    opening: parameter(1.0, (0.0, 1.0), "opening if no signal is connected"),
}

/// A shut-off valve; see the module documentation.
pub(crate) static SHUT_OFF_VALVE: Component =
    Component {
        kind: "shut_off_valve",
        summary: "piloted shut-off valve with filter and line in series",
        parameters: &PARAMETERS,
        faults: &[
            fault("stuck", Category::Jamming, "does not open fully").shrinks(
                "area_m2",
                0.004,
                (1e-6, 1.0),
            ),
            fault("filter_clogging", Category::Clogging, "the filter in series fills with dirt")
                .adds("series_resistance_pa_s_m3", 1.1e11, (0.0, 1e15)),
        ],
        ports: &[
            hydraulic("a", "inlet"),
            hydraulic("b", "outlet"),
            input_or("opening", Unit::None, "opening", "0 closed … 1 open"),
        ],
        connect,
        ..Component::PLAIN
    };

fn connect(wiring: &mut Wiring) {
    let inputs = [wiring.pressure("a"), wiring.pressure("b"), wiring.signal("opening")];
    let flow = Output::transfer(wiring.flow("a"), wiring.flow("b"));
    wiring.equation(ShutOffFlow, inputs, [flow]);
}

/// Equations (S1) and (S2): (p_a, p_b, opening) → flow from a to b.
pub(crate) struct ShutOffFlow;

impl Equation<3, 1, 4> for ShutOffFlow {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 4] {
        let [factor, r, four_k] = hole(
            given[index::area_m2],
            given[index::discharge_coefficient],
            given[index::transition_reynolds],
            given.fluid,
        );
        let series = given[index::series_resistance_pa_s_m3] * given.fluid.relative_viscosity;
        [factor, r, four_k, given[index::area_m2] * series]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 4], [p_a, p_b, opening]: [S; 3]) -> [S; 1] {
        let opening = opening.max(S::constant(0.0));
        let laminar = opening * c[3] + c[1];
        let drop = p_a - p_b;
        let velocity = scaled_velocity_pa_s_m(drop.abs(), laminar, c[2]);
        [opening * velocity * drop.signed(c[0])]
    }
}
