//! A pressure transducer behind a tapping line.
//!
//! ```text
//! dp_l/dt = 2π f_l (p − p_l)                                               (TP1)
//! ```
//!
//! The line is a resistance and the compliance of the fluid in front of the membrane. The transducer then measures
//! `p_l` as a [`super::pressure_sensor`] does, so the reading is of second order. Parameters, faults and ports are
//! those of the transducer, so that one kind can stand for the other.
//!
//! Source: a resistance and a capacitance in series.

use super::pressure_sensor::{
    CURRENT, FAULTS, PARAMETERS as SHARED, PORTS, connect_transducer, span,
};
use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Parameter, Start, declare::*};
use crate::wiring::Wiring;

/// The transducer's parameters come first, at the same positions.
const TAPPING_HZ: usize = SHARED.len();

static PARAMETERS: [Parameter; TAPPING_HZ + 1] = with_more(
    SHARED,
    [parameter("tapping_hz", 60.0, (1e-3, 1e5), "corner frequency f_l of the line")],
);

/// A pressure transducer behind a tapping line; see the module documentation.
pub(crate) static TAPPED_PRESSURE_SENSOR: Component = Component {
    kind: "tapped_pressure_sensor",
    summary: "pressure transducer behind a tapping line",
    parameters: &PARAMETERS,
    faults: &FAULTS,
    ports: &PORTS,
    states: &[
        CURRENT,
        state("line_pressure_pa", 2e7, "pressure in front of the membrane").from(Start::Value(1e7)),
    ],
    connect,
    span,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let line = wiring.state("line_pressure_pa");
    let inputs = [wiring.pressure("port"), line];
    let rate = wiring.rate("line_pressure_pa");
    wiring.equation(TappingLine, inputs, [rate]);
    connect_transducer(wiring, line);
}

/// Equation (TP1): (pressure, pressure in the line) → rate of the pressure in the line.
pub(crate) struct TappingLine;

impl Equation<2, 1, 1> for TappingLine {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 1] {
        [given[TAPPING_HZ] * S::constant(core::f64::consts::TAU)]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 1], [pressure, line]: [S; 2]) -> [S; 1] {
        [(pressure - line) * c[0]]
    }
}
