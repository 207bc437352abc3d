//! A third stroke sensor, at the surface: majority vote.
//!
//! With `g_k = x_k − x_3` (disagreement of ram sensor k with the third): where
//! one ram sensor errs, its own disagreement is large and the other's small;
//! where both are large, the third errs.

use super::{Family, Feature, Quantity, Sensors, contrast, log_deviation};
use crate::residual::Window;
use alloc::format;
use alloc::vec;
use alloc::vec::Vec;

/// See the module.
pub struct Vote;

/// The rams of the first two units and the surface.
fn rams(sensors: &Sensors) -> Option<([usize; 2], usize)> {
    let ram = |unit| sensors.find(Quantity::Ram, unit);
    let surface = sensors.0.iter().position(|s| s.quantity == Quantity::Surface)?;
    Some(([ram(0)?, ram(1)?], surface))
}

impl Family for Vote {
    fn name(&self) -> &'static str {
        "vote"
    }

    fn summary(&self) -> &'static str {
        "each ram sensor against a third stroke sensor"
    }

    fn features(&self, sensors: &Sensors) -> Vec<Feature> {
        if rams(sensors).is_none() {
            return Vec::new();
        }
        let mut features = Vec::new();
        for unit in 0..2 {
            let mut push = |name: &str, in_unit, meaning: &str| {
                features.push(Feature {
                    name: format!("{name}_{}", unit + 1),
                    unit: in_unit,
                    meaning: format!("{meaning} of ram sensor {} from the third", unit + 1),
                    units: vec![unit],
                    teaches: true,
                });
            };
            push("mean_vote", "of scale", "mean disagreement");
            push("log_dev_vote", "log10 of scale", "log10 deviation of the disagreement");
        }
        let mut push = |name: &str, unit, meaning: &str| {
            features.push(Feature {
                name: name.into(),
                unit,
                meaning: meaning.into(),
                units: vec![0, 1],
                teaches: true,
            });
        };
        push("vote_contrast", "1", "mean disagreement with the third sensor, ram 1 against 2");
        push("vote_dev_excess", "log10", "log10 ratio of the disagreements' deviations");
        features
    }

    fn compute(&self, sensors: &Sensors, window: &Window, values: &mut Vec<f64>) {
        let Some((rams, surface)) = rams(sensors) else { return };
        let mean = rams.map(|ram| window.mean(ram) - window.mean(surface));
        let deviation = rams.map(|ram| {
            let both = window.covariance(ram, surface);
            let own = window.covariance(ram, ram) + window.covariance(surface, surface);
            let noise = sensors.noise_variance(&[(ram, 1.0), (surface, -1.0)]);
            log_deviation(own - 2.0 * both, noise)
        });
        values.extend([mean[0], deviation[0], mean[1], deviation[1]]);
        let error = sensors.error_of_mean(window, &[(rams[0], 1.0), (surface, -1.0)]);
        values.push(contrast(mean[0].abs(), mean[1].abs(), error));
        values.push(deviation[0] - deviation[1]);
    }
}
