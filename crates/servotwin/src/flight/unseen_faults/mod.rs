//! Tests the diagnosis with faults that it was never trained on.
//!
//! The right name cannot be expected for an unknown fault. The requirement is that the healthy actuator stays on, and
//! that the output is sensible: the right actuator, an unknown fault, or a wrong input of the twin.

mod challenge_set;
mod effect;
mod list;

pub use challenge_set::ChallengeSetMetrics;
pub use list::{ALL, Foreign, Sensible, set_names};

use super::campaign::{FlightCampaign, Observer};
use super::judge::{Latency, latency};
use super::plan::{Onset, PlannedFlight, Purpose};
use crate::experiment::CampaignError;
use crate::parallel::Workers;
use crate::study::flights::Environment;
use crate::study::{Flights, Setting, Study};
use effect::{Changes, Touched};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::diagnoser::{Alarm, Diagnoser, IndexedFinding, Outcome, Session};
use std::borrow::Cow;
use std::sync::Arc;

/// The first number of these flights, so that specimens and noise differ from other flights.
const FIRST: usize = 500_000;

/// Number of flights by output; every flight counts once, by its most specific output.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Words {
    /// A sensible action against a faulty actuator was raised first.
    pub sensible: u64,
    /// Another action against a faulty actuator was raised first.
    pub other_command: u64,
    /// An action against a healthy actuator was raised first.
    pub wrong_actuator: u64,
    /// No command was raised, but the actuator at fault was named.
    pub actuator: u64,
    /// None of the above, but the fault was reported as unknown.
    pub unknown: u64,
    /// None of the above, but an input was reported as invalid.
    pub environment_invalid: u64,
    /// None of the above, but readings were reported as missing.
    pub no_data: u64,
    /// Only a detection was reported, or a healthy actuator was named without a command.
    pub detected: u64,
    /// Nothing was reported.
    pub healthy: u64,
}

impl Words {
    /// Each count with its name, the best result first.
    pub fn named(&self) -> [(&'static str, u64); 9] {
        [
            ("sensible command", self.sensible),
            ("other command", self.other_command),
            ("actuator", self.actuator),
            ("unknown", self.unknown),
            ("input invalid", self.environment_invalid),
            ("no data", self.no_data),
            ("detected", self.detected),
            ("healthy", self.healthy),
            ("wrong actuator", self.wrong_actuator),
        ]
    }
}

/// The outcome of an unseen fault.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UnseenFaultOutcome {
    /// The fault's title.
    pub title: String,
    /// Its strengths in words.
    pub strengths: String,
    /// The command that counts as sensible.
    pub sensible: Sensible,
    /// Number of completed flights.
    pub flights: u64,
    /// Number of failed flights.
    pub failed: u64,
    /// The outputs of the diagnosis.
    pub words: Words,
    /// Number of shutdowns of an actuator at fault.
    pub shutdowns_at_fault: u64,
    /// Number of shutdowns of a healthy actuator whose boundary sensors are right.
    pub shutdowns_healthy: u64,
    /// Flights in which a healthy actuator was shut down because a boundary sensor (a supply or return pressure that
    /// its twin reads) was wrong. `None` if no such sensor was wrong.
    pub shutdowns_behind_wrong_sensor: Option<u64>,
    /// From the onset to the first output of any kind.
    pub first_word: Option<Latency>,
    /// Flights in which a shutdown of a healthy actuator was raised, whether its boundary sensors were right or wrong:
    /// environment, unit, strength.
    pub wrong: Vec<String>,
}

/// The outcomes of all unseen faults in a scenario.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UnseenFaultMetrics {
    /// The scenario's name.
    pub setting: String,
    /// One for each fault that applies to the study's system.
    pub outcomes: Vec<UnseenFaultOutcome>,
    /// One for each challenge set with a flight.
    pub sets: Vec<ChallengeSetMetrics>,
}

impl UnseenFaultMetrics {
    /// Number of shutdowns of a healthy actuator, and of flights.
    pub fn shutdowns_healthy(&self) -> (u64, u64) {
        let sum = |of: fn(&UnseenFaultOutcome) -> u64| self.outcomes.iter().map(of).sum();
        (sum(|outcome| outcome.shutdowns_healthy), sum(|outcome| outcome.flights))
    }

