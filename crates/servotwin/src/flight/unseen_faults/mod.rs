//! Tests the diagnosis with faults that it was never trained on.
//!
//! The right name cannot be expected for an unknown fault. The requirement is that the healthy actuator stays on, and
//! that the output makes sense: the right actuator, an unknown fault, or a wrong input of the twin.

mod effect;
mod list;

pub(super) use effect::Touched;
pub use list::ALL;
pub(crate) use list::UnseenFault;
use list::set_names;

use super::watched::{Ended, Truth, Watching, watch};
use crate::measure::flights::{Latency, latency};
use crate::measure::outcome::{Needed, RunOutcome};
use crate::measure::{Measure, Rates, unseen};
use crate::parallel::Workers;
use crate::run::runner::{Chosen, Runner};
use crate::run::{Profile, Run, RunError};
use crate::study::flights::Environment;
use crate::study::{Scenario, Stream, Study, Suite};
use effect::Changes;
use serde::{Deserialize, Serialize};

/// What was counted in the flights of an unseen fault, or of all of a challenge set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UnseenFaultRates {
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
    /// The measures of unseen faults (`unseen::all`).
    pub rates: Rates,
    /// From the onset to the first output of any kind.
    pub first_word: Option<Latency>,
    /// From the onset to the first right action.
    pub latency: Option<Latency>,
    /// Flights in which a shutdown of a healthy actuator was raised, whether its boundary sensors were right or wrong:
    /// environment, actuator, strength.
    pub wrong: Vec<String>,
}

impl UnseenFaultRates {
    /// In how many flights something happened.
    pub fn count(&self, measure: &Measure) -> u64 {
        self.rates.of(measure).count
    }
}

/// What was counted in the flights of all unseen faults in a scenario.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UnseenFaultMetrics {
    /// The suite.
    pub suite: String,
    /// The scenario.
    pub scenario: String,
    /// The measures of all flights.
    pub rates: Rates,
    /// One for each fault that applies to the study's system.
    pub faults: Vec<UnseenFaultRates>,
    /// One for each challenge set with a flight.
    pub sets: Vec<UnseenFaultRates>,
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
            Some(UnseenFaultRates { strengths, needed, ..counted })
        };
        let of_set = |set| of(set, &|row| row.kind == set);
        let finished: Vec<&RunOutcome> = outcomes.iter().filter(|row| row.is_finished).collect();
        UnseenFaultMetrics {
            suite: suite.into(),
            scenario: scenario.into(),
            rates: unseen::rates(&finished),
            faults: ALL.iter().filter_map(of_fault).collect(),
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
    /// Its run, in the environment before any change.
    run: Run,
}

impl Case {
    /// What is right in its run.
    fn truth(&self, study: &Study) -> Truth {
        let UnseenFault { set, title, needed, .. } = ALL[self.fault];
        let names = |actuators: &[usize]| {
            let name = |&actuator: &usize| match study.actuators[actuator].as_str() {
                "" => "actuator",
                name => name,
            };
            actuators.iter().map(name).collect::<Vec<_>>().join(", ")
        };
        let (run, Changes { at_fault, misinformed, .. }) = (&self.run, &self.changes);
        let run = RunOutcome {
            number: run.number as u64,
            environment: run.environment as u64,
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

/// All events of the list, each for every actuator, as often as the suite repeats them.
fn cases(study: &Study, suite: &Suite) -> Vec<Case> {
    let onset_s = suite.onset_s.map_or(0.0, |[from, to]| 0.5 * (from + to));
    let mut cases = vec![];
    for Event { fault, place, strength, actuator, changes } in events(study) {
        for repeat in 0..suite.repeats {
            // Eleven and seven have no common divisor with the usual numbers.
            let turn = 11 * repeat + 7 * fault + 5 * place + 3 * actuator;
            let run = Run {
                number: cases.len(),
                environment: turn % suite.environments.max(1),
                fault: None,
                intensity: 0.0,
                onset_s,
                profile: Profile::Step,
                duration_s: suite.duration_s,
            };
            cases.push(Case { fault, strength, changes: changes.clone(), run });
        }
    }
    cases
}

/// The runs of a suite of unseen faults, by number.
pub(super) fn runs(study: &Study, suite: &Suite) -> Vec<Run> {
    cases(study, suite).into_iter().map(|case| case.run).collect()
}

/// The environments as twins receive them, the runs in these, and for each run the environment of its plant if it differs
/// from the twin's.
type Placed = (Vec<Environment>, Vec<Run>, Vec<Option<Environment>>);

/// Places the runs of cases in environments. A twin that receives another one has one of its own, behind all others.
fn placed(study: &Study, suite: &Suite, cases: &[Case]) -> Result<Placed, RunError> {
    let mut told = study.environments(suite, 0..suite.environments)?;
    let (mut runs, mut real) = (vec![], vec![]);
    for Case { changes, run, .. } in cases {
        let (mut run, base) = (*run, &told[run.environment]);
        let [plant, twin] = changes.environments(base, &run, study.sample_period_s);
        // If only the twin's environment changes, the plant keeps the original one.
        real.push(twin.is_some().then(|| plant.unwrap_or_else(|| base.clone())));
        if let Some(twin) = twin {
            run.environment = told.len();
            told.push(twin);
        }
        runs.push(run);
    }
    Ok((told, runs, real))
}

/// A fault of a strength in an actuator.
struct Event {
    /// The index of the fault in [`ALL`].
    fault: usize,
    /// The index of the strength.
    place: usize,
    strength: f64,
    actuator: usize,
    changes: Changes,
}

/// All events of the list that apply to a study's system, each for every actuator.
fn events(study: &Study) -> Vec<Event> {
    let mut events = vec![];
    for (fault, known) in ALL.iter().enumerate() {
        for (place, &strength) in known.strengths.iter().enumerate() {
            events.extend((0..study.actuators.len()).filter_map(|actuator| {
                let changes = Changes::new(study, actuator, known.effects(strength))?;
                Some(Event { fault, place, strength, actuator, changes })
            }));
        }
    }
    events
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
    let cases = cases(study, suite);
    let (told, mut runs, real) = placed(study, suite, &cases)?;
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
        &|run| case(run).truth(study),
        &touched,
        |run, variant| {
            if let Some(real) = &real[run.number] {
                variant.inputs = real.inputs.iter().collect();
            }
            variant.later = case(run).changes.later(study, run, &variant.overrides);
        },
        ended,
    );
    Ok(())
}

/// Counts some flights.
fn counted(title: &str, own: &[&RunOutcome]) -> UnseenFaultRates {
    let finished: Vec<&RunOutcome> = own.iter().copied().filter(|row| row.is_finished).collect();
    let of = finished.len() as u64;
    let is_wrong = |row: &&&RunOutcome| row.shuts_down_healthy() || row.shutdown_misinformed;
    let in_words = |row: &RunOutcome| {
        let of = if row.at_fault.is_empty() { &row.misinformed } else { &row.at_fault };
        let of = if of.is_empty() { String::new() } else { format!(", {of}") };
        format!("environment {}{of} at {}", row.environment, row.intensity)
    };
    UnseenFaultRates {
        title: title.into(),
        strengths: String::new(),
        needed: None,
        flights: of,
        failed: own.len() as u64 - of,
        rates: unseen::rates(&finished),
        first_word: latency(finished.iter().filter_map(|row| row.first_word_s), of),
        latency: latency(finished.iter().filter_map(|row| row.right_action_s), of),
        wrong: finished.iter().filter(is_wrong).map(|row| in_words(row)).collect(),
    }
}
