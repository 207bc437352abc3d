//! Majority vote with an additional stroke sensor at the surface.
//!
//! With `g_k = x_k − x_s`, the disagreement of ram sensor k with the surface sensor. If one ram sensor errs, only its
//! own disagreement is large. If all are large, the surface sensor errs.

use super::{
    Feature, Formulas, MAX_ACTUATORS, Quantity, Sensors, Teaches, against, compared, contrast,
    largest_other, log_deviation, name_of,
};
use crate::number::Number;
use crate::residual::Statistics;
use alloc::format;
use alloc::vec;
use alloc::vec::Vec;

/// The family of this module.
pub(crate) struct Vote;

/// The ram sensors of all actuators, if there are several, and the surface sensor.
fn rams(sensors: &Sensors) -> Option<(super::LikeSensors, usize)> {
    let rams = sensors.like_sensors(Quantity::Ram);
    let surface = sensors.0.iter().position(|s| s.quantity == Quantity::Surface)?;
    (rams.count > 1).then_some((rams, surface))
}

impl Formulas for Vote {
    fn name(&self) -> &'static str {
        "vote"
    }

    fn summary(&self) -> &'static str {
        "each ram sensor against a third stroke sensor"
    }

    fn features(&self, sensors: &Sensors) -> Vec<Feature> {
        let Some((rams, _)) = rams(sensors) else { return Vec::new() };
        let actuators = rams.actuators();
        let surface = if actuators.len() > 2 { "that of the surface" } else { "the third" };
        let mut features = Vec::new();
        for &actuator in actuators {
            let number = actuator + 1;
            let mut push = |name: &str, in_unit, meaning: &str| {
                features.push(Feature {
                    name: format!("{name}_{number}"),
                    unit: in_unit,
                    meaning: format!("{meaning} of ram sensor {number} from {surface}"),
                    actuators: vec![actuator],
                    teaches: Teaches::Everybody,
                });
            };
            push("mean_vote", "of scale", "mean disagreement");
            push("log_dev_vote", "log10 of scale", "log10 deviation of the disagreement");
        }
        for own in 0..compared(actuators.len()) {
            let mut push = |name: &str, unit, meaning| {
                let (name, actuators) = (name_of(name, actuators, own), actuators.to_vec());
                features.push(Feature {
                    name,
                    unit,
                    meaning,
                    actuators,
                    teaches: Teaches::Everybody,
                });
            };
            let rams = against(actuators, own);
            let sensor = if actuators.len() > 2 { surface } else { "the third sensor" };
            push("vote_contrast", "1", format!("mean disagreement with {sensor}, ram {rams}"));
            let meaning = match actuators.len() {
                2 => "log10 ratio of the disagreements' deviations".into(),
                _ => format!("log10 ratio of the disagreements' deviations, ram {rams}"),
            };
            push("vote_dev_excess", "log10", meaning);
        }
        features
    }

    fn append<W: Statistics>(&self, sensors: &Sensors, window: &W, values: &mut Vec<W::Number>) {
        let Some((rams, surface)) = rams(sensors) else { return };
        let rams = rams.sensors();
        let zeros = [W::Number::constant(0.0); MAX_ACTUATORS];
        let (mut sizes, mut deviations) = (zeros, zeros);
        for (place, &ram) in rams.iter().enumerate() {
            let mean = window.mean(ram) - window.mean(surface);
            let both = window.covariance(ram, surface);
            let own = window.covariance(ram, ram) + window.covariance(surface, surface);
            let two = W::Number::constant(2.0);
            let noise = sensors.noise(&[(ram, 1.0), (surface, -1.0)]);
            sizes[place] = mean.abs();
            deviations[place] = log_deviation(own - two * both, noise);
            values.extend([mean, deviations[place]]);
        }
        let (sizes, deviations) = (&sizes[..rams.len()], &deviations[..rams.len()]);
        for own in 0..compared(rams.len()) {
            let error = sensors.error_of_mean(window, &[(rams[own], 1.0), (surface, -1.0)]);
            values.push(contrast(sizes[own], largest_other(sizes, own), error));
            values.push(deviations[own] - largest_other(deviations, own));
        }
    }
}
