//! A continuous controller with proportional, integral and derivative parts.
//!
//! ```text
//! e  = w + b − x,   de_f/dt = (e − e_f)/τ_d                                (PI1)
//! y  = K (e + T_d (e − e_f)/τ_d) + z                                       (PI2)
//! z' = K_i (K e + u − y)                                                   (PI3)
//! u  = clamp(y, y_min, y_max − (1 − s) (y_max − y_min))                    (PI4)
//! ```
//!
//! s is the share of its range that the output stage reaches. It is a share of the range and not of y_max, so
//! the limits keep their order whatever their signs are.
//!
//! All signals are pure numbers: scale an input with a `gain`, or use a sensor's share of its range. The
//! derivative is filtered with τ_d. The integral does not wind up: beyond a limit, it follows the output with
//! the time constant 1/K_i.
//!
//! Source: Åström & Hägglund 1995: the filtered derivative, and the tracking that stops the integral.

use super::gain::{gain_high, gain_low};
use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Category, Unit, declare::*};
use crate::wiring::{Output, Wiring};
use alloc::string::String;

parameters! {
    gain: parameter(1.0, (-1e6, 1e6), "gain K"),
    integral_gain_per_s: parameter(0.0, (0.0, 1e4), "integral gain K_i"),
    derivative_time_s: parameter(0.0, (0.0, 1e3), "derivative time T_d"),
    derivative_filter_s: parameter(0.01, (1e-5, 1e3), "filter time constant τ_d of the derivative"),
    least: parameter(-1.0, (-1e6, 1e6), "minimum output y_min"),
    largest: parameter(1.0, (-1e6, 1e6), "maximum output y_max"),
    offset: parameter(0.0, (-1e6, 1e6), "offset b added to the setpoint"),
    reach: parameter(1.0, (0.0, 1.0), "share s of the range that the output reaches"),
}

/// A PID controller; see the module documentation.
pub(crate) static PID_CONTROLLER: Component = Component {
    kind: "pid_controller",
    summary: "proportional, integral and derivative controller of pure numbers",
    parameters: &PARAMETERS,
    faults: &[
        gain_low("gain"),
        gain_high("gain"),
        fault("bias_positive", Category::Bias, "null shift").adds("offset", 0.2, (0.0, 1e6)),
        fault("bias_negative", Category::Bias, "null shift").adds("offset", -0.2, (-1e6, 0.0)),
        fault(
            "output_loss",
            Category::Calibration,
            "the output stage does not reach its maximum output",
        )
        .scales("reach", 0.75, (0.0, 1.0)),
    ],
    ports: &[
        input("setpoint", Unit::None, "setpoint w"),
        input("measured", Unit::None, "measured value x"),
        output("output", Unit::None, "output u of the controller"),
    ],
    states: &[
        state("integral", 1.0, "integral part z of the output"),
        state("slow_error", 1.0, "filtered error e_f"),
    ],
    connect,
    check,
    ..Component::PLAIN
};

fn check(parameters: &[f64]) -> Result<(), String> {
    if parameters[index::least] < parameters[index::largest] {
        return Ok(());
    }
    Err("least must be below largest".into())
}

fn connect(wiring: &mut Wiring) {
    let [setpoint, measured] = ["setpoint", "measured"].map(|port| wiring.signal(port));
    let [integral, slow] = ["integral", "slow_error"].map(|state| wiring.state(state));
    let output = wiring.internal();
    let outputs = [Output::add(output), wiring.rate("integral"), wiring.rate("slow_error")];
    wiring.equation(PidLaw, [setpoint, measured, integral, slow], outputs);
    wiring.set("output", output.variable());
}

/// Equations (PI1)–(PI4): (setpoint, measured, integral, slow error) → output and both rates.
pub(crate) struct PidLaw;

