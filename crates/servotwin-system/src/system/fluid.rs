//! The numbers of a fluid in a system file.

use servotwin_model::fluid::table::LEAST_STEP_K;
use servotwin_model::fluid::{Fluid, own};
use servotwin_model::spec::{Parameter, declare::parameter, declare::required};

/// The numbers of a fluid, in the order of [`set_fluid`]: first those of all kinds, then those of `table` and `own`,
/// then those of `own` alone.
pub(crate) static FLUID: [Parameter; 10] = [
    parameter("air_fraction", 0.005, (0.0, 0.2), "free gas per volume of liquid"),
    parameter("polytropic_exponent", 1.4, (1.0, 1.67), "polytropic exponent of the gas"),
    parameter("wall_modulus_pa", 10e9, (1e8, 1e13), "stiffness of the walls"),
    parameter("bulk_modulus_slope", 11.0, (0.0, 20.0), "rise of the bulk modulus, Pa per pascal"),
    parameter("bulk_modulus_pa", 1.6e9, MODULUS_PA, "bulk modulus of the liquid at 40 °C"),
    parameter(
        "bulk_modulus_change",
        -8e6,
        (-2e7, 0.0),
        "change of the bulk modulus, Pa per kelvin",
    ),
    parameter("density_kg_m3", 880.0, (500.0, 2000.0), "density at 15 °C"),
    parameter("expansion", 7e-4, (0.0, 5e-3), "thermal expansion of its volume, per kelvin"),
    parameter("viscosity_40_m2_s", 46e-6, (2e-6, 1e-3), "kinematic viscosity at 40 °C"),
    parameter("viscosity_100_m2_s", 6.8e-6, (1e-6, 5e-4), "kinematic viscosity at 100 °C"),
];

/// The allowed bulk modulus, Pa.
const MODULUS_PA: (f64, f64) = (own::LEAST_BULK_MODULUS_PA, 1e10);

/// Number of entries that every fluid has.
pub(crate) const OF_ALL: usize = 3;
/// Number of entries for a table whose points give the bulk modulus.
pub(super) const WITH_SLOPE: usize = 4;
/// Number of entries for a table whose points do not.
pub(crate) const WITH_MODULUS: usize = 6;

/// Sets a number of a fluid by its index.
pub(super) fn set_fluid(fluid: &mut Fluid, index: usize, value: f64) {
    match index {
        0 => fluid.air_fraction = value,
        1 => fluid.polytropic_exponent = value,
        2 => fluid.wall_modulus_pa = value,
        3 => fluid.own.bulk_modulus_slope = value,
        4 => fluid.own.bulk_modulus_pa = value,
        5 => fluid.own.bulk_modulus_change = value,
        6 => fluid.own.density_kg_m3 = value,
        7 => fluid.own.expansion = value,
        8 => fluid.own.viscosity_40_m2_s = value,
        _ => fluid.own.viscosity_100_m2_s = value,
    }
}

/// The numbers of a point in a fluid table; the last is optional.
pub(crate) static POINT: [Parameter; 4] = [
    required(
        "temperature_k",
        (200.0, 480.0),
        "temperature, at least one kelvin above the previous point",
    ),
    required(
        "density_kg_m3",
        (500.0, 2000.0),
        "density, no more than at the previous, colder point",
    ),
    required(
        "viscosity_m2_s",
        (1e-6, 2e-2),
        "kinematic viscosity, no more than at the previous, colder point",
    ),
    required(
        "bulk_modulus_pa",
        MODULUS_PA,
        "bulk modulus of the liquid, no more than at the previous, colder point",
    ),
];
/// The index of the bulk modulus in a point.
pub(super) const MODULUS: usize = 3;

/// The allowed range of a point's number, given that of the point before.
pub(super) fn allowed(index: usize, before: Option<f64>) -> (f64, f64) {
    let Parameter { min, max, .. } = POINT[index];
    match before {
        None => (min, max),
        Some(before) if index == 0 => ((before + LEAST_STEP_K).min(max), max),
        Some(before) => (min, before),
    }
}
