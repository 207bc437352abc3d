//! A double-acting cylinder with its piston, seals and end stops.
//!
//! ```text
//! V_A  = max(V_A0 + A_A x, V_A0/100),   V_B = max(V_B0 − A_B x, V_B0/100)    (Y1)
//! s_A' = E(s_A)/V_A [q_A − (1 − φ_A) A_A v],   p_A = max(s_A, p_v)           (Y2)
//! s_B' = E(s_B)/V_B [q_B + (1 − φ_B) A_B v],   p_B = max(s_B, p_v)
//! q_li = C_li (μ_r/μ) (p_A − p_B)                           a → b          (Y3)
//! x'   = v,   m v' = A_A (p_A − p_0) − A_B (p_B − p_0) + F − F_f − F_stop    (Y4)
//! F_f  = B (μ/μ_r) v + n F_c [1 + (κ − 1) e^{−(v/v_st)²}] tanh(v/v_t),
//! n    = [1 + g ((p_A + p_B)/(2 p_n) − 1)] e^{−β (T − T_r)}                 (Y5)
//! F_stop = k e + c v min(|e|/d, 1),   e = x − clamp(x, −x_st, x_st)          (Y6)
//! ```
//!
//! `x` is the position of the piston relative to the body, 0 at the center and positive when chamber A grows.
//! `F` is the force on the rod, and `p_0` the normal pressure on the rod's end. The friction is Stribeck's,
//! with `κ` the ratio of static to Coulomb friction. It is smoothed over `v_t`: the rod creeps instead of
//! sticking. If `v_t` is as large as `v_st`, as by default, `κ` raises the slope at rest but leaves no peak
//! above `F_c`. Pressure presses the seals onto rod and bore: a share `g` of the Coulomb friction grows with the
//! mean chamber pressure, and `F_c` is reached at `p_n`. Cold seals are stiffer (`β`). `F_c`, `B` and `C_li` hold
//! at `T_r` = 40 °C, where the dynamic viscosity `μ` is `μ_r`. The damping of the stop fades in over the first
//! thousandth of the stroke (`d`), and the stop never pulls. End stops that are stiff enough keep the piston away
//! from the lower limit of (Y1) (see `check`); a run reports a piston that reaches it. The volumetric form (Y2) errs by at most p/E, 1.4 %. `φ` is the share of the
//! cavity in a chamber, which is zero above the vapor pressure `p_v` (equations (F4)–(F6) of [`crate::fluid`]).
//!
//! Source: continuity and the balance of forces, Merritt 1967 and Jelali & Kroll 2003; Stribeck friction as
//! in Olsson 1998. The stop and the growth of seal friction are the toolkit's own choice.

use super::contact::{
    END_STOP_CONSTANTS, STRIBECK_CONSTANTS, Stribeck, end_stop, end_stop_constants, stribeck,
    stribeck_constants,
};
use super::volume::fluid_pressure;
use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::fluid::{
    BULK_CONSTANTS, NORMAL_PRESSURE_PA, REFERENCE_TEMPERATURE_K, liquid_share, pressure_rate_pa_s,
};
use crate::scalar::Scalar;
use crate::spec::{Category, Fault, Port, State, Unit, declare::*};
use crate::wiring::{Output, Variable, Wiring};
use alloc::format;
use alloc::string::String;

/// The smallest chamber volume, per unit of the volume at the center.
const SMALLEST: f64 = 0.01;

