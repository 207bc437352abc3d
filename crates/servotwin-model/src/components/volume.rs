//! A rigid volume, such as a manifold, a gallery or a hose end.
//!
//! ```text
//! ds/dt = E(s)/V · Σq                                                     (V1)
//! p = max(s, p_v)                                                         (V2)
//! ```
//!
//! `s` is the pressure of a full volume. Below the vapor pressure `p_v`, it is the size of the cavity
//! (equations (F4)–(F6) of [`crate::fluid`]). The volumetric form conserves volume, not mass: the error is at
//! most p/E, 1.4 % of the transferred volume between 200 and 6 bar.
//!
//! Source: continuity and bulk modulus, Merritt 1967.

use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::fluid::{self, BULK_CONSTANTS, pressure_rate_pa_s};
use crate::scalar::Scalar;
use crate::spec::declare::*;
use crate::wiring::{Output, Variable, Wiring};

parameters! {
    volume_m3: required((1e-9, 1.0), "volume"),
    start_pa: parameter(1e7, (1e3, 1e8), "first guess for the steady state"),
}

/// A rigid volume; see the module documentation.
pub(crate) static VOLUME: Component = Component {
    kind: "volume",
    summary: "rigid volume of fluid: manifold, gallery",
    parameters: &PARAMETERS,
    ports: &[pressure("port", "all connections")],
    states: &[pressure_state("pressure_pa", "start_pa", "pressure, absolute")],
    connect,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let state = wiring.state("pressure_pa");
    let pressure = fluid_pressure(wiring, "pressure_pa");
    wiring.set("port", pressure);
    let flow = wiring.flow("port").variable();
    let rate = wiring.derivative("pressure_pa");
    wiring.equation(VolumePressure, [state, flow], [Output::add(rate)]);
}

/// Wires equation (V2): the pressure that a fluid state stands for. Ports, other equations and recordings of
/// the state use it.
pub(super) fn fluid_pressure(wiring: &mut Wiring, state: &str) -> Variable {
    let pressure = wiring.internal();
    let inputs = [wiring.state(state)];
    wiring.opening_equation(FluidPressure, inputs, [Output::add(pressure)]);
    wiring.show_state(state, pressure.variable());
    pressure.variable()
}

/// Equation (V2): (state) → pressure.
pub(crate) struct FluidPressure;

impl Equation<1, 1, 0> for FluidPressure {
    #[inline(always)]
    fn evaluate<S: Scalar>(_: &[S::Base; 0], [state]: [S; 1]) -> [S; 1] {
        [fluid::pressure_pa(state)]
    }
}

/// Equation (V1): (state, flow into the volume) → rate of the state.
pub(crate) struct VolumePressure;

impl Equation<2, 1, { 1 + BULK_CONSTANTS }> for VolumePressure {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 1 + BULK_CONSTANTS] {
        let [a, b, c, d, e, f] = given.fluid.bulk.to_array();
        [given[index::volume_m3], a, b, c, d, e, f]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 1 + BULK_CONSTANTS], [p, flow]: [S; 2]) -> [S; 1] {
        [pressure_rate_pa_s(&c[1..], p, flow, S::from_base(c[0]))]
    }
}
