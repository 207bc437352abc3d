//! Relations between the two chambers of one actuator.
//!
//! A leak or a clogged edge moves both chambers by the same amount (common mode), because a critical valve holds it
//! only through its null conductance. A force moves them apart (differential mode). A pressure sensor moves one alone.
//! The ratios separate these cases at any intensity.

use super::{Feature, Noise, Quantity, Sensors, Sink, correlation, log_deviation, ratio};
use crate::number::Number;
use crate::residual::Statistics;
use alloc::format;
use alloc::vec;

const NEEDED: [Quantity; 3] = [Quantity::PressureA, Quantity::PressureB, Quantity::Spool];

pub(super) fn list<W: Statistics, S: Sink<W::Number>>(sensors: &Sensors, window: &W, out: &mut S) {
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
        let number = actuator + 1;
        let mut put = |value, name: &str, unit, meaning: &str| {
            out.put(value, || {
                let meaning = format!("{meaning}, actuator {number}");
                Feature::new(format!("{name}_{number}"), unit, meaning, vec![actuator])
            });
        };
        put(common, "mean_common", "of scale", "mean of (r_pA + r_pB)/2");
        put(mean_a - mean_b, "mean_differential", "of scale", "mean of r_pA − r_pB");
        let log = "log10 of scale";
        put(deviation_common, "log_dev_common", log, "log10 deviation of (r_pA + r_pB)/2");
        put(deviation_differential, "log_dev_differential", log, "log10 deviation of r_pA − r_pB");
        let of_chambers = ratio(mean_b, mean_a, error(&[(a, 1.0)]));
        put(of_chambers, "mean_chambers_ratio", "1", "mean r_pB over mean r_pA");
        let of_chambers = correlation(both, [var_a, var_b], chambers);
        put(of_chambers, "chambers_corr", "1", "correlation of r_pA with r_pB");
        let deviations = deviation_common - deviation_differential;
        let meaning = "log10 of the two deviations' ratio";
        put(deviations, "common_over_differential", "1", meaning);
        let differential = with_spool(with_a - with_b, var_differential, noise_differential);
        let meaning = "correlation of r_pA − r_pB with the twin's spool";
        put(differential, "differential_spool_corr", "1", meaning);
        let of_both = with_spool(half * (with_a + with_b), var_common, noise_common);
        let meaning = "correlation of (r_pA + r_pB)/2 with the twin's spool";
        put(of_both, "common_spool_corr", "1", meaning);
        let spool_over_common = ratio(window.mean(spool), common, error(&of_common));
        let meaning = "mean spool residual over mean common-mode residual";
        put(spool_over_common, "spool_over_common", "1", meaning);
    }
}
