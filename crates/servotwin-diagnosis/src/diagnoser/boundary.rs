//! Doubt about a boundary sensor: a wrong supply or return pressure looks like a leak or a closed valve.
//!
//! The twin computes with the measured boundary value u. If that reading is off by δ, the residuals of the actuator
//! move in a direction that the twin's own equations give, and that of the sensor next to the boundary moves by δ. A
//! leak and a closed valve move the same residuals in the same direction. But they change the pressure drop between
//! boundary and sensor, and this drop grows with the load flow. With r the residual and y the twin's signal of the
//! sensor next to the boundary:
//!
//! ```text
//! wrong reading    r = δ
//! fault            r = δ + s y,  s ≠ 0
//! evidence         n/2 ln(Σr² / (Σr² − (Σry)²/Σy²)) − 1/2 ln n                 (1)
//! ```
//!
//! The sums take deviations from the means of windows, so a drift of δ does no harm. (1) is the criterion of Schwarz,
//! "Estimating the Dimension of a Model", Annals of Statistics 6, 1978. n counts independent samples. What is left of
//! the residual beside the line is in part the white noise of the sensor, which is new in every sample. The other part
//! is an error of the model, which is new in every window only.
//!
//! A shutdown waits for this evidence while a wrong reading explains all that the actuator shows: what is left of the
//! mean residuals lies within their bands, and δ is no larger than a transducer's error.

use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::panel::SensorBand;
use crate::residual::Window;

/// What a wrong reading of one boundary value does.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Boundary {
    /// Index of the input.
    pub input: u32,
    /// Index of the sensor next to the boundary.
    pub sensor: u32,
    /// Each watched sensor of its actuator, and the change of its twin value in parts of scale for a change of the
    /// input by one SI unit.
    pub effects: Vec<(u32, f64)>,
}

impl Boundary {
    /// Checks indices and numbers.
    ///
    /// # Errors
    /// [`Error::CorruptModel`].
    pub(super) fn check(&self, inputs: usize, watched: usize) -> Result<(), Error> {
        let known = |sensor: u32| (sensor as usize) < watched;
        let is_sound = (self.input as usize) < inputs
            && self.effect().is_some_and(|effect| effect != 0.0)
            && self.effects.iter().all(|&(sensor, effect)| known(sensor) && effect.is_finite());
        let broken = "a boundary names no input, or no effect on its sensor";
        if is_sound { Ok(()) } else { Err(Error::CorruptModel { broken }) }
    }

    /// The effect on the sensor next to the boundary.
    fn effect(&self) -> Option<f64> {
        self.effects.iter().find(|(sensor, _)| *sensor == self.sensor).map(|(_, effect)| *effect)
    }

    /// Whether a wrong reading explains a window: it moves the sensor next to the boundary out of its band, by no more
    /// than `largest_error` in parts of scale, and what is left of all mean residuals lies within their bands.
    pub(super) fn explains(
        &self,
        window: &Window,
        bands: &[SensorBand],
        largest_error: f64,
    ) -> bool {
        let half_width = |sensor: u32| bands[sensor as usize].half_width.max(1e-12);
        let (mut along, mut of) = (0.0, 0.0);
        for &(sensor, effect) in &self.effects {
            let weighed = effect / half_width(sensor);
            along += weighed * window.mean(sensor as usize) / half_width(sensor);
            of += weighed * weighed;
        }
        let wrong_by = along / of;
        let is_left_in_band = |&(sensor, effect): &(u32, f64)| {
            (window.mean(sensor as usize) - wrong_by * effect).abs() <= half_width(sensor)
        };
        let moved = (wrong_by * self.effect().unwrap_or_default()).abs();
        moved > half_width(self.sensor)
            && moved <= largest_error
            && self.effects.iter().all(is_left_in_band)
    }
}

/// The evidence of a running session against a wrong reading of one boundary value.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Doubt {
    /// Consecutive windows in which the sensor next to the boundary deviated.
    deviating: u32,
    /// Number of samples, and of windows that share none.
    samples: f64,
    windows: f64,
    /// Σr², Σry and Σy².
    sums: [f64; 3],
}

impl Doubt {
    /// Whether a session can have stored these numbers.
    pub fn fits(&self) -> bool {
        self.samples >= 0.0
            && self.windows >= 0.0
            && self.sums.iter().chain([&self.samples, &self.windows]).all(|sum| sum.is_finite())
            && self.sums[0] >= 0.0
            && self.sums[2] >= 0.0
    }

    /// Forgets all samples.
    pub fn clear(&mut self) {
        *self = Doubt::default();
    }

    /// Takes a window of `panes` panes, of which `share` is new. The sums forget within `memory_s` seconds. A window that holds the onset of the deviation counts
    /// nothing: there the residual steps, whatever the flow is.
    pub fn take(
        &mut self,
        boundary: &Boundary,
        window: &Window,
        half_width: f64,
        memory_s: f64,
        (panes, share, period_s): (u32, f64, f64),
    ) {
        let sensor = boundary.sensor as usize;
        if window.mean(sensor).abs() <= half_width {
            return self.clear();
        }
        self.deviating = self.deviating.saturating_add(1);
        if self.deviating <= panes {
            return;
        }
        let new = share * window.count() as f64;
        let kept = libm::exp(-new * period_s / memory_s);
        self.samples = kept * self.samples + new;
        self.windows = kept * self.windows + share;
        let moments = [
            window.covariance(sensor, sensor),
            window.cross_covariance(sensor, sensor),
            window.twin_covariance(sensor, sensor),
        ];
        for (sum, moment) in self.sums.iter_mut().zip(moments) {
            *sum = kept * *sum + new * moment;
        }
    }

