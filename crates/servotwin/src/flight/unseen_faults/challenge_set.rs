//! Counts of the flights of a challenge set: all unseen faults of one name.

use super::{ALL, Ended, Latency, Sensible, latency};
use serde::{Deserialize, Serialize};

/// What the diagnosis did in the flights of a challenge set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChallengeSetMetrics {
    /// The name of the set.
    pub name: String,
    /// Number of completed flights.
    pub flights: u64,
    /// Number of failed flights.
    pub failed: u64,
    /// Flights in which a sensible action against an actuator at fault was the first after the onset. Where no action
    /// is sensible, those without any.
    pub right_action: u64,
    /// Flights in which another action was the first after the onset, against whatever actuator.
    pub other_action: u64,
    /// Flights that need a shutdown, and those of them without a shutdown of an actuator at fault.
    pub missed_shutdowns: [u64; 2],
    /// Flights in which a healthy actuator was shut down at any time, whether its boundary sensors were right or wrong.
    pub wrong_shutdowns: u64,
    /// Flights with an action before the onset.
    pub false_alarms: u64,
    /// From the onset to the first sensible action.
    pub latency: Option<Latency>,
}

impl ChallengeSetMetrics {
    /// Flights without an action after the onset that need one.
    pub fn without_action(&self) -> u64 {
        self.flights - self.right_action - self.other_action
    }
}

/// Counts the flights of a set; `None` if it has none.
pub(super) fn count(set: &str, ended: &[Ended], period_s: f64) -> Option<ChallengeSetMetrics> {
    let is_of_set = |ended: &&Ended| ALL[ended.case.foreign].set == set;
    let (finished, failed): (Vec<&Ended>, Vec<&Ended>) =
        ended.iter().filter(is_of_set).partition(|ended| ended.is_ok);
    if finished.len() + failed.len() == 0 {
        return None;
    }
    let count = |holds: &dyn Fn(&Ended) -> bool| {
        finished.iter().filter(|ended| holds(ended)).count() as u64
    };
    let needs_shutdown = |ended: &Ended| ended.heard.sensible == Sensible::Shutdown;
    let is_right = |ended: &Ended| match ended.heard.first {
        Some((unit, action)) => ended.heard.is_sensible(unit, action),
        None => ended.heard.sensible == Sensible::Nothing,
    };
    let times_s = finished
        .iter()
        .filter_map(|ended| Some(ended.since_onset_s(ended.heard.right_action?, period_s)));
    Some(ChallengeSetMetrics {
        name: set.into(),
        flights: finished.len() as u64,
        failed: failed.len() as u64,
        right_action: count(&is_right),
        other_action: count(&|ended| ended.heard.first.is_some() && !is_right(ended)),
        missed_shutdowns: [
            count(&needs_shutdown),
            count(&|ended| needs_shutdown(ended) && !ended.heard.off_at_fault),
        ],
        wrong_shutdowns: count(&|ended| ended.heard.off_healthy || ended.heard.off_misinformed),
        false_alarms: count(&|ended| ended.heard.false_alarm),
        latency: latency(times_s, finished.len() as u64),
    })
}
