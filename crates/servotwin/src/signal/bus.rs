//! Reconstructs a command from bus samples, using past samples only.
//!
//! Between two samples, the curve is a cubic whose slopes follow from the samples so far:
//!
//! (SB1)  m_k = (3 d_k − d_{k−1})/2,  d_k = (s_k − s_{k−1})/T,  |m_k| ≤ 3 min(|d_k|, |d_{k−1}|)
//!
//! This is the slope of the parabola through three samples. A smooth signal therefore has nearly no corners in its
//! acceleration, which would excite the valve a hundred times a second. The limit prevents overshoot at a step or at
//! the beginning of a ramp. At the end of a ramp, which the slope cannot anticipate, the curve overshoots by a seventh
//! of the last rise. The samples determine the curve to the bit.

use servotwin_model::signal::{CurveError, Piecewise};
use servotwin_model::solver::Knot;

/// State of one signal on the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bus {
    last: Option<f64>,
    difference_per_s: f64,
}

impl Bus {
    /// Takes the next sample; returns its value and slope.
    pub fn next(&mut self, value: f64, period_s: f64) -> Knot {
        let before = self.difference_per_s;
        self.difference_per_s = (value - self.last.unwrap_or(value)) / period_s;
        self.last = Some(value);
        Knot { value, slope_per_s: slope(self.difference_per_s, before) }
    }

    /// The state: the last value, if any, and the last difference, per second.
    pub fn memory(&self) -> (Option<f64>, f64) {
        (self.last, self.difference_per_s)
    }

    /// Restores a bus from its state.
    pub fn from_memory((last, difference_per_s): (Option<f64>, f64)) -> Self {
        Bus { last, difference_per_s }
    }
}

/// Slope (SB1) from the last two differences. NaN does not limit the slope; callers detect and report it.
fn slope(now: f64, before: f64) -> f64 {
    let most = 3.0 * now.abs().min(before.abs());
    (1.5 * now - 0.5 * before).max(-most).min(most)
}

/// A function of time as reconstructed from bus samples.
///
/// # Errors
/// Never for a function that is finite over the duration.
pub fn sent(
    value: impl Fn(f64) -> f64,
    period_s: f64,
    duration_s: f64,
) -> Result<Piecewise, CurveError> {
    let samples = (duration_s / period_s).ceil() as usize + 1;
    let values: Vec<f64> = (0..=samples).map(|k| value(k as f64 * period_s)).collect();
    curve(&values, period_s)
}

/// The curve through samples.
///
/// # Errors
/// There is no sample, or one is not finite.
pub(crate) fn curve(values: &[f64], period_s: f64) -> Result<Piecewise, CurveError> {
    let times_s: Vec<f64> = (0..values.len()).map(|k| k as f64 * period_s).collect();
    let mut bus = Bus::default();
    let slopes = values.iter().map(|&value| bus.next(value, period_s).slope_per_s);
    Piecewise::hermite(&times_s, values, &slopes.collect::<Vec<f64>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_becomes_a_rise_over_one_sample_without_swinging_over() {
        let step = Piecewise::steps(&[0.0, 0.5], &[0.0, 1.0]).unwrap();
        let sent = sent(|time_s| step.value(time_s), 0.1, 1.0).unwrap();
        for k in 0..=1000 {
            let t = f64::from(k) * 1e-3;
            assert!((0.0..=1.0).contains(&sent.value(t)), "{t}: {}", sent.value(t));
            assert!(t > 0.4 || sent.value(t) == 0.0, "nothing of the future: {t}");
            assert!(t < 0.5 || sent.value(t) == 1.0);
        }
    }

    #[test]
    fn what_is_no_number_is_sent_as_it_is_and_stops_nothing() {
        let mut bus = Bus::default();
        for value in [0.0, 1.0, f64::NAN, f64::INFINITY, -f64::INFINITY, f64::NAN] {
            let sent = bus.next(value, 0.01).value;
            assert!(sent == value || sent.is_nan() && value.is_nan(), "{value}: {sent}");
        }
        for k in 0..3 {
            let knot = bus.next(f64::from(k), 0.01);
            assert!(k < 2 || knot.slope_per_s.is_finite(), "healed after two numbers: {knot:?}");
        }
    }

    #[test]
    fn a_slow_signal_comes_out_nearly_as_it_went_in() {
        let times: Vec<f64> = (0..=400).map(|k| f64::from(k) * 0.005).collect();
        let sine = |t: f64| (2.0 * std::f64::consts::PI * t).sin();
        let values: Vec<f64> = times.iter().map(|&t| sine(t)).collect();
        let signal = Piecewise::linear(&times, &values).unwrap();
        let sent = sent(|time_s| signal.value(time_s), 0.01, 2.0).unwrap();
        // At the beginning, the bus has no slope.
        let known = times.iter().filter(|&&t| t > 0.025);
        let worst = known.map(|&t| (sent.value(t) - sine(t)).abs()).fold(0.0, f64::max);
        assert!(worst < 2.5e-4, "{worst}");
    }
}
