//! The main job, stage by stage: records, training, evaluation. The crate `servotwin-report` presents the results.
//!
//! Every stage reads the files of the previous stages from the output folder (`folder`), so that a user can
//! change one thing and repeat the rest. A [`Subject`] of the diagnosis is a data set, with or
//! without the extra sensor.
//!
//! All work is done by a [`Job`]: a study, its output folder, and a [`Crew`]. What it computes of a suite is divided into
//! [`tasks`], for one machine or many; `run` is the order in which one machine does all of them.

pub mod data_card;
mod error;
pub mod flights;
pub(crate) mod folder;
mod held_out;
pub mod hold;
pub mod manifest;
pub mod outcomes;
pub mod results;
pub mod run;
pub mod sealed;
mod subject;
pub mod tasks;
pub mod worst_case;

pub use error::JobError;
pub use folder::{Folder, Kept};
pub use hold::{Among, Hold};
pub use results::Results;
pub use run::{StudyEvent, StudyResults, StudyRun};
pub use subject::Subject;

use crate::learn::perturbation::Perturbation;
use crate::learn::train;
use crate::learn::{self, Context, DataSet, model_file};
use crate::parallel::{self, Workers};
use crate::records::{Records, RunError, data_features};
use crate::study::{Purpose, Scenario, Study, Suite};
use crate::table::Table;
use outcomes::FlownSuite;
use results::SubjectResult;
use servotwin_diagnosis::features::Quantity;
use servotwin_diagnosis::panel::Panel;
use servotwin_diagnosis::residual::Window;
use std::sync::{Mutex, PoisonError};

/// The resources of some work: threads, and a receiver of progress.
#[derive(Clone, Copy)]
pub struct Crew<'c> {
    /// The threads, and their cancellation.
    pub workers: Workers<'c>,
    /// Receives the task at hand, and the share of all work that is done, from 0 to 1. It is called from several threads.
    pub progress: &'c (dyn Fn(&str, f64) + Sync),
}

impl<'c> Crew<'c> {
    /// Threads whose progress nobody looks at.
    pub fn quiet(workers: Workers<'c>) -> Self {
        Crew { workers, progress: &|_, _| () }
    }
}

/// A study, the folder of its results, and who works on it.
#[derive(Clone, Copy)]
pub struct Job<'j> {
    /// The study.
    pub study: &'j Study,
    /// Suites that stand in for those of the study.
    pub changed: &'j [Suite],
    /// The output folder.
    pub folder: &'j Folder,
    /// The threads, and who looks at the progress.
    pub crew: Crew<'j>,
}

impl<'j> Job<'j> {
    /// The suites of a study as it declares them, with all processors.
    pub fn new(study: &'j Study, folder: &'j Folder) -> Self {
        let crew = Crew::quiet(Workers::all());
        Job { study, changed: &[], folder, crew }
    }

    /// The same job, whose progress another receives.
    fn told<'t>(&self, progress: &'t (dyn Fn(&str, f64) + Sync)) -> Job<'t>
    where
        'j: 't,
    {
        Job { crew: Crew { progress, ..self.crew }, ..*self }
    }

    fn tell(&self, what: &str, share: f64) {
        (self.crew.progress)(what, share);
    }

    fn check(&self) -> Result<(), JobError> {
        if self.crew.workers.is_cancelled() { Err(RunError::Cancelled.into()) } else { Ok(()) }
    }

    /// The records of a purpose in scenarios with the same plants.
    fn records(&self, purpose: Purpose, scenarios: Vec<Scenario>) -> Result<Records<'j>, RunError> {
        let (folder, workers) = (self.folder.path(), self.crew.workers);
        Records::new(folder, self.study, (purpose, scenarios), workers)
    }
}

/// Perturbed copies of a training window.
const PERTURBED: usize = 6;

/// The perturbation that covers the solver's error, as a share of scale. For 37 of the aileron's 41 kinds of fault the
/// largest error is smaller (6e-5). Four kinds that ring or cavitate exceed it at times (up to 2.9e-3,
/// `docs/limits.md`), so some of their answers may depend on the solver and still count as firm.
const SOLVER_ERROR: f64 = 1e-4;

