//! Comparison of corresponding sensors of several actuators.
//!
//! A fault disturbs its own actuator more than the others, so the sign of a difference names the actuator at any
//! intensity. With two actuators, the first is compared with the second. With more, each is compared with the largest
//! of the others.

use super::{
    Feature, MAX_ACTUATORS, Quantity, Sensors, Sink, against, compared, contrast, largest_other,
    log_deviation, name_of,
};
use crate::number::Number;
use crate::residual::Statistics;
use alloc::format;

/// The quantities that actuators can have in common.
fn quantities() -> impl Iterator<Item = (Quantity, &'static str)> {
    let known = Quantity::ALL.iter().copied();
    known.filter(|(q, _)| !matches!(q, Quantity::Other | Quantity::Surface))
}

pub(super) fn list<W: Statistics, S: Sink<W::Number>>(sensors: &Sensors, window: &W, out: &mut S) {
    for (quantity, name) in quantities() {
        let like_sensors = sensors.like_sensors(quantity);
        let (actuators, like_sensors) = (like_sensors.actuators(), like_sensors.sensors());
        let zeros = [W::Number::constant(0.0); MAX_ACTUATORS];
        let (mut means, mut deviations) = (zeros, zeros);
        for (place, &sensor) in like_sensors.iter().enumerate().filter(|_| like_sensors.len() > 1) {
            let noise = sensors.noise(&[(sensor, 1.0)]);
            means[place] = window.mean(sensor).abs();
            deviations[place] = log_deviation(window.covariance(sensor, sensor), noise);
        }
        let (means, deviations) = (&means[..like_sensors.len()], &deviations[..like_sensors.len()]);
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
            let mut put = |value, kind: &str, unit, meaning: &str| {
                out.put(value, || {
                    let feature = name_of(&format!("{kind}_{name}"), actuators, own);
                    let against = against(actuators, own);
                    let meaning = format!("{meaning} of {name}, actuator {against}");
                    Feature::new(feature, unit, meaning, actuators.to_vec())
                });
            };
            put(means[own] - other, "mean_excess", "of scale", "|mean| difference");
            let meaning = "(|mean 1| − |mean 2|)/(|mean 1| + |mean 2|)";
            put(contrast(means[own], other, error), "mean_contrast", "1", meaning);
            let excess = deviations[own] - largest_other(deviations, own);
            put(excess, "dev_excess", "log10", "log10 ratio of standard deviations");
        }
    }
}
