//! The runs of a suite: fault, intensity, onset, environment and duration of each.

use crate::ensemble::Later;
use crate::study::{Purpose, Scenario, Stream, Study, Suite};
use servotwin_model::program::FaultAt;
use std::fmt;
use std::ops::Range;
use std::str::FromStr;

/// How a fault develops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Profile {
    /// It appears at once.
    Step,
    /// It grows to its intensity within `DRIFT_S`.
    Drift,
    /// It appears and disappears every `PULSE_S`.
    Intermittent,
}

impl Profile {
    /// All of them.
    pub const ALL: [Profile; 3] = [Profile::Step, Profile::Drift, Profile::Intermittent];

    /// The name in tables and reports.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Profile::Step => "at once",
            Profile::Drift => "drift",
            Profile::Intermittent => "intermittent",
        }
    }
}

/// How long a growing fault takes to reach its intensity, s.
pub(crate) const DRIFT_S: f64 = 4.0;
/// Number of steps in which it grows.
const DRIFT_STEPS: u32 = 40;
/// How long an intermittent fault is present, and absent, s.
pub(crate) const PULSE_S: f64 = 1.0;

/// The intensities of every fault in closed loop.
const CLOSED_LOOP_INTENSITIES: [f64; 2] = [0.5, 1.0];

/// A run of a suite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Run {
    /// Its number in the suite, from which specimen and noise are derived.
    pub number: usize,
    /// The number of its environment.
    pub(crate) environment: usize,
    /// The fault as an index in [`Study::faults`], or in closed loop in all faults of the system; `None` for a
    /// healthy run.
    pub fault: Option<usize>,
    /// The fault's intensity; 0 for a healthy run.
    pub(crate) intensity: f64,
    /// Onset of the fault, s; 0 for one that is present before the first sample, infinite for a healthy run.
    pub onset_s: f64,
    /// How the fault develops.
    pub(crate) profile: Profile,
    /// Duration, s.
    pub(crate) duration_s: f64,
}

/// The name of a run in a scenario, which tells everything of it together with the study: `judge#17@realistic`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunName {
    /// The suite.
    pub suite: String,
    /// The number in the suite.
    pub number: usize,
    /// The scenario.
    pub scenario: Scenario,
}

impl fmt::Display for RunName {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}#{}@{}", self.suite, self.number, self.scenario.name())
    }
}

impl FromStr for RunName {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let parse = || {
            let (suite, rest) = text.split_once('#')?;
            let (number, scenario) = rest.split_once('@')?;
            let (number, scenario) = (number.parse().ok()?, Scenario::named(scenario)?);
            Some(RunName { suite: suite.into(), number, scenario })
        };
        parse().ok_or("a run is written as suite#number@scenario, such as judge#17@realistic")
    }
}

/// The number of runs of a suite: first those with a fault, then the healthy ones.
pub fn count(study: &Study, suite: &Suite) -> usize {
    if suite.environments == 0 {
        return 0;
    }
    faulty(study, suite) + suite.healthy * suite.environments
}

/// The number of faults in one repeat. If actuators are alike, every row is also seen from the other actuators, so
/// training takes the actuators in turn.
fn of_a_repeat(study: &Study, suite: &Suite) -> usize {
    match takes_turns(study, suite) {
        _ if suite.is_closed_loop => {
            study.system.all_faults().len() * CLOSED_LOOP_INTENSITIES.len()
        }
        true => study.faults.len() / study.actuators.len(),
        false => study.faults.len(),
    }
}

fn takes_turns(study: &Study, suite: &Suite) -> bool {
    suite.purpose == Purpose::Train && study.has_like_actuators()
}

/// The number of runs of a suite with a fault.
pub(crate) fn faulty(study: &Study, suite: &Suite) -> usize {
    suite.repeats * of_a_repeat(study, suite)
}

/// All runs of a suite, by number.
pub(crate) fn all<'s>(study: &'s Study, suite: &'s Suite) -> impl Iterator<Item = Run> + 's {
    (0..count(study, suite)).map(|number| run(study, suite, number))
}

