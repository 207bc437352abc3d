//! Majority vote with an additional stroke sensor at the surface.
//!
//! With `g_k = x_k − x_s`, the disagreement of ram sensor k with the surface sensor. If one ram sensor errs, only its
//! own disagreement is large. If all are large, the surface sensor errs.

use super::{
    Feature, LikeSensors, MAX_ACTUATORS, Quantity, Sensors, Sink, against, compared, contrast,
    largest_other, log_deviation, name_of,
};
use crate::number::Number;
use crate::residual::Statistics;
use alloc::format;
use alloc::vec;

/// The ram sensors of all actuators, if there are several, and the surface sensor.
fn rams(sensors: &Sensors) -> Option<(LikeSensors, usize)> {
    let rams = sensors.like_sensors(Quantity::Ram);
    let surface = sensors.0.iter().position(|s| s.quantity == Quantity::Surface)?;
    (rams.count > 1).then_some((rams, surface))
}

pub(super) fn list<W: Statistics, S: Sink<W::Number>>(sensors: &Sensors, window: &W, out: &mut S) {
    let Some((rams, surface)) = rams(sensors) else { return };
    let (actuators, rams) = (rams.actuators(), rams.sensors());
    let third = if actuators.len() > 2 { "that of the surface" } else { "the third" };
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
        let number = actuators[place] + 1;
        let mut put = |value, name: &str, unit, meaning: &str| {
            out.put(value, || {
                let meaning = format!("{meaning} of ram sensor {number} from {third}");
                Feature::new(format!("{name}_{number}"), unit, meaning, vec![actuators[place]])
            });
        };
        put(mean, "mean_vote", "of scale", "mean disagreement");
        let meaning = "log10 deviation of the disagreement";
        put(deviations[place], "log_dev_vote", "log10 of scale", meaning);
    }
    let (sizes, deviations) = (&sizes[..rams.len()], &deviations[..rams.len()]);
    for own in 0..compared(rams.len()) {
        let error = sensors.error_of_mean(window, &[(rams[own], 1.0), (surface, -1.0)]);
        let feature = |name: &str, unit, meaning| {
            Feature::new(name_of(name, actuators, own), unit, meaning, actuators.to_vec())
        };
        out.put(contrast(sizes[own], largest_other(sizes, own), error), || {
            let sensor = if actuators.len() > 2 { third } else { "the third sensor" };
            let rams = against(actuators, own);
            let meaning = format!("mean disagreement with {sensor}, ram {rams}");
            feature("vote_contrast", "1", meaning)
        });
        out.put(deviations[own] - largest_other(deviations, own), || {
            let meaning = "log10 ratio of the disagreements' deviations";
            let meaning = match actuators.len() {
                2 => meaning.into(),
                _ => format!("{meaning}, ram {}", against(actuators, own)),
            };
            feature("vote_dev_excess", "log10", meaning)
        });
    }
}
