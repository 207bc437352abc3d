//! Closed-loop flights as evidence: the outcomes of the suite [`EFFECTS`] in the quoted scenario.

use super::can_fly;
use crate::error::SafetyError;
use crate::results::{EvidenceBasis, StudyResultsFolder};
use servotwin::job::outcomes::{self, Basis};
use servotwin::job::{Crew, Job};
use servotwin::measure::outcome::RunOutcome;
use servotwin::parallel::Workers;
use servotwin::study::suites::EFFECTS;

/// The flights of a folder.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FmeaFlights {
    /// One outcome for each fault and intensity, and that of the healthy flight.
    pub(crate) outcomes: Vec<RunOutcome>,
    /// The operating case that was flown.
    pub(crate) case: String,
    /// The scenario of the diagnoser.
    pub(crate) scenario: String,
    /// What changed since the flights; `None` if they are of this model.
    pub(crate) stale: Option<String>,
}

impl FmeaFlights {
    /// The file of the flights.
    pub(crate) fn file(&self) -> String {
        format!("outcomes-{EFFECTS}-{}.parquet", self.scenario)
    }

    /// The finished flights of a fault.
    pub(crate) fn of(&self, fault: &str) -> Vec<&RunOutcome> {
        let is_own = |own: &&RunOutcome| own.event == fault && own.is_finished;
        self.outcomes.iter().filter(is_own).collect()
    }

    /// The healthy flight.
    pub(crate) fn healthy(&self) -> Option<&RunOutcome> {
        self.outcomes.iter().find(|own| own.onset_s.is_none() && own.is_finished)
    }

    /// The flights of the quoted scenario; `None` if there are none. If it `flies`, those that are missing or of
    /// another basis are flown first, where there is a diagnoser.
    ///
    /// # Errors
    /// The file is damaged or cannot be written; the healthy flight cannot be simulated.
    pub(crate) fn of_folder(
        results: &StudyResultsFolder,
        flies: bool,
        workers: Workers,
    ) -> Result<Option<Self>, SafetyError> {
        let StudyResultsFolder { folder, study, scenario, .. } = results;
        let flown = match study.suite(EFFECTS) {
            Some(suite) if flies && can_fly(results) => {
                let job = Job { crew: Crew::quiet(workers), ..Job::new(study, folder) };
                Some(job.fly(suite, *scenario)?)
            }
            _ => outcomes::stored(folder, EFFECTS, *scenario)?,
        };
        let Some(flown) = flown else { return Ok(None) };
        let stale = match can_fly(results) {
            true => {
                let now = Basis::of(folder, study, *scenario)?;
                basis(now).changes_since(&basis(flown.basis))
            }
            false => Some("the model changed".into()),
        };
        let (case, scenario) = (study.cases[0].name.clone(), flown.scenario);
        Ok(Some(FmeaFlights { outcomes: flown.outcomes, case, scenario, stale }))
    }
}

/// The basis of flights in the words of a sheet.
fn basis(own: Basis) -> EvidenceBasis {
    let Basis { system_sha256: system, study_sha256: study, diagnoser_sha256: model, .. } = own;
    EvidenceBasis { system, study, model }
}
