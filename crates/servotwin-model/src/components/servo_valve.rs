//! A two-stage servo valve with a four-edge spool.
//!
//! The torque motor, the pilot stage and the mechanical feedback move the spool as a second order with a
//! limited rate. Flow forces and stick-slip are neglected; the feedback spring closes the inner loop:
//!
//! ```text
//! u_c  = clamp(g u + b, −1, 1)                                             (W1)
//! σ    = √(max(p_p − p_t, 0)/Δp_N), smooth at zero                         (W2)
//! d    = x_max u_c − x,   d_s = d − clamp(d, −d_0, d_0)
//! x'   = σ v_max tanh(v / v_max)                                           (W3)
//! v'   = σ (ω² d_s − 2 ζ ω v − 20 ω e_v) − stop(x, v),   e_v = v − clamp(v, −2 v_max, 2 v_max)
//! ```
//!
//! `e_v` keeps the velocity before its limit from winding up while the pilot stage is saturated.
//!
//! Of the edges PA, PB, AT and BT, a positive stroke opens PA and BT (`s_e` = 1) and closes PB and AT
//! (`s_e` = −1). Each has an overlap `o`, a radial clearance `c`, an edge radius `r`, a width `w` and a
//! smoothing `ε`:
//!
//! ```text
//! ξ  = s_e x − o,   h = √(ξ² + ε²),   ξ₊ = (ξ + h)/2,   L = (ξ₊ − ξ) (h − ξ)/(2h)   (W4)
//! s  = √((ξ₊ + 2r)² + (c + 2r)²) − 2r,   A = w s                             (W5)
//! R  = Re_t ρ ν/(2 C_d² 2s A) + 12 ρ ν L/(w c³ (1 + 1.5 e²))                  (W6)
//! q  = m w/(2k) · sgn(Δp) (√(a² + 4 k s² |Δp|) − a),   a = R A s             (W7)
//! ```
//!
//! (W7) is (O2) of [`super::orifice`] with `s` moved into the root: `a = Re_t ν k/2 + b L s²` with
//! `b = 12 ρ ν / (c³ (1 + 1.5 e²))`. `m` is the transmission (1 open; a mode valve isolates the cylinder with
//! it). The overlap is a laminar slit, which vanishes with the share `(h − ξ)/(2h)` as the edge opens, and `e` is
//! the relative eccentricity of the spool. The pilot stage takes its quiescent flow from p to t through a hole.
//! The same pressure drop moves the spool: natural frequency and slew rate are proportional to `σ`, and without
//! supply the spool stays where it is. Dirt holds the spool while the difference `d` to its command is smaller than
//! `d_0`, which is zero for a free spool. The model is valid for |x| up to a few strokes and for Δp of either sign.
//!
//! Source: a second order for the valve up to its spool as in Thayer 1958, the leak of an eccentric gap as in
//! Merritt 1967, and the rounded-edge geometry of common component libraries. The limits are the toolkit's
//! own choice.

use super::orifice::{self, flow_m3_s, hole, scaled_velocity_pa_s_m, turbulent};
use super::spool::{
    ORIENTATIONS, SPOOL_CONSTANTS, Spool, bias_negative, bias_positive, breakaway, clogging,
    damping_loss, edges, gain_high, gain_low, jam, motion_variables, natural_frequency_loss, ports,
    spool_constants, spool_motion, states,
};
use crate::component::{Component, SteadyGain};
use crate::equation::{Equation, Given};
use crate::scalar::{Scalar, lit};
use crate::spec::{Category, Fault, Parameter, declare::*};
use crate::wiring::{Output, Wiring};
use alloc::vec;
use alloc::vec::Vec;

/// The parameters of the edges in the order of [`ORIENTATIONS`]: PA, PB, AT, BT.
const WIDTHS: [usize; 4] =
    [index::width_pa_m, index::width_pb_m, index::width_at_m, index::width_bt_m];
const OVERLAPS: [usize; 4] =
    [index::overlap_pa_m, index::overlap_pb_m, index::overlap_at_m, index::overlap_bt_m];

