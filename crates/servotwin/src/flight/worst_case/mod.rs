//! A search for the flights in which the diagnosis is closest to an error.
//!
//! A flight is a point: command, load, air speed, pressures, temperatures, tolerances, fault and onset ([`space`]). Its
//! [`margin`](super::margin) is continuous, so a search can follow it long before an error occurs. The search is a
//! cross-entropy method (`cross_entropy`); random points come from the distributions of the study.
//!
//! All points of a generation fly at once in lanes, each in an environment and with a specimen of its own beside the twin
//! of this environment. A point has the same bits alone and among others. Its outcome is a row like that of any flight.

pub(crate) mod cross_entropy;
pub mod space;

use super::watched::{Flown, Truth, Watching, watch};
use crate::live::tracking::TrackedQuantities;
use crate::measure::outcome::RunOutcome;
use crate::parallel::Workers;
use crate::run::runner::{Chosen, Runner};
use crate::run::{Profile, Run, RunError};
use crate::study::suites::JUDGE;
use crate::study::{Scenario, Study, Suite};
use servotwin_diagnosis::diagnoser::Session;
use space::{SearchPoint, SearchSpace};

/// The intensity of every fault: a missed weak fault is no finding.
pub const INTENSITY: f64 = 1.0;

/// The suite of the points of a space. `seed` is that of commands, noise and draws.
pub(crate) fn suite(study: &Study, space: &SearchSpace, seed: u64) -> Option<Suite> {
    let mut suite = study.suite(JUDGE)?.clone().with_seed(seed);
    suite.name = space.suite();
    suite.draws = "worst_case".into();
    suite.healthy = 0;
    Some(suite)
}

/// Flies numbered points of a space. Returns one outcome for each.
///
/// # Errors
/// A command cannot be flown, a twin cannot be simulated, or the run was cancelled.
pub(crate) fn fly(
    space: &SearchSpace,
    (study, suite, scenario): (&Study, &Suite, Scenario),
    session: &Session,
    points: &[(u64, SearchPoint)],
    workers: Workers,
) -> Result<Vec<RunOutcome>, RunError> {
    let chosen: Vec<_> = points.iter().map(|(_, point)| space.chosen(suite.seed, point)).collect();
    let environments = study.chosen_environments(&chosen)?.unwrap_or_default();
    let places = points.iter().enumerate();
    let runs = places.map(|(place, (_, point))| run(space, place, point)).collect();
    let chosen = Chosen {
        deviations: points.iter().map(|(_, point)| space.deviations(point).to_vec()).collect(),
        tracked: TrackedQuantities::of(study).following_slot().into_iter().collect(),
    };
    let flown = Runner::chosen(study, suite, scenario, (environments, runs), chosen, workers)?;
    let truth = |run: &Run| {
        let (number, ref point) = points[run.environment];
        let planned = Truth::planned(study, run);
        let point = space.text_of(point);
        let run = RunOutcome { number, environment: number, point, ..planned.run };
        Truth { run, objective: Some(space.objective), ..planned }
    };
    let watching = [Watching { session: session.clone(), missing: None }];
    let mut outcomes = vec![];
    let mut ended = |_, flown: Flown| outcomes.extend(flown.outcomes);
    watch(&flown, &watching, &truth, &|_| None, |_, _| (), &mut ended);
    outcomes.sort_by_key(|outcome| outcome.number);
    if workers.is_cancelled() { Err(RunError::Cancelled) } else { Ok(outcomes) }
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
