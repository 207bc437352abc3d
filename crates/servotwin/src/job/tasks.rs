//! Parts of any suites as tasks, which machines compute in any order into one folder, or into folders of their own that are
//! copied together.

use super::flights::{self, FlightResults};
use super::{Job, JobError, data_card, manifest, outcomes};
use crate::flight::watched;
use crate::learn::training_windows;
use crate::records::{RecordsOutcome, RunError, calibration_file, runs, title};
use crate::run::part;
use crate::study::suites::{FLIGHTS, HARD_NEGATIVES, LEARN, RECORDS};
use crate::study::{Purpose, Scenario, Study, Suite};
use std::iter::once;
use std::path::PathBuf;
use std::slice::from_ref;

/// A part of a suite. Tasks with the same needs may run at the same time, behind those that come before.
#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    /// The suite, by its name.
    pub suite: String,
    /// The scenarios that its simulations serve.
    pub scenarios: Vec<Scenario>,
    /// The number of the part.
    pub part: usize,
    /// The files that it writes, relative to the output folder.
    pub files: Vec<String>,
    /// The number of its runs in all scenarios.
    pub runs: usize,
    /// The files that must be there before, relative to the output folder; [`Job::prepare`] writes them.
    pub needs: Vec<String>,
}

/// The names of suites whose tasks a study has: all records, all flights, and each suite of flights.
fn known(study: &Study) -> impl Iterator<Item = &str> {
    let flown = study.suites().filter(|suite| suite.purpose != Purpose::Tune);
    [RECORDS, FLIGHTS].into_iter().chain(flown.map(|suite| suite.name.as_str()))
}

