//! A plant beside its twin, sample by sample.

use super::{RecordedRun, SensorChain};
use crate::ensemble::Sink;

/// Observes a plant beside its twin.
pub trait Observer: Send {
    /// Takes a sample: the sensor values, the twin's expected values and the inputs; SI. Inputs are empty where the twin
    /// does not record them.
    fn sample(&mut self, index: usize, measured: &[f64], twin: &[f64], inputs: &[f64]);

    /// Takes the tracked variables of the plant and of its twin at the same sample, before [`Observer::sample`].
    fn track(&mut self, _index: usize, _plant: &[f64], _twin: &[f64]) {}
}

/// Passes a plant to an observer as its sensors show it, beside its twin.
///
/// The plant records its sensors, then what is tracked. The twin records the same, then the inputs.
pub(crate) struct Watch<'t, O> {
    twin: &'t RecordedRun,
    sensors: SensorChain,
    measured: Vec<f64>,
    pub(crate) observer: O,
}

impl<'t, O> Watch<'t, O> {
    /// The plant of `count` sensors.
    pub(crate) fn new(
        twin: &'t RecordedRun,
        count: usize,
        sensors: SensorChain,
        observer: O,
    ) -> Self {
        Watch { twin, sensors, measured: vec![0.0; count], observer }
    }
}

impl<O: Observer> Sink for Watch<'_, O> {
    fn sample(&mut self, index: usize, values: &[f64]) {
        let (twin, inputs) = self.twin.at(index).split_at(values.len());
        let (measured, tracked) = values.split_at(self.measured.len());
        let (expected, tracked_twin) = twin.split_at(self.measured.len());
        self.observer.track(index, tracked, tracked_twin);
        self.measured.copy_from_slice(measured);
        self.sensors.measure(&mut self.measured);
        self.observer.sample(index, &self.measured, expected, inputs);
    }
}
