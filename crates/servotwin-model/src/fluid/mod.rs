//! Hydraulic fluids: density, viscosity and bulk modulus.
//!
//! Each liquid has its own file; [`FluidKind::ALL`] lists them. The properties of a circuit at
//! its temperature are a [`FluidState`], computed once per variant. Only the
//! effective bulk modulus also depends on the pressure; the chambers evaluate it:
//!
//! ```text
//! E_l = E_0(T) + k_p p                                                    (F1)
//! E_m = E_l (1 + g) / (1 + g E_l / (n p)),   g = a (p_0 / p)^(1/n)          (F2)
//! 1/E = 1/E_m + 1/E_wall                                                  (F3)
//! ```
//!
//! `a` is the volume of free gas per volume of liquid at the normal pressure
//! `p_0` = 101 325 Pa, `n` the polytropic exponent of the gas. Near vacuum E
//! falls as `p^(1 + 1/n)`.
//!
//! No absolute pressure falls below the vapor pressure `p_v`. A chamber keeps one
//! state `s`, which is the pressure of a full chamber and the size of the cavity
//! in a chamber that is not full:
//!
//! ```text
//! p   = max(s, p_v)                                                       (F4)
//! φ   = max(p_v − s, 0)/E_c,   1/E_c = 1/E_l(p_v) + 1/E_wall               (F5)
//! s'  = E(s)/V [q − (1 − φ) V'],   E(s) = E_c below p_v                    (F6)
//! ```
//!
//! `φ` is the cavity's share of the chamber's volume `V`, `q` the flow of liquid into
//! the chamber. The liquid fills `V_l = (1 − φ) V`, and `V_l' = q` gives
//! `φ' = [(1 − φ) V' − q]/V`, which is (F6). The vapor therefore yields without
//! resistance, and its mass is neglected. A cavity closes when as much liquid has
//! returned as left it. With air, the gas of (F2) expands first.
//!
//! Validity: `p_v` = 20 Pa for every fluid and temperature. The liquids of the catalogue boil
//! below this pressure up to about 60 °C, and 20 Pa is practically zero in a hydraulic system. The
//! cavity is lumped: it has no position in its chamber and no waves.
//!
//! Source: (F1)–(F3) as in MathWorks' hydraulic fluid; (F4)–(F6) are the discrete vapor cavity of column separation
//! (Wylie & Streeter 1978), lumped into a chamber.

mod mil_prf_5606;
mod mil_prf_83282;
mod mineral_oil;
pub mod own;
mod phosphate_ester;
pub mod table;

use crate::hash::{Canonical, Fingerprint};
use crate::math::power;
use crate::scalar::{Scalar, lit};
use crate::spec::{Parameter, declare::parameter};

/// The properties of one liquid as functions of its temperature.
pub(crate) trait Liquid {
    /// The word for `kind` in a system file.
    const NAME: &'static str;
    /// One line of documentation, with the source.
    const SUMMARY: &'static str;
    /// Temperatures for which the equations hold, K.
    const RANGE_K: (f64, f64);

    /// Density at normal pressure, kg/m³.
    fn density_kg_m3<S: Scalar>(temperature_k: S) -> S;
    /// Kinematic viscosity at normal pressure, m²/s.
    fn kinematic_viscosity_m2_s<S: Scalar>(temperature_k: S) -> S;
    /// Bulk modulus of the liquid, extrapolated to zero pressure, Pa.
    fn bulk_modulus_pa<S: Scalar>(temperature_k: S) -> S;
    /// Growth of the bulk modulus with pressure, Pa/Pa.
    const BULK_MODULUS_SLOPE: f64;
}

/// The fluid of a circuit, as a system file describes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Fluid {
    /// The liquid.
    pub kind: FluidKind,
    /// The data of [`FluidKind::Own`]. [`FluidKind::Table`] also uses the growth of its bulk
    /// modulus.
    pub own: own::OwnLiquid,
    /// The points of [`FluidKind::Table`].
    pub table: table::Table,
    /// Volume of free gas per volume of liquid at normal pressure.
    pub air_fraction: f64,
    /// Polytropic exponent of the gas.
    pub polytropic_exponent: f64,
    /// Stiffness of the walls as a bulk modulus, Pa.
    pub wall_modulus_pa: f64,
}

