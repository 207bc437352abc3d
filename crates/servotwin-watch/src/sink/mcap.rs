//! Writes the watch as an MCAP file for Foxglove, Rerun and PlotJuggler.
//!
//! Every sample is a message on `/inputs`, `/measured`, `/twin` and `/residuals`. `/bands` has one
//! message, and `/decisions` has one for each change of the finding. Messages are JSON with a schema. The name of a number
//! ends with its unit, and a missing value is null. Notices of a live watch (no data, heartbeats) are on `/watch`; while the
//! source is silent, `/decisions` has the state `no_data`.

pub mod recording;

use super::{Sample, Scene, Sink, SinkError, Trace};
use crate::watchdog::{Notice, WatchEvent};
use ::mcap::records::MessageHeader;
use ::mcap::{McapError, WriteOptions, Writer};
use serde_json::json;
use servotwin::observer::Finding;
use servotwin_io::files::{AtomicFile, FileError};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The size of a chunk, bytes; readers load chunks whole.
const CHUNK: u64 = 1 << 17;

/// Writes an MCAP file.
pub struct Mcap {
    path: PathBuf,
    writer: Writer<AtomicFile>,
    inputs: Channel,
    measured: Channel,
    twin: Channel,
    residuals: Channel,
    bands: Channel,
    features: Option<Channel>,
    decisions: Channel,
    /// For a live watch, from its first notice on.
    notices: Option<Channel>,
    /// The last finding on `/decisions`, except silence.
    last_finding: Finding,
    has_bands: bool,
    text: String,
}

/// A topic with the JSON keys of its numbers.
struct Channel {
    id: u16,
    sequence: u32,
    /// `,"p_a_1_pa":`
    keys: Vec<String>,
}

impl Mcap {
    /// Begins a file; it appears when [`finish`](Self::finish)ed.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn create(path: &Path, scene: &Scene) -> Result<Self, SinkError> {
        let failed = |error| sink_error(path, error);
        let library = concat!("servotwin ", env!("CARGO_PKG_VERSION"));
        let options = WriteOptions::new().library(library).chunk_size(Some(CHUNK));
        let mut writer = options.create(AtomicFile::create(path)?).map_err(failed)?;
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
        let features = scene.features.iter().map(|name| (name.clone(), String::new()));
        let features: Vec<(String, String)> = features.collect();
        let mut channel = |topic: &str, names: &[(String, String)]| {
            Channel::new(&mut writer, topic, names).map_err(failed)
        };
        let features = match scene.features.is_empty() {
            true => None,
            false => Some(channel("/features", &features)?),
        };
        let (inputs, measured) =
            (channel("/inputs", &si(&scene.inputs))?, channel("/measured", &si(&scene.sensors))?);
        let twin = channel("/twin", &si(&scene.sensors))?;
        let residuals = channel("/residuals", &shares)?;
        let bands = channel("/bands", &shares)?;
        let decisions = Channel::decisions(&mut writer).map_err(failed)?;
        Ok(Mcap {
            path: path.into(),
            writer,
            inputs,
            measured,
            twin,
            residuals,
            bands,
            features,
            decisions,
            notices: None,
            last_finding: Finding::default(),
            has_bands: false,
            text: String::new(),
        })
    }

    /// Completes the file and moves it into place.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(mut self) -> Result<(), SinkError> {
        self.writer.finish().map_err(|error| sink_error(&self.path, error))?;
        Ok(self.writer.into_inner().commit()?)
    }

    fn write(&mut self, sample: &Sample) -> Result<(), McapError> {
        let Mcap { writer, text, .. } = self;
        let observation = &sample.observation;
        let time_s = sample.time_s;
        let mut numbers = |channel: &mut Channel, values: &[f64]| {
            channel.numbers(time_s, values, text);
            channel.send(writer, time_s, text)
        };
        numbers(&mut self.inputs, sample.inputs)?;
        numbers(&mut self.measured, sample.measured)?;
        numbers(&mut self.twin, observation.twin)?;
        numbers(&mut self.residuals, observation.residuals)?;
        if let Some(features) = &mut self.features {
            numbers(features, observation.features)?;
        }
        if !self.has_bands {
            numbers(&mut self.bands, observation.bands)?;
            self.has_bands = true;
        }
        if sample.changed {
            self.last_finding.clone_from(observation.finding);
            self.decide(time_s, observation.finding)?;
        }
        Ok(())
    }

    fn decide(&mut self, time_s: f64, finding: &Finding) -> Result<(), McapError> {
        let mut decision = serde_json::to_value(finding).unwrap_or_default();
        decision["time_s"] = json!(time_s);
        self.decisions.send(&mut self.writer, time_s, &decision.to_string())
    }

    fn write_notice(&mut self, notice: &Notice) -> Result<(), McapError> {
        let time_s = notice.time_s.unwrap_or(0.0);
        // Sample time stands still while the source is silent; wall-clock time is added to the last sample.
        let now_s = match notice.event {
            WatchEvent::NoData | WatchEvent::Heartbeat { .. } => time_s + notice.silent_s,
            _ => time_s,
        };
        let channel = match &mut self.notices {
            Some(channel) => channel,
            none => none.insert(Channel::notices(&mut self.writer)?),
        };
        let text = serde_json::to_string(notice).unwrap_or_default();
        channel.send(&mut self.writer, now_s, &text)?;
        match notice.event {
            WatchEvent::NoData => {
                let evidence = notice.words().into_iter().collect();
                let silent = self.last_finding.without_data(evidence);
                self.decide(now_s, &silent)?;
            }
            WatchEvent::DataAgain => self.decide(now_s, &self.last_finding.clone())?,
            _ => {}
        }
        Ok(())
    }
}