impl<'j> Job<'j> {
    /// A suite of records or flights whose runs are tasks.
    ///
    /// # Errors
    /// [`JobError::NoSuite`].
    pub fn suite(&self, name: &str) -> Result<&'j Suite, JobError> {
        let changed = self.changed.iter().find(|suite| suite.name == name);
        let suite = changed.or_else(|| self.study.suite(name));
        suite.filter(|suite| suite.purpose != Purpose::Tune).ok_or_else(|| JobError::NoSuite {
            name: name.into(),
            known: known(self.study).collect::<Vec<_>>().join(", "),
        })
    }

    /// The scenarios of flights that are wanted.
    fn flown(&self, wanted: impl Fn(Scenario) -> bool) -> Vec<Scenario> {
        let mut scenarios = flights::scenarios(self.study);
        scenarios.retain(|&scenario| wanted(scenario));
        scenarios
    }

    /// The tasks of some suites in those of the scenarios that they have, in an order in which they can run. [`RECORDS`]
    /// stands for all suites of records, [`FLIGHTS`] for the flights to learn from and every suite that is not on request.
    ///
    /// # Errors
    /// [`JobError::NoSuite`]; a scenario lacks sections of the study.
    pub fn tasks(
        &self,
        suites: &[String],
        scenarios: impl Fn(Scenario) -> bool,
    ) -> Result<Vec<Task>, JobError> {
        let study = self.study;
        let flown = self.flown(&scenarios);
        let mut tasks = vec![];
        for name in suites {
            match name.as_str() {
                RECORDS => tasks.extend(self.of_records(&scenarios)?),
                FLIGHTS => {
                    flights::flights(study)?;
                    tasks.extend(
                        self.of_suites(study.training_suites().chain(study.usual_suites()), &flown),
                    );
                }
                name => tasks.extend(self.of_suites(once(self.suite(name)?), &flown)),
            }
        }
        Ok(tasks)
    }

    fn of_records(&self, scenarios: impl Fn(Scenario) -> bool) -> Result<Vec<Task>, JobError> {
        let mut tasks = vec![];
        for (purpose, scenarios) in self.records_in(scenarios)? {
            let records = self.records(purpose, scenarios.clone())?;
            tasks.extend((0..records.part_count()).map(|part| Task {
                suite: records.suite.name.clone(),
                scenarios: scenarios.clone(),
                part,
                files: records.files_of(part),
                runs: records.rows_of(part),
                needs: records.calibration().into_iter().collect(),
            }));
        }
        Ok(tasks)
    }

    fn of_suites<'s>(
        &self,
        suites: impl Iterator<Item = &'s Suite>,
        scenarios: &[Scenario],
    ) -> Vec<Task> {
        let all = flights::in_scenarios(suites, scenarios).into_iter();
        all.flat_map(|(suite, scenario)| self.of_suite(suite, scenario)).collect()
    }

    fn of_suite(&self, suite: &Suite, scenario: Scenario) -> Vec<Task> {
        let folder = self.folder;
        let (stem, needs) = match suite.name.as_str() {
            HARD_NEGATIVES => (
                training_windows::stem(suite, scenario),
                vec![folder.spreads(scenario), folder.bands(scenario)],
            ),
            LEARN => (training_windows::stem(suite, scenario), vec![folder.spreads(scenario)]),
            _ => (outcomes::stem(suite, scenario), vec![folder.diagnoser(scenario)]),
        };
        let inside = |path: PathBuf| {
            let path = path.strip_prefix(folder.path()).expect("a file of the folder");
            path.to_string_lossy().into_owned()
        };
        let needs: Vec<String> = needs.into_iter().map(inside).collect();
        let task = |(part, runs): (usize, Vec<usize>)| Task {
            suite: suite.name.clone(),
            scenarios: vec![scenario],
            part,
            files: vec![part::file_name(&stem, part)],
            runs: runs.len(),
            needs: needs.clone(),
        };
        watched::parts(self.study, suite).into_iter().enumerate().map(task).collect()
    }

    /// Computes those files of tasks that are absent or unusable, in the order of the tasks. What they need that is not
    /// trained is prepared with them.
    ///
    /// # Errors
    /// What a task needs is missing; a run cannot begin; a file cannot be written;
    /// [`Cancelled`](crate::records::RunError::Cancelled).
    pub fn run(&self, tasks: &[Task]) -> Result<(), JobError> {
        let all: usize = tasks.iter().map(|task| task.runs).sum();
        let mut done = 0;
        // The parts of a suite in a scenario fly together.
        for alike in tasks.chunk_by(|a, b| (&a.suite, &a.scenarios) == (&b.suite, &b.scenarios)) {
            let runs: usize = alike.iter().map(|task| task.runs).sum();
            let told = |what: &str, share: f64| {
                self.tell(what, (done as f64 + share * runs as f64) / all.max(1) as f64);
            };
            let parts: Vec<usize> = alike.iter().map(|task| task.part).collect();
            self.told(&told).run_parts((&alike[0].suite, &alike[0].scenarios), &parts)?;
            done += runs;
        }
        Ok(())
    }

    /// Computes parts of a suite in scenarios with the same plants.
    fn run_parts(
        &self,
        (suite, scenarios): (&str, &[Scenario]),
        parts: &[usize],
    ) -> Result<(), JobError> {
        let mut of_records = Purpose::OF_RECORDS.into_iter();
        if let Some(purpose) = of_records.find(|&own| self.study.records(own).name == suite) {
            let records = self.records(purpose, scenarios.to_vec())?;
            records.run_parts(parts, &self.rows_of(suite))?;
            return Ok(());
        }
        let suite = self.suite(suite)?;
        match suite.purpose {
            Purpose::Train => self.fly_to_learn((suite, scenarios[0]), parts),
            _ => self.fly_parts((suite, scenarios[0]), parts),
        }
    }

    /// Reports how many rows of records are simulated.
    fn rows_of<'c>(&'c self, what: &'c str) -> impl Fn(usize, usize) + Sync + 'c {
        move |done, all| self.tell(what, done as f64 / all.max(1) as f64)
    }

    /// Writes a file that tasks need, unless it is there.
    ///
    /// # Errors
    /// Parts of the flights that it comes from are missing; the work behind it fails; the file cannot be written.
    pub fn prepare(&self, file: &str) -> Result<(), JobError> {
        let Job { study, folder, .. } = *self;
        let path = folder.path().join(file);
        for purpose in Purpose::OF_RECORDS {
            if path == calibration_file(folder.path(), purpose) {
                return Ok(self.records(purpose, vec![Scenario::Fitted])?.calibrate()?);
            }
        }
        for scenario in flights::scenarios(study) {
            if path == folder.spreads(scenario) {
                return self.design(scenario).map(drop);
            } else if path == folder.bands(scenario) {
                return self.learned_bands(&self.design(scenario)?).map(drop);
            } else if path == folder.diagnoser(scenario) {
                return self.learn(scenario).map(drop);
            }
        }
        Ok(())
    }

    /// Simulates what is missing of the records of a purpose in scenarios with the same plants, and writes their data sets.
    ///
    /// # Errors
    /// The study is empty, a twin cannot be simulated, or a file cannot be written.
    pub(super) fn simulate_records(
        &self,
        purpose: Purpose,
        scenarios: Vec<Scenario>,
    ) -> Result<RecordsOutcome, JobError> {
        let what = format!("simulating {}", title(purpose, &scenarios));
        Ok(self.records(purpose, scenarios)?.run(&self.rows_of(&what))?)
    }

    /// Runs suites and joins their parts: data sets of records, outcomes of judged flights, and their counts. [`FLIGHTS`]
    /// trains the diagnosers; other suites are flown with those that are there. Returns what was counted of records, and of
    /// flights if any were flown.
    ///
    /// # Errors
    /// As [`Job::tasks`], [`Job::run`] and [`Job::learn`].
    pub fn run_suites(
        &self,
        suites: &[String],
        scenarios: impl Fn(Scenario) -> bool,
    ) -> Result<(Vec<RecordsOutcome>, Option<FlightResults>), JobError> {
        self.complete(suites, scenarios, true)
    }

    /// Computes what is missing of some suites and joins their parts, with the diagnosers that are there.
    ///
    /// # Errors
    /// As [`Job::tasks`] and [`Job::run`].
    pub fn join(
        &self,
        suites: &[String],
        scenarios: impl Fn(Scenario) -> bool,
    ) -> Result<(), JobError> {
        self.complete(suites, scenarios, false).map(drop)
    }

    fn complete(
        &self,
        suites: &[String],
        scenarios: impl Fn(Scenario) -> bool,
        learns: bool,
    ) -> Result<(Vec<RecordsOutcome>, Option<FlightResults>), JobError> {
        let Job { study, folder, .. } = *self;
        let flown = self.flown(&scenarios);
        let (mut judged, mut simulated, mut results) = (vec![], vec![], None);
        for name in suites {
            match name.as_str() {
                RECORDS => {
                    for (purpose, scenarios) in self.records_in(&scenarios)? {
                        simulated.push(self.simulate_records(purpose, scenarios)?);
                    }
                    data_card::write(folder, study)?;
                }
                FLIGHTS if learns => results = Some(self.fly_all(&flown)?),
                FLIGHTS => judged.extend(study.usual_suites()),
                name => match self.suite(name)? {
                    suite if suite.purpose == Purpose::Test => judged.push(suite),
                    suite => self.run(&self.tasks(from_ref(&suite.name), &scenarios)?)?,
                },
            }
        }
        if !judged.is_empty() {
            results = Some(self.fly_suites(&judged, &flown)?);
        }
        manifest::write(folder, study)?;
        Ok((simulated, results))
    }

    /// The purposes and scenarios of records that are simulated together.
    fn records_in(
        &self,
        wanted: impl Fn(Scenario) -> bool,
    ) -> Result<Vec<(Purpose, Vec<Scenario>)>, JobError> {
        let all = runs(self.study, &wanted);
        if all.is_empty()
            && let Some(scenario) = Scenario::ALL.into_iter().find(|&scenario| wanted(scenario))
        {
            RunError::check(scenario, self.study)?;
        }
        Ok(all)
    }
}