    /// Number of flights with a healthy actuator shut down because of a wrong boundary sensor, and of flights with such
    /// a sensor.
    pub fn shutdowns_behind_wrong_sensor(&self) -> (u64, u64) {
        let counted = self.outcomes.iter();
        let counted = counted.filter_map(|o| Some((o.shutdowns_behind_wrong_sensor?, o.flights)));
        counted.fold((0, 0), |(wrong, of), (w, flights)| (wrong + w, of + flights))
    }
}

/// One flight with an unseen fault.
struct Case {
    /// Its index in [`ALL`].
    foreign: usize,
    unit: usize,
    strength: f64,
    changes: Changes,
    /// The plant's environment, if it differs from the twin's.
    real: Option<Environment>,
    base: usize,
}

impl Case {
    /// Its environment, its actuator and how strong the fault is.
    fn in_words(&self, study: &Study, flights: &Flights) -> String {
        let environment = &flights.judged[self.base].name;
        let unit = &study.units[self.unit];
        let of = if unit.is_empty() { String::new() } else { format!(", {unit}") };
        format!("{environment}{of} at {}", self.strength)
    }
}

/// The cases, their flights and the environments as twins receive them.
#[derive(Default)]
struct Plan {
    cases: Vec<Case>,
    flights: Vec<PlannedFlight>,
    told: Vec<Environment>,
}

impl Plan {
    fn new(study: &Study, flights: &Flights) -> Self {
        let mut plan = Plan { told: flights.judged.clone(), ..Plan::default() };
        let count = flights.judged.len();
        for (foreign, fault) in ALL.iter().enumerate() {
            for (place, &strength) in fault.strengths.iter().enumerate() {
                for unit in 0..study.units.len() {
                    let effects = (fault.effects)(strength);
                    let Some(changes) = Changes::new(study, unit, &effects) else { continue };
                    for repeat in 0..flights.judge.foreign {
                        // Eleven and seven have no common divisor with the usual numbers.
                        let base = (11 * repeat + 7 * foreign + 5 * place + 3 * unit) % count;
                        let case = Case {
                            foreign,
                            unit,
                            strength,
                            changes: changes.clone(),
                            real: None,
                            base,
                        };
                        plan.add(study, flights, case);
                    }
                }
            }
        }
        plan
    }

    fn add(&mut self, study: &Study, flights: &Flights, mut case: Case) {
        let [from, to] = flights.onset_s;
        let mut flight = PlannedFlight {
            number: FIRST + self.cases.len(),
            environment: case.base,
            fault: None,
            intensity: 0.0,
            onset_s: 0.5 * (from + to),
            onset: Onset::Step,
            duration_s: flights.duration_s,
        };
        let base = &flights.judged[case.base];
        let [plant, twin] = case.changes.environments(base, &flight, study.sample_period_s);
        // If only the twin's environment changes, the plant keeps the original one.
        case.real = twin.is_some().then(|| plant.unwrap_or_else(|| base.clone()));
        if let Some(twin) = twin {
            flight.environment = self.told.len();
            self.told.push(twin);
        }
        self.flights.push(flight);
        self.cases.push(case);
    }
}

/// The outputs collected in a flight.
struct Listening {
    session: Session,
    sensible: Sensible,
    touched: Touched,
    onset: u64,
    at_fault: Vec<usize>,
    misinformed: Vec<usize>,
    is_off: Vec<bool>,
    /// Actuator and action of the first alarm.
    first: Option<(usize, u32)>,
    heard: FindingFlags,
    first_word: Option<u64>,
    /// The sample of the first sensible action against a faulty actuator.
    right_action: Option<u64>,
    /// Whether an action was raised before the onset.
    false_alarm: bool,
    off_at_fault: bool,
    off_misinformed: bool,
    off_healthy: bool,
}

/// The findings at any time since the onset.
#[derive(Default)]
struct FindingFlags {
    actuator: bool,
    other: bool,
    unknown: bool,
    environment_invalid: bool,
    no_data: bool,
}

