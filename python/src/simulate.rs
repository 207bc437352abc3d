//! Runs: one, and many in lanes on all threads.

use crate::array;
use crate::errors::Failure;
use crate::long::long;
use crate::system::System;
use crate::table::{Drawing, Table};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use servotwin::ensemble::{Ensemble, Variant};
use servotwin::recording::{self, Recorded};
use servotwin::rest::Stopped;
use servotwin::signal::Signal;
use servotwin::signal::bus::Bus;
use servotwin::system::System as Inner;
use servotwin_model::program::FaultAt;
use servotwin_model::signal::Piecewise;
use servotwin_model::solver::{Control, Knot, Method, Settings};
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// More values than this are not recorded at once.
const MOST_VALUES: f64 = 2e8;

/// How to run: what all variants share.
pub struct Plan {
    duration_s: f64,
    period_s: f64,
    settings: Settings,
    /// Signals by input and text: variants often share theirs.
    built: RefCell<BTreeMap<(usize, String), Arc<Piecewise>>>,
}

/// A number within a range.
///
/// # Errors
/// It is outside.
pub fn within(name: &str, value: f64, range: (f64, f64), unit: &str) -> Result<f64, Failure> {
    match value.is_finite() && (range.0..=range.1).contains(&value) {
        true => Ok(value),
        false => Err(Failure::range(name, value, range, unit)),
    }
}

/// The solver's settings by name.
///
/// # Errors
/// An unknown method, a number out of range, or a method without error control and step.
pub fn settings(method: &str, tolerance: f64, step_s: Option<f64>) -> Result<Settings, Failure> {
    let method = Method::ALL.into_iter().find(|known| known.name() == method).ok_or_else(|| {
        let names = Method::ALL.map(Method::name).join(", ");
        Failure::value(format!("there is no method '{method}'; there are {names}"))
    })?;
    let control = match step_s {
        Some(step_s) => Control::Fixed { step_s: within("step_s", step_s, (1e-9, 1.0), "s")? },
        None if method.tableau().is_none() => {
            return Err(Failure::value("rk4 has no error control: give step_s"));
        }
        None => {
            let tolerance = within("tolerance", tolerance, (1e-15, 0.1), "")?;
            Control::within(tolerance)
        }
    };
    Ok(Settings { method, control, land_on_samples: true })
}

/// A variant as Python gives it.
#[derive(Default)]
pub struct Given {
    /// Faults with their intensities.
    pub faults: Vec<FaultAt>,
    /// Parameters that differ.
    pub overrides: Vec<(usize, usize, f64)>,
    curves: Vec<Arc<Piecewise>>,
    driven: Vec<String>,
}

/// The faults of a mapping from ids to intensities.
///
/// # Errors
/// An unknown fault, or an intensity outside of 0 to 1.
pub fn faults(system: &Inner, given: Option<&Bound<'_, PyDict>>) -> PyResult<Vec<FaultAt>> {
    let mut list = vec![];
    for (id, intensity) in given.into_iter().flatten() {
        let id: String = id.extract()?;
        let (component, fault) = system.find_fault(&id).map_err(Failure::from)?;
        let intensity = within(&id, intensity.extract()?, (0.0, 1.0), "")?;
        list.push(FaultAt { component, fault, intensity });
    }
    Ok(list)
}

/// The parameters of a mapping from ids to SI values.
///
/// # Errors
/// An unknown parameter, or a value outside its range.
pub fn overrides(
    system: &Inner,
    given: Option<&Bound<'_, PyDict>>,
) -> PyResult<Vec<(usize, usize, f64)>> {
    let mut list = vec![];
    for (id, value) in given.into_iter().flatten() {
        let id: String = id.extract()?;
        let (component, parameter) = system.find_parameter(&id).map_err(Failure::from)?;
        let spec = system.network().components[component].component.spec();
        let declared = &spec.parameters[parameter];
        let range = (declared.min, declared.max);
        let value = within(&id, value.extract()?, range, declared.unit.symbol())?;
        list.push((component, parameter, value));
    }
    if !list.is_empty() {
        system.possible_with(&list).map_err(Failure::value)?;
    }
    Ok(list)
}

impl Plan {
    fn new(duration_s: f64, period_s: f64, settings: Settings) -> Result<Self, Failure> {
        Ok(Plan {
            duration_s: within("duration_s", duration_s, (1e-6, 1e6), "s")?,
            period_s: within("sample_period_s", period_s, (1e-6, 1e6), "s")?,
            settings,
            built: RefCell::default(),
        })
    }

