//! How far a flight is from an error.
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

use super::{SearchObjective, SearchOutcome};
use crate::flight::evidence::EvidencePeak;
use crate::flight::watched::{OutOfBands, RaisedLog};
use crate::run::{Observer, Run};
use crate::study::Study;
use servotwin_diagnosis::diagnoser::{Raised, Session};
use servotwin_model::math::ln;

/// p₀: less probable actions are all alike.
const MIN_PROBABILITY: f64 = 1e-12;

/// What a flight is watched for.
pub(super) struct Target {
    objective: SearchObjective,
    /// The name of the faulty actuator; `None` without a fault.
    faulty: Option<String>,
    /// The onset of the fault, or the beginning of a flight without one, s.
    since_s: f64,
    duration_s: f64,
}

impl Target {
    pub(crate) fn new(objective: SearchObjective, study: &Study, flight: &Run) -> Self {
        Target {
            objective,
            faulty: flight.fault.map(|fault| study.units[study.faults[fault].unit].clone()),
            since_s: if flight.fault.is_some() { flight.onset_s } else { 0.0 },
            duration_s: flight.duration_s,
        }
    }
}

/// A session with what a margin needs.
pub(super) struct MarginWatch {
    session: Session,
    target: Target,
    period_s: f64,
    /// The first sample since the onset.
    since: u64,
    /// The index of the faulty actuator in the diagnoser.
    faulty: Option<u32>,
    log: RaisedLog,
    /// The evidence since the onset for the actions of the objective.
    peak: EvidencePeak,
    out_of_bands: OutOfBands,
    /// The largest departure of the tracked variable so far.
    departure: f64,
}

impl MarginWatch {
    pub(crate) fn new(session: Session, target: Target, period_s: f64) -> Self {
        let diagnoser = session.diagnoser().clone();
        let names = diagnoser.names();
        let switches_off = diagnoser.tuning.switches_off(names);
        let place = |name: &String| names.actuators.iter().position(|known| known == name);
        let faulty = target.faulty.as_ref().and_then(place);
        let since = (target.since_s / period_s).ceil() as u64;
        let is_counted = |actuator: usize, action: usize| match target.objective {
            SearchObjective::MissedShutdown => Some(actuator) == faulty && switches_off[action],
            SearchObjective::WrongShutdown => Some(actuator) != faulty && switches_off[action],
            SearchObjective::FalseAlarm => true,
            SearchObjective::Transient => Some(actuator) == faulty,
        };
        MarginWatch {
            peak: EvidencePeak::new(&diagnoser, is_counted),
            out_of_bands: OutOfBands::new(diagnoser.lengths.len(), since),
            faulty: faulty.map(|faulty| faulty as u32),
            log: RaisedLog::default(),
            departure: 0.0,
            session,
            target,
            period_s,
            since,
        }
    }

    fn since_onset(&self) -> impl Iterator<Item = &Raised> {
        self.log.raised.iter().filter(|raised| raised.sample >= self.since)
    }

    /// The first raised action that the objective counts.
    fn counted(&self) -> Option<&Raised> {
        let is_counted = |raised: &&Raised| {
            self.peak.claims.contains(&(raised.actuator as usize, raised.action as usize))
        };
        self.since_onset().find(is_counted)
    }

    pub(crate) fn into_outcome(self) -> SearchOutcome {
        let is_visible = self.faulty.is_some() && self.out_of_bands.seen.is_some();
        let counted = self.counted();
        let evidence = self.peak.largest();
        let (margin, is_error) = match (self.target.objective, counted) {
            (SearchObjective::MissedShutdown, Some(raised)) => {
                let left_s = self.target.duration_s - raised.sample as f64 * self.period_s;
                (left_s / (self.target.duration_s - self.target.since_s), false)
            }
            (SearchObjective::MissedShutdown, None) if !is_visible => (1.0, false),
            (SearchObjective::MissedShutdown, None) => ((evidence - 1.0).min(0.0), true),
            (SearchObjective::Transient, _) => (-self.departure, false),
            (_, None) if evidence == 0.0 => (1.0 + improbability(self.peak.probability), false),
            // Trees and committee must agree, too, so enough evidence alone is no error.
            (_, None) => ((1.0 - evidence).max(0.0), false),
            (_, Some(_)) => ((1.0 - evidence).min(0.0), true),
        };
        let diagnoser = self.session.diagnoser();
        let names = diagnoser.names();
        let switches_off = diagnoser.tuning.switches_off(names);
        let is_wrong = |raised: &&Raised| {
            switches_off[raised.action as usize] && Some(raised.actuator) != self.faulty
        };
        let wrong = self.since_onset().find(is_wrong);
        let action = self.since_onset().next().map(|raised| {
            let (actuator, action) = (raised.actuator as usize, raised.action as usize);
            let name = format!("{} {}", names.actuators[actuator], names.actions[action]);
            (name.trim().to_owned(), raised.sample as f64 * self.period_s)
        });
        let (action, action_s) = action.unwrap_or((String::new(), f64::NAN));
        let wrong_shutdown = wrong.map(|raised| names.actuators[raised.actuator as usize].clone());
        SearchOutcome { margin, is_error, is_visible, action, action_s, wrong_shutdown }
    }
}

/// ln p / ln p₀, from 0 for a certain action to 1.
fn improbability(probability: f64) -> f64 {
    ln(probability.clamp(MIN_PROBABILITY, 1.0)) / ln(MIN_PROBABILITY)
}

impl Observer for MarginWatch {
    fn sample(&mut self, index: usize, measured: &[f64], twin: &[f64], inputs: &[f64]) {
        self.log.take(self.session.push(inputs, measured, twin));
        self.out_of_bands.look(index as u64, &self.session);
        if index as u64 >= self.since {
            self.peak.take(&self.session);
        }
    }

    fn track(&mut self, index: usize, plant: &[f64], twin: &[f64]) {
        let is_faulty = |raised: &Raised| Some(raised.actuator) == self.faulty;
        if (index as u64) < self.since || self.since_onset().any(is_faulty) {
            return;
        }
        let departures = plant.iter().zip(twin).map(|(plant, twin)| (plant - twin).abs());
        self.departure = departures.fold(self.departure, f64::max);
    }
}
