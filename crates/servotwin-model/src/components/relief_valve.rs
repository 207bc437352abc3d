//! A relief valve, which opens from a to b when the pressure drop exceeds its set pressure.
//!
//! ```text
//! A = A_0 σ((p_a − p_b − p_set)/Δp_r) + A_l
//! ```
//!
//! These are equations (K1) and (K2) of [`super::check_valve`], with the set pressure in place of the
//! cracking pressure. The spring chamber is at the outlet pressure. The dynamics of the poppet are neglected.
//!
//! Source: the check valve.

use super::{check_valve, orifice};
use crate::component::Component;
use crate::spec::{Category, declare::*};

parameters! {
    area_m2: parameter(1e-5, (0.0, 1e-2), "flow area when open"),
    set_pa: parameter(25.8e6, (0.0, 1e8), "pressure drop at which the valve begins to open"),
    range_pa: parameter(1e6, (1e2, 1e8), "further pressure drop until the valve is open"),
    leak_area_m2: parameter(0.0, (0.0, 1e-2), "leak through the seat"),
    discharge_coefficient: orifice::discharge_coefficient(),
    transition_reynolds: orifice::transition_reynolds(),
}

// The equation of the check valve uses these positions.
const _: () = {
    use check_valve::index as shared;
    assert!(index::area_m2 == shared::area_m2 && index::set_pa == shared::cracking_pa);
    assert!(index::range_pa == shared::range_pa && index::leak_area_m2 == shared::leak_area_m2);
    assert!(index::discharge_coefficient == shared::discharge_coefficient);
    assert!(index::transition_reynolds == shared::transition_reynolds);
};

/// A relief valve; see the module documentation.
pub(crate) static RELIEF_VALVE: Component = Component {
    kind: "relief_valve",
    summary: "relief valve with smooth opening",
    parameters: &PARAMETERS,
    faults: &[
        fault("set_pressure_loss", Category::Wear, "the spring has lost force").scales(
            "set_pa",
            0.5,
            (0.0, 1.0),
        ),
        fault("seat_leakage", Category::InternalLeakage, "the seat is worn").adds(
            "leak_area_m2",
            2e-7,
            (0.0, 1e-2),
        ),
    ],
    ports: &[hydraulic("a", "protected side"), hydraulic("b", "side to which it relieves")],
    connect: check_valve::connect,
    ..Component::PLAIN
};