impl FindingFlags {
    /// Updates the flags; returns whether anything was reported.
    fn listen(&mut self, outcome: &Outcome, is_concerned: impl Fn(usize) -> bool) -> bool {
        let lacks = outcome.lost > 0 || matches!(outcome.alarm, Alarm::NoData | Alarm::Error);
        self.no_data |= lacks;
        match outcome.finding {
            IndexedFinding::Healthy | IndexedFinding::Unjudged => return lacks,
            IndexedFinding::Unknown => self.unknown = true,
            IndexedFinding::EnvironmentInvalid { .. } => self.environment_invalid = true,
            IndexedFinding::Detected => self.other = true,
            IndexedFinding::Actuator { actuator: unit }
            | IndexedFinding::Action { actuator: unit, .. }
            | IndexedFinding::Detail { actuator: unit, .. } => {
                let is_right = is_concerned(unit as usize);
                self.actuator |= is_right;
                self.other |= !is_right;
            }
        }
        true
    }
}

impl Observer for Listening {
    fn sample(&mut self, index: usize, measured: &[f64], twin: &[f64], inputs: &[f64]) {
        self.touched.take(index, measured, inputs);
        let outcome = *self.session.push(&self.touched.inputs, &self.touched.measured, twin);
        let is_late = index as u64 >= self.onset;
        if let Some(raised) = outcome.raised {
            let unit = raised.actuator as usize;
            let is_guilty = is_late && self.at_fault.contains(&unit);
            let is_misinformed = is_late && self.misinformed.contains(&unit);
            let is_off = self.is_off[raised.action as usize];
            // A command raised before the onset accuses a healthy unit and may persist.
            let is_new_off = is_off && raised.sample == outcome.sample;
            self.false_alarm |= !is_late;
            if is_late && self.is_sensible(unit, raised.action) {
                self.right_action = self.right_action.or(Some(index as u64));
            }
            self.off_at_fault |= is_off && is_guilty;
            self.off_misinformed |= is_new_off && is_misinformed;
            self.off_healthy |= is_new_off && !is_guilty && !is_misinformed;
        }
        if is_late {
            let is_word = self.heard.listen(&outcome, |unit| {
                self.at_fault.contains(&unit) || self.misinformed.contains(&unit)
            });
            self.first_word = self.first_word.or(is_word.then_some(index as u64));
            let raised = outcome.raised.map(|raised| (raised.actuator as usize, raised.action));
            self.first = self.first.or(raised);
        }
    }
}

impl Listening {
    fn new(
        session: &Session,
        is_off: &[bool],
        flight: &PlannedFlight,
        case: &Case,
        period_s: f64,
    ) -> Self {
        let onset = (flight.onset_s / period_s).ceil() as usize;
        Listening {
            session: session.clone(),
            sensible: ALL[case.foreign].sensible,
            touched: Touched::new(case.changes.touches(), onset, flight.number as u64),
            onset: onset as u64,
            at_fault: case.changes.at_fault.clone(),
            misinformed: case.changes.misinformed.clone(),
            is_off: is_off.to_vec(),
            first: None,
            heard: FindingFlags::default(),
            first_word: None,
            right_action: None,
            false_alarm: false,
            off_at_fault: false,
            off_misinformed: false,
            off_healthy: false,
        }
    }

    /// Whether something is wrong with a unit or with what its twin reads.
    fn is_concerned(&self, unit: usize) -> bool {
        self.at_fault.contains(&unit) || self.misinformed.contains(&unit)
    }

    /// Whether an action against a unit is sensible.
    fn is_sensible(&self, unit: usize, action: u32) -> bool {
        let is_off = self.is_off[action as usize];
        self.is_concerned(unit)
            && match self.sensible {
                Sensible::Shutdown => is_off,
                Sensible::NoShutdown => !is_off,
                Sensible::Any => true,
                Sensible::Nothing => false,
            }
    }

    fn count(&self, words: &mut Words) {
        let heard = &self.heard;
        let word = match self.first {
            Some((unit, action)) if self.is_sensible(unit, action) => &mut words.sensible,
            Some((unit, _)) if self.is_concerned(unit) => &mut words.other_command,
            Some(_) => &mut words.wrong_actuator,
            None if heard.actuator => &mut words.actuator,
            None if heard.unknown => &mut words.unknown,
            None if heard.environment_invalid => &mut words.environment_invalid,
            None if heard.no_data => &mut words.no_data,
            None if heard.other => &mut words.detected,
            None => &mut words.healthy,
        };
        *word += 1;
    }
}

