//! A leak to the surroundings, such as a worn rod seal or a cracked line.
//!
//! ```text
//! q = A v(max(p − p_amb, 0))                                              (E1)
//! ```
//!
//! `v` is the velocity (O2) of [`super::orifice`]. Fluid only leaves: below the ambient pressure, the leak
//! draws nothing in. A closed leak passes exactly nothing.
//!
//! Source: the orifice. The one-way flow is the toolkit's own choice.

use super::orifice::{self, hole, scaled_velocity_pa_s_m};
use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Category, Unit, declare::*};
use crate::wiring::{Output, Wiring};

parameters! {
    area_m2: parameter(0.0, (0.0, 1e-3), "area of the leak"),
    ambient_pa: parameter(101_325.0, (0.0, 1e7), "ambient pressure, absolute"),
    discharge_coefficient: orifice::discharge_coefficient(),
    transition_reynolds: orifice::transition_reynolds(),
}

/// A leak to the surroundings; see the module documentation.
pub(crate) static EXTERNAL_LEAKAGE: Component = Component {
    kind: "external_leakage",
    summary: "leak from a node to the surroundings",
    parameters: &PARAMETERS,
    faults: &[fault("leakage", Category::ExternalLeakage, "a seal or a line leaks to the outside")
        .adds("area_m2", 2e-7, (0.0, 1e-4))],
    ports: &[
        hydraulic("port", "node that leaks"),
        output("flow_m3_s", Unit::CubicMetrePerSecond, "flow that leaks away"),
    ],
    connect,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let pressure = wiring.pressure("port");
    let leaving = Output::subtract(wiring.flow("port"));
    wiring.equation(LeakageFlow, [pressure], [leaving]);
    wiring.output("flow_m3_s", LeakageFlow, [pressure]);
}

/// Equation (E1): (p) → flow out of the node.
pub(crate) struct LeakageFlow;

impl Equation<1, 1, 4> for LeakageFlow {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 4] {
        let [factor, r, four_k] = hole(
            given[index::area_m2],
            given[index::discharge_coefficient],
            given[index::transition_reynolds],
            given.fluid,
        );
        [factor, r, four_k, given[index::ambient_pa]]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 4], [p]: [S; 1]) -> [S; 1] {
        let drop = (p - c[3]).max(S::constant(0.0));
        [scaled_velocity_pa_s_m(drop, S::from_base(c[1]), c[2]) * c[0]]
    }
}
