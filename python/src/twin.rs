//! `Twin`: one system, stepped from sample to sample by its user.

use crate::array;
use crate::errors::Failure;
use crate::long::long;
use crate::simulate::{Steps, resolve};
use crate::system::System;
use crate::table::{Drawing, Table};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use self_cell::self_cell;
use servotwin::recording::{self, Recorded};
use servotwin::rest::Stopped;
use servotwin::signal::bus::Bus;
use servotwin::system::System as Inner;
use servotwin_model::solver::{self, Between, Knot, Snapshot};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering;

type Solver<'p> = solver::Twin<'p>;

self_cell!(
    /// A twin beside the system that it is of.
    struct Running {
        owner: Arc<Inner>,
        #[covariant]
        dependent: Solver,
    }
);

/// A virtual twin that is stepped beside an actuator, one sample at a time.
///
/// Parameters
/// ----------
/// system : System
///     The system.
/// sample_period_s : float
///     The time from sample to sample, s.
/// record : sequence of str, optional
///     The quantities that `step` returns; the sensors by default.
/// between : dict of str, optional
///     How an input moves between two samples: "hold", "line" or "cubic".
/// faults : dict of float, optional
///     Intensities from 0 to 1 by the ids of faults.
/// parameters : dict of float, optional
///     Values in SI by the ids of parameters.
/// method : str
///     The method of the solver: "rodas4p2", "rodas3" or "rodas5p".
/// tolerance : float, optional
///     The allowed error of a step, in parts of a state's scale.
/// step_s : float, optional
///     A fixed step instead of error control, s.
#[pyclass(module = "servotwin")]
pub(crate) struct Twin {
    running: Running,
    recorded: Vec<Recorded>,
    buses: Vec<Bus>,
    knots: Vec<Knot>,
    values: Vec<f64>,
    period_s: f64,
    parameters: Vec<Vec<f64>>,
    is_settled: bool,
}

impl Twin {
    fn system(&self) -> &Inner {
        self.running.borrow_owner()
    }

    /// The inputs of the next sample: a sequence of all, or a mapping of those that change.
    fn take(&mut self, inputs: &Bound<'_, PyAny>) -> PyResult<()> {
        if let Ok(named) = inputs.cast::<PyDict>() {
            for (id, value) in named {
                let id: String = id.extract()?;
                let place = self.system().find_input(&id).map_err(Failure::from)?;
                self.knots[place].value = array::real(&value)?;
            }
        } else {
            let values = array::reals(inputs)?;
            self.take_values(&values)?;
        }
        Ok(self.check()?)
    }

    fn take_values(&mut self, values: &[f64]) -> Result<(), Failure> {
        if values.len() != self.knots.len() {
            let (found, needed) = (values.len(), self.knots.len());
            return Err(Failure::value(format!("{found} inputs, but the system has {needed}")));
        }
        for (knot, &value) in self.knots.iter_mut().zip(values) {
            knot.value = value;
        }
        Ok(())
    }

    fn check(&self) -> Result<(), Failure> {
        match self.knots.iter().position(|knot| !knot.value.is_finite()) {
            Some(place) => {
                let id = &self.system().network().inputs[place].id;
                Err(Failure::value(format!("input {id} is {}", self.knots[place].value)))
            }
            None => Ok(()),
        }
    }

    /// One sample on; the first one is found at rest.
    fn advance(&mut self) -> Result<(), Failure> {
        let Twin { running, buses, knots, period_s, parameters, is_settled, .. } = self;
        for (knot, bus) in knots.iter_mut().zip(buses.iter_mut()) {
            *knot = bus.next(knot.value, *period_s);
        }
        let stepped = running.with_dependent_mut(|system, twin| {
            let stepped = if *is_settled {
                twin.step(knots)
            } else {
                twin.settle(knots, &system.program.first_guess(parameters))
            };
            stepped.map_err(|failure| Stopped::new(system, failure))
        });
        *is_settled = stepped.is_ok();
        stepped?;
        let twin = running.borrow_dependent();
        for (value, one) in self.values.iter_mut().zip(&self.recorded) {
            *value = twin.value(one.slot);
        }
        Ok(())
    }
}

fn between(word: &str) -> Result<Between, Failure> {
    match word {
        "hold" => Ok(Between::Hold),
        "line" => Ok(Between::Line),
        "cubic" => Ok(Between::Cubic),
        _ => {
            let text = format!("there is no way '{word}' between samples: hold, line, cubic");
            Err(Failure::value(text))
        }
    }
}

