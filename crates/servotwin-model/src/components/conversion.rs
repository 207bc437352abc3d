//! The two conversions that all sensors share, each with its faults.
//!
//! The sensor converts a quantity to an electrical signal, and the computer converts this signal to a number.
//! Either conversion can be biased or miscalibrated:
//!
//! ```text
//! y = (1 + g) x + b                                                       (C1)
//! i = 4 mA + 16 mA · clamp((1 + g_e) x + b_e, 0, 1)                        (C2)
//! x' = (1 + g_d) (i − 4 mA) / 16 mA + b_d                                  (C3)
//! ```
//!
//! `x` and the biases are fractions of full scale. (C2) and (C3) describe the current loop. The sensor's
//! output saturates at full scale.

use crate::equation::Given;
use crate::scalar::Scalar;
use crate::spec::{Category, Fault, Parameter, declare::*};

/// Bias of the first conversion.
pub(crate) const fn bias_electrical(name: &'static str) -> Parameter {
    share(name, (-2.0, 2.0), "bias of the sensor, as a share of full scale")
}

/// Gain error of the first conversion.
pub(crate) const fn gain_electrical(name: &'static str) -> Parameter {
    share(name, (-1.0, 2.0), "gain error of the sensor")
}

/// Bias of the second conversion.
pub(crate) const fn bias_digital(name: &'static str) -> Parameter {
    share(name, (-2.0, 2.0), "bias of the computer's input, as a share of full scale")
}

/// Gain error of the second conversion.
pub(crate) const fn gain_digital(name: &'static str) -> Parameter {
    share(name, (-1.0, 2.0), "gain error of the computer's input")
}

/// Noise, which is added to sampled readings.
pub(crate) const fn noise_sigma(name: &'static str) -> Parameter {
    share(name, (0.0, 1.0), "standard deviation of the noise, as a share of full scale")
}

/// Resolution, which is applied to sampled readings.
pub(crate) const fn bits(name: &'static str) -> Parameter {
    share(name, (0.0, 32.0), "resolution over full scale, in bits; 0 for ideal")
}

const fn share(name: &'static str, range: (f64, f64), summary: &'static str) -> Parameter {
    parameter(name, 0.0, range, summary)
}

/// The faults of both conversions, and one more fault of the sensor itself.
pub(crate) const fn faults(own: Fault) -> [Fault; 9] {
    const fn bias(name: &'static str, parameter: &'static str, full: f64) -> Fault {
        fault(name, Category::Bias, "constant error").adds(parameter, full, (-1.0, 1.0))
    }
    const fn gain(name: &'static str, parameter: &'static str, full: f64) -> Fault {
        fault(name, Category::Calibration, "wrong calibration").adds(parameter, full, (-1.0, 1.0))
    }
    [
        bias("bias_positive", "bias_electrical", 0.20),
        bias("bias_negative", "bias_electrical", -0.20),
        gain("gain_high", "gain_electrical", 0.20),
        gain("gain_low", "gain_electrical", -0.20),
        bias("digital_bias_positive", "bias_digital", 0.20),
        bias("digital_bias_negative", "bias_digital", -0.20),
        gain("digital_gain_high", "gain_digital", 0.20),
        gain("digital_gain_low", "gain_digital", -0.20),
        own,
    ]
}

/// The factor `1 + g` of (C1) from the parameter `g`.
pub(crate) fn factor<S: Scalar<Base = S>>(given: &Given<S>, gain: usize) -> S {
    given[gain] + S::constant(1.0)
}

/// The current at zero scale, A.
pub(crate) const ZERO_A: f64 = 4e-3;
const SPAN_A: f64 = 16e-3;

/// The gain and the offset of [`to_current_a`], which are (C2) without its limits. The quantity is `low` at zero
/// scale and `low + range` at full scale.
pub(crate) fn to_current_constants<S: Scalar<Base = S>>(
    factor: S,
    bias: S,
    low: S,
    range: S,
) -> [S; 2] {
    let gain = factor * S::constant(SPAN_A) / range;
    [gain, bias * S::constant(SPAN_A) + S::constant(ZERO_A) - gain * low]
}

/// Equation (C2): quantity → current, A.
#[inline(always)]
pub(crate) fn to_current_a<S: Scalar>(quantity: S, gain: S::Base, offset: S::Base) -> S {
    (quantity * gain + offset).clamp(S::constant(ZERO_A), S::constant(ZERO_A + SPAN_A))
}

/// The gain and the offset of (C3), for the quantity of [`to_current_constants`] instead of its fraction.
pub(crate) fn from_current_constants<S: Scalar<Base = S>>(
    factor: S,
    bias: S,
    low: S,
    range: S,
) -> [S; 2] {
    let gain = factor * range / S::constant(SPAN_A);
    [gain, bias * range - gain * S::constant(ZERO_A) + low]
}
