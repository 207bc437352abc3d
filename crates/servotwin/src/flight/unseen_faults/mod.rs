//! Tests the diagnosis with faults that it was never trained on.
//!
//! The right name cannot be expected for an unknown fault. The requirement is that the healthy actuator stays on, and
//! that the output makes sense: the right actuator, an unknown fault, or a wrong input of the twin.

mod effect;
mod list;

pub(super) use effect::Touched;
use list::set_names;
pub use list::{ALL, UnseenFault};

use super::watched::{Ended, Truth, Watching, watch};
use crate::measure::flights::{Latency, latency};
use crate::measure::outcome::{FirstAction, Needed, RunOutcome, Word};
use crate::parallel::Workers;
use crate::run::runner::{Chosen, Runner};
use crate::run::{Profile, Run, RunError};
use crate::study::flights::Environment;
use crate::study::{Scenario, Stream, Study, Suite};
use effect::Changes;
use serde::{Deserialize, Serialize};

/// Number of flights by output; every flight counts once, by its most specific output.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Words {
    /// The needed action against a faulty actuator was raised first.
    pub needed: u64,
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
    fn count(&mut self, outcome: &RunOutcome) {
        let word = match (outcome.first, outcome.word) {
            (FirstAction::Right, _) => &mut self.needed,
            (FirstAction::OtherAction, _) => &mut self.other_command,
            (FirstAction::OtherActuator, _) => &mut self.wrong_actuator,
            (FirstAction::None, Word::Actuator) => &mut self.actuator,
            (FirstAction::None, Word::Unknown) => &mut self.unknown,
            (FirstAction::None, Word::EnvironmentInvalid) => &mut self.environment_invalid,
            (FirstAction::None, Word::NoData) => &mut self.no_data,
            (FirstAction::None, Word::Detected) => &mut self.detected,
            (FirstAction::None, Word::Healthy) => &mut self.healthy,
        };
        *word += 1;
    }

    /// Each count with its name, the best result first.
    pub fn named(&self) -> [(&'static str, u64); 9] {
        [
            ("needed command", self.needed),
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

/// What was counted in the flights of an unseen fault, or of all of a challenge set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UnseenFaultOutcome {
    /// The title of the fault, or the name of the set.
    pub title: String,
    /// The strengths of the fault in words; empty for a set.
    pub strengths: String,
    /// What is right for the fault; `None` for a set.
    pub needed: Option<Needed>,
    /// Number of completed flights.
    pub flights: u64,
    /// Number of failed flights.
    pub failed: u64,
    /// Flights in which the first action after the onset was right, or where none is right, none was raised.
    pub right_action: u64,
    /// Flights in which another action was the first after the onset, against whatever actuator.
    pub other_action: u64,
    /// The outputs of the diagnosis.
    pub words: Words,
    /// Flights that need a shutdown, and those of them without a shutdown of an actuator at fault.
    pub missed_shutdowns: [u64; 2],
    /// Number of shutdowns of an actuator at fault.
    pub shutdowns_at_fault: u64,
    /// Number of shutdowns, at any time, of a healthy actuator whose boundary sensors are right.
    pub shutdowns_healthy: u64,
    /// Flights in which a healthy actuator was shut down because a boundary sensor (a supply or return pressure that
    /// its twin reads) was wrong. `None` if no such sensor was wrong.
    pub shutdowns_behind_wrong_sensor: Option<u64>,
    /// Flights with an action before the onset.
    pub false_alarms: u64,
    /// From the onset to the first output of any kind.
    pub first_word: Option<Latency>,
    /// From the onset to the first right action.
    pub latency: Option<Latency>,
    /// Flights in which a shutdown of a healthy actuator was raised, whether its boundary sensors were right or wrong:
    /// environment, unit, strength.
    pub wrong: Vec<String>,
}

impl UnseenFaultOutcome {
    /// Flights without an action after the onset that need one.
    pub fn without_action(&self) -> u64 {
        self.flights - self.right_action - self.other_action
    }

    /// Flights in which a healthy actuator was shut down at any time, whether its boundary sensors were right or wrong.
    pub fn wrong_shutdowns(&self) -> u64 {
        self.wrong.len() as u64
    }
}

/// The outcomes of all unseen faults in a scenario.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UnseenFaultMetrics {
    /// The suite.
    pub suite: String,
    /// The scenario.
    pub scenario: String,
    /// One for each fault that applies to the study's system.
    pub outcomes: Vec<UnseenFaultOutcome>,
    /// One for each challenge set with a flight.
    pub sets: Vec<UnseenFaultOutcome>,
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

impl UnseenFaultMetrics {
    /// Counts the flights of a suite in a scenario.
    pub fn of(suite: &str, scenario: &str, outcomes: &[RunOutcome]) -> Self {
        let of = |title: &str, is_own: &dyn Fn(&RunOutcome) -> bool| {
            let own: Vec<&RunOutcome> = outcomes.iter().filter(|row| is_own(row)).collect();
            (!own.is_empty()).then(|| counted(title, &own))
        };
        let of_fault = |fault: &UnseenFault| {
            let counted = of(fault.title, &|row| row.event == fault.title)?;
            let (strengths, needed) = (fault.strengths_in_words.into(), Some(fault.needed));
            Some(UnseenFaultOutcome { strengths, needed, ..counted })
        };
        let of_set = |set| of(set, &|row| row.kind == set);
        UnseenFaultMetrics {
            suite: suite.into(),
            scenario: scenario.into(),
            outcomes: ALL.iter().filter_map(of_fault).collect(),
            sets: set_names().into_iter().filter_map(of_set).collect(),
        }
    }
}

/// One run with an unseen fault.
struct Case {
    /// Its index in [`ALL`].
    fault: usize,
    strength: f64,
    changes: Changes,
    /// The plant's environment, if it differs from the twin's.
    real: Option<Environment>,
    /// The number of the environment before any change.
    base: usize,
}

impl Case {
    /// What is right in its run.
    fn truth(&self, study: &Study, run: &Run) -> Truth {
        let UnseenFault { set, title, needed, .. } = ALL[self.fault];
        let names = |units: &[usize]| {
            let name = |&unit: &usize| match study.units[unit].as_str() {
                "" => "actuator",
                name => name,
            };
            units.iter().map(name).collect::<Vec<_>>().join(", ")
        };
        let Changes { at_fault, misinformed, .. } = &self.changes;
        let run = RunOutcome {
            number: run.number as u64,
            environment: self.base as u64,
            event: title.into(),
            kind: set.into(),
            intensity: self.strength,
            onset_s: Some(run.onset_s),
            duration_s: run.duration_s,
            at_fault: names(at_fault),
            misinformed: names(misinformed),
            needed,
            needs_shutdown: needed == Needed::Shutdown,
            ..RunOutcome::default()
        };
        let (at_fault, misinformed) = (at_fault.clone(), misinformed.clone());
        Truth { run, at_fault, misinformed, objective: None }
    }
}

/// The cases, their runs and the environments as twins receive them.
struct Plan {
    cases: Vec<Case>,
    runs: Vec<Run>,
    told: Vec<Environment>,
}

impl Plan {
    /// All events of the list, each for every actuator, as often as the suite repeats them.
    fn new(study: &Study, suite: &Suite) -> Result<Self, RunError> {
        let told = study.environments(suite, 0..suite.environments)?;
        let mut plan = Plan { cases: vec![], runs: vec![], told };
        for Event { fault, place, strength, unit, changes } in events(study) {
            for repeat in 0..suite.repeats {
                // Eleven and seven have no common divisor with the usual numbers.
                let number = 11 * repeat + 7 * fault + 5 * place + 3 * unit;
                let (base, changes) = (number % suite.environments, changes.clone());
                plan.add(study, suite, Case { fault, strength, changes, real: None, base });
            }
        }
        Ok(plan)
    }

    fn add(&mut self, study: &Study, suite: &Suite, mut case: Case) {
        let middle_s = suite.onset_s.map_or(0.0, |[from, to]| 0.5 * (from + to));
        let mut run = Run {
            number: self.cases.len(),
            environment: case.base,
            fault: None,
            intensity: 0.0,
            onset_s: middle_s,
            profile: Profile::Step,
            duration_s: suite.duration_s,
        };
        let base = &self.told[case.base];
        let [plant, twin] = case.changes.environments(base, &run, study.sample_period_s);
        // If only the twin's environment changes, the plant keeps the original one.
        case.real = twin.is_some().then(|| plant.unwrap_or_else(|| base.clone()));
        if let Some(twin) = twin {
            run.environment = self.told.len();
            self.told.push(twin);
        }
        self.runs.push(run);
        self.cases.push(case);
    }
}

/// A fault of a strength in an actuator.
struct Event {
    /// The index of the fault in [`ALL`].
    fault: usize,
    /// The index of the strength.
    place: usize,
    strength: f64,
    unit: usize,
    changes: Changes,
}

/// All events of the list that apply to a study's system, each for every actuator.
fn events(study: &Study) -> Vec<Event> {
    let mut events = vec![];
    for (fault, known) in ALL.iter().enumerate() {
        for (place, &strength) in known.strengths.iter().enumerate() {
            events.extend((0..study.units.len()).filter_map(|unit| {
                let changes = Changes::new(study, unit, known.effects(strength))?;
                Some(Event { fault, place, strength, unit, changes })
            }));
        }
    }
    events
}

/// The number of runs of a suite of unseen faults.
pub(super) fn count(study: &Study, suite: &Suite) -> usize {
    suite.repeats * events(study).len()
}

/// Flies runs with unseen faults of a suite, watched by diagnoses.
///
/// # Errors
/// A command cannot be flown, or a twin cannot be simulated.
pub(super) fn fly(
    (study, suite, scenario): (&Study, &Suite, Scenario),
    watching: &[Watching],
    numbers: &[usize],
    workers: Workers,
    ended: Ended,
) -> Result<(), RunError> {
    let Plan { cases, mut runs, told } = Plan::new(study, suite)?;
    runs.retain(|run| numbers.contains(&run.number));
    let case = |run: &Run| &cases[run.number];
    let chosen = Chosen::default();
    let flown = Runner::chosen(study, suite, scenario, (told, runs), chosen, workers)?;
    let touched = |run: &Run| {
        let onset = (run.onset_s / flown.period_s()).ceil() as usize;
        let random = suite.seed_of(run.number).stream(Stream::Reading);
        Some(Touched::new(&case(run).changes, onset, random))
    };
    watch(
        &flown,
        watching,
        &|run| case(run).truth(study, run),
        &touched,
        |run, variant| {
            let case = case(run);
            if let Some(real) = &case.real {
                variant.inputs = real.inputs.iter().collect();
            }
            variant.later = case.changes.later(study, run, &variant.overrides);
        },
        ended,
    );
    Ok(())
}

/// Counts some flights.
fn counted(title: &str, own: &[&RunOutcome]) -> UnseenFaultOutcome {
    let finished: Vec<&RunOutcome> = own.iter().copied().filter(|row| row.is_finished).collect();
    let mut words = Words::default();
    finished.iter().for_each(|row| words.count(row));
    let of = finished.len() as u64;
    let count =
        |holds: fn(&RunOutcome) -> bool| finished.iter().filter(|row| holds(row)).count() as u64;
    let is_wrong = |row: &&&RunOutcome| row.shuts_down_healthy() || row.shutdown_misinformed;
    let in_words = |row: &RunOutcome| {
        let of = if row.at_fault.is_empty() { &row.misinformed } else { &row.at_fault };
        let of = if of.is_empty() { String::new() } else { format!(", {of}") };
        format!("environment {}{of} at {}", row.environment, row.intensity)
    };
    UnseenFaultOutcome {
        title: title.into(),
        strengths: String::new(),
        needed: None,
        flights: of,
        failed: own.len() as u64 - of,
        right_action: count(RunOutcome::is_right),
        other_action: count(|row| row.first != FirstAction::None && !row.is_right()),
        words,
        missed_shutdowns: [
            count(|row| row.needs_shutdown),
            count(|row| row.needs_shutdown && !row.shutdown_at_fault),
        ],
        shutdowns_at_fault: count(|row| row.shutdown_at_fault),
        shutdowns_healthy: count(RunOutcome::shuts_down_healthy),
        shutdowns_behind_wrong_sensor: own
            .iter()
            .any(|row| !row.misinformed.is_empty())
            .then(|| count(|row| row.shutdown_misinformed)),
        false_alarms: count(|row| row.early_alarms > 0),
        first_word: latency(finished.iter().filter_map(|row| row.first_word_s), of),
        latency: latency(finished.iter().filter_map(|row| row.right_action_s), of),
        wrong: finished.iter().filter(is_wrong).map(|row| in_words(row)).collect(),
    }
}
