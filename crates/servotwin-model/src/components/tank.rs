//! A return line or reservoir of constant pressure.
//!
//! ```text
//! p = p_tank
//! ```
//!
//! Source: an ideal element, by definition.

use crate::component::Component;
use crate::fluid;
use crate::spec::{Unit, declare::*};
use crate::wiring::Wiring;

parameters! {
    pressure_pa: parameter(0.6e6, (1e3, 1e8), "pressure, absolute"),
    temperature_k: parameter(313.15, (200.0, 480.0), "fluid temperature"),
    bulk_modulus_factor: fluid::bulk_modulus_factor(),
    air_factor: fluid::air_factor(),
}

/// A tank; see the module documentation.
pub(crate) static TANK: Component = Component {
    kind: "tank",
    summary: "return line or reservoir of constant or measured pressure",
    parameters: &PARAMETERS,
    ports: &[
        pressure("port", "inlet"),
        input_or("pressure", Unit::Pascal, "pressure_pa", "measured return pressure"),
    ],
    reference: true,
    connect,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let pressure = wiring.signal("pressure");
    wiring.set("port", pressure);
}
