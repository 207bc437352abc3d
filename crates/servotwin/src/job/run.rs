//! The whole main job in one call: campaigns, flights, training and evaluation.
//!
//! ```no_run
//! use servotwin::prelude::*;
//!
//! let study = Study::read("my_study.toml")?;
//! let results = study.run("out")?;
//! let trees = results.trees(Scenario::Noise)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use super::flights::{Crew, FlightResults};
use super::folder::{Folder, Kept};
use super::hold::Hold;
use super::results::SubjectResult;
use super::{JobError, Results, Subject};
use super::{data_card, flights, manifest, subjects, train_and_evaluate};
use crate::campaign::{Campaign, CampaignError, CampaignOutcome};
use crate::parallel::Workers;
use crate::study::{Purpose, Scenario, Study};
use crate::table::{self, Table};
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
    /// A campaign has simulated some of its rows.
    Rows {
        /// The running campaign.
        campaign: &'e Campaign<'e>,
        /// The number of simulated rows.
        done: usize,
        /// The number of all rows.
        all: usize,
    },
    /// A campaign has ended.
    Simulated {
        /// The finished campaign.
        campaign: &'e Campaign<'e>,
        /// What the campaign counted.
        outcome: &'e CampaignOutcome,
    },
    /// A stage begins.
    Began {
        /// The number of the stage, from 1.
        stage: usize,
        /// The number of stages.
        of: usize,
    },
    /// Flights are being simulated.
    Flying {
        /// The task at hand.
        what: &'e str,
        /// The share of all work that is done, from 0 to 1.
        share: f64,
    },
    /// The flights are simulated and evaluated.
    Flown(&'e FlightResults),
    /// Trees and boosted trees are being trained and evaluated.
    Evaluating {
        /// The task at hand.
        what: &'e str,
        /// The share of all work that is done, from 0 to 1.
        share: f64,
    },
    /// The scenarios simulated so far are evaluated, and their results written.
    Evaluated {
        /// The results so far.
        results: &'e Results,
        /// The number of stages that follow.
        remaining: usize,
    },
}

/// Options of a study's run; see [`RunStudy::run`] for the usual way.
pub struct StudyRun<'r> {
    /// The study.
    pub study: &'r Study,
    /// The output folder.
    pub folder: Folder,
    /// Whether to remove another study's results from the folder.
    pub replace: bool,
    /// Whether to simulate the fitted scenario, too.
    pub fitted: bool,
    /// The only scenario to simulate, beside those that the folder has.
    pub only: Option<Scenario>,
    /// The threads, and their cancellation.
    pub workers: Workers<'r>,
    /// Called at every event, from several threads.
    pub observer: &'r (dyn Fn(&StudyEvent) + Sync),
}

/// The results of a study, in its output folder.
#[derive(Debug)]
pub struct StudyResults {
    folder: Folder,
    /// The results of the evaluation, by scenario and protocol.
    pub evaluation: Results,
    /// The results of the flights; `None` for a study without flights.
    pub flights: Option<FlightResults>,
    /// The lock that keeps other processes from writing into the folder while the caller of [`RunStudy::run`] holds the
    /// results.
    _hold: Option<Hold>,
}

/// Runs a whole study with one call, `study.run("out")`.
///
/// [`Study`] is a type of `servotwin-system`, which knows neither training nor evaluation.
/// The prelude brings this trait with it.
pub trait RunStudy {
    /// Runs the whole study on all processors: simulates, trains and evaluates, and writes all results into a folder.
    /// `servotwin_report::write` turns them into one HTML file.
    /// An interrupted study resumes where it stopped and gives the same bytes.
    ///
    /// # Errors
    /// The folder belongs to another study or cannot be written; a stage fails.
    fn run(&self, out: impl AsRef<Path>) -> Result<StudyResults, JobError>;
}

impl RunStudy for Study {
    fn run(&self, out: impl AsRef<Path>) -> Result<StudyResults, JobError> {
        StudyRun::new(self, out).run()
    }
}

impl<'r> StudyRun<'r> {
    /// Runs with all processors, the usual scenarios and no observer.
    pub fn new(study: &'r Study, out: impl AsRef<Path>) -> Self {
        StudyRun {
            study,
            folder: Folder::new(out.as_ref()),
            replace: false,
            fitted: false,
            only: None,
            workers: Workers::all(),
            observer: &|_| {},
        }
    }

