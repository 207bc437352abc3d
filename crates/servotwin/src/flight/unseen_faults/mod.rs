//! Judges the diagnosis on faults that it was never trained on.
//!
//! A right name cannot be expected. The healthy actuator must stay on, and the finding must make sense: it names the
//! right actuator, an unknown fault, or an invalid input.

mod effect;
mod list;

pub use list::{ALL, Foreign, Sensible};

use super::campaign::{FlightCampaign, Observer};
use super::judge::{Latency, latency};
use super::plan::{Flight, Onset, Purpose};
use crate::campaign::CampaignError;
use crate::parallel::Workers;
use crate::study::flights::Environment;
use crate::study::{Flights, Setting, Study};
use effect::{Changes, Touched};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::diagnoser::{Alarm, Diagnoser, Finding, Outcome, Session};
use std::borrow::Cow;
use std::sync::Arc;

/// First flight number of unseen faults, so that their specimens and noise differ from those of other flights.
const FIRST: usize = 500_000;

/// Number of flights by result. Every flight counts once, with its most significant finding. An actuator whose
/// twin reads a wrong boundary sensor counts as faulty here.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Words {
    /// A sensible action against a faulty actuator was raised first.
    pub sensible: u64,
    /// Another action against a faulty actuator was raised first.
    pub other_command: u64,
    /// An action against a healthy actuator was raised first.
    pub wrong_actuator: u64,
    /// No action, but the faulty actuator was named.
    pub actuator: u64,
    /// None of these, but the fault was reported as unknown.
    pub unknown: u64,
    /// None of these, but an input was reported as invalid.
    pub environment_invalid: u64,
    /// None of these, but readings were reported as missing.
    pub no_data: u64,
    /// Only a detection, or a healthy actuator was named without an action.
    pub detected: u64,
    /// No finding.
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

/// Results for one unseen fault.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UnseenFaultOutcome {
    /// Title of the fault.
    pub title: String,
    /// The strengths, as text.
    pub strengths: String,
    /// Which actions count as sensible.
    pub sensible: Sensible,
    /// Number of flights simulated to the end.
    pub flights: u64,
    /// Number of flights that failed.
    pub failed: u64,
    /// Number of flights by result.
    pub words: Words,
    /// Number of flights with a shutdown of a faulty actuator.
    pub shutdowns_at_fault: u64,
    /// Number of flights with a shutdown of a healthy actuator whose boundary sensors are right.
    pub shutdowns_healthy: u64,
    /// Number of flights with a shutdown of a healthy actuator because a boundary sensor of its twin (supply or return
    /// pressure) was wrong. `None` if no such sensor was wrong. Results that predate this count also have `None` and
    /// include these flights in `shutdowns_at_fault`.
    #[serde(default)]
    pub shutdowns_behind_wrong_sensor: Option<u64>,
    /// Latency from the onset to the first finding of any kind.
    pub first_word: Option<Latency>,
    /// Flights with a shutdown of a healthy actuator, with right or wrong boundary sensors: environment, actuator,
    /// strength.
    pub wrong: Vec<String>,
}

/// Results for all unseen faults in one scenario.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UnseenFaultMetrics {
    /// Name of the scenario.
    pub setting: String,
    /// One for each fault that the study's system can have.
    pub outcomes: Vec<UnseenFaultOutcome>,
}

impl UnseenFaultMetrics {
    /// Number of flights with a shutdown of a healthy actuator, and of all flights.
    pub fn shutdowns_healthy(&self) -> (u64, u64) {
        let sum = |of: fn(&UnseenFaultOutcome) -> u64| self.outcomes.iter().map(of).sum();
        (sum(|outcome| outcome.shutdowns_healthy), sum(|outcome| outcome.flights))
    }

    /// Number of flights with a healthy actuator shut down because of a wrong boundary sensor, and of all flights with
    /// such a sensor.
    pub fn shutdowns_behind_wrong_sensor(&self) -> (u64, u64) {
        let counted = self.outcomes.iter();
        let counted = counted.filter_map(|o| Some((o.shutdowns_behind_wrong_sensor?, o.flights)));
        counted.fold((0, 0), |(wrong, of), (w, flights)| (wrong + w, of + flights))
    }
}

