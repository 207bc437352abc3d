//! Band-limited white noise, softly limited.
//!
//! White samples w are filtered by a Butterworth low-pass of order 4 (two
//! biquads by the bilinear transform, prewarped), limited and faded in:
//!
//! (SN1)  K = tan(π f_c/f_s),  Q_j = 1/(2 cos(π/8)), 1/(2 cos(3π/8))
//!
//! (SN2)  y = g (w_0 + 2 w_1 + w_2) − a_1 y_1 − a_2 y_2,  g = K²/n,
//!        a_1 = 2 (K² − 1)/n,  a_2 = (1 − K/Q + K²)/n,  n = 1 + K/Q + K²
//!
//! (SN3)  s_k = u(t_k) l tanh(c y_k/l),  u = x² (3 − 2x), x = min(t/t_f, 1)
//!
//! (SN4)  ds/dt_k = (s_{k−2} − 8 s_{k−1} + 8 s_{k+1} − s_{k+2}) f_s/12
//!
//! with cubics through the samples and slopes. Straight lines would have a corner at every sample, and each corner
//! excites the valve. In 90 s of the aileron they double the solver's steps, for frequencies that are not in the
//! signal. The factor c gives s the requested rms over the first `window` seconds, after the limit and the fade-in. The
//! values do not depend on the duration of the run. Without a limit, the tanh is left out.

use super::error::SignalError;
use super::random::NormalDeviates;
use super::spec::{Fallback::*, Given, Kind, Range::*, Sort::*, parameter};
use servotwin_model::math::{sin_cos, tanh};
use servotwin_model::signal::{CurveError, Piecewise};
use servotwin_model::spec::Unit;
use std::f64::consts::PI;

/// The default limit for angles: the travel of an aileron (physics 7.2).
const ANGLE_LIMIT_RAD: f64 = 22.0 * PI / 180.0;

/// The most samples in the window, over which the factor of (SN3) is iterated.
const MOST_IN_WINDOW: f64 = 1e6;
/// The most iterations for the factor.
const MOST_ROUNDS: usize = 60;

pub(super) static NOISE: Kind = Kind {
    name: "noise",
    summary: "band-limited white noise (Butterworth of order 4), softly limited",
    example: "noise:rms=5deg,bandwidth=1Hz,seed=7",
    parameters: &[
        parameter("rms", Value, Positive, Required, "root mean square over the window"),
        parameter(
            "bandwidth",
            Frequency,
            Between(0.01, 1e3),
            Required,
            "the filter's -3 dB frequency",
        ),
        // Integers are read as f64, exact up to 2⁵³.
        parameter(
            "seed",
            Whole,
            Between(0.0, 9_007_199_254_740_992.0),
            Number(1.0),
            "another seed gives another realization",
        ),
        parameter(
            "limit",
            Value,
            Positive,
            Without("22deg for an angle, none for other inputs"),
            "largest magnitude of a sample, at least twice the rms",
        ),
        parameter(
            "sampling",
            Frequency,
            Between(1.0, 1e4),
            Number(100.0),
            "sampling rate, at least 2.5 times the bandwidth",
        ),
        parameter("fade", Time, NotNegative, Number(0.5), "time to fade in from rest"),
        parameter("window", Time, Positive, Number(90.0), "time over which the rms holds"),
    ],
    build,
};

/// One section of the filter (SN2), in transposed direct form II.
struct Biquad {
    gain: f64,
    a: [f64; 2],
    memory: [f64; 2],
}

impl Biquad {
    fn new(k: f64, damping: f64) -> Self {
        let n = 1.0 + k * damping + k * k;
        let a = [2.0 * (k * k - 1.0) / n, (1.0 - k * damping + k * k) / n];
        Self { gain: k * k / n, a, memory: [0.0; 2] }
    }

    fn next(&mut self, input: f64) -> f64 {
        let scaled = self.gain * input;
        let output = scaled + self.memory[0];
        self.memory =
            [2.0 * scaled - self.a[0] * output + self.memory[1], scaled - self.a[1] * output];
        output
    }
}

/// Filtered white noise in steady state.
fn filtered(seed: u64, bandwidth_hz: f64, sampling_hz: f64, count: usize) -> Vec<f64> {
    let (sin, cos) = sin_cos(PI * bandwidth_hz / sampling_hz);
    // The damping 1/Q of the two pole pairs of a Butterworth filter.
    let mut sections =
        [PI / 8.0, 3.0 * PI / 8.0].map(|a| Biquad::new(sin / cos, 2.0 * sin_cos(a).1));
    let mut random = NormalDeviates::new(seed);
    // The slower pair forgets by e^{-2.4} per 1/f_c: 15 of them leave 2e-16.
    let settling = (15.0 * sampling_hz / bandwidth_hz).ceil() as usize;
    let samples = (0..settling + count)
        .map(|_| sections.iter_mut().fold(random.normal(), |value, section| section.next(value)));
    samples.skip(settling).collect()
}