    /// Runs every stage. Each group of scenarios is simulated and evaluated before the next, so that results appear
    /// early. Flights come last.
    ///
    /// # Errors
    /// As [`RunStudy::run`]; [`CampaignError::Cancelled`].
    pub fn run(&self) -> Result<StudyResults, JobError> {
        let study = self.study;
        let named = self.only.or(self.fitted.then_some(Scenario::Fitted));
        if let Some(scenario) = named.filter(|scenario| !scenario.is_possible(study)) {
            return Err(CampaignError::no_section(scenario, study).into());
        }
        let Kept { hold, dropped } = self.folder.keep_study(study, self.replace)?;
        if dropped > 0 {
            (self.observer)(&StudyEvent::Removed { files: dropped });
        }
        // What was measured and cannot be read is told before anything is simulated.
        let before = flights::results(&self.folder)?;
        let mut flown = flights::scenarios(study);
        flown.retain(|scenario| self.only.is_none_or(|only| only == *scenario));
        let flies = study.flights.is_some() && study.is_full && !flown.is_empty();
        let (evaluation, stages) = self.scenarios(usize::from(flies))?;
        self.check()?;
        let flights = if flies {
            (self.observer)(&StudyEvent::Began { stage: stages, of: stages });
            Some(self.fly(&flown)?)
        } else {
            before
        };
        self.check()?;
        Ok(StudyResults { folder: self.folder.clone(), evaluation, flights, _hold: Some(hold) })
    }

    /// Simulates and evaluates all scenarios, the easiest first. Returns the results and the number of stages including
    /// the `following` ones.
    fn scenarios(&self, following: usize) -> Result<(Results, usize), JobError> {
        let study = self.study;
        let is_wanted = |scenario: Scenario| {
            let is_there = || self.folder.data_set(scenario, Purpose::Test).exists();
            let is_named = match self.only {
                Some(only) => scenario == only,
                None => scenario.is_usual() || self.fitted,
            };
            is_named || is_there()
        };
        let groups = Scenario::groups(study, is_wanted);
        let of = groups.len() * (study.purposes().len() + 1) + following;
        let mut stage = 0;
        let mut begin = || {
            stage += 1;
            (self.observer)(&StudyEvent::Began { stage, of });
            stage
        };
        let mut evaluated = vec![];
        let mut results = Results::new(study, vec![]);
        for scenarios in groups {
            for purpose in study.purposes() {
                begin();
                self.simulate(purpose, scenarios.clone())?;
            }
            self.check()?;
            let stage = begin();
            evaluated.extend(self.evaluate(&scenarios)?);
            results = super::write_results(&self.folder, study, evaluated.clone())?;
            data_card::write(&self.folder, study)?;
            manifest::write(&self.folder, study)?;
            let remaining = of - stage;
            (self.observer)(&StudyEvent::Evaluated { results: &results, remaining });
        }
        Ok((results, of))
    }

    fn check(&self) -> Result<(), JobError> {
        match self.workers.is_cancelled() {
            true => Err(CampaignError::Cancelled.into()),
            false => Ok(()),
        }
    }

    fn simulate(&self, purpose: Purpose, scenarios: Vec<Scenario>) -> Result<(), JobError> {
        let campaign = Campaign {
            workers: self.workers,
            ..Campaign::new(self.folder.path(), self.study, scenarios, purpose)
        };
        let rows = |done, all| {
            (self.observer)(&StudyEvent::Rows { campaign: &campaign, done, all });
        };
        let outcome = campaign.run(rows)?;
        (self.observer)(&StudyEvent::Simulated { campaign: &campaign, outcome: &outcome });
        Ok(())
    }

    fn fly(&self, scenarios: &[Scenario]) -> Result<FlightResults, JobError> {
        let progress =
            |what: &str, share: f64| (self.observer)(&StudyEvent::Flying { what, share });
        let crew = Crew { workers: self.workers, progress: &progress };
        let results = flights::fly_all(&self.folder, self.study, scenarios, &crew)?;
        (self.observer)(&StudyEvent::Flown(&results));
        Ok(results)
    }

    fn evaluate(&self, scenarios: &[Scenario]) -> Result<Vec<SubjectResult>, JobError> {
        let progress =
            |what: &str, share: f64| (self.observer)(&StudyEvent::Evaluating { what, share });
        let mut subjects = subjects(&self.folder, self.study)?;
        subjects.retain(|subject| scenarios.contains(&subject.scenario()));
        train_and_evaluate(&self.folder, self.study, &subjects, self.workers, &progress)
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
        table::read(&path).map_err(|error| JobError::DataSet { path, error: error.into() })
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