/// One flight with an unseen fault.
struct Case {
    /// Index into [`ALL`].
    foreign: usize,
    unit: usize,
    strength: f64,
    changes: Changes,
    /// The plant's environment, if the twin's inputs differ from it.
    real: Option<Environment>,
    base: usize,
}

/// The cases, their flights, and the environments of the twins.
#[derive(Default)]
struct Plan {
    cases: Vec<Case>,
    flights: Vec<Flight>,
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
                        // Small coprime factors spread the cases over the environments.
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
        let mut flight = Flight {
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
        // A plant without a change keeps the original environment, even if its twin's inputs change.
        case.real = twin.is_some().then(|| plant.unwrap_or_else(|| base.clone()));
        if let Some(twin) = twin {
            flight.environment = self.told.len();
            self.told.push(twin);
        }
        self.flights.push(flight);
        self.cases.push(case);
    }
}

/// The observer of one flight.
struct Listening {
    session: Session,
    touched: Touched,
    onset: u64,
    at_fault: Vec<usize>,
    misinformed: Vec<usize>,
    is_off: Vec<bool>,
    /// Actuator and action of the first alarm.
    first: Option<(usize, u32)>,
    heard: FindingFlags,
    first_word: Option<u64>,
    off_at_fault: bool,
    off_misinformed: bool,
    off_healthy: bool,
}

/// Findings at any time since the onset.
#[derive(Default)]
struct FindingFlags {
    actuator: bool,
    other: bool,
    unknown: bool,
    environment_invalid: bool,
    no_data: bool,
}

