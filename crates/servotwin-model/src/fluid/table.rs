//! A liquid defined by its properties at several temperatures.
//!
//! Between two consecutive points, 1 the colder and 2 the warmer:
//!
//! ```text
//! ρ(T)  = ρ₁ + (ρ₂ − ρ₁) (T − T₁)/(T₂ − T₁)                                 (LT1)
//! E₀(T) = E₁ + (E₂ − E₁) (T − T₁)/(T₂ − T₁)                                 (LT2)
//! lg lg(ν/cSt + 0.7) = A − B lg(T/K)   through ν₁ and ν₂                     (LT3)
//! ```
//!
//! (LT3) is Walther's law (ASTM D341). Between the points of a mineral oil it is more accurate than a straight
//! line by orders of magnitude. All three equations have kinks at the points, but only in the temperature, which no
//! run changes. Outside the points the properties are unknown.

use super::{walther_m2_s, walther_through};
use crate::hash::{Canonical, Fingerprint};
use crate::scalar::Scalar;
use alloc::vec;
use alloc::vec::Vec;

/// The word for `kind` in a system file.
pub(crate) const NAME: &str = "table";
/// One line of documentation.
pub(crate) const SUMMARY: &str = "a liquid by its own numbers at several temperatures";
/// The smallest distance of two points, K. Closer points would turn the rounding of a data sheet into a slope.
pub const LEAST_STEP_K: f64 = 1.0;

/// The properties of a liquid at one temperature and at normal pressure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Temperature, K.
    pub temperature_k: f64,
    /// Density, kg/m³.
    pub density_kg_m3: f64,
    /// Kinematic viscosity, m²/s.
    pub viscosity_m2_s: f64,
    /// Bulk modulus, extrapolated to zero pressure, Pa.
    pub bulk_modulus_pa: f64,
}

/// A liquid's points, from cold to hot.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    points: Vec<Point>,
}

impl Canonical for Table {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        fingerprint.add(&self.points);
    }
}

impl Canonical for Point {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        let Point { temperature_k, density_kg_m3, viscosity_m2_s, bulk_modulus_pa } = *self;
        fingerprint.add(&[temperature_k, density_kg_m3, viscosity_m2_s, bulk_modulus_pa]);
    }
}

/// HLP 46 at −10, 40 and 100 °C.
impl Default for Table {
    fn default() -> Self {
        let point = |temperature_k, density_kg_m3, viscosity_m2_s, bulk_modulus_pa| Point {
            temperature_k,
            density_kg_m3,
            viscosity_m2_s,
            bulk_modulus_pa,
        };
        let points = vec![
            point(263.15, 895.4, 1474.3e-6, 2.0e9),
            point(313.15, 864.6, 46e-6, 1.6e9),
            point(373.15, 827.64, 6.8e-6, 1.12e9),
        ];
        Self { points }
    }
}

impl Table {
    /// A table of points. Returns `None` unless there are at least two, each warmer than the one before by at least
    /// [`LEAST_STEP_K`].
    pub fn new(points: Vec<Point>) -> Option<Self> {
        let rises = |pair: &[Point]| pair[1].temperature_k >= pair[0].temperature_k + LEAST_STEP_K;
        (points.len() >= 2 && points.windows(2).all(rises)).then_some(Self { points })
    }

    /// Temperatures of the first and the last point, K.
    pub(crate) fn range_k(&self) -> (f64, f64) {
        (self.points[0].temperature_k, self.points[self.points.len() - 1].temperature_k)
    }

    /// Density, kg/m³, kinematic viscosity, m²/s, and bulk modulus, Pa.
    pub(crate) fn laws<S: Scalar>(&self, temperature_k: S) -> (S, S, S) {
        let [a, b] = self.of_pair(temperature_k, |cold, warm| {
            walther_through([cold, warm].map(|point| (point.temperature_k, point.viscosity_m2_s)))
        });
        (
            self.straight(temperature_k, |point| point.density_kg_m3),
            walther_m2_s(temperature_k, a, b),
            self.straight(temperature_k, |point| point.bulk_modulus_pa),
        )
    }

