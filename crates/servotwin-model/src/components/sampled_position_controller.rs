//! The position loop of one actuator as a computer runs it: sampled, with a
//! zero-order hold and a computation delay.
//!
//! ```text
//! u_k = mode · clamp(K_p e_k − K_d (Δp_k − d_k)/p_ref, −1, 1)               (Z1)
//! d_{k+1} = d_k + (1 − exp(−T/τ)) (Δp_k − d_k)                             (Z2)
//! output = u_{k−n}                                                        (Z3)
//! ```
//!
//! The law and its symbols are those of [`super::position_controller`]. (Z2) is its washout, solved exactly
//! for a held input. The inputs are read at the ticks, `T` apart. `n` is 0, 1 or 2 samples.
//!
//! Source: the zero-order hold of Åström & Wittenmark 1997.

use super::position_controller::{
    self as continuous, FAULTS, PORTS, demand, demand_constants, feedback_gain, limited, loop_gains,
};
use crate::component::{Component, SteadyGain};
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Parameter, declare::*};
use crate::wiring::Wiring;
use alloc::string::String;
use alloc::vec::Vec;

// These parameters follow those of the continuous controller.
parameters! {
    period_s: parameter(0.01, (1e-4, 1.0), "time T between ticks"),
    delay_samples: parameter(0.0, (0.0, 2.0), "computation delay n, in whole samples"),
}

/// Number of parameters of the continuous controller.
const SHARED: usize = continuous::PARAMETERS.len();
const PERIOD: usize = SHARED + index::period_s;
const DELAY: usize = SHARED + index::delay_samples;

const ALL_PARAMETERS: [Parameter; SHARED + PARAMETERS.len()] = {
    let [a, b, c, d, e, f, g, h] = continuous::PARAMETERS;
    let [period, delay] = PARAMETERS;
    [a, b, c, d, e, f, g, h, period, delay]
};

/// A sampled position loop; see the module documentation.
pub(crate) static SAMPLED_POSITION_CONTROLLER: Component = Component {
    kind: "sampled_position_controller",
    summary: "position loop with dynamic pressure feedback, sampled",
    parameters: &ALL_PARAMETERS,
    faults: &FAULTS,
    ports: &PORTS,
    connect,
    check,
    steady_gains,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let [_, newest, delayed, twice_delayed] =
        wiring.sampled(SampledLaw, "period_s", |wiring, held| {
            let signal = |port| wiring.signal(port);
            let [command, position, correction, p_a, p_b, mode] =
                ["command", "position", "correction", "pressure_a", "pressure_b", "mode"]
                    .map(signal);
            let [washout, newest, delayed, _] = held;
            [command, position, correction, p_a, p_b, mode, washout, newest, delayed]
        });
    let delay = wiring.structural("delay_samples") as usize;
    wiring.set("current", [newest, delayed, twice_delayed][delay]);
}

fn check(parameters: &[f64]) -> Result<(), String> {
    if [0.0, 1.0, 2.0].contains(&parameters[DELAY]) {
        Ok(())
    } else {
        Err("delay_samples must be 0, 1 or 2".into())
    }
}

fn steady_gains(parameters: &[f64]) -> Vec<SteadyGain> {
    loop_gains(parameters)
}

/// Equations (Z1)–(Z3): (signals, held values) → (washout, current, current of
/// the last tick, current of the tick before).
pub(crate) struct SampledLaw;

impl Equation<9, 4, 5> for SampledLaw {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 5] {
        let [arm, rig, gain] = demand_constants(given);
        let decay = (-(given[PERIOD] / given[continuous::index::washout_s])).exp();
        [arm, rig, gain, feedback_gain(given), S::constant(1.0) - decay]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 5], inputs: [S; 9]) -> [S; 4] {
        let [command, position, correction, p_a, p_b, mode, washout, newest, delayed] = inputs;
        let change = p_a - p_b - washout;
        let demand = demand(&[c[0], c[1], c[2]], [command, position, correction]);
        let current = limited(demand - change * c[3], mode);
        [washout + change * c[4], current, newest, delayed]
    }
}
