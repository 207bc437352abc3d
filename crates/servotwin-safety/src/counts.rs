//! Counts of outcomes, as fault trees and the failure rate of the function read them.
//!
//! A fault is *hidden* in a flight if no action answers it, or no sensor shows it. The test on the ground *passes* it
//! if it reports no fault; a test in an invalid environment is repeated. Both fly the same faults at the same
//! intensities; flight and test number k of a fault at an intensity make a pair.

use crate::interval::{CountedValue, clopper_pearson, poisson_rate_per_h};
use crate::results::StudyResultsFolder;
use servotwin::job::{Folder, JobError, outcomes};
use servotwin::measure::flights::{FlightMetrics, STRONG};
use servotwin::measure::outcome::{FirstAction, RunOutcome};
use servotwin::measure::{Measure, OTHER_ACTION, RIGHT_ACTION_OF_ALL, VISIBLE, WRONG_SHUTDOWN};
use servotwin::study::Scenario;
use servotwin::study::suites::JUDGE;
use std::collections::BTreeMap;

/// The scenario of tests on the ground.
const TESTS: Scenario = Scenario::Fitted;

/// The faults whose flights are counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FaultIntensities {
    All,
    /// From [`STRONG`] on.
    Strong,
    /// Below it.
    Weak,
}

/// What became of a fault that needs an action.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Answer {
    /// The right action was not the first one.
    Missed,
    /// Nothing was raised, or nothing was visible.
    Hidden,
    /// It was hidden and tested on the ground, and the test passed it.
    Passed,
    /// Nothing was visible.
    Invisible,
    /// Another action was raised for the right actuator.
    OtherAction,
    /// Another actuator was shut down.
    WrongShutdown,
}

/// Judged flights of one suite and scenario.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct JudgedFlights {
    /// What was flown, in words.
    pub title: String,
    /// The finished flights with a fault.
    pub faults: Vec<RunOutcome>,
    /// Hours without a fault, and the shutdowns in them.
    pub healthy: (f64, u64),
    /// For each of `faults`, whether a test on the ground passes it, if it was tested; `None` without tests.
    pub passed: Option<Vec<Option<bool>>>,
}

impl JudgedFlights {
    /// The flights behind some figures of merit.
    ///
    /// # Errors
    /// There is no file of their outcomes, or it is damaged.
    pub(crate) fn read(folder: &Folder, metrics: &FlightMetrics) -> Result<Self, JobError> {
        let group = &metrics.group;
        let scenario = Scenario::named(&group.scenario).unwrap_or(TESTS);
        let place = (folder, group.suite.as_str(), scenario);
        let mut faults = judged(place, "study --suite flights")?;
        faults.retain(|row| row.is_finished && row.onset_s.is_some());
        let healthy = (metrics.healthy.hours, metrics.healthy.shutdowns);
        Ok(JudgedFlights { title: metrics.title(), faults, healthy, passed: None })
    }

    /// The same flights with the tests of a folder.
    ///
    /// # Errors
    /// The folder has no tests, or they are damaged.
    pub(crate) fn tested_in(self, folder: &Folder) -> Result<Self, JobError> {
        let tests = judged((&folder.ground_test(), JUDGE, TESTS), "test")?;
        Ok(self.with_tests(&tests))
    }

    /// The same flights with the tests of their faults on the ground.
    #[must_use]
    pub fn with_tests(self, tests: &[RunOutcome]) -> Self {
        let mut of_fault: BTreeMap<(&str, u64), Vec<&RunOutcome>> = BTreeMap::new();
        for test in tests.iter().filter(|test| test.is_finished) {
            of_fault.entry(key(test)).or_default().push(test);
        }
        let mut flown: BTreeMap<(&str, u64), usize> = BTreeMap::new();
        let passed = self.faults.iter().map(|flight| {
            let place = flown.entry(key(flight)).or_default();
            let test = of_fault.get(&key(flight)).map(|tests| tests[*place % tests.len()]);
            *place += 1;
            test.map(|test| !test.reports_fault())
        });
        let passed = Some(passed.collect());
        JudgedFlights { passed, ..self }
    }

    /// How many faults that need an action got an answer, and of how many: those that were flown, or tested.
    pub(crate) fn count(
        &self,
        (action, intensities): (&str, FaultIntensities),
        answer: Answer,
    ) -> [u64; 2] {
        let is_meant = |row: &RunOutcome| match intensities {
            FaultIntensities::All => true,
            FaultIntensities::Strong => row.intensity >= STRONG,
            FaultIntensities::Weak => row.intensity < STRONG,
        };
        let is_own = |row: &RunOutcome| row.action == action && is_meant(row);
        let own = self.faults.iter().filter(|row| is_own(row));
        let counts = |measure: &Measure| measure.count(own.clone());
        let [visible, flown] = counts(&VISIBLE);
        match answer {
            Answer::Missed => [flown - counts(&RIGHT_ACTION_OF_ALL)[0], flown],
            Answer::Hidden => [own.clone().filter(|row| is_hidden(row)).count() as u64, flown],
            Answer::Invisible => [flown - visible, flown],
            Answer::OtherAction => [counts(&OTHER_ACTION)[0], flown],
            Answer::WrongShutdown => [counts(&WRONG_SHUTDOWN)[0], flown],
            Answer::Passed => {
                let tested = self.passed.iter().flatten().zip(&self.faults);
                let tested = tested.filter(|(_, row)| is_own(row) && is_hidden(row));
                let passed: Vec<bool> = tested.filter_map(|(passed, _)| *passed).collect();
                [passed.iter().filter(|passed| **passed).count() as u64, passed.len() as u64]
            }
        }
    }