    /// Equation (1), in nats. `noise` is the standard deviation of a sample of the residual by the sensor's noise, in
    /// parts of scale.
    pub fn evidence_nats(&self, noise: f64) -> f64 {
        let [of_residual, of_both, of_twin] = self.sums;
        if self.samples <= 1.0 || of_residual <= 0.0 || of_twin <= 0.0 {
            return 0.0;
        }
        let explained = of_both * of_both / (of_residual * of_twin);
        let left = (1.0 - explained).max(1e-12);
        let white = (self.samples * noise * noise / (left * of_residual)).min(1.0);
        let independent = (white * self.samples + (1.0 - white) * self.windows).max(1.0);
        -0.5 * (independent * libm::log(left) + libm::log(independent))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use alloc::format;
    use alloc::vec;

    impl Doubt {
        /// Whether a wrong reading is still possible with odds of 1 to 20.
        fn remains(&self) -> bool {
            self.evidence_nats(NOISE) < 3.0
        }
    }

    const BOUNDARY: fn() -> Boundary =
        || Boundary { input: 0, sensor: 0, effects: vec![(0, 1e-7), (1, 0.5e-7)] };

    fn bands() -> Vec<SensorBand> {
        let band = |n: usize| SensorBand { sensor: format!("p_{n}"), half_width: 0.02 };
        (0..2).map(band).collect()
    }

    /// The deviation of uniform noise 0.005 wide.
    const NOISE: f64 = 0.00144;

    /// A window of 50 samples from `start`, with residuals of two sensors and the twin's drop of the first.
    fn window(
        start: usize,
        drop: impl Fn(f64) -> f64,
        residual: impl Fn(f64) -> [f64; 2],
    ) -> Window {
        let mut random = Random::stream(7, start as u64);
        let mut window = Window::new(2);
        for k in 0..50 {
            let time_s = 0.01 * (start + k) as f64;
            let mut noise = || 0.005 * (random.unit() - 0.5);
            let twin = [1.0 - drop(time_s), 0.5];
            let r = residual(time_s);
            let measured = [twin[0] + r[0] + noise(), twin[1] + r[1] + noise()];
            window.add(&measured, &twin, &[1.0, 1.0]);
        }
        window
    }

    /// The doubt after some seconds, with windows that begin 0.1 s apart.
    fn doubt(
        seconds: usize,
        drop: impl Fn(f64) -> f64,
        residual: impl Fn(f64) -> [f64; 2],
    ) -> Doubt {
        let mut doubt = Doubt::default();
        for pane in 0..10 * seconds {
            let window = window(10 * pane, &drop, &residual);
            doubt.take(&BOUNDARY(), &window, 0.02, 10.0, (5, 0.2, 0.01));
        }
        doubt
    }

    /// The drop over the supply valve under a load flow that follows a motion of 0.7 Hz.
    fn moving(time_s: f64) -> f64 {
        0.03 * libm::pow(libm::sin(4.4 * time_s), 2.0)
    }

    #[test]
    fn a_leak_grows_with_the_load_flow_and_a_wrong_reading_does_not() {
        let leak = |time_s: f64| {
            let shift = -0.04 - 0.5 * moving(time_s);
            [shift, 0.5 * shift]
        };
        assert!(!doubt(2, moving, leak).remains());
        assert!(doubt(30, moving, |_| [-0.04, -0.02]).remains());
    }

    /// A model error that happens to move with the flow for some seconds is no evidence, though its samples are many.
    #[test]
    fn an_error_that_is_the_same_throughout_a_window_counts_once() {
        let swinging = |time_s: f64| {
            let shift = -0.04 + 0.004 * libm::sin(3.1 * time_s);
            [shift, 0.5 * shift]
        };
        assert!(doubt(4, moving, swinging).remains());
    }

    /// Without motion nothing tells the two apart, however long it lasts.
    #[test]
    fn an_actuator_at_rest_stays_doubtful() {
        assert!(doubt(30, |_| 0.001, |_| [-0.04, -0.02]).remains());
    }

    #[test]
    fn evidence_is_forgotten_when_the_deviation_ends() {
        let leak = |time_s: f64| [-0.04 - 0.5 * moving(time_s), -0.02];
        let mut doubt = doubt(3, moving, leak);
        doubt.take(&BOUNDARY(), &window(0, moving, |_| [0.0, 0.0]), 0.02, 10.0, (5, 0.2, 0.01));
        assert!(doubt.remains() && doubt.samples == 0.0);
    }

    #[test]
    fn a_wrong_reading_moves_all_sensors_in_its_direction_by_no_more_than_transducers_err() {
        let explains = |residual: [f64; 2]| {
            let window = window(0, |_| 0.0, |_| residual);
            BOUNDARY().explains(&window, &bands(), 0.05)
        };
        assert!(explains([-0.04, -0.02]));
        assert!(explains([0.04, 0.02]));
        // Only the sensor next to the boundary moves: it is this sensor's own fault.
        assert!(!explains([-0.04, 0.03]));
        assert!(!explains([-0.08, -0.04]), "no transducer errs by 8 % of its scale");
        assert!(!explains([0.0, 0.0]), "nothing deviates, so there is nothing to explain");
    }

    #[test]
    fn a_boundary_needs_an_effect_on_its_own_sensor() {
        assert!(BOUNDARY().check(1, 2).is_ok());
        assert!(BOUNDARY().check(0, 2).is_err() && BOUNDARY().check(1, 1).is_err());
        assert!(Boundary { sensor: 1, effects: vec![(0, 1.0)], ..BOUNDARY() }.check(1, 2).is_err());
    }
}
