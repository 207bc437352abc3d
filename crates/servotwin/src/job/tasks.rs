//! Parts of any suites as tasks, which machines compute in any order into one folder, or into folders of their own that are
//! copied together.

use super::flights::{self, Crew};
use super::{Folder, JobError, data_card, manifest, outcomes};
use crate::campaign::{Campaign, calibration_file, runs};
use crate::flight::{training_windows, watched};
use crate::run::part;
use crate::study::suites::{FLIGHTS, HARD_NEGATIVES, LEARN, RECORDS};
use crate::study::{Purpose, Scenario, Study, Suite};
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
    /// The files that must be there before, relative to the output folder; [`prepare`] writes them.
    pub needs: Vec<String>,
}

/// A study, and the folder of its results.
#[derive(Clone, Copy)]
pub struct Place<'p> {
    /// The study.
    pub study: &'p Study,
    /// Suites that stand in for those of the study.
    pub changed: &'p [Suite],
    /// The output folder.
    pub folder: &'p Folder,
}

impl<'p> Place<'p> {
    /// A suite of records or flights whose runs are tasks.
    fn suite(&self, name: &str) -> Result<&'p Suite, JobError> {
        let changed = self.changed.iter().find(|suite| suite.name == name);
        let suite = changed.or_else(|| self.study.suite(name));
        suite.filter(|suite| suite.purpose != Purpose::Tune).ok_or_else(|| JobError::NoSuite {
            name: name.into(),
            known: known(self.study).collect::<Vec<_>>().join(", "),
        })
    }
}

/// The names of suites whose tasks a study has: all records, all flights, and each suite of flights.
fn known(study: &Study) -> impl Iterator<Item = &str> {
    let flown = study.suites().filter(|suite| suite.purpose != Purpose::Tune);
    [RECORDS, FLIGHTS].into_iter().chain(flown.map(|suite| suite.name.as_str()))
}

/// The tasks of some suites in those of the scenarios that they have, in an order in which they can run. [`RECORDS`] stands
/// for all suites of records, [`FLIGHTS`] for the flights to learn from and every suite that is not on request.
///
/// # Errors
/// [`JobError::NoSuite`]; a scenario lacks sections of the study.
pub fn tasks(
    place: Place,
    suites: &[String],
    scenarios: impl Fn(Scenario) -> bool,
) -> Result<Vec<Task>, JobError> {
    let study = place.study;
    let mut tasks = vec![];
    for name in suites {
        match name.as_str() {
            RECORDS => tasks.extend(of_records(place, &scenarios)?),
            FLIGHTS => {
                flights::flights(study)?;
                let judged = study.suites().filter(|suite| flights::is_usual(suite));
                let taught =
                    [LEARN, HARD_NEGATIVES].into_iter().filter_map(|name| study.suite(name));
                let all: Vec<&Suite> = taught.chain(judged).collect();
                for scenario in flights::scenarios(study).into_iter().filter(|&s| scenarios(s)) {
                    tasks.extend(all.iter().flat_map(|suite| of_suite(place, suite, scenario)));
                }
            }
            name => {
                let suite = place.suite(name)?;
                let own = flights::scenarios(study).into_iter().filter(|&s| scenarios(s));
                tasks.extend(own.flat_map(|scenario| of_suite(place, suite, scenario)));
            }
        }
    }
    Ok(tasks)
}

fn of_records(place: Place, scenarios: impl Fn(Scenario) -> bool) -> Result<Vec<Task>, JobError> {
    let mut tasks = vec![];
    for (purpose, scenarios) in runs(place.study, scenarios) {
        let campaign = campaign(place, scenarios.clone(), purpose);
        let (prepared, suite) = (campaign.prepared()?, campaign.suite().name);
        tasks.extend((0..prepared.part_count()).map(|part| Task {
            suite: suite.clone(),
            scenarios: scenarios.clone(),
            part,
            files: prepared.files_of(part),
            runs: prepared.rows_of(part),
            needs: campaign.calibration().into_iter().collect(),
        }));
    }
    Ok(tasks)
}

fn of_suite(Place { study, folder, .. }: Place, suite: &Suite, scenario: Scenario) -> Vec<Task> {
    if !suite.scenarios.contains(&scenario) {
        return vec![];
    }
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
    watched::parts(study, suite).into_iter().enumerate().map(task).collect()
}

fn campaign<'s>(
    Place { study, folder, .. }: Place<'s>,
    scenarios: Vec<Scenario>,
    purpose: Purpose,
) -> Campaign<'s> {
    Campaign::new(folder.path(), study, scenarios, purpose)
}

