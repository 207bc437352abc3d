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
    Combination, Feature, MAX_ACTUATORS, Quantity, Sensors, Sink, compared, correlation,
    log_deviation, name_of, ratio,
};
use crate::number::{Number, sum};
use crate::residual::Statistics;
use alloc::format;
use alloc::string::String;

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

pub(super) fn list<W: Statistics, S: Sink<W::Number>>(sensors: &Sensors, window: &W, out: &mut S) {
    let (mut known, mut numbers, mut count) = ([[0; 3]; MAX_ACTUATORS], [0; MAX_ACTUATORS], 0);
    for actuator in sensors.with(&NEEDED).take(MAX_ACTUATORS) {
        known[count] = NEEDED.map(|quantity| sensors.find(quantity, actuator).unwrap_or(0));
        numbers[count] = actuator;
        count += 1;
    }
    let actuators = &numbers[..count];
    for own in 0..compared(count) {
        let all = combinations(&known[..count], own);
        let all = [0, 1, 2].map(|i| all[i].terms());
        let means = all.map(|c| mean(window, c));
        let variances = all.map(|c| covariance(window, c, c));
        let noise = all.map(|c| sensors.noise(c));
        let errors = all.map(|c| sensors.error_of_mean(window, c));
        // The meaning names a combination as `{0}`.
        let mut put = |value, name: &str, unit, meaning: &str| {
            out.put(value, || {
                let places = words(actuators, own).into_iter().enumerate();
                let meaning = places.fold(String::from(meaning), |meaning, (place, words)| {
                    meaning.replace(&format!("{{{place}}}"), &words)
                });
                let is_shared = name.ends_with("_sum");
                let name = if is_shared { name.into() } else { name_of(name, actuators, own) };
                Feature::new(name, unit, meaning, actuators.to_vec())
            });
        };
        // All actuators share one sum, written with the first.
        let told = usize::from(own > 0);
        let of_means = [
            ("mean_sum", "mean change of load: {0}"),
            ("mean_fight", "mean force fight: {1}"),
            ("mean_gap", "mean disagreement of the ram sensors: {2}"),
        ];
        for (mean, (name, meaning)) in means.into_iter().zip(of_means).skip(told) {
            put(mean, name, "of scale", meaning);
        }
        let of_deviations = [
            ("log_dev_sum", "log10 deviation of {0}"),
            ("log_dev_fight", "log10 deviation of {1}"),
            ("log_dev_gap", "log10 deviation of {2}"),
        ];
        for (i, (name, meaning)) in of_deviations.into_iter().enumerate().skip(told) {
            put(log_deviation(variances[i], noise[i]), name, "log10 of scale", meaning);
        }
        for (i, j, name, meaning) in [
            (0, 2, "sum_over_gap", "mean change of load over mean ram disagreement"),
            (0, 1, "sum_over_fight", "mean change of load over mean force fight"),
            (2, 1, "gap_over_fight", "mean ram disagreement over mean force fight"),
        ] {
            put(ratio(means[i], means[j], errors[j]), name, "1", meaning);
        }
        for (i, j, name, meaning) in [
            (0, 1, "sum_fight_corr", "correlation of {0} with {1}"),
            (0, 2, "sum_gap_corr", "correlation of {0} with {2}"),
            (1, 2, "fight_gap_corr", "correlation of {1} with {2}"),
        ] {
            let both = covariance(window, all[i], all[j]);
            let of_both = correlation(both, [variances[i], variances[j]], [noise[i], noise[j]]);
            put(of_both, name, "1", meaning);
        }
    }
}
