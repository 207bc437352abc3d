//! The signal of an actuator with the largest disturbance.
//!
//! ```text
//! P_ij = log10 ( rms(r'_i) / rms(r'_j) ),   rms² = mean² + variance
//! ```
//!
//! for every pair of one actuator's sensors. A blocked supply valve disturbs the supply pressure far more than the
//! spool. A clogged edge disturbs the spool and the chambers far more than the supply. This holds at any intensity: the
//! logarithm of the ratio is the fault's direction without its size.

use super::{Feature, Quantity, Sensors, Sink, log_deviation};
use crate::residual::Statistics;
use alloc::format;

/// The sensors of each actuator in pairs.
fn pairs(sensors: &Sensors) -> impl Iterator<Item = (usize, usize)> + '_ {
    let own = move |actuator: usize, from: usize| {
        let is_own = move |sensor: &usize| {
            let s = &sensors.0[*sensor];
            s.actuator == Some(actuator)
                && !matches!(s.quantity, Quantity::Surface | Quantity::Other)
        };
        (from..sensors.0.len()).filter(is_own)
    };
    let of_actuator = move |actuator| {
        own(actuator, 0)
            .flat_map(move |first| own(actuator, first + 1).map(move |second| (first, second)))
    };
    (0..sensors.actuators()).flat_map(of_actuator)
}

pub(super) fn list<W: Statistics, S: Sink<W::Number>>(sensors: &Sensors, window: &W, out: &mut S) {
    let log_rms = |sensor: usize| {
        let mean = window.mean(sensor);
        let mean_square = mean * mean + window.covariance(sensor, sensor);
        log_deviation(mean_square, sensors.noise(&[(sensor, 1.0)]))
    };
    for (first, second) in pairs(sensors) {
        out.put(log_rms(first) - log_rms(second), || {
            let [a, b] = [&sensors.0[first], &sensors.0[second]];
            let name = format!("rms_{}_over_{}", a.name, b.name);
            let meaning =
                format!("log10 of the rms residual of {} over that of {}", a.name, b.name);
            Feature::new(name, "log10", meaning, a.actuator.into_iter().collect())
        });
    }
}
