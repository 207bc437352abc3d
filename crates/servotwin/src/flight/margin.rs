//! How far a flight is from an error that a search looks for ([`worst_case`](super::worst_case)).
//!
//! | objective | margin without the error | with it |
//! |---|---|---|
//! | missed shutdown | share of the time after the onset that is left when the shutdown is raised; 1 for a fault that was not visible | largest evidence for the shutdown in parts of its limit, minus 1 |
//! | wrong shutdown | 1 minus the largest evidence e for a shutdown of a healthy actuator | the same, at most 0 |
//! | false alarm | 1 minus the largest evidence e for any action | the same, at most 0 |
//! | transient | minus the largest departure before the first action against the faulty actuator, SI | there is no limit, hence no error |
//!
//! Evidence stays at 0 while every window speaks for health, and a search could not follow it. There the margin is
//! 1 + ln p / ln p₀, with the largest probability p that the committee gave a counted action and p₀ = 1e-12, within 1
//! and 2.

use super::evidence::EvidencePeak;
use crate::measure::outcome::RunOutcome;
use crate::study::Study;
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::diagnoser::{Diagnoser, Raised, Session};
use servotwin_model::math::ln;

/// p₀: less probable actions are all alike.
const MIN_PROBABILITY: f64 = 1e-12;

/// What a search looks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SearchObjective {
    /// A visible fault that needs a shutdown, and none comes.
    MissedShutdown,
    /// The shutdown of a healthy actuator beside a faulty one; of the only actuator in a flight without a fault.
    WrongShutdown,
    /// An action in a flight without a fault.
    FalseAlarm,
    /// The largest departure of the controlled quantity from the healthy twin, before the first action against the faulty
    /// actuator.
    Transient,
}

impl SearchObjective {
    /// All, in the order of reports: healthy actuators first.
    pub const ALL: [SearchObjective; 4] = [
        SearchObjective::WrongShutdown,
        SearchObjective::MissedShutdown,
        SearchObjective::FalseAlarm,
        SearchObjective::Transient,
    ];

    /// The name in files and options.
    pub fn name(self) -> &'static str {
        match self {
            SearchObjective::MissedShutdown => "missed_shutdown",
            SearchObjective::WrongShutdown => "wrong_shutdown",
            SearchObjective::FalseAlarm => "false_alarm",
            SearchObjective::Transient => "transient",
        }
    }

    /// Whether flights of a study have a fault.
    pub(super) fn has_fault(self, study: &Study) -> bool {
        match self {
            SearchObjective::MissedShutdown | SearchObjective::Transient => true,
            SearchObjective::WrongShutdown => study.actuators.len() > 1,
            SearchObjective::FalseAlarm => false,
        }
    }

    /// Whether the error occurred in a flight.
    pub fn is_error(self, row: &RunOutcome) -> bool {
        match self {
            SearchObjective::MissedShutdown => row.visible_s.is_some() && !row.shutdown_at_fault,
            SearchObjective::WrongShutdown => row.shuts_down_healthy(),
            SearchObjective::FalseAlarm => row.early_alarms > 0,
            SearchObjective::Transient => false,
        }
    }

    /// The order from the worst flight to the best; those that could not be simulated come last.
    pub fn rank(self, row: &RunOutcome) -> (bool, f64) {
        (!self.is_error(row), row.margin.unwrap_or(f64::INFINITY))
    }
}

/// What a margin needs of a flight.
pub(super) struct MarginWatch {
    objective: SearchObjective,
    /// The index of the faulty actuator.
    faulty: Option<usize>,
    /// The first sample since the onset; 0 for a flight without a fault.
    since: u64,
    /// The evidence since then for the actions that the objective counts.
    peak: EvidencePeak,
    /// The largest departure of the tracked variable so far.
    departure: f64,
}

impl MarginWatch {
    /// For a flight with a fault in an actuator from the sample `onset` on, or without a fault.
    pub(super) fn new(
        objective: SearchObjective,
        diagnoser: &Diagnoser,
        (faulty, onset): (Option<usize>, u64),
    ) -> Self {
        let switches_off = diagnoser.tuning.switches_off(diagnoser.names());
        let is_counted = |actuator: usize, action: usize| match objective {
            SearchObjective::MissedShutdown => Some(actuator) == faulty && switches_off[action],
            SearchObjective::WrongShutdown => Some(actuator) != faulty && switches_off[action],
            SearchObjective::FalseAlarm => true,
            SearchObjective::Transient => Some(actuator) == faulty,
        };
        let peak = EvidencePeak::new(diagnoser, is_counted);
        let since = if faulty.is_some() { onset } else { 0 };
        MarginWatch { objective, faulty, since, peak, departure: 0.0 }
    }

    /// Takes a session behind a sample.
    pub(super) fn take(&mut self, index: u64, session: &Session) {
        if index >= self.since {
            self.peak.take(session);
        }
    }

    /// Takes the tracked variables of plant and twin, and the actions raised before.
    pub(super) fn track(&mut self, index: u64, raised: &[Raised], plant: &[f64], twin: &[f64]) {
        let is_against_faulty = |own: &Raised| Some(own.actuator as usize) == self.faulty;
        if index < self.since || self.since_onset(raised).any(is_against_faulty) {
            return;
        }
        let departures = plant.iter().zip(twin).map(|(plant, twin)| (plant - twin).abs());
        self.departure = departures.fold(self.departure, f64::max);
    }

    fn since_onset<'r>(&self, raised: &'r [Raised]) -> impl Iterator<Item = &'r Raised> {
        let since = self.since;
        raised.iter().filter(move |own| own.sample >= since)
    }

    /// The margin of a finished flight in which these actions were raised.
    pub(super) fn margin(&self, row: &RunOutcome, raised: &[Raised], period_s: f64) -> f64 {
        let is_counted = |own: &&Raised| {
            self.peak.claims.contains(&(own.actuator as usize, own.action as usize))
        };
        let evidence = self.peak.largest;
        match (self.objective, self.since_onset(raised).find(is_counted)) {
            (SearchObjective::MissedShutdown, Some(raised)) => {
                let left_s = row.duration_s - raised.sample as f64 * period_s;
                left_s / (row.duration_s - row.onset_s.unwrap_or(0.0))
            }
            (SearchObjective::MissedShutdown, None) if row.visible_s.is_none() => 1.0,
            (SearchObjective::MissedShutdown, None) => (evidence - 1.0).min(0.0),
            (SearchObjective::Transient, _) => -self.departure,
            (_, None) if evidence == 0.0 => 1.0 + improbability(self.peak.probability),
            // Trees and committee must agree, too, so enough evidence alone is no error.
            (_, None) => (1.0 - evidence).max(0.0),
            (_, Some(_)) => (1.0 - evidence).min(0.0),
        }
    }
}

/// ln p / ln p₀, from 0 for a certain action to 1.
fn improbability(probability: f64) -> f64 {
    ln(probability.clamp(MIN_PROBABILITY, 1.0)) / ln(MIN_PROBABILITY)
}
