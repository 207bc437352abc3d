//! A return line or reservoir of constant pressure.
//!
//! ```text
//! p = p_tank
//! ```
//!
//! Source: an ideal element, by definition.

use crate::component::Component;
use crate::fluid;
use crate::spec::{Spec, Unit, declare::*};
use crate::wiring::Wiring;

/// A tank; see the module documentation.
pub(crate) struct Tank;

parameters! {
    pressure_pa: parameter(Unit::Pascal, 0.6e6, (1e3, 1e8), "pressure, absolute"),
    temperature_k: parameter(Unit::Kelvin, 313.15, (200.0, 480.0), "fluid temperature"),
    bulk_modulus_factor: fluid::bulk_modulus_factor(),
    air_factor: fluid::air_factor(),
}

static SPEC: Spec = Spec {
    kind: "tank",
    summary: "return line or reservoir of constant or measured pressure",
    parameters: &PARAMETERS,
    faults: &[],
    ports: &[
        pressure("port", "inlet"),
        input_or("pressure", Unit::Pascal, "pressure_pa", "measured return pressure"),
    ],
    states: &[],
    reference: true,
};

impl Component for Tank {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn connect(&self, wiring: &mut Wiring) {
        let pressure = wiring.signal("pressure");
        wiring.set("port", pressure);
    }
}
