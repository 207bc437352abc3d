//! The whole main job in one call: records, flights, training and evaluation.
//!
//! ```no_run
//! use servotwin::prelude::*;
//!
//! let study = Study::read("my_study.toml")?;
//! let results = study.run("out")?;
//! let trees = results.trees(Scenario::Noise)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use super::flights::FlightResults;
use super::folder::{Folder, Kept};
use super::hold::Hold;
use super::{Job, JobError, Results, Subject, data_card, flights, manifest, subjects};
use crate::records::{RecordsOutcome, RunError};
use crate::study::{Purpose, Scenario, Study};
use crate::table::Table;
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_diagnosis::hierarchy::Hierarchy;
use std::path::Path;

/// An event while a study runs.
pub enum StudyEvent<'e> {
    /// Results of an earlier version of the study were removed from the folder.
    Removed {
        /// The number of removed files.
        files: usize,
    },
    /// Records are simulated.
    Simulated(&'e RecordsOutcome),
    /// The scenarios simulated so far are evaluated, and their results written.
    Evaluated {
        /// The results so far.
        results: &'e Results,
        /// The number of stages that follow.
        remaining: usize,
    },
    /// The flights are simulated and evaluated.
    Flown(&'e FlightResults),
}

/// Options of a study's run; see [`Study::run`] for the usual way.
pub struct StudyRun<'r> {
    /// The study, its output folder, and who works on it. Every task begins with the number of its stage among all.
    pub job: Job<'r>,
    /// Whether to remove another study's results from the folder.
    pub replace: bool,
    /// Whether to simulate the fitted scenario, too.
    pub fitted: bool,
    /// The only scenario to simulate, beside those that the folder has.
    pub only: Option<Scenario>,
    /// Called at every event.
    pub observer: &'r dyn Fn(&StudyEvent),
}

/// The results of a study, in its output folder.
#[derive(Debug)]
pub struct StudyResults {
    folder: Folder,
    /// The results of the evaluation, by scenario and protocol.
    pub evaluation: Results,
    /// The results of the flights; `None` for a study without flights.
    pub flights: Option<FlightResults>,
    /// The lock that keeps other processes from writing into the folder while the caller of [`Study::run`] holds the
    /// results.
    _hold: Option<Hold>,
}

impl Study {
    /// Runs the whole study on all processors: simulates, trains and evaluates, and writes all results into a folder.
    /// `servotwin_report::write` turns them into one HTML file.
    /// An interrupted study resumes where it stopped and gives the same bytes.
    ///
    /// # Errors
    /// The folder belongs to another study or cannot be written; a stage fails.
    pub fn run(&self, out: impl AsRef<Path>) -> Result<StudyResults, JobError> {
        StudyRun::new(Job::new(self, &Folder::new(out.as_ref()))).run()
    }
}

impl<'r> StudyRun<'r> {
    /// Runs the usual scenarios without an observer.
    pub fn new(job: Job<'r>) -> Self {
        StudyRun { job, replace: false, fitted: false, only: None, observer: &|_| {} }
    }

    /// Runs every stage. Each group of scenarios is simulated and evaluated before the next, so that results appear
    /// early. Flights come last.
    ///
    /// # Errors
    /// As [`Study::run`]; [`RunError::Cancelled`].
    pub fn run(&self) -> Result<StudyResults, JobError> {
        let Job { study, folder, .. } = self.job;
        let named = self.only.or(self.fitted.then_some(Scenario::Fitted));
        named.map_or(Ok(()), |scenario| RunError::check(scenario, study))?;
        let Kept { hold, dropped } = folder.keep_study(study, self.replace)?;
        if dropped > 0 {
            (self.observer)(&StudyEvent::Removed { files: dropped });
        }
        // What was measured and cannot be read is told before anything is simulated.
        let before = flights::results(folder)?;
        let mut flown = flights::scenarios(study);
        flown.retain(|scenario| self.only.is_none_or(|only| only == *scenario));
        let flies = study.flights.is_some() && study.is_full && !flown.is_empty();
        let (evaluation, stages) = self.scenarios(usize::from(flies))?;
        self.job.check()?;
        let flights = if flies {
            let flights = self.stage([stages; 2], |job| job.fly_all(&flown))?;
            (self.observer)(&StudyEvent::Flown(&flights));
            Some(flights)
        } else {
            before
        };
        self.job.check()?;
        Ok(StudyResults { folder: folder.clone(), evaluation, flights, _hold: Some(hold) })
    }

