//! A wall: a translational port that does not move.
//!
//! ```text
//! x = x_0,   v = 0
//! ```
//!
//! Source: an ideal element, by definition.

use crate::component::Component;
use crate::spec::{Spec, Unit, declare::*};
use crate::wiring::Wiring;

/// A wall; see the module documentation.
pub(crate) struct Fixed;

parameters! {
    position_m: parameter(Unit::Metre, 0.0, (-1e3, 1e3), "position of the wall"),
}

static SPEC: Spec = Spec {
    kind: "fixed",
    summary: "wall that does not move",
    parameters: &PARAMETERS,
    faults: &[],
    ports: &[moving("port", "part that is fastened")],
    states: &[],
    reference: false,
};

impl Component for Fixed {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn connect(&self, wiring: &mut Wiring) {
        let position = wiring.parameter("position_m");
        // A sum that nothing adds to stays zero.
        let velocity = wiring.internal().variable();
        wiring.set_motion("port", position, velocity);
    }
}
