//! Each pair of like sensors of two actuators: which one deviates more.
//!
//! A fault disturbs its own actuator more than the other; the sign of these
//! differences says which it is at any intensity.

use super::{Family, Feature, Quantity, Sensors, contrast, log_deviation};
use crate::residual::Window;
use alloc::format;
use alloc::vec;
use alloc::vec::Vec;

/// See the module.
pub struct Comparison;

/// The sensors of the first two units that correspond.
fn pairs(sensors: &Sensors) -> impl Iterator<Item = (&'static str, usize, usize)> + '_ {
    let known =
        Quantity::ALL.iter().filter(|(q, _)| !matches!(q, Quantity::Other | Quantity::Surface));
    known.filter_map(|&(q, name)| Some((name, sensors.find(q, 0)?, sensors.find(q, 1)?)))
}

impl Family for Comparison {
    fn name(&self) -> &'static str {
        "comparison"
    }

    fn summary(&self) -> &'static str {
        "sizes of like residuals of two actuators against each other"
    }

    fn features(&self, sensors: &Sensors) -> Vec<Feature> {
        let mut features = Vec::new();
        for (name, _, _) in pairs(sensors) {
            let mut push = |kind: &str, unit, meaning: &str| {
                features.push(Feature {
                    name: format!("{kind}_{name}"),
                    unit,
                    meaning: format!("{meaning} of {name}, actuator 1 against 2"),
                    units: vec![0, 1],
                    teaches: true,
                });
            };
            push("mean_excess", "of scale", "|mean| difference");
            push("mean_contrast", "1", "(|mean 1| − |mean 2|)/(|mean 1| + |mean 2|)");
            push("dev_excess", "log10", "log10 ratio of standard deviations");
        }
        features
    }

    fn compute(&self, sensors: &Sensors, window: &Window, values: &mut Vec<f64>) {
        for (_, a, b) in pairs(sensors) {
            let (mean_a, mean_b) = (window.mean(a).abs(), window.mean(b).abs());
            let deviation = |i| log_deviation(window.covariance(i, i), sensors.noise(&[(i, 1.0)]));
            let error = sensors.error_of_mean(window, &[(a, 1.0), (b, 1.0)]);
            values.push(mean_a - mean_b);
            values.push(contrast(mean_a, mean_b, error));
            values.push(deviation(a) - deviation(b));
        }
    }
}