/// The subjects whose data sets are in the folder.
///
/// # Errors
/// [`JobError::NoDataSet`] if the folder has none.
pub fn subjects(folder: &Folder, study: &Study) -> Result<Vec<Subject>, JobError> {
    let there = |subject: &Subject| {
        let possible = !subject.extra_sensor() || study.extra_sensor.is_some();
        possible && folder.data_set(subject.scenario(), Purpose::Test).exists()
    };
    let subjects: Vec<Subject> = Subject::ALL.into_iter().filter(there).collect();
    match subjects.is_empty() {
        true => Err(JobError::NoDataSet { folder: folder.path().into() }),
        false => Ok(subjects),
    }
}

/// Reads the data sets of a subject.
///
/// # Errors
/// A file cannot be read, or contradicts the study.
pub fn data_set(folder: &Folder, study: &Study, subject: Subject) -> Result<DataSet, JobError> {
    let path = |purpose| folder.data_set(subject.scenario(), purpose);
    let wrong = |error| JobError::DataSet { path: path(Purpose::Test), error };
    let mut tables = vec![];
    for purpose in study.purposes() {
        let in_file = |error| JobError::DataSet { path: path(purpose), error };
        tables.push((purpose, Table::read(path(purpose)).map_err(|e| in_file(e.into()))?));
    }
    let mut features = data_features(study);
    features.retain(|known| subject.extra_sensor() || !known.extra);
    DataSet::new(&tables, features, &study.actuators, &study.actions()).map_err(wrong)
}

/// A pool number for each sensor with a band. Corresponding sensors of all actuators share a number.
pub fn pools(study: &Study) -> Vec<usize> {
    let sensors = &study.sensors.0[..study.base_sensors()];
    let like = |sensor: usize| sensors.iter().position(|s| s.quantity == sensors[sensor].quantity);
    let is_other = |sensor: usize| sensors[sensor].quantity == Quantity::Other;
    let pool = |sensor: usize| like(sensor).filter(|_| !is_other(sensor)).unwrap_or(sensor);
    (0..sensors.len()).map(pool).collect()
}

/// The input of a subject's training and evaluation. Reading the data and perturbing its windows takes longer than
/// training the trees.
struct Prepared {
    subject: Subject,
    /// The data set with every feature, including those without value for training.
    all_features: DataSet,
    /// The data set for training and evaluation: banded, and with training features only. It has perturbed rows if
    /// there are windows.
    data: DataSet,
}

impl Prepared {
    fn read(
        folder: &Folder,
        study: &Study,
        subject: Subject,
        workers: Workers,
    ) -> Result<Self, JobError> {
        let all_features = data_set(folder, study, subject)?;
        let windows = windows(folder, study, subject, &all_features)?;
        let taught = all_features.taught()?;
        let (mut data, _) = learn::banded(&taught, &subject.settings(study), &pools(study));
        if !windows.is_empty() {
            data = data.with_perturbed(&perturbation(study, subject, &windows), workers)?;
        }
        Ok(Self { subject, all_features, data })
    }

    /// Trains trees and committee with all training data, and writes them as a diagnoser of records, with what it answers in
    /// the records for judging.
    fn train(&self, folder: &Folder, study: &Study, workers: Workers) -> Result<Panel, JobError> {
        let Prepared { subject, data, .. } = self;
        let settings = subject.settings(study);
        let panel = learn::train(data, &settings, &pools(study), workers)?;
        let novelty = learn::novelty(data, &settings)?;
        let read = (study, subject.scenario(), subject.sensors(study));
        let diagnoser = train::of_records(read, panel.clone(), novelty)?;
        model_file::write_model(folder.records(*subject), &diagnoser)?;
        if !subject.extra_sensor() {
            let judged = FlownSuite::of_records((folder, study), *subject, data, &panel)?;
            judged.write(&folder.outcomes(&judged.suite, &judged.scenario))?;
        }
        Ok(panel)
    }

    fn evaluate(
        &self,
        study: &Study,
        trained: &Panel,
        workers: Workers,
        progress: &dyn Fn(&str, f64),
    ) -> Result<SubjectResult, JobError> {
        let Prepared { subject, all_features, data } = self;
        let (pools, settings) = (pools(study), subject.settings(study));
        let context = Context { trained, pools: &pools, all_features, workers, progress };
        let evaluation = learn::evaluate(data, &settings, &context)?;
        Ok(SubjectResult::new(*subject, study, settings, evaluation))
    }
}

