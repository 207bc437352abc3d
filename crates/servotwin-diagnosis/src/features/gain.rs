//! Regression of each residual on the twin's own signal: `r' ≈ g s'^VT + b`.
//!
//! A sensor's calibration error has a gain and a correlation near ±1. A bias has an offset and no correlation. A
//! hydraulic fault has neither clearly.

use super::{Feature, Formulas, Noise, Sensors, Teaches, correlation};
use crate::number::Number;
use crate::residual::Statistics;
use alloc::format;
use alloc::vec::Vec;

/// The family of this module.
pub(crate) struct Gain;

/// Below this deviation, in parts of scale, a twin signal gives no slope.
const LEAST_DEVIATION: f64 = 1e-3;

impl Formulas for Gain {
    fn name(&self) -> &'static str {
        "gain"
    }

    fn summary(&self) -> &'static str {
        "slope, offset and correlation of each residual against the twin's own signal"
    }

    fn features(&self, sensors: &Sensors) -> Vec<Feature> {
        let of_sensor = |s: &super::Sensor| {
            let feature = |kind: &str, unit, meaning: &str| Feature {
                name: format!("{kind}_{}", s.name),
                unit,
                meaning: format!("{meaning} {}", s.name),
                actuators: s.actuator.into_iter().collect(),
                teaches: Teaches::Everybody,
            };
            [
                feature("gain", "1", "slope of the residual over the twin's signal of"),
                feature("offset", "of scale", "residual at a twin signal of zero of"),
                feature("self_corr", "1", "correlation of the residual with the twin's signal of"),
            ]
        };
        sensors.0.iter().flat_map(of_sensor).collect()
    }

    fn append<W: Statistics>(&self, sensors: &Sensors, window: &W, values: &mut Vec<W::Number>) {
        for i in 0..sensors.0.len() {
            let covariance = window.cross_covariance(i, i);
            let variance = window.twin_covariance(i, i);
            let least_variance = W::Number::constant(LEAST_DEVIATION * LEAST_DEVIATION);
            let gain = covariance / (variance + least_variance);
            values.push(gain);
            values.push(window.mean(i) - gain * window.twin_mean(i));
            let noise = [sensors.noise(&[(i, 1.0)]), Noise::default()];
            let own = window.covariance(i, i);
            values.push(correlation(covariance, [own, variance], noise));
        }
    }
}