    /// Equations (LT1) and (LT2): a property by linear interpolation.
    fn straight<S: Scalar>(&self, temperature_k: S, property: fn(&Point) -> f64) -> S {
        let [start, from_k, slope] = self.of_pair(temperature_k, |cold, warm| {
            let rise = property(warm) - property(cold);
            let slope = rise / (warm.temperature_k - cold.temperature_k);
            [property(cold), cold.temperature_k, slope]
        });
        start + (temperature_k - from_k) * slope
    }

    /// The constants of the two points around a temperature.
    fn of_pair<S: Scalar, const N: usize>(
        &self,
        temperature_k: S,
        constants: impl Fn(&Point, &Point) -> [f64; N],
    ) -> [S; N] {
        let of = |cold: usize| constants(&self.points[cold], &self.points[cold + 1]);
        let mut chosen = of(0).map(S::constant);
        for cold in 1..self.points.len() - 1 {
            let colder = temperature_k.less(S::constant(self.points[cold].temperature_k));
            let here = of(cold);
            chosen = core::array::from_fn(|n| S::select(colder, chosen[n], S::constant(here[n])));
        }
        chosen
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(value: f64, expected: f64, tolerance: f64) {
        assert!((value / expected - 1.0).abs() < tolerance, "{value} instead of {expected}");
    }

    /// MIL-PRF-5606 by its data sheet. No single line of Walther's law fits its viscosities.
    fn red_oil() -> [Point; 3] {
        [
            (233.15, 911.6, 495e-6, 1.56e9),
            (313.15, 853.1, 13.5e-6, 1.0e9),
            (373.15, 809.2, 5.1e-6, 0.58e9),
        ]
        .map(|(temperature_k, density_kg_m3, viscosity_m2_s, bulk_modulus_pa)| Point {
            temperature_k,
            density_kg_m3,
            viscosity_m2_s,
            bulk_modulus_pa,
        })
    }

    #[test]
    fn every_point_is_met() {
        let table = Table::new(red_oil().to_vec()).unwrap();
        for point in red_oil() {
            let (density, viscosity, modulus) = table.laws(point.temperature_k);
            close(density, point.density_kg_m3, 1e-14);
            close(viscosity, point.viscosity_m2_s, 1e-11);
            close(modulus, point.bulk_modulus_pa, 1e-14);
        }
        assert_eq!(table.range_k(), (233.15, 373.15));
    }

    #[test]
    fn between_points_it_is_the_liquid_that_they_are_of() {
        let fluid = |kind| super::super::Fluid { kind, ..Default::default() };
        let table = Table::new(red_oil().to_vec()).unwrap();
        for celsius in [-30.0, -10.0, 20.0, 39.9, 40.1, 80.0] {
            let kelvin = celsius + 273.15;
            let liquid = fluid(super::super::FluidKind::MilPrf5606).at(kelvin);
            let (density, viscosity, modulus) = table.laws(kelvin);
            close(density, liquid.density_kg_m3, 1e-4);
            close(viscosity, liquid.kinematic_viscosity_m2_s, 2e-4);
            close(modulus, liquid.bulk.liquid_pa, 1e-9);
        }
    }

    #[test]
    fn a_further_point_on_a_line_changes_nothing() {
        let mut points = red_oil().to_vec();
        let coarse = Table::new(points.clone()).unwrap();
        let (density_kg_m3, viscosity_m2_s, bulk_modulus_pa) = coarse.laws(290.0);
        let between =
            Point { temperature_k: 290.0, density_kg_m3, viscosity_m2_s, bulk_modulus_pa };
        points.insert(1, between);
        let fine = Table::new(points).unwrap();
        for kelvin in [240.0, 289.0, 291.0, 350.0] {
            let (one, other) = (coarse.laws(kelvin), fine.laws(kelvin));
            close(other.0, one.0, 1e-14);
            close(other.1, one.1, 1e-10);
            close(other.2, one.2, 1e-14);
        }
    }

    #[test]
    fn points_that_are_no_table_make_none() {
        let [cold, warm, hot] = red_oil();
        assert_eq!(Table::new(vec![]), None);
        assert_eq!(Table::new(vec![warm]), None);
        assert_eq!(Table::new(vec![cold, hot, warm]), None);
        let near = Point { temperature_k: warm.temperature_k + 0.5, ..warm };
        assert_eq!(Table::new(vec![warm, near]), None);
        assert!(Table::new(vec![warm, hot]).is_some());
    }
}