    fn given(
        &self,
        system: &Inner,
        inputs: Option<&Bound<'_, PyDict>>,
        faults_given: Option<&Bound<'_, PyDict>>,
        parameters: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Given> {
        let mut given = Given {
            faults: faults(system, faults_given)?,
            overrides: overrides(system, parameters)?,
            curves: system.default_inputs().into_iter().map(Arc::new).collect(),
            driven: vec![],
        };
        for (id, signal) in inputs.into_iter().flatten() {
            let id: String = id.extract()?;
            let place = system.find_input(&id).map_err(Failure::from)?;
            given.curves[place] = self.curve(system, place, &signal)?;
            given.driven.push(id);
        }
        Ok(given)
    }

    /// The signal of an input: a text as on the command line, a number, or its samples.
    fn curve(
        &self,
        system: &Inner,
        place: usize,
        signal: &Bound<'_, PyAny>,
    ) -> PyResult<Arc<Piecewise>> {
        let input = &system.network().inputs[place];
        let about = |failure: Failure| failure.about(&input.id);
        let bad = |error| about(Failure::value(error));
        if let Ok(text) = signal.extract::<String>() {
            if let Some(curve) = self.built.borrow().get(&(place, text.clone())) {
                return Ok(curve.clone());
            }
            let signal: Signal = text.parse().map_err(|e| about(Failure::from(e)))?;
            let curve = system.driven(place, &signal, self.duration_s);
            let curve = Arc::new(curve.map_err(|e| about(Failure::from(e)))?);
            self.built.borrow_mut().insert((place, text), curve.clone());
            return Ok(curve);
        }
        if let Ok(value) = signal.extract::<f64>() {
            return Ok(Arc::new(Piecewise::constant(value).map_err(bad)?));
        }
        let (values, shape) = array::numbers(signal)?;
        if shape.len() != 1 || values.is_empty() {
            let text = "a signal is a text, a number, or its samples in one dimension";
            return Err(about(Failure::value(text)).into());
        }
        let times: Vec<f64> = (0..values.len()).map(|k| k as f64 * self.period_s).collect();
        let mut bus = Bus::default();
        let knots: Vec<Knot> = values.iter().map(|&v| bus.next(v, self.period_s)).collect();
        let slopes: Vec<f64> = knots.iter().map(|knot| knot.slope_per_s).collect();
        Ok(Arc::new(Piecewise::hermite(&times, &values, &slopes).map_err(bad)?))
    }

    /// Runs the variants; the recorded values of each, in their order.
    fn run(
        &self,
        py: Python<'_>,
        system: &Inner,
        variants: &[Given],
        recorded: &[Recorded],
        threads: Option<usize>,
        progress: Option<&Py<PyAny>>,
    ) -> PyResult<Vec<Table>> {
        let samples = self.duration_s / self.period_s + 1.0;
        if samples * (variants.len() * (recorded.len() + 1)) as f64 > MOST_VALUES {
            let text = "more than 200 million values would be recorded: \
                        choose with record, or a longer sample_period_s";
            return Err(Failure::value(text).into());
        }
        let (duration_s, period_s, settings) = (self.duration_s, self.period_s, self.settings);
        let tables = long(py, progress, |watch| -> Result<Vec<Table>, Failure> {
            let mut ensemble = Ensemble {
                settings,
                record: recorded.iter().map(|one| one.slot).collect(),
                duration_s,
                sample_period_s: period_s,
                cancel: Some(&watch.cancel),
                ..Ensemble::of(system)
            };
            ensemble.threads = threads.unwrap_or(ensemble.threads).max(1);
            let mut runs: Vec<Option<Vec<Vec<f64>>>> = vec![None; variants.len()];
            let (mut stopped, mut done) = (None, 0);
            ensemble.run(
                variants.len(),
                |place| {
                    let Given { faults, overrides, curves, .. } = &variants[place];
                    let (faults, overrides) = (faults.clone(), overrides.clone());
                    let inputs = curves.iter().map(Arc::as_ref).collect();
                    Variant { faults, overrides, inputs, ..Variant::default() }
                },
                |_| vec![Vec::with_capacity(ensemble.samples()); recorded.len()],
                |place, values, outcome| {
                    match outcome {
                        Ok(_) => runs[place] = Some(values),
                        Err(failure) => {
                            let first = stopped.as_ref().is_none_or(|&(p, _)| place < p);
                            if first {
                                stopped = Some((place, failure));
                            }
                        }
                    }
                    done += 1;
                    watch.tell("simulating", done, variants.len());
                },
            );
            if let Some((place, failure)) = stopped {
                let failure = Failure::from(Stopped::new(system, failure));
                let many = variants.len() > 1;
                return Err(if many {
                    failure.about(&format!("variant {place}"))
                } else {
                    failure
                });
            }
            let tables = runs.into_iter().flatten().map(|values| -> Result<Table, Failure> {
                let times = recording::times_s(&ensemble);
                let table = recording::table(system, recorded, times, values)?;
                let (title, recorded) = (system.title.clone(), recorded.to_vec());
                Ok(Table::new(table, Some(Drawing { title, recorded })))
            });
            tables.collect()
        })?;
        Ok(tables?)
    }
}

/// Simulates a system from rest.
#[pyfunction]
#[pyo3(signature = (
    system, *, inputs = None, faults = None, parameters = None, duration_s = 5.0,
    sample_period_s = 0.01, record = None, method = "rodas4p2", tolerance = 1e-5, step_s = None
))]
#[expect(clippy::too_many_arguments, reason = "they are named in Python")]
pub fn simulate(
    py: Python<'_>,
    system: &System,
    inputs: Option<&Bound<'_, PyDict>>,
    faults: Option<&Bound<'_, PyDict>>,
    parameters: Option<&Bound<'_, PyDict>>,
    duration_s: f64,
    sample_period_s: f64,
    record: Option<Vec<String>>,
    method: &str,
    tolerance: f64,
    step_s: Option<f64>,
) -> PyResult<Table> {
    let plan = Plan::new(duration_s, sample_period_s, settings(method, tolerance, step_s)?)?;
    let inner = &system.inner;
    let given = plan.given(inner, inputs, faults, parameters)?;
    let driven: Vec<&str> = given.driven.iter().map(String::as_str).collect();
    let recorded = recording::choose(inner, &record.unwrap_or_default(), &driven);
    let recorded = recorded.map_err(Failure::from)?;
    let mut tables = plan.run(py, inner, &[given], &recorded, Some(1), None)?;
    Ok(tables.pop().expect("one variant gives one table"))
}