/// Flies the unseen faults of some challenge sets in some of the test environments, and evaluates the outputs.
///
/// # Errors
/// A twin cannot be simulated, or [`Diagnoser::check`] fails for a study that does not fit.
pub fn judge(
    study: &Study,
    flights: &Flights,
    setting: Setting,
    diagnoser: &Arc<Diagnoser>,
    sets: &[&str],
    workers: Workers,
) -> Result<UnseenFaultMetrics, CampaignError> {
    let Plan { cases, flights: mut plan, told } = Plan::new(study, flights);
    let case = |flight: &PlannedFlight| &cases[flight.number - FIRST];
    // Numbers, and so specimens and noise, do not depend on the chosen sets.
    plan.retain(|flight| sets.contains(&ALL[case(flight).foreign].set));
    let lot = (Purpose::Judge, flights.seed);
    let told = Cow::Owned(told);
    let flown = FlightCampaign::planned(study, told, plan, lot, setting, workers)?;
    let fresh = Session::new(diagnoser.clone()).expect("a diagnoser that was checked");
    let is_off = diagnoser.tuning.switches_off(diagnoser.names());
    let mut ended = vec![];
    flown.fly_altered(
        &flown.which,
        |flight, variant| {
            let case = case(flight);
            if let Some(real) = &case.real {
                variant.inputs = real.inputs.iter().collect();
            }
            variant.later = case.changes.later(study, flight, &variant.overrides);
        },
        |flight| Listening::new(&fresh, &is_off, flight, case(flight), flown.period_s()),
        |flight, heard, outcome| {
            let (flight, case, is_ok) = (*flight, case(flight), outcome.is_ok());
            ended.push(Ended { flight, case, heard, is_ok });
        },
    );
    ended.sort_by_key(|ended| ended.flight.number);
    let outcome_of = |foreign: usize| {
        let own: Vec<&Ended> = ended.iter().filter(|ended| ended.case.foreign == foreign).collect();
        outcome(&ALL[foreign], &own, study, flights, flown.period_s())
    };
    let outcomes = (0..ALL.len()).map(outcome_of).filter(|o| o.flights + o.failed > 0).collect();
    let sets = set_names().into_iter().filter(|set| sets.contains(set));
    let sets = sets.filter_map(|set| challenge_set::count(set, &ended, flown.period_s())).collect();
    Ok(UnseenFaultMetrics { setting: setting.name().into(), outcomes, sets })
}

/// A judged flight with an unseen fault; `is_ok` is false if the simulation failed.
struct Ended<'c> {
    flight: PlannedFlight,
    case: &'c Case,
    heard: Listening,
    is_ok: bool,
}

impl Ended<'_> {
    /// The time from the onset to a sample, s.
    fn since_onset_s(&self, sample: u64, period_s: f64) -> f64 {
        (sample as f64 * period_s - self.flight.onset_s).max(0.0)
    }
}

/// The outcome of all flights with one of the faults.
fn outcome(
    fault: &Foreign,
    own: &[&Ended],
    study: &Study,
    flights: &Flights,
    period_s: f64,
) -> UnseenFaultOutcome {
    let finished: Vec<&Ended> = own.iter().copied().filter(|ended| ended.is_ok).collect();
    let mut words = Words::default();
    finished.iter().for_each(|ended| ended.heard.count(&mut words));
    let of = finished.len() as u64;
    let times_s = finished
        .iter()
        .filter_map(|ended| Some(ended.since_onset_s(ended.heard.first_word?, period_s)));
    let count = |holds: fn(&Listening) -> bool| {
        finished.iter().filter(|ended| holds(&ended.heard)).count() as u64
    };
    let is_wrong = |ended: &&&Ended| ended.heard.off_healthy || ended.heard.off_misinformed;
    UnseenFaultOutcome {
        title: fault.title.into(),
        strengths: fault.strengths_in_words.into(),
        sensible: fault.sensible,
        flights: of,
        failed: own.len() as u64 - of,
        words,
        shutdowns_at_fault: count(|heard| heard.off_at_fault),
        shutdowns_healthy: count(|heard| heard.off_healthy),
        shutdowns_behind_wrong_sensor: own
            .iter()
            .any(|ended| !ended.case.changes.misinformed.is_empty())
            .then(|| count(|heard| heard.off_misinformed)),
        first_word: latency(times_s, of),
        wrong: finished
            .iter()
            .filter(is_wrong)
            .map(|ended| ended.case.in_words(study, flights))
            .collect(),
    }
}
