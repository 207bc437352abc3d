//! The outcomes of a suite in a scenario: flown in parts, and joined to a table. An interrupted suite goes on with the parts
//! that are missing.

use super::flights::{Crew, diagnoser};
use super::{Folder, JobError};
use crate::files::create_folder;
use crate::flight::watched::{self, Watching};
use crate::manifest::{sha256, sha256_of_text};
use crate::measure::flights::HealthyMetrics;
use crate::measure::outcome::{self, RunOutcome};
use crate::parallel::Workers;
use crate::run::fitted_twins::CalibrationRecords;
use crate::run::part::{self, PartFiles};
use crate::run::{CampaignError, RunName, plan};
use crate::study::suites::{HEALTHY, HEALTHY_OTHER_STRUCTURE};
use crate::study::{Purpose, Scenario, Study, Suite};
use crate::table::{self, Table, TableError};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::diagnoser::{Diagnoser, Session};
use servotwin_diagnosis::error::Error;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// The numbers of runs of a suite.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SuiteSize {
    /// The suite.
    pub suite: String,
    /// The number of environments.
    pub environments: usize,
    /// The number of runs of every fault at every intensity.
    pub repeats: usize,
    /// The number of healthy runs in each environment.
    pub healthy: usize,
    /// The length of a run with a fault, s.
    pub duration_s: f64,
    /// The length of a healthy run, s.
    pub healthy_duration_s: f64,
}

impl From<&Suite> for SuiteSize {
    fn from(suite: &Suite) -> Self {
        let &Suite { environments, repeats, healthy, duration_s, healthy_duration_s, .. } = suite;
        let suite = suite.name.clone();
        SuiteSize { suite, environments, repeats, healthy, duration_s, healthy_duration_s }
    }
}

/// What suites of a scenario are flown with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Basis {
    /// The hash of the diagnoser's file.
    pub diagnoser_sha256: String,
    /// The hash of the study file.
    pub study_sha256: String,
    /// The hash of the system file.
    pub system_sha256: String,
}

impl Basis {
    /// The study and the diagnoser of a scenario in a folder.
    ///
    /// # Errors
    /// The diagnoser's file cannot be read.
    pub fn of(folder: &Folder, study: &Study, scenario: Scenario) -> Result<Self, JobError> {
        Ok(Basis {
            diagnoser_sha256: sha256(&folder.diagnoser(scenario))?,
            study_sha256: sha256_of_text(&study.text),
            system_sha256: sha256_of_text(&study.system.text),
        })
    }
}

/// The flown part of a suite in a scenario. Its file is the table of outcomes with the other fields as metadata.
#[derive(Debug, Clone, PartialEq)]
pub struct FlownSuite {
    /// The suite.
    pub suite: String,
    /// The scenario.
    pub scenario: String,
    /// The seed of everything that was drawn.
    pub seed: u64,
    /// What else determines its runs, in words.
    pub runs: String,
    /// What it was flown with.
    pub basis: Basis,
    /// What became of the calibration flights, where twins are fitted to plants of another structure.
    pub calibration: Option<CalibrationRecords>,
    /// One outcome for each run and diagnosis, by run.
    pub outcomes: Vec<RunOutcome>,
}

impl FlownSuite {
    pub(super) fn new(
        folder: &Folder,
        study: &Study,
        suite: &Suite,
        scenario: Scenario,
    ) -> Result<Self, JobError> {
        Ok(FlownSuite {
            suite: suite.name.clone(),
            scenario: scenario.name().into(),
            seed: suite.seed,
            runs: in_words(suite),
            basis: Basis::of(folder, study, scenario)?,
            calibration: None,
            outcomes: vec![],
        })
    }

    /// Number of runs in which the plant could not be simulated to the end.
    pub fn failed(&self) -> usize {
        self.outcomes.iter().filter(|row| !row.is_finished).count()
    }

    /// The counts of the time without a fault in all finished runs.
    pub fn healthy(&self) -> HealthyMetrics {
        let finished: Vec<&RunOutcome> =
            self.outcomes.iter().filter(|row| row.is_finished).collect();
        HealthyMetrics::new(&finished)
    }

    /// What was flown, in words.
    pub fn title(&self) -> String {
        match self.suite.as_str() {
            HEALTHY => self.scenario.clone(),
            suite => format!("{suite}, {}", self.scenario),
        }
    }

    /// The length of the longest run, s.
    pub fn longest_s(&self) -> f64 {
        self.outcomes.iter().map(|row| row.duration_s).fold(0.0, f64::max)
    }

