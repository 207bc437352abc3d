//! A sine whose frequency changes from one value to another (chirp), in Hermite cubics.
//!
//! With x the time since the beginning, T the length, f_0 and f_1 the ends and L = ln(f_1/f_0)/T, the phase in periods
//! is
//!
//! (SW1)  φ = f_0 x + (f_1 − f_0) x²/(2T)            linear
//!
//! (SW2)  φ = f_0 (e^{L x} − 1)/L                     logarithmic
//!
//! and s = A sin 2πφ. With ω = 2πφ′ and derivatives of ω the fourth derivative of s is at most
//!
//! (SW3)  M = A (ω⁴ + 6 ω² |ω′| + 3 ω′² + 4 ω |ω″| + |ω‴|)
//!
//! so pieces of h = (384 · 9e-10 A / M)^{1/4} keep the error below 1e-9 A. The last value holds after T.

use super::error::SignalError;
use super::sine::sin_cos_of_periods;
use super::spec::{Fallback::*, Given, Kind, Range::*, Sort::*, parameter, words};
use servotwin_model::math::{exp, ln};
use servotwin_model::signal::Piecewise;
use std::f64::consts::TAU;

const ERROR: f64 = 9e-10;

pub(super) static SWEEP: Kind = Kind {
    name: "sweep",
    summary: "a sine with a rising or falling frequency",
    example: "sweep:amplitude=2deg,from=0.1Hz,to=10Hz",
    parameters: &[
        parameter("amplitude", Value, Any, Required, "peak value"),
        parameter("from", Frequency, Between(1e-4, 1e3), Required, "frequency at the start"),
        parameter("to", Frequency, Between(1e-4, 1e3), Required, "frequency at the end"),
        words(
            "law",
            Choice(&["log", "linear"]),
            Word("log"),
            "how the frequency changes over time",
        ),
        parameter("at", Time, NotNegative, Number(0.0), "start time"),
        parameter(
            "length",
            Time,
            Positive,
            Without("the rest of the run"),
            "duration of the sweep",
        ),
    ],
    build,
};

/// The phase law of a sweep.
#[derive(Clone, Copy)]
enum Law {
    Linear { from_hz: f64, growth_hz_s: f64 },
    Logarithmic { from_hz: f64, growth_per_s: f64 },
}

impl Law {
    fn new(law: &str, from_hz: f64, to_hz: f64, length_s: f64) -> Self {
        // With equal ends, the logarithmic rate would be zero, and the phase divides by it.
        if law == "linear" || from_hz == to_hz {
            Law::Linear { from_hz, growth_hz_s: (to_hz - from_hz) / length_s }
        } else {
            Law::Logarithmic { from_hz, growth_per_s: ln(to_hz / from_hz) / length_s }
        }
    }

    /// Phase in periods, and frequency in Hz.
    fn at(self, x_s: f64) -> (f64, f64) {
        match self {
            Law::Linear { from_hz, growth_hz_s } => {
                (x_s * (from_hz + 0.5 * growth_hz_s * x_s), from_hz + growth_hz_s * x_s)
            }
            Law::Logarithmic { from_hz, growth_per_s } => {
                let frequency_hz = from_hz * exp(growth_per_s * x_s);
                ((frequency_hz - from_hz) / growth_per_s, frequency_hz)
            }
        }
    }

    /// The longest piece allowed by (SW3) at the frequency of `x_s`.
    fn piece_s(self, x_s: f64) -> f64 {
        let omega = TAU * self.at(x_s).1;
        let (first, second, third) = match self {
            Law::Linear { growth_hz_s, .. } => (TAU * growth_hz_s.abs(), 0.0, 0.0),
            Law::Logarithmic { growth_per_s, .. } => {
                let l = growth_per_s.abs();
                (omega * l, omega * l * l, omega * l * l * l)
            }
        };
        let square = omega * omega;
        let bound = square * square
            + 6.0 * square * first
            + 3.0 * first * first
            + 4.0 * omega * second
            + third;
        (384.0 * ERROR / bound).sqrt().sqrt()
    }
}

fn build(given: &Given) -> Result<Piecewise, SignalError> {
    let (amplitude, at_s) = (given.number("amplitude"), given.number("at"));
    let length_s = given.optional("length").unwrap_or(given.duration_s - at_s);
    if length_s <= 0.0 {
        return Err(given.impossible("'at' must be before the end of the run"));
    }
    let law = Law::new(given.word("law"), given.number("from"), given.number("to"), length_s);
    let mut points = (vec![], vec![], vec![]);
    // The shortest piece is at one of the ends, where the frequency is highest.
    given.few_points(length_s / law.piece_s(0.0).min(law.piece_s(length_s)))?;
    let mut push = |x_s: f64| {
        let (periods, frequency_hz) = law.at(x_s);
        let (sin, cos) = sin_cos_of_periods(periods);
        points.0.push(at_s + x_s);
        points.1.push(amplitude * sin);
        points.2.push(amplitude * TAU * frequency_hz * cos);
    };
    let mut x_s = 0.0;
    while x_s < length_s {
        push(x_s);
        // The frequency is monotone, so the bound is the larger of those at the two ends.
        let h = law.piece_s(x_s);
        x_s += h.min(law.piece_s((x_s + h).min(length_s)));
    }
    push(length_s);
    Ok(Piecewise::hermite(&points.0, &points.1, &points.2)?)
}
