//! Health of sensors: the diagnosis continues without a sensor that has no usable values.

use serde::{Deserialize, Serialize};

/// Whether a sensor delivers values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SensorHealth {
    is_lost: bool,
    /// Consecutive samples that contradict `is_lost`.
    against: u64,
}

/// Number of consecutive samples after which a sensor counts as lost, and as back.
#[derive(Debug, Clone, Copy)]
pub(super) struct Patience {
    pub until_lost: u64,
    pub until_back: u64,
}

impl SensorHealth {
    /// Counts a sample with or without a usable value.
    pub(crate) fn notice(&mut self, is_there: bool, patience: Patience) {
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

    pub(crate) fn is_lost(self) -> bool {
        self.is_lost
    }

    /// Whether a stored state is possible with this patience.
    pub(crate) fn fits(self, patience: Patience) -> bool {
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
