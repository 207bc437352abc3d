//! The mean residuals of a healthy specimen, learned online.
//!
//! Specimens differ by their tolerances, so the residuals of a healthy one have nonzero means, as large as those of
//! small faults. A `Baseline` is their mean over the first seconds, and follows slowly afterwards:
//!
//! ```text
//! m_n = m_{n−1} + (r_n − m_{n−1}) / n    for n ≤ N, the settling samples
//! m_n = m_{n−1} + (r_n − m_{n−1}) / M    afterwards, M the memory in samples
//! ```
//!
//! Residuals are clipped to a quarter of their scale. No tolerance is larger, and one wild value of a broken line must
//! not stay for a minute.
//!
//! A residual minus its baseline shows changes since the start, however far the specimen is from its twin. It hides
//! faults that were present from the start or grow more slowly than the baseline follows. The diagnosis must therefore
//! watch the uncorrected residuals too.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use crate::error::{Error, require, require_sound, same_length};

/// Residuals are clipped to this part of their scale.
const MOST: f64 = 0.25;

/// Time constants of a baseline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BaselineSettings {
    /// Samples of the initial mean; at least 1.
    pub settle_samples: u32,
    /// Memory of the slow update afterwards, in samples; at least `settle_samples`.
    pub memory_samples: u32,
}

impl BaselineSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`Error::SettingOutOfRange`].
    pub fn check(&self) -> Result<(), Error> {
        let (settle, memory) = (self.settle_samples, self.memory_samples);
        require(settle > 0, "settle_samples", f64::from(settle), "at least 1")?;
        let is_longer = memory >= settle;
        require(is_longer, "memory_samples", f64::from(memory), "at least settle_samples")
    }
}

/// The mean residual of every sensor, in fixed memory.
#[derive(Debug, Clone)]
pub(crate) struct Baseline {
    settings: BaselineSettings,
    state: Stored,
}

/// What a [`Baseline`] remembers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Stored {
    /// Number of samples learned from.
    pub(crate) samples: u64,
    /// The mean residuals, in the sensors' units.
    pub(crate) means: Vec<f64>,
}

impl Baseline {
    /// An empty baseline for this many sensors.
    ///
    /// # Errors
    /// As [`BaselineSettings::check`].
    pub(crate) fn new(settings: BaselineSettings, sensors: usize) -> Result<Self, Error> {
        settings.check()?;
        Ok(Baseline { settings, state: Stored { samples: 0, means: vec![0.0; sensors] } })
    }

    /// Learns from a sample of a healthy specimen. Does not allocate.
    ///
    /// # Panics
    /// Here and in `subtract`, if there are fewer values or scales than sensors.
    pub(crate) fn learn(&mut self, measured: &[f64], twin: &[f64], scales: &[f64]) {
        self.state.samples += 1;
        let memory = match self.is_settling() {
            true => self.state.samples as f64,
            false => f64::from(self.settings.memory_samples),
        };
        for (place, mean) in self.state.means.iter_mut().enumerate() {
            let most = MOST * scales[place];
            let residual = (measured[place] - twin[place]).clamp(-most, most);
            *mean += (residual - *mean) / memory;
        }
    }

    fn is_settling(&self) -> bool {
        self.state.samples <= u64::from(self.settings.settle_samples)
    }

    /// Whether the initial mean is complete.
    pub(crate) fn is_settled(&self) -> bool {
        self.state.samples >= u64::from(self.settings.settle_samples)
    }

    /// Writes measured values without the specimen's mean residual into `values`. Sensors with a stand-in value stay as
    /// they are. Does not allocate.
    pub(crate) fn subtract(&self, measured: &[f64], stands_in: &[bool], values: &mut [f64]) {
        for (place, value) in values.iter_mut().enumerate() {
            let mean = if stands_in[place] { 0.0 } else { self.state.means[place] };
            *value = measured[place] - mean;
        }
    }

    /// Forgets everything.
    pub(crate) fn clear(&mut self) {
        self.state.samples = 0;
        self.state.means.fill(0.0);
    }

    /// Returns the complete state.
    pub(crate) fn store(&self) -> Stored {
        self.state.clone()
    }