    /// The share of the faults that need an action and get an answer, and its evidence.
    pub(crate) fn share(
        &self,
        faults: (&str, FaultIntensities),
        answer: Answer,
        confidence: f64,
    ) -> (CountedValue, String) {
        let [count, of] = self.count(faults, answer);
        let evidence = match (answer, of) {
            (Answer::Passed, 0) => "no test of a hidden fault, so nothing is known".into(),
            (Answer::Passed, _) => {
                format!("{count} of {of} tests, outcomes-judge-*.parquet of both")
            }
            (_, 0) => "not flown, so nothing is known".into(),
            _ => format!("{count} of {of} flights, flights.json, scenario {}", self.title),
        };
        (clopper_pearson(count, of, confidence), evidence)
    }

    /// Shutdowns of healthy lanes by false alarms, per hour of a lane, with their evidence.
    pub(crate) fn false_shutdowns_per_h(
        &self,
        lanes: usize,
        confidence: f64,
    ) -> (CountedValue, String) {
        let (hours, shutdowns) = self.healthy;
        // Every healthy hour was an hour of all lanes.
        let hours = hours * lanes as f64;
        let value = match hours > 0.0 {
            true => poisson_rate_per_h(shutdowns, hours, confidence),
            // Without hours nothing is known; a rate of 1/h stands for that.
            false => CountedValue { point: 1.0, low: 0.0, high: 1.0 },
        };
        let evidence = format!(
            "shutdowns of healthy lanes: {shutdowns} in {hours:.3} h of lanes, flights.json, scenario {}",
            self.title
        );
        (value, evidence)
    }
}

/// Whether no action answers a fault, or no sensor shows it.
fn is_hidden(row: &RunOutcome) -> bool {
    row.visible_s.is_none() || row.first == FirstAction::None
}

/// The fault and the bits of its intensity.
fn key(outcome: &RunOutcome) -> (&str, u64) {
    (&outcome.event, outcome.intensity.to_bits())
}

/// The judged outcomes of a suite in a folder; without any, `command` makes them.
fn judged(
    (folder, suite, scenario): (&Folder, &str, Scenario),
    command: &'static str,
) -> Result<Vec<RunOutcome>, JobError> {
    let path = folder.outcomes(suite, scenario.name());
    let stored = outcomes::stored(folder, suite, scenario)?;
    Ok(stored.ok_or(JobError::Missing { path, command })?.outcomes)
}

/// The judged tests on the ground of a folder; none if there are none.
///
/// # Errors
/// The file is damaged.
pub(crate) fn tests(results: &StudyResultsFolder) -> Result<Vec<RunOutcome>, JobError> {
    let stored = outcomes::stored(&results.folder.ground_test(), JUDGE, TESTS)?;
    Ok(stored.map_or(vec![], |own| own.outcomes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use servotwin::measure::outcome::Word;

    #[test]
    fn hidden_faults_are_paired_with_their_tests() {
        let fault = |intensity: f64, word: Word, first: FirstAction| RunOutcome {
            event: "actuator_1.leakage_a.leakage".into(),
            action: "shut_down".into(),
            intensity,
            onset_s: Some(1.0),
            visible_s: Some(0.5),
            is_finished: true,
            word,
            first,
            ..RunOutcome::default()
        };
        let found = |intensity| fault(intensity, Word::Actuator, FirstAction::Right);
        let silent = |intensity| fault(intensity, Word::Healthy, FirstAction::None);
        let flights = vec![silent(0.1), silent(0.2), found(0.7), silent(0.7), silent(0.4)];
        let invalid = fault(0.2, Word::EnvironmentInvalid, FirstAction::None);
        let tests = [found(0.1), invalid, silent(0.7), found(0.7)];
        let flights = JudgedFlights { faults: flights, ..JudgedFlights::default() };
        let flights = flights.with_tests(&tests);
        let of = |intensities| {
            let count = |answer| flights.count(("shut_down", intensities), answer);
            let [[missed, flown], [hidden, _]] = [Answer::Missed, Answer::Hidden].map(count);
            let [passed, tested] = count(Answer::Passed);
            [flown, missed, hidden, tested, passed]
        };
        // The fault of intensity 0.4 was never tested; the second flight of 0.7 has the second test.
        assert_eq!(of(FaultIntensities::All), [5, 4, 4, 3, 1]);
        assert_eq!(of(FaultIntensities::Weak), [3, 3, 3, 2, 1]);
        assert_eq!(of(FaultIntensities::Strong), [2, 1, 1, 1, 0]);
        for answer in [Answer::Missed, Answer::Hidden, Answer::Passed, Answer::Invisible] {
            assert_eq!(flights.count(("change_mode", FaultIntensities::All), answer), [0, 0]);
        }
    }
}