const fn width(name: &'static str, summary: &'static str) -> Parameter {
    parameter(name, 2.38e-3, (0.0, 0.2), summary)
}

const fn overlap(name: &'static str, summary: &'static str) -> Parameter {
    parameter(name, -2e-6, (-1e-3, 1e-3), summary)
}

const fn edge_wear(name: &'static str, parameter: &'static str, summary: &'static str) -> Fault {
    fault(name, Category::Wear, summary).adds(parameter, -20e-6, (-1e-3, 1e-3))
}

parameters! {
    stroke_m: parameter(1e-3, (1e-5, 1e-1), "spool position at rated current"),
    width_pa_m: width("slot width of edge P-A"),
    width_pb_m: width("slot width of edge P-B"),
    width_at_m: width("slot width of edge A-T"),
    width_bt_m: width("slot width of edge B-T"),
    overlap_pa_m: overlap("overlap of edge P-A; negative: underlap"),
    overlap_pb_m: overlap("overlap of edge P-B; negative: underlap"),
    overlap_at_m: overlap("overlap of edge A-T; negative: underlap"),
    overlap_bt_m: overlap("overlap of edge B-T; negative: underlap"),
    clearance_m: parameter(4e-6, (1e-7, 1e-3), "radial clearance"),
    edge_radius_m: parameter(2e-6, (0.0, 1e-3), "radius of the metering edges"),
    smoothing_m: parameter(1.5e-6, (1e-8, 1e-4), "smoothing of the edges"),
    eccentricity: parameter(0.0, (0.0, 1.0), "relative spool eccentricity"),
    discharge_coefficient: orifice::discharge_coefficient(),
    transition_reynolds: orifice::transition_reynolds(),
    natural_frequency_hz: parameter(100.0, (0.1, 2000.0), "natural frequency of the spool"),
    damping_ratio: parameter(0.7, (1e-3, 10.0), "damping ratio of the spool"),
    slew_rate_m_s: parameter(
        0.15,
        (1e-4, 100.0),
        "maximum spool velocity, set by the pilot stage's flow",
    ),
    pilot_area_m2: parameter(4e-8, (0.0, 1e-5), "orifice area of the pilot stage, p to t"),
    null_bias: parameter(0.0, (-2.0, 2.0), "offset, per unit of rated current"),
    current_gain: parameter(1.0, (-10.0, 10.0), "gain g from current to stroke"),
    pilot_rated_drop_pa: parameter(
        20e6,
        (1e5, 1e8),
        "pressure drop p to t at which natural frequency and slew rate hold",
    ),
    breakaway: breakaway(),
    stop_fraction: parameter(1.1, (0.5, 10.0), "position of the end stops, per unit of stroke"),
    stop_stiffness_per_s2: parameter(
        1e8,
        (0.0, 1e12),
        "acceleration per penetration of an end stop",
    ),
    stop_damping_per_s: parameter(1e4, (0.0, 1e8), "acceleration per velocity in an end stop"),
    transmission: parameter(1.0, (0.0, 1.0), "transmission if no signal is connected"),
}