impl Sink for Mcap {
    fn sample(&mut self, sample: &Sample) -> Result<(), SinkError> {
        self.write(sample).map_err(|error| sink_error(&self.path, error))
    }

    fn notice(&mut self, notice: &Notice) -> Result<(), SinkError> {
        self.write_notice(notice).map_err(|error| sink_error(&self.path, error))
    }

    fn close(self: Box<Self>) -> Result<(), SinkError> {
        self.finish()
    }
}

impl Channel {
    /// Creates a topic for numbers with units.
    fn new(
        writer: &mut Writer<AtomicFile>,
        topic: &str,
        names: &[(String, String)],
    ) -> Result<Self, McapError> {
        let mut properties = serde_json::Map::new();
        properties.insert("time_s".into(), json!({ "type": "number", "description": "s" }));
        for (name, unit) in names {
            let property = json!({ "type": ["number", "null"], "description": unit });
            properties.insert(name.clone(), property);
        }
        let id = channel_id(writer, topic, properties)?;
        let keys = names.iter().map(|(name, _)| format!(",{}:", json!(name)));
        Ok(Channel { id, sequence: 0, keys: keys.collect() })
    }

    fn decisions(writer: &mut Writer<AtomicFile>) -> Result<Self, McapError> {
        let text = json!({ "type": "string" });
        let properties = json!({
            "time_s": { "type": "number", "description": "s" },
            "state": text,
            "phase": text,
            "actuator": { "type": ["integer", "null"] },
            "unit": { "type": ["string", "null"] },
            "command": text,
            "detail": text,
            "confidence": { "type": "number" },
            "evidence": { "type": "array", "items": text },
        });
        let properties = properties.as_object().cloned().unwrap_or_default();
        let id = channel_id(writer, "/decisions", properties)?;
        Ok(Channel { id, sequence: 0, keys: vec![] })
    }

    fn notices(writer: &mut Writer<AtomicFile>) -> Result<Self, McapError> {
        let text = json!({ "type": "string" });
        let properties = json!({
            "event": text,
            "wall_time": text,
            "time_s": { "type": ["number", "null"], "description": "s" },
            "silent_s": { "type": "number", "description": "s" },
            "state": text,
            "phase": text,
        });
        let properties = properties.as_object().cloned().unwrap_or_default();
        let id = channel_id(writer, "/watch", properties)?;
        Ok(Channel { id, sequence: 0, keys: vec![] })
    }

    /// Formats numbers as a JSON message.
    fn numbers(&self, time_s: f64, values: &[f64], text: &mut String) {
        text.clear();
        let _ = write!(text, "{{\"time_s\":{time_s:?}");
        for (key, value) in self.keys.iter().zip(values) {
            text.push_str(key);
            // `{:?}` prints the shortest text that reads back to the same bits.
            let _ = match value.is_finite() {
                true => write!(text, "{value:?}"),
                false => write!(text, "null"),
            };
        }
        text.push('}');
    }

    fn send(
        &mut self,
        writer: &mut Writer<AtomicFile>,
        time_s: f64,
        text: &str,
    ) -> Result<(), McapError> {
        // The format has no negative times: they are written as zero.
        let log_time = (time_s * 1e9).round() as u64;
        let header = MessageHeader {
            channel_id: self.id,
            sequence: self.sequence,
            log_time,
            publish_time: log_time,
        };
        self.sequence = self.sequence.wrapping_add(1);
        writer.write_to_known_channel(&header, text.as_bytes())
    }
}

fn channel_id(
    writer: &mut Writer<AtomicFile>,
    topic: &str,
    properties: serde_json::Map<String, serde_json::Value>,
) -> Result<u16, McapError> {
    let schema = json!({
        "$schema": "http://json-schema.org/draft-07/schema#",
        "type": "object",
        "properties": properties,
    });
    let name = format!("servotwin.{}", topic.trim_start_matches('/'));
    let schema = writer.add_schema(&name, "jsonschema", schema.to_string().as_bytes())?;
    writer.add_channel(schema, topic, "json", &BTreeMap::new())
}

fn sink_error(path: &Path, error: McapError) -> SinkError {
    let cause = match error {
        McapError::Io(cause) => cause,
        error => std::io::Error::other(error.to_string()),
    };
    SinkError::File(FileError::from_io(path, cause))
}
