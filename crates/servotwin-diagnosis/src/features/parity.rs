//! Parity residuals: a sensor against the law that relates it to others.
//!
//! A controller makes a sensor follow others of its actuator. The spool of a servo valve follows the measured ram
//! position and pressures, whatever the flow, load and friction. With `r_s` the sensor's scaled residual and `w_j` its
//! change for the others, the parity residual is
//!
//! ```text
//! q = r_s − Σ_j w_j r_j
//! ```
//!
//! The tolerances of a healthy specimen change flow or friction, which moves all sensors but not q. So does an error of
//! a sensor that the controller uses. A valve that ignores its command, or a wrong spool sensor, appears in q alone.
//!
//! A hydraulic law serves as well. With four equal edges a critical valve keeps `p_A + p_B = p_S + p_T`. A real change
//! of the return pressure moves the chambers, and so changes q less than a sensor error does. Sensors without such a
//! law ([`super::Sensor::follows`]) have no such features.
//!
//! Source: parity relations, Chow and Willsky, IEEE Transactions on Automatic Control 29 (1984) 603.

use super::{Combination, Noise, Sensors, Sink, Teaches, correlation, log_deviation, of_law};
use crate::number::{Number, sum};
use crate::residual::Statistics;
use alloc::format;

/// Largest number of sensors that one sensor may follow.
pub const MAX_FOLLOWED: usize = 7;

/// Below this deviation, in parts of scale, a twin signal gives no slope: q carries the noise of several sensors.
const LEAST_DEVIATION: f64 = 1e-2;

/// A sensor's parity residual as a combination of residuals; its own comes first.
struct Relation {
    terms: [(usize, f64); MAX_FOLLOWED + 1],
    count: usize,
}

impl Relation {
    fn terms(&self) -> Combination<'_> {
        &self.terms[..self.count]
    }

    /// Mean, variance, and covariance with a twin signal.
    fn of<W: Statistics>(&self, window: &W, twin: usize) -> [W::Number; 3] {
        let weighted = |of: &dyn Fn(usize) -> W::Number| {
            let terms = self.terms().iter();
            sum(terms.map(|&(sensor, weight)| W::Number::constant(weight) * of(sensor)))
        };
        [
            weighted(&|sensor| window.mean(sensor)),
            weighted(&|a| weighted(&|b| window.covariance(a, b))),
            weighted(&|sensor| window.cross_covariance(sensor, twin)),
        ]
    }
}

/// The relations of all sensors that follow others.
fn relations(sensors: &Sensors) -> impl Iterator<Item = (usize, Relation)> + '_ {
    let with = sensors.0.iter().enumerate().filter(|(_, sensor)| !sensor.follows.is_empty());
    with.map(|(place, sensor)| {
        let mut terms = [(place, 1.0); MAX_FOLLOWED + 1];
        let followed = sensor.follows.iter().take(MAX_FOLLOWED);
        let count = 1 + followed.len();
        for (term, &(other, weight)) in terms[1..].iter_mut().zip(followed) {
            *term = (other, -weight);
        }
        (place, Relation { terms, count })
    })
}