/// A two-stage servo valve; see the module documentation.
pub(crate) static SERVO_VALVE: Component = Component {
    kind: "servo_valve",
    summary: "two-stage four-way servo valve",
    parameters: &PARAMETERS,
    faults: &[
        clogging("clogging_pa", "width_pa_m", "dirt narrows edge P-A"),
        clogging("clogging_pb", "width_pb_m", "dirt narrows edge P-B"),
        clogging("clogging_at", "width_at_m", "dirt narrows edge A-T"),
        clogging("clogging_bt", "width_bt_m", "dirt narrows edge B-T"),
        natural_frequency_loss("the pilot stage is slow"),
        damping_loss("the pilot stage rings"),
        bias_positive(),
        bias_negative(),
        gain_high("too much stroke per current"),
        gain_low("too little stroke per current: a demagnetized torque motor"),
        fault("wear_clearance", Category::Wear, "worn lands: more radial clearance").adds(
            "clearance_m",
            12e-6,
            (0.0, 1e-4),
        ),
        fault("edge_rounding", Category::Wear, "all metering edges are rounded").adds(
            "edge_radius_m",
            28e-6,
            (0.0, 1e-3),
        ),
        edge_wear("wear_pa", "overlap_pa_m", "edge P-A is eroded"),
        edge_wear("wear_pb", "overlap_pb_m", "edge P-B is eroded"),
        edge_wear("wear_at", "overlap_at_m", "edge A-T is eroded"),
        edge_wear("wear_bt", "overlap_bt_m", "edge B-T is eroded"),
        fault(
            "pilot_clogging",
            Category::Clogging,
            "the filter of the pilot stage passes less flow",
        )
        .scales("slew_rate_m_s", 0.1, (1e-3, 1.0)),
        jam(),
    ],
    ports: &ports("current per unit of rated current"),
    states: &states(),
    connect,
    steady_gains,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let pressures = [wiring.pressure("p"), wiring.pressure("t")];
    let ([current, position, velocity], rates) = motion_variables(wiring);
    let inputs = [current, position, velocity, pressures[0], pressures[1]];
    wiring.equation(SpoolMotion, inputs, rates);
    for (which, (inputs, flow)) in edges(wiring).into_iter().enumerate() {
        wiring.equation_of(which, EdgeFlow, inputs, [flow]);
    }
    let flow = Output::transfer(wiring.flow("p"), wiring.flow("t"));
    wiring.equation(PilotFlow, pressures, [flow]);
}

fn steady_gains(parameters: &[f64]) -> Vec<SteadyGain> {
    let gain = parameters[index::stroke_m] * parameters[index::current_gain];
    vec![SteadyGain { from: "current", to: "spool_position", gain }]
}

/// Number of constants of [`SpoolMotion`].
const MOTION_CONSTANTS: usize = SPOOL_CONSTANTS + 1;

/// Pressure drop below which the flow of the pilot stage is laminar, Pa.
const LAMINAR_PILOT_PA: f64 = 1e3;

/// The square root of [`LAMINAR_PILOT_PA`].
const LAMINAR_PILOT_ROOT: f64 = 31.622776601683793;

/// The root in (W2) of a pressure drop of at least zero, with a finite slope at zero, √Pa.
#[inline(always)]
fn pilot_root<S: Scalar>(drop_pa: S) -> S {
    (drop_pa + lit::<S>(LAMINAR_PILOT_PA)).sqrt() - lit::<S>(LAMINAR_PILOT_ROOT)
}

/// Equations (W1)–(W3): (current, x, v, p_p, p_t) → (x', v').
pub(crate) struct SpoolMotion;

impl Equation<5, 2, MOTION_CONSTANTS> for SpoolMotion {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; MOTION_CONSTANTS] {
        let spool = spool_constants(Spool {
            stroke_m: given[index::stroke_m],
            natural_frequency_hz: given[index::natural_frequency_hz],
            damping_ratio: given[index::damping_ratio],
            slew_rate_m_s: given[index::slew_rate_m_s],
            null_bias: given[index::null_bias],
            current_gain: given[index::current_gain],
            breakaway: given[index::breakaway],
            stop: [index::stop_fraction, index::stop_stiffness_per_s2, index::stop_damping_per_s]
                .map(|place| given[place]),
        });
        let rated = pilot_root(given[index::pilot_rated_drop_pa]);
        let mut constants = [S::constant(1.0) / rated; MOTION_CONSTANTS];
        constants[..SPOOL_CONSTANTS].copy_from_slice(&spool);
        constants
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; MOTION_CONSTANTS], inputs: [S; 5]) -> [S; 2] {
        let [current, x, v, p, t] = inputs;
        let [spool @ .., per_rated] = c;
        let speed = pilot_root((p - t).max(S::constant(0.0))) * *per_rated;
        spool_motion(spool, [current, x, v], speed)
    }
}

/// Equations (W4)–(W7): (x, transmission, p_up, p_down) → flow. `which` is the
/// edge: 0 for PA, 1 for PB, 2 for AT, 3 for BT.
pub(crate) struct EdgeFlow;

