//! Which sensors have gone silent, so that the others go on being judged without them.

use serde::{Deserialize, Serialize};

/// Whether a sensor's values come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SensorHealth {
    is_lost: bool,
    /// Samples in a row that say otherwise.
    against: u64,
}

/// How long it takes to believe that a sensor is gone, and that it is there again, in samples.
#[derive(Debug, Clone, Copy)]
pub(super) struct Patience {
    pub until_lost: u64,
    pub until_back: u64,
}

impl SensorHealth {
    /// Takes notice of whether a sample had a usable value.
    pub fn notice(&mut self, is_there: bool, patience: Patience) {
        if is_there != self.is_lost {
            self.against = 0;
            return;
        }
        self.against += 1;
        let limit = if self.is_lost { patience.until_back } else { patience.until_lost };
        if self.against >= limit {
            *self = SensorHealth { is_lost: !self.is_lost, against: 0 };
        }
    }

    pub fn is_lost(self) -> bool {
        self.is_lost
    }

    /// Whether a stored one can have been written with this patience.
    pub fn fits(self, patience: Patience) -> bool {
        self.against < if self.is_lost { patience.until_back } else { patience.until_lost }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PATIENCE: Patience = Patience { until_lost: 3, until_back: 5 };

    fn after(samples: &[bool]) -> bool {
        let mut sensor_health = SensorHealth::default();
        samples.iter().for_each(|&is_there| sensor_health.notice(is_there, PATIENCE));
        sensor_health.is_lost()
    }

    #[test]
    fn a_sensor_is_lost_after_a_row_without_values_and_back_after_a_row_with() {
        assert!(!after(&[false; 2]));
        assert!(after(&[false; 3]));
        assert!(!after(&[false, false, true, false, false]));
        assert!(after(&[&[false; 3][..], &[true; 4]].concat()));
        assert!(!after(&[&[false; 3][..], &[true; 5]].concat()));
        assert!(after(&[&[false; 3][..], &[true; 4], &[false], &[true; 4]].concat()));
    }
}
