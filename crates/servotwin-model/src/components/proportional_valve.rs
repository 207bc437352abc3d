//! A proportional directional valve with four edges, described by the numbers of a data sheet.
//!
//! The spool moves as in [`super::servo_valve`], equations (W1) to (W3). Of its edges PA, PB, AT and BT, a
//! positive stroke opens PA and BT (`s_e` = 1) and closes PB and AT (`s_e` = −1). `x_max` is the stroke. The
//! overlap `o` and the smoothing `ε` of an edge are per unit of stroke:
//!
//! ```text
//! ξ  = (s_e x/x_max − o)/(1 − o),   ξ₊ = (ξ + √(ξ² + ε²))/2                 (PV1)
//! q  = m (f Q_N √(ρ_N/(ρ Δp_N)) ξ₊ Δp/(Δp² + p_t²)^¼ + C_l Δp)             (PV2)
//! ```
//!
//! `Q_N` is the flow of one edge at full stroke and at the pressure drop `Δp_N` over this edge, with an oil
//! of density `ρ_N`. ISO 10770-1 rates proportional valves at 5 bar per edge, and servo valves at 35 bar. `f`
//! is the share of this flow that an edge passes, as in spools for cylinders with one rod. Below `p_t`, the
//! flow becomes proportional to the drop. `C_l` is the leakage past a land. `m` is the transmission, as in
//! the servo valve. The valve's own position loop takes care of flow forces and needs no supply (`σ` of (W2) is 1).
//!
//! Source: the square root law through the rated point of ISO 10770-1, and the spool of the servo valve. The
//! smoothing of (PV1) and (PV2) is the toolkit's own choice.

use super::spool::{
    ORIENTATIONS, SPOOL_CONSTANTS, Spool, bias_negative, bias_positive, breakaway, clogging,
    damping_loss, edges, gain_high, gain_low, jam, motion_variables, natural_frequency_loss, ports,
    spool_constants, spool_motion, states,
};
use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Category, Fault, Parameter, declare::*};
use crate::wiring::Wiring;

/// The spool's stops: at 1.1 strokes, where they do not affect the flow, with the stiffness and damping of
/// the servo valve's stops.
const STOP: [f64; 3] = [1.1, 1e8, 1e4];

/// The parameters of the edges in the order of [`ORIENTATIONS`]: PA, PB, AT, BT.
const SHARES: [usize; 4] = [index::pa_share, index::pb_share, index::at_share, index::bt_share];
const OVERLAPS: [usize; 4] =
    [index::pa_overlap, index::pb_overlap, index::at_overlap, index::bt_overlap];

const fn share(name: &'static str, summary: &'static str) -> Parameter {
    parameter(name, 1.0, (0.0, 2.0), summary)
}

const fn overlap(name: &'static str, summary: &'static str) -> Parameter {
    parameter(name, 0.0, (-0.5, 0.5), summary)
}

const fn edge_wear(name: &'static str, parameter: &'static str, summary: &'static str) -> Fault {
    fault(name, Category::Wear, summary).adds(parameter, -0.05, (-0.5, 0.5))
}

