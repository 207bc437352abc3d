//! Whole records: watched by a diagnosis, or fitted by the twin's parameters.

use crate::diagnoser::Diagnoser;
use crate::errors::Failure;
use crate::long::long;
use crate::study::Study;
use crate::table::{Table, table_of};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use servotwin::fit::{Fit, FitError, FitRecord, FitResults as Solved, Unknown};
use servotwin::table::Column;
use servotwin_watch::whole_table::{TableFindings, TableWatchError, watch_table};
use std::ffi::CString;

/// Watch a record with twin and diagnosis.
///
/// Parameters
/// ----------
/// study : Study
///     The study whose system the record comes from.
/// diagnoser : Diagnoser
///     The diagnoser, which is not changed.
/// log : Table
///     One row for each sample. Columns are found by their names as `servotwin watch` finds them, with units; one is
///     the time. What may be wrong with the table is a `UserWarning`.
///
/// Returns
/// -------
/// Table
///     One row for each finding that differs from the one before: time_s, state, phase, actuator, action,
///     component, confidence and the finding in words.
///
/// Raises
/// ------
/// InputError
///     If the table lacks the time or the command, its values contradict its columns, or nothing could be judged.
/// StageError
///     If the diagnoser belongs to another study.
#[pyfunction]
pub(crate) fn watch(
    py: Python<'_>,
    study: &Study,
    diagnoser: &Diagnoser,
    log: &Table,
) -> PyResult<Table> {
    let (study, trained, log) = (&*study.inner, diagnoser.trained(), &*log.inner);
    let watched = long(py, None, |watch| watch_table(study, &trained, log, &watch.cancel))?;
    let TableFindings { changes: lines, warnings } = watched.map_err(|error| match error {
        TableWatchError::Diagnoser(error) => Failure::stage(error),
        error => Failure::value(error),
    })?;
    for warning in warnings {
        let text = CString::new(warning.replace('\0', " ")).expect("no zero is left");
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)?;
    }
    let columns = vec![
        Column::of("time_s", "s", &lines, |(time_s, _)| *time_s),
        Column::of("state", "", &lines, |(_, finding)| finding.state.words().to_owned()),
        Column::of("phase", "", &lines, |(_, finding)| finding.phase.words().to_owned()),
        Column::of("actuator", "", &lines, |(_, finding)| {
            finding.actuator.clone().unwrap_or_default()
        }),
        Column::of("action", "", &lines, |(_, finding)| finding.action.clone()),
        Column::of("component", "", &lines, |(_, finding)| finding.detail.clone()),
        Column::of("confidence", "", &lines, |(_, finding)| finding.confidence),
        Column::of("finding", "", &lines, |(_, finding)| finding.words()),
    ];
    Ok(table_of(columns))
}

/// A fit of the twin to a record, which `fit_record` returns.
#[pyclass(frozen, module = "servotwin", get_all)]
pub(crate) struct Fitted {
    /// Whether parameters within their tolerances explain the record.
    is_update: bool,
    /// The verdict as a sentence.
    verdict: String,
    /// Everything that the tolerances do not explain, as sentences.
    findings: Vec<String>,
    /// The text of the system file with the fitted parameters; None if the fit is no update.
    system_text: Option<String>,
    /// The parameters: name, unit, nominal and fitted value, standard error, and how well each is known.
    parameters: Py<Table>,
}

#[pymethods]
impl Fitted {
    fn __repr__(&self) -> String {
        format!("Fitted('{}')", self.verdict)
    }
}

/// Fit the parameters of the twin to a record of its actuator.
///
/// Parameters
/// ----------
/// study : Study
///     The study with the tolerances and faults.
/// log : Table
///     One row for each sample. Columns have the names of inputs and sensors, with or without the suffix of
///     their unit, in SI; the time is in seconds.
/// threads : int, optional
///     The number of threads; all processors by default. The result does not depend on it.
///
/// Returns
/// -------
/// Fitted
///
/// Raises
/// ------
/// InputError
///     If the table cannot be a record of this system.
/// StageError
///     If the fit fails.
#[pyfunction]
#[pyo3(signature = (study, log, *, threads = None))]
pub(crate) fn fit_record(
    py: Python<'_>,
    study: &Study,
    log: &Table,
    #[pyo3(from_py_with = crate::array::threads_or_none)] threads: Option<usize>,
) -> PyResult<Fitted> {
    let (study, log) = (&*study.inner, &*log.inner);
    let (parameters, fitted, verdict, system_text) = long(py, None, |watch| {
        let record =
            FitRecord::from_table("the record", log, &study.system).map_err(Failure::value)?;
        let problem = Fit {
            threads: watch.workers(threads).threads(),
            cancel: Some(&watch.cancel),
            ..Fit::of_study(study, vec![record])
        };
        let failed = |error: FitError| match error {
            error @ FitError::Record { .. } => Failure::value(error),
            error => Failure::stage(error),
        };
        let fitted = problem.solve().map_err(failed)?;
        let verdict = problem.verdict(&fitted).map_err(failed)?;
        let text = fitted.is_update().then(|| fitted.system_text(&problem)).transpose();
        let text = text.map_err(Failure::stage)?;
        Ok::<_, Failure>((parameters(&problem, &fitted), fitted, verdict, text))
    })??;
    Ok(Fitted {
        is_update: fitted.is_update(),
        verdict: verdict.sentence,
        findings: fitted.findings,
        system_text,
        parameters: Py::new(py, parameters)?,
    })
}

fn parameters(problem: &Fit, fitted: &Solved) -> Table {
    let lines: Vec<_> = problem.unknowns.iter().enumerate().collect();
    let error = |(k, unknown): &(usize, &Unknown)| {
        let per_sigma = unknown.per_sigma(unknown.nominal());
        (fitted.known.error(*k) * per_sigma).abs()
    };
    table_of(vec![
        Column::of("name", "", &lines, |(_, unknown)| unknown.name.clone()),
        Column::of("unit", "", &lines, |(_, unknown)| unknown.unit.symbol().to_owned()),
        Column::of("nominal", "", &lines, |(_, unknown)| unknown.nominal()),
        Column::of("value", "", &lines, |(k, unknown)| unknown.value(fitted.z[*k])),
        Column::of("standard_error", "", &lines, error),
        Column::of("knowledge", "", &lines, |(k, _)| {
            fitted.known.sentence("record", &problem.unknowns, *k)
        }),
    ])
}
