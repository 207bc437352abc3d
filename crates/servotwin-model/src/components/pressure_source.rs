//! An ideal supply line, which delivers any flow at its pressure.
//!
//! ```text
//! p = p_supply
//! ```
//!
//! Source: an ideal element, by definition.

use crate::component::Component;
use crate::fluid;
use crate::spec::{Spec, Unit, declare::*};
use crate::wiring::Wiring;

/// An ideal pressure supply; see the module documentation.
pub(crate) struct PressureSource;

parameters! {
    pressure_pa: parameter(Unit::Pascal, 20.684e6, (1e4, 1e8), "supply pressure, absolute"),
    temperature_k: parameter(Unit::Kelvin, 313.15, (200.0, 480.0), "fluid temperature"),
    bulk_modulus_factor: fluid::bulk_modulus_factor(),
    air_factor: fluid::air_factor(),
}

static SPEC: Spec = Spec {
    kind: "pressure_source",
    summary: "hydraulic supply of constant or measured pressure",
    parameters: &PARAMETERS,
    faults: &[],
    ports: &[
        pressure("port", "outlet"),
        input_or("pressure", Unit::Pascal, "pressure_pa", "measured supply pressure"),
    ],
    states: &[],
    reference: true,
};

impl Component for PressureSource {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn connect(&self, wiring: &mut Wiring) {
        let pressure = wiring.signal("pressure");
        wiring.set("port", pressure);
    }
}
