//! Suites of a study, whole or in tasks that are computed by themselves, be it on other machines.

use crate::errors::Failure;
use crate::long::{Watch, long};
use crate::study::{Study, scenario};
use pyo3::prelude::*;
use servotwin::job::tasks::Task;
use servotwin::job::{Among, Crew, Folder, Hold, Job, JobError};
use servotwin::records::RunError;
use servotwin::run::part::Share;
use servotwin::study::Scenario;
use std::path::PathBuf;

/// Suite, scenarios, number of the part, files, runs, and the files that are needed before.
type Told = (String, Vec<String>, usize, Vec<String>, usize, Vec<String>);

/// The wanted scenarios; by default the usual ones, or those of tests on the ground.
fn wanted(study: &Study, names: Option<Vec<String>>) -> Result<impl Fn(Scenario) -> bool, Failure> {
    let is_on_ground = study.inner.is_on_ground();
    let named =
        names.map(|names| names.iter().map(|name| scenario(name)).collect::<Result<Vec<_>, _>>());
    let named = named.transpose()?;
    Ok(move |scenario: Scenario| match &named {
        Some(named) => named.contains(&scenario),
        None => scenario.is_usual() || is_on_ground,
    })
}

/// A study, and its output folder.
struct At<'s> {
    study: &'s Study,
    folder: Folder,
}

impl At<'_> {
    fn job(&self) -> Job<'_> {
        Job::new(&self.study.inner, &self.folder)
    }

    /// Does work that holds the folder.
    fn work(
        &self,
        py: Python<'_>,
        (threads, progress): (Option<usize>, Option<Py<PyAny>>),
        hold: impl FnOnce(&Folder) -> Result<Hold, JobError> + Send,
        work: impl FnOnce(Job) -> Result<(), Failure> + Send,
    ) -> PyResult<()> {
        let result = long(py, progress.as_ref(), |watch: &Watch| -> Result<(), Failure> {
            let _hold = hold(&self.folder)?;
            let told = |what: &str, share: f64| watch.tell(what, (share * 1000.0) as usize, 1000);
            let crew = Crew { workers: watch.workers(threads), progress: &told };
            work(Job { crew, ..self.job() })?;
            match watch.workers(None).is_cancelled() {
                true => Err(RunError::Cancelled.into()),
                false => Ok(()),
            }
        })?;
        Ok(result?)
    }
}

/// Runs suites into a folder, or a share of their parts.
#[pyfunction]
#[pyo3(signature = (study, out, suites, scenarios = None, share = None, threads = None, progress = None))]
#[expect(clippy::too_many_arguments, reason = "they are Python's")]
pub(crate) fn run_suites(
    py: Python<'_>,
    study: &Study,
    out: PathBuf,
    suites: Vec<String>,
    scenarios: Option<Vec<String>>,
    share: Option<&str>,
    #[pyo3(from_py_with = crate::array::threads_or_none)] threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<()> {
    let wanted = wanted(study, scenarios)?;
    let share: Option<Share> = share.map(str::parse).transpose().map_err(Failure::value)?;
    let at = At { study, folder: Folder::new(out) };
    let inner = &study.inner;
    let hold = |folder: &Folder| match share {
        Some(_) => folder.join_study(inner),
        None => Ok(folder.keep_study(inner, false)?.hold),
    };
    at.work(py, (threads, progress), hold, |job| {
        let tasks = job.tasks(&suites, &wanted)?;
        if tasks.is_empty() {
            return Err(Failure::value("none of these suites has runs in these scenarios"));
        }
        let Some(share) = share else {
            return Ok(job.run_suites(&suites, &wanted).map(drop)?);
        };
        let own = tasks.into_iter().enumerate().filter(|(number, _)| share.holds(*number));
        let own: Vec<Task> = own.map(|(_, task)| task).collect();
        Ok(job.run(&own)?)
    })
}

/// The tasks of suites.
#[pyfunction]
#[pyo3(signature = (study, suites, scenarios = None))]
pub(crate) fn tasks_of(
    py: Python<'_>,
    study: &Study,
    suites: Vec<String>,
    scenarios: Option<Vec<String>>,
) -> PyResult<Vec<Told>> {
    let (wanted, at) = (wanted(study, scenarios)?, At { study, folder: Folder::new("") });
    let tasks = py.detach(|| at.job().tasks(&suites, wanted)).map_err(Failure::from)?;
    let told = |Task { suite, scenarios, part, files, runs, needs }: Task| {
        let names = scenarios.iter().map(|scenario| scenario.name().into()).collect();
        (suite, names, part, files, runs, needs)
    };
    Ok(tasks.into_iter().map(told).collect())
}

/// Computes the files of a task in a folder that may hold nothing but what it needs.
#[pyfunction]
#[pyo3(signature = (study, out, task, threads = None))]
pub(crate) fn run_task(
    py: Python<'_>,
    study: &Study,
    out: PathBuf,
    task: Told,
    #[pyo3(from_py_with = crate::array::threads_or_none)] threads: Option<usize>,
) -> PyResult<()> {
    let (suite, names, part, files, runs, needs) = task;
    let scenarios = names.iter().filter_map(|name| Scenario::named(name)).collect();
    let task = Task { suite, scenarios, part, files, runs, needs };
    let at = At { study, folder: Folder::new(out) };
    at.work(py, (threads, None), |folder| folder.hold(Among::Parts), |job| Ok(job.run(&[task])?))
}

/// Writes a file that tasks need.
#[pyfunction]
#[pyo3(signature = (study, out, file, threads = None))]
pub(crate) fn prepare_file(
    py: Python<'_>,
    study: &Study,
    out: PathBuf,
    file: &str,
    #[pyo3(from_py_with = crate::array::threads_or_none)] threads: Option<usize>,
) -> PyResult<()> {
    let at = At { study, folder: Folder::new(out) };
    at.work(py, (threads, None), |folder| folder.hold(Among::Parts), |job| Ok(job.prepare(file)?))
}

/// Joins the parts of suites in a folder.
#[pyfunction]
#[pyo3(signature = (study, out, suites, scenarios = None, threads = None))]
pub(crate) fn join_suites(
    py: Python<'_>,
    study: &Study,
    out: PathBuf,
    suites: Vec<String>,
    scenarios: Option<Vec<String>>,
    #[pyo3(from_py_with = crate::array::threads_or_none)] threads: Option<usize>,
) -> PyResult<()> {
    let (wanted, at) = (wanted(study, scenarios)?, At { study, folder: Folder::new(out) });
    let inner = &study.inner;
    let hold = |folder: &Folder| Ok(folder.keep_study(inner, false)?.hold);
    at.work(py, (threads, None), hold, |job| Ok(job.join(&suites, &wanted)?))
}
