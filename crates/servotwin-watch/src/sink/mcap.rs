//! Writes the watch as an MCAP file for Foxglove, Rerun and PlotJuggler.
//!
//! Every sample is a message on `/inputs`, `/measured`, `/twin` and `/residuals`. `/bands` has one
//! message, and `/decisions` has one for each change of the finding. Messages are JSON with a schema. The name of a number
//! ends with its unit, and a missing value is null. Notices of a live watch (no data, heartbeats) are on `/watch`; while the
//! source is silent, `/decisions` has the state `no_data`.

pub mod recording;

use super::{Sample, Scene, Sink, SinkError, Trace};
use crate::watchdog::{Notice, WatchEvent};
use recording::{Recording, Topic};
use serde_json::json;
use servotwin::observer::Finding;
use std::path::Path;
use std::sync::Arc;

/// Writes an MCAP file.
pub struct Mcap {
    recording: Recording,
    /// The last finding on `/decisions`, except silence.
    last_finding: Finding,
    has_bands: bool,
}

/// The topics of numbers, in the order of [`topics`].
const TOPICS: [&str; 6] = ["/inputs", "/measured", "/twin", "/residuals", "/bands", "/features"];
/// The index of the bands among them.
const BANDS: usize = 4;

/// The topics of numbers; the features are left out if there are none.
fn topics(scene: &Scene) -> Vec<Topic> {
    let si = |traces: &[Trace]| -> Vec<(String, String)> {
        let name = |trace: &Trace| match trace.id.ends_with(trace.unit.suffix()) {
            true => trace.id.clone(),
            false => format!("{}{}", trace.id, trace.unit.suffix()),
        };
        traces.iter().map(|trace| (name(trace), trace.unit.symbol().to_owned())).collect()
    };
    let shares = scene.sensors.iter().zip(&scene.residual_divisors);
    let shares = shares
        .map(|(trace, divisor)| (trace.id.clone(), format!("share of the sensor's {divisor}")));
    let shares: Vec<(String, String)> = shares.collect();
    let features = scene.features.iter().map(|name| (name.clone(), String::new())).collect();
    let (inputs, sensors) = (si(&scene.inputs), si(&scene.sensors));
    let numbers = [inputs, sensors.clone(), sensors, shares.clone(), shares, features];
    let topics = TOPICS.iter().zip(numbers);
    let topics = topics.map(|(name, numbers)| Topic { name: (*name).into(), numbers });
    topics.filter(|topic| topic.name != "/features" || !topic.numbers.is_empty()).collect()
}

impl Mcap {
    /// Begins a file; it appears when [`finish`](Self::finish)ed.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn create(path: &Path, scene: &Scene) -> Result<Self, SinkError> {
        let recording = Recording::create(path, &topics(scene))?;
        Ok(Mcap { recording, last_finding: Finding::default(), has_bands: false })
    }

    /// Completes the file and moves it into place.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(self) -> Result<(), SinkError> {
        self.recording.finish()
    }

    fn decide(&mut self, time_s: f64, finding: &Finding) -> Result<(), SinkError> {
        let mut decision = serde_json::to_value(finding).unwrap_or_default();
        decision["time_s"] = json!(time_s);
        self.recording.note("/decisions", time_s, &decision)
    }
}

impl Sink for Mcap {
    fn sample(&mut self, sample: &Arc<Sample>) -> Result<(), SinkError> {
        let Sample { time_s, inputs, measured, twin, residuals, bands, features, .. } = &**sample;
        let numbers = [inputs, measured, twin, residuals, bands, features];
        let is_due = |topic: usize| topic != BANDS || !self.has_bands;
        for (topic, values) in numbers.into_iter().enumerate().filter(|(topic, _)| is_due(*topic)) {
            self.recording.numbers(topic, *time_s, values)?;
        }
        self.has_bands = true;
        if sample.changed {
            self.last_finding.clone_from(&sample.finding);
            self.decide(*time_s, &sample.finding)?;
        }
        Ok(())
    }

    fn notice(&mut self, notice: &Notice) -> Result<(), SinkError> {
        let time_s = notice.time_s.unwrap_or(0.0);
        // Sample time stands still while the source is silent; wall-clock time is added to the last sample.
        let now_s = match notice.event {
            WatchEvent::NoData | WatchEvent::Heartbeat { .. } => time_s + notice.silent_s,
            _ => time_s,
        };
        let words = serde_json::to_value(notice).unwrap_or_default();
        self.recording.note("/watch", now_s, &words)?;
        match notice.event {
            WatchEvent::NoData => {
                let evidence = notice.words().into_iter().collect();
                let silent = self.last_finding.without_data(evidence);
                self.decide(now_s, &silent)
            }
            WatchEvent::DataAgain => self.decide(now_s, &self.last_finding.clone()),
            _ => Ok(()),
        }
    }

    fn close(self: Box<Self>) -> Result<(), SinkError> {
        self.finish()
    }
}
