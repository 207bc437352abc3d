//! `Diagnoser`: the diagnosis beside an actuator, sample by sample or over whole tables.

use crate::array;
use crate::errors::Failure;
use crate::long::long;
use crate::table::Table;
use pyo3::prelude::*;
use servotwin::learn::model_file;
use servotwin::table::{Column, Table as Columns};
use servotwin_diagnosis::diagnoser::{self, Session};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// The diagnosis after a sample, which `Diagnoser.push` returns.
#[pyclass(frozen, module = "servotwin", get_all)]
pub(crate) struct Outcome {
    /// The number of the sample, from 0.
    sample: u64,
    /// The finding in words: `actuator_1 / shut_down / leak`.
    finding: String,
    /// The state of the alarm.
    alarm: &'static str,
    /// The raised action as (actuator, action), or None.
    raised: Option<(String, String)>,
    /// The probability of the finding.
    confidence: f64,
    /// The sensor with the largest residual relative to its band, or None.
    worst_sensor: Option<String>,
    /// The size of this residual, relative to its band.
    excess: f64,
    /// The sensors whose values are missing; the diagnosis does without them.
    lost: Vec<String>,
}

#[pymethods]
impl Outcome {
    fn __repr__(&self) -> String {
        let Outcome { sample, finding, alarm, confidence, .. } = self;
        format!("Outcome(sample {sample}: {finding}, alarm {alarm}, confidence {confidence:.3})")
    }
}

/// A diagnosis that watches an actuator, sample by sample.
///
/// A pickled diagnoser is in the state before its first sample.
///
/// Parameters
/// ----------
/// path : path
///     A `diagnoser-SCENARIO.json` that the suites "flights" of a study have written.
///
/// Examples
/// --------
/// >>> diagnoser = servotwin.Diagnoser("out/diagnoser-realistic.json")  # doctest: +SKIP
/// >>> diagnoser.push(inputs, measured, expected).finding  # doctest: +SKIP
/// 'healthy'
#[pyclass(module = "servotwin")]
pub(crate) struct Diagnoser {
    session: Session,
}

impl Diagnoser {
    /// A diagnoser before its first sample.
    pub(crate) fn fresh(diagnoser: diagnoser::Diagnoser) -> Result<Self, Failure> {
        Ok(Diagnoser { session: Session::new(Arc::new(diagnoser))? })
    }

    /// A copy of what was trained.
    pub(crate) fn trained(&self) -> Arc<diagnoser::Diagnoser> {
        self.session.diagnoser().clone()
    }

    fn outcome(&self) -> Outcome {
        let (diagnoser, said) = (self.session.diagnoser(), self.session.outcome());
        let names = diagnoser.names();
        let sensors = diagnoser.sensors.iter().enumerate();
        let lost = sensors.filter(|(place, _)| self.session.is_lost(*place));
        let in_names = |raised: diagnoser::Raised| {
            let actuator = names.actuators[raised.actuator as usize].clone();
            (actuator, names.actions[raised.action as usize].clone())
        };
        Outcome {
            sample: said.sample,
            finding: diagnoser.describe(said.finding),
            alarm: said.alarm.name(),
            raised: said.raised.map(in_names),
            confidence: said.confidence,
            worst_sensor: said.worst_sensor.map(|s| diagnoser.sensors[s as usize].name.clone()),
            excess: said.excess,
            lost: lost.map(|(_, sensor)| sensor.name.clone()).collect(),
        }
    }

    fn place_of(&self, name: &str) -> Result<usize, Failure> {
        let actuators = &self.session.diagnoser().names().actuators;
        let found = actuators.iter().position(|actuator| actuator == name);
        let known = || actuators.join(", ");
        found.ok_or_else(|| {
            Failure::value(format!("there is no actuator '{name}'; there are {}", known()))
        })
    }
}

#[pymethods]
impl Diagnoser {
    #[new]
    fn new(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let diagnoser = py.detach(|| model_file::read_diagnoser(path)).map_err(Failure::from)?;
        Ok(Self::fresh(diagnoser)?)
    }

    /// Read a diagnoser from its JSON.
    ///
    /// Parameters
    /// ----------
    /// text : str
    ///     The content of a `diagnoser-SCENARIO.json`.
    ///
    /// Returns
    /// -------
    /// Diagnoser
    #[staticmethod]
    fn from_json(text: &str) -> PyResult<Self> {
        let diagnoser = model_file::parse("the text".as_ref(), text).map_err(Failure::value)?;
        Ok(Self::fresh(diagnoser)?)
    }

    /// Judge one sample.
    ///
    /// Parameters
    /// ----------
    /// inputs : sequence of float
    ///     The inputs of the system, in the order of `inputs`, SI.
    /// measured : sequence of float
    ///     The measured values, in the order of `sensors`, SI. NaN means missing.
    /// expected : sequence of float
    ///     The values of the twin, in the order of `sensors`, SI.
    ///
    /// Returns
    /// -------
    /// Outcome
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If a sequence has another length.
    fn push(
        &mut self,
        #[pyo3(from_py_with = array::reals)] inputs: Vec<f64>,
        #[pyo3(from_py_with = array::reals)] measured: Vec<f64>,
        #[pyo3(from_py_with = array::reals)] expected: Vec<f64>,
    ) -> PyResult<Outcome> {
        let pushed = self.session.try_push(&inputs, &measured, &expected).map(drop);
        pushed.map_err(Failure::from)?;
        Ok(self.outcome())
    }