impl Equation<4, 1, 9> for EdgeFlow {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 9] {
        let number = S::constant;
        let orientation = ORIENTATIONS[given.which];
        let clearance = given[index::clearance_m];
        let two_radii = given[index::edge_radius_m] * number(2.0);
        let height = clearance + two_radii;
        let viscosity = given.fluid.kinematic_viscosity_m2_s;
        let k = turbulent(given.fluid.density_kg_m3, given[index::discharge_coefficient]);
        let eccentricity = given[index::eccentricity];
        let widening = number(1.0) + eccentricity * eccentricity * number(1.5);
        let slit = number(12.0) * given.fluid.density_kg_m3 * viscosity
            / (clearance * clearance * clearance * widening);
        [
            number(orientation),
            given[OVERLAPS[given.which]],
            given[index::smoothing_m] * given[index::smoothing_m],
            two_radii * number(2.0),
            height * height * number(4.0),
            given[WIDTHS[given.which]] * number(0.5) / k,
            given[index::transition_reynolds] * viscosity * k * number(0.5),
            slit * number(0.0625),
            k,
        ]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 9], [x, transmission, up, down]: [S; 4]) -> [S; 1] {
        let [
            orientation,
            overlap,
            smoothing,
            four_radii,
            four_heights,
            width_per_two_k,
            hole,
            sixteenth_of_slit,
            k,
        ] = *c;
        let travel = x * orientation - overlap;
        let smooth = (travel * travel + smoothing).sqrt();
        // These are twice the opening of (W4), and therefore twice the reach and the gap.
        let reach = travel + smooth + four_radii;
        let gap = (reach * reach + four_heights).sqrt() - four_radii;
        let gap = gap * gap;
        let closed = smooth - travel;
        let laminar = closed * closed / smooth * gap * sixteenth_of_slit + hole;
        let drop = up - down;
        let velocity = scaled_velocity_pa_s_m(drop.abs() * gap, laminar, k);
        [transmission * velocity * drop.signed(width_per_two_k)]
    }
}

/// The pilot stage as a hole: (p_p, p_t) → flow from p to t.
pub(crate) struct PilotFlow;

impl Equation<2, 1, 3> for PilotFlow {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 3] {
        hole(
            given[index::pilot_area_m2],
            given[index::discharge_coefficient],
            given[index::transition_reynolds],
            given.fluid,
        )
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 3], [p, t]: [S; 2]) -> [S; 1] {
        [flow_m3_s(p - t, c)]
    }
}

#[cfg(test)]
mod tests {
    use super::super::contract::constants;
    use super::*;

    fn edge_flow(changes: &[(&str, f64)], which: usize, x: f64, drop: f64) -> f64 {
        let c = constants(EdgeFlow, &SERVO_VALVE, changes, which);
        EdgeFlow::evaluate(&c, [x, 1.0, 1e5 + drop, 1e5])[0]
    }

    #[track_caller]
    fn assert_close(value: f64, expected: f64, tolerance: f64) {
        let error = (value / expected - 1.0).abs();
        assert!(error < tolerance, "{value:e} instead of {expected:e}");
    }

    #[test]
    fn an_open_edge_passes_the_turbulent_flow() {
        assert_close(edge_flow(&[], 0, 1e-3, 1e7), 2.207e-4, 1e-3);
        // The smoothing costs an open edge nothing.
        let turbulent = [("transition_reynolds", 1.0), ("smoothing_m", 1e-8)];
        assert_close(edge_flow(&turbulent, 0, 1e-3, 1e7), 2.210e-4, 1e-3);
    }

    #[test]
    fn an_overlapped_edge_leaks_as_a_slit() {
        let flow = edge_flow(&[("overlap_pa_m", 50e-6)], 0, 0.0, 1e7);
        assert_close(flow, 2.16e-7, 1e-2);
    }

    #[test]
    fn edges_open_with_the_spool_or_against_it() {
        for (which, sign) in [(0, 1.0), (1, -1.0), (2, -1.0), (3, 1.0)] {
            let open = edge_flow(&[], which, sign * 5e-4, 1e7);
            let closed = edge_flow(&[], which, -sign * 5e-4, 1e7);
            assert!(open > 1e-4 && closed < 1e-7, "{which}: {open:e} {closed:e}");
            let backwards = edge_flow(&[], which, sign * 5e-4, -1e7);
            assert!((backwards + open).abs() < 1e-12 * open, "{which} is not odd");
        }
    }

