//! Regression of each residual on the twin's own signal: `r' ≈ g s'^VT + b`.
//!
//! A sensor's calibration error has a gain and a correlation near ±1. A bias has an offset and no correlation. A
//! hydraulic fault has neither clearly.

use super::{Noise, Sensors, Sink, correlation};
use crate::number::Number;
use crate::residual::Statistics;

/// Below this deviation, in parts of scale, a twin signal gives no slope.
const LEAST_DEVIATION: f64 = 1e-3;

pub(super) fn list<W: Statistics, S: Sink<W::Number>>(sensors: &Sensors, window: &W, out: &mut S) {
    for (i, s) in sensors.0.iter().enumerate() {
        let covariance = window.cross_covariance(i, i);
        let variance = window.twin_covariance(i, i);
        let least_variance = W::Number::constant(LEAST_DEVIATION * LEAST_DEVIATION);
        let gain = covariance / (variance + least_variance);
        out.put(gain, || {
            s.feature("gain", "1", "slope of the residual over the twin's signal of {}")
        });
        out.put(window.mean(i) - gain * window.twin_mean(i), || {
            s.feature("offset", "of scale", "residual at a twin signal of zero of {}")
        });
        let noise = [sensors.noise(&[(i, 1.0)]), Noise::default()];
        let own = window.covariance(i, i);
        out.put(correlation(covariance, [own, variance], noise), || {
            s.feature("self_corr", "1", "correlation of the residual with the twin's signal of {}")
        });
    }
}
