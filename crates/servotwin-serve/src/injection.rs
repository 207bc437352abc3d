//! Faults as they are injected by hand.

use serde::{Deserialize, Serialize};
use servotwin_model::program::FaultAt;

/// How long a ramp takes to its intensity, s.
pub(crate) const RAMP_S: f64 = 5.0;
/// Half of the period of an intermittent fault, s.
pub(crate) const HALF_PERIOD_S: f64 = 1.0;
/// A ramp rises in steps of this intensity: every step loads parameters anew.
const STEP: f64 = 0.01;

/// How a fault begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum InjectedOnset {
    /// At once, and it stays.
    Step,
    /// It rises to its intensity within [`RAMP_S`].
    Ramp,
    /// It comes and goes every [`HALF_PERIOD_S`].
    Intermittent,
}

/// An injected fault.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Injection {
    /// The fault's name, e.g. `actuator_1.leakage_a.leakage`.
    pub(crate) name: String,
    /// The fault at its full intensity, 0 to 1.
    pub(crate) fault: FaultAt,
    /// How it begins.
    pub(crate) onset: InjectedOnset,
    /// When it was injected, s.
    pub(crate) since_s: f64,
}

impl Injection {
    /// The fault as it is at a time, s.
    pub(crate) fn at(&self, time_s: f64) -> FaultAt {
        let age_s = (time_s - self.since_s).max(0.0);
        let share = match self.onset {
            InjectedOnset::Step => 1.0,
            InjectedOnset::Ramp => ((age_s / RAMP_S).min(1.0) / STEP).floor() * STEP,
            InjectedOnset::Intermittent => {
                f64::from(u8::from(((age_s / HALF_PERIOD_S) as u64).is_multiple_of(2)))
            }
        };
        FaultAt { intensity: self.fault.intensity * share, ..self.fault }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn intensity(onset: InjectedOnset, age_s: f64) -> f64 {
        let fault = FaultAt { component: 0, fault: 0, intensity: 0.5 };
        Injection { name: String::new(), fault, onset, since_s: 10.0 }.at(10.0 + age_s).intensity
    }

    #[test]
    fn a_step_is_there_at_once_and_stays() {
        assert_eq!([0.0, 1e3].map(|age| intensity(InjectedOnset::Step, age)), [0.5, 0.5]);
    }

    #[test]
    fn a_ramp_rises_to_its_intensity_and_stays_there() {
        let [begin, middle, end, later] =
            [0.0, 0.5, 1.0, 3.0].map(|share| intensity(InjectedOnset::Ramp, share * RAMP_S));
        assert_eq!([begin, end, later], [0.0, 0.5, 0.5]);
        assert!((middle - 0.25).abs() < 0.01, "{middle}");
    }

    #[test]
    fn an_intermittent_fault_comes_and_goes() {
        let seen = [0.5, 1.5, 2.5]
            .map(|half| intensity(InjectedOnset::Intermittent, half * HALF_PERIOD_S));
        assert_eq!(seen, [0.5, 0.0, 0.5]);
    }
}
