//! Plausibility checks of the inputs.
//!
//! The twin needs measured boundary conditions (supply, tank, temperature, command). A wrong one disturbs every
//! residual that it drives, and no tree can recognize it. The session therefore checks the inputs first. A value must
//! be present, finite and in its range. It must not freeze for longer than its sensor can, and not contradict another
//! value.

use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use crate::error::Error;

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

/// A rejected input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Invalid {
    /// Index into [`InputChecks::inputs`].
    pub input: u32,
    /// The failed check.
    pub why: Why,
}

impl InputRange {
    /// The number of equal samples from which it counts as frozen; `None` for no limit.
    pub fn frozen_after_samples(&self, period_s: f64) -> Option<u64> {
        self.frozen_after_s.map(|s| (libm::round(s / period_s) as u64).max(1))
    }
}

impl InputChecks {
    /// Checks that ranges and names make sense.
    ///
    /// # Errors
    /// [`Error::CorruptModel`].
    pub(crate) fn check(&self) -> Result<(), Error> {
        let holds = |holds, broken| {
            if holds { Ok(()) } else { Err(Error::CorruptModel { broken }) }
        };
        let ordered = |low: f64, high: f64| low <= high && low.is_finite() && high.is_finite();
        for input in &self.inputs {
            holds(ordered(input.least, input.largest), "an input's range is empty or infinite")?;
            let sound = input.frozen_after_s.is_none_or(|s| s > 0.0 && s.is_finite());
            holds(sound, "an input freezes after a time that is not above zero")?;
        }
        for difference in &self.differences {
            let range = ordered(difference.least, difference.largest);
            holds(range, "a difference's range is empty or infinite")?;
            let known =
                self.place(&difference.of).is_some() && self.place(&difference.minus).is_some();
            holds(known, "a difference is of an input that is not there")?;
        }
        Ok(())
    }

    fn place(&self, name: &str) -> Option<usize> {
        self.inputs.iter().position(|input| input.name == name)
    }
}

/// How long each input has been the same.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct InputMemory {
    /// Bits of the last value, so that a stored NaN comes back exactly.
    last: Vec<u64>,
    /// Number of repetitions of each value.
    repeats: Vec<u64>,
}

impl InputMemory {
    /// Forgets everything.
    pub(crate) fn clear(&mut self) {
        self.last.fill(f64::NAN.to_bits());
        self.repeats.fill(0);
    }
}

/// Applies the checks to each sample.
#[derive(Debug, Clone)]
pub(super) struct Guard {
    /// Number of repetitions from which each input counts as frozen.
    frozen_after: Vec<Option<u64>>,
    /// Indices of both inputs of each difference.
    pairs: Vec<(usize, usize)>,
    pub memory: InputMemory,
}

impl Guard {
    pub(crate) fn new(environment: &InputChecks, period_s: f64) -> Self {
        let frozen_after = |input: &InputRange| input.frozen_after_samples(period_s);
        let pair =
            |d: &InputDifference| Some((environment.place(&d.of)?, environment.place(&d.minus)?));
        let count = environment.inputs.len();
        Guard {
            frozen_after: environment.inputs.iter().map(frozen_after).collect(),
            pairs: environment.differences.iter().filter_map(pair).collect(),
            memory: InputMemory { last: vec![f64::NAN.to_bits(); count], repeats: vec![0; count] },
        }
    }

    /// Whether a stored memory has the same number of inputs.
    pub(crate) fn fits(&self, memory: &InputMemory) -> bool {
        let count = self.frozen_after.len();
        memory.last.len() == count && memory.repeats.len() == count
    }

    /// The first implausible value, if any. Values that a short list lacks count as missing.
    pub(crate) fn look(&mut self, environment: &InputChecks, inputs: &[f64]) -> Option<Invalid> {
        let value = |input: usize| inputs.get(input).copied().unwrap_or(f64::NAN);
        let mut first = None;
        for (place, input) in environment.inputs.iter().enumerate() {
            let is_frozen = self.is_frozen(place, value(place));
            let why = why(input, value(place)).or(is_frozen.then_some(Why::Frozen));
            first = first.or(why.map(|why| Invalid { input: place as u32, why }));
        }
        let contradiction = || {
            let holds = |(d, &(of, minus)): (&InputDifference, &(usize, usize))| {
                (d.least..=d.largest).contains(&(value(of) - value(minus)))
            };
            let mut broken =
                environment.differences.iter().zip(&self.pairs).filter(|pair| !holds(*pair));
            let (_, &(of, _)) = broken.next()?;
            Some(Invalid { input: of as u32, why: Why::Contradicts })
        };
        first.or_else(contradiction)
    }

    fn is_frozen(&mut self, place: usize, value: f64) -> bool {
        let InputMemory { last, repeats } = &mut self.memory;
        let same = last[place] == value.to_bits();
        repeats[place] = if same { repeats[place].saturating_add(1) } else { 0 };
        last[place] = value.to_bits();
        self.frozen_after[place].is_some_and(|limit| repeats[place] >= limit)
    }
}

fn why(input: &InputRange, value: f64) -> Option<Why> {
    if value.is_nan() {
        Some(Why::Missing)
    } else if value.is_infinite() {
        Some(Why::NotFinite)
    } else if (input.least..=input.largest).contains(&value) {
        None
    } else {
        Some(Why::OutOfRange)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn environment() -> InputChecks {
        let input = |name: &str, frozen_after_s| InputRange {
            name: name.into(),
            least: 0.0,
            largest: 100.0,
            frozen_after_s,
        };
        InputChecks {
            inputs: vec![input("supply", Some(0.05)), input("tank", None)],
            differences: vec![InputDifference {
                of: "supply".into(),
                minus: "tank".into(),
                least: 10.0,
                largest: 90.0,
            }],
        }
    }

    #[test]
    fn every_reason_is_found_and_named() {
        let environment = environment();
        environment.check().unwrap();
        let look = |inputs: &[f64]| Guard::new(&environment, 0.01).look(&environment, inputs);
        let invalid = |input, why| Some(Invalid { input, why });
        assert_eq!(look(&[50.0, 5.0]), None);
        assert_eq!(look(&[f64::NAN, 5.0]), invalid(0, Why::Missing));
        assert_eq!(look(&[50.0]), invalid(1, Why::Missing));
        assert_eq!(look(&[50.0, f64::NEG_INFINITY]), invalid(1, Why::NotFinite));
        assert_eq!(look(&[50.0, -1.0]), invalid(1, Why::OutOfRange));
        assert_eq!(look(&[14.0, 5.0]), invalid(0, Why::Contradicts));
    }

    #[test]
    fn a_value_freezes_after_its_time_and_thaws_at_once() {
        let environment = environment();
        let mut guard = Guard::new(&environment, 0.01);
        for k in 0..10 {
            let expected = (k >= 5).then_some(Invalid { input: 0, why: Why::Frozen });
            assert_eq!(guard.look(&environment, &[50.0, 5.0]), expected, "sample {k}");
        }
        assert_eq!(guard.look(&environment, &[50.1, 5.0]), None);
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        let mut reversed = environment();
        reversed.inputs[0].least = 200.0;
        assert!(reversed.check().is_err());
        let mut unknown = environment();
        unknown.differences[0].minus = "air".into();
        assert!(unknown.check().is_err());
    }
}
