//! How the spread of a healthy residual grows with the flow through a valve.
//!
//! A specimen departs from its twin most while oil flows: pressure drops, the lag of a spool and the delays of sensors
//! are larger then. Windows take residuals in parts of their spread, so that what departs at rest is not lost in what
//! departs in motion:
//!
//! (SP1)  r'_i = (s_i − s_i^VT) / (x_scale,i d_i),  d_i = 1 + g_i (|x| + τ |dx/dt|),  x = x_v^VT / x_scale,v
//!
//! x_v^VT is the twin's spool position of the same actuator: the plant's own would hide its faults. τ |dx/dt| is how far
//! the spool travels within the delays of sensors. The growth g_i is learned from healthy flights.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use crate::error::{Error, require, require_sound, same_length};

/// τ, s: some samples of a flight control computer, and the lag of a slow sensor.
pub const DELAY_S: f64 = 0.05;

/// The largest growth: a residual at the full stroke of a spool is then judged a thousandth of itself.
const MAX_GROWTH: f64 = 1e3;

/// How the spread of a sensor's residual grows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spread {
    /// Index of the spool sensor of the same actuator.
    pub spool: u32,
    /// g: by how much the spread grows until the spool reaches its scale, in parts of the spread at rest.
    pub growth: f64,
}

impl Spread {
    /// d: the spread in parts of that at rest; `reach` is that of the spool.
    pub fn factor(&self, reach: f64) -> f64 {
        1.0 + self.growth * reach
    }

    /// Checks the numbers against the number of sensors.
    ///
    /// # Errors
    /// [`Error::CorruptModel`], [`Error::SettingOutOfRange`].
    pub(crate) fn check(&self, sensors: usize) -> Result<(), Error> {
        let range = 0.0..=MAX_GROWTH;
        require(range.contains(&self.growth), "growth", self.growth, "0 to 1000")?;
        let is_there = (self.spool as usize) < sensors;
        require_sound(is_there, "a spread grows with a sensor that is not there")
    }
}

/// How far the twin's signals reach within a delay of sensors: |x| + τ |dx/dt|, in parts of scale.
#[derive(Debug, Clone)]
pub struct Reach {
    /// τ, in samples.
    delay_samples: f64,
    /// The signals at the last sample, in parts of scale.
    last: Vec<f64>,
    has_last: bool,
    reach: Vec<f64>,
}

impl Reach {
    /// Before the first sample of this many sensors.
    pub fn new(sensors: usize, period_s: f64) -> Self {
        let delay_samples = DELAY_S / period_s;
        Reach {
            delay_samples,
            last: vec![0.0; sensors],
            has_last: false,
            reach: vec![0.0; sensors],
        }
    }

    /// The reach of each sensor's signal at a sample; `twin` and `scales` are in the sensors' units. Does not allocate.
    pub fn take(&mut self, twin: &[f64], scales: &[f64]) -> &[f64] {
        for (i, (value, scale)) in twin.iter().zip(scales).enumerate() {
            let x = value / scale;
            let moved = if self.has_last { (x - self.last[i]).abs() } else { 0.0 };
            self.reach[i] = x.abs() + moved * self.delay_samples;
            self.last[i] = x;
        }
        self.has_last = true;
        &self.reach
    }
}

/// The spreads of all sensors along a flight.
#[derive(Debug, Clone)]
pub struct Spreads {
    of: Vec<Option<Spread>>,
    reach: Reach,
    /// d of each sensor at the last sample.
    factors: Vec<f64>,
    measured: Vec<f64>,
}

impl Spreads {
    /// Before the first sample.
    pub fn new(of: Vec<Option<Spread>>, period_s: f64) -> Self {
        let sensors = of.len();
        let reach = Reach::new(sensors, period_s);
        Spreads { of, reach, factors: vec![1.0; sensors], measured: vec![0.0; sensors] }
    }

    /// Number of sensors.
    pub(crate) fn sensors(&self) -> usize {
        self.of.len()
    }

    /// d of a sensor at the last sample; 1 without a spread.
    ///
    /// # Panics
    /// There is no such sensor.
    pub(crate) fn factor(&self, sensor: usize) -> f64 {
        self.factors[sensor]
    }

    /// The measured values whose residuals are those of the sample in parts of their spread, and d of each sensor. A
    /// sensor without a spread keeps its bits. Does not allocate.
    pub(crate) fn divide(&mut self, measured: &[f64], twin: &[f64], scales: &[f64]) -> [&[f64]; 2] {
        let reach = self.reach.take(twin, scales);
        self.measured.copy_from_slice(measured);
        for (i, spread) in self.of.iter().enumerate() {
            if let Some(spread) = spread {
                self.factors[i] = spread.factor(reach[spread.spool as usize]);
                self.measured[i] = twin[i] + (measured[i] - twin[i]) / self.factors[i];
            }
        }
        [&self.measured, &self.factors]
    }

    /// Forgets the last sample.
    pub(crate) fn clear(&mut self) {
        self.reach.has_last = false;
    }

    /// The twin's signals at the last sample, in parts of scale; empty if there is none.
    pub(crate) fn store(&self) -> Vec<f64> {
        if self.reach.has_last { self.reach.last.clone() } else { vec![] }
    }

    /// Restores what was stored.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`]; [`Error::CorruptModel`] for a value that is not finite.
    pub(crate) fn restore(&mut self, stored: &[f64]) -> Result<(), Error> {
        self.reach.has_last = !stored.is_empty();
        if self.reach.has_last {
            same_length("twin signals", self.of.len(), stored.len())?;
            let is_sound = stored.iter().all(|value| value.is_finite());
            require_sound(is_sound, "a twin signal is not finite")?;
            self.reach.last.copy_from_slice(stored);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_residual_in_motion_counts_less_and_one_at_rest_in_full() {
        let of = vec![Some(Spread { spool: 1, growth: 30.0 }), None];
        let mut spreads = Spreads::new(of, DELAY_S / 5.0);
        let scales = [2.0, 1e-3];
        assert_eq!(spreads.divide(&[5.0, 0.3], &[4.0, 0.0], &scales)[0], [5.0, 0.3]);
        // Displaced by its scale in one sample, five of which are the delay; then it stands there.
        assert_eq!(
            spreads.divide(&[5.0, 0.3], &[4.0, -1e-3], &scales)[0],
            [4.0 + 1.0 / 181.0, 0.3]
        );
        let stored = spreads.store();
        assert_eq!(spreads.divide(&[5.0, 0.3], &[4.0, -1e-3], &scales)[0], [4.0 + 1.0 / 31.0, 0.3]);
        assert_eq!((spreads.factor(0), spreads.factor(1)), (31.0, 1.0));
        spreads.clear();
        assert!(spreads.store().is_empty());
        assert!(spreads.restore(&stored[1..]).is_err() && spreads.restore(&[f64::NAN; 2]).is_err());
        spreads.restore(&stored).unwrap();
        assert_eq!(spreads.store(), stored);
    }

    #[test]
    fn a_growth_is_a_number_and_its_spool_is_there() {
        let is_sound = |spool, growth| Spread { spool, growth }.check(2).is_ok();
        assert!(is_sound(1, 0.0) && is_sound(0, 1e3));
        assert!(!is_sound(2, 1.0) && !is_sound(0, -1.0) && !is_sound(0, f64::NAN));
    }
}
