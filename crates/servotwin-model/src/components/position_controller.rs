//! The continuous position loop of one actuator.
//!
//! ```text
//! e = r sin(θ_c) + x_rig − x_m + x_corr                                    (K1)
//! y = K_p e − K_d (Δp − d)/p_ref,   dd/dt = (Δp − d)/τ                      (K2)
//! u = mode · clamp(y, −1, 1)                                              (K3)
//! ```
//!
//! The law is proportional, with dynamic pressure feedback. The washout `d` removes the steady load from
//! Δp = p_A − p_B, so only the changes of Δp damp the loop. `u` is per unit of the rated current. Mode 0
//! switches the output off.
//!
//! Source: the position loop of Merritt 1967, with the dynamic pressure feedback that is built into servo
//! valves of that name.

use super::gain::{gain_high, gain_low};
use crate::component::{Component, SteadyGain};
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Category, Fault, Port, Unit, declare::*};
use crate::wiring::{Output, Wiring};
use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::FRAC_PI_2;

// The sampled controller shares these parameters.
parameters! {
    arm_m: parameter(0.0525, (1e-4, 100.0), "lever arm r from angle to stroke"),
    gain_per_m: parameter(272.0, (0.0, 1e6), "position gain K_p"),
    pressure_gain: parameter(0.45, (0.0, 100.0), "pressure feedback gain K_d"),
    pressure_reference_pa: parameter(20.684e6, (1e3, 1e9), "reference pressure p_ref"),
    washout_s: parameter(0.10, (1e-4, 1e3), "washout time constant τ"),
    rig_offset_m: parameter(0.0, (-1.0, 1.0), "rigging offset x_rig"),
    correction_m: parameter(0.0, (-1.0, 1.0), "constant correction x_corr"),
    mode: parameter(1.0, (0.0, 1.0), "1 active, 0 off"),
}

/// The faults of a position loop: a wrong gain or a wrong zero of its amplifier.
pub(crate) const LOOP_FAULTS: [Fault; 4] = {
    const fn bias(name: &'static str, full_m: f64, range_m: (f64, f64)) -> Fault {
        let summary = "null shift: the loop holds another position";
        fault(name, Category::Bias, summary).adds("rig_offset_m", full_m, range_m)
    }
    [
        gain_low("gain_per_m"),
        gain_high("gain_per_m"),
        bias("bias_positive", 4e-3, (0.0, 1.0)),
        bias("bias_negative", -4e-3, (-1.0, 0.0)),
    ]
};

/// The faults of the controller, which the sampled controller shares.
pub(crate) const FAULTS: [Fault; 5] = {
    let [low, high, positive, negative] = LOOP_FAULTS;
    let feedback_loss =
        fault("feedback_loss", Category::Dynamics, "pressure feedback no longer damps the loop")
            .scales("pressure_gain", 0.0, (0.0, 1.0));
    [low, high, positive, negative, feedback_loss]
};

/// The ports of the controller, which the sampled controller shares.
pub(crate) const PORTS: [Port; 7] = [
    input_within("command", Unit::Radian, (-FRAC_PI_2, FRAC_PI_2), "commanded angle θ_c"),
    input("position", Unit::Metre, "measured ram position x_m"),
    input("pressure_a", Unit::Pascal, "measured chamber pressure p_A"),
    input("pressure_b", Unit::Pascal, "measured chamber pressure p_B"),
    input_or("correction", Unit::Metre, "correction_m", "correction from a force-fight equaliser"),
    input_or("mode", Unit::None, "mode", "1 active, 0 off"),
    output("current", Unit::None, "valve current per unit of the rated current"),
];

/// A continuous position loop; see the module documentation.
pub(crate) static POSITION_CONTROLLER: Component = Component {
    kind: "position_controller",
    summary: "position loop with dynamic pressure feedback",
    parameters: &PARAMETERS,
    faults: &FAULTS,
    ports: &PORTS,
    states: &[state("washout_pa", 2e7, "slow part d of the differential pressure")],
    connect,
    steady_gains,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let demand = wiring.internal();
    let inputs = ["command", "position", "correction"].map(|p| wiring.signal(p));
    wiring.equation(PositionDemand, inputs, [Output::add(demand)]);
    let [a, b] = ["pressure_a", "pressure_b"].map(|p| wiring.signal(p));
    let inputs = [a, b, wiring.state("washout_pa")];
    let rate = wiring.derivative("washout_pa");
    let outputs = [Output::subtract(demand), Output::add(rate)];
    wiring.equation(PressureFeedback, inputs, outputs);
    let inputs = [demand.variable(), wiring.signal("mode")];
    wiring.output("current", LimitedCurrent, inputs);
}