parameters! {
    area_a_m2: parameter(2.2723e-3, (1e-6, 1.0), "piston area, side A"),
    area_b_m2: parameter(2.2723e-3, (1e-6, 1.0), "piston area, side B"),
    volume_a_m3: parameter(65e-6, (1e-8, 1.0), "volume of chamber A at the center"),
    volume_b_m3: parameter(65e-6, (1e-8, 1.0), "volume of chamber B at the center"),
    internal_leakage_m3_s_pa: parameter(
        2e-14,
        (0.0, 1e-8),
        "laminar leakage across the piston seal at 40 °C",
    ),
    mass_kg: parameter(2.0, (1e-3, 1e5), "mass of piston and rod"),
    coulomb_friction_n: parameter(500.0, (0.0, 1e6), "Coulomb friction F_c of the seals at 40 °C"),
    friction_pressure_share: parameter(
        0.5,
        (0.0, 1.0),
        "share g of the Coulomb friction that grows with pressure",
    ),
    friction_pressure_pa: parameter(
        1.06e7,
        (1e5, 1e8),
        "mean chamber pressure p_n at which the Coulomb friction is F_c",
    ),
    friction_temperature_per_k: parameter(
        6e-3,
        (0.0, 0.1),
        "decrease β of the Coulomb friction with temperature",
    ),
    static_friction_ratio: parameter(1.5, (1.0, 10.0), "ratio κ of static to Coulomb friction"),
    stribeck_velocity_m_s: parameter(
        5e-3,
        (1e-5, 1.0),
        "velocity v_st at which static friction has faded",
    ),
    friction_smoothing_m_s: parameter(
        5e-3,
        (1e-5, 1.0),
        "velocity v_t at which Coulomb friction is reached",
    ),
    viscous_friction_n_s_m: parameter(6e3, (0.0, 1e7), "viscous friction at 40 °C"),
    stroke_half_m: parameter(23.5e-3, (1e-4, 10.0), "distance from the center to an end stop"),
    stop_stiffness_n_m: parameter(2e8, (0.0, 1e12), "stiffness of the end stops"),
    stop_damping_n_s_m: parameter(5e4, (0.0, 1e9), "damping of the end stops"),
    start_a_pa: parameter(1.06e7, (1e3, 1e8), "first guess for pressure A"),
    start_b_pa: parameter(1.06e7, (1e3, 1e8), "first guess for pressure B"),
}

/// The faults of every cylinder, whatever its friction law.
pub(super) const FAULTS: [Fault; 3] = [
    fault("internal_leakage", Category::InternalLeakage, "the piston seal is worn").adds(
        "internal_leakage_m3_s_pa",
        8e-12,
        (0.0, 1e-8),
    ),
    fault("friction", Category::Friction, "the seals drag, both sticking and sliding").scales(
        "coulomb_friction_n",
        10.0,
        (1.0, 100.0),
    ),
    fault("viscous_friction", Category::Friction, "the guides drag in proportion to velocity")
        .scales("viscous_friction_n_s_m", 10.0, (1.0, 100.0)),
];

/// The ports of every cylinder.
pub(super) const PORTS: [Port; 5] = [
    pressure("a", "chamber A, which pushes the rod out"),
    pressure("b", "chamber B"),
    optional(moving("rod", "piston and rod, relative to the body")),
    output("position", Unit::Metre, "piston position, 0 at the center"),
    output("velocity", Unit::MetrePerSecond, "piston velocity"),
];

/// The states of every cylinder.
pub(super) const STATES: [State; 4] = [
    pressure_state("pressure_a_pa", "start_a_pa", "chamber A, absolute"),
    pressure_state("pressure_b_pa", "start_b_pa", "chamber B, absolute"),
    state("position_m", 2e-2, "piston position"),
    state("velocity_m_s", 0.05, "piston velocity").with_error_weight(VELOCITY_ERROR_WEIGHT),
];

/// A double-acting cylinder; see the module documentation.
pub(crate) static CYLINDER: Component = Component {
    kind: "cylinder",
    summary: "double-acting cylinder with friction, internal leakage and end stops",
    parameters: &PARAMETERS,
    faults: &FAULTS,
    ports: &PORTS,
    states: &STATES,
    connect,
    check: check_volumes,
    travel_m,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let friction = connect_all_but_friction(wiring);
    let shift = wiring.rate("position_m");
    let slower = Output::subtract(wiring.derivative("velocity_m_s"));
    wiring.equation(PistonFriction, friction, [shift, slower]);
}