    /// What determines the runs.
    pub(super) fn origin(&self) -> [(&'static str, String); 7] {
        let FlownSuite { suite, scenario, seed, runs, basis, .. } = self;
        [
            ("suite", suite.clone()),
            ("scenario", scenario.clone()),
            ("seed", seed.to_string()),
            ("runs", runs.clone()),
            ("diagnoser_sha256", basis.diagnoser_sha256.clone()),
            ("study_sha256", basis.study_sha256.clone()),
            ("system_sha256", basis.system_sha256.clone()),
        ]
    }

    fn metadata(&self) -> BTreeMap<String, String> {
        let calibration = self.calibration.map(|records| {
            ("calibration", serde_json::to_string(&records).expect("three numbers"))
        });
        let all = self.origin().into_iter().chain(calibration);
        all.map(|(key, value)| (key.to_owned(), value)).collect()
    }

    /// Writes the file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(super) fn write(&self, path: &Path) -> Result<(), JobError> {
        let written = table::write(path, &self.to_table());
        written.map_err(|error| JobError::Outcomes { path: path.into(), error })
    }

    fn to_table(&self) -> Table {
        let mut rows = outcome::table(&self.outcomes);
        rows.metadata.extend(self.metadata());
        rows
    }

    fn from_table(rows: &Table) -> Result<Self, TableError> {
        let text = |key: &str| rows.metadata.get(key).cloned().unwrap_or_default();
        Ok(FlownSuite {
            suite: text("suite"),
            scenario: text("scenario"),
            seed: text("seed").parse().unwrap_or_default(),
            runs: text("runs"),
            basis: Basis {
                diagnoser_sha256: text("diagnoser_sha256"),
                study_sha256: text("study_sha256"),
                system_sha256: text("system_sha256"),
            },
            calibration: serde_json::from_str(&text("calibration")).ok(),
            outcomes: outcome::from_table(rows)?,
        })
    }

    /// Takes what became of other runs.
    fn take(&mut self, outcomes: Vec<RunOutcome>, calibration: Option<CalibrationRecords>) {
        self.outcomes.extend(outcomes);
        if let Some(more) = calibration {
            self.calibration.get_or_insert_default().add(more);
        }
    }
}

/// What determines the runs of a suite beside the study file: more environments only add runs to a suite in which each is
/// flown once.
fn in_words(suite: &Suite) -> String {
    let SuiteSize { environments, repeats, healthy, duration_s, healthy_duration_s, .. } =
        suite.into();
    let environments = match (repeats, healthy) {
        (0, 1) => String::new(),
        _ => format!("{environments} environments, "),
    };
    format!(
        "{environments}{repeats} of each fault of {duration_s} s, {healthy} healthy of {healthy_duration_s} s"
    )
}

/// The diagnoses that watch a suite: one, or one without each sensor.
///
/// # Errors
/// As [`Session::new`].
pub fn watching(suite: &Suite, diagnoser: &Arc<Diagnoser>) -> Result<Vec<Watching>, Error> {
    let session = Session::new(diagnoser.clone())?.at_rest();
    let without = |missing| Watching { session: session.clone(), missing };
    Ok(match suite.misses_sensors {
        true => (0..diagnoser.sensors.len()).map(|sensor| without(Some(sensor))).collect(),
        false => vec![without(None)],
    })
}

/// A suite in a scenario that is flown with the stored diagnoser, part by part.
struct FlownParts<'f> {
    place: (&'f Study, &'f Suite, Scenario),
    watching: Vec<Watching>,
    /// The suite without outcomes.
    empty: FlownSuite,
    files: PartFiles,
}

impl<'f> FlownParts<'f> {
    fn new(
        folder: &Folder,
        study: &'f Study,
        suite: &'f Suite,
        scenario: Scenario,
    ) -> Result<Self, JobError> {
        let model = Arc::new(diagnoser(folder, scenario)?);
        let watching = watching(suite, &model);
        let empty = FlownSuite::new(folder, study, suite, scenario)?;
        let mut mark = part::model_mark(study);
        empty.origin().into_iter().for_each(|(key, value)| _ = mark.add(key).add(&value));
        create_folder(folder.parts())?;
        Ok(FlownParts {
            place: (study, suite, scenario),
            watching: watching.map_err(|error| JobError::Evaluation(error.into()))?,
            empty,
            files: PartFiles::new(
                folder.path(),
                stem(suite, scenario),
                mark,
                watched::parts(study, suite),
            ),
        })
    }

    /// Flies some parts whose files are absent or unusable.
    fn fly(&self, parts: &[usize], crew: &Crew) -> Result<(), JobError> {
        let (_, suite, scenario) = self.place;
        let what = format!("{}: suite {}", scenario.name(), suite.name);
        let missing = self.files.missing(parts.iter().copied());
        let all = self.files.runs_of(parts);
        let mut done = all - self.files.runs_of(&missing);
        let told = |ended: usize| (crew.progress)(&what, ended as f64 / all.max(1) as f64);
        told(done);
        for round in watched::rounds(self.place, &self.files.parts, &missing) {
            let numbers = || round.iter().flat_map(|&part| &self.files.parts[part]);
            let (list, workers): (Vec<usize>, _) = (numbers().copied().collect(), crew.workers);
            let flown =
                watched::fly(self.place, &self.watching, &list, workers, &|n| told(done + n))?;
            let part_of = round.iter().flat_map(|&part| {
                self.files.parts[part].iter().map(move |&number| (number as u64, part))
            });
            let part_of: BTreeMap<u64, usize> = part_of.collect();
            let mut rows: BTreeMap<usize, Vec<RunOutcome>> = BTreeMap::new();
            for outcome in flown.outcomes {
                rows.entry(part_of[&outcome.number]).or_default().push(outcome);
            }
            for &part in &round {
                let mut own = self.empty.clone();
                own.take(rows.remove(&part).unwrap_or_default(), flown.calibration);
                self.files.write(part, own.to_table()).map_err(CampaignError::from)?;
            }
            done += list.len();
        }
        Ok(())
    }

