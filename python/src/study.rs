//! `Study`: faults × operating cases, and the stages of the main job over folders.

use crate::errors::Failure;
use crate::long::{Watch, long};
use crate::system::System;
use crate::table::Table;
use pyo3::prelude::*;
use servotwin::campaign::columns::feature_columns_of;
use servotwin::campaign::{
    Campaign, CampaignError, CampaignOutcome, PreparedCampaign, Share, runs,
};
use servotwin::evaluation::EvaluationError;
use servotwin::job::{self, Among, Folder, JobError, data_card, manifest};
use servotwin::study::{Purpose, Scenario, Study as Inner, StudyError};
use servotwin::table::{Column, Table as Columns};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// A study: faults, intensities and operating cases, and how the diagnosis is trained and judged.
///
/// Parameters
/// ----------
/// path : path, optional
///     A study file, or the name of a built-in study; the study of the aileron by default.
///
/// Raises
/// ------
/// MistakesError
///     If the file has mistakes.
///
/// Examples
/// --------
/// >>> results = servotwin.Study().run("out")  # doctest: +SKIP
/// >>> results.table("noise").to_pandas()  # doctest: +SKIP
#[pyclass(frozen, module = "servotwin")]
pub struct Study {
    /// The study.
    pub inner: Arc<Inner>,
    path: String,
    /// Plans of campaigns that were needed once: a worker computes many pieces of one.
    plans: Mutex<Vec<Plan>>,
}

/// What a campaign is for, its scenarios, and its plan.
type Plan = (Purpose, Vec<Scenario>, Arc<PreparedCampaign>);

impl Study {
    fn made(inner: Inner, path: String) -> Self {
        Study { inner: Arc::new(inner), path, plans: Mutex::default() }
    }

    fn prepared(&self, campaign: &Campaign) -> Result<Arc<PreparedCampaign>, CampaignError> {
        let mut plans = self.plans.lock().unwrap_or_else(PoisonError::into_inner);
        let is_it = |plan: &&Plan| (plan.0, &plan.1) == (campaign.purpose, &campaign.scenarios);
        if let Some((_, _, known)) = plans.iter().find(is_it) {
            return Ok(known.clone());
        }
        let made = Arc::new(campaign.prepared()?);
        plans.push((campaign.purpose, campaign.scenarios.clone(), made.clone()));
        Ok(made)
    }
}

#[pymethods]
impl Study {
    #[new]
    #[pyo3(signature = (path = None))]
    fn new(py: Python<'_>, path: Option<PathBuf>) -> PyResult<Self> {
        let shown = path.as_ref().map_or("studies/paper.toml".into(), |p| p.display().to_string());
        let inner = py.detach(|| match path {
            Some(path) => Inner::read(path),
            None => Ok(Inner::default()),
        });
        Ok(Study::made(inner.map_err(Failure::from)?, shown))
    }

    /// Read a study from a text.
    ///
    /// Parameters
    /// ----------
    /// text : str
    ///     The content of a study file.
    /// path : str
    ///     The name of the file in mistakes; a relative path of the system starts from its folder.
    /// system : str, optional
    ///     The content of a system file, instead of the system that the study names.
    ///
    /// Returns
    /// -------
    /// Study
    #[staticmethod]
    #[pyo3(signature = (text, path = "study.toml", system = None))]
    fn parse(py: Python<'_>, text: &str, path: &str, system: Option<&str>) -> PyResult<Self> {
        let parse = || -> Result<Inner, Failure> {
            let Some(system) = system else { return Ok(Inner::parse(text, path)?) };
            let system = servotwin::system::System::parse(system, "system.toml")?;
            Ok(Inner::parse_for(text, path, system)?)
        };
        Ok(Study::made(py.detach(parse)?, path.into()))
    }

    /// The name in files.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    /// One line for people.
    #[getter]
    fn title(&self) -> &str {
        &self.inner.title
    }

    /// The text of the file.
    #[getter]
    fn text(&self) -> &str {
        &self.inner.text
    }

    /// The system.
    #[getter]
    fn system(&self) -> PyResult<System> {
        Ok(System::parsed(&self.inner.system.text, "system.toml")?)
    }

