//! Sinks: where the results of a watch go.

pub mod events;
pub mod strip;
pub mod threads;
mod watched;

use super::checkpoint::Checkpoint;
use super::player::{PlayerSignal, SignalGroup};
use super::watchdog::{Notice, SinkLoss};
use servotwin::live::observer::{Finding, Observation};
use servotwin::shown::Shown;
use servotwin::study::Study;
use servotwin::system::Sensor;
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_io::files::FileError;
use std::path::PathBuf;
use std::sync::Arc;

pub use watched::Watched;

/// One period with its measurements and the observer's results.
#[derive(Debug, Clone)]
pub struct Sample {
    /// The time, s.
    pub time_s: f64,
    /// The line, row, datagram or message it came from; 0 if none did.
    pub place: u64,
    /// The external inputs, SI.
    pub inputs: Vec<f64>,
    /// The measured sensor values, SI.
    pub measured: Vec<f64>,
    /// The twin's value of each sensor, SI.
    pub twin: Vec<f64>,
    /// The residual of each sensor as a share of its scale.
    pub residuals: Vec<f64>,
    /// The finding.
    pub finding: Finding,
    /// Whether the finding differs from that of the last sample.
    pub changed: bool,
}

impl Sample {
    /// A period at a time, s, shared by all sinks, with its place, inputs and measurements, and what an observer found in it.
    pub fn new(
        (time_s, place): (f64, u64),
        inputs: &[f64],
        measured: &[f64],
        observation: &Observation,
        changed: bool,
    ) -> Arc<Self> {
        Arc::new(Sample {
            time_s,
            place,
            inputs: inputs.to_vec(),
            measured: measured.to_vec(),
            twin: observation.twin.to_vec(),
            residuals: observation.residuals.to_vec(),
            finding: observation.finding.clone(),
            changed,
        })
    }
}

/// Receives samples, notices and checkpoints; what it does not take is none of its output.
pub trait Sink {
    /// Takes a sample.
    ///
    /// # Errors
    /// The sample cannot be written.
    fn sample(&mut self, _sample: &Arc<Sample>) -> Result<(), SinkError> {
        Ok(())
    }

    /// Waits until all that came before is written.
    ///
    /// # Errors
    /// It cannot be written.
    fn flush(&mut self) -> Result<(), SinkError> {
        Ok(())
    }

    /// Takes a notice that the watch reports besides the diagnosis.
    ///
    /// # Errors
    /// It cannot be written.
    fn notice(&mut self, _notice: &Notice) -> Result<(), SinkError> {
        Ok(())
    }

    /// Takes the state from which the watch can go on. The last one is not left out, however late it comes.
    ///
    /// # Errors
    /// It cannot be written.
    fn save(&mut self, _checkpoint: &Arc<Checkpoint>, _is_last: bool) -> Result<(), SinkError> {
        Ok(())
    }

    /// Name and reason of each failure since the last call that the watch survives.
    fn failures(&mut self) -> Vec<(String, String)> {
        vec![]
    }

    /// The losses so far of each sink behind this one.
    fn losses(&self) -> Vec<SinkLoss> {
        vec![]
    }
}

/// Why a result cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum SinkError {
    /// A file cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// Standard output cannot be written.
    #[error("standard output: {0}")]
    Output(std::io::Error),
    /// A sink takes nothing at the end.
    #[error("it takes nothing at the end")]
    Stuck,
    /// The thread of a sink ended early.
    #[error("its thread has ended")]
    Thread,
}

/// A file that holds the last checkpoint.
pub struct CheckpointFile(pub PathBuf);

impl Sink for CheckpointFile {
    fn save(&mut self, checkpoint: &Arc<Checkpoint>, _is_last: bool) -> Result<(), SinkError> {
        Ok(checkpoint.write(&self.0)?)
    }
}

/// The signals of a watch, for pages and viewers.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// A one-line title.
    pub title: String,
    /// The sampling period, s.
    pub period_s: f64,
    /// The signals, in the order of their values.
    pub signals: Vec<PlayerSignal>,
    /// How the inputs and the sensors of the system are shown.
    inputs: Vec<Shown>,
    sensors: Vec<Shown>,
}

impl Scene {
    /// The signals of a study, with the residuals of a diagnoser: their bands, and what they are divided by.
    pub fn of_study(title: &str, study: &Study, diagnoser: &Diagnoser) -> Self {
        let (network, all) = (study.system.network(), &study.system.sensors);
        let inputs: Vec<Shown> =
            (0..network.inputs.len()).map(|place| Shown::of_input(network, place)).collect();
        let sensors: Vec<Shown> =
            all.iter().map(|sensor| Shown::of(sensor.unit, sensor.scale)).collect();
        let input = |(place, shown): (usize, &Shown)| {
            let is_command = place == study.command_input;
            let group = if is_command { SignalGroup::Motion } else { SignalGroup::Input };
            let id = &network.inputs[place].id;
            PlayerSignal::new(id, id, shown.symbol(), group)
        };
        let of_sensors = |what: &'static str, group| {
            let signal = move |(sensor, shown): (&Sensor, &Shown)| {
                let id = format!("{what}{}", sensor.id);
                PlayerSignal::new(&id, &sensor.label, shown.symbol(), group)
            };
            all.iter().zip(&sensors).map(signal)
        };
        let residual = |sensor: &Sensor| {
            let id = format!("residual.{}", sensor.id);
            PlayerSignal::residual(&id, &sensor.label, diagnoser, &sensor.id)
        };
        let signals = (inputs.iter().enumerate().map(input))
            .chain(all.iter().map(residual))
            .chain(of_sensors("reading.", SignalGroup::Reading))
            .chain(of_sensors("twin.", SignalGroup::Twin))
            .collect();
        let (title, period_s) = (title.into(), diagnoser.period_s);
        Scene { title, period_s, signals, inputs, sensors }
    }

    /// The values of the signals in a sample, in the units that are shown.
    pub(crate) fn values(&self, sample: &Sample) -> impl Iterator<Item = f64> {
        let shown = |(shown, &value): (&Shown, &f64)| shown.value(value);
        let inputs = self.inputs.iter().zip(&sample.inputs).map(shown);
        let residuals = sample.residuals.iter().map(|residual| 100.0 * residual);
        let readings = self.sensors.iter().zip(&sample.measured).map(shown);
        let twins = self.sensors.iter().zip(&sample.twin).map(shown);
        inputs.chain(residuals).chain(readings).chain(twins)
    }
}
