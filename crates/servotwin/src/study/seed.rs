//! Seeds: every random number of a study comes from one hash of the study's seed, the name of what is drawn, a number,
//! and a stream. So no two purposes share a random number, and a run depends on nothing but itself.

use super::Study;
use crate::signal::random::NormalDeviates;
use servotwin_diagnosis::random::Random;
use servotwin_model::hash::Fingerprint;

/// The root of the random numbers of a run, an environment or a specimen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Seed(u64);

/// What random numbers are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// Places in the ranges of a command.
    Command,
    /// The random part of a command.
    Noise,
    /// Places in the ranges of inputs and parameters.
    Ranges,
    /// The onset of a fault.
    Onset,
    /// Deviations of a specimen from its nominal parameters.
    Tolerances,
    /// Further parameters of a specimen.
    Draws,
    /// Parameters of a plant of another structure.
    OtherPlant,
    /// Noise of the sensors.
    Sensors,
    /// Noise of the sensors in a calibration flight.
    Calibration,
    /// Which specimen of a pool is flown.
    Pool,
    /// Which windows teach.
    Windows,
    /// Noise of a reading that a fault changes.
    Reading,
    /// Points of a search.
    Search = 13,
    /// What differs between two tests of an actuator.
    Wear,
}

impl Seed {
    /// The seed of a number of what is drawn, such as the name of a suite.
    pub(crate) fn of(study_seed: u64, drawn: &str, number: u64) -> Seed {
        let mut hash = Fingerprint::default();
        hash.add("servotwin 1").add(&study_seed).add(drawn).add(&number);
        Seed(hash.value())
    }

    /// The random numbers of a stream.
    pub(crate) fn stream(self, stream: Stream) -> NormalDeviates {
        NormalDeviates::stream(self.0, stream as u64)
    }

    /// The same as a generator of whole numbers.
    pub(crate) fn choices(self, stream: Stream) -> Random {
        Random::stream(self.0, stream as u64)
    }
}

impl Study {
    /// The seed of a number of what is drawn, such as the name of a suite.
    pub(crate) fn seed_of(&self, drawn: &str, number: usize) -> Seed {
        Seed::of(self.seed, drawn, number as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn seeds_names_numbers_and_streams_share_no_random_number() {
        let mut first = BTreeSet::new();
        let mut count = 0;
        for seed in 0..10 {
            for drawn in ["judge", "judge/environment", "learn", "hold_out"] {
                for number in 0..100 {
                    for stream in [Stream::Command, Stream::Sensors, Stream::Search] {
                        first.insert(Seed::of(seed, drawn, number).choices(stream).next_u64());
                        count += 1;
                    }
                }
            }
        }
        assert_eq!(first.len(), count);
    }
}
