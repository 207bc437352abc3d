//! The twin and the diagnosis of one system, fed sample by sample with named signals.
//!
//! A [`Monitor`] simulates the virtual twin with the inputs that you push, compares it with the sensors, and returns a
//! [`Finding`] with names: the fault, the action and the reasons.
//!
//! ```no_run
//! use servotwin::prelude::*;
//!
//! let study = Study::default();
//! let diagnoser = read_diagnoser("out/diagnoser-realistic.json")?;
//! let mut monitor = Monitor::new(&study, diagnoser)?;
//! monitor.set("command", 0.05)?;
//! monitor.set("p_a_1", 9.8e6)?;
//! println!("{}", monitor.push());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::live::observer::{Finding, Observer};
use crate::live::runtime::RuntimeError;
use crate::live::watcher::Watcher;
use crate::nearest::UnknownName;
use crate::study::Study;
use servotwin_diagnosis::diagnoser::Diagnoser;
use std::sync::Arc;

/// A diagnosis of one system, sample by sample.
pub struct Monitor<'s> {
    study: &'s Study,
    watcher: Watcher<'s>,
    period_s: f64,
    samples: u64,
    inputs: Vec<f64>,
    measured: Vec<f64>,
}

impl<'s> Monitor<'s> {
    /// A monitor before its first sample. Inputs have their default values.
    ///
    /// # Errors
    /// The diagnoser was trained for another study.
    pub fn new(study: &'s Study, diagnoser: Diagnoser) -> Result<Self, RuntimeError> {
        let period_s = diagnoser.period_s;
        let watcher = Watcher::new(study, Arc::new(diagnoser))?;
        let inputs = study.system.network().inputs.iter().map(|input| input.default).collect();
        let measured = vec![f64::NAN; study.system.sensors.len()];
        Ok(Monitor { study, watcher, period_s, samples: 0, inputs, measured })
    }

    /// The time between two samples, s.
    pub fn period_s(&self) -> f64 {
        self.period_s
    }

    /// Sets an input or a sensor of the next sample, SI. An input keeps its value until you set it again. A sensor that
    /// you do not set is missing in that sample.
    ///
    /// # Errors
    /// The system has neither an input nor a sensor of this name.
    pub fn set(&mut self, name: &str, value: f64) -> Result<(), UnknownName> {
        *self.place(name)? = value;
        Ok(())
    }

    fn place(&mut self, name: &str) -> Result<&mut f64, UnknownName> {
        let system = &self.study.system;
        if let Some(sensor) = system.sensors.iter().position(|sensor| sensor.id == name) {
            return Ok(&mut self.measured[sensor]);
        }
        match system.network().inputs.iter().position(|input| input.id == name) {
            Some(input) => Ok(&mut self.inputs[input]),
            None => {
                let sensors = system.sensors.iter().map(|sensor| sensor.id.clone());
                let inputs = system.network().inputs.iter().map(|input| input.id.clone());
                let known = sensors.chain(inputs).collect();
                Err(UnknownName { what: "input or sensor", given: name.into(), known })
            }
        }
    }

    /// Takes the sample that you have set, and returns the finding.
    pub fn push(&mut self) -> &Finding {
        let time_s = self.samples as f64 * self.period_s;
        self.samples += 1;
        let finding = self.watcher.push(time_s, &self.inputs, &self.measured).finding;
        self.measured.fill(f64::NAN);
        finding
    }

    /// Restarts, because the next sample does not continue the last one. Actuators that are off stay off.
    pub fn restart(&mut self) {
        self.watcher.restart();
    }

    /// Withdraws everything that was raised. All is judged anew, also a fault that lasts.
    pub fn reset_alarm(&mut self) {
        self.watcher.reset_alarm();
    }
}