/// The limit and fade-in of (SN3).
struct Shape {
    sampling_hz: f64,
    fade_s: f64,
    limit: Option<f64>,
}

impl Shape {
    fn sample(&self, k: usize, value: f64) -> f64 {
        let x = (k as f64 / self.sampling_hz / self.fade_s.max(f64::MIN_POSITIVE)).min(1.0);
        let limited = self.limit.map_or(value, |limit| limit * tanh(value / limit));
        limited * (x * x * (3.0 - 2.0 * x))
    }

    fn samples(&self, filtered: &[f64], factor: f64) -> Vec<f64> {
        filtered.iter().enumerate().map(|(k, y)| self.sample(k, factor * y)).collect()
    }

    /// The curve by (SN4): all samples but the last two, which only determine slopes.
    fn curve(&self, filtered: &[f64], factor: f64) -> Result<Piecewise, CurveError> {
        let values = self.samples(filtered, factor);
        let count = values.len() - 2;
        let times_s: Vec<f64> = (0..count).map(|k| k as f64 * (1.0 / self.sampling_hz)).collect();
        Piecewise::hermite(&times_s, &values[..count], &slopes(&values, self.sampling_hz))
    }

    /// The factor that gives the curve the requested rms over the window.
    fn factor(&self, filtered: &[f64], rms: f64, window_s: f64) -> Result<f64, CurveError> {
        let mut factor = rms;
        // The limit reduces the rms by at most a third: each iteration halves the error at least.
        for _ in 0..MOST_ROUNDS {
            let curve = self.curve(filtered, factor)?;
            let ratio = rms / curve.mean_square(0.0, window_s).sqrt();
            factor *= ratio;
            if (ratio - 1.0).abs() < 1e-12 {
                break;
            }
        }
        Ok(factor)
    }
}

fn build(given: &Given) -> Result<Piecewise, SignalError> {
    let (rms, bandwidth_hz) = (given.number("rms"), given.number("bandwidth"));
    let sampling_hz = given.number("sampling");
    let fallback = (given.unit == Unit::Radian).then_some(ANGLE_LIMIT_RAD);
    let limit = given.optional("limit").or(fallback);
    if bandwidth_hz > 0.4 * sampling_hz {
        return Err(given.impossible("'bandwidth' must be at most 0.4 times 'sampling'"));
    }
    if limit.is_some_and(|limit| rms > 0.5 * limit) {
        return Err(given.impossible("'rms' must be at most half of 'limit' (22deg for an angle)"));
    }
    let window_s = given.number("window");
    if window_s * bandwidth_hz < 2.0 || window_s < 2.0 * given.number("fade") {
        return Err(
            given.impossible("'window' must last two periods of 'bandwidth' and twice 'fade'")
        );
    }
    given.few_points(window_s.max(given.duration_s) * sampling_hz)?;
    if window_s * sampling_hz > MOST_IN_WINDOW {
        return Err(given.impossible(format!(
            "'window' must hold at most {MOST_IN_WINDOW} samples ({} s at {sampling_hz} Hz): it is gone through \
             up to {MOST_ROUNDS} times; it may be shorter than the run",
            MOST_IN_WINDOW / sampling_hz
        )));
    }
    let shape = Shape { sampling_hz, fade_s: given.number("fade"), limit };
    let count = |seconds: f64| (seconds * sampling_hz).ceil() as usize + 1;
    let (window, run) = (count(window_s), count(given.duration_s));
    let seed = given.number("seed") as u64;
    // Two additional samples determine the slopes at the end.
    let filtered = filtered(seed, bandwidth_hz, sampling_hz, window.max(run) + 2);
    let factor = shape.factor(&filtered[..window + 2], rms, window_s)?;
    Ok(shape.curve(&filtered[..run + 2], factor)?)
}

/// Slopes (SN4) at all samples but the last two; before the first sample, the first value holds.
fn slopes(values: &[f64], sampling_hz: f64) -> Vec<f64> {
    let at = |k: usize, back: usize| {
        if k < back { values[0] } else { values[k - back] }
    };
    let slope = |k: usize| {
        let near = values[k + 1] - at(k, 1);
        let far = values[k + 2] - at(k, 2);
        (8.0 * near - far) * sampling_hz / 12.0
    };
    (0..values.len() - 2).map(slope).collect()
}
