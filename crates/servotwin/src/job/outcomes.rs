//! The outcomes of a suite in a scenario, as a folder holds them. An interrupted suite goes on where it was last stored.

use super::flights::{Crew, diagnoser};
use super::{Folder, JobError};
use crate::campaign::Share;
use crate::files::create_folder;
use crate::flight::judge::HealthyMetrics;
use crate::flight::outcome::{self, FlightOutcome};
use crate::flight::watched::{self, FlownEnvironments, Watching, fly_suite};
use crate::manifest::{sha256, sha256_of_text};
use crate::parallel::Workers;
use crate::run::fitted_twins::CalibrationRecords;
use crate::run::{RunName, plan};
use crate::study::suites::{HEALTHY, HEALTHY_OTHER_STRUCTURE};
use crate::study::{Purpose, Scenario, Study, Suite};
use crate::table::{self, TableError};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::diagnoser::{Diagnoser, Session};
use servotwin_diagnosis::error::Error;
use std::collections::BTreeMap;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A suite is stored whenever it has grown by this fraction: every part at first, and rarely once its file is large.
const STORED_EVERY: f64 = 0.05;

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
    /// Whether the suites have the study's full sizes.
    pub is_full: bool,
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
    pub fn of(
        folder: &Folder,
        (study, is_full): (&Study, bool),
        scenario: Scenario,
    ) -> Result<Self, JobError> {
        Ok(Basis {
            is_full,
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
    /// The first environment that was flown; above 0 in a share.
    pub first: usize,
    /// The environment behind the last one that was flown.
    pub environments: usize,
    /// What became of the calibration flights, where twins are fitted to plants of another structure.
    pub calibration: Option<CalibrationRecords>,
    /// One outcome for each run and diagnosis, by run.
    pub outcomes: Vec<FlightOutcome>,
}

impl FlownSuite {
    pub(super) fn new(
        folder: &Folder,
        (study, is_full): (&Study, bool),
        suite: &Suite,
        scenario: Scenario,
    ) -> Result<Self, JobError> {
        Ok(FlownSuite {
            suite: suite.name.clone(),
            scenario: scenario.name().into(),
            seed: suite.seed,
            runs: in_words(suite),
            basis: Basis::of(folder, (study, is_full), scenario)?,
            first: 0,
            environments: 0,
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
        let finished: Vec<&FlightOutcome> =
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
    fn origin(&self) -> [(&'static str, String); 8] {
        let FlownSuite { suite, scenario, seed, runs, basis, .. } = self;
        [
            ("suite", suite.clone()),
            ("scenario", scenario.clone()),
            ("seed", seed.to_string()),
            ("size", if basis.is_full { "full" } else { "small" }.into()),
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
        let environments = [("environments", self.environments.to_string())];
        let first = (self.first > 0).then(|| ("first", self.first.to_string()));
        let all = self.origin().into_iter().chain(environments).chain(first).chain(calibration);
        all.map(|(key, value)| (key.to_owned(), value)).collect()
    }

    /// Writes the file.
    ///
    /// # Errors
    /// The file cannot be written.
    fn write(&self, path: &Path) -> Result<(), JobError> {
        let mut rows = outcome::table(&self.outcomes);
        rows.metadata.extend(self.metadata());
        table::write(path, &rows).map_err(|error| JobError::Outcomes { path: path.into(), error })
    }

    /// Takes what became of some environments.
    fn take(&mut self, flown: FlownEnvironments) {
        self.outcomes.extend(flown.outcomes);
        self.environments = flown.environments;
        if let Some(more) = flown.calibration {
            self.calibration.get_or_insert_default().add(more);
        }
    }
}

/// A flown part with its file, which is written whenever it has grown.
pub(super) struct Growing {
    path: PathBuf,
    pub flown: FlownSuite,
    /// [`FlownSuite::environments`] of the file.
    written: usize,
}

impl Growing {
    /// What a file holds of the same runs; none of a file of other runs.
    pub(super) fn begun(path: PathBuf, stored: Option<FlownSuite>, new: FlownSuite) -> Self {
        let is_same = |own: &FlownSuite| own.origin() == new.origin() && own.first == new.first;
        let flown = stored.filter(is_same).unwrap_or(new);
        Growing { path, written: flown.environments, flown }
    }

    fn take(&mut self, own: FlownEnvironments, end: usize) -> Result<(), JobError> {
        self.flown.take(own);
        let FlownSuite { first, environments, .. } = self.flown;
        let has_grown =
            (environments - self.written) as f64 > STORED_EVERY * (self.written - first) as f64;
        if has_grown || environments == end { self.write() } else { Ok(()) }
    }

    pub(super) fn write(&mut self) -> Result<(), JobError> {
        self.flown.outcomes.sort_by_key(|outcome| outcome.number);
        self.flown.write(&self.path)?;
        self.written = self.flown.environments;
        Ok(())
    }

    /// Flies the environments up to `end`.
    fn fly(
        &mut self,
        place: (&Study, &Suite, Scenario),
        watching: &[Watching],
        end: usize,
        crew: &Crew,
    ) -> Result<(), JobError> {
        let (_, suite, scenario) = place;
        let what = format!("{}: suite {}", scenario.name(), suite.name);
        let from = self.flown.environments;
        let share = |environments: f64| environments / suite.environments as f64;
        let told = |done: usize, of: usize| {
            let flown = end.saturating_sub(from) as f64 * done as f64 / of.max(1) as f64;
            (crew.progress)(&what, share(from as f64 + flown));
        };
        (crew.progress)(&what, share(from as f64));
        fly_suite(place, watching, from..end.max(from), crew.workers, &told, |own| {
            self.take(own, end)
        })
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

/// Flies a suite in a scenario with the stored diagnoser, and writes its outcomes. What the folder's file and its
/// shares hold of the same runs stays; a file of other runs is replaced. Nothing is learned.
///
/// # Errors
/// The diagnoser is missing; a twin cannot be simulated; the file cannot be read or written.
pub fn fly(
    folder: &Folder,
    (study, is_full): (&Study, bool),
    suite: &Suite,
    scenario: Scenario,
    crew: &Crew,
) -> Result<FlownSuite, JobError> {
    let model = Arc::new(diagnoser(folder, scenario)?);
    let watching = watching(suite, &model).map_err(|error| JobError::Evaluation(error.into()))?;
    let new = FlownSuite::new(folder, (study, is_full), suite, scenario)?;
    let shares = shares(folder, &new);
    let (place, path) = ((study, suite, scenario), folder.outcomes(&suite.name, scenario.name()));
    let stored = read(&path)?.filter(|own| own.environments <= suite.environments);
    let mut growing = Growing::begun(path, stored, new);
    for share in shares.into_iter().filter(|share| share.environments <= suite.environments) {
        // Shares of several divisions may overlap.
        if share.first >= growing.flown.environments {
            growing.fly(place, &watching, share.first, crew)?;
            let FlownSuite { outcomes, environments, calibration, .. } = share;
            growing.flown.take(FlownEnvironments { outcomes, environments, calibration });
        }
    }
    growing.fly(place, &watching, suite.environments, crew)?;
    if growing.written < growing.flown.environments {
        growing.write()?;
    }
    Ok(growing.flown)
}

/// Flies a share of the environments of a suite in a scenario, as [`fly`], into a file of its own, and returns these
/// environments. [`fly`] joins it to the bytes of an undivided suite.
///
/// # Errors
/// As [`fly`].
pub fn fly_share(
    folder: &Folder,
    (study, is_full): (&Study, bool),
    suite: &Suite,
    scenario: Scenario,
    (share, crew): (Share, &Crew),
) -> Result<Range<usize>, JobError> {
    let block = share.block(suite.environments);
    let model = Arc::new(diagnoser(folder, scenario)?);
    let watching = watching(suite, &model).map_err(|error| JobError::Evaluation(error.into()))?;
    let new = FlownSuite::new(folder, (study, is_full), suite, scenario)?;
    let new = FlownSuite { first: block.start, environments: block.start, ..new };
    create_folder(folder.parts())?;
    let path = folder.parts().join(share_name(&new, &block.start.to_string()));
    // A damaged share counts as missing.
    let stored = read(&path).ok().flatten();
    let mut growing = Growing::begun(path, stored, new);
    growing.fly((study, suite, scenario), &watching, block.end, crew)?;
    Ok(block)
}

/// The name of a share's file.
fn share_name(FlownSuite { suite, scenario, .. }: &FlownSuite, first: &str) -> String {
    format!("outcomes-{suite}-{scenario}-{first}.parquet")
}

/// The stored shares of a suite of which nothing is flown yet, by their first environments.
fn shares(folder: &Folder, new: &FlownSuite) -> Vec<FlownSuite> {
    let name = share_name(new, "");
    let prefix = name.trim_end_matches(".parquet");
    let mut shares = vec![];
    for entry in fs::read_dir(folder.parts()).into_iter().flatten().flatten() {
        let is_share = entry.file_name().to_string_lossy().starts_with(prefix);
        let stored = if is_share { read(&entry.path()).ok().flatten() } else { None };
        shares.extend(stored.filter(|own| own.origin() == new.origin()));
    }
    shares.sort_by_key(|share| share.first);
    shares
}

/// Flies one environment of a suite in a scenario, watched by a diagnoser; of unseen faults all runs.
///
/// # Errors
/// A twin cannot be simulated, or the diagnoser does not fit.
pub fn fly_environment(
    (study, suite, scenario): (&Study, &Suite, Scenario),
    environment: usize,
    diagnoser: &Arc<Diagnoser>,
    workers: Workers,
) -> Result<Vec<FlightOutcome>, JobError> {
    let watching =
        watching(suite, diagnoser).map_err(|error| JobError::Evaluation(error.into()))?;
    let place = (study, suite, scenario);
    let flown = watched::fly_environments(place, &watching, environment..environment + 1, workers)?;
    Ok(flown.outcomes)
}

/// Flies one run of a suite for judging with the stored diagnoser, to the bit as among all others. Returns one outcome for
/// each diagnosis.
///
/// # Errors
/// [`JobError::NoRun`]; the diagnoser is missing; a twin cannot be simulated.
pub fn fly_run(
    folder: &Folder,
    (study, is_full): (&Study, bool),
    name: &RunName,
    workers: Workers,
) -> Result<Vec<FlightOutcome>, JobError> {
    let none = || JobError::NoRun { name: name.to_string() };
    let suite = study.suite(&name.suite, is_full).ok_or_else(none)?;
    let is_known = suite.is_unseen || name.number < plan::count(study, suite);
    if !is_known || suite.purpose != Purpose::Test {
        return Err(none());
    }
    let model = Arc::new(diagnoser(folder, name.scenario)?);
    let watching = watching(suite, &model).map_err(|error| JobError::Evaluation(error.into()))?;
    let place = (study, suite, name.scenario);
    let outcomes = watched::fly_run(place, &watching, name.number, workers)?.outcomes;
    if outcomes.is_empty() { Err(none()) } else { Ok(outcomes) }
}

/// Writes the outcomes of all runs of a suite in a scenario.
///
/// # Errors
/// The diagnoser's file cannot be read, or the file cannot be written.
pub fn write(
    folder: &Folder,
    (study, is_full): (&Study, bool),
    suite: &Suite,
    scenario: Scenario,
    mut outcomes: Vec<FlightOutcome>,
) -> Result<(), JobError> {
    outcomes.sort_by_key(|outcome| outcome.number);
    let new = FlownSuite::new(folder, (study, is_full), suite, scenario)?;
    let path = folder.outcomes(&suite.name, scenario.name());
    FlownSuite { environments: suite.environments, outcomes, ..new }.write(&path)
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
    let wrong = |error: TableError| JobError::Outcomes { path: path.into(), error };
    let rows = table::read(path).map_err(wrong)?;
    let text = |key: &str| rows.metadata.get(key).cloned().unwrap_or_default();
    let number = |key: &str| text(key).parse().unwrap_or_default();
    Ok(Some(FlownSuite {
        suite: text("suite"),
        scenario: text("scenario"),
        seed: number("seed"),
        runs: text("runs"),
        basis: Basis {
            is_full: text("size") == "full",
            diagnoser_sha256: text("diagnoser_sha256"),
            study_sha256: text("study_sha256"),
            system_sha256: text("system_sha256"),
        },
        first: number("first") as usize,
        environments: number("environments") as usize,
        calibration: serde_json::from_str(&text("calibration")).ok(),
        outcomes: outcome::from_table(&rows).map_err(wrong)?,
    }))
}
