//! The law of a servo valve: its spool follows the current that drives it, whatever the position loop does.
//!
//! Regression of the spool's displacement x over the current i, both in parts of scale, as measured and by the twin:
//!
//! ```text
//! x ≈ α + β i,   β = cov(x, i)/var(i),   α = ⟨x⟩ − β⟨i⟩,   e² = var(x) − cov²(x, i)/var(i)
//! ```
//!
//! A wrong gain of the valve or of its spool sensor moves β, and a shifted null moves α. e is what the line leaves: in a
//! fast motion the part of x that lags, which a loss of natural frequency or damping moves. It is compared with the
//! deviation of i. Flow, load and friction change the current and the spool together, and none of the three.
//!
//! Sensors without a current have no such features.

use super::{Noise, Quantity, Sensors, Sink, log_deviation, of_law};
use crate::number::Number;
use crate::residual::Statistics;

/// Below this deviation, in parts of scale, a current gives no slope.
const LEAST_DEVIATION: f64 = 1e-2;

/// The line of a spool over its current.
struct Line<N> {
    /// α and β.
    offset: N,
    slope: N,
    /// e² and var(i).
    left: N,
    of_current: N,
}

impl<N: Number> Line<N> {
    /// From the means of x and i, and their covariances: xx, xi and ii.
    fn new([x, i]: [N; 2], [xx, xi, ii]: [N; 3]) -> Self {
        let slope = xi / (ii + N::constant(LEAST_DEVIATION * LEAST_DEVIATION));
        Line { offset: x - slope * i, slope, left: xx - slope * xi, of_current: ii }
    }
}

/// The lines of spool over current, by the twin and as measured.
fn lines<W: Statistics>(window: &W, spool: usize, current: usize) -> [Line<W::Number>; 2] {
    let pairs = [(spool, spool), (spool, current), (current, current)];
    let of_twin = pairs.map(|(a, b)| window.twin_covariance(a, b));
    let measured = pairs.map(|(a, b)| {
        let both = window.cross_covariance(a, b) + window.cross_covariance(b, a);
        window.covariance(a, b) + both + window.twin_covariance(a, b)
    });
    let mean_of_twin = [spool, current].map(|sensor| window.twin_mean(sensor));
    let mean = [spool, current].map(|sensor| window.mean(sensor) + window.twin_mean(sensor));
    [Line::new(mean_of_twin, of_twin), Line::new(mean, measured)]
}

pub(super) fn list<W: Statistics, S: Sink<W::Number>>(sensors: &Sensors, window: &W, out: &mut S) {
    for actuator in sensors.with(&[Quantity::Spool, Quantity::Current]) {
        let find = |quantity| sensors.find(quantity, actuator).expect("an actuator with both");
        let (spool, current) = (find(Quantity::Spool), find(Quantity::Current));
        let [twin, measured] = lines(window, spool, current);
        // Twin and sensors show the noise of real sensors, so that nothing below it counts.
        let over = |noise: Noise, measured, twin| {
            let of_twin = Noise { carried: 0.0, ..noise };
            log_deviation(measured, noise) - log_deviation(twin, of_twin)
        };
        let of_both = sensors.noise(&[(spool, 1.0), (current, 1.0)]);
        let left = over(of_both, measured.left, twin.left);
        let of_current = sensors.noise(&[(current, 1.0)]);
        let lag = left - over(of_current, measured.of_current, twin.of_current);
        let known = |value| of_law(window, [spool, current].into_iter(), value, 0.0);
        let of_spool = &sensors.0[spool];
        out.put(known(measured.slope - twin.slope), || {
            of_spool.feature(
                "law_gain",
                "1",
                "slope over the current, less that of the twin, of {}",
            )
        });
        out.put(known(measured.offset - twin.offset), || {
            let meaning = "value at a current of zero, less that of the twin, of {}";
            of_spool.feature("law_offset", "of scale", meaning)
        });
        out.put(known(lag), || {
            let meaning =
                "log10 of what the line over the current leaves, over that of the twin, of {}";
            of_spool.feature("law_lag", "log10", meaning)
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::Sensor;
    use crate::residual::Window;
    use alloc::vec::Vec;

    /// The features of a spool that follows its current with a gain, an offset and a lag of samples; the twin has a
    /// slower loop.
    fn features(gain: f64, offset: f64, lag: usize) -> Vec<f64> {
        let sensor = |name: &str, quantity| Sensor {
            name: name.into(),
            quantity,
            actuator: Some(0),
            noise: 1e-4,
            is_noisy: false,
            follows: Vec::new(),
        };
        let sensors = Sensors(
            [("x_v_1", Quantity::Spool), ("u_1", Quantity::Current)]
                .map(|(name, quantity)| sensor(name, quantity))
                .into(),
        );
        let mut window = Window::new(2);
        let current = |sample: usize, size: f64| size * libm::sin(0.2 * sample as f64);
        for sample in 10..1000 {
            let measured = [gain * current(sample - lag, 0.3) + offset, current(sample, 0.3)];
            let twin = [current(sample - 2, 0.25), current(sample, 0.25)];
            window.add(&measured, &twin, &[1.0, 1.0]);
        }
        let mut values = Vec::new();
        list(&sensors, &window, &mut values);
        values
    }

    #[test]
    fn gain_offset_and_lag_show_apart_and_the_loop_in_none() {
        // The twin's current is smaller by a sixth, which none of the three shows.
        let healthy = features(1.0, 0.0, 2);
        assert!(healthy.iter().all(|value| value.abs() < 1e-2), "{healthy:?}");
        let [high, shifted, slow] =
            [features(1.2, 0.0, 2), features(1.0, 0.1, 2), features(1.0, 0.0, 4)];
        assert!((high[0] - 0.184).abs() < 1e-2 && high[1].abs() < 1e-2, "{high:?}");
        assert!((shifted[1] - 0.1).abs() < 1e-2 && shifted[0].abs() < 1e-2, "{shifted:?}");
        assert!(slow[2] > healthy[2] + 0.2, "{slow:?} beside {healthy:?}");
    }
}
