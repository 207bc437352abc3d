//! Runs: one, and many in lanes on all threads.

use crate::array;
use crate::errors::Failure;
use crate::long::long;
use crate::system::System;
use crate::table::{Drawing, Table};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use servotwin::simulate::{
    InputSignal, PreparedRun, PreparedSimulation, Simulation, SimulationError, SimulationProgress,
    VariantSpec,
};
use servotwin::system::System as Inner;
use servotwin_model::solver::{Method, SolverSettings};
use std::sync::atomic::{AtomicUsize, Ordering};

type Mapping<'a, 'py> = Option<&'a Bound<'py, PyDict>>;

/// How the solver steps, as Python gives it.
pub(crate) struct Steps<'a> {
    /// The method's name.
    pub(crate) method: &'a str,
    /// The allowed error of a step; that of runs without.
    pub(crate) tolerance: Option<f64>,
    /// A fixed step instead of error control, s.
    pub(crate) step_s: Option<f64>,
}

impl Steps<'_> {
    fn apply<'s>(&self, simulation: Simulation<'s>) -> Result<Simulation<'s>, Failure> {
        let known = Method::ALL.into_iter().find(|known| known.name() == self.method);
        let method = known.ok_or_else(|| {
            let names = Method::ALL.map(Method::name).join(", ");
            Failure::value(format!("there is no method '{}'; there are {names}", self.method))
        })?;
        let simulation = simulation.method(method);
        Ok(match (self.step_s, self.tolerance) {
            (Some(step_s), _) => simulation.step_s(step_s),
            (None, Some(tolerance)) => simulation.tolerance(tolerance),
            (None, None) => simulation,
        })
    }
}

/// Faults and parameters with their names resolved, and how the solver steps.
///
/// # Errors
/// An unknown name, or a number outside its range.
pub(crate) fn resolve(
    system: &Inner,
    steps: Option<&Steps>,
    faults: Mapping,
    parameters: Mapping,
) -> PyResult<(PreparedRun, SolverSettings)> {
    let mut simulation = Simulation::new(system).variant(variant(None, faults, parameters)?);
    if let Some(steps) = steps {
        simulation = steps.apply(simulation)?;
    }
    let prepared = simulation.prepare(None).map_err(Failure::from)?;
    let settings = prepared.settings();
    Ok((prepared.base, settings))
}

fn numbers(given: Mapping) -> PyResult<Vec<(String, f64)>> {
    let pairs = given.into_iter().flatten();
    pairs.map(|(id, value)| Ok((id.extract()?, array::real(&value)?))).collect()
}

fn variant(inputs: Mapping, faults: Mapping, parameters: Mapping) -> PyResult<VariantSpec> {
    let inputs = inputs.into_iter().flatten().map(|(id, given)| {
        let id: String = id.extract()?;
        let signal = signal(&id, &given)?;
        Ok((id, signal))
    });
    Ok(VariantSpec {
        inputs: inputs.collect::<PyResult<_>>()?,
        faults: numbers(faults)?,
        parameters: numbers(parameters)?,
    })
}

/// A text as on the command line, a number, or samples in one dimension.
fn signal(input: &str, given: &Bound<'_, PyAny>) -> PyResult<InputSignal> {
    if let Ok(text) = given.extract::<String>() {
        return Ok(text.into());
    }
    if let Ok(value) = given.extract::<f64>() {
        return Ok(value.into());
    }
    let (values, shape) = array::numbers(given)?;
    if shape.len() != 1 || values.is_empty() {
        let text = "a signal is a text, a number, or its samples in one dimension";
        return Err(Failure::value(text).about(input).into());
    }
    Ok(values.into())
}

