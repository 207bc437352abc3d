//! Mineral hydraulic oils of the viscosity grades 32, 46 and 68 (HLP, VG).
//!
//! Viscosity: Walther's law through the grade's own viscosity at 40 °C (ISO 3448) and one at 100 °C for
//! a viscosity index of about 100 (5.4, 6.8 and 8.7 cSt, rounded from manufacturers' sheets). Density at
//! 15 °C and its expansion of 7e-4/K, bulk modulus 1.6 GPa at 40 °C, −8 MPa/K and slope 11: usual values of
//! textbooks, not of one product. Valid from −10 to 100 °C.

use super::{Liquid, walther_m2_s};
use crate::scalar::{Scalar, lit};

const RANGE_K: (f64, f64) = (263.15, 373.15);

/// Density of an oil whose density at 15 °C is `at_15`, kg/m³.
fn density_kg_m3<S: Scalar>(temperature_k: S, at_15: f64) -> S {
    (S::constant(1.0) - (temperature_k - lit::<S>(288.15)) * lit::<S>(7e-4)) * lit::<S>(at_15)
}

fn bulk_modulus_pa<S: Scalar>(temperature_k: S) -> S {
    S::constant(1.6e9) - (temperature_k - lit::<S>(313.15)) * lit::<S>(8e6)
}

/// Declares a grade by its name, its density at 15 °C and the constants of Walther's law.
macro_rules! grade {
    ($oil:ident, $name:literal, $summary:literal, $density:literal, $a:literal, $b:literal) => {
        #[doc = $summary]
        pub(crate) struct $oil;

        impl Liquid for $oil {
            const NAME: &'static str = $name;
            const SUMMARY: &'static str = $summary;
            const RANGE_K: (f64, f64) = RANGE_K;

            fn density_kg_m3<S: Scalar>(temperature_k: S) -> S {
                density_kg_m3(temperature_k, $density)
            }

            fn kinematic_viscosity_m2_s<S: Scalar>(temperature_k: S) -> S {
                walther_m2_s(temperature_k, S::constant($a), S::constant($b))
            }

            fn bulk_modulus_pa<S: Scalar>(temperature_k: S) -> S {
                bulk_modulus_pa(temperature_k)
            }

            const BULK_MODULUS_SLOPE: f64 = 11.0;
        }
    };
}

grade!(Hlp32, "hlp_32", "mineral hydraulic oil HLP 32 (VG 32)", 875.0, 9.5308151, 3.7465784);
grade!(Hlp46, "hlp_46", "mineral hydraulic oil HLP 46 (VG 46)", 880.0, 9.4179926, 3.6844415);
grade!(Hlp68, "hlp_68", "mineral hydraulic oil HLP 68 (VG 68)", 885.0, 9.3096948, 3.6243963);