    /// Simulates and evaluates all scenarios, the easiest first. Returns the results and the number of stages including
    /// the `following` ones.
    fn scenarios(&self, following: usize) -> Result<(Results, usize), JobError> {
        let Job { study, folder, .. } = self.job;
        let is_wanted = |scenario: Scenario| {
            let is_there = || folder.data_set(scenario, Purpose::Test).exists();
            let is_named = match self.only {
                Some(only) => scenario == only,
                None => scenario.is_usual() || self.fitted,
            };
            is_named || is_there()
        };
        let groups = Scenario::groups(study, is_wanted);
        let of = groups.len() * (study.purposes().len() + 1) + following;
        let mut stage = 0;
        let mut evaluated = vec![];
        let mut results = Results::new(study, vec![]);
        for scenarios in groups {
            for purpose in study.purposes() {
                stage += 1;
                let records =
                    self.stage([stage, of], |j| j.simulate_records(purpose, scenarios.clone()))?;
                (self.observer)(&StudyEvent::Simulated(&records));
            }
            self.job.check()?;
            stage += 1;
            let mut subjects = subjects(folder, study)?;
            subjects.retain(|subject| scenarios.contains(&subject.scenario()));
            evaluated.extend(self.stage([stage, of], |job| job.train_and_evaluate(&subjects))?);
            results = self.job.write_results(evaluated.clone())?;
            data_card::write(folder, study)?;
            manifest::write(folder, study)?;
            let remaining = of - stage;
            (self.observer)(&StudyEvent::Evaluated { results: &results, remaining });
        }
        Ok((results, of))
    }

    /// Works on a stage, given by its number among all.
    fn stage<T>(&self, [stage, of]: [usize; 2], work: impl FnOnce(&Job) -> T) -> T {
        let job = self.job;
        work(&job.told(&|what, share| job.tell(&format!("{stage}/{of} {what}"), share)))
    }
}

impl StudyResults {
    /// Reads the results of a study from its output folder. Other processes may write there meanwhile.
    ///
    /// # Errors
    /// The folder has neither an evaluation nor flights, or one of its files is damaged.
    pub fn read(out: impl AsRef<Path>) -> Result<Self, JobError> {
        let folder = Folder::new(out.as_ref());
        folder.read_study()?;
        let (evaluation, flights) = (Results::read(&folder)?, flights::results(&folder)?);
        Ok(StudyResults { folder, evaluation, flights, _hold: None })
    }

    /// The output folder.
    pub fn folder(&self) -> &Folder {
        &self.folder
    }

    /// The data card of the folder's data sets; `None` without data sets.
    ///
    /// # Errors
    /// It cannot be read, or contradicts the manifest.
    pub fn data_card(&self) -> Result<Option<String>, JobError> {
        let path = self.folder.data_card();
        if !path.exists() {
            return Ok(None);
        }
        crate::manifest::check(&path)?;
        Ok(Some(crate::files::read_text(path)?))
    }

    /// The data set of a scenario: labels and features of every simulated variant.
    ///
    /// # Errors
    /// The scenario was not simulated.
    pub fn table(&self, scenario: Scenario) -> Result<Table, JobError> {
        let path = self.folder.data_set(scenario, Purpose::Test);
        Table::read(&path).map_err(|error| JobError::DataSet { path, error: error.into() })
    }

    /// The nine trees trained in a scenario.
    ///
    /// # Errors
    /// The scenario was not simulated.
    pub fn trees(&self, scenario: Scenario) -> Result<Hierarchy, JobError> {
        Ok(super::panel(&self.folder, Subject::of(scenario))?.trees)
    }

    /// The diagnoser trained in the flights of a scenario.
    ///
    /// # Errors
    /// No flights were flown in this scenario.
    pub fn diagnoser(&self, scenario: Scenario) -> Result<Diagnoser, JobError> {
        flights::diagnoser(&self.folder, scenario)
    }
}
