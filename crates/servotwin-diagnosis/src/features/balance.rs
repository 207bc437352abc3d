//! Force and position balances over both actuators.
//!
//! With `d_k = r_pAk − r_pBk` (differential pressure residual of actuator k)
//! and `x_k` its ram residual:
//!
//! - the *sum* `d_1 + d_2` is the change of the load. A force fight leaves it at
//!   zero; a moved aileron changes it through the air; a pressure sensor's bias
//!   shows in full.
//! - the *fight* `d_1 − d_2` is what the actuators push against each other.
//! - the *gap* `x_1 − x_2` is what the ram sensors disagree by. The rams are
//!   tied by the aileron, so a gap that the fight does not explain through the
//!   attachments' compliance is a ram sensor's error.
//!
//! A bias of one ram sensor and the opposite bias of the other give the same
//! fight and the same gap: they move the aileron in opposite directions, and
//! only the air load tells. Hence *sum over gap* is the one sign that separates
//! the paper's most difficult case.

use super::{Family, Feature, Quantity, Sensors, correlation, log_deviation, ratio};
use crate::residual::Window;
use alloc::string::ToString;
use alloc::vec;
use alloc::vec::Vec;

/// See the module.
pub struct Balance;

const NEEDED: [Quantity; 3] = [Quantity::PressureA, Quantity::PressureB, Quantity::Ram];

/// Sensors with their weights: four pressures, or two rams and twice nothing.
type Four = [(usize, f64); 4];

/// How many of the four count in sum, fight and gap.
const COUNTS: [usize; 3] = [4, 4, 2];

/// Sum, fight and gap, where both actuators have the sensors.
fn combinations(sensors: &Sensors) -> Option<[Four; 3]> {
    let of = |unit| {
        let [a, b, ram] = NEEDED.map(|q| sensors.find(q, unit));
        Some((a?, b?, ram?))
    };
    let (a1, b1, x1) = of(0)?;
    let (a2, b2, x2) = of(1)?;
    Some([
        [(a1, 1.0), (b1, -1.0), (a2, 1.0), (b2, -1.0)],
        [(a1, 1.0), (b1, -1.0), (a2, -1.0), (b2, 1.0)],
        [(x1, 1.0), (x2, -1.0), (x1, 0.0), (x2, 0.0)],
    ])
}

fn mean(window: &Window, combination: &[(usize, f64)]) -> f64 {
    combination.iter().map(|&(i, w)| w * window.mean(i)).sum()
}

fn covariance(window: &Window, a: &[(usize, f64)], b: &[(usize, f64)]) -> f64 {
    let products = a.iter().flat_map(|&(i, u)| b.iter().map(move |&(j, v)| (i, j, u * v)));
    products.map(|(i, j, weight)| weight * window.covariance(i, j)).sum()
}

impl Family for Balance {
    fn name(&self) -> &'static str {
        "balance"
    }

    fn summary(&self) -> &'static str {
        "change of load, force fight and disagreement of the ram sensors"
    }

    fn features(&self, sensors: &Sensors) -> Vec<Feature> {
        if combinations(sensors).is_none() {
            return Vec::new();
        }
        let feature = |name: &str, unit, meaning: &str| Feature {
            name: name.to_string(),
            unit,
            meaning: meaning.to_string(),
            units: vec![0, 1],
            teaches: true,
        };
        vec![
            feature("mean_sum", "of scale", "mean change of load: d1 + d2"),
            feature("mean_fight", "of scale", "mean force fight: d1 − d2"),
            feature("mean_gap", "of scale", "mean disagreement of the ram sensors: x1 − x2"),
            feature("log_dev_sum", "log10 of scale", "log10 deviation of d1 + d2"),
            feature("log_dev_fight", "log10 of scale", "log10 deviation of d1 − d2"),
            feature("log_dev_gap", "log10 of scale", "log10 deviation of x1 − x2"),
            feature("sum_over_gap", "1", "mean change of load over mean ram disagreement"),
            feature("sum_over_fight", "1", "mean change of load over mean force fight"),
            feature("gap_over_fight", "1", "mean ram disagreement over mean force fight"),
            feature("sum_fight_corr", "1", "correlation of d1 + d2 with d1 − d2"),
            feature("sum_gap_corr", "1", "correlation of d1 + d2 with x1 − x2"),
            feature("fight_gap_corr", "1", "correlation of d1 − d2 with x1 − x2"),
        ]
    }

    fn compute(&self, sensors: &Sensors, window: &Window, values: &mut Vec<f64>) {
        let Some(all) = combinations(sensors) else {
            return;
        };
        let [sum, fight, gap] = [0, 1, 2].map(|i| &all[i][..COUNTS[i]]);
        let means = [sum, fight, gap].map(|c| mean(window, c));
        let variances = [sum, fight, gap].map(|c| covariance(window, c, c));
        values.extend(means);
        let noise = [sum, fight, gap].map(|c| sensors.noise(c));
        let errors = [sum, fight, gap].map(|c| sensors.error_of_mean(window, c));
        values.extend([0, 1, 2].map(|i| log_deviation(variances[i], noise[i])));
        values.push(ratio(means[0], means[2], errors[2]));
        values.push(ratio(means[0], means[1], errors[1]));
        values.push(ratio(means[2], means[1], errors[1]));
        let pairs = [(sum, fight, 0, 1), (sum, gap, 0, 2), (fight, gap, 1, 2)];
        for (a, b, i, j) in pairs {
            let both = covariance(window, a, b);
            values.push(correlation(both, [variances[i], variances[j]], [noise[i], noise[j]]));
        }
    }
}
