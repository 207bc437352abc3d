//! What the test on the ground finds of the faults that stay hidden in flight, counted from the outcomes of both.
//!
//! A fault is *hidden* in a flight if no action answers it, or no sensor shows it. The test on the ground *passes* it
//! if it reports no fault; a test in an invalid environment is repeated. Both fly the same faults at the same
//! intensities; flight and test number k of a fault at an intensity make a pair.

use crate::counts::FaultIntensities;
use crate::results::StudyResultsFolder;
use servotwin::flight::judge::STRONG;
use servotwin::flight::outcome::{FirstAction, FlightOutcome};
use servotwin::job::{Folder, JobError, outcomes};
use servotwin::study::Scenario;
use servotwin::study::suites::JUDGE;
use std::collections::BTreeMap;

/// The scenario of tests on the ground.
const TESTS: Scenario = Scenario::Fitted;

/// Faults that were hidden in flight, by the action that they need, and by whether they are strong.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct GroundTest(BTreeMap<(String, bool), PassedFaults>);

/// Faults that were hidden in flight.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PassedFaults {
    /// Number of those that were tested on the ground.
    pub tested: u64,
    /// Number of these that the test passed.
    pub passed: u64,
}

impl GroundTest {
    /// The counts of a folder in the quoted scenario.
    ///
    /// # Errors
    /// The folder has no judged flights, or its `ground_test` no judged tests; a file is damaged.
    pub(crate) fn read(results: &StudyResultsFolder) -> Result<Self, JobError> {
        let flights = judged(&results.folder, results.scenario, "study --suite flights")?;
        let tests = judged(&results.folder.ground_test(), TESTS, "test")?;
        Ok(Self::count(&flights, &tests))
    }

    /// Counts the outcomes of flights and of tests.
    pub fn count(flights: &[FlightOutcome], tests: &[FlightOutcome]) -> Self {
        let mut of_fault: BTreeMap<(&str, u64), Vec<&FlightOutcome>> = BTreeMap::new();
        for test in tests.iter().filter(|test| test.is_finished) {
            of_fault.entry(key(test)).or_default().push(test);
        }
        let mut flown: BTreeMap<(&str, u64), usize> = BTreeMap::new();
        let mut counts: BTreeMap<(String, bool), PassedFaults> = BTreeMap::new();
        for flight in flights.iter().filter(|flight| flight.is_finished && flight.onset_s.is_some())
        {
            let place = flown.entry(key(flight)).or_default();
            let test = of_fault.get(&key(flight)).map(|tests| tests[*place % tests.len()]);
            *place += 1;
            if let Some(test) = test.filter(|_| is_hidden(flight)) {
                let group = (flight.action.clone(), flight.intensity >= STRONG);
                let counts = counts.entry(group).or_default();
                counts.tested += 1;
                counts.passed += u64::from(!test.reports_fault());
            }
        }
        GroundTest(counts)
    }

    /// The counts of the faults that need an action.
    pub(crate) fn of(&self, action: &str, intensities: FaultIntensities) -> PassedFaults {
        let of = |is_strong| self.0.get(&(action.to_owned(), is_strong)).copied();
        let [weak, strong] = [false, true].map(|is_strong| of(is_strong).unwrap_or_default());
        match intensities {
            FaultIntensities::All => PassedFaults {
                tested: weak.tested + strong.tested,
                passed: weak.passed + strong.passed,
            },
            FaultIntensities::Strong => strong,
            FaultIntensities::Weak => weak,
        }
    }
}

/// The judged tests of a folder; none if there are none.
///
/// # Errors
/// The file is damaged.
pub(crate) fn tests(results: &StudyResultsFolder) -> Result<Vec<FlightOutcome>, JobError> {
    let stored = outcomes::stored(&results.folder.ground_test(), JUDGE, TESTS)?;
    Ok(stored.map_or(vec![], |own| own.outcomes))
}

/// The judged outcomes of a folder; without any, `command` makes them.
fn judged(
    folder: &Folder,
    scenario: Scenario,
    command: &'static str,
) -> Result<Vec<FlightOutcome>, JobError> {
    let path = folder.outcomes(JUDGE, scenario.name());
    let stored = outcomes::stored(folder, JUDGE, scenario)?;
    Ok(stored.ok_or(JobError::Missing { path, command })?.outcomes)
}

/// The fault and the bits of its intensity.
fn key(outcome: &FlightOutcome) -> (&str, u64) {
    (&outcome.event, outcome.intensity.to_bits())
}

fn is_hidden(flight: &FlightOutcome) -> bool {
    flight.visible_s.is_none() || flight.first == FirstAction::None
}

#[cfg(test)]
mod tests {
    use super::*;
    use servotwin::flight::outcome::Word;

    #[test]
    fn hidden_faults_are_paired_with_their_tests() {
        let fault = |intensity: f64, word: Word, first: FirstAction| FlightOutcome {
            event: "actuator_1.leakage_a.leakage".into(),
            action: "shut_down".into(),
            intensity,
            onset_s: Some(1.0),
            visible_s: Some(0.5),
            is_finished: true,
            word,
            first,
            ..FlightOutcome::default()
        };
        let found = |intensity| fault(intensity, Word::Actuator, FirstAction::Right);
        let silent = |intensity| fault(intensity, Word::Healthy, FirstAction::None);
        let flights = [silent(0.1), silent(0.2), found(0.7), silent(0.7), silent(0.4)];
        let invalid = fault(0.2, Word::EnvironmentInvalid, FirstAction::None);
        let tests = [found(0.1), invalid, silent(0.7), found(0.7)];
        let test = GroundTest::count(&flights, &tests);
        let of = |intensities| test.of("shut_down", intensities);
        // The fault of intensity 0.4 was never tested; the second flight of 0.7 has the second test.
        assert_eq!(of(FaultIntensities::All), PassedFaults { tested: 3, passed: 1 });
        assert_eq!(of(FaultIntensities::Weak), PassedFaults { tested: 2, passed: 1 });
        assert_eq!(of(FaultIntensities::Strong), PassedFaults { tested: 1, passed: 0 });
        assert_eq!(test.of("change_mode", FaultIntensities::All), PassedFaults::default());
    }
}