impl Canonical for Fluid {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        let Fluid { kind, own, table, air_fraction, polytropic_exponent, wall_modulus_pa } = self;
        fingerprint.add(kind.name()).add(own).add(table);
        fingerprint.add(air_fraction).add(polytropic_exponent).add(wall_modulus_pa);
    }
}

impl Default for Fluid {
    fn default() -> Self {
        Self {
            kind: FluidKind::PhosphateEster,
            own: own::OwnLiquid::default(),
            table: table::Table::default(),
            air_fraction: 0.005,
            polytropic_exponent: 1.4,
            wall_modulus_pa: 10e9,
        }
    }
}

/// The properties of a circuit's fluid at its temperature.
#[derive(Clone, Copy, Debug)]
pub struct FluidState<S> {
    /// Density, kg/m³.
    pub density_kg_m3: S,
    /// Kinematic viscosity, m²/s.
    pub kinematic_viscosity_m2_s: S,
    /// Dynamic viscosity per unit of that at `REFERENCE_TEMPERATURE_K`. Laminar resistances and viscous friction
    /// grow with it, laminar leakage falls with it.
    pub(crate) relative_viscosity: S,
    /// Constants of the effective bulk modulus.
    pub bulk: BulkModulus<S>,
    /// Temperature, K.
    pub(crate) temperature_k: S,
}

impl<S: Scalar<Base = S>> BulkModulus<S> {
    /// `1/E_c` of equation (F5), 1/Pa.
    pub(crate) fn cavity_compliance_per_pa(&self) -> S {
        let liquid = self.liquid_pa + self.slope * S::constant(VAPOR_PRESSURE_PA);
        S::constant(1.0) / liquid + self.wall_compliance_per_pa
    }
}

/// Equation (F4): the absolute pressure of a fluid from its state, Pa.
#[inline(always)]
pub(crate) fn pressure_pa<S: Scalar>(state_pa: S) -> S {
    state_pa.max(S::constant(VAPOR_PRESSURE_PA))
}

/// `1 − φ` of equation (F5): the share of a chamber that liquid fills. It is exactly one in a full chamber.
#[inline(always)]
pub(crate) fn liquid_share<S: Scalar>(cavity_compliance_per_pa: S::Base, state_pa: S) -> S {
    let below = (-state_pa + lit::<S>(VAPOR_PRESSURE_PA)).max(S::constant(0.0));
    -(below * cavity_compliance_per_pa) + lit::<S>(1.0)
}

/// A parameter of every component that fixes a pressure: how far its circuit's liquid is from its description.
pub(crate) const fn bulk_modulus_factor(name: &'static str) -> Parameter {
    let summary = "actual bulk modulus of the liquid per unit of that described";
    parameter(name, 1.0, (0.1, 10.0), summary)
}

/// The same for the gas in the liquid.
pub(crate) const fn air_factor(name: &'static str) -> Parameter {
    let summary = "actual volume of free gas per unit of that described";
    parameter(name, 1.0, (0.0, 100.0), summary)
}

impl<S: Scalar<Base = S>> FluidState<S> {
    /// The fluid with the factors of [`bulk_modulus_factor`] and [`air_factor`].
    pub(crate) fn deviating(mut self, [bulk_modulus, air]: [S; 2]) -> Self {
        self.bulk.liquid_pa = self.bulk.liquid_pa * bulk_modulus;
        self.bulk.slope = self.bulk.slope * bulk_modulus;
        self.bulk.gas = self.bulk.gas * air;
        self
    }
}