impl FindingFlags {
    /// Records a finding and returns whether it reports anything.
    fn listen(&mut self, outcome: &Outcome, is_concerned: impl Fn(usize) -> bool) -> bool {
        let lacks = outcome.lost > 0 || matches!(outcome.alarm, Alarm::NoData | Alarm::Error);
        self.no_data |= lacks;
        match outcome.finding {
            Finding::Healthy | Finding::Unjudged => return lacks,
            Finding::Unknown => self.unknown = true,
            Finding::EnvironmentInvalid { .. } => self.environment_invalid = true,
            Finding::Detected => self.other = true,
            Finding::Actuator { actuator: unit }
            | Finding::Action { actuator: unit, .. }
            | Finding::Detail { actuator: unit, .. } => {
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
        let outcome = self.session.push(&self.touched.inputs, &self.touched.measured, twin);
        let is_late = index as u64 >= self.onset;
        if let Some(raised) = outcome.raised {
            let unit = raised.actuator as usize;
            let is_guilty = is_late && self.at_fault.contains(&unit);
            let is_misinformed = is_late && self.misinformed.contains(&unit);
            let is_off = self.is_off[raised.action as usize];
            // Alarms raised before the onset concern a healthy actuator and may persist.
            let is_new_off = is_off && raised.sample == outcome.sample;
            self.off_at_fault |= is_off && is_guilty;
            self.off_misinformed |= is_new_off && is_misinformed;
            self.off_healthy |= is_new_off && !is_guilty && !is_misinformed;
        }
        if is_late {
            let is_word = self.heard.listen(outcome, |unit| {
                self.at_fault.contains(&unit) || self.misinformed.contains(&unit)
            });
            self.first_word = self.first_word.or(is_word.then_some(index as u64));
            let raised = outcome.raised.map(|raised| (raised.actuator as usize, raised.action));
            self.first = self.first.or(raised);
        }
    }
}

impl Listening {
    /// Whether an actuator is faulty or its twin reads a wrong input.
    fn is_concerned(&self, unit: usize) -> bool {
        self.at_fault.contains(&unit) || self.misinformed.contains(&unit)
    }

    fn count(&self, sensible: Sensible, words: &mut Words) {
        let heard = &self.heard;
        let word = match self.first {
            Some((unit, _)) if !self.is_concerned(unit) => &mut words.wrong_actuator,
            Some((_, command)) => {
                let is_off = self.is_off[command as usize];
                let is_sensible = match sensible {
                    Sensible::Shutdown => is_off,
                    Sensible::NoShutdown => !is_off,
                    Sensible::Any => true,
                    Sensible::Nothing => false,
                };
                if is_sensible { &mut words.sensible } else { &mut words.other_command }
            }
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

/// Flies every unseen fault in some of the judged environments and counts the findings.
///
/// # Errors
/// A twin cannot be simulated.
///
/// # Panics
/// If the diagnoser fails [`Diagnoser::check`].
pub fn judge(
    study: &Study,
    flights: &Flights,
    setting: Setting,
    diagnoser: &Arc<Diagnoser>,
    workers: Workers,
) -> Result<UnseenFaultMetrics, CampaignError> {
    let Plan { cases, flights: plan, told } = Plan::new(study, flights);
    let lot = (Purpose::Judge, flights.seed);
    let told = Cow::Owned(told);
    let flown = FlightCampaign::planned(study, told, plan, lot, setting, workers)?;
    let fresh = Session::new(diagnoser.clone()).expect("a diagnoser that was checked");
    let commands = diagnoser.names().actions.iter();
    let is_off: Vec<bool> =
        commands.map(|command| diagnoser.decision.off_actions.contains(command)).collect();
    let case = |flight: &Flight| &cases[flight.number - FIRST];
    let onset = |flight: &Flight| (flight.onset_s / flown.period_s()).ceil() as usize;
    let mut ended = vec![];
    let all: Vec<usize> = (0..cases.len()).collect();
    flown.fly_altered(
        &all,
        |flight, variant| {
            let case = case(flight);
            if let Some(real) = &case.real {
                variant.inputs = real.inputs.iter().collect();
            }
            variant.later = case.changes.later(study, flight, &variant.overrides);
        },
        |flight| Listening {
            session: fresh.clone(),
            touched: Touched::new(
                case(flight).changes.touches(),
                onset(flight),
                flight.number as u64,
            ),
            onset: onset(flight) as u64,
            at_fault: case(flight).changes.at_fault.clone(),
            misinformed: case(flight).changes.misinformed.clone(),
            is_off: is_off.clone(),
            first: None,
            heard: FindingFlags::default(),
            first_word: None,
            off_at_fault: false,
            off_misinformed: false,
            off_healthy: false,
        },
        |flight, listening, outcome| ended.push((*flight, listening, outcome.is_ok())),
    );
    ended.sort_by_key(|(flight, ..)| flight.number);
    let told_of = |foreign: usize| {
        let own = ended.iter().filter(|(flight, ..)| case(flight).foreign == foreign);
        let own: Vec<_> = own.map(|(f, heard, is_ok)| (f, case(f), heard, *is_ok)).collect();
        let finished: Vec<_> = own.iter().filter(|one| one.3).collect();
        let fault = &ALL[foreign];
        let mut words = Words::default();
        finished.iter().for_each(|(_, _, heard, _)| heard.count(fault.sensible, &mut words));
        let of = finished.len() as u64;
        let times = finished.iter().filter_map(|(flight, _, heard, _)| {
            Some(heard.first_word? as f64 * flown.period_s() - flight.onset_s)
        });
        let count = |all: &[&(_, _, &Listening, _)], holds: fn(&Listening) -> bool| {
            all.iter().filter(|one| holds(one.2)).count() as u64
        };
        let wrong: Vec<String> = finished
            .iter()
            .filter(|one| one.2.off_healthy || one.2.off_misinformed)
            .map(|(_, case, _, _)| {
                let environment = &flights.judged[case.base].name;
                let unit = &study.units[case.unit];
                let of = if unit.is_empty() { String::new() } else { format!(", {unit}") };
                format!("{environment}{of} at {}", case.strength)
            })
            .collect();
        UnseenFaultOutcome {
            title: fault.title.into(),
            strengths: fault.strengths_in_words.into(),
            sensible: fault.sensible,
            flights: of,
            failed: own.len() as u64 - of,
            words,
            shutdowns_at_fault: count(&finished, |heard| heard.off_at_fault),
            shutdowns_healthy: count(&finished, |heard| heard.off_healthy),
            shutdowns_behind_wrong_sensor: own
                .iter()
                .any(|one| !one.1.changes.misinformed.is_empty())
                .then(|| count(&finished, |heard| heard.off_misinformed)),
            first_word: latency(times.map(|time_s: f64| time_s.max(0.0)), of),
            wrong,
        }
    };
    let outcomes = (0..ALL.len()).map(told_of).filter(|o| o.flights + o.failed > 0).collect();
    Ok(UnseenFaultMetrics { setting: setting.name().into(), outcomes })
}
