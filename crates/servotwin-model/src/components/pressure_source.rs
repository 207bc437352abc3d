//! An ideal supply line, which delivers any flow at its pressure.
//!
//! ```text
//! p = p_supply
//! ```
//!
//! Source: an ideal element, by definition.

use crate::component::Component;
use crate::fluid;
use crate::spec::{Unit, declare::*};
use crate::wiring::Wiring;

parameters! {
    pressure_pa: parameter(20.684e6, (1e4, 1e8), "supply pressure, absolute"),
    temperature_k: parameter(313.15, (200.0, 480.0), "fluid temperature"),
    bulk_modulus_factor: fluid::bulk_modulus_factor(),
    air_factor: fluid::air_factor(),
}

/// An ideal pressure supply; see the module documentation.
pub(crate) static PRESSURE_SOURCE: Component = Component {
    kind: "pressure_source",
    summary: "hydraulic supply of constant or measured pressure",
    parameters: &PARAMETERS,
    ports: &[
        pressure("port", "outlet"),
        input_or("pressure", Unit::Pascal, "pressure_pa", "measured supply pressure"),
    ],
    reference: true,
    connect,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let pressure = wiring.signal("pressure");
    wiring.set("port", pressure);
}
