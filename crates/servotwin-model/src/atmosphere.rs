//! The International Standard Atmosphere (ISO 2533) up to 20 km.
//!
//! ```text
//! T = T_0 − L min(h, h_1),            T_0 = 288.15 K, L = 6.5 K/km         (A1)
//! p = p_0 (T/T_0)^(g/(R L)) · exp(−g (h − h_1)⁺ / (R T))                   (A2)
//! ρ = p / (R T),   a = √(γ R T)                                           (A3)
//! ```
//!
//! `h_1` = 11 km is the tropopause. Below it the second factor of (A2) is one;
//! above it the temperature and the first factor stay constant. Valid for −2 km …
//! 20 km of geopotential altitude; outside, the altitude is held at the nearer end.

use crate::scalar::{Scalar, lit};

/// Specific gas constant of dry air, J/(kg K).
const GAS_CONSTANT: f64 = 287.05287;
/// Standard gravity, m/s².
const GRAVITY: f64 = 9.80665;
/// Ratio of specific heats.
const HEAT_RATIO: f64 = 1.4;
/// Temperature at sea level, K.
const SEA_LEVEL_K: f64 = 288.15;
/// Pressure at sea level, Pa.
const SEA_LEVEL_PA: f64 = 101_325.0;
/// Temperature gradient of the troposphere, K/m.
const LAPSE_K_M: f64 = 0.0065;
/// Altitude of the tropopause, m.
const TROPOPAUSE_M: f64 = 11_000.0;
/// Altitudes for which the equations hold, m.
const RANGE_M: (f64, f64) = (-2_000.0, 20_000.0);

/// The state of the air at an altitude.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Air<S> {
    /// Density, kg/m³.
    pub(crate) density_kg_m3: S,
    /// Speed of sound, m/s.
    pub(crate) sound_speed_m_s: S,
}

/// Equations (A1)–(A3).
#[inline(always)]
pub(crate) fn standard_air<S: Scalar>(altitude_m: S) -> Air<S> {
    const EXPONENT: f64 = GRAVITY / (GAS_CONSTANT * LAPSE_K_M);
    const STRATOSPHERE_K: f64 = SEA_LEVEL_K - LAPSE_K_M * TROPOPAUSE_M;
    const FADE_PER_M: f64 = GRAVITY / (GAS_CONSTANT * STRATOSPHERE_K) * core::f64::consts::LOG2_E;
    let altitude = altitude_m.clamp(S::constant(RANGE_M.0), S::constant(RANGE_M.1));
    let tropopause = S::constant(TROPOPAUSE_M);
    let temperature_k = -(altitude.min(tropopause) * lit::<S>(LAPSE_K_M)) + lit::<S>(SEA_LEVEL_K);
    let fade = (altitude.max(tropopause) - tropopause) * lit::<S>(FADE_PER_M);
    let octaves = (temperature_k * lit::<S>(1.0 / SEA_LEVEL_K)).log2() * lit::<S>(EXPONENT);
    let pressure_pa = (octaves - fade).exp2() * lit::<S>(SEA_LEVEL_PA);
    Air {
        density_kg_m3: pressure_pa / (temperature_k * lit::<S>(GAS_CONSTANT)),
        sound_speed_m_s: (temperature_k * lit::<S>(HEAT_RATIO * GAS_CONSTANT)).sqrt(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_close(value: f64, expected: f64, tolerance: f64) {
        assert!((value - expected).abs() < tolerance, "{value} is not {expected}");
    }

    #[test]
    fn agrees_with_the_tables_of_iso_2533() {
        // Altitude, density, speed of sound.
        let table = [
            (0.0, 1.225, 340.294),
            (3_000.0, 0.909_12, 328.578),
            (11_000.0, 0.363_918, 295.069),
            (20_000.0, 0.088_034_9, 295.069),
        ];
        for (altitude, density, sound) in table {
            let air = standard_air::<f64>(altitude);
            assert_close(air.density_kg_m3, density, 2e-5 * density);
            assert_close(air.sound_speed_m_s, sound, 1e-3);
        }
    }
}
