//! `Study`: faults × operating cases, and the stages of the main job over folders.

use crate::errors::Failure;
use crate::long::long;
use crate::system::System;
use crate::table::{Table, table_of};
use pyo3::prelude::*;
use servotwin::job::{Folder, JobError};
use servotwin::learn::EvaluationError;
use servotwin::records::RunError;
use servotwin::records::columns::feature_columns_of;
use servotwin::study::{Purpose, Scenario, Study as Inner};
use servotwin::table::Column;
use std::path::PathBuf;
use std::sync::Arc;

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
pub(crate) struct Study {
    /// The study.
    pub(crate) inner: Arc<Inner>,
    path: String,
}

impl Study {
    fn made(inner: Inner, path: String) -> Self {
        Study { inner: Arc::new(inner), path }
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
        let lines = &self.inner.faults;
        table_of(vec![
            Column::of("id", "", lines, |fault| fault.id.clone()),
            Column::of("actuator", "", lines, |fault| self.inner.actuators[fault.actuator].clone()),
            Column::of("kind", "", lines, |fault| fault.kind.clone()),
            Column::of("intensity", "", lines, |fault| fault.at.intensity),
        ])
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

/// A scenario by its name.
///
/// # Errors
/// There is none of this name.
pub(crate) fn scenario(name: &str) -> Result<Scenario, Failure> {
    let found = Scenario::ALL.into_iter().find(|scenario| scenario.name() == name);
    found.ok_or_else(|| {
        let known = Scenario::ALL.map(Scenario::name).join(", ");
        Failure::value(format!("there is no scenario '{name}'; there are {known}"))
    })
}

/// Writes the report of a folder; its file.
#[pyfunction]
pub(crate) fn write_report(py: Python<'_>, out: PathBuf) -> PyResult<PathBuf> {
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
pub(crate) fn data_set(
    py: Python<'_>,
    out: PathBuf,
    scenario: &str,
    training: bool,
) -> PyResult<Table> {
    let purpose = if training { Purpose::Train } else { Purpose::Test };
    let path = Folder::new(out).data_set(self::scenario(scenario)?, purpose);
    let table = py.detach(|| servotwin::table::Table::read(path)).map_err(Failure::from)?;
    Ok(table.into())
}

/// The columns among these that are features of a data set.
#[pyfunction]
pub(crate) fn feature_columns(names: Vec<String>) -> Vec<String> {
    let features = feature_columns_of(names.iter().map(String::as_str));
    features.into_iter().map(str::to_owned).collect()
}

impl From<RunError> for Failure {
    fn from(error: RunError) -> Self {
        match error {
            RunError::File(error) => error.into(),
            RunError::Table(error) => error.into(),
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
            JobError::Study(error) => (*error).into(),
            JobError::Run(error) => error.into(),
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
