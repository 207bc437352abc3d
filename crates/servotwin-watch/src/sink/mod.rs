//! Sinks: where the results of a watch go.

pub mod events;
#[cfg(feature = "mcap")]
pub mod mcap;
pub mod strip;
pub mod threads;
mod watched;

use super::checkpoint::Checkpoint;
use super::player::{PlayerSignal, SignalGroup};
use super::source::feature_needed_text;
use super::watchdog::{Notice, SinkLoss};
use servotwin::live::observer::{Finding, Observation};
use servotwin::shown::Shown;
use servotwin::study::Study;
use servotwin::system::{Sensor, System};
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_io::files::FileError;
use servotwin_model::network::ExternalInput;
use servotwin_model::spec::Unit;
use std::path::{Path, PathBuf};
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

    /// Writes out buffered data.
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

    /// Ends the output.
    ///
    /// # Errors
    /// It cannot be written.
    fn close(mut self: Box<Self>) -> Result<(), SinkError> {
        self.flush()
    }
}

/// Why a result cannot be written.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
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
    /// An output whose writer is behind a disabled feature.
    #[error("{}", feature_needed_text(.what, .feature))]
    Feature { what: String, feature: &'static str },
}

/// A file that holds the last checkpoint.
pub struct CheckpointFile(pub PathBuf);

impl Sink for CheckpointFile {
    fn save(&mut self, checkpoint: &Arc<Checkpoint>, _is_last: bool) -> Result<(), SinkError> {
        Ok(checkpoint.write(&self.0)?)
    }
}

/// Opens an MCAP file.
///
/// # Errors
/// It cannot be opened; [`SinkError::Feature`] if the program is built without MCAP.
pub fn open_mcap(path: &Path, scene: &Scene) -> Result<Box<dyn Sink + Send>, SinkError> {
    #[cfg(feature = "mcap")]
    return Ok(Box::new(mcap::Mcap::create(path, scene)?));
    #[cfg(not(feature = "mcap"))]
    {
        let _ = scene;
        Err(SinkError::Feature { what: path.display().to_string(), feature: "mcap" })
    }
}

/// The signals of a watch, for sinks that display them.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// A one-line title.
    pub title: String,
    /// The inputs of the system.
    pub inputs: Vec<Trace>,
    /// The index of the command among them.
    command: Option<usize>,
    /// The sensors of the system.
    pub sensors: Vec<Trace>,
    /// What the residual of each sensor is divided by, in words.
    pub residual_divisors: Vec<&'static str>,
    /// Half the width of each residual's band; NaN for none.
    pub bands: Vec<f64>,
    /// The sampling period, s.
    pub period_s: f64,
}

/// A signal to display.
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    /// The id in files.
    pub id: String,
    /// The display label.
    pub label: String,
    /// The SI unit.
    pub unit: Unit,
    /// The display unit.
    pub shown: Shown,
}

impl Scene {
    /// The signals of a system.
    pub fn new(title: &str, system: &System, period_s: f64) -> Self {
        let network = system.network();
        let input = |(place, input): (usize, &ExternalInput)| {
            let (id, unit) = (input.id.clone(), input.unit);
            Trace { label: id.clone(), id, unit, shown: Shown::of_input(network, place) }
        };
        let sensor = |sensor: &Sensor| {
            let (id, label, unit) = (sensor.id.clone(), sensor.label.clone(), sensor.unit);
            Trace { id, label, unit, shown: Shown::of(unit, sensor.scale) }
        };
        Scene {
            title: title.into(),
            inputs: network.inputs.iter().enumerate().map(input).collect(),
            command: None,
            sensors: system.sensors.iter().map(sensor).collect(),
            residual_divisors: vec!["scale"; system.sensors.len()],
            bands: vec![f64::NAN; system.sensors.len()],
            period_s,
        }
    }

    /// The signals of a study, with the residuals of a diagnoser: their bands, and what they are divided by.
    pub fn of_study(title: &str, study: &Study, diagnoser: &Diagnoser) -> Self {
        let mut scene = Scene::new(title, &study.system, diagnoser.period_s);
        scene.command = Some(study.command_input);
        for (sensor, band) in diagnoser.sensors.iter().zip(&diagnoser.lengths[0].panel.bands) {
            if let Some(own) = scene.sensors.iter().position(|trace| trace.id == sensor.name) {
                scene.residual_divisors[own] = sensor.residual_divisor();
                scene.bands[own] = band.half_width;
            }
        }
        scene
    }

    /// The signals of a page, in the order of [`values`](Self::values).
    pub fn signals(&self) -> Vec<PlayerSignal> {
        let signal = |trace: &Trace, what: &str, group| {
            let (id, unit) = (format!("{what}{}", trace.id), trace.shown.symbol());
            PlayerSignal::new(&id, &trace.label, unit, group)
        };
        let sensors = |what, group| self.sensors.iter().map(move |one| signal(one, what, group));
        let input = |(place, trace)| {
            let is_command = self.command == Some(place);
            signal(trace, "", if is_command { SignalGroup::Motion } else { SignalGroup::Input })
        };
        let residuals = self.residual_divisors.iter().zip(&self.bands);
        let residuals = residuals.zip(sensors("residual.", SignalGroup::Residual));
        let residuals = residuals.map(|((divisor, band), signal)| PlayerSignal {
            unit: format!("% of {divisor}"),
            band: band.is_finite().then_some(100.0 * band),
            ..signal
        });
        let inputs = self.inputs.iter().enumerate().map(input);
        let readings = sensors("reading.", SignalGroup::Reading);
        let twins = sensors("twin.", SignalGroup::Twin);
        inputs.chain(residuals).chain(readings).chain(twins).collect()
    }

    /// The values of the signals in a sample, in the units that are shown.
    pub fn values(&self, sample: &Sample) -> impl Iterator<Item = f64> {
        let shown = |(trace, &value): (&Trace, &f64)| trace.shown.value(value);
        let inputs = self.inputs.iter().zip(&sample.inputs).map(shown);
        let residuals = sample.residuals.iter().map(|residual| 100.0 * residual);
        let readings = self.sensors.iter().zip(&sample.measured).map(shown);
        let twins = self.sensors.iter().zip(&sample.twin).map(shown);
        inputs.chain(residuals).chain(readings).chain(twins)
    }
}
