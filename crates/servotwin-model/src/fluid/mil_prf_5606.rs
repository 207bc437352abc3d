//! MIL-PRF-5606, red mineral oil.
//!
//! Viscosity: Walther's law through a manufacturer's data sheet (495, 13.5 and 5.1 cSt at
//! −40, 40 and 100 °C; `[S:5606]` of the physics notes). It has one line below 40 °C
//! and one above, which meet there within 0.005 %. Density: 871 kg/m³ at 15.6 °C; its
//! expansion is an estimate. Bulk modulus: 1.0 GPa at 40 °C from the same sheet;
//! its slopes are estimates, as for the other liquids.

use super::{Liquid, walther_m2_s};
use crate::scalar::{Scalar, lit};

/// Red mineral oil; see the module documentation.
pub(crate) struct MilPrf5606;

impl Liquid for MilPrf5606 {
    const NAME: &'static str = "mil_prf_5606";
    const SUMMARY: &'static str = "MIL-PRF-5606 mineral oil, general aviation and older military";
    const RANGE_K: (f64, f64) = (219.15, 408.15);

    fn density_kg_m3<S: Scalar>(temperature_k: S) -> S {
        let warmer = temperature_k - lit::<S>(288.75);
        (S::constant(1.0) - warmer * lit::<S>(8.4e-4)) * lit::<S>(871.0)
    }

    fn kinematic_viscosity_m2_s<S: Scalar>(temperature_k: S) -> S {
        let warm = temperature_k.less(S::constant(313.15));
        let a = S::select(warm, S::constant(7.25042), S::constant(5.92281));
        let b = S::select(warm, S::constant(2.88044), S::constant(2.34849));
        walther_m2_s(temperature_k, a, b)
    }

    fn bulk_modulus_pa<S: Scalar>(temperature_k: S) -> S {
        S::constant(1.0e9) - (temperature_k - lit::<S>(313.15)) * lit::<S>(7e6)
    }

    const BULK_MODULUS_SLOPE: f64 = 10.0;
}