#[pymethods]
impl Twin {
    #[new]
    #[pyo3(signature = (
        system, *, sample_period_s = 0.01, record = None, between = None, faults = None,
        parameters = None, method = "rodas4p2", tolerance = None, step_s = None
    ))]
    #[expect(clippy::too_many_arguments, reason = "they are named in Python")]
    fn new(
        system: &System,
        #[pyo3(from_py_with = array::real)] sample_period_s: f64,
        record: Option<Vec<String>>,
        between: Option<BTreeMap<String, String>>,
        faults: Option<&Bound<'_, PyDict>>,
        parameters: Option<&Bound<'_, PyDict>>,
        method: &str,
        #[pyo3(from_py_with = array::real_or_none)] tolerance: Option<f64>,
        #[pyo3(from_py_with = array::real_or_none)] step_s: Option<f64>,
    ) -> PyResult<Self> {
        let inner = &system.inner;
        let period_s = sample_period_s;
        let period_range_s = (1e-6, 1e3);
        if !(period_range_s.0..=period_range_s.1).contains(&period_s) {
            return Err(Failure::range("sample_period_s", period_s, period_range_s, "s").into());
        }
        let steps = Steps { method, tolerance, step_s };
        let (given, settings) = resolve(inner, Some(&steps), faults, parameters)?;
        if settings.method.tableau().is_none() {
            return Err(Failure::value("a twin needs an implicit method, not rk4").into());
        }
        let inputs = &inner.network().inputs;
        let mut ways = vec![Between::Hold; inputs.len()];
        for (id, word) in between.into_iter().flatten() {
            ways[inner.find_input(&id).map_err(Failure::from)?] = self::between(&word)?;
        }
        let recorded = recording::choose(inner, &record.unwrap_or_default(), &[]);
        let recorded = recorded.map_err(Failure::from)?;
        let parameters = inner.program.parameters_with(&given.parameters, &given.faults);
        let running = Running::new(inner.clone(), |inner| {
            let mut twin = Solver::new(&inner.program, settings, period_s, ways);
            twin.load(&parameters);
            twin
        });
        Ok(Twin {
            running,
            buses: vec![Bus::default(); inputs.len()],
            knots: inputs.iter().map(|input| Knot::from(input.default)).collect(),
            values: vec![0.0; recorded.len()],
            recorded,
            period_s,
            parameters,
            is_settled: false,
        })
    }

    /// Find the steady state at constant inputs, which is sample 0.
    ///
    /// Parameters
    /// ----------
    /// inputs : dict or sequence of float, optional
    ///     The inputs in SI; defaults of the system otherwise.
    ///
    /// Returns
    /// -------
    /// tuple of float
    ///     The recorded values, in the order of `record`.
    #[pyo3(signature = (inputs = None))]
    fn settle<'py>(
        &mut self,
        py: Python<'py>,
        inputs: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        if let Some(inputs) = inputs {
            self.take(inputs)?;
        }
        self.is_settled = false;
        self.buses.fill(Bus::default());
        self.advance()?;
        PyTuple::new(py, &self.values)
    }

    /// Advance to the next sample. The first call finds the steady state.
    ///
    /// Parameters
    /// ----------
    /// inputs : dict or sequence of float
    ///     The inputs at the next sample in SI; a dict may name only those that change.
    ///
    /// Returns
    /// -------
    /// tuple of float
    ///     The recorded values, in the order of `record`.
    ///
    /// Raises
    /// ------
    /// RunError
    ///     If the solver cannot continue.
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        inputs: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        self.take(inputs)?;
        self.advance()?;
        PyTuple::new(py, &self.values)
    }

    /// Step through the rows of an array.
    ///
    /// Parameters
    /// ----------
    /// inputs : array_like of shape (n_samples, n_inputs)
    ///     The inputs in SI, in the order of `inputs`.
    ///
    /// Returns
    /// -------
    /// Table
    ///     The recorded values at each sample.
    fn run(&mut self, py: Python<'_>, inputs: &Bound<'_, PyAny>) -> PyResult<Table> {
        let (values, shape) = array::numbers(inputs)?;
        let width = self.knots.len();
        if shape.len() != 2 || shape[1] != width {
            let text = format!("inputs have the shape {shape:?}, but must have {width} columns");
            return Err(Failure::value(text).into());
        }
        let (title, recorded) = (self.system().title.clone(), self.recorded.clone());
        let period_s = self.period_s;
        let table = long(py, None, |watch| -> Result<_, Failure> {
            let mut times = Vec::with_capacity(shape[0]);
            let mut columns = vec![Vec::with_capacity(shape[0]); self.recorded.len()];
            for row in values.chunks_exact(width.max(1)) {
                if watch.cancel.load(Ordering::Relaxed) {
                    break;
                }
                self.take_values(row)?;
                self.check()?;
                self.advance()?;
                times.push(self.running.borrow_dependent().sample() as f64 * period_s);
                for (column, &value) in columns.iter_mut().zip(&self.values) {
                    column.push(value);
                }
            }
            Ok(recording::table(self.system(), &self.recorded, times, columns)?)
        })??;
        Ok(Table::new(table, Some(Drawing { title, recorded })))
    }

    /// Change faults and parameters from the next sample on.
    ///
    /// Parameters
    /// ----------
    /// faults : dict of float, optional
    ///     Intensities from 0 to 1 by the ids of faults.
    /// parameters : dict of float, optional
    ///     Values in SI by the ids of parameters.
    #[pyo3(signature = (faults = None, parameters = None))]
    fn load(
        &mut self,
        faults: Option<&Bound<'_, PyDict>>,
        parameters: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<()> {
        let inner = self.running.borrow_owner().clone();
        let (given, _) = resolve(&inner, None, faults, parameters)?;
        self.parameters = inner.program.parameters_with(&given.parameters, &given.faults);
        let parameters = &self.parameters;
        self.running.with_dependent_mut(|_, twin| twin.load(parameters));
        Ok(())
    }

    /// The inputs, in the order of `step`.
    #[getter]
    fn inputs(&self) -> Vec<&str> {
        self.system().network().inputs.iter().map(|input| input.id.as_str()).collect()
    }

    /// The quantities that `step` returns, in its order.
    #[getter]
    fn record(&self) -> Vec<&str> {
        self.recorded.iter().map(|one| one.name.as_str()).collect()
    }

    /// The values that were recorded last.
    #[getter]
    fn values<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, &self.values)
    }

    /// The number of the current sample; None before the first.
    #[getter]
    fn sample(&self) -> Option<u64> {
        self.is_settled.then(|| self.running.borrow_dependent().sample())
    }

    /// The time since the steady state, s; None before the first sample.
    #[getter]
    fn time_s(&self) -> Option<f64> {
        self.is_settled.then(|| self.running.borrow_dependent().time_s())
    }

    /// Return the state of the twin, from which `restore` continues with the same bits.
    ///
    /// Returns
    /// -------
    /// dict
    ///     Can be pickled.
    fn save<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        if !self.is_settled {
            return Err(Failure::value("the twin stands on no sample yet").into());
        }
        let mut snapshot = Snapshot::default();
        self.running.borrow_dependent().save(&mut snapshot);
        let saved = PyDict::new(py);
        saved.set_item("sample", snapshot.sample)?;
        saved.set_item("wanted_s", snapshot.wanted_s)?;
        saved.set_item("effort", snapshot.attempt_rate_per_s)?;
        saved.set_item("states", snapshot.states)?;
        saved.set_item("held", snapshot.held)?;
        saved.set_item("next_tick", snapshot.next_tick)?;
        let knots = snapshot.inputs.iter().map(|knot| (knot.value, knot.slope_per_s));
        saved.set_item("inputs", knots.collect::<Vec<_>>())?;
        let buses = self.buses.iter().map(Bus::memory);
        saved.set_item("buses", buses.collect::<Vec<_>>())?;
        Ok(saved)
    }

    /// Continue from a saved state.
    ///
    /// Parameters
    /// ----------
    /// saved : dict
    ///     The state that `save` of a twin with the same system, parameters and settings returned.
    fn restore(&mut self, saved: &Bound<'_, PyDict>) -> PyResult<()> {
        let entry = |name: &str| -> PyResult<Bound<'_, PyAny>> {
            let missing = || Failure::value(format!("what was saved has no '{name}'"));
            Ok(saved.get_item(name)?.ok_or_else(missing)?)
        };
        let knots: Vec<(f64, f64)> = entry("inputs")?.extract()?;
        let buses: Vec<(Option<f64>, f64)> = entry("buses")?.extract()?;
        let knot = |&(value, slope_per_s): &(f64, f64)| Knot { value, slope_per_s };
        let snapshot = Snapshot {
            sample: entry("sample")?.extract()?,
            wanted_s: entry("wanted_s")?.extract()?,
            attempt_rate_per_s: entry("effort")?.extract()?,
            states: entry("states")?.extract()?,
            held: entry("held")?.extract()?,
            next_tick: entry("next_tick")?.extract()?,
            inputs: knots.iter().map(knot).collect(),
        };
        if buses.len() != self.buses.len() {
            return Err(Failure::value("what was saved has other inputs").into());
        }
        let restored = self.running.with_dependent_mut(|_, twin| twin.restore(&snapshot));
        let other = |what| Failure::value(format!("what was saved has other {what}"));
        restored.map_err(other)?;
        self.buses = buses.into_iter().map(Bus::from_memory).collect();
        self.knots = snapshot.inputs;
        self.is_settled = true;
        let twin = self.running.borrow_dependent();
        for (value, one) in self.values.iter_mut().zip(&self.recorded) {
            *value = twin.value(one.slot);
        }
        Ok(())
    }

    fn __repr__(&self) -> String {
        let name = &self.system().name;
        match self.sample() {
            Some(sample) => format!("Twin('{name}', on sample {sample})"),
            None => format!("Twin('{name}', before its first sample)"),
        }
    }
}