impl From<SimulationError> for Failure {
    fn from(error: SimulationError) -> Self {
        let message = error.to_string();
        match error {
            SimulationError::UnknownName(error) => error.into(),
            SimulationError::Signal { input, error } => Failure::from(error).about(&input),
            SimulationError::OutOfRange { range, .. } => Failure::value(message).within(range),
            SimulationError::Stopped { variant, stopped } => match variant {
                Some(place) => Failure::from(stopped).about(&format!("variant {place}")),
                None => stopped.into(),
            },
            _ => Failure::value(message),
        }
    }
}

/// Runs with the interpreter's lock released; one table per run.
fn run(
    py: Python<'_>,
    system: &Inner,
    prepared: &PreparedSimulation,
    progress: Option<&Py<PyAny>>,
) -> PyResult<Vec<Table>> {
    let count = prepared.runs.len();
    let tables = long(py, progress, |watch| -> Result<Vec<Table>, Failure> {
        let done = AtomicUsize::new(0);
        let tell = |progress| {
            if progress == SimulationProgress::Run {
                let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                watch.tell("simulating", done, count);
            }
        };
        let results = match prepared.run(&tell, Some(&watch.cancel)) {
            // Python raises what canceled the run.
            Err(SimulationError::Canceled) => return Ok(vec![]),
            results => results?,
        };
        let table = |run| -> Result<Table, Failure> {
            let (title, recorded) = (system.title.clone(), results.recorded.clone());
            Ok(Table::new(results.table_of_run(run)?, Some(Drawing { title, recorded })))
        };
        (0..count).map(table).collect()
    })?;
    Ok(tables?)
}

/// Simulate a system from its steady state.
///
/// Parameters
/// ----------
/// system : System
///     The system.
/// inputs : dict, optional
///     For each input a text as on the command line ("step:size=5deg"), a constant in SI, or an array
///     with its value at every sample.
/// faults : dict of float, optional
///     Intensities from 0 to 1 by the ids of faults.
/// parameters : dict of float, optional
///     Values in SI by the ids of parameters.
/// duration_s : float
///     The simulated time, s.
/// sample_period_s : float
///     The time from sample to sample, s.
/// record : sequence of str, optional
///     The recorded quantities; inputs that move and sensors by default.
/// method : str
///     The method of the solver: "rodas4p2", "rodas3", "rodas5p" or "rk4".
/// tolerance : float, optional
///     The allowed error of a step, in parts of a state's scale.
/// step_s : float, optional
///     A fixed step instead of error control, s; "rk4" needs one.
/// noise : int, optional
///     Record sensors as they read, with their declared noise and resolution; a seed from 0.
///
/// Returns
/// -------
/// Table
///     The time and one column for each recorded quantity, SI.
///
/// Raises
/// ------
/// UnknownNameError
///     If the system has no such input, fault, parameter or quantity.
/// InputError
///     If a value is out of range.
/// RunError
///     If the solver cannot continue.
///
/// Examples
/// --------
/// >>> run = servotwin.simulate(servotwin.System(), inputs={"command": "step:size=2deg"}, duration_s=0.5)
/// >>> run.units["p_a_1_pa"]
/// 'Pa'
#[pyfunction]
#[pyo3(signature = (
    system, *, inputs = None, faults = None, parameters = None, duration_s = 5.0,
    sample_period_s = 0.01, record = None, method = "rodas4p2", tolerance = None, step_s = None,
    noise = None
))]
#[expect(clippy::too_many_arguments, reason = "they are named in Python")]
pub(crate) fn simulate(
    py: Python<'_>,
    system: &System,
    inputs: Option<&Bound<'_, PyDict>>,
    faults: Option<&Bound<'_, PyDict>>,
    parameters: Option<&Bound<'_, PyDict>>,
    #[pyo3(from_py_with = array::real)] duration_s: f64,
    #[pyo3(from_py_with = array::real)] sample_period_s: f64,
    record: Option<Vec<String>>,
    method: &str,
    #[pyo3(from_py_with = array::real_or_none)] tolerance: Option<f64>,
    #[pyo3(from_py_with = array::real_or_none)] step_s: Option<f64>,
    #[pyo3(from_py_with = array::count_or_none)] noise: Option<u64>,
) -> PyResult<Table> {
    let mut simulation = Simulation::new(&system.inner)
        .threads(1)
        .duration_s(duration_s)
        .sample_period_s(sample_period_s)
        .record(record.unwrap_or_default())
        .variant(variant(inputs, faults, parameters)?);
    if let Some(seed) = noise {
        simulation = simulation.noise(seed);
    }
    let simulation = Steps { method, tolerance, step_s }.apply(simulation)?;
    let prepared = simulation.prepare(None).map_err(Failure::from)?;
    let mut tables = run(py, &system.inner, &prepared, None)?;
    Ok(tables.pop().expect("one run gives one table"))
}

