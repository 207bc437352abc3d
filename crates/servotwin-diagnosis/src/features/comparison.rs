//! Comparison of corresponding sensors of several actuators.
//!
//! A fault disturbs its own actuator more than the others, so the sign of a difference names the actuator at any
//! intensity. With two actuators, the first is compared with the second. With more, each is compared with the largest
//! of the others.

use super::{
    Feature, Formulas, MAX_ACTUATORS, Quantity, Sensors, Teaches, against, compared, contrast,
    largest_other, log_deviation, name_of,
};
use crate::number::Number;
use crate::residual::Statistics;
use alloc::format;
use alloc::vec::Vec;

/// The family of this module.
pub(crate) struct Comparison;

/// The quantities that actuators can have in common.
fn quantities() -> impl Iterator<Item = (Quantity, &'static str)> {
    let known = Quantity::ALL.iter().copied();
    known.filter(|(q, _)| !matches!(q, Quantity::Other | Quantity::Surface))
}

impl Formulas for Comparison {
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

    fn append<W: Statistics>(&self, sensors: &Sensors, window: &W, values: &mut Vec<W::Number>) {
        for (quantity, _) in quantities() {
            let like_sensors = sensors.like_sensors(quantity);
            let like_sensors = like_sensors.sensors();
            let zeros = [W::Number::constant(0.0); MAX_ACTUATORS];
            let (mut means, mut deviations) = (zeros, zeros);
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
                let error_beside = |place: usize| {
                    let pair = [(like_sensors[own], 1.0), (like_sensors[place], 1.0)];
                    sensors.error_of_mean(window, &pair)
                };
                let others = (0..like_sensors.len()).filter(|place| *place != own);
                let mut others = others.map(|place| (means[place], error_beside(place)));
                let Some(first) = others.next() else { continue };
                let (other, error) = others.fold(first, |(mean, error), (next, its_error)| {
                    (mean.if_less(next, next, mean), mean.if_less(next, its_error, error))
                });
                values.push(means[own] - other);
                values.push(contrast(means[own], other, error));
                values.push(deviations[own] - largest_other(deviations, own));
            }
        }
    }
}