impl Job<'_> {
    /// Trains and evaluates some subjects, and writes the models. Subjects are processed in parallel, because much of the
    /// work on one of them uses a single thread.
    ///
    /// # Errors
    /// A file is missing or cannot be read or written; training or evaluation fails.
    fn train_and_evaluate(&self, subjects: &[Subject]) -> Result<Vec<SubjectResult>, JobError> {
        let Job { study, folder, crew: Crew { workers, .. }, .. } = *self;
        let shares = Mutex::new(vec![0.0; subjects.len()]);
        let numbered: Vec<(usize, Subject)> = subjects.iter().copied().enumerate().collect();
        let evaluated = parallel::map(&numbered, workers, |&(place, subject)| {
            let told = |what: &str, share: f64| {
                let mut shares = shares.lock().unwrap_or_else(PoisonError::into_inner);
                shares[place] = share;
                let done = shares.iter().sum::<f64>() / (shares.len() as f64 + 0.2);
                self.tell(&format!("{}: {what}", subject.name()), done);
            };
            let prepared = Prepared::read(folder, study, subject, workers)?;
            let trained = prepared.train(folder, study, workers)?;
            prepared.evaluate(study, &trained, workers, &told).inspect(|_| told("done", 1.0))
        });
        evaluated?.into_iter().collect()
    }

    /// Writes the results of some subjects.
    ///
    /// # Errors
    /// The file cannot be written.
    fn write_results(&self, subjects: Vec<SubjectResult>) -> Result<Results, JobError> {
        let results = Results::new(self.study, subjects);
        model_file::write(self.folder.results(), &results)?;
        Ok(results)
    }
}

/// Reads the windows of all rows of a data set, in their order. Without training commands there is no perturbation and
/// the list is empty.
fn windows(
    folder: &Folder,
    study: &Study,
    subject: Subject,
    data: &DataSet,
) -> Result<Vec<Window>, JobError> {
    let mut windows = vec![];
    if !data.has_training() {
        return Ok(windows);
    }
    for purpose in study.purposes() {
        let scenarios = (purpose, vec![subject.scenario()]);
        let stored = Records::new(folder.path(), study, scenarios, Workers::new(1))?;
        for rows in stored.windows()? {
            // A data set has no rows for failed variants.
            let ran = rows.into_iter().filter(|row| row.failure.is_empty());
            windows.extend(ran.map(|row| row.window));
        }
    }
    if windows.len() != data.rows.len() {
        let path = folder.data_set(subject.scenario(), Purpose::Test);
        return Err(JobError::OtherRows { path, rows: data.rows.len(), windows: windows.len() });
    }
    Ok(windows)
}

/// The perturbation of training windows. The larger reach exceeds the windows' uncertainty, so that splits keep a
/// distance from the training data. It is largest without noise, where the uncertainty alone is small.
fn perturbation<'w>(study: &Study, subject: Subject, windows: &'w [Window]) -> Perturbation<'w> {
    let has_noise = subject.scenario().has_noise();
    let noise = study.sensors.0.iter().map(|s| if has_noise { s.noise } else { 0.0 });
    let features = data_features(study).into_iter().enumerate();
    let own = features
        .filter(|(_, known)| known.feature.teaches.of_records())
        .filter(|(_, known)| subject.extra_sensor() || !known.extra);
    Perturbation {
        sensors: study.sensors_in(subject.scenario()),
        windows,
        noise: noise.collect(),
        lasting: SOLVER_ERROR,
        columns: own.map(|(place, _)| place).collect(),
        reaches: if has_noise { &[1.0, 2.0] } else { &[1.0, 8.0] },
        draws: PERTURBED,
        seed: 1,
    }
}

/// Reads the bands, trees and committee trained for a subject.
///
/// # Errors
/// [`JobError::Missing`], or the file is no diagnoser.
pub fn panel(folder: &Folder, subject: Subject) -> Result<Panel, JobError> {
    let path = folder.records(subject);
    match path.exists() {
        true => Ok(model_file::read_diagnoser(path)?.lengths.swap_remove(0).panel),
        false => Err(JobError::Missing { path, command: "study" }),
    }
}
