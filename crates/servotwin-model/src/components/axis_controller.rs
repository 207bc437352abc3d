//! The continuous position loop of a linear axis, whose command is a position.
//!
//! ```text
//! e = x_c + x_rig − x_m                                                   (AX1)
//! y = K_p e + z − K_d (Δp − d)/p_ref,   dd/dt = (Δp − d)/τ                  (AX2)
//! z' = K_i (K_p e + clamp(y, −1, 1) − y)                                   (AX3)
//! u = mode · clamp(y, −1, 1)                                              (AX4)
//! ```
//!
//! The law is proportional and integral, with dynamic pressure feedback if both pressures are connected. The
//! washout `d` removes the steady load from Δp = p_A − p_B. The integral does not wind up: beyond the limit,
//! it follows the output with the time constant 1/K_i. `u` is per unit of the rated current. Mode 0 switches
//! the output off.
//!
//! Source: the loop and the feedback of the position controller. The integral stops by tracking, as in Åström
//! & Hägglund 1995.

use super::position_controller::{LOOP_FAULTS, feedback};
use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Unit, declare::*};
use crate::wiring::{Output, Wiring};

parameters! {
    gain_per_m: parameter(100.0, (0.0, 1e6), "position gain K_p"),
    integral_gain_per_s: parameter(0.0, (0.0, 1e3), "integral gain K_i"),
    pressure_gain: parameter(0.0, (0.0, 100.0), "pressure feedback gain K_d"),
    pressure_reference_pa: parameter(20e6, (1e3, 1e9), "reference pressure p_ref"),
    washout_s: parameter(0.1, (1e-4, 1e3), "washout time constant τ"),
    rig_offset_m: parameter(0.0, (-1.0, 1.0), "rigging offset x_rig"),
    no_pressure_pa: parameter(1e5, (0.0, 1e9), "value of pressures that are not connected"),
    mode: parameter(1.0, (0.0, 1.0), "1 active, 0 off"),
}

/// A linear axis controller; see the module documentation.
pub(crate) static AXIS_CONTROLLER: Component = Component {
    kind: "axis_controller",
    summary: "position loop of a linear axis, with integral and dynamic pressure feedback",
    parameters: &PARAMETERS,
    faults: &LOOP_FAULTS,
    ports: &[
        input_within("command", Unit::Metre, (-10.0, 10.0), "commanded position x_c"),
        input("position", Unit::Metre, "measured position x_m"),
        input_or("pressure_a", Unit::Pascal, "no_pressure_pa", "measured chamber pressure p_A"),
        input_or("pressure_b", Unit::Pascal, "no_pressure_pa", "measured chamber pressure p_B"),
        input_or("mode", Unit::None, "mode", "1 active, 0 off"),
        output("current", Unit::None, "valve current per unit of the rated current"),
    ],
    states: &[
        state("washout_pa", 2e7, "slow part d of the differential pressure"),
        state("integral", 1.0, "integral part z of the output"),
    ],
    connect,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let demand = wiring.internal();
    let [command, position] = ["command", "position"].map(|port| wiring.signal(port));
    let integral = wiring.state("integral");
    let inputs = [command, position, integral];
    wiring.equation(AxisDemand, inputs, [Output::add(demand)]);
    let [a, b] = ["pressure_a", "pressure_b"].map(|port| wiring.signal(port));
    let inputs = [a, b, wiring.state("washout_pa")];
    let rate = wiring.derivative("washout_pa");
    let outputs = [Output::subtract(demand), Output::add(rate)];
    wiring.equation(AxisDamping, inputs, outputs);
    let current = wiring.internal();
    let inputs = [demand.variable(), wiring.signal("mode"), command, position];
    let outputs = [Output::add(current), wiring.rate("integral")];
    wiring.equation(AxisOutput, inputs, outputs);
    wiring.set("current", current.variable());
}

/// Equation (AX1) and the first terms of (AX2): (command, position, integral) → demand.
pub(crate) struct AxisDemand;

impl Equation<3, 1, 2> for AxisDemand {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 2] {
        [given[index::gain_per_m], given[index::rig_offset_m]]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 2], [command, position, integral]: [S; 3]) -> [S; 1] {
        [(command + c[1] - position) * c[0] + integral]
    }
}

/// The last term of (AX2): (p_A, p_B, washout) → part subtracted from the demand, rate of the washout.
pub(crate) struct AxisDamping;

impl Equation<3, 2, 2> for AxisDamping {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 2] {
        [
            given[index::pressure_gain] / given[index::pressure_reference_pa],
            S::constant(1.0) / given[index::washout_s],
        ]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 2], inputs: [S; 3]) -> [S; 2] {
        feedback(c, inputs)
    }
}

/// Equations (AX3) and (AX4): (demand, mode, command, position) → current, rate of the integral.
pub(crate) struct AxisOutput;

impl Equation<4, 2, 3> for AxisOutput {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 3] {
        [given[index::gain_per_m], given[index::rig_offset_m], given[index::integral_gain_per_s]]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 3], inputs: [S; 4]) -> [S; 2] {
        let [demand, mode, command, position] = inputs;
        let output = demand.clamp(S::constant(-1.0), S::constant(1.0));
        let error = (command + c[1] - position) * c[0];
        [output * mode, (error + output - demand) * c[2]]
    }
}

#[cfg(test)]
mod tests {
    use super::super::contract::constants;
    use super::*;

    #[test]
    fn the_integral_grows_with_the_error_and_stops_at_the_limit() {
        let changes = [("gain_per_m", 100.0), ("integral_gain_per_s", 5.0)];
        let c = constants(AxisOutput, &AXIS_CONTROLLER, &changes, 0);
        let [current, rate] = AxisOutput::evaluate(&c, [0.1, 1.0, 2e-3, 1e-3]);
        assert!((current - 0.1).abs() < 1e-15 && (rate - 0.5).abs() < 1e-12, "{current} {rate}");
        // With a constant error, the integral settles where the demand exceeds the limit by the error.
        let [current, rate] = AxisOutput::evaluate(&c, [1.1, 0.5, 2e-3, 1e-3]);
        assert!((current - 0.5).abs() < 1e-15 && rate.abs() < 1e-12, "{current} {rate}");
    }
}
