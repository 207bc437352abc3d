//! Force and position balances over all actuators.
//!
//! With `d_k = r_pAk − r_pBk` (differential pressure residual of actuator k) and `x_k` its ram residual, for two
//! actuators:
//!
//! - the *sum* `d_1 + d_2` is the change of the load. A force fight leaves it at zero. A moved aileron changes it
//!   through the air load. A pressure sensor's bias appears in full.
//! - the *fight* `d_1 − d_2` is the force with which the actuators push against each other.
//! - the *gap* `x_1 − x_2` is the disagreement of the ram sensors. The aileron ties the rams, so a gap beyond the fight
//!   times the attachments' compliance is an error of a ram sensor.
//!
//! A bias of one ram sensor and the opposite bias of the other give the same fight and the same gap. They move the
//! aileron in opposite directions, and only the air load differs. Hence *sum over gap* is the one sign that separates
//! the paper's most difficult case.
//!
//! With more than two actuators, the sum covers all. Each has its own fight and gap against the mean of the others.

use super::{
    Combination, Feature, Formulas, MAX_ACTUATORS, Quantity, Sensors, Teaches, compared,
    correlation, log_deviation, name_of, ratio,
};
use crate::number::{Number, sum};
use crate::residual::Statistics;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

/// The family of this module.
pub(crate) struct Balance;

const NEEDED: [Quantity; 3] = [Quantity::PressureA, Quantity::PressureB, Quantity::Ram];

/// Sensors with weights: two pressures or the ram of each actuator.
struct Weighted {
    terms: [(usize, f64); 2 * MAX_ACTUATORS],
    count: usize,
}

impl Weighted {
    fn of(terms: impl Iterator<Item = (usize, f64)>) -> Self {
        let mut weighted = Weighted { terms: [(0, 0.0); 2 * MAX_ACTUATORS], count: 0 };
        for term in terms {
            weighted.terms[weighted.count] = term;
            weighted.count += 1;
        }
        weighted
    }

    fn terms(&self) -> &[(usize, f64)] {
        &self.terms[..self.count]
    }
}

/// Sum, fight and gap of one actuator.
fn combinations(actuators: &[[usize; 3]], own: usize) -> [Weighted; 3] {
    let others = -1.0 / (actuators.len() - 1) as f64;
    let all = actuators.iter().enumerate();
    let weighed = all.map(|(place, sensors)| (sensors, if place == own { 1.0 } else { others }));
    let sum = actuators.iter().flat_map(|&[a, b, _]| [(a, 1.0), (b, -1.0)]);
    let fight = weighed.clone().flat_map(|(&[a, b, _], weight)| [(a, weight), (b, -weight)]);
    let gap = weighed.map(|(&[_, _, ram], weight)| (ram, weight));
    [Weighted::of(sum), Weighted::of(fight), Weighted::of(gap)]
}

fn mean<W: Statistics>(window: &W, combination: Combination) -> W::Number {
    sum(combination.iter().map(|&(i, w)| W::Number::constant(w) * window.mean(i)))
}

fn covariance<W: Statistics>(window: &W, a: Combination, b: Combination) -> W::Number {
    let products = a.iter().flat_map(|&(i, u)| b.iter().map(move |&(j, v)| (i, j, u * v)));
    sum(products.map(|(i, j, weight)| W::Number::constant(weight) * window.covariance(i, j)))
}

/// Formulas of sum, fight and gap for the features' descriptions.
fn words(actuators: &[usize], own: usize) -> [String; 3] {
    if let [first, second] = actuators {
        let (k, l) = (first + 1, second + 1);
        return [format!("d{k} + d{l}"), format!("d{k} − d{l}"), format!("x{k} − x{l}")];
    }
    let k = actuators[own] + 1;
    let less = |letter: &str| format!("{letter}{k} − mean of the other {letter}");
    ["the sum of all d".into(), less("d"), less("x")]
}

impl Formulas for Balance {
    fn name(&self) -> &'static str {
        "balance"
    }

    fn summary(&self) -> &'static str {
        "change of load, force fight and disagreement of the ram sensors"
    }

    fn features(&self, sensors: &Sensors) -> Vec<Feature> {
        let actuators: Vec<usize> = sensors.with(&NEEDED).take(MAX_ACTUATORS).collect();
        let mut features = Vec::new();
        for own in 0..compared(actuators.len()) {
            let [sum, fight, gap] = words(&actuators, own);
            let mut push = |name: String, unit, meaning: String| {
                features.push(Feature {
                    name,
                    unit,
                    meaning,
                    actuators: actuators.clone(),
                    teaches: Teaches::Everybody,
                });
            };
            let of = |name: &str| name_of(name, &actuators, own);
            // All actuators share one sum.
            let is_first = own == 0;
            if is_first {
                push("mean_sum".into(), "of scale", format!("mean change of load: {sum}"));
            }
            push(of("mean_fight"), "of scale", format!("mean force fight: {fight}"));
            push(
                of("mean_gap"),
                "of scale",
                format!("mean disagreement of the ram sensors: {gap}"),
            );
            if is_first {
                push("log_dev_sum".into(), "log10 of scale", format!("log10 deviation of {sum}"));
            }
            push(of("log_dev_fight"), "log10 of scale", format!("log10 deviation of {fight}"));
            push(of("log_dev_gap"), "log10 of scale", format!("log10 deviation of {gap}"));
            let mut relation = |name: &str, meaning: String| push(of(name), "1", meaning);
            relation("sum_over_gap", "mean change of load over mean ram disagreement".into());
            relation("sum_over_fight", "mean change of load over mean force fight".into());
            relation("gap_over_fight", "mean ram disagreement over mean force fight".into());
            relation("sum_fight_corr", format!("correlation of {sum} with {fight}"));
            relation("sum_gap_corr", format!("correlation of {sum} with {gap}"));
            relation("fight_gap_corr", format!("correlation of {fight} with {gap}"));
        }
        features
    }

    fn append<W: Statistics>(&self, sensors: &Sensors, window: &W, values: &mut Vec<W::Number>) {
        let (mut known, mut count) = ([[0; 3]; MAX_ACTUATORS], 0);
        for actuator in sensors.with(&NEEDED).take(MAX_ACTUATORS) {
            known[count] = NEEDED.map(|quantity| sensors.find(quantity, actuator).unwrap_or(0));
            count += 1;
        }
        for own in 0..compared(count) {
            let all = combinations(&known[..count], own);
            let [load, fight, gap] = [0, 1, 2].map(|i| all[i].terms());
            // All actuators share one sum, written with the first.
            let told = usize::from(own > 0);
            let means = [load, fight, gap].map(|c| mean(window, c));
            let variances = [load, fight, gap].map(|c| covariance(window, c, c));
            values.extend(&means[told..]);
            let noise = [load, fight, gap].map(|c| sensors.noise(c));
            let errors = [load, fight, gap].map(|c| sensors.error_of_mean(window, c));
            let deviations = [0, 1, 2].map(|i| log_deviation(variances[i], noise[i]));
            values.extend(&deviations[told..]);
            values.push(ratio(means[0], means[2], errors[2]));
            values.push(ratio(means[0], means[1], errors[1]));
            values.push(ratio(means[2], means[1], errors[1]));
            let pairs = [(load, fight, 0, 1), (load, gap, 0, 2), (fight, gap, 1, 2)];
            for (a, b, i, j) in pairs {
                let both = covariance(window, a, b);
                values.push(correlation(both, [variances[i], variances[j]], [noise[i], noise[j]]));
            }
        }
    }
}