    #[test]
    fn at_null_the_spool_and_the_pilot_leak_as_in_the_prototype() {
        let litres_per_minute = 6e4;
        // Two parallel paths, each with half the pressure drop over either edge.
        let half = 0.5 * (20.68e6 - 0.6e6);
        let spool = 2.0 * edge_flow(&[], 0, 0.0, half) * litres_per_minute;
        // The prototype's 0.129, and 1 % for the slit that closes as the edge opens.
        assert_close(spool, 0.1306, 1e-3);
        let c = constants(PilotFlow, &SERVO_VALVE, &[], 0);
        let pilot = PilotFlow::evaluate(&c, [20.68e6, 0.6e6])[0] * litres_per_minute;
        assert_close(pilot, 0.312, 1e-2);
    }

    #[test]
    fn the_spool_stays_within_its_rate_and_its_stops() {
        let [rate, _] = motion(&[], [1.0, 0.0, 10.0], 20e6);
        assert_close(rate, 0.15, 1e-9);
        let [_, inside] = motion(&[], [1.0, 1.1e-3, 0.0], 20e6);
        let [_, beyond] = motion(&[], [1.0, 1.2e-3, 0.0], 20e6);
        assert!(beyond < inside - 0.9e-4 * 1e8, "{inside} {beyond}");
        let saturated = motion(&[], [5.0, 0.0, 0.0], 20e6);
        assert_eq!(saturated, motion(&[], [1.0, 0.0, 0.0], 20e6));
    }

    #[test]
    fn a_saturated_velocity_does_not_wind_up() {
        // A spool without damping that crosses its stroke at its limit would reach 12 times the limit before it.
        let changes = [("damping_ratio", 0.02)];
        let (step_s, mut x, mut v, mut largest) = (1e-6, -1e-3, 0.0, 0.0_f64);
        while x < 1e-3 {
            let [rate, acceleration] = motion(&changes, [1.0, x, v], 20e6);
            (x, v) = (x + step_s * rate, v + step_s * acceleration);
            largest = largest.max(v);
        }
        assert!((0.3..0.45).contains(&largest), "{largest}");
    }

    fn motion(changes: &[(&str, f64)], [current, x, v]: [f64; 3], drop: f64) -> [f64; 2] {
        let c = constants(SpoolMotion, &SERVO_VALVE, changes, 0);
        SpoolMotion::evaluate(&c, [current, x, v, 1e5 + drop, 1e5])
    }

    #[test]
    fn the_pilot_moves_the_spool_with_the_root_of_its_pressure() {
        for share in [0.25, 0.5, 0.81] {
            let rates = motion(&[], [1.0, 2e-4, 0.05], share * 20e6);
            let rated = motion(&[], [1.0, 2e-4, 0.05], 20e6);
            (0..2).for_each(|k| assert_close(rates[k] / rated[k], f64::sqrt(share), 1e-2));
        }
        assert_eq!(LAMINAR_PILOT_ROOT, LAMINAR_PILOT_PA.sqrt());
        assert_eq!(motion(&[], [1.0, 2e-4, 0.05], 0.0), [0.0, 0.0]);
        assert_eq!(motion(&[], [1.0, 2e-4, 0.05], -1e6), [0.0, 0.0]);
    }

    #[test]
    fn dirt_holds_the_spool_until_its_command_is_far_away() {
        let half = [("breakaway", 0.5)];
        assert_eq!(motion(&half, [1.0, 0.0, 0.0], 20e6), [0.0, 0.0]);
        assert_eq!(motion(&half, [-1.0, 0.0, 0.0], 20e6), [0.0, 0.0]);
        assert!(motion(&half, [-1.0, 0.5e-3, 0.0], 20e6)[1] < 0.0);
        assert_eq!(motion(&[("breakaway", 1.0)], [-1.0, 1.1e-3, 0.0], 20e6), [0.0, 0.0]);
    }
}
