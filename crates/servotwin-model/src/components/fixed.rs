//! A wall: a translational port that does not move.
//!
//! ```text
//! x = x_0,   v = 0
//! ```
//!
//! Source: an ideal element, by definition.

use crate::component::Component;
use crate::spec::declare::*;
use crate::wiring::Wiring;

parameters! {
    position_m: parameter(0.0, (-1e3, 1e3), "position of the wall"),
}

/// A wall; see the module documentation.
pub(crate) static FIXED: Component = Component {
    kind: "fixed",
    summary: "wall that does not move",
    parameters: &PARAMETERS,
    ports: &[moving("port", "part that is fastened")],
    connect,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let position = wiring.parameter("position_m");
    // A sum that nothing adds to stays zero.
    let velocity = wiring.internal().variable();
    wiring.set_motion("port", position, velocity);
}
