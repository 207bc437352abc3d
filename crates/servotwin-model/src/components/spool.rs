//! The common part of valves with one spool and four edges: the spool's motion, its edges, ports,
//! states and faults. [`super::servo_valve`] gives the equations (W1) to (W3).

use super::contact::{END_STOP_CONSTANTS, end_stop, end_stop_constants};
use crate::scalar::Scalar;
use crate::spec::{Category, Fault, Parameter, Port, State, Unit, declare::*};
use crate::wiring::{Output, Variable, Wiring};

/// Whether each edge opens with the spool or against it, in the order of `which`.
pub(crate) const ORIENTATIONS: [f64; 4] = [1.0, -1.0, -1.0, 1.0];

/// Upstream and downstream port of each edge, in the order of `which`.
const EDGES: [(&str, &str); 4] = [("p", "a"), ("p", "b"), ("a", "t"), ("b", "t")];

/// The ports of a valve whose spool follows a current or signal.
pub(crate) const fn ports(current: &'static str) -> [Port; 7] {
    [
        hydraulic("p", "supply"),
        hydraulic("t", "return"),
        hydraulic("a", "control port A"),
        hydraulic("b", "control port B"),
        input("current", Unit::None, current),
        input_or("transmission", Unit::None, "transmission", "factor on the flow of all edges"),
        output("spool_position", Unit::Metre, "spool position; positive opens p → a"),
    ]
}

/// The states of the spool.
pub(crate) const fn states() -> [State; 2] {
    [
        state("spool_position_m", 1e-3, "spool position"),
        // The samples of an oscillating valve depend on the velocity.
        state("spool_velocity_m_s", 0.1, "spool velocity before its limit").with_error_weight(2.0),
    ]
}

/// Fault: dirt narrows an edge. `parameter` is its width or share.
pub(crate) const fn clogging(
    name: &'static str,
    parameter: &'static str,
    summary: &'static str,
) -> Fault {
    fault(name, Category::Clogging, summary).scales(parameter, 0.05, (0.0, 1.0))
}

/// Fault: the spool is slow.
pub(crate) const fn natural_frequency_loss(summary: &'static str) -> Fault {
    let name = "natural_frequency_loss";
    fault(name, Category::Dynamics, summary).shrinks("natural_frequency_hz", 0.03, (1e-3, 1.0))
}

/// Fault: the spool oscillates.
pub(crate) const fn damping_loss(summary: &'static str) -> Fault {
    fault("damping_loss", Category::Dynamics, summary).shrinks("damping_ratio", 0.03, (1e-3, 1.0))
}

/// Fault: the null moves towards p → a.
pub(crate) const fn bias_positive() -> Fault {
    let summary = "null shift toward p → a";
    fault("bias_positive", Category::Bias, summary).adds("null_bias", 0.40, (0.0, 2.0))
}

/// Fault: the null moves towards p → b.
pub(crate) const fn bias_negative() -> Fault {
    let summary = "null shift toward p → b";
    fault("bias_negative", Category::Bias, summary).adds("null_bias", -0.40, (-2.0, 0.0))
}

/// Fault: the stroke is larger than commanded.
pub(crate) const fn gain_high(summary: &'static str) -> Fault {
    fault("gain_high", Category::Calibration, summary).adds("current_gain", 1.0, (0.0, 10.0))
}

/// Fault: the stroke is smaller than commanded.
pub(crate) const fn gain_low(summary: &'static str) -> Fault {
    fault("gain_low", Category::Calibration, summary).adds("current_gain", -0.8, (-2.0, 0.0))
}

/// Fault: dirt holds the spool.
pub(crate) const fn jam() -> Fault {
    let summary = "dirt holds the spool until the difference to its command is large enough";
    fault("jam", Category::Jamming, summary).adds("breakaway", 1.0, (0.0, 1.0))
}

/// The parameter that [`jam`] raises.
pub(crate) const fn breakaway(name: &'static str) -> Parameter {
    let summary =
        "difference to the command, per unit of the largest, below which the spool sticks";
    parameter(name, 0.0, (0.0, 1.0), summary)
}

