//! Plausibility checks of the inputs.
//!
//! The twin needs measured boundary conditions (supply, tank, temperature, command). A wrong one disturbs every
//! residual that it drives, and no tree can recognize it. The session therefore checks the inputs first. A value must
//! be present, finite and in its range. It must not freeze for longer than its sensor can, and not contradict another
//! value.

use alloc::string::String;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use crate::error::{Error, require_sound};

/// The plausible range of one input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputRange {
    /// Its name.
    pub name: String,
    /// Smallest plausible value, SI.
    pub least: f64,
    /// Largest plausible value, SI.
    pub largest: f64,
    /// Time with the same bits after which it counts as frozen; `None` for no limit.
    pub frozen_after_s: Option<f64>,
}

/// A plausibility check between two inputs: `least ≤ of − minus ≤ largest`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputDifference {
    /// Name of the first input.
    pub of: String,
    /// Name of the subtracted input.
    pub minus: String,
    /// Smallest plausible difference, SI.
    pub least: f64,
    /// Largest plausible difference, SI.
    pub largest: f64,
}

/// All plausibility checks of the inputs.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputChecks {
    /// The inputs, in the order of a sample.
    pub inputs: Vec<InputRange>,
    /// Checks between two inputs.
    pub differences: Vec<InputDifference>,
}

/// Reason why an input is rejected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Why {
    /// It is missing (NaN).
    Missing,
    /// It is infinite.
    NotFinite,
    /// It is outside its range.
    OutOfRange,
    /// Its bits have been the same for too long.
    Frozen,
    /// It contradicts another input.
    Contradicts,
    /// A wrong reading of it would explain all deviations of an actuator, and so would a fault.
    Doubtful,
}

impl InputRange {
    /// The number of equal samples from which it counts as frozen; `None` for no limit.
    pub fn frozen_after_samples(&self, period_s: f64) -> Option<u64> {
        self.frozen_after_s.map(|s| (libm::round(s / period_s) as u64).max(1))
    }

    /// What is wrong with a value on its own.
    pub(super) fn wrong(&self, value: f64) -> Option<Why> {
        if value.is_nan() {
            Some(Why::Missing)
        } else if value.is_infinite() {
            Some(Why::NotFinite)
        } else if (self.least..=self.largest).contains(&value) {
            None
        } else {
            Some(Why::OutOfRange)
        }
    }
}

impl InputChecks {
    /// Checks that ranges and names make sense.
    ///
    /// # Errors
    /// [`Error::CorruptModel`].
    pub(crate) fn check(&self) -> Result<(), Error> {
        let ordered = |low: f64, high: f64| low <= high && low.is_finite() && high.is_finite();
        for input in &self.inputs {
            let range = ordered(input.least, input.largest);
            require_sound(range, "an input's range is empty or infinite")?;
            let sound = input.frozen_after_s.is_none_or(|s| s > 0.0 && s.is_finite());
            require_sound(sound, "an input freezes after a time that is not above zero")?;
        }
        for difference in &self.differences {
            let range = ordered(difference.least, difference.largest);
            require_sound(range, "a difference's range is empty or infinite")?;
            let known =
                self.place(&difference.of).is_some() && self.place(&difference.minus).is_some();
            require_sound(known, "a difference is of an input that is not there")?;
        }
        Ok(())
    }

    pub(super) fn place(&self, name: &str) -> Option<usize> {
        self.inputs.iter().position(|input| input.name == name)
    }
}
