//! The paper's features: mean (5), variance (6) and indicator (7) of each scaled residual.

use super::{Feature, Formulas, Sensors, Teaches};
use crate::residual::Statistics;
use alloc::format;
use alloc::vec::Vec;

/// The family of this module.
pub(crate) struct Moments;

impl Formulas for Moments {
    fn name(&self) -> &'static str {
        "moments"
    }

    fn summary(&self) -> &'static str {
        "mean, variance and no-deviation indicator of each residual (the paper's)"
    }

    fn features(&self, sensors: &Sensors) -> Vec<Feature> {
        let of_sensor = |s: &super::Sensor| {
            let actuators: Vec<usize> = s.actuator.into_iter().collect();
            [
                Feature {
                    name: format!("mean_{}", s.name),
                    unit: "of scale",
                    meaning: format!("mean of the residual of {}", s.name),
                    actuators: actuators.clone(),
                    teaches: Teaches::Everybody,
                },
                Feature {
                    name: format!("var_{}", s.name),
                    unit: "of scale²",
                    meaning: format!("variance of the residual of {}", s.name),
                    actuators: actuators.clone(),
                    teaches: Teaches::Nobody,
                },
                Feature {
                    name: format!("no_dev_{}", s.name),
                    unit: "0 or 1",
                    meaning: format!(
                        "1 if {} stays within ±3 % with a deviation below 1 %",
                        s.name
                    ),
                    actuators,
                    teaches: Teaches::Nobody,
                },
            ]
        };
        sensors.0.iter().flat_map(of_sensor).collect()
    }

    fn append<W: Statistics>(&self, sensors: &Sensors, window: &W, values: &mut Vec<W::Number>) {
        for i in 0..sensors.0.len() {
            values.extend([window.mean(i), window.covariance(i, i), window.indicator(i)]);
        }
    }
}