pub(super) fn list<W: Statistics, S: Sink<W::Number>>(sensors: &Sensors, window: &W, out: &mut S) {
    for (place, relation) in relations(sensors) {
        let noise = sensors.noise(relation.terms());
        let [mean, variance, with_twin] = relation.of(window, place);
        let known = |value, fulfilled| {
            of_law(window, relation.terms().iter().map(|term| term.0), value, fulfilled)
        };
        let mean = known(mean, 0.0);
        let variance = known(variance, noise.carried);
        let with_twin = known(with_twin, 0.0);
        let of_twin = window.twin_covariance(place, place);
        let log_dev = log_deviation(variance, noise);
        let feature = |kind: &str, unit, meaning: &str| {
            let meaning = meaning.replace("{}", "the parity residual of {}");
            let feature = sensors.0[place].feature(&format!("parity_{kind}"), unit, &meaning);
            feature.teaching(Teaches::Windows)
        };
        out.put(mean, || feature("mean", "of scale", "mean of {}"));
        out.put(log_dev, || {
            feature("log_dev", "log10 of scale", "log10 of the standard deviation of {}")
        });
        let least_variance = W::Number::constant(LEAST_DEVIATION * LEAST_DEVIATION);
        out.put(with_twin / (of_twin + least_variance), || {
            feature("gain", "1", "slope of {} over its twin's signal")
        });
        let noises = [noise, Noise::default()];
        out.put(correlation(with_twin, [variance, of_twin], noises), || {
            feature("corr", "1", "correlation of {} with its twin's signal")
        });
        for &(other, _) in relation.terms() {
            let own = window.covariance(other, other);
            out.put(log_dev - log_deviation(own, sensors.noise(&[(other, 1.0)])), || {
                let other = &sensors.0[other].name;
                let meaning =
                    format!("log10 ratio of the deviations of {{}} and of the residual of {other}");
                feature(&format!("over_{other}"), "log10", &meaning)
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::{Feature, Quantity, Sensor, Views};
    use crate::random::Random;
    use crate::residual::Window;
    use alloc::string::String;
    use alloc::vec::Vec;

    const NOISE: f64 = 0.002;

    /// A ram, and a spool that moves six times as far in the other direction.
    fn sensors() -> Sensors {
        let sensor = |name: &str, quantity, follows: &[(usize, f64)]| Sensor {
            name: name.into(),
            quantity,
            actuator: Some(0),
            noise: NOISE,
            is_noisy: true,
            follows: follows.to_vec(),
        };
        let ram = sensor("x_p_1", Quantity::Ram, &[]);
        Sensors(alloc::vec![ram, sensor("x_v_1", Quantity::Spool, &[(0, -6.0)])])
    }

    /// The features of half a second with a twin spool amplitude of 0.3. `residuals` gives those of ram and spool for
    /// the spool's position.
    fn computed(residuals: impl Fn(f64) -> [f64; 2]) -> Vec<f64> {
        computed_beside(&[false; 2], residuals)
    }

    /// The same, with stand-ins for some sensors.
    fn computed_beside(stands_in: &[bool], residuals: impl Fn(f64) -> [f64; 2]) -> Vec<f64> {
        let mut random = Random::new(11);
        let mut normal = || (0..12).map(|_| random.unit()).sum::<f64>() - 6.0;
        let mut window = Window::new(2);
        for sample in 0..50 {
            let spool = 0.3 * libm::sin(0.3 * f64::from(sample));
            let [ram, own] = residuals(spool).map(|r| r + NOISE * normal());
            window.add(&[ram, spool + own], &[0.0, spool], &[1.0, 1.0]);
        }
        let mut features = Vec::<Feature>::new();
        list(&sensors(), &Window::new(2), &mut features);
        let names: Vec<String> = features.into_iter().map(|feature| feature.name).collect();
        let mut views = Views::new(sensors(), &names, 1).unwrap();
        views.stand_in(stands_in, &[false; 2]);
        views.compute(&window).unwrap().1[0].clone()
    }

    #[test]
    fn a_specimen_whose_flow_differs_leaves_nothing_but_noise() {
        // A lagging ram demands a tenth more spool for the same speed.
        let [mean, log_dev, gain, ..] = computed(|spool| [-spool / 60.0, spool / 10.0])[..] else {
            panic!("too few")
        };
        let noise = NOISE * libm::sqrt(1.0 + 36.0);
        assert!(mean.abs() < 3.0 * noise / libm::sqrt(50.0), "{mean}");
        assert!((log_dev - libm::log10(noise)).abs() < 0.15, "{log_dev}");
        assert!(gain.abs() < 0.02, "{gain}");
    }

    #[test]
    fn a_valve_that_moves_too_far_and_a_sensor_that_says_so_show_alike() {
        let valve = computed(|spool| [spool * 0.2 / 6.0, 0.0]);
        let sensor = computed(|spool| [0.0, 0.2 * spool]);
        for (values, over_ram) in [(valve, 0.5..1.2), (sensor, 1.2..1.6)] {
            let [_, _, gain, correlation, _, over] = values[..] else { panic!("too few") };
            assert!((gain - 0.2).abs() < 0.02, "{gain}");
            assert!(correlation > 0.9, "{correlation}");
            // The ram's motion separates the two cases.
            assert!(over_ram.contains(&over), "{over}");
        }
    }

    #[test]
    fn where_something_stands_in_for_a_sensor_the_law_counts_as_kept() {
        let is_wrong = |spool: f64| [0.0, 0.2 * spool];
        let known = computed(is_wrong);
        let unknown = computed_beside(&[true, false], is_wrong);
        let noise = NOISE * libm::sqrt(1.0 + 36.0);
        assert_eq!([unknown[0], unknown[2], unknown[3]], [0.0; 3]);
        assert!((unknown[1] - libm::log10(noise)).abs() < 1e-3, "{}", unknown[1]);
        assert!(known[1] > unknown[1] + 0.3);
    }
}
