//! Healthy flights, each in an environment of its own: how often they raise an alarm, and how near they come to one.
//!
//! False alarms cluster. What raises one in an environment raises others there, so hours in one environment do not count
//! like hours in many. Here the environment is the unit: each is flown once, by a specimen of its own. A flight without an
//! alarm still has information, because the evidence for an action reaches some part of its limit. These largest values
//! are block maxima, and their tail gives a rate of false alarms where counting gives only a bound.

use super::campaign::{FlightCampaign, Observer};
use super::evidence::EvidencePeak;
use super::judge::{EnvironmentMetrics, RaisedLog};
use super::other_plant::{OTHER_PLANT, OtherPlants};
use super::plan::{Onset, PlannedFlight, Purpose};
use crate::experiment::CampaignError;
use crate::parallel::Workers;
use crate::study::flights::Environment;
use crate::study::{Setting, Study};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::diagnoser::{Raised, Session};
use servotwin_learning::metrics::Tail;
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

/// What a healthy flight gave.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HealthyFlight {
    /// The number of its environment.
    pub environment: u64,
    /// Number of actions raised.
    pub alarms: u64,
    /// Number of shutdowns raised.
    pub shutdowns: u64,
    /// The largest evidence for any action, in parts of its limit.
    pub evidence: f64,
    /// The largest evidence for a shutdown, in parts of its limit.
    pub shutdown_evidence: f64,
    /// The same for each length of windows.
    pub shutdown_evidence_by_length: Vec<f64>,
}

/// What many healthy flights gave, counted by environment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HealthySummary {
    /// Duration of all flights, h.
    pub hours: f64,
    /// Environments with an alarm.
    pub alarms: EnvironmentMetrics,
    /// Environments with a shutdown.
    pub shutdowns: EnvironmentMetrics,
    /// The largest evidence for any action in any flight, in parts of its limit.
    pub largest_evidence: f64,
    /// The largest evidence for a shutdown in any flight, in parts of its limit.
    pub largest_shutdown_evidence: f64,
    /// The tail of the largest evidence for any action, extrapolated to the limit; `None` for too few flights.
    pub tail: Option<Tail>,
    /// The same for shutdowns.
    pub shutdown_tail: Option<Tail>,
}

impl HealthySummary {
    /// Counts flights of `duration_s` seconds.
    pub fn new(flights: &[HealthyFlight], duration_s: f64) -> Self {
        let environments = |count: fn(&HealthyFlight) -> u64| {
            EnvironmentMetrics::new(flights.iter().map(|flight| count(flight) > 0))
        };
        let maxima = |evidence: fn(&HealthyFlight) -> f64| -> Vec<f64> {
            flights.iter().map(evidence).collect()
        };
        let largest = |maxima: &[f64]| maxima.iter().copied().fold(0.0, f64::max);
        let of_any = maxima(|flight| flight.evidence);
        let of_shutdown = maxima(|flight| flight.shutdown_evidence);
        HealthySummary {
            hours: flights.len() as f64 * duration_s / 3600.0,
            alarms: environments(|flight| flight.alarms),
            shutdowns: environments(|flight| flight.shutdowns),
            largest_evidence: largest(&of_any),
            largest_shutdown_evidence: largest(&of_shutdown),
            tail: Tail::fit(&of_any, 1.0),
            shutdown_tail: Tail::fit(&of_shutdown, 1.0),
        }
    }
}

/// Flies each environment once without a fault, observed by a session. `environments` have the given numbers; the
/// specimens and the noise follow from these and the seed. Returns the finished flights in order, and how many failed.
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
) -> Result<(Vec<HealthyFlight>, u64), CampaignError> {
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
    let (mut finished, mut failed) = (vec![], 0);
    flown.fly(
        &flown.which,
        |_| EvidenceWatch::new(session.clone()),
        |flight, watch, outcome| match outcome {
            Ok(_) => finished.push(watch.into_flight(flight.number - FIRST_NUMBER)),
            Err(_) => failed += 1,
        },
    );
    if workers.is_cancelled() {
        return Err(CampaignError::Cancelled);
    }
    finished.sort_by_key(|flight| flight.environment);
    Ok((finished, failed))
}

/// A session with the largest evidence that it gathered.
struct EvidenceWatch {
    session: Session,
    /// Every action, at the time it was raised.
    log: RaisedLog,
    /// For each action, whether it switches off.
    switches_off: Vec<bool>,
    of_any: EvidencePeak,
    of_shutdown: EvidencePeak,
}

impl EvidenceWatch {
    fn new(session: Session) -> Self {
        let diagnoser = session.diagnoser();
        let switches_off = diagnoser.tuning.switches_off(diagnoser.names());
        EvidenceWatch {
            of_any: EvidencePeak::new(diagnoser, |_, _| true),
            of_shutdown: EvidencePeak::new(diagnoser, |_, action| switches_off[action]),
            switches_off,
            session,
            log: RaisedLog::default(),
        }
    }

    fn into_flight(self, environment: usize) -> HealthyFlight {
        let is_off = |raised: &&Raised| self.switches_off[raised.action as usize];
        HealthyFlight {
            environment: environment as u64,
            alarms: self.log.raised.len() as u64,
            shutdowns: self.log.raised.iter().filter(is_off).count() as u64,
            evidence: self.of_any.largest(),
            shutdown_evidence: self.of_shutdown.largest(),
            shutdown_evidence_by_length: self.of_shutdown.by_length,
        }
    }
}

impl Observer for EvidenceWatch {
    fn sample(&mut self, _index: usize, measured: &[f64], twin: &[f64], inputs: &[f64]) {
        self.log.take(self.session.push(inputs, measured, twin));
        self.of_any.take(&self.session);
        self.of_shutdown.take(&self.session);
    }
}