/// Simulates variants side by side: lanes on all threads.
#[pyfunction]
#[pyo3(signature = (
    system, variants, *, duration_s = 5.0, sample_period_s = 0.01, record = None,
    method = "rodas4p2", tolerance = 1e-5, step_s = None, threads = None, progress = None
))]
#[expect(clippy::too_many_arguments, reason = "they are named in Python")]
pub fn simulate_many(
    py: Python<'_>,
    system: &System,
    variants: Vec<Bound<'_, PyDict>>,
    duration_s: f64,
    sample_period_s: f64,
    record: Option<Vec<String>>,
    method: &str,
    tolerance: f64,
    step_s: Option<f64>,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Vec<Table>> {
    let plan = Plan::new(duration_s, sample_period_s, settings(method, tolerance, step_s)?)?;
    let inner = &system.inner;
    let given = variants.iter().map(|variant| {
        let known = ["inputs", "faults", "parameters"];
        for key in variant.keys() {
            let key: String = key.extract()?;
            if !known.contains(&key.as_str()) {
                let text = format!("a variant has no '{key}'; it has {}", known.join(", "));
                return Err(Failure::value(text).into());
            }
        }
        let part = |key| -> PyResult<Option<Bound<'_, PyDict>>> {
            let found = variant.get_item(key)?;
            Ok(found.map(|found| found.cast_into::<PyDict>()).transpose()?)
        };
        let [inputs, faults, parameters] = known.map(part);
        plan.given(inner, inputs?.as_ref(), faults?.as_ref(), parameters?.as_ref())
    });
    let given = given.collect::<PyResult<Vec<_>>>()?;
    let driven: BTreeSet<&str> =
        given.iter().flat_map(|one| one.driven.iter().map(String::as_str)).collect();
    let driven: Vec<&str> = driven.into_iter().collect();
    let recorded = recording::choose(inner, &record.unwrap_or_default(), &driven);
    let recorded = recorded.map_err(Failure::from)?;
    plan.run(py, inner, &given, &recorded, threads, progress.as_ref())
}