parameters! {
    rated_flow_m3_s: required(
        (1e-7, 0.1),
        "flow Q_N of a fully open edge at the rated pressure drop",
    ),
    rated_drop_pa: parameter(5e5, (1e4, 1e8), "rated pressure drop Δp_N over an edge"),
    rated_density_kg_m3: parameter(865.0, (500.0, 2000.0), "density ρ_N of the oil in the rating"),
    pa_share: share("share of the rated flow that edge P-A passes"),
    pb_share: share("share of the rated flow that edge P-B passes"),
    at_share: share("share of the rated flow that edge A-T passes"),
    bt_share: share("share of the rated flow that edge B-T passes"),
    pa_overlap: overlap("overlap of edge P-A per unit of stroke; negative: underlap"),
    pb_overlap: overlap("overlap of edge P-B per unit of stroke"),
    at_overlap: overlap("overlap of edge A-T per unit of stroke"),
    bt_overlap: overlap("overlap of edge B-T per unit of stroke"),
    smoothing: parameter(2e-3, (1e-5, 0.1), "smoothing ε of the edges"),
    transition_pa: parameter(2e4, (1.0, 1e6), "pressure drop p_t below which the flow is laminar"),
    leakage_m3_s_pa: parameter(2e-13, (0.0, 1e-8), "laminar conductance C_l past each land"),
    stroke_m: parameter(1e-3, (1e-5, 1e-1), "spool position at full signal"),
    natural_frequency_hz: parameter(60.0, (0.1, 2000.0), "natural frequency of the spool"),
    damping_ratio: parameter(0.8, (1e-3, 10.0), "damping ratio of the spool"),
    opening_time_s: parameter(0.015, (1e-4, 10.0), "shortest time from the center to full opening"),
    null_bias: parameter(0.0, (-2.0, 2.0), "offset, per unit of full signal"),
    current_gain: parameter(1.0, (-10.0, 10.0), "gain g from signal to stroke"),
    breakaway: breakaway(),
    transmission: parameter(1.0, (0.0, 1.0), "transmission if no signal is connected"),
}

/// A proportional valve; see the module documentation.
pub(crate) static PROPORTIONAL_VALVE: Component = Component {
    kind: "proportional_valve",
    summary: "four-way proportional or servo valve, described by rated flow and overlap",
    parameters: &PARAMETERS,
    faults: &[
        clogging("clogging_pa", "pa_share", "dirt narrows edge P-A"),
        clogging("clogging_pb", "pb_share", "dirt narrows edge P-B"),
        clogging("clogging_at", "at_share", "dirt narrows edge A-T"),
        clogging("clogging_bt", "bt_share", "dirt narrows edge B-T"),
        natural_frequency_loss("the position loop of the spool is slow"),
        damping_loss("the position loop of the spool rings"),
        fault("slow_spool", Category::Dynamics, "the pilot stage or the solenoid has lost force")
            .scales("opening_time_s", 20.0, (1.0, 1000.0)),
        bias_positive(),
        bias_negative(),
        gain_high("too much stroke per signal"),
        gain_low("too little stroke per signal"),
        fault("wear", Category::InternalLeakage, "worn lands: each leaks 3 L/min more at 100 bar")
            .adds("leakage_m3_s_pa", 5e-12, (1e-14, 1e-7)),
        edge_wear("wear_pa", "pa_overlap", "edge P-A is eroded"),
        edge_wear("wear_pb", "pb_overlap", "edge P-B is eroded"),
        edge_wear("wear_at", "at_overlap", "edge A-T is eroded"),
        edge_wear("wear_bt", "bt_overlap", "edge B-T is eroded"),
        jam(),
    ],
    ports: &ports("signal per unit of full signal"),
    states: &states(),
    connect,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let (inputs, rates) = motion_variables(wiring);
    wiring.equation(ControlledSpool, inputs, rates);
    for (which, (inputs, flow)) in edges(wiring).into_iter().enumerate() {
        wiring.equation_of(which, RatedEdge, inputs, [flow]);
    }
}

/// Equations (W1)–(W3): (signal, x, v) → (x', v').
pub(crate) struct ControlledSpool;

impl Equation<3, 2, SPOOL_CONSTANTS> for ControlledSpool {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; SPOOL_CONSTANTS] {
        spool_constants(Spool {
            stroke_m: given[index::stroke_m],
            natural_frequency_hz: given[index::natural_frequency_hz],
            damping_ratio: given[index::damping_ratio],
            slew_rate_m_s: given[index::stroke_m] / given[index::opening_time_s],
            null_bias: given[index::null_bias],
            current_gain: given[index::current_gain],
            breakaway: given[index::breakaway],
            stop: STOP.map(S::constant),
        })
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; SPOOL_CONSTANTS], inputs: [S; 3]) -> [S; 2] {
        spool_motion(c, inputs, S::constant(1.0))
    }
}

/// Equations (PV1) and (PV2): (x, transmission, p_up, p_down) → flow. `which` is the edge: 0 for PA, 1 for PB,
/// 2 for AT, 3 for BT.
pub(crate) struct RatedEdge;