fn steady_gains(parameters: &[f64]) -> Vec<SteadyGain> {
    loop_gains(parameters)
}

/// How the current of a position loop follows what its sensors read: (K1) and (K2) for changes that are fast beside the
/// washout.
pub(crate) fn loop_gains(parameters: &[f64]) -> Vec<SteadyGain> {
    let of_pressure = parameters[index::pressure_gain] / parameters[index::pressure_reference_pa];
    let gain = |from, gain| SteadyGain { from, to: "current", gain };
    vec![
        gain("position", -parameters[index::gain_per_m]),
        gain("pressure_a", -of_pressure),
        gain("pressure_b", of_pressure),
    ]
}

/// The constants of [`demand`].
pub(crate) fn demand_constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 3] {
    [given[index::arm_m], given[index::rig_offset_m], given[index::gain_per_m]]
}

/// Equation (K1) and the first term of (K2).
#[inline(always)]
pub(crate) fn demand<S: Scalar>(c: &[S::Base; 3], [command, position, correction]: [S; 3]) -> S {
    (command.sin() * c[0] + c[1] - position + correction) * c[2]
}

/// `K_d/p_ref` of (K2).
pub(crate) fn feedback_gain<S: Scalar<Base = S>>(given: &Given<S>) -> S {
    given[index::pressure_gain] / given[index::pressure_reference_pa]
}

/// The second term of (K2): the part subtracted from the demand, and the rate of the washout. The
/// constants are `[K_d/p_ref, 1/τ]`, the inputs `[p_A, p_B, d]`.
#[inline(always)]
pub(crate) fn feedback<S: Scalar>(c: &[S::Base; 2], [p_a, p_b, washout]: [S; 3]) -> [S; 2] {
    let change = p_a - p_b - washout;
    [change * c[0], change * c[1]]
}

/// Equation (K3): the current from the demand and the mode.
#[inline(always)]
pub(crate) fn limited<S: Scalar>(demand: S, mode: S) -> S {
    demand.clamp(S::constant(-1.0), S::constant(1.0)) * mode
}

/// Equation (K1) and the first term of (K2): (command, position, correction) →
/// demand.
pub(crate) struct PositionDemand;

impl Equation<3, 1, 3> for PositionDemand {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 3] {
        demand_constants(given)
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 3], inputs: [S; 3]) -> [S; 1] {
        [demand(c, inputs)]
    }
}

/// The second term of (K2): (p_A, p_B, washout) → part subtracted from the demand, rate of
/// the washout.
pub(crate) struct PressureFeedback;

impl Equation<3, 2, 2> for PressureFeedback {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 2] {
        [feedback_gain(given), S::constant(1.0) / given[index::washout_s]]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 2], inputs: [S; 3]) -> [S; 2] {
        feedback(c, inputs)
    }
}

/// Equation (K3): (demand, mode) → current.
pub(crate) struct LimitedCurrent;

impl Equation<2, 1, 0> for LimitedCurrent {
    #[inline(always)]
    fn evaluate<S: Scalar>(_: &[S::Base; 0], [demand, mode]: [S; 2]) -> [S; 1] {
        [limited(demand, mode)]
    }
}

#[cfg(test)]
mod tests {
    use super::super::contract::constants;
    use super::*;

    /// The declared gains are the slopes of (K1) and (K2).
    #[test]
    fn the_gains_of_the_loop_are_those_of_its_equations() {
        let demand = constants(PositionDemand, &POSITION_CONTROLLER, &[], 0);
        let feedback = constants(PressureFeedback, &POSITION_CONTROLLER, &[], 0);
        let current = |[position, p_a, p_b]: [f64; 3]| {
            let [wanted] = PositionDemand::evaluate(&demand, [0.1, position, 0.0]);
            let [damping, _] = PressureFeedback::evaluate(&feedback, [p_a, p_b, 0.0]);
            wanted - damping
        };
        let at_rest = current([0.0; 3]);
        let parameters: Vec<f64> = PARAMETERS.iter().filter_map(|known| known.default).collect();
        let gains = (POSITION_CONTROLLER.steady_gains)(&parameters);
        for (place, change) in [1e-3, 1e5, 1e5].into_iter().enumerate() {
            let mut readings = [0.0; 3];
            readings[place] = change;
            let slope = (current(readings) - at_rest) / change;
            let SteadyGain { from, gain, .. } = gains[place];
            assert!((slope / gain - 1.0).abs() < 1e-9, "{from}: {gain} instead of {slope}");
        }
    }
}