    /// Joins all parts, by run.
    fn joined(&self) -> Result<FlownSuite, JobError> {
        let mut all = self.empty.clone();
        for part in 0..self.files.parts.len() {
            if let Some(table) = self.files.read(part)? {
                let own = FlownSuite::from_table(&table).map_err(CampaignError::from)?;
                all.take(own.outcomes, own.calibration);
            }
        }
        all.outcomes.sort_by_key(|outcome| outcome.number);
        Ok(all)
    }
}

/// How the names of the files of a suite's parts begin.
pub(super) fn stem(suite: &Suite, scenario: Scenario) -> String {
    format!("outcomes-{}-{}", suite.name, scenario.name())
}

/// Flies the missing parts of a suite in a scenario with the stored diagnoser, and writes the outcomes of all. Nothing is
/// learned.
///
/// # Errors
/// The diagnoser is missing; a twin cannot be simulated; a file cannot be read or written.
pub fn fly(
    folder: &Folder,
    study: &Study,
    suite: &Suite,
    scenario: Scenario,
    crew: &Crew,
) -> Result<FlownSuite, JobError> {
    let parts = FlownParts::new(folder, study, suite, scenario)?;
    parts.fly(&parts.files.all(), crew)?;
    let joined = parts.joined()?;
    let path = folder.outcomes(&suite.name, scenario.name());
    if read(&path).ok().flatten().as_ref() != Some(&joined) {
        joined.write(&path)?;
    }
    Ok(joined)
}

/// Flies some parts of a suite in a scenario with the stored diagnoser. [`fly`] joins all parts to the bytes of an undivided
/// suite.
///
/// # Errors
/// As [`fly`].
pub(super) fn fly_parts(
    folder: &Folder,
    study: &Study,
    (suite, scenario): (&Suite, Scenario),
    parts: &[usize],
    crew: &Crew,
) -> Result<(), JobError> {
    FlownParts::new(folder, study, suite, scenario)?.fly(parts, crew)
}

/// Flies one run of a suite for judging with the stored diagnoser, to the bit as among all others. Returns one outcome for
/// each diagnosis.
///
/// # Errors
/// [`JobError::NoRun`]; the diagnoser is missing; a twin cannot be simulated.
pub fn fly_run(
    folder: &Folder,
    study: &Study,
    name: &RunName,
    workers: Workers,
) -> Result<Vec<RunOutcome>, JobError> {
    let none = || JobError::NoRun { name: name.to_string() };
    let suite = study.suite(&name.suite).ok_or_else(none)?;
    let is_known = suite.is_unseen || name.number < plan::count(study, suite);
    if !is_known || suite.purpose != Purpose::Test {
        return Err(none());
    }
    let model = Arc::new(diagnoser(folder, name.scenario)?);
    let watching = watching(suite, &model).map_err(|error| JobError::Evaluation(error.into()))?;
    let place = (study, suite, name.scenario);
    let flown = watched::fly(place, &watching, &[name.number], workers, &|_| ())?;
    if flown.outcomes.is_empty() { Err(none()) } else { Ok(flown.outcomes) }
}

/// Reads the healthy flights in environments of their own, in all scenarios.
///
/// # Errors
/// As `stored`.
pub fn healthy(folder: &Folder) -> Result<Vec<FlownSuite>, JobError> {
    let each = |suite| Scenario::ALL.map(|scenario| stored(folder, suite, scenario).transpose());
    [HEALTHY, HEALTHY_OTHER_STRUCTURE].into_iter().flat_map(each).flatten().collect()
}

/// Reads the outcomes of a suite in a scenario; `None` if there are none.
///
/// # Errors
/// The file cannot be read, or contradicts the manifest.
pub fn stored(
    folder: &Folder,
    suite: &str,
    scenario: Scenario,
) -> Result<Option<FlownSuite>, JobError> {
    read(&folder.outcomes(suite, scenario.name()))
}

/// Reads a file of outcomes; `None` if there is none.
fn read(path: &Path) -> Result<Option<FlownSuite>, JobError> {
    if !path.exists() {
        return Ok(None);
    }
    let read = table::read(path).and_then(|rows| FlownSuite::from_table(&rows));
    read.map(Some).map_err(|error| JobError::Outcomes { path: path.into(), error })
}