/// The runs of a suite that fly in some of its environments, by number.
pub fn runs(study: &Study, suite: &Suite, environments: &Range<usize>) -> Vec<Run> {
    all(study, suite).filter(|run| environments.contains(&run.environment)).collect()
}

/// The run of a suite with a number. It depends on nothing else. Environments alternate, so that no fault meets the same
/// one twice.
pub fn run(study: &Study, suite: &Suite, number: usize) -> Run {
    match number.checked_sub(faulty(study, suite)) {
        None => with_fault(study, suite, number),
        Some(healthy) => Run {
            number,
            environment: match suite.is_records {
                true => healthy / suite.healthy,
                false => healthy % suite.environments,
            },
            fault: None,
            intensity: 0.0,
            onset_s: f64::INFINITY,
            profile: Profile::Step,
            duration_s: suite.healthy_duration_s,
        },
    }
}

fn with_fault(study: &Study, suite: &Suite, number: usize) -> Run {
    let each = of_a_repeat(study, suite);
    let (repeat, place) = (number / each, number % each);
    if suite.is_closed_loop {
        let count = CLOSED_LOOP_INTENSITIES.len();
        return Run {
            number,
            environment: repeat % suite.environments,
            fault: Some(place / count),
            intensity: CLOSED_LOOP_INTENSITIES[place % count],
            onset_s: suite.onset_s.map_or(0.0, |[middle, _]| middle),
            profile: Profile::Step,
            duration_s: suite.duration_s,
        };
    }
    let intensities = study.intensities.len().max(1);
    let turn = (repeat + place / intensities + place % intensities) % study.actuators.len();
    let fault = if takes_turns(study, suite) { turn * each + place } else { place };
    let of_study = study.faults[fault].at.intensity;
    let training = study.training.as_ref().filter(|_| suite.purpose == Purpose::Train);
    let onset_s = suite.onset_s.map_or(0.0, |[from, to]| {
        from + (to - from) * suite.seed_of(number).stream(Stream::Onset).unit()
    });
    let profile = match (fault + repeat) % 8 {
        3 => Profile::Drift,
        7 => Profile::Intermittent,
        _ => Profile::Step,
    };
    Run {
        number,
        environment: match suite.is_records {
            true => repeat,
            // Seven has no common divisor with the usual numbers of intensities and environments.
            false => (7 * fault + 11 * repeat + fault / intensities) % suite.environments,
        },
        fault: Some(fault),
        intensity: training.map_or(of_study, |t| t.intensity(of_study, repeat + 7 * fault)),
        onset_s,
        profile: if suite.onset_s.is_some() { profile } else { Profile::Step },
        duration_s: suite.duration_s,
    }
}

impl Run {
    /// Whether its plant is healthy to the end.
    pub(crate) fn is_healthy(&self) -> bool {
        self.onset_s == f64::INFINITY
    }

    /// The faults that are present before the first sample.
    pub(crate) fn at_start(&self, study: &Study) -> Vec<FaultAt> {
        let fault = self.fault.filter(|_| self.onset_s == 0.0);
        fault.map(|fault| self.at(study, fault, 1.0)).into_iter().collect()
    }

    /// The course of a fault that begins later, in the form of [`crate::ensemble::Variant::later`].
    pub(crate) fn later(&self, study: &Study) -> Vec<Later> {
        let Some(fault) = self.fault.filter(|_| self.onset_s > 0.0) else { return vec![] };
        let at = |time_s: f64, share: f64| {
            let faults = if share > 0.0 { vec![self.at(study, fault, share)] } else { vec![] };
            Later { time_s, faults, overrides: vec![] }
        };
        match self.profile {
            Profile::Step => vec![at(self.onset_s, 1.0)],
            Profile::Drift => {
                let share = |step: u32| f64::from(step) / f64::from(DRIFT_STEPS);
                let when = |step: u32| self.onset_s + DRIFT_S * share(step - 1);
                (1..=DRIFT_STEPS).map(|step| at(when(step), share(step))).collect()
            }
            Profile::Intermittent => {
                let pulses = ((self.duration_s - self.onset_s) / PULSE_S) as u32;
                let when = |pulse: u32| self.onset_s + PULSE_S * f64::from(pulse);
                let there = |pulse: u32| if pulse.is_multiple_of(2) { 1.0 } else { 0.0 };
                (0..=pulses).map(|pulse| at(when(pulse), there(pulse))).collect()
            }
        }
    }

