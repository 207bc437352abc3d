//! Relations between the two chambers of one actuator.
//!
//! A leak or a clogged edge moves both chambers by the same amount (common mode), because a critical valve holds it
//! only through its null conductance. A force moves them apart (differential mode). A pressure sensor moves one alone.
//! The ratios separate these cases at any intensity.

use super::{
    Feature, Formulas, Noise, Quantity, Sensors, Teaches, correlation, log_deviation, ratio,
};
use crate::number::Number;
use crate::residual::Statistics;
use alloc::format;
use alloc::vec;
use alloc::vec::Vec;

/// The family of this module.
pub(crate) struct Pressure;

const NEEDED: [Quantity; 3] = [Quantity::PressureA, Quantity::PressureB, Quantity::Spool];

impl Formulas for Pressure {
    fn name(&self) -> &'static str {
        "pressure"
    }

    fn summary(&self) -> &'static str {
        "common-mode and differential pressure of each actuator"
    }

    fn features(&self, sensors: &Sensors) -> Vec<Feature> {
        let mut features = Vec::new();
        for actuator in sensors.with(&NEEDED) {
            let mut push = |name: &str, in_unit, meaning: &str| {
                features.push(Feature {
                    name: format!("{name}_{}", actuator + 1),
                    unit: in_unit,
                    meaning: format!("{meaning}, actuator {}", actuator + 1),
                    actuators: vec![actuator],
                    teaches: Teaches::Everybody,
                });
            };
            push("mean_common", "of scale", "mean of (r_pA + r_pB)/2");
            push("mean_differential", "of scale", "mean of r_pA − r_pB");
            push("log_dev_common", "log10 of scale", "log10 deviation of (r_pA + r_pB)/2");
            push("log_dev_differential", "log10 of scale", "log10 deviation of r_pA − r_pB");
            push("mean_chambers_ratio", "1", "mean r_pB over mean r_pA");
            push("chambers_corr", "1", "correlation of r_pA with r_pB");
            push("common_over_differential", "1", "log10 of the two deviations' ratio");
            push(
                "differential_spool_corr",
                "1",
                "correlation of r_pA − r_pB with the twin's spool",
            );
            push("common_spool_corr", "1", "correlation of (r_pA + r_pB)/2 with the twin's spool");
            push("spool_over_common", "1", "mean spool residual over mean common-mode residual");
        }
        features
    }

    fn append<W: Statistics>(&self, sensors: &Sensors, window: &W, values: &mut Vec<W::Number>) {
        for actuator in sensors.with(&NEEDED) {
            let [a, b, spool] =
                NEEDED.map(|q| sensors.find(q, actuator).expect("an actuator with all"));
            let (var_a, var_b) = (window.covariance(a, a), window.covariance(b, b));
            let both = window.covariance(a, b);
            let [quarter, half, two] = [0.25, 0.5, 2.0].map(W::Number::constant);
            let var_common = quarter * (var_a + var_b + two * both);
            let var_differential = var_a + var_b - two * both;
            let (mean_a, mean_b) = (window.mean(a), window.mean(b));
            let common = half * (mean_a + mean_b);
            let (with_a, with_b) =
                (window.cross_covariance(a, spool), window.cross_covariance(b, spool));
            let var_spool = window.twin_covariance(spool, spool);
            let of_common = [(a, 0.5), (b, 0.5)];
            let noise = |combination: &[(usize, f64)]| sensors.noise(combination);
            let chambers = [noise(&[(a, 1.0)]), noise(&[(b, 1.0)])];
            let noise_common = noise(&of_common);
            let noise_differential = noise(&[(a, 1.0), (b, -1.0)]);
            let deviation_common = log_deviation(var_common, noise_common);
            let deviation_differential = log_deviation(var_differential, noise_differential);
            let with_spool = |covariance, variance, noise| {
                correlation(covariance, [variance, var_spool], [noise, Noise::default()])
            };
            let error = |combination: &[(usize, f64)]| sensors.error_of_mean(window, combination);
            values.extend([
                common,
                mean_a - mean_b,
                deviation_common,
                deviation_differential,
                ratio(mean_b, mean_a, error(&[(a, 1.0)])),
                correlation(both, [var_a, var_b], chambers),
                deviation_common - deviation_differential,
                with_spool(with_a - with_b, var_differential, noise_differential),
                with_spool(half * (with_a + with_b), var_common, noise_common),
                ratio(window.mean(spool), common, error(&of_common)),
            ]);
        }
    }
}