    /// The names of the operating cases that are judged.
    #[getter]
    fn cases(&self) -> Vec<&str> {
        self.inner.cases.iter().map(|case| case.name.as_str()).collect()
    }

    /// Every fault with every intensity, and the actuator that has it.
    #[getter]
    fn faults(&self) -> Table {
        let faults = &self.inner.faults;
        let units = &self.inner.units;
        let text = |name: &str, of: &dyn Fn(usize) -> String| {
            Column::new(name, "", (0..faults.len()).map(of).collect::<Vec<_>>())
        };
        let intensity: Vec<f64> = faults.iter().map(|fault| fault.at.intensity).collect();
        let columns = vec![
            text("id", &|k| faults[k].id.clone()),
            text("unit", &|k| units[faults[k].unit].clone()),
            text("kind", &|k| faults[k].kind.clone()),
            Column::new("intensity", "", intensity),
        ];
        Columns::from_columns(columns).expect("different names, one length").into()
    }

    /// Run the whole study: simulate, train, evaluate, and write the report.
    ///
    /// An interrupted study resumes where it stopped, and writes the same bytes.
    ///
    /// Parameters
    /// ----------
    /// out : path
    ///     The output folder.
    /// fitted : bool
    ///     Whether to simulate the scenario "fitted", too.
    /// replace : bool
    ///     Whether to remove the results of another study from the folder.
    /// threads : int, optional
    ///     The number of threads; all processors by default. The results do not depend on it.
    /// progress : bool or callable
    ///     True for a bar of tqdm, False for none, or a function of the task, the amount done and the
    ///     whole amount.
    ///
    /// Returns
    /// -------
    /// Results
    ///
    /// Raises
    /// ------
    /// StageError
    ///     If the folder belongs to another study, or a stage fails.
    #[pyo3(signature = (out, *, fitted = false, replace = false, threads = None, progress = None))]
    fn run<'py>(
        slf: &Bound<'py, Self>,
        out: PathBuf,
        fitted: bool,
        replace: bool,
        #[pyo3(from_py_with = crate::array::threads_or_none)] threads: Option<usize>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        // The bar of progress is Python's.
        let run = slf.py().import("servotwin.study")?.getattr("_run")?;
        run.call1((slf, out, fitted, replace, threads, progress))
    }

    /// Return the same study in its full size; a study that declares a quick size has that one first.
    ///
    /// Returns
    /// -------
    /// Study
    fn full(&self, py: Python<'_>) -> PyResult<Self> {
        let inner = py.detach(|| self.inner.full());
        Ok(Study::made(inner.map_err(Failure::from)?, self.path.clone()))
    }

    fn __repr__(&self) -> String {
        let (faults, cases) = (self.inner.faults.len(), self.inner.cases.len());
        format!("Study('{}', {faults} faults x {cases} cases)", self.inner.name)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let make = slf.py().get_type::<Study>().getattr("parse")?;
        let Study { inner, path, .. } = slf.get();
        let arguments = (inner.text.clone(), path.clone(), inner.system.text.clone());
        Ok((make, arguments).into_pyobject(slf.py())?.into_any())
    }
}

fn chosen(scenarios: Option<Vec<String>>) -> Result<Vec<Scenario>, Failure> {
    let usual = || Scenario::ALL.into_iter().filter(|scenario| scenario.is_usual()).collect();
    let Some(names) = scenarios else { return Ok(usual()) };
    names.iter().map(|name| scenario(name)).collect()
}

/// A scenario by its name.
///
/// # Errors
/// There is none of this name.
pub fn scenario(name: &str) -> Result<Scenario, Failure> {
    let found = Scenario::ALL.into_iter().find(|scenario| scenario.name() == name);
    found.ok_or_else(|| {
        let known = Scenario::ALL.map(Scenario::name).join(", ");
        Failure::value(format!("there is no scenario '{name}'; there are {known}"))
    })
}

/// That the study does not have what a scenario needs.
fn missing(wanted: &[Scenario], study: &Inner) -> Failure {
    match wanted.first() {
        Some(&scenario) => CampaignError::no_section(scenario, study).into(),
        None => Failure::value("scenarios are empty"),
    }
}

fn purpose(is_training: bool) -> Purpose {
    if is_training { Purpose::Train } else { Purpose::Test }
}

