//! MIL-PRF-83282, synthetic hydrocarbon.
//!
//! The specification's limits: at least 14.0 cSt at 40 °C and 3.45 cSt at
//! 100 °C, bulk modulus at least 1.379 GPa at 40 °C. They are from memory (`[M]` of the
//! physics notes) and not verified. Walther's law goes through the two viscosities.
//! The density is an estimate.

use super::{Liquid, walther_m2_s};
use crate::scalar::{Scalar, lit};

/// Synthetic hydrocarbon; see the module documentation.
pub(crate) struct MilPrf83282;

impl Liquid for MilPrf83282 {
    const NAME: &'static str = "mil_prf_83282";
    const SUMMARY: &'static str = "MIL-PRF-83282 synthetic hydrocarbon, military";
    const RANGE_K: (f64, f64) = (233.15, 478.15);

    fn density_kg_m3<S: Scalar>(temperature_k: S) -> S {
        let warmer = temperature_k - lit::<S>(288.75);
        (S::constant(1.0) - warmer * lit::<S>(8.4e-4)) * lit::<S>(846.0)
    }

    fn kinematic_viscosity_m2_s<S: Scalar>(temperature_k: S) -> S {
        walther_m2_s(temperature_k, S::constant(9.12058), S::constant(3.62752))
    }

    fn bulk_modulus_pa<S: Scalar>(temperature_k: S) -> S {
        S::constant(1.379e9) - (temperature_k - lit::<S>(313.15)) * lit::<S>(7e6)
    }

    const BULK_MODULUS_SLOPE: f64 = 10.0;
}
