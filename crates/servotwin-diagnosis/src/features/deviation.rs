//! The size of each residual: standard deviation on a logarithmic scale, and largest excursion. A tree splits a
//! logarithm more evenly than the variance, whose interesting part lies close to zero.

use super::{Feature, Formulas, Sensors, Teaches, log_deviation};
use crate::residual::Statistics;
use alloc::format;
use alloc::vec::Vec;

/// The family of this module.
pub(crate) struct Deviation;

impl Formulas for Deviation {
    fn name(&self) -> &'static str {
        "deviation"
    }

    fn summary(&self) -> &'static str {
        "logarithm of the standard deviation, and largest magnitude, of each residual"
    }

    fn features(&self, sensors: &Sensors) -> Vec<Feature> {
        let of_sensor = |s: &super::Sensor| {
            [
                Feature {
                    name: format!("log_dev_{}", s.name),
                    unit: "log10 of scale",
                    meaning: format!(
                        "log10 of the standard deviation of the residual of {}",
                        s.name
                    ),
                    actuators: s.actuator.into_iter().collect(),
                    teaches: Teaches::Everybody,
                },
                Feature {
                    name: format!("largest_{}", s.name),
                    unit: "of scale",
                    meaning: format!("largest magnitude of the residual of {}", s.name),
                    actuators: s.actuator.into_iter().collect(),
                    teaches: Teaches::Nobody,
                },
            ]
        };
        sensors.0.iter().flat_map(of_sensor).collect()
    }

    fn append<W: Statistics>(&self, sensors: &Sensors, window: &W, values: &mut Vec<W::Number>) {
        for i in 0..sensors.0.len() {
            let noise = sensors.noise(&[(i, 1.0)]);
            values.push(log_deviation(window.covariance(i, i), noise));
            values.push(window.largest(i));
        }
    }
}