/// Wires a cylinder without its friction. Returns what friction reads: velocity, p_a and p_b.
pub(super) fn connect_all_but_friction(wiring: &mut Wiring) -> [Variable; 3] {
    let p_a = fluid_pressure(wiring, "pressure_a_pa");
    let p_b = fluid_pressure(wiring, "pressure_b_pa");
    let position = wiring.state("position_m");
    let velocity = wiring.state("velocity_m_s");
    wiring.set("a", p_a);
    wiring.set("b", p_b);
    wiring.set_motion("rod", position, velocity);
    wiring.set("position", position);
    wiring.set("velocity", velocity);
    for (which, (port, state)) in
        [("a", "pressure_a_pa"), ("b", "pressure_b_pa")].into_iter().enumerate()
    {
        let flow = wiring.flow(port).variable();
        let inputs = [wiring.state(state), flow, position, velocity];
        let rate = wiring.rate(state);
        wiring.equation_of(which, ChamberPressure, inputs, [rate]);
    }
    let leakage = Output::transfer(wiring.flow("a"), wiring.flow("b"));
    wiring.equation(SealLeakage, [p_a, p_b], [leakage]);
    let rod = wiring.force("rod").variable();
    let faster = wiring.rate("velocity_m_s");
    let slower = Output::subtract(wiring.derivative("velocity_m_s"));
    wiring.equation(PistonForce, [p_a, p_b, rod], [faster]);
    wiring.equation(PistonStop, [position, velocity], [slower]);
    [velocity, p_a, p_b]
}

/// The positions between which no volume of (Y1) is at its lower limit.
pub(super) fn travel_m(parameters: &[f64]) -> Option<(f64, f64)> {
    let most =
        |volume: usize, area: usize| parameters[volume] * (1.0 - SMALLEST) / parameters[area];
    let (a, b) =
        (most(index::volume_a_m3, index::area_a_m2), most(index::volume_b_m3, index::area_b_m2));
    Some((-a, b))
}

/// Checks that the end stops keep the piston within the volumes of (Y1).
pub(super) fn check_volumes(parameters: &[f64]) -> Result<(), String> {
    let half = parameters[index::stroke_half_m];
    let sides =
        [(index::area_a_m2, index::volume_a_m3, 'a'), (index::area_b_m2, index::volume_b_m3, 'b')];
    sides.into_iter().try_for_each(|(area, volume, side)| {
        let (area, volume) = (parameters[area], parameters[volume]);
        if area * half < volume * (1.0 - SMALLEST) {
            return Ok(());
        }
        Err(format!(
            "area_{side}_m2 ({area:e}) times stroke_half_m ({half}) is {:.3e}, which must be below \
             volume_{side}_m3 ({volume:e}), the volume at mid stroke",
            area * half
        ))
    })
}

/// Equations (Y1) and (Y2): (s, flow into the chamber, x, v) → s'. `which` is
/// the chamber: 0 for A, 1 for B.
pub(crate) struct ChamberPressure;

impl Equation<4, 1, { 4 + BULK_CONSTANTS }> for ChamberPressure {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 4 + BULK_CONSTANTS] {
        let cavity = given.fluid.bulk.cavity_compliance_per_pa();
        let [a, b, c, d, e, f] = given.fluid.bulk.to_array();
        let [volume, area, sign] = match given.which {
            0 => [given[index::volume_a_m3], given[index::area_a_m2], S::constant(1.0)],
            _ => [given[index::volume_b_m3], given[index::area_b_m2], S::constant(-1.0)],
        };
        let area = area * sign;
        [area, volume, volume * S::constant(SMALLEST), cavity, a, b, c, d, e, f]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 4 + BULK_CONSTANTS], [s, flow, x, v]: [S; 4]) -> [S; 1] {
        let volume = (x * c[0] + c[1]).max(S::from_base(c[2]));
        let swept = v * c[0] * liquid_share(c[3], s);
        [pressure_rate_pa_s(&c[4..], s, flow - swept, volume)]
    }
}

