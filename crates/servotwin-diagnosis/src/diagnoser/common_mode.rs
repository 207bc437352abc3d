//! Common mode: a deviation that several actuators share is the fault of none of them.
//!
//! If the twin gets a wrong command, the same sensors of all actuators deviate alike. A tree that never saw this picks
//! an actuator by chance. With r the residuals of corresponding sensors of actuators k and l in parts of their bands,
//!
//! ```text
//! share = Σ E(r_k + r_l)² / (Σ E(r_k + r_l)² + Σ E(r_k − r_l)²)
//! ```
//!
//! It is one half if only one of the two deviates, less if one moves against the other, and one if both deviate alike.

use alloc::vec::Vec;

use crate::features::Sensors;
use crate::panel::SensorBand;
use crate::residual::Window;

/// Two actuators, and their corresponding sensors.
pub(crate) type CorrespondingSensors = ([usize; 2], Vec<[usize; 2]>);

/// The corresponding sensors of each pair of actuators, among the first `watched` ones.
pub fn corresponding(sensors: &Sensors, watched: usize) -> Vec<CorrespondingSensors> {
    let mut pairs = Vec::new();
    for first in 0..sensors.actuators() {
        for second in first + 1..sensors.actuators() {
            let Some(order) = sensors.exchanged(first, second) else { continue };
            let own = |&sensor: &usize| sensors.0[sensor].actuator == Some(first);
            let watched = (0..watched).filter(own).filter(|&sensor| order[sensor] < watched);
            pairs.push(([first, second], watched.map(|sensor| [sensor, order[sensor]]).collect()));
        }
    }
    pairs
}

/// The corresponding sensors of each pair of actuators.
#[derive(Debug, Clone)]
pub(super) struct CommonMode {
    pairs: Vec<CorrespondingSensors>,
}

impl CommonMode {
    /// Considers the first `watched` sensors.
    pub(crate) fn new(sensors: &Sensors, watched: usize) -> Self {
        CommonMode { pairs: corresponding(sensors, watched) }
    }

    /// The largest common-mode share of an actuator with any other; 0 without a corresponding actuator.
    pub(crate) fn share(&self, actuator: usize, window: &Window, bands: &[SensorBand]) -> f64 {
        let pairs = self.pairs.iter().filter(|(actuators, _)| actuators.contains(&actuator));
        pairs.map(|(_, sensors)| share(sensors, window, bands)).fold(0.0, f64::max)
    }
}

fn share(sensors: &[[usize; 2]], window: &Window, bands: &[SensorBand]) -> f64 {
    let (mut sum, mut difference) = (0.0, 0.0);
    for &[a, b] in sensors {
        let weight = 1.0 / (bands[a].half_width * bands[b].half_width).max(1e-24);
        let mean = |sign: f64| {
            let mean = window.mean(a) + sign * window.mean(b);
            mean * mean
        };
        let own = window.covariance(a, a) + window.covariance(b, b);
        let common = 2.0 * window.covariance(a, b);
        sum += weight * (own + common + mean(1.0));
        difference += weight * (own - common + mean(-1.0));
    }
    if sum + difference > 0.0 { sum / (sum + difference) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::{Quantity, Sensor};
    use alloc::format;

    fn share_of<const N: usize>(residual: impl Fn(f64) -> [f64; N]) -> [f64; N] {
        let sensor = |actuator: usize| Sensor {
            name: format!("x_{actuator}"),
            quantity: Quantity::Ram,
            actuator: Some(actuator),
            noise: 0.0,
            is_noisy: false,
            follows: alloc::vec![],
        };
        let sensors = Sensors((0..N).map(sensor).collect());
        let mut window = Window::new(N);
        for k in 0..50 {
            window.add(&residual(f64::from(k) * 0.1), &[0.0; N], &[1.0; N]);
        }
        let band = |s: &Sensor| SensorBand { sensor: s.name.clone(), half_width: 0.01 };
        let bands: Vec<SensorBand> = sensors.0.iter().map(band).collect();
        let common_mode = CommonMode::new(&sensors, N);
        core::array::from_fn(|actuator| common_mode.share(actuator, &window, &bands))
    }

    #[test]
    fn the_share_tells_common_from_own_and_from_opposite() {
        let wave = |t: f64| 0.05 + libm::sin(t);
        let of_second = |residual: &dyn Fn(f64) -> [f64; 2]| share_of(residual)[1];
        assert!((of_second(&|t| [wave(t), wave(t)]) - 1.0).abs() < 1e-12);
        assert!((of_second(&|t| [wave(t), 0.0]) - 0.5).abs() < 1e-12);
        assert!(of_second(&|t| [wave(t), -wave(t)]) < 1e-12);
        let nearly = of_second(&|t| [wave(t), 0.8 * wave(t)]);
        assert!((0.97..1.0).contains(&nearly), "{nearly}");
        assert_eq!(of_second(&|_| [0.0, 0.0]), 0.0);
    }

    /// With three actuators, the fault of one is its own, whatever the other two have in common.
    #[test]
    fn what_two_of_three_have_in_common_is_no_fault_of_either() {
        let wave = |t: f64| 0.05 + libm::sin(t);
        let all = share_of(|t| [wave(t), wave(t), wave(t)]);
        assert!(all.iter().all(|share| (share - 1.0).abs() < 1e-12), "{all:?}");
        let [own, second, third] = share_of(|t| [wave(t), -0.2 * wave(t), -0.2 * wave(t)]);
        assert!(own < 0.5 && second > 0.999 && third > 0.999, "{own} {second} {third}");
    }
}