/// The variables of the spool's motion. The inputs are current, position and velocity, the outputs the rates of
/// position and velocity.
pub(crate) fn motion_variables(wiring: &mut Wiring) -> ([Variable; 3], [Output; 2]) {
    let position = wiring.state("spool_position_m");
    let velocity = wiring.state("spool_velocity_m_s");
    wiring.set("spool_position", position);
    let rates = [wiring.rate("spool_position_m"), wiring.rate("spool_velocity_m_s")];
    ([wiring.signal("current"), position, velocity], rates)
}

/// What the flow through each edge reads, (x, transmission, p_up, p_down), and the transfer of this flow.
pub(crate) fn edges(wiring: &mut Wiring) -> [([Variable; 4], Output); 4] {
    let position = wiring.state("spool_position_m");
    let transmission = wiring.signal("transmission");
    EDGES.map(|(up, down)| {
        let inputs = [position, transmission, wiring.pressure(up), wiring.pressure(down)];
        (inputs, Output::transfer(wiring.flow(up), wiring.flow(down)))
    })
}

/// The parameters of a spool's motion.
pub(crate) struct Spool<S> {
    pub(crate) stroke_m: S,
    pub(crate) natural_frequency_hz: S,
    pub(crate) damping_ratio: S,
    pub(crate) slew_rate_m_s: S,
    pub(crate) null_bias: S,
    pub(crate) current_gain: S,
    /// Difference to the command below which the spool sticks, per unit of the largest.
    pub(crate) breakaway: S,
    /// Position per unit of stroke, stiffness and damping of the end stops.
    pub(crate) stop: [S; 3],
}

/// Number of constants of [`spool_motion`].
pub(crate) const SPOOL_CONSTANTS: usize = 10 + END_STOP_CONSTANTS;

/// The velocity before its limit up to which nothing but damping brakes it, over the limit; there tanh is 0.96.
const FREE: f64 = 2.0;

/// The rate at which an excess velocity decays, over the natural frequency ω.
const DECAY: f64 = 20.0;

/// The constants of [`spool_motion`].
pub(crate) fn spool_constants<S: Scalar<Base = S>>(spool: Spool<S>) -> [S; SPOOL_CONSTANTS] {
    let omega = spool.natural_frequency_hz * S::constant(2.0 * core::f64::consts::PI);
    let square = omega * omega;
    let [fraction, stiffness, damping] = spool.stop;
    let [a, b, c, d] = end_stop_constants(spool.stroke_m * fraction, stiffness, damping);
    // The spool is at one end stop, and the full command points to the other.
    let largest_m = spool.stroke_m * (fraction + S::constant(1.0));
    [
        spool.current_gain,
        spool.null_bias,
        spool.stroke_m,
        square,
        omega * spool.damping_ratio * S::constant(2.0),
        spool.slew_rate_m_s,
        S::constant(1.0) / spool.slew_rate_m_s,
        largest_m * spool.breakaway,
        spool.slew_rate_m_s * S::constant(FREE),
        omega * S::constant(DECAY),
        a,
        b,
        c,
        d,
    ]
}

/// Equations (W1)–(W3): (current, x, v) → (x', v'), with the speed of the pilot stage per unit of the rated one.
#[inline(always)]
pub(crate) fn spool_motion<S: Scalar>(
    c: &[S::Base; SPOOL_CONSTANTS],
    [current, x, v]: [S; 3],
    speed: S,
) -> [S; 2] {
    let [
        gain,
        bias,
        stroke,
        square,
        damping,
        slew,
        per_slew,
        breakaway,
        free,
        decay,
        ref stop @ ..,
    ] = *c;
    let one = S::constant(1.0);
    let command = (current * gain + bias).clamp(-one, one);
    let difference = command * stroke - x;
    let held = S::from_base(breakaway);
    let driving = difference - difference.clamp(-held, held);
    let free = S::from_base(free);
    let excess = v - v.clamp(-free, free);
    let acceleration = (driving * square - v * damping - excess * decay) * speed;
    let rate = (v * per_slew).tanh() * slew * speed;
    [rate, acceleration - end_stop(x, v, stop)]
}
