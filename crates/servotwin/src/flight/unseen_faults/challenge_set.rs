//! Counts of the flights of a challenge set: all unseen faults of one name.

use super::{Latency, Outcome, has_healthy_shutdown, latency};
use crate::flight::outcome::FirstAction;
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
pub(super) fn count(set: &str, outcomes: &[Outcome]) -> Option<ChallengeSetMetrics> {
    let is_of_set = |row: &&Outcome| row.kind == set;
    let (finished, failed): (Vec<&Outcome>, Vec<&Outcome>) =
        outcomes.iter().filter(is_of_set).partition(|row| row.is_finished);
    if finished.len() + failed.len() == 0 {
        return None;
    }
    let count =
        |holds: fn(&Outcome) -> bool| finished.iter().filter(|row| holds(row)).count() as u64;
    let times_s = finished.iter().filter_map(|row| row.right_action_s);
    Some(ChallengeSetMetrics {
        name: set.into(),
        flights: finished.len() as u64,
        failed: failed.len() as u64,
        right_action: count(Outcome::is_right),
        other_action: count(|row| row.first != FirstAction::None && !row.is_right()),
        missed_shutdowns: [
            count(|row| row.needs_shutdown),
            count(|row| row.needs_shutdown && !row.shutdown_at_fault),
        ],
        wrong_shutdowns: count(|row| has_healthy_shutdown(row) || row.shutdown_misinformed),
        false_alarms: count(|row| row.early_alarms > 0),
        latency: latency(times_s, finished.len() as u64),
    })
}