/// The constants of equations (F1)–(F3).
#[derive(Clone, Copy, Debug)]
pub struct BulkModulus<S> {
    /// `E_0`, Pa.
    pub liquid_pa: S,
    /// `k_p`.
    pub slope: S,
    /// `a · p_0^(1/n)`.
    pub(crate) gas: S,
    /// `−1/n`.
    pub(crate) exponent: S,
    /// `1/n`.
    pub(crate) reciprocal_exponent: S,
    /// `1/E_wall`, 1/Pa.
    pub(crate) wall_compliance_per_pa: S,
}

/// The temperature at which the parameters of laminar resistances, laminar leakage and seal friction hold, K.
pub(crate) const REFERENCE_TEMPERATURE_K: f64 = 313.15;
/// Normal pressure, Pa.
pub(crate) const NORMAL_PRESSURE_PA: f64 = 101_325.0;
/// Vapor pressure `p_v`, Pa: the lowest pressure of any fluid. It is so low that the gas expands first.
/// At 2 kPa the kink caused the largest errors of all runs (4.7e-3 of scale instead of 5e-4).
pub const VAPOR_PRESSURE_PA: f64 = 20.0;

/// Number of constants of [`BulkModulus`].
pub(crate) const BULK_CONSTANTS: usize = 6;

impl<S: Scalar> BulkModulus<S> {
    /// The constants as an array, for storage among an equation's constants.
    pub fn to_array(self) -> [S; BULK_CONSTANTS] {
        [
            self.liquid_pa,
            self.slope,
            self.gas,
            self.exponent,
            self.reciprocal_exponent,
            self.wall_compliance_per_pa,
        ]
    }
}

/// `1/E`, the compressibility of the mixture with its walls at an absolute
/// pressure, 1/Pa: equations (F1)–(F3), with the constants of
/// [`BulkModulus::to_array`].
#[inline(always)]
pub fn compressibility_per_pa<S: Scalar>(constants: &[S::Base], pressure_pa: S) -> S {
    let (numerator, denominator) = compressibility(constants, pressure_pa);
    numerator / denominator
}

/// `E q/V`, the rate at which a flow raises the pressure in a volume, Pa/s. This is
/// [`compressibility_per_pa`] with only one division.
#[inline(always)]
pub(crate) fn pressure_rate_pa_s<S: Scalar>(
    constants: &[S::Base],
    pressure_pa: S,
    flow_m3_s: S,
    volume_m3: S,
) -> S {
    let (numerator, denominator) = compressibility(constants, pressure_pa);
    flow_m3_s * denominator / (numerator * volume_m3)
}

/// `1/E` as numerator and denominator.
#[inline(always)]
fn compressibility<S: Scalar>(constants: &[S::Base], pressure_pa: S) -> (S, S) {
    let &[liquid, slope, gas, exponent, reciprocal, wall] = constants else { unreachable!() };
    let one = lit::<S>(1.0);
    let p = pressure_pa.max(S::constant(VAPOR_PRESSURE_PA));
    let liquid_modulus = p * slope + liquid;
    // The cavity of a boiling liquid includes its gas: the strain of the liquid (F5) accounts for both.
    let boils = pressure_pa.less(S::constant(VAPOR_PRESSURE_PA));
    let gas_share = S::select(boils, S::constant(0.0), power(p, exponent) * gas);
    // (1 + g E_l/(n p)) / (E_l (1 + g)) + 1/E_wall, over one denominator.
    let numerator = p + gas_share * liquid_modulus * reciprocal;
    let denominator = p * liquid_modulus * (gas_share + one);
    (numerator + denominator * wall, denominator)
}