/// Simulate variants of a system in lanes, on all threads.
///
/// Parameters
/// ----------
/// system : System
///     The system.
/// variants : sequence of dict
///     Each has the optional keys `inputs`, `faults` and `parameters`, as for `simulate`.
/// duration_s : float
///     The simulated time, s.
/// sample_period_s : float
///     The time from sample to sample, s.
/// record : sequence of str, optional
///     The recorded quantities; inputs that move and sensors by default.
/// method : str
///     The method of the solver: "rodas4p2", "rodas3", "rodas5p" or "rk4".
/// tolerance : float, optional
///     The allowed error of a step, in parts of a state's scale.
/// step_s : float, optional
///     A fixed step instead of error control, s; "rk4" needs one.
/// threads : int, optional
///     The number of threads; all processors by default. The results do not depend on it.
/// progress : callable, optional
///     Called with the task, the amount done and the whole amount.
///
/// Returns
/// -------
/// list of Table
///     One for each variant.
#[pyfunction]
#[pyo3(signature = (
    system, variants, *, duration_s = 5.0, sample_period_s = 0.01, record = None,
    method = "rodas4p2", tolerance = None, step_s = None, threads = None, progress = None
))]
#[expect(clippy::too_many_arguments, reason = "they are named in Python")]
pub(crate) fn simulate_many(
    py: Python<'_>,
    system: &System,
    variants: Vec<Bound<'_, PyDict>>,
    #[pyo3(from_py_with = array::real)] duration_s: f64,
    #[pyo3(from_py_with = array::real)] sample_period_s: f64,
    record: Option<Vec<String>>,
    method: &str,
    #[pyo3(from_py_with = array::real_or_none)] tolerance: Option<f64>,
    #[pyo3(from_py_with = array::real_or_none)] step_s: Option<f64>,
    #[pyo3(from_py_with = crate::array::threads_or_none)] threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Vec<Table>> {
    let variants = variants.iter().map(variant_of).collect::<PyResult<Vec<_>>>()?;
    let mut simulation = Simulation::new(&system.inner)
        .duration_s(duration_s)
        .sample_period_s(sample_period_s)
        .record(record.unwrap_or_default());
    if let Some(threads) = threads {
        simulation = simulation.threads(threads);
    }
    let simulation = Steps { method, tolerance, step_s }.apply(simulation)?;
    let prepared = simulation.prepare_variants(&variants).map_err(Failure::from)?;
    run(py, &system.inner, &prepared, progress.as_ref())
}

fn variant_of(given: &Bound<'_, PyDict>) -> PyResult<VariantSpec> {
    let known = ["inputs", "faults", "parameters"];
    for key in given.keys() {
        let key: String = key.extract()?;
        if !known.contains(&key.as_str()) {
            let text = format!("a variant has no '{key}'; it has {}", known.join(", "));
            return Err(Failure::value(text).into());
        }
    }
    let part = |key| -> PyResult<Option<Bound<'_, PyDict>>> {
        let found = given.get_item(key)?;
        Ok(found.map(|found| found.cast_into::<PyDict>()).transpose()?)
    };
    let [inputs, faults, parameters] = known.map(part);
    variant(inputs?.as_ref(), faults?.as_ref(), parameters?.as_ref())
}
