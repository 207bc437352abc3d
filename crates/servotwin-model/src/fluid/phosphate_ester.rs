//! Phosphate ester of type IV/V (Skydrol 500 class).
//!
//! Density and viscosity: polynomial fits of an aircraft actuator data set
//! (Politecnico di Torino with UTAS, 2013; `[S:Turin-fluid]` of the physics
//! notes), for −40 … 110 °C. Bulk modulus: 1.48 GPa at 40 °C, −7 MPa/K, slope 10.
//! These values are from memory of a manufacturer's sheet and not verified; published
//! effective values lie between 0.8 and 1.5 GPa.

use super::{Liquid, log_10, power_of_ten};
use crate::scalar::{Scalar, lit};

/// Phosphate ester; see the module documentation.
pub(crate) struct PhosphateEster;

impl Liquid for PhosphateEster {
    const NAME: &'static str = "phosphate_ester";
    const SUMMARY: &'static str =
        "phosphate ester type IV/V (Skydrol 500 class), transport aircraft";
    const RANGE_K: (f64, f64) = (233.15, 383.15);

    fn density_kg_m3<S: Scalar>(temperature_k: S) -> S {
        let celsius = temperature_k - lit::<S>(273.15);
        // The second factor is the data set's own: the compression by 20 bar at a bulk modulus of 8,000 bar.
        (S::constant(1015.4) - celsius * lit::<S>(0.85)) * lit::<S>(1.0 + 20.0 / 8000.0)
    }

    fn kinematic_viscosity_m2_s<S: Scalar>(temperature_k: S) -> S {
        let l = log_10(temperature_k + lit::<S>(51.0 - 273.15));
        let mut exponent = S::constant(0.3829);
        for c in [-1.8481, 2.2079, -1.1052, 2.9544] {
            exponent = exponent * l + lit::<S>(c);
        }
        power_of_ten(exponent) * lit::<S>(1e-6)
    }

    fn bulk_modulus_pa<S: Scalar>(temperature_k: S) -> S {
        S::constant(1.48e9) - (temperature_k - lit::<S>(313.15)) * lit::<S>(7e6)
    }

    const BULK_MODULUS_SLOPE: f64 = 10.0;
}
