//! A liquid defined by its data sheet.
//!
//! ```text
//! ρ(T) = ρ₁₅ (1 − α (T − 288.15 K))                                        (L1)
//! lg lg(ν/cSt + 0.7) = A − B lg(T/K)   through ν at 40 and at 100 °C          (L2)
//! E₀(T) = E₄₀ + β (T − 313.15 K)                                          (L3)
//! ```
//!
//! (L2) is Walther's law (ASTM D341); the defaults are those of HLP 46.

use super::{walther_m2_s, walther_through};
use crate::hash::{Canonical, Fingerprint};
use crate::scalar::{Scalar, lit};

/// The word for `kind` in a system file.
pub(crate) const NAME: &str = "own";
/// One line of documentation.
pub(crate) const SUMMARY: &str = "a liquid by its own numbers";
/// Temperatures for which data may be given, K; [`OwnLiquid::range_k`] may end earlier.
pub(crate) const RANGE_K: (f64, f64) = (253.15, 423.15);
/// The lowest bulk modulus of a liquid with its own data, Pa: no hydraulic fluid is as soft. Equation (L3) is a
/// straight line that reaches zero at a high enough temperature.
pub const LEAST_BULK_MODULUS_PA: f64 = 2e8;
/// The reference temperature of the bulk modulus in data sheets, K.
const SHEET_K: f64 = 313.15;

/// The data of a liquid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OwnLiquid {
    /// Density at 15 °C, kg/m³.
    pub density_kg_m3: f64,
    /// Its thermal expansion α, 1/K.
    pub expansion: f64,
    /// Kinematic viscosity at 40 °C, m²/s.
    pub viscosity_40_m2_s: f64,
    /// Kinematic viscosity at 100 °C, m²/s.
    pub viscosity_100_m2_s: f64,
    /// Bulk modulus at 40 °C, extrapolated to zero pressure, Pa.
    pub bulk_modulus_pa: f64,
    /// Change β of the bulk modulus with temperature, Pa/K.
    pub bulk_modulus_change: f64,
    /// Growth of the bulk modulus with pressure, Pa/Pa.
    pub bulk_modulus_slope: f64,
}

impl Canonical for OwnLiquid {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        fingerprint.add(&[
            self.density_kg_m3,
            self.expansion,
            self.viscosity_40_m2_s,
            self.viscosity_100_m2_s,
            self.bulk_modulus_pa,
            self.bulk_modulus_change,
            self.bulk_modulus_slope,
        ]);
    }
}

impl Default for OwnLiquid {
    fn default() -> Self {
        Self {
            density_kg_m3: 880.0,
            expansion: 7e-4,
            viscosity_40_m2_s: 46e-6,
            viscosity_100_m2_s: 6.8e-6,
            bulk_modulus_pa: 1.6e9,
            bulk_modulus_change: -8e6,
            bulk_modulus_slope: 11.0,
        }
    }
}

impl OwnLiquid {
    /// Density, kg/m³, kinematic viscosity, m²/s, bulk modulus, Pa, and its growth with pressure.
    pub(crate) fn laws<S: Scalar>(&self, temperature_k: S) -> (S, S, S, f64) {
        let since_15 = temperature_k - lit::<S>(288.15);
        let number = |value: f64| S::constant(value);
        let sheet = [(SHEET_K, self.viscosity_40_m2_s), (373.15, self.viscosity_100_m2_s)];
        let [a, b] = walther_through(sheet);
        (
            (number(1.0) - since_15 * number(self.expansion)) * number(self.density_kg_m3),
            walther_m2_s(temperature_k, number(a), number(b)),
            self.bulk_modulus_at(temperature_k),
            self.bulk_modulus_slope,
        )
    }

    /// Equation (L3): the bulk modulus at zero pressure, Pa.
    pub fn bulk_modulus_at<S: Scalar>(&self, temperature_k: S) -> S {
        let since_40 = temperature_k - lit::<S>(SHEET_K);
        S::constant(self.bulk_modulus_pa) + since_40 * S::constant(self.bulk_modulus_change)
    }

    /// Temperatures for which the equations hold, K: the bulk modulus must be at least [`LEAST_BULK_MODULUS_PA`].
    pub(crate) fn range_k(&self) -> (f64, f64) {
        let (coldest, hottest) = RANGE_K;
        if self.bulk_modulus_change >= 0.0 {
            return (coldest, hottest);
        }
        let spare_pa = self.bulk_modulus_pa - LEAST_BULK_MODULUS_PA;
        (coldest, hottest.min(SHEET_K - spare_pa / self.bulk_modulus_change))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn soft(bulk_modulus_pa: f64, bulk_modulus_change: f64) -> OwnLiquid {
        OwnLiquid { bulk_modulus_pa, bulk_modulus_change, ..OwnLiquid::default() }
    }

    #[test]
    fn its_temperatures_end_where_it_would_be_too_soft() {
        for (modulus, change) in [(1.2e9, -2e7), (8e8, -8e6), (LEAST_BULK_MODULUS_PA, -1.0)] {
            let liquid = soft(modulus, change);
            let (coldest, hottest) = liquid.range_k();
            assert!(coldest == RANGE_K.0 && hottest < RANGE_K.1, "{hottest}");
            let left = liquid.bulk_modulus_at(hottest) / LEAST_BULK_MODULUS_PA;
            assert!((left - 1.0).abs() < 1e-12, "{left}");
        }
        for stiff in [OwnLiquid::default(), soft(LEAST_BULK_MODULUS_PA, 0.0), soft(1e10, -2e7)] {
            assert_eq!(stiff.range_k(), RANGE_K);
            assert!(stiff.bulk_modulus_at(RANGE_K.1) >= LEAST_BULK_MODULUS_PA);
        }
    }
}
