//! Healthy flights, each in an environment of its own: how often they raise an alarm, and how near they come to one.
//!
//! False alarms cluster. What raises one in an environment raises others there, so hours in one environment do not count
//! like hours in many. Here the environment is the unit: each is flown once, by a specimen of its own. A flight without an
//! alarm still has information, because the evidence for an action reaches some part of its limit
//! ([`Nearness`](super::judge::Nearness)).

use super::campaign::FlightCampaign;
use super::other_plant::{OTHER_PLANT, OtherPlants};
use super::outcome::FlightOutcome;
use super::plan::{Onset, PlannedFlight, Purpose};
use super::watched::{Truth, Watching, watch};
use crate::experiment::CampaignError;
use crate::parallel::Workers;
use crate::study::flights::Environment;
use crate::study::{Setting, Study};
use servotwin_diagnosis::diagnoser::Session;
use std::borrow::Cow;
use std::ops::Range;

/// The number of the first flight: beyond those of the evaluation, so that no specimen flies twice.
const FIRST_NUMBER: usize = 200_000;

/// The plants of healthy flights.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HealthyPlants {
    /// Those of a scenario, which differ from their twin as in training.
    Of(Setting),
    /// Those of `[flights.other_plant]`, beside the diagnoser of the scenario *realistic*.
    Other,
}

impl HealthyPlants {
    /// All of them.
    pub fn all() -> impl Iterator<Item = HealthyPlants> {
        Setting::ALL.into_iter().map(HealthyPlants::Of).chain([HealthyPlants::Other])
    }

    /// The name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            HealthyPlants::Of(setting) => setting.name(),
            HealthyPlants::Other => OTHER_PLANT,
        }
    }

    /// The scenario whose diagnoser flies, and whose tolerances the specimens have.
    pub fn setting(self) -> Setting {
        match self {
            HealthyPlants::Of(setting) => setting,
            HealthyPlants::Other => Setting::Realistic,
        }
    }
}

/// How the plants of healthy flights differ from their twins.
#[derive(Clone, Copy)]
pub enum Differences<'p> {
    /// By the tolerances and draws of the study, so many times as large as declared.
    Scattered(f64),
    /// In structure.
    Structure(&'p OtherPlants),
}

/// Flies each environment once without a fault, watched by a session. `environments` have the given numbers; the
/// specimens and the noise follow from these and the seed. Returns one outcome for each.
///
/// # Errors
/// A twin cannot be simulated, or the run was cancelled.
pub fn fly(
    study: &Study,
    (environments, numbers): (&[Environment], Range<usize>),
    (seed, duration_s): (u64, f64),
    (setting, differences): (Setting, Differences),
    session: &Session,
    workers: Workers,
) -> Result<Vec<FlightOutcome>, CampaignError> {
    let flight = |(environment, number): (usize, usize)| PlannedFlight {
        number: FIRST_NUMBER + number,
        environment,
        fault: None,
        intensity: 0.0,
        onset_s: f64::INFINITY,
        onset: Onset::Step,
        duration_s,
    };
    let plan: Vec<PlannedFlight> = numbers.enumerate().map(flight).collect();
    let environments = Cow::Borrowed(environments);
    let lot = (Purpose::Judge, seed);
    let flown = FlightCampaign::planned(study, environments, plan, lot, setting, workers)?;
    let flown = match differences {
        Differences::Scattered(scatter) => flown.with_scatter(scatter),
        Differences::Structure(plants) => flown.with_plants(plants),
    };
    let truth = |flight: &PlannedFlight| {
        let mut truth = Truth::planned(study, flight);
        truth.run.environment = (flight.number - FIRST_NUMBER) as u64;
        truth
    };
    let watching = [Watching { session: session.clone(), missing: None }];
    let outcomes = watch(&flown, &watching, &truth, &|_| None, |_, _| (), &|_, _| ());
    if workers.is_cancelled() { Err(CampaignError::Cancelled) } else { Ok(outcomes) }
}