    /// Judge the rows of arrays.
    ///
    /// Parameters
    /// ----------
    /// inputs, measured, expected : array_like of shape (n_samples, n_columns)
    ///     As for `push`, one row for each sample.
    ///
    /// Returns
    /// -------
    /// Table
    ///     The outcome after each row.
    fn run(
        &mut self,
        py: Python<'_>,
        inputs: &Bound<'_, PyAny>,
        measured: &Bound<'_, PyAny>,
        expected: &Bound<'_, PyAny>,
    ) -> PyResult<Table> {
        let given = [inputs, measured, expected].map(array::numbers);
        let [inputs, measured, expected] = given;
        let (inputs, measured, expected) = (inputs?, measured?, expected?);
        let rows = measured.1.first().copied().unwrap_or(0);
        let fits = |(_, shape): &(Vec<f64>, Vec<usize>)| shape.len() == 2 && shape[0] == rows;
        if ![&inputs, &measured, &expected].into_iter().all(fits) {
            let text = "inputs, measured and expected need two dimensions and as many rows each";
            return Err(Failure::value(text).into());
        }
        let table = long(py, None, |watch| -> Result<Columns, Failure> {
            let row = |(values, shape): &(Vec<f64>, Vec<usize>), row: usize| {
                values[row * shape[1]..(row + 1) * shape[1]].to_vec()
            };
            let (mut times, mut findings, mut alarms) = (vec![], vec![], vec![]);
            let (mut actuators, mut actions, mut confidences) = (vec![], vec![], vec![]);
            for at in 0..rows {
                if watch.cancel.load(Ordering::Relaxed) {
                    break;
                }
                let (inputs, measured) = (row(&inputs, at), row(&measured, at));
                self.session.try_push(&inputs, &measured, &row(&expected, at))?;
                let said = self.outcome();
                times.push(self.session.time_s(said.sample));
                findings.push(said.finding);
                alarms.push(said.alarm.to_owned());
                let (actuator, action) = said.raised.unwrap_or_default();
                actuators.push(actuator);
                actions.push(action);
                confidences.push(said.confidence);
            }
            Ok(Columns::from_columns(vec![
                Column::new("time_s", "s", times),
                Column::new("finding", "", findings),
                Column::new("alarm", "", alarms),
                Column::new("raised_actuator", "", actuators),
                Column::new("raised_action", "", actions),
                Column::new("confidence", "", confidences),
            ])?)
        })??;
        Ok(table.into())
    }

    /// The sensors, in the order of `measured` and `expected`: names that `Twin` and `simulate` take as `record`.
    #[getter]
    fn sensors(&self) -> Vec<String> {
        self.session.diagnoser().sensors.iter().map(|sensor| sensor.name.clone()).collect()
    }

    /// The inputs, in their order.
    #[getter]
    fn inputs(&self) -> Vec<String> {
        self.session.diagnoser().environment.inputs.iter().map(|i| i.name.clone()).collect()
    }

    /// Time from sample to sample, s.
    #[getter]
    fn sample_period_s(&self) -> f64 {
        self.session.diagnoser().period_s
    }

    /// The actuators.
    #[getter]
    fn actuators(&self) -> Vec<String> {
        self.session.diagnoser().names().actuators.clone()
    }

    /// The last outcome.
    #[getter]
    fn last(&self) -> Outcome {
        self.outcome()
    }

    /// Report that an actuator is off; its sensors are ignored from now on.
    ///
    /// Parameters
    /// ----------
    /// actuator : str
    ///     One of `actuators`.
    fn switched_off(&mut self, actuator: &str) -> PyResult<()> {
        let actuator = self.place_of(actuator)?;
        Ok(self.session.switched_off(actuator).map_err(Failure::from)?)
    }

    /// Report that an actuator is on again. It is judged from now on, and what was raised for it is withdrawn.
    ///
    /// Parameters
    /// ----------
    /// actuator : str
    ///     One of `actuators`.
    fn release(&mut self, actuator: &str) -> PyResult<()> {
        let actuator = self.place_of(actuator)?;
        Ok(self.session.release(actuator).map_err(Failure::from)?)
    }

    /// Withdraw everything that was raised. All is judged anew, also a fault that lasts.
    fn reset_alarm(&mut self) {
        self.session.reset_alarm();
    }

    /// Forget all samples, as after a gap in the log. What is raised stands, and actuators that are off stay off.
    fn restart(&mut self) {
        self.session.restart();
    }

    /// Return the diagnoser as JSON.
    ///
    /// Returns
    /// -------
    /// str
    fn to_json(&self) -> String {
        serde_json::to_string(&**self.session.diagnoser()).expect("a diagnoser is JSON")
    }

    fn __repr__(&self) -> String {
        let diagnoser = self.session.diagnoser();
        let (sensors, lengths) = (diagnoser.sensors.len(), diagnoser.lengths.len());
        format!("Diagnoser({sensors} sensors, {lengths} window lengths)")
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let make = slf.py().get_type::<Diagnoser>().getattr("from_json")?;
        Ok((make, (slf.borrow().to_json(),)).into_pyobject(slf.py())?.into_any())
    }
}