/// Declares the kinds of liquid, one per line: `Variant = module::Type`.
macro_rules! liquids {
    ($($variant:ident = $module:ident :: $liquid:ident),* $(,)?) => {
        /// A liquid of the catalogue.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum FluidKind {
            $(#[doc = stringify!($liquid)] $variant,)*
            /// [`own::OwnLiquid`].
            Own,
            /// [`table::Table`].
            Table,
        }

        impl FluidKind {
            /// Every liquid, in the order of the documentation.
            pub const ALL: &'static [FluidKind] = &[
                $(FluidKind::$variant,)* FluidKind::Own, FluidKind::Table,
            ];

            /// The word for `kind` in a system file.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $module::$liquid::NAME,)*
                    Self::Own => own::NAME,
                    Self::Table => table::NAME,
                }
            }

            /// One line of documentation.
            pub fn summary(self) -> &'static str {
                match self {
                    $(Self::$variant => $module::$liquid::SUMMARY,)*
                    Self::Own => own::SUMMARY,
                    Self::Table => table::SUMMARY,
                }
            }
        }

        impl Fluid {
            /// Temperatures for which the fluid's equations hold, K.
            pub fn range_k(&self) -> (f64, f64) {
                match self.kind {
                    $(FluidKind::$variant => $module::$liquid::RANGE_K,)*
                    FluidKind::Own => self.own.range_k(),
                    FluidKind::Table => self.table.range_k(),
                }
            }

            /// Density, kg/m³, kinematic viscosity, m²/s, and bulk modulus, Pa, with its growth by pressure.
            fn laws<S: Scalar>(&self, t: S) -> (S, S, S, f64) {
                match self.kind {
                    $(FluidKind::$variant => (
                        $module::$liquid::density_kg_m3(t),
                        $module::$liquid::kinematic_viscosity_m2_s(t),
                        $module::$liquid::bulk_modulus_pa(t),
                        $module::$liquid::BULK_MODULUS_SLOPE,
                    ),)*
                    FluidKind::Own => self.own.laws(t),
                    FluidKind::Table => {
                        let (density, viscosity, bulk) = self.table.laws(t);
                        (density, viscosity, bulk, self.own.bulk_modulus_slope)
                    }
                }
            }
        }
    };
}

liquids! {
    PhosphateEster = phosphate_ester::PhosphateEster,
    MilPrf5606 = mil_prf_5606::MilPrf5606,
    MilPrf83282 = mil_prf_83282::MilPrf83282,
    Hlp32 = mineral_oil::Hlp32,
    Hlp46 = mineral_oil::Hlp46,
    Hlp68 = mineral_oil::Hlp68,
}

impl Fluid {
    /// The bulk modulus, Pa, of a liquid with its own data at a temperature within `own::RANGE_K` at which it is too
    /// soft ([`own::LEAST_BULK_MODULUS_PA`]); `None` otherwise.
    pub fn too_soft_pa(&self, temperature_k: f64) -> Option<f64> {
        let is_within = |(min, max): (f64, f64)| (min..=max).contains(&temperature_k);
        let is_too_soft = is_within(own::RANGE_K) && !is_within(self.range_k());
        let is_own = self.kind == FluidKind::Own;
        (is_own && is_too_soft).then(|| self.own.bulk_modulus_at(temperature_k))
    }

    /// The fluid's properties at a temperature.
    pub fn at<S: Scalar>(&self, temperature_k: S) -> FluidState<S> {
        let (density, viscosity, bulk, slope) = self.laws(temperature_k);
        let (coldest, hottest) = self.range_k();
        let reference_k = S::constant(REFERENCE_TEMPERATURE_K.min(hottest).max(coldest));
        let (reference_density, reference_viscosity, ..) = self.laws(reference_k);
        let exponent = 1.0 / self.polytropic_exponent;
        let gas = self.air_fraction * power(NORMAL_PRESSURE_PA, exponent);
        FluidState {
            density_kg_m3: density,
            kinematic_viscosity_m2_s: viscosity,
            relative_viscosity: density * viscosity / (reference_density * reference_viscosity),
            bulk: BulkModulus {
                liquid_pa: bulk,
                slope: S::constant(slope),
                gas: S::constant(gas),
                exponent: S::constant(-exponent),
                reciprocal_exponent: S::constant(exponent),
                wall_compliance_per_pa: S::constant(1.0 / self.wall_modulus_pa),
            },
            temperature_k,
        }
    }
}