/// Equation (Y3): (p_a, p_b) → flow from a to b.
pub(crate) struct SealLeakage;

impl Equation<2, 1, 1> for SealLeakage {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 1] {
        [given[index::internal_leakage_m3_s_pa] / given.fluid.relative_viscosity]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 1], [p_a, p_b]: [S; 2]) -> [S; 1] {
        [(p_a - p_b) * c[0]]
    }
}

/// Equation (Y4) without friction and stops: (p_a, p_b, rod force) → contribution to v'.
pub(crate) struct PistonForce;

impl Equation<3, 1, 4> for PistonForce {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 4] {
        let per_mass = S::constant(1.0) / given[index::mass_kg];
        let a = given[index::area_a_m2] * per_mass;
        let b = given[index::area_b_m2] * per_mass;
        [a, b, per_mass, (a - b) * S::constant(NORMAL_PRESSURE_PA)]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 4], [p_a, p_b, force]: [S; 3]) -> [S; 1] {
        [p_a * c[0] - p_b * c[1] + force * c[2] - c[3]]
    }
}

/// The seals' friction at the fluid's temperature, per mass.
pub(super) fn seal_friction<S: Scalar<Base = S>>(given: &Given<S>) -> Stribeck<S> {
    let mass = given[index::mass_kg];
    let warmer_k = given.fluid.temperature_k - S::constant(REFERENCE_TEMPERATURE_K);
    let stiffness = (-(warmer_k * given[index::friction_temperature_per_k])).exp();
    Stribeck {
        viscous: given[index::viscous_friction_n_s_m] * given.fluid.relative_viscosity / mass,
        coulomb: given[index::coulomb_friction_n] * stiffness / mass,
        static_ratio: given[index::static_friction_ratio],
        velocity: given[index::stribeck_velocity_m_s],
        smoothing: given[index::friction_smoothing_m_s],
    }
}

/// The constants of [`seal_load`].
pub(super) fn seal_load_constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 2] {
    let share = given[index::friction_pressure_share];
    let per_pressure = share / (given[index::friction_pressure_pa] * S::constant(2.0));
    [per_pressure, S::constant(1.0) - share]
}

/// `n` of equation (Y5) without its temperature: the load of the chamber pressures on the seals.
#[inline(always)]
pub(super) fn seal_load<S: Scalar>([p_a, p_b]: [S; 2], [per_pressure, rest]: [S::Base; 2]) -> S {
    (p_a + p_b) * per_pressure + rest
}

/// Number of constants of [`PistonFriction`].
const FRICTION_CONSTANTS: usize = 2 + STRIBECK_CONSTANTS;

/// Equation (Y5): (v, p_a, p_b) → (x', deceleration by friction).
pub(crate) struct PistonFriction;

impl Equation<3, 2, FRICTION_CONSTANTS> for PistonFriction {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; FRICTION_CONSTANTS] {
        let [per_pressure, rest] = seal_load_constants(given);
        let stribeck = stribeck_constants(seal_friction(given));
        let mut constants = [rest; FRICTION_CONSTANTS];
        constants[..STRIBECK_CONSTANTS].copy_from_slice(&stribeck);
        constants[STRIBECK_CONSTANTS] = per_pressure;
        constants
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; FRICTION_CONSTANTS], [v, p_a, p_b]: [S; 3]) -> [S; 2] {
        let [of_stribeck @ .., per_pressure, rest] = c;
        [v, stribeck(v, seal_load([p_a, p_b], [*per_pressure, *rest]), of_stribeck)]
    }
}

/// Equation (Y6): (x, v) → deceleration by the end stops.
pub(crate) struct PistonStop;

impl Equation<2, 1, END_STOP_CONSTANTS> for PistonStop {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; END_STOP_CONSTANTS] {
        let mass = given[index::mass_kg];
        let stiffness = given[index::stop_stiffness_n_m] / mass;
        end_stop_constants(
            given[index::stroke_half_m],
            stiffness,
            given[index::stop_damping_n_s_m] / mass,
        )
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; END_STOP_CONSTANTS], [x, v]: [S; 2]) -> [S; 1] {
        [end_stop(x, v, c)]
    }
}