impl Equation<4, 3, 7> for PidLaw {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 7] {
        let per_filter = S::constant(1.0) / given[index::derivative_filter_s];
        [
            given[index::gain],
            given[index::integral_gain_per_s],
            given[index::derivative_time_s] * per_filter,
            per_filter,
            given[index::least],
            highest(given),
            given[index::offset],
        ]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 7], inputs: [S; 4]) -> [S; 3] {
        let [setpoint, measured, integral, slow] = inputs;
        let error = setpoint + c[6] - measured;
        let fast = error - slow;
        let proportional = error * c[0];
        let demand = proportional + fast * c[2] * c[0] + integral;
        let output = demand.clamp(S::from_base(c[4]), S::from_base(c[5]));
        [output, (proportional + output - demand) * c[1], fast * c[3]]
    }
}

/// The upper limit of (PI4). It equals y_max to the last bit at full range, and rounding never takes it below y_min.
fn highest<S: Scalar>(given: &Given<S>) -> S {
    let (least, largest) = (given[index::least], given[index::largest]);
    let lost = (S::constant(1.0) - given[index::reach]) * (largest - least);
    (largest - lost).max(least)
}

#[cfg(test)]
mod tests {
    use super::super::contract::constants;
    use super::*;

    #[test]
    fn its_three_parts_add_and_end_at_the_limits() {
        let changes = [
            ("gain", 2.0),
            ("integral_gain_per_s", 3.0),
            ("derivative_time_s", 0.1),
            ("derivative_filter_s", 0.02),
        ];
        let c = constants(PidLaw, &PID_CONTROLLER, &changes, 0);
        let [output, integral, slow] = PidLaw::evaluate(&c, [0.1, 0.05, 0.2, 0.03]);
        // 2 (0.05 + 0.1 (0.05 − 0.03)/0.02) + 0.2
        assert!((output - 0.5).abs() < 1e-12, "{output}");
        assert!((integral - 3.0 * 0.1).abs() < 1e-12 && (slow - 1.0).abs() < 1e-12);
        let [output, integral, _] = PidLaw::evaluate(&c, [5.0, 0.0, 0.0, 5.0]);
        assert_eq!((output, integral), (1.0, 3.0));
        // An offset acts like a setpoint.
        let shifted = constants(PidLaw, &PID_CONTROLLER, &[("offset", 0.05)], 0);
        let healthy = constants(PidLaw, &PID_CONTROLLER, &[], 0);
        let wanted = |c, setpoint| PidLaw::evaluate(c, [setpoint, 0.25, 0.0, 0.0]);
        assert_eq!(wanted(&shifted, 0.5), wanted(&healthy, 0.55));
    }

    #[test]
    fn a_loss_of_output_moves_the_upper_limit_to_the_lower_one_and_never_beyond() {
        let fault = PID_CONTROLLER.faults[PID_CONTROLLER.fault("output_loss").unwrap()];
        let limits = |least: f64, largest: f64, reach: f64| {
            let changes = [("least", least), ("largest", largest), ("reach", reach)];
            let c = constants(PidLaw, &PID_CONTROLLER, &changes, 0);
            let output = |demand: f64| PidLaw::evaluate(&c, [0.0, 0.0, demand, 0.0])[0];
            (output(-1e7), output(1e7))
        };
        for (least, largest) in [(-1.0, 1.0), (0.2, 0.9), (-0.9, -0.2), (-1.0, 0.0), (0.0, 1.0)] {
            let mut before = largest;
            for intensity in [0.0, 0.1, 0.3, 0.5, 0.7, 1.0] {
                for full in [fault.full_min, fault.full, fault.full_max] {
                    let reach = fault.law.apply(1.0, intensity, full);
                    let (low, high) = limits(least, largest, reach);
                    assert!(low == least && (least..=largest).contains(&high), "{low} … {high}");
                }
                let (_, high) = limits(least, largest, fault.law.apply(1.0, intensity, fault.full));
                assert!(if intensity == 0.0 { high == largest } else { high < before }, "{high}");
                before = high;
            }
            let (_, nothing) = limits(least, largest, 0.0);
            assert!(nothing - least < 1e-15, "all of the range is lost: {nothing}");
        }
        assert_eq!(limits(-1.0, 1.0, fault.full), (-1.0, 0.5));
    }

    #[test]
    fn limits_in_the_wrong_order_are_impossible() {
        assert!((PID_CONTROLLER.check)(&[1.0, 0.0, 0.0, 0.01, 1.0, 1.0, 0.0, 1.0]).is_err());
    }
}
