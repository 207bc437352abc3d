//! The outcomes of a suite in a scenario: flown in parts, and joined to a table. An interrupted suite goes on with the parts
//! that are missing.

use super::flights::diagnoser;
use super::{Folder, Job, JobError, Subject};
use crate::flight::watched::{self, Flown, Truth, Watching};
use crate::learn::DataSet;
use crate::manifest::{sha256, sha256_of_text};
use crate::measure::flights::HealthyMetrics;
use crate::measure::outcome::{self, RunOutcome, Word};
use crate::parallel::Workers;
use crate::run::compute::{Kept, Round, Take, compute};
use crate::run::fitted_twins::CalibrationRecords;
use crate::run::part::{self, PartFiles};
use crate::run::{RunError, RunName, plan};
use crate::study::suites::{HEALTHY, HEALTHY_OTHER_STRUCTURE};
use crate::study::{Purpose, Scenario, Study, Suite};
use crate::table::{Table, TableError};
use servotwin_diagnosis::diagnoser::{Diagnoser, Session};
use servotwin_diagnosis::panel::{Panel, PanelVerdict};
use std::collections::BTreeMap;
use std::path::Path;
use std::slice::from_ref;
use std::sync::Arc;

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
        let diagnoser_sha256 = sha256(&folder.diagnoser(scenario))?;
        Ok(Basis { diagnoser_sha256, ..Basis::of_texts(study) })
    }

    /// The study alone.
    fn of_texts(study: &Study) -> Self {
        Basis {
            diagnoser_sha256: String::new(),
            study_sha256: sha256_of_text(&study.text),
            system_sha256: sha256_of_text(&study.system.text),
        }
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

    /// What the diagnoser of a subject answers in the records for judging, each of which is one window: it is visible and
    /// answered at its end.
    pub(super) fn of_records(
        (folder, study): (&Folder, &Study),
        subject: Subject,
        data: &DataSet,
        panel: &Panel,
    ) -> Result<Self, JobError> {
        let (suite, scenario) = (study.records(Purpose::Test), subject.scenario());
        let diagnoser_sha256 = sha256(&folder.records(subject))?;
        let mut outcomes: Vec<RunOutcome> = plan::all(study, &suite)
            .filter(|run| scenario.has_noise() || !run.is_healthy())
            .map(|run| Truth::planned(study, &run).run)
            .collect();
        let (names, mut scratch) = (data.examples.names(), panel.scratch());
        let shutdowns = data.actions(&study.shutdowns());
        let mut views = vec![vec![0.0; data.features.len()]; data.examples.views()];
        for row in data.rows_where(Purpose::Test, |_| true) {
            let own = &data.rows[row];
            for (view, values) in views.iter_mut().enumerate() {
                data.examples.row_into(view, row, values);
            }
            let verdict = panel.diagnose(&own.largest, &views, &mut scratch);
            let verdict = verdict.map_err(|error| JobError::Evaluation(error.into()))?;
            let seen = std::mem::take(&mut outcomes[own.variant]).seen(own.is_detected());
            outcomes[own.variant] = match verdict {
                PanelVerdict::Healthy => seen,
                PanelVerdict::NotIsolated(_) => RunOutcome { word: Word::Detected, ..seen },
                PanelVerdict::Isolated(said) => seen.answered(&said, names, &shutdowns),
            };
        }
        let basis = Basis { diagnoser_sha256, ..Basis::of_texts(study) };
        let (name, runs) = (suite.name.clone(), in_words(&suite));
        let scenario = scenario.name().into();
        Ok(FlownSuite {
            suite: name,
            scenario,
            seed: suite.seed,
            runs,
            basis,
            calibration: None,
            outcomes,
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
        let written = self.to_table().write(path);
        written.map_err(|error| JobError::DataSet { path: path.into(), error: error.into() })
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
}

/// What determines the runs of a suite beside the study file: more environments only add runs to a suite in which each is
/// flown once.
fn in_words(suite: &Suite) -> String {
    let Suite { environments, repeats, healthy, duration_s, healthy_duration_s, .. } = suite;
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
/// The diagnoser contradicts itself.
pub(super) fn watching(
    suite: &Suite,
    diagnoser: &Arc<Diagnoser>,
) -> Result<Vec<Watching>, JobError> {
    let session = Session::new(diagnoser.clone());
    let session = session.map_err(|error| JobError::Evaluation(error.into()))?.at_rest();
    let without = |missing| Watching { session: session.clone(), missing };
    Ok(match suite.misses_sensors {
        true => (0..diagnoser.sensors.len()).map(|sensor| without(Some(sensor))).collect(),
        false => vec![without(None)],
    })
}

/// A suite in a scenario that is flown with the stored diagnoser, part by part.
struct FlownParts<'f> {
    place: (&'f Study, &'f Suite, Scenario),
    workers: Workers<'f>,
    watching: Vec<Watching>,
    /// The suite without outcomes.
    empty: FlownSuite,
    files: PartFiles,
}

impl<'f> FlownParts<'f> {
    fn new(job: &Job<'f>, suite: &'f Suite, scenario: Scenario) -> Result<Self, JobError> {
        let Job { study, folder, .. } = *job;
        let watching = watching(suite, &Arc::new(diagnoser(folder, scenario)?))?;
        let empty = FlownSuite::new(folder, study, suite, scenario)?;
        let mut mark = part::model_mark(study);
        empty.origin().into_iter().for_each(|(key, value)| _ = mark.add(key).add(&value));
        let (stem, parts) = (stem(suite, scenario), watched::parts(study, suite));
        Ok(FlownParts {
            place: (study, suite, scenario),
            workers: job.crew.workers,
            watching,
            empty,
            files: PartFiles::new(folder.path(), stem, mark, parts),
        })
    }

    /// Flies some parts whose files are absent or unusable.
    fn fly(&self, parts: &[usize], job: &Job) -> Result<(), JobError> {
        let (_, suite, scenario) = self.place;
        let what = format!("{}: suite {}", scenario.name(), suite.name);
        let told = |done, all: usize| job.tell(&what, done as f64 / all.max(1) as f64);
        compute(self, parts, self.workers, &told)?;
        Ok(())
    }

    /// Joins all parts, by run.
    fn joined(&self) -> Result<FlownSuite, JobError> {
        let mut all = self.empty.clone();
        for part in 0..self.files.parts.len() {
            if let Some(table) = self.files.read(part)? {
                let own = FlownSuite::from_table(&table).map_err(RunError::from)?;
                all.outcomes.extend(own.outcomes);
                if let Some(more) = own.calibration {
                    all.calibration.get_or_insert_default().add(more);
                }
            }
        }
        all.outcomes.sort_by_key(|outcome| outcome.number);
        Ok(all)
    }
}

impl Kept for FlownParts<'_> {
    type Row = Flown;

    fn place(&self) -> (&Study, &Suite, Scenario) {
        self.place
    }

    fn files(&self) -> &[PartFiles] {
        from_ref(&self.files)
    }

    fn fly(&self, round: &Round, take: Take<Flown>) -> Result<(), RunError> {
        let numbers: Vec<usize> = round.numbers().collect();
        let mut ended = |number, flown| take(0, number, flown);
        watched::fly(self.place, &self.watching, &numbers, self.workers, &mut ended)
    }

    fn table(&self, rows: BTreeMap<usize, Flown>) -> Result<Table, TableError> {
        let mut part = self.empty.clone();
        for flown in rows.into_values() {
            // All runs of a part share their calibration flights.
            part.calibration = flown.calibration;
            part.outcomes.extend(flown.outcomes);
        }
        Ok(part.to_table())
    }
}

/// How the names of the files of a suite's parts begin.
pub(super) fn stem(suite: &Suite, scenario: Scenario) -> String {
    format!("outcomes-{}-{}", suite.name, scenario.name())
}

impl Job<'_> {
    /// Flies the missing parts of a suite in a scenario with the stored diagnoser, and writes the outcomes of all. Nothing is
    /// learned.
    ///
    /// # Errors
    /// The diagnoser is missing; a twin cannot be simulated; a file cannot be read or written.
    pub fn fly(&self, suite: &Suite, scenario: Scenario) -> Result<FlownSuite, JobError> {
        let parts = FlownParts::new(self, suite, scenario)?;
        parts.fly(&parts.files.all(), self)?;
        let joined = parts.joined()?;
        let path = self.folder.outcomes(&suite.name, scenario.name());
        if read(&path).ok().flatten().as_ref() != Some(&joined) {
            joined.write(&path)?;
        }
        Ok(joined)
    }

    /// Flies some parts of a suite in a scenario with the stored diagnoser. [`Job::fly`] joins all parts to the bytes of an
    /// undivided suite.
    ///
    /// # Errors
    /// As [`Job::fly`].
    pub(super) fn fly_parts(
        &self,
        (suite, scenario): (&Suite, Scenario),
        parts: &[usize],
    ) -> Result<(), JobError> {
        FlownParts::new(self, suite, scenario)?.fly(parts, self)
    }

    /// Flies one run of a suite for judging with the stored diagnoser, to the bit as among all others. Returns one outcome
    /// for each diagnosis.
    ///
    /// # Errors
    /// [`JobError::NoRun`]; the diagnoser is missing; a twin cannot be simulated.
    pub fn fly_run(&self, name: &RunName) -> Result<Vec<RunOutcome>, JobError> {
        let none = || JobError::NoRun { name: name.to_string() };
        let Job { study, folder, crew, .. } = *self;
        let suite = study.suite(&name.suite).ok_or_else(none)?;
        if suite.purpose != Purpose::Test || watched::runs(study, suite).len() <= name.number {
            return Err(none());
        }
        let watching = watching(suite, &Arc::new(diagnoser(folder, name.scenario)?))?;
        let (place, mut outcomes) = ((study, suite, name.scenario), vec![]);
        let mut ended = |_, flown: Flown| outcomes.extend(flown.outcomes);
        watched::fly(place, &watching, &[name.number], crew.workers, &mut ended)?;
        Ok(outcomes)
    }
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
    let read = Table::read(path).and_then(|rows| FlownSuite::from_table(&rows));
    read.map(Some).map_err(|error| JobError::DataSet { path: path.into(), error: error.into() })
}
