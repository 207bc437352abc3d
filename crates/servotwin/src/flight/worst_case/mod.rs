//! A search for the flights in which the diagnosis is closest to an error.
//!
//! A flight is a point: command, load, air speed, pressures, temperatures, tolerances, fault and onset ([`space`]). Its
//! *margin* is continuous, so a search can follow it long before an error occurs (`margin`). The search is a
//! cross-entropy method ([`cross_entropy`]); random points come from the distributions of the study.
//!
//! All points of a generation fly at once in lanes, each in an environment and with a specimen of its own beside the twin
//! of this environment. A point has the same bits alone and among others.

pub mod cross_entropy;
pub(crate) mod margin;
pub mod space;

use super::tracking::TrackedQuantities;
use crate::parallel::Workers;
use crate::run::runner::{Chosen, Runner};
use crate::run::{CampaignError, Profile, Run};
use crate::study::suites::JUDGE;
use crate::study::{Scenario, Study, StudyError, Suite};
use margin::{MarginWatch, Target};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::diagnoser::Session;
use space::{SearchPoint, SearchSpace};

/// The largest number of a point.
pub const MAX_POINTS: usize = 200_000;

/// The intensity of every fault: a missed weak fault is no finding.
pub const INTENSITY: f64 = 1.0;

/// What a search looks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
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
            SearchObjective::MissedShutdown => "missed-shutdown",
            SearchObjective::WrongShutdown => "wrong-shutdown",
            SearchObjective::FalseAlarm => "false-alarm",
            SearchObjective::Transient => "transient",
        }
    }

    /// Whether flights of a study have a fault.
    pub(super) fn has_fault(self, study: &Study) -> bool {
        match self {
            SearchObjective::MissedShutdown | SearchObjective::Transient => true,
            SearchObjective::WrongShutdown => study.units.len() > 1,
            SearchObjective::FalseAlarm => false,
        }
    }
}

/// What a flight gave.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchOutcome {
    /// The distance to the error, in parts of a limit or of the time after the onset; at most 0 for an error. The negative
    /// departure for [`SearchObjective::Transient`], SI. NaN if the flight could not be simulated to the end.
    pub margin: f64,
    /// Whether the error occurred.
    pub is_error: bool,
    /// Whether the fault was visible.
    pub is_visible: bool,
    /// The first action since the onset, with its actuator; empty without one.
    pub action: String,
    /// When it was raised, s; NaN without one.
    pub action_s: f64,
    /// The healthy actuator that was shut down, whatever the objective; `None` if none was.
    pub wrong_shutdown: Option<String>,
}

impl SearchOutcome {
    /// A flight that could not be simulated to the end.
    fn failed() -> Self {
        SearchOutcome {
            margin: f64::NAN,
            is_error: false,
            is_visible: false,
            action: String::new(),
            action_s: f64::NAN,
            wrong_shutdown: None,
        }
    }

    /// The order from the worst flight to the best; those that could not be simulated come last.
    pub fn rank(&self) -> (bool, f64) {
        let margin = if self.margin.is_nan() { f64::INFINITY } else { self.margin };
        (!self.is_error, margin)
    }
}

/// Why a point cannot be flown.
#[derive(Debug, thiserror::Error)]
pub enum SearchError {
    /// The study has no flights to search in.
    #[error("the study has no [flights]: docs/study-format.md describes this section")]
    NoFlights,
    /// No fault of the study is of use to an objective.
    #[error(
        "the study has no fault that {0} can search: it needs a class whose action switches off"
    )]
    NoFault(&'static str),
    /// A command of a point cannot be flown.
    #[error(transparent)]
    Study(#[from] Box<StudyError>),
    /// A twin cannot be simulated, or the run was cancelled.
    #[error(transparent)]
    Campaign(#[from] CampaignError),
}

/// Flights of one study beside one diagnoser.
pub struct PointFlyer<'s> {
    /// The study.
    pub study: &'s Study,
    /// The scenario: with tolerances or without.
    pub scenario: Scenario,
    /// The seed of commands, noise and draws, 0 to 999.
    pub seed: u64,
    /// The diagnosis before a flight.
    pub session: Session,
    /// The threads.
    pub workers: Workers<'s>,
}

impl PointFlyer<'_> {
    /// Flies points of a space; one outcome for each, in order.
    ///
    /// # Errors
    /// A command cannot be flown, a twin cannot be simulated, or the run was cancelled.
    pub fn fly(
        &self,
        space: &SearchSpace,
        points: &[SearchPoint],
    ) -> Result<Vec<SearchOutcome>, SearchError> {
        let chosen: Vec<_> = points.iter().map(|point| space.chosen(self.seed, point)).collect();
        let environments = self.study.chosen_environments(&chosen).map_err(Box::new)?;
        let environments = environments.ok_or(SearchError::NoFlights)?;
        let suite = search_suite(self.study, self.seed).ok_or(SearchError::NoFlights)?;
        let runs: Vec<Run> =
            points.iter().enumerate().map(|(place, point)| run(space, place, point)).collect();
        let quantities = TrackedQuantities::of(self.study);
        let chosen = Chosen {
            deviations: points.iter().map(|point| space.deviations(point).to_vec()).collect(),
            tracked: quantities.following_slot().into_iter().collect(),
        };
        let planned = (environments, runs);
        let flown =
            Runner::chosen(self.study, &suite, self.scenario, planned, chosen, self.workers)?;
        let target = |run: &Run| Target::new(space.objective, self.study, run);
        let mut outcomes = vec![SearchOutcome::failed(); points.len()];
        flown.fly(
            |run| MarginWatch::new(self.session.clone(), target(run), flown.period_s()),
            |run, watch, outcome| {
                if outcome.is_ok() {
                    outcomes[run.environment] = watch.into_outcome();
                }
            },
        );
        if self.workers.is_cancelled() {
            return Err(CampaignError::Cancelled.into());
        }
        Ok(outcomes)
    }
}

/// The suite whose random numbers the points have.
pub(super) fn search_suite(study: &Study, seed: u64) -> Option<Suite> {
    let mut suite = study.suite(JUDGE, false)?.clone().with_seed(seed);
    suite.draws = "worst_case".into();
    suite.healthy = 0;
    Some(suite)
}

/// The run of a point, in the environment of its own place.
fn run(space: &SearchSpace, place: usize, point: &SearchPoint) -> Run {
    let fault = space.fault(point);
    Run {
        number: point.number,
        environment: place,
        fault,
        intensity: if fault.is_some() { INTENSITY } else { 0.0 },
        onset_s: if fault.is_some() { space.onset_s(point) } else { f64::INFINITY },
        profile: Profile::Step,
        duration_s: space.ranges.duration_s,
    }
}
