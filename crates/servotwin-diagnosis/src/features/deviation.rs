//! The size of each residual: standard deviation on a logarithmic scale, and largest excursion. A tree splits a
//! logarithm more evenly than the variance, whose interesting part lies close to zero.

use super::{Sensors, Sink, Teaches, log_deviation};
use crate::residual::Statistics;

pub(super) fn list<W: Statistics, S: Sink<W::Number>>(sensors: &Sensors, window: &W, out: &mut S) {
    for (i, s) in sensors.0.iter().enumerate() {
        let noise = sensors.noise(&[(i, 1.0)]);
        out.put(log_deviation(window.covariance(i, i), noise), || {
            let meaning = "log10 of the standard deviation of the residual of {}";
            s.feature("log_dev", "log10 of scale", meaning)
        });
        out.put(window.largest(i), || {
            let meaning = "largest magnitude of the residual of {}";
            s.feature("largest", "of scale", meaning).teaching(Teaches::Nobody)
        });
    }
}