fn planned<'s>(
    study: &'s Inner,
    purpose: Purpose,
    scenarios: Vec<Scenario>,
    folder: &Folder,
    threads: Option<usize>,
    watch: &'s Watch,
) -> Campaign<'s> {
    Campaign {
        scenarios: scenarios.clone(),
        workers: watch.workers(threads),
        ..Campaign::stored(folder.path(), study, scenarios[0], purpose)
    }
}

/// The title of a campaign's progress.
pub fn name(purpose: Purpose, scenarios: &[Scenario]) -> String {
    let names: Vec<&str> = scenarios.iter().map(|scenario| scenario.name()).collect();
    let training = if purpose == Purpose::Train { ", training commands" } else { "" };
    format!("simulating {}{training}", names.join(" and "))
}

/// What a campaign has done, as Python sees it: scenarios, training, variants, resumed, failures.
type Done = (Vec<&'static str>, bool, usize, usize, Vec<(String, usize, String)>);

fn done(
    purpose: Purpose,
    scenarios: &[Scenario],
    outcome: CampaignOutcome,
) -> Result<Done, Failure> {
    if outcome.cancelled {
        return Err(CampaignError::Cancelled.into());
    }
    let failed =
        outcome.failed.into_iter().map(|(s, variant, why)| (s.name().into(), variant, why));
    let names = scenarios.iter().map(|scenario| scenario.name()).collect();
    let is_training = purpose == Purpose::Train;
    Ok((names, is_training, outcome.variants, outcome.resumed, failed.collect()))
}

/// Simulates every fault of a study in every case, into data sets; or one share of it into parts.
#[pyfunction]
#[pyo3(signature = (study, out, scenarios = None, threads = None, share = None, progress = None))]
pub fn run_campaign(
    py: Python<'_>,
    study: &Study,
    out: PathBuf,
    scenarios: Option<Vec<String>>,
    #[pyo3(from_py_with = crate::array::threads_or_none)] threads: Option<usize>,
    share: Option<&str>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Vec<Done>> {
    let wanted = chosen(scenarios)?;
    let share: Option<Share> = share.map(str::parse).transpose().map_err(Failure::value)?;
    let (study, folder) = (&*study.inner, Folder::new(out));
    let result = long(py, progress.as_ref(), |watch| -> Result<Vec<Done>, Failure> {
        let runs = runs(study, |scenario| wanted.contains(&scenario));
        if runs.is_empty() {
            return Err(missing(&wanted, study));
        }
        let _hold = match share {
            Some(_) => folder.join_study(study)?,
            None => folder.keep_study(study, false)?.hold,
        };
        let (mut list, mut parts) = (vec![], 0);
        for (purpose, scenarios) in runs {
            let campaign = planned(study, purpose, scenarios.clone(), &folder, threads, watch);
            let what = name(purpose, &scenarios);
            let told = |done, all| watch.tell(&what, done, all);
            let outcome = match share {
                None => campaign.run(told)?,
                Some(share) => {
                    let (outcome, count) = campaign.run_share(share, parts, told)?;
                    parts += count;
                    outcome
                }
            };
            list.push(done(purpose, &scenarios, outcome)?);
        }
        if share.is_none() {
            data_card::write(&folder, study)?;
            manifest::write(&folder, study)?;
        }
        Ok(list)
    })?;
    Ok(result?)
}

/// A piece of a campaign that runs anywhere: (scenarios, training, part, files, rows, the file with
/// calibrated specimens that it needs).
type Task = (Vec<&'static str>, bool, usize, Vec<String>, usize, Option<String>);

/// The pieces of a study's campaigns.
#[pyfunction]
#[pyo3(signature = (study, scenarios = None))]
pub fn tasks(py: Python<'_>, study: &Study, scenarios: Option<Vec<String>>) -> PyResult<Vec<Task>> {
    let wanted = chosen(scenarios)?;
    let list = py.detach(|| -> Result<Vec<Task>, Failure> {
        let (watch, folder, mut list) = (Watch::default(), Folder::new(""), vec![]);
        let runs = runs(&study.inner, |scenario| wanted.contains(&scenario));
        if runs.is_empty() {
            return Err(missing(&wanted, &study.inner));
        }
        for (purpose, scenarios) in runs {
            let names: Vec<&str> = scenarios.iter().map(|scenario| scenario.name()).collect();
            let campaign = planned(&study.inner, purpose, scenarios, &folder, None, &watch);
            let prepared = study.prepared(&campaign)?;
            list.extend((0..prepared.part_count()).map(|part| {
                let (files, rows) = campaign.part_files(&prepared, part);
                let is_training = purpose == Purpose::Train;
                (names.clone(), is_training, part, files, rows, campaign.calibration())
            }));
        }
        Ok(list)
    })?;
    Ok(list)
}

/// Fits the specimens of the scenario `fitted` into the folder, unless they are there.
#[pyfunction]
#[pyo3(signature = (study, out, training, threads = None))]
pub fn run_calibration(
    py: Python<'_>,
    study: &Study,
    out: PathBuf,
    training: bool,
    #[pyo3(from_py_with = crate::array::threads_or_none)] threads: Option<usize>,
) -> PyResult<()> {
    let (study, folder) = (&*study.inner, Folder::new(out));
    let result = long(py, None, |watch| -> Result<(), Failure> {
        let _hold = folder.hold(Among::Parts)?;
        let fitted = vec![Scenario::Fitted];
        Ok(planned(study, purpose(training), fitted, &folder, threads, watch).calibrate()?)
    })?;
    Ok(result?)
}

/// Simulates one part into a folder: (rows, of them found done).
#[pyfunction]
#[pyo3(signature = (study, out, scenarios, training, part, threads = None))]
pub fn run_task(
    py: Python<'_>,
    study: &Study,
    out: PathBuf,
    scenarios: Vec<String>,
    training: bool,
    part: usize,
    #[pyo3(from_py_with = crate::array::threads_or_none)] threads: Option<usize>,
) -> PyResult<(usize, usize)> {
    let (scenarios, folder) = (chosen(Some(scenarios))?, Folder::new(out));
    let result = long(py, None, |watch| -> Result<(usize, usize), Failure> {
        let _hold = folder.hold(Among::Parts)?;
        let campaign = planned(&study.inner, purpose(training), scenarios, &folder, threads, watch);
        let prepared = study.prepared(&campaign)?;
        let outcome = campaign.run_parts(&prepared, &[part], |_, _| ())?;
        if outcome.cancelled {
            return Err(CampaignError::Cancelled.into());
        }
        Ok((outcome.variants, outcome.resumed))
    })?;
    Ok(result?)
}

/// Joins parts to data sets.
#[pyfunction]
#[pyo3(signature = (out, scenarios = None, progress = None))]
pub fn merge_parts(
    py: Python<'_>,
    out: PathBuf,
    scenarios: Option<Vec<String>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Vec<Done>> {
    let (wanted, folder) = (chosen(scenarios)?, Folder::new(out));
    let result = long(py, progress.as_ref(), |watch| -> Result<Vec<Done>, Failure> {
        let (study, _hold) = folder.open()?;
        let mut list = vec![];
        for (purpose, scenarios) in runs(&study, |scenario| wanted.contains(&scenario)) {
            let campaign = planned(&study, purpose, scenarios.clone(), &folder, None, watch);
            list.push(done(purpose, &scenarios, campaign.merge()?)?);
        }
        data_card::write(&folder, &study)?;
        manifest::write(&folder, &study)?;
        Ok(list)
    })?;
    Ok(result?)
}

/// Writes the texts of study and system into a folder in which others may work.
#[pyfunction]
pub fn join_study(py: Python<'_>, study: &Study, out: PathBuf) -> PyResult<()> {
    let folder = Folder::new(out);
    Ok(py.detach(|| folder.join_study(&study.inner).map(drop)).map_err(Failure::from)?)
}

/// Trains trees and committees of a folder; subject and file of each.
#[pyfunction]
#[pyo3(signature = (out, threads = None, progress = None))]
pub fn train_folder(
    py: Python<'_>,
    out: PathBuf,
    #[pyo3(from_py_with = crate::array::threads_or_none)] threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Vec<(String, PathBuf)>> {
    let folder = Folder::new(out);
    let result = long(py, progress.as_ref(), |watch| -> Result<_, Failure> {
        let (study, _hold) = folder.open()?;
        let workers = watch.workers(threads);
        watch.tell("training", 0, 1);
        let trained = job::train_all(&folder, &study, workers)?;
        watch.tell("training", 1, 1);
        manifest::write(&folder, &study)?;
        let file = |(subject, _): &(job::Subject, _)| {
            (subject.name().to_owned(), folder.records(*subject))
        };
        Ok(trained.iter().map(file).collect())
    })?;
    Ok(result?)
}

/// Evaluates every data set of a folder; the results as JSON.
#[pyfunction]
#[pyo3(signature = (out, threads = None, progress = None))]
pub fn evaluate_folder(
    py: Python<'_>,
    out: PathBuf,
    #[pyo3(from_py_with = crate::array::threads_or_none)] threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let folder = Folder::new(out);
    let result = long(py, progress.as_ref(), |watch| -> Result<String, Failure> {
        let (study, _hold) = folder.open()?;
        let workers = watch.workers(threads);
        let told = |what: &str, share: f64| watch.tell(what, (share * 1000.0) as usize, 1000);
        let results = job::evaluate_all(&folder, &study, workers, &told)?;
        manifest::write(&folder, &study)?;
        Ok(serde_json::to_string(&results).expect("results are JSON"))
    })?;
    Ok(result?)
}

/// Writes the report of a folder; its file.
#[pyfunction]
pub fn write_report(py: Python<'_>, out: PathBuf) -> PyResult<PathBuf> {
    let folder = Folder::new(out);
    let result = long(py, None, |_| -> Result<PathBuf, Failure> {
        let (study, _hold) = folder.open()?;
        servotwin_report::write(&folder, &study)?;
        Ok(folder.report())
    })?;
    Ok(result?)
}

/// The data set of a scenario in a folder.
#[pyfunction]
#[pyo3(signature = (out, scenario = "noise", training = false))]
pub fn data_set(py: Python<'_>, out: PathBuf, scenario: &str, training: bool) -> PyResult<Table> {
    let path = Folder::new(out).data_set(self::scenario(scenario)?, purpose(training));
    let table = py.detach(|| servotwin::table::read(path)).map_err(Failure::from)?;
    Ok(table.into())
}

/// The columns among these that are features of a data set.
#[pyfunction]
pub fn feature_columns(names: Vec<String>) -> Vec<String> {
    let features = feature_columns_of(names.iter().map(String::as_str));
    features.into_iter().map(str::to_owned).collect()
}

/// Reads the text of a study as results keep it, with its system.
#[pyfunction]
pub fn study_of(py: Python<'_>, out: PathBuf) -> PyResult<Study> {
    let folder = Folder::new(out);
    let path = folder.study().display().to_string();
    let inner = py.detach(|| folder.read_study()).map_err(Failure::from)?;
    Ok(Study::made(inner, path))
}

impl From<CampaignError> for Failure {
    fn from(error: CampaignError) -> Self {
        match error {
            CampaignError::File(error) => error.into(),
            CampaignError::Table(error) => error.into(),
            error => Failure::stage(error),
        }
    }
}

impl From<EvaluationError> for Failure {
    fn from(error: EvaluationError) -> Self {
        match error {
            EvaluationError::File(error) => error.into(),
            EvaluationError::Table(error) => error.into(),
            error => Failure::stage(error),
        }
    }
}

impl From<JobError> for Failure {
    fn from(error: JobError) -> Self {
        match error {
            JobError::File(error) => error.into(),
            JobError::Study(error) => StudyError::into(*error),
            JobError::Campaign(error) => error.into(),
            JobError::Evaluation(error) => error.into(),
            error => {
                let file = match &error {
                    JobError::NoDataSet { folder }
                    | JobError::Busy { folder }
                    | JobError::OtherStudy { folder } => Some(folder.clone()),
                    JobError::Missing { path, .. } | JobError::DataSet { path, .. } => {
                        Some(path.clone())
                    }
                    _ => None,
                };
                let failure = Failure::stage(&error);
                match file {
                    Some(file) => failure.in_file(file.display()),
                    None => failure,
                }
            }
        }
    }
}
