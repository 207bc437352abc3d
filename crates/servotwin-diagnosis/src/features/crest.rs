//! Whether a residual is steady or comes in bursts.
//!
//! ```text
//! K_i = log10 ( peak_i / rms_i ),   peak = max(largest |r'_i|, 4 noise_i),   rms² = mean² + variance
//! ```
//!
//! the crest factor. A bias has 0, a sine 0.15, noise 0.6. A valve without damping may ring for a tenth of a second
//! after a quick command. It then has more than 1, though its moments look healthy. The peak is at least four standard
//! deviations of a sample, so that the number of noise samples has no influence.

use super::{Sensors, Sink, Teaches, log_deviation};
use crate::number::Number;
use crate::residual::{LARGEST_OF_NOISE, Statistics};

pub(super) fn list<W: Statistics, S: Sink<W::Number>>(sensors: &Sensors, window: &W, out: &mut S) {
    for (i, s) in sensors.0.iter().enumerate() {
        let noise = sensors.noise(&[(i, 1.0)]);
        let largest_noise = W::Number::constant(LARGEST_OF_NOISE * noise.least_deviation());
        let peak = window.largest(i).larger(largest_noise);
        let mean = window.mean(i);
        let mean_square = mean * mean + window.covariance(i, i);
        out.put(peak.log10() - log_deviation(mean_square, noise), || {
            let meaning = "log10 of the largest magnitude of the residual of {} over its rms";
            s.feature("crest", "log10", meaning).teaching(Teaches::TreesOfRecords)
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::{Quantity, Sensor};
    use crate::random::Random;
    use crate::residual::Window;
    use alloc::vec::Vec;

    const NOISE: f64 = 0.002;

    /// The crest factor of a noisy residual over this many samples.
    fn crest(samples: u32, residual: impl Fn(f64) -> f64) -> f64 {
        let sensors = Sensors(alloc::vec![Sensor {
            name: "x_v_1".into(),
            quantity: Quantity::Spool,
            actuator: Some(0),
            noise: NOISE,
            is_noisy: true,
            follows: alloc::vec![],
        }]);
        let mut random = Random::new(7);
        let mut window = Window::new(1);
        for sample in 0..samples {
            let normal = (0..12).map(|_| random.unit()).sum::<f64>() - 6.0;
            window.add(&[residual(f64::from(sample) * 0.01) + NOISE * normal], &[0.0], &[1.0]);
        }
        let mut values: Vec<f64> = Vec::new();
        list(&sensors, &window, &mut values);
        values[0]
    }

    #[test]
    fn what_is_there_all_the_time_has_a_small_crest_and_what_bursts_a_large_one() {
        let bias = crest(2000, |_| 0.2);
        let sine = crest(2000, |t| 0.2 * libm::sin(6.0 * t));
        let burst = crest(2000, |t| match t {
            3.0..3.1 => 0.2 * libm::sin(60.0 * t),
            _ => 0.0,
        });
        assert!(bias.abs() < 0.02, "{bias}");
        assert!((sine - 0.15).abs() < 0.02, "{sine}");
        assert!(burst > 1.0, "{burst}");
    }

    #[test]
    fn of_noise_the_number_of_samples_does_not_show() {
        let [short, long] = [500, 9000].map(|samples| crest(samples, |_| 0.0));
        assert!((short - libm::log10(LARGEST_OF_NOISE)).abs() < 0.02, "{short}");
        assert!((long - short).abs() < 0.02, "{long} against {short}");
    }
}