impl Equation<4, 1, 6> for RatedEdge {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 6] {
        let one = S::constant(1.0);
        let overlap = given[OVERLAPS[given.which]];
        let per_stroke = one / ((one - overlap) * given[index::stroke_m]);
        let density = given[index::rated_density_kg_m3] / given.fluid.density_kg_m3;
        let full = given[index::rated_flow_m3_s] * (density / given[index::rated_drop_pa]).sqrt();
        [
            S::constant(ORIENTATIONS[given.which]) * per_stroke,
            overlap / (one - overlap),
            given[index::smoothing] * given[index::smoothing],
            full * given[SHARES[given.which]] * S::constant(0.5),
            given[index::transition_pa] * given[index::transition_pa],
            given[index::leakage_m3_s_pa],
        ]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 6], [x, transmission, up, down]: [S; 4]) -> [S; 1] {
        let [per_stroke, overlap, smoothing, half_of_full, transition, leakage] = *c;
        let travel = x * per_stroke - overlap;
        let twice_open = travel + (travel * travel + smoothing).sqrt();
        let drop = up - down;
        let root = (drop * drop + transition).sqrt().sqrt();
        [transmission * drop * (twice_open * half_of_full / root + leakage)]
    }
}

#[cfg(test)]
mod tests {
    use super::super::contract::constants;
    use super::*;

    /// Flow in L/min through an edge of a valve rated at 60 L/min and 5 bar.
    fn flow(changes: &[(&str, f64)], which: usize, stroke: f64, bar: f64) -> f64 {
        let all = [&[("rated_flow_m3_s", 1e-3)], changes].concat();
        let c = constants(RatedEdge, &PROPORTIONAL_VALVE, &all, which);
        RatedEdge::evaluate(&c, [stroke * 1e-3, 1.0, 1e5 + bar * 1e5, 1e5])[0] * 6e4
    }

    #[track_caller]
    fn assert_close(value: f64, expected: f64, tolerance: f64) {
        assert!((value / expected - 1.0).abs() < tolerance, "{value} instead of {expected}");
    }

    #[test]
    fn an_open_edge_passes_the_rated_flow_with_any_overlap() {
        let density = constants_density();
        let expected = 60.0 * (865.0 / density).sqrt();
        for overlap in [0.0, 0.2, -0.1] {
            for (which, sign) in [(0, 1.0), (1, -1.0), (2, -1.0), (3, 1.0)] {
                let names = ["pa_overlap", "pb_overlap", "at_overlap", "bt_overlap"];
                let changes = [(names[which], overlap), ("leakage_m3_s_pa", 0.0)];
                assert_close(flow(&changes, which, sign, 5.0), expected, 1e-3);
                assert_close(flow(&changes, which, sign, 20.0), 2.0 * expected, 1e-3);
                assert_close(flow(&changes, which, sign, -5.0), -expected, 1e-3);
            }
        }
    }

    /// Density of the fluid in [`constants`], kg/m³.
    fn constants_density() -> f64 {
        let half = [("rated_density_kg_m3", 1000.0), ("leakage_m3_s_pa", 0.0)];
        1000.0 / (flow(&half, 0, 1.0, 5.0) / 60.0).powi(2)
    }

    #[test]
    fn inside_the_overlap_only_the_land_leaks() {
        let changes = [("pa_overlap", 0.2), ("leakage_m3_s_pa", 1e-12)];
        // 10⁻¹² m³/(s Pa) at 100 bar are 0.6 L/min.
        assert_close(flow(&changes, 0, 0.1, 100.0), 0.6, 0.02);
        assert!(flow(&changes, 0, 0.21, 100.0) > 2.0 * flow(&changes, 0, 0.19, 100.0));
    }

    #[test]
    fn small_drops_make_flows_in_proportion() {
        let changes = [("leakage_m3_s_pa", 0.0)];
        assert_close(flow(&changes, 0, 1.0, 0.002) / flow(&changes, 0, 1.0, 0.001), 2.0, 1e-3);
    }
}
