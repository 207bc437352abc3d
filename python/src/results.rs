//! `Results`: what a study has left in its output folder.

use crate::diagnoser::Diagnoser;
use crate::errors::Failure;
use crate::long::long;
use crate::model::{Tree, stage_trees};
use crate::study::{Study, scenario};
use crate::table::Table;
use pyo3::prelude::*;
use servotwin::job::{Crew, Folder, Job, JobError, StudyResults, StudyRun};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The results of a study, in its output folder.
///
/// `Study.run` returns them; `Results(out)` reads those of an earlier run.
///
/// Parameters
/// ----------
/// out : path
///     The output folder of an evaluated study, or of flights.
///
/// Raises
/// ------
/// StageError
///     If the folder has neither an evaluation nor flights.
#[pyclass(frozen, module = "servotwin")]
pub(crate) struct Results {
    inner: StudyResults,
}

#[pymethods]
impl Results {
    #[new]
    fn new(py: Python<'_>, out: PathBuf) -> PyResult<Self> {
        let inner = py.detach(|| StudyResults::read(out)).map_err(Failure::from)?;
        Ok(Results { inner })
    }

    /// The output folder.
    #[getter]
    fn folder(&self) -> PathBuf {
        self.inner.folder().path().to_owned()
    }

    /// The evaluation of every scenario, as `evaluation.json` holds it.
    #[getter]
    fn evaluation<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        python(py, &self.inner.evaluation)
    }

    /// The results of the flights, as `flights.json` holds them; None for a study without flights.
    #[getter]
    fn flights<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        python(py, &self.inner.flights)
    }

    /// The data card, Markdown that describes the data sets; None in folders of earlier versions.
    #[getter]
    fn data_card(&self) -> PyResult<Option<String>> {
        Ok(self.inner.data_card().map_err(Failure::from)?)
    }

    /// The trees of every evaluated scenario: `results.trees["noise"]["A"]`.
    #[getter]
    fn trees(&self) -> PyResult<BTreeMap<&'static str, BTreeMap<String, Tree>>> {
        let subjects = self.inner.evaluation.subjects.iter().map(|result| result.subject);
        let own = subjects.filter(|subject| !subject.extra_sensor());
        let read = own.map(|subject| {
            let trees = self.inner.trees(subject.scenario()).map_err(Failure::from)?;
            Ok((subject.name(), stage_trees(&trees).into_iter().collect()))
        });
        read.collect()
    }

    /// The data set of a scenario: labels and features, one row for each variant.
    ///
    /// Parameters
    /// ----------
    /// name : str
    ///     The scenario: "ideal", "noise", "fitted" or "realistic".
    ///
    /// Returns
    /// -------
    /// Table
    #[pyo3(signature = (name = "noise"))]
    fn table(&self, py: Python<'_>, name: &str) -> PyResult<Table> {
        let scenario = scenario(name)?;
        let table = py.detach(|| self.inner.table(scenario)).map_err(Failure::from)?;
        Ok(table.into())
    }

    /// The diagnoser that the flights of a scenario have trained.
    ///
    /// Parameters
    /// ----------
    /// name : str
    ///     The scenario: "noise" or "realistic".
    ///
    /// Returns
    /// -------
    /// Diagnoser
    #[pyo3(signature = (name = "realistic"))]
    fn diagnoser(&self, py: Python<'_>, name: &str) -> PyResult<Diagnoser> {
        let scenario = scenario(name)?;
        let trained = py.detach(|| self.inner.diagnoser(scenario)).map_err(Failure::from)?;
        Ok(Diagnoser::fresh(trained)?)
    }

    /// The report, which a notebook shows.
    ///
    /// Returns
    /// -------
    /// Report
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let path = py.import("pathlib")?.call_method1("Path", (self.inner.folder().report(),))?;
        py.import("servotwin.study")?.call_method1("Report", (path,))
    }

    fn __repr__(&self) -> String {
        format!("Results('{}')", self.inner.folder().path().display())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let make = slf.py().get_type::<Results>();
        Ok((make, (slf.get().folder(),)).into_pyobject(slf.py())?.into_any())
    }
}

/// A result as Python's own dicts and lists.
fn python<'py>(py: Python<'py>, result: &impl serde::Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(result).expect("results are JSON");
    py.import("json")?.call_method1("loads", (text,))
}

/// Runs a whole study.
#[pyfunction]
#[pyo3(signature = (study, out, fitted = false, replace = false, threads = None, progress = None))]
pub(crate) fn run_study(
    py: Python<'_>,
    study: &Study,
    out: PathBuf,
    fitted: bool,
    replace: bool,
    #[pyo3(from_py_with = crate::array::threads_or_none)] threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Results> {
    let result = long(py, progress.as_ref(), |watch| -> Result<_, JobError> {
        let folder = Folder::new(&out);
        let told = |what: &str, share: f64| watch.tell(what, (share * 1000.0) as usize, 1000);
        let crew = Crew { workers: watch.workers(threads), progress: &told };
        let job = Job { crew, ..Job::new(&study.inner, &folder) };
        let run = StudyRun { fitted, replace, ..StudyRun::new(job) };
        servotwin_report::write(run.run()?.folder(), &study.inner)?;
        // Read again, so that the folder is free for others while Python keeps the results.
        StudyResults::read(&out)
    })?;
    Ok(Results { inner: result.map_err(Failure::from)? })
}