#[cfg(test)]
mod tests {
    use super::super::contract::constants;
    use super::*;

    #[test]
    fn the_oil_is_a_spring_of_the_expected_stiffness() {
        // dF/dx = A dp/dt / v summed over both chambers: 2 E A²/V = 2.14e8 N/m.
        let chamber = |which| {
            let c = constants(ChamberPressure, &CYLINDER, &[], which);
            2.2723e-3 * ChamberPressure::evaluate(&c, [106.35e5, 0.0, 0.0, 1.0])[0]
        };
        let stiffness = chamber(1) - chamber(0);
        assert!((stiffness / 2.14e8 - 1.0).abs() < 5e-3, "{stiffness:e}");
    }

    fn friction_n(smoothing_m_s: f64, velocity_m_s: f64) -> f64 {
        let changes = [("viscous_friction_n_s_m", 0.0), ("friction_smoothing_m_s", smoothing_m_s)];
        let c = constants(PistonFriction, &CYLINDER, &changes, 0);
        let mass_kg = 2.0;
        PistonFriction::evaluate(&c, [velocity_m_s, 1.06e7, 1.06e7])[1] * mass_kg
    }

    #[test]
    fn friction_is_odd_and_tends_to_coulombs() {
        assert_eq!(friction_n(5e-3, -3e-3), -friction_n(5e-3, 3e-3));
        assert_eq!(friction_n(5e-3, 0.0), 0.0);
        assert!((friction_n(5e-3, 0.1) - 500.0).abs() < 1e-6);
        // The slope at zero velocity, which gives the fastest pole of the actuator.
        let slope = friction_n(5e-3, 1e-9) / 1e-9;
        assert!((slope / (750.0 / 5e-3) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn static_friction_shows_only_below_a_fine_smoothing() {
        let largest = |smoothing| {
            let forces = (1..200).map(|i| friction_n(smoothing, i as f64 * 1e-4));
            forces.fold(0.0, f64::max)
        };
        assert!(largest(0.2e-3) > 720.0);
        // A smoothing velocity as large as the Stribeck velocity hides the peak.
        assert!(largest(5e-3) <= 500.0 + 1e-6, "{}", largest(5e-3));
    }

    #[test]
    fn pressure_presses_the_seals_onto_the_rod() {
        let c = constants(PistonFriction, &CYLINDER, &[], 0);
        let friction = |bar: f64| PistonFriction::evaluate(&c, [0.1, bar * 1e5, bar * 1e5])[1];
        let viscous = 6e3 * 0.1 / 2.0;
        let ratio = |bar| (friction(bar) - viscous) / (friction(106.0) - viscous);
        assert!((ratio(0.0) - 0.5).abs() < 1e-9 && (ratio(212.0) - 1.5).abs() < 1e-9);
    }

    #[test]
    fn end_stops_push_back_and_never_pull() {
        let c = end_stop_constants(23.5e-3, 2e8, 5e4);
        assert_eq!(end_stop(23e-3, 1.0, &c), 0.0);
        assert!((end_stop(24.5e-3, 0.0, &c) - 2e5).abs() < 1e-3);
        assert!((end_stop(-24.5e-3, 0.0, &c) + 2e5).abs() < 1e-3);
        assert_eq!(end_stop(23.6e-3, -10.0, &c), 0.0);
        assert_eq!(end_stop(-23.6e-3, 10.0, &c), 0.0);
    }

    #[test]
    fn a_chamber_keeps_a_volume() {
        let c = constants(ChamberPressure, &CYLINDER, &[], 0);
        let [rate] = ChamberPressure::evaluate(&c, [1e7, 1e-6, -1.0, 0.0]);
        assert!(rate.is_finite() && rate > 0.0);
    }
}