    fn at(&self, study: &Study, fault: usize, share: f64) -> FaultAt {
        FaultAt { intensity: self.intensity * share, ..study.faults[fault].at }
    }

    /// The fraction of its intensity that the fault has at a time.
    pub(crate) fn share(&self, time_s: f64) -> f64 {
        let age = time_s - self.onset_s;
        match self.profile {
            _ if self.fault.is_none() || age < 0.0 => 0.0,
            Profile::Step => 1.0,
            Profile::Drift => (age / DRIFT_S).min(1.0),
            Profile::Intermittent => {
                f64::from(u8::from(((age / PULSE_S) as u64).is_multiple_of(2)))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::suites::{EFFECTS, JUDGE, LEARN};
    use std::collections::BTreeSet;

    #[test]
    fn every_fault_is_flown_in_each_repeat_and_in_training_by_each_actuator_in_turn() {
        let study = Study::default();
        let judge = study.suite(JUDGE).unwrap();
        let runs = |suite: &Suite| runs(&study, suite, &(0..suite.environments));
        let faults: Vec<usize> = runs(judge).iter().filter_map(|run| run.fault).collect();
        assert_eq!(faults, (0..study.faults.len()).collect::<Vec<_>>());
        let learn = study.suite(LEARN).unwrap();
        let taught: BTreeSet<usize> = runs(learn).iter().filter_map(|run| run.fault).collect();
        assert_eq!(taught.len(), study.faults.len(), "over the repeats, every fault has its turn");
        let each = study.faults.len() / study.actuators.len();
        let kinds = |run: &Run| run.fault.map(|fault| fault % each);
        for repeat in runs(learn)[..learn.repeats * each].chunks(each) {
            let own: BTreeSet<usize> = repeat.iter().filter_map(kinds).collect();
            assert_eq!(own.len(), each, "one actuator for each kind at each intensity");
        }
    }

    #[test]
    fn in_closed_loop_every_fault_of_the_system_begins_at_half_and_full_intensity() {
        let study = Study::default();
        let effects = study.suite(EFFECTS).unwrap();
        let runs = runs(&study, effects, &(0..1));
        let faults = study.system.all_faults().len();
        assert_eq!(runs.len(), 2 * faults + 1);
        let middle = study.flights.as_ref().unwrap().onset_s.iter().sum::<f64>() / 2.0;
        for (place, run) in runs[..2 * faults].iter().enumerate() {
            let intensity = [0.5, 1.0][place % 2];
            assert_eq!((run.fault, run.intensity), (Some(place / 2), intensity));
            assert_eq!((run.onset_s, run.profile, run.environment), (middle, Profile::Step, 0));
        }
        assert!(runs[2 * faults].is_healthy());
        let environments = study.environments(effects, 0..1).unwrap();
        assert_eq!(environments[0].name, study.cases[0].name);
    }

    #[test]
    fn a_run_is_the_same_among_others_and_by_its_name() {
        let study = Study::default();
        let judge = study.suite(JUDGE).unwrap();
        let all = runs(&study, judge, &(0..judge.environments));
        assert_eq!(all.len(), count(&study, judge));
        for one in &runs(&study, judge, &(3..5)) {
            assert_eq!(one, &all[one.number]);
        }
        let name = RunName { suite: "judge".into(), number: 17, scenario: Scenario::Realistic };
        assert_eq!(name.to_string(), "judge#17@realistic");
        assert_eq!(name.to_string().parse(), Ok(name));
        assert!("judge#x@realistic".parse::<RunName>().is_err());
    }
}