/// Computes those files of tasks that are absent or unusable, in the order of the tasks. What they need that is not trained
/// is prepared with them.
///
/// # Errors
/// What a task needs is missing; a run cannot begin; a file cannot be written; [`Cancelled`](crate::campaign::CampaignError::Cancelled).
pub fn run(place: Place, tasks: &[Task], crew: &Crew) -> Result<(), JobError> {
    let all: usize = tasks.iter().map(|task| task.runs).sum();
    let mut done = 0;
    // The parts of a suite in a scenario fly together.
    for alike in tasks.chunk_by(|a, b| (&a.suite, &a.scenarios) == (&b.suite, &b.scenarios)) {
        let runs: usize = alike.iter().map(|task| task.runs).sum();
        let told = |what: &str, share: f64| {
            let runs = done as f64 + share * runs as f64;
            (crew.progress)(what, runs / all.max(1) as f64);
        };
        let parts: Vec<usize> = alike.iter().map(|task| task.part).collect();
        let crew = Crew { workers: crew.workers, progress: &told };
        run_parts(place, (&alike[0].suite, &alike[0].scenarios), &parts, &crew)?;
        done += runs;
    }
    Ok(())
}

/// Computes parts of a suite in scenarios with the same plants.
fn run_parts(
    place: Place,
    (suite, scenarios): (&str, &[Scenario]),
    parts: &[usize],
    crew: &Crew,
) -> Result<(), JobError> {
    let Place { study, folder, .. } = place;
    let mut of_records = Purpose::OF_RECORDS.into_iter();
    if let Some(purpose) = of_records.find(|&purpose| study.records(purpose).name == suite) {
        let campaign = campaign(place, scenarios.to_vec(), purpose);
        let campaign = Campaign { workers: crew.workers, ..campaign };
        campaign.run_parts(&campaign.prepared()?, parts, rows_of(suite, crew))?;
        return Ok(());
    }
    let known = place.suite(suite)?;
    let (own, size) = ((known, scenarios[0]), study);
    match known.purpose {
        Purpose::Train => flights::fly_to_learn(folder, size, own, parts, crew),
        _ => outcomes::fly_parts(folder, size, own, parts, crew),
    }
}

/// Reports how many rows of a suite of records are simulated.
fn rows_of<'c>(suite: &'c str, crew: &'c Crew) -> impl Fn(usize, usize) + Sync + 'c {
    move |done, all| (crew.progress)(suite, done as f64 / all.max(1) as f64)
}

/// Writes a file that tasks need, unless it is there.
///
/// # Errors
/// Parts of the flights that it comes from are missing; the work behind it fails; the file cannot be written.
pub fn prepare(place: Place, file: &str, crew: &Crew) -> Result<(), JobError> {
    let Place { study, folder, .. } = place;
    let path = folder.path().join(file);
    let workers = crew.workers;
    for purpose in Purpose::OF_RECORDS {
        if path == calibration_file(folder.path(), purpose) {
            let campaign = campaign(place, vec![Scenario::Fitted], purpose);
            return Ok(Campaign { workers, ..campaign }.calibrate()?);
        }
    }
    let design = |scenario| flights::design(folder, study, scenario, workers);
    for scenario in flights::scenarios(study) {
        if path == folder.spreads(scenario) {
            return design(scenario).map(drop);
        } else if path == folder.bands(scenario) {
            return flights::learned_bands(folder, &design(scenario)?).map(drop);
        } else if path == folder.diagnoser(scenario) {
            return flights::learn(folder, study, scenario, crew).map(drop);
        }
    }
    Ok(())
}

/// Computes what is missing of some suites and joins their parts: data sets of records, outcomes of judged flights, and
/// their counts.
///
/// # Errors
/// As [`tasks`] and [`run`].
pub fn join(
    place: Place,
    suites: &[String],
    scenarios: impl Fn(Scenario) -> bool,
    crew: &Crew,
) -> Result<(), JobError> {
    let Place { study, folder, .. } = place;
    let mut judged = vec![];
    for name in suites {
        match name.as_str() {
            RECORDS => {
                for (purpose, scenarios) in runs(study, &scenarios) {
                    let campaign = campaign(place, scenarios, purpose);
                    let suite = campaign.suite().name;
                    let campaign = Campaign { workers: crew.workers, ..campaign };
                    campaign.run(rows_of(&suite, crew))?;
                }
                data_card::write(folder, study)?;
            }
            FLIGHTS => judged.extend(study.suites().filter(|suite| flights::is_usual(suite))),
            name => match place.suite(name)? {
                suite if suite.purpose == Purpose::Test => judged.push(suite),
                suite => run(place, &tasks(place, from_ref(&suite.name), &scenarios)?, crew)?,
            },
        }
    }
    if !judged.is_empty() {
        let own: Vec<Scenario> =
            flights::scenarios(study).into_iter().filter(|&s| scenarios(s)).collect();
        flights::fly(folder, study, &judged, &own, (crew, &|share| share))?;
    }
    manifest::write(folder, study).map(drop)
}

/// Runs suites and joins them. [`FLIGHTS`] trains the diagnosers; other suites are flown with those that are there.
///
/// # Errors
/// As [`join`] and [`flights::learn`].
pub fn run_suites(
    place: Place,
    suites: &[String],
    scenarios: impl Fn(Scenario) -> bool,
    crew: &Crew,
) -> Result<(), JobError> {
    if suites.iter().any(|name| name == FLIGHTS) {
        flights::flights(place.study)?;
        for scenario in flights::scenarios(place.study).into_iter().filter(|&s| scenarios(s)) {
            flights::learn(place.folder, place.study, scenario, crew)?;
        }
    }
    join(place, suites, scenarios, crew)
}
