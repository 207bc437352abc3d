//! Comparison of corresponding sensors of several actuators.
//!
//! A fault disturbs its own actuator more than the others, so the sign of a difference names the actuator at any
//! intensity. With two actuators, the first is compared with the second. With more, each is compared with the largest
//! of the others.

use super::{
    Family, Feature, MAX_ACTUATORS, Quantity, Sensors, Teaches, against, compared, contrast,
    largest_other, log_deviation, name_of,
};
use crate::residual::Window;
use alloc::format;
use alloc::vec::Vec;

/// The family of this module.
pub struct Comparison;

/// The quantities that actuators can have in common.
fn quantities() -> impl Iterator<Item = (Quantity, &'static str)> {
    let known = Quantity::ALL.iter().copied();
    known.filter(|(q, _)| !matches!(q, Quantity::Other | Quantity::Surface))
}

impl Family for Comparison {
    fn name(&self) -> &'static str {
        "comparison"
    }

    fn summary(&self) -> &'static str {
        "magnitudes of corresponding residuals of the actuators against each other"
    }

    fn features(&self, sensors: &Sensors) -> Vec<Feature> {
        let mut features = Vec::new();
        for (quantity, name) in quantities() {
            let like_sensors = sensors.like_sensors(quantity);
            let actuators = like_sensors.actuators();
            for own in 0..compared(actuators.len()) {
                let mut push = |kind: &str, unit, meaning: &str| {
                    features.push(Feature {
                        name: name_of(&format!("{kind}_{name}"), actuators, own),
                        unit,
                        meaning: format!(
                            "{meaning} of {name}, actuator {}",
                            against(actuators, own)
                        ),
                        actuators: actuators.to_vec(),
                        teaches: Teaches::Everybody,
                    });
                };
                push("mean_excess", "of scale", "|mean| difference");
                push("mean_contrast", "1", "(|mean 1| − |mean 2|)/(|mean 1| + |mean 2|)");
                push("dev_excess", "log10", "log10 ratio of standard deviations");
            }
        }
        features
    }

    fn compute(&self, sensors: &Sensors, window: &Window, values: &mut Vec<f64>) {
        for (quantity, _) in quantities() {
            let like_sensors = sensors.like_sensors(quantity);
            let like_sensors = like_sensors.sensors();
            let (mut means, mut deviations) = ([0.0; MAX_ACTUATORS], [0.0; MAX_ACTUATORS]);
            for (place, &sensor) in
                like_sensors.iter().enumerate().filter(|_| like_sensors.len() > 1)
            {
                let noise = sensors.noise(&[(sensor, 1.0)]);
                means[place] = window.mean(sensor).abs();
                deviations[place] = log_deviation(window.covariance(sensor, sensor), noise);
            }
            let (means, deviations) =
                (&means[..like_sensors.len()], &deviations[..like_sensors.len()]);
            for own in 0..compared(like_sensors.len()) {
                let other = largest_other(means, own);
                let is_other = |place: &usize| *place != own && means[*place] == other;
                let place = (0..like_sensors.len()).find(is_other).unwrap_or(own);
                let pair = [(like_sensors[own], 1.0), (like_sensors[place], 1.0)];
                let error = sensors.error_of_mean(window, &pair);
                values.push(means[own] - other);
                values.push(contrast(means[own], other, error));
                values.push(deviations[own] - largest_other(deviations, own));
            }
        }
    }
}