/// `10^x`.
fn power_of_ten<S: Scalar>(x: S) -> S {
    (x * lit::<S>(core::f64::consts::LOG2_10)).exp2()
}

/// Base-ten logarithm.
fn log_10<S: Scalar>(x: S) -> S {
    x.log2() * lit::<S>(core::f64::consts::LOG10_2)
}

/// Walther's law of viscosity: `log₁₀ log₁₀(ν/cSt + 0.7) = A − B log₁₀(T/K)`,
/// in m²/s.
fn walther_m2_s<S: Scalar>(temperature_k: S, a: S, b: S) -> S {
    let inner = power_of_ten(a - b * log_10(temperature_k));
    (power_of_ten(inner) - lit::<S>(0.7)) * lit::<S>(1e-6)
}

/// A and B of Walther's law through two points (temperature, K; viscosity, m²/s), the colder first.
fn walther_through([cold, hot]: [(f64, f64); 2]) -> [f64; 2] {
    let double = |m2_s: f64| log_10(log_10(m2_s * 1e6 + 0.7));
    let [warm, hotter] = [cold, hot].map(|(temperature_k, _)| log_10::<f64>(temperature_k));
    let [thick, thin] = [cold, hot].map(|(_, m2_s)| double(m2_s));
    let b = (thick - thin) / (hotter - warm);
    [thick + b * warm, b]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_close(value: f64, expected: f64, tolerance: f64) {
        let error = (value / expected - 1.0).abs();
        assert!(error < tolerance, "{value} instead of {expected}");
    }

    fn at(kind: FluidKind, celsius: f64) -> FluidState<f64> {
        Fluid { kind, ..Fluid::default() }.at(celsius + 273.15)
    }

    #[test]
    fn phosphate_ester_has_the_density_and_viscosity_of_its_data_set() {
        let table = [
            (-20.0, 1035.0, 95.7),
            (0.0, 1018.0, 36.2),
            (40.0, 983.9, 10.18),
            (70.0, 958.0, 5.47),
            (100.0, 933.0, 3.48),
        ];
        for (celsius, density, centistokes) in table {
            let fluid = at(FluidKind::PhosphateEster, celsius);
            assert_close(fluid.density_kg_m3, density, 1e-3);
            assert_close(fluid.kinematic_viscosity_m2_s, centistokes * 1e-6, 2e-3);
        }
    }

    #[test]
    fn mil_prf_5606_has_the_viscosity_of_its_sheet() {
        for (celsius, centistokes) in [(-40.0, 495.0), (40.0, 13.5), (100.0, 5.1)] {
            let fluid = at(FluidKind::MilPrf5606, celsius);
            assert_close(fluid.kinematic_viscosity_m2_s, centistokes * 1e-6, 1e-4);
        }
        assert_close(at(FluidKind::MilPrf5606, 15.6).density_kg_m3, 871.0, 1e-6);
        assert_close(at(FluidKind::MilPrf5606, 40.0).bulk.liquid_pa, 1.0e9, 1e-12);
    }

    #[test]
    fn mil_prf_5606_is_continuous_where_its_two_lines_meet() {
        let [below, above] = [39.999_999, 40.000_001]
            .map(|celsius| at(FluidKind::MilPrf5606, celsius).kinematic_viscosity_m2_s);
        assert_close(below, above, 5e-5);
    }

    #[test]
    fn mil_prf_83282_has_the_viscosity_of_its_specification() {
        for (celsius, centistokes) in [(40.0, 14.0), (100.0, 3.45)] {
            let fluid = at(FluidKind::MilPrf83282, celsius);
            assert_close(fluid.kinematic_viscosity_m2_s, centistokes * 1e-6, 1e-4);
        }
        assert_close(at(FluidKind::MilPrf83282, 40.0).bulk.liquid_pa, 1.379e9, 1e-12);
    }

    #[test]
    fn mineral_oils_have_the_viscosity_of_their_grade() {
        let table = [
            (FluidKind::Hlp32, 32.0, 5.4),
            (FluidKind::Hlp46, 46.0, 6.8),
            (FluidKind::Hlp68, 68.0, 8.7),
        ];
        for (kind, at_40, at_100) in table {
            for (celsius, centistokes) in [(40.0, at_40), (100.0, at_100)] {
                let viscosity = at(kind, celsius).kinematic_viscosity_m2_s;
                assert_close(viscosity, centistokes * 1e-6, 1e-4);
            }
        }
        // The data of HLP 46 give HLP 46.
        for celsius in [-10.0, 15.0, 70.0, 100.0] {
            let named = at(FluidKind::Hlp46, celsius);
            for by_numbers in [FluidKind::Own, FluidKind::Table].map(|kind| at(kind, celsius)) {
                assert_close(by_numbers.density_kg_m3, named.density_kg_m3, 1e-12);
                let viscosity = by_numbers.kinematic_viscosity_m2_s;
                assert_close(viscosity, named.kinematic_viscosity_m2_s, 3e-5);
                assert_close(by_numbers.bulk.liquid_pa, named.bulk.liquid_pa, 1e-12);
                assert_eq!(by_numbers.bulk.slope, named.bulk.slope);
            }
        }
        assert_close(at(FluidKind::Hlp46, 15.0).density_kg_m3, 880.0, 1e-12);
        assert_close(at(FluidKind::Hlp46, 40.0).bulk.liquid_pa, 1.6e9, 1e-12);
    }

    #[test]
    fn the_effective_bulk_modulus_falls_with_air_at_low_pressure() {
        let constants = at(FluidKind::PhosphateEster, 40.0).bulk.to_array();
        let modulus = |bar: f64| 1.0 / compressibility_per_pa(&constants, bar * 1e5);
        let table =
            [(1.0, 0.027), (6.0, 0.41), (20.0, 1.02), (50.0, 1.25), (100.0, 1.34), (200.0, 1.43)];
        for (bar, gigapascal) in table {
            assert_close(modulus(bar), gigapascal * 1e9, 1.5e-2);
        }
        assert_close(modulus(106.35), 1.347e9, 1e-3);
    }

    #[test]
    fn no_pressure_makes_the_bulk_modulus_zero_or_infinite() {
        let constants = at(FluidKind::PhosphateEster, 40.0).bulk.to_array();
        for pressure in [-1e7, -1.0, 0.0, 1.0, 2e3, 1e9] {
            let compressibility = compressibility_per_pa(&constants, pressure);
            assert!(compressibility.is_finite() && compressibility > 0.0, "{pressure}");
        }
    }

    #[test]
    fn no_flow_takes_a_chamber_below_vacuum() {
        for &kind in FluidKind::ALL {
            let constants = at(kind, 40.0).bulk.to_array();
            let (mut pressure, step_s) = (1e5, 1e-6);
            // A chamber of 65 cm³ loses 0.2 L/s for a quarter of a second, without supply.
            for _ in 0..250_000 {
                pressure += step_s * pressure_rate_pa_s(&constants, pressure, -2e-4, 65e-6);
            }
            assert!((0.0..1e4).contains(&pressure), "{}: {pressure}", kind.name());
        }
    }

    #[test]
    fn every_liquid_is_plausible_over_its_whole_range() {
        for &kind in FluidKind::ALL {
            let fluid = Fluid { kind, ..Fluid::default() };
            let (low, high) = fluid.range_k();
            let name = kind.name();
            let mut colder = f64::INFINITY;
            for step in 0..=100 {
                let state = fluid.at(low + (high - low) * step as f64 / 100.0);
                assert!((600.0..1200.0).contains(&state.density_kg_m3), "{name}");
                assert!((1e-7..1e-2).contains(&state.kinematic_viscosity_m2_s), "{name}");
                assert!(state.bulk.liquid_pa > 0.1e9, "{name} at {} K", state.temperature_k);
                let viscosity = state.kinematic_viscosity_m2_s;
                assert!(viscosity < colder, "{name} thickens when warmed");
                colder = viscosity;
            }
        }
    }
}