    /// Restores a state stored with the same number of sensors.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`].
    pub(crate) fn restore(&mut self, stored: &Stored) -> Result<(), Error> {
        same_length("means of a reference", self.state.means.len(), stored.means.len())?;
        let is_sound =
            stored.samples <= 1 << 53 && stored.means.iter().all(|mean| mean.is_finite());
        require_sound(is_sound, "a stored reference is no mean of samples")?;
        self.state.clone_from(stored);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENARIOS: BaselineSettings =
        BaselineSettings { settle_samples: 10, memory_samples: 1000 };

    const SCALE: f64 = 100.0;

    fn left(baseline: &Baseline, measured: f64) -> f64 {
        let mut values = [0.0];
        baseline.subtract(&[measured], &[false], &mut values);
        values[0]
    }

    #[test]
    fn it_is_the_mean_of_the_first_samples_and_follows_slowly() {
        let mut baseline = Baseline::new(SCENARIOS, 1).unwrap();
        for k in 0..10 {
            assert!(!baseline.is_settled());
            baseline.learn(&[7.0 + f64::from(k % 2)], &[2.0], &[SCALE]);
        }
        assert!(baseline.is_settled());
        assert!((left(&baseline, 7.5) - 2.0).abs() < 1e-12, "the twin's value is left");
        for _ in 0..100 {
            baseline.learn(&[9.5], &[2.0], &[SCALE]);
        }
        let shown = left(&baseline, 9.5) - 2.0;
        assert!((shown - 2.0 * libm::exp(-0.1)).abs() < 1e-3, "a tenth of its memory: {shown}");
        (0..10_000).for_each(|_| baseline.learn(&[9.5], &[2.0], &[SCALE]));
        assert!((left(&baseline, 9.5) - 2.0).abs() < 1e-3, "ten times its memory");
    }

    #[test]
    fn one_wild_value_moves_little() {
        let mut baseline = Baseline::new(SCENARIOS, 1).unwrap();
        let wild = |baseline: &mut Baseline, value: f64| {
            (0..9).for_each(|_| baseline.learn(&[2.0], &[2.0], &[SCALE]));
            baseline.learn(&[value], &[2.0], &[SCALE]);
            left(baseline, 2.0) - 2.0
        };
        let at_first = wild(&mut baseline, 1e300);
        assert!((at_first + 0.1 * MOST * SCALE).abs() < 1e-9, "{at_first}");
        let before = left(&baseline, 2.0);
        let later = wild(&mut baseline, -1e300) + 2.0 - before;
        assert!(later > 0.0 && later < 2.0 * MOST * SCALE / 1000.0 + 0.1, "{later}");
    }

    #[test]
    fn what_stands_in_for_a_sensor_has_no_tolerance() {
        let mut baseline = Baseline::new(SCENARIOS, 2).unwrap();
        (0..10).for_each(|_| baseline.learn(&[3.0, 3.0], &[1.0, 1.0], &[SCALE; 2]));
        let mut values = [0.0; 2];
        baseline.subtract(&[3.0, 1.0], &[false, true], &mut values);
        assert_eq!(values, [1.0, 1.0]);
    }

    #[test]
    fn what_was_stored_goes_on_and_what_is_impossible_is_refused() {
        let mut baseline = Baseline::new(SCENARIOS, 1).unwrap();
        (0..7).for_each(|k| baseline.learn(&[f64::from(k)], &[0.0], &[SCALE]));
        let mut other = Baseline::new(SCENARIOS, 1).unwrap();
        other.restore(&baseline.store()).unwrap();
        (0..20).for_each(|k| {
            baseline.learn(&[f64::from(k)], &[0.0], &[SCALE]);
            other.learn(&[f64::from(k)], &[0.0], &[SCALE]);
        });
        assert_eq!(baseline.store(), other.store());
        assert!(Baseline::new(SCENARIOS, 2).unwrap().restore(&baseline.store()).is_err());
        baseline.clear();
        assert_eq!(baseline.store(), Baseline::new(SCENARIOS, 1).unwrap().store());
        for (settle_samples, memory_samples) in [(0, 10), (10, 9)] {
            assert!(Baseline::new(BaselineSettings { settle_samples, memory_samples }, 1).is_err());
        }
    }
}
