//! An orifice with a smooth transition from laminar to turbulent flow.
//!
//! ```text
//! Δp = R q + K q|q|,   K = ρ / (2 C_d² A²)                                 (O1)
//! q  = A/(2k) · sgn(Δp) (√(r² + 4 k |Δp|) − r),   r = R A,  k = K A²        (O2)
//! r  = Re_t ρ ν / (2 C_d² D_h) + R_s A,    D_h = √(4A/π)                   (O3)
//! ```
//!
//! (O2) is (O1) solved for the flow. This form also holds for a closed orifice (A = 0 gives q = 0), and needs
//! no division. The difference loses less than 1e-16 r A/(2k) by cancellation. The flow is smooth at Δp = 0,
//! where its slope is A/r, and tends to `C_d A √(2Δp/ρ)`. `Re_t` is the transition Reynolds number. `R_s` is
//! a laminar resistance in series (a filter, a line); adding the resistances is exact.
//!
//! Source: the square root law of Merritt 1967. Adding the laminar and the turbulent drop, with a transition
//! Reynolds number, is usual in component libraries.

use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::fluid::FluidState;
use crate::scalar::Scalar;
use crate::spec::{Category, Parameter, declare::*};
use crate::wiring::{Output, Wiring};

/// The discharge coefficient of a restriction.
pub(crate) const fn discharge_coefficient(name: &'static str) -> Parameter {
    parameter(name, 0.65, (0.1, 1.0), "discharge coefficient C_d")
}

/// The Reynolds number at which the flow of a restriction becomes turbulent.
pub(crate) const fn transition_reynolds(name: &'static str) -> Parameter {
    parameter(name, 50.0, (1.0, 2500.0), "transition Reynolds number Re_t")
}

parameters! {
    area_m2: required((0.0, 1e-2), "flow area"),
    discharge_coefficient: discharge_coefficient(),
    transition_reynolds: transition_reynolds(),
}

/// An orifice; see the module documentation.
pub(crate) static ORIFICE: Component = Component {
    kind: "orifice",
    summary: "fixed orifice, laminar to turbulent",
    parameters: &PARAMETERS,
    faults: &[fault("clogging", Category::Clogging, "dirt narrows the orifice").scales(
        "area_m2",
        0.05,
        (0.0, 1.0),
    )],
    ports: &[hydraulic("a", "one side"), hydraulic("b", "other side")],
    connect,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let pressures = [wiring.pressure("a"), wiring.pressure("b")];
    let flow = Output::transfer(wiring.flow("a"), wiring.flow("b"));
    wiring.equation(Restriction, pressures, [flow]);
}

/// The turbulent constant `k = ρ/(2 C_d²)` of (O1), Pa s²/m².
pub(crate) fn turbulent<S: Scalar<Base = S>>(density_kg_m3: S, discharge_coefficient: S) -> S {
    density_kg_m3 * S::constant(0.5) / (discharge_coefficient * discharge_coefficient)
}

/// The laminar part of `r` in (O3) for a hydraulic diameter, Pa s/m.
pub(crate) fn laminar<S: Scalar<Base = S>>(
    turbulent: S,
    kinematic_viscosity_m2_s: S,
    transition_reynolds: S,
    hydraulic_diameter_m: S,
) -> S {
    transition_reynolds * kinematic_viscosity_m2_s * turbulent / hydraulic_diameter_m
}

/// The hydraulic diameter of a round hole, m. A closed hole counts as a hole of one
/// micrometer, which keeps (O2) finite.
pub(crate) fn hole_diameter_m<S: Scalar<Base = S>>(area_m2: S) -> S {
    (area_m2 * S::constant(4.0 / core::f64::consts::PI)).sqrt().max(S::constant(1e-6))
}

/// Equation (O2) with the constants of [`hole`]: the flow, m³/s.
#[inline(always)]
pub(crate) fn flow_m3_s<S: Scalar>(pressure_drop_pa: S, hole: &[S::Base; 3]) -> S {
    let laminar = S::from_base(hole[1]);
    scaled_velocity_pa_s_m(pressure_drop_pa.abs(), laminar, hole[2])
        * pressure_drop_pa.signed(hole[0])
}

/// Equation (O2) without its factor, for a drop of at least zero: `2 k` times the mean velocity, Pa s/m.
#[inline(always)]
pub(crate) fn scaled_velocity_pa_s_m<S: Scalar>(
    pressure_drop_pa: S,
    laminar: S,
    four_turbulent: S::Base,
) -> S {
    (pressure_drop_pa * four_turbulent + laminar * laminar).sqrt() - laminar
}

/// The constants of a round hole: `A/(2k)`, `r` of (O3) without series
/// resistance, and `4 k`.
pub(crate) fn hole<S: Scalar<Base = S>>(
    area_m2: S,
    discharge_coefficient: S,
    transition_reynolds: S,
    fluid: &FluidState<S>,
) -> [S; 3] {
    let k = turbulent(fluid.density_kg_m3, discharge_coefficient);
    let diameter = hole_diameter_m(area_m2);
    let r = laminar(k, fluid.kinematic_viscosity_m2_s, transition_reynolds, diameter);
    [area_m2 * S::constant(0.5) / k, r, k * S::constant(4.0)]
}

/// Equation (O2): (p_a, p_b) → flow from a to b.
pub(crate) struct Restriction;

impl Equation<2, 1, 3> for Restriction {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 3] {
        hole(
            given[index::area_m2],
            given[index::discharge_coefficient],
            given[index::transition_reynolds],
            given.fluid,
        )
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 3], [p_a, p_b]: [S; 2]) -> [S; 1] {
        [flow_m3_s(p_a - p_b, c)]
    }
}
