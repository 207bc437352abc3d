//! Writes the watch as an MCAP file for Foxglove, Rerun and PlotJuggler.
//!
//! Every sample is a message on `/inputs`, `/measured`, `/twin` and `/residuals`. `/bands` has one
//! message, and `/decisions` has one for each change of the finding. Messages are JSON with a schema. The name of a number
//! ends with its unit, and a missing value is null. Notices of a live watch (no data, heartbeats) are on `/watch`; while the
//! source is silent, `/decisions` has the state `no_data`.

use super::{Sample, Scene, Sink, SinkError, Trace};
use crate::watchdog::{Notice, WatchEvent};
use ::mcap::records::MessageHeader;
use ::mcap::{McapError, WriteOptions, Writer};
use serde_json::{Map, Value, json};
use servotwin::live::observer::Finding;
use servotwin_io::files::{AtomicFile, FileError};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The size of a chunk, bytes; readers load chunks whole.
const CHUNK: u64 = 1 << 17;

/// The index of the bands among the channels of numbers.
const BANDS: usize = 4;

/// Writes an MCAP file.
pub struct Mcap {
    path: PathBuf,
    writer: Writer<AtomicFile>,
    /// Inputs, measured values, twin, residuals and bands.
    numbers: Vec<Channel>,
    /// The channels of findings and notices, which appear with their first message.
    notes: BTreeMap<&'static str, Channel>,
    text: String,
    /// The last finding on `/decisions`, except silence.
    last_finding: Finding,
    /// The bands, until they are written with the first sample.
    bands: Option<Vec<f64>>,
}

/// A channel of the file.
struct Channel {
    id: u16,
    sequence: u32,
    /// The JSON keys of its numbers: `,"p_a_1_pa":`
    keys: Vec<String>,
}

impl Mcap {
    /// Begins a file; it appears when [`finish`](Self::finish)ed.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn create(path: &Path, scene: &Scene) -> Result<Self, SinkError> {
        let library = concat!("servotwin ", env!("CARGO_PKG_VERSION"));
        let options = WriteOptions::new().library(library).chunk_size(Some(CHUNK));
        let file = AtomicFile::create(path)?;
        let create = || -> Result<_, McapError> {
            let mut writer = options.create(file)?;
            let numbers = numbers(&mut writer, scene)?;
            Ok((writer, numbers))
        };
        let (writer, numbers) = create().map_err(|error| sink_error(path, error))?;
        let (path, last_finding) = (path.to_owned(), Finding::default());
        let (notes, text, bands) = (BTreeMap::new(), String::new(), Some(scene.bands.clone()));
        Ok(Mcap { path, writer, numbers, notes, text, last_finding, bands })
    }

    /// Completes the file and moves it into place.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(mut self) -> Result<(), SinkError> {
        self.writer.finish().map_err(|error| sink_error(&self.path, error))?;
        Ok(self.writer.into_inner().commit()?)
    }

    /// Writes one message of a channel of numbers; NaN becomes null.
    fn numbers(&mut self, channel: usize, time_s: f64, values: &[f64]) -> Result<(), SinkError> {
        let Mcap { writer, numbers, text, .. } = self;
        let channel = &mut numbers[channel];
        text.clear();
        let _ = write!(text, "{{\"time_s\":{time_s:?}");
        for (key, value) in channel.keys.iter().zip(values) {
            text.push_str(key);
            // `{:?}` prints the shortest text that reads back to the same bits.
            let _ = match value.is_finite() {
                true => write!(text, "{value:?}"),
                false => write!(text, "null"),
            };
        }
        text.push('}');
        channel.send(writer, time_s, text).map_err(|error| sink_error(&self.path, error))
    }

    /// Writes a message of JSON, whose keys are the schema of its channel if it is the first.
    fn note(&mut self, topic: &'static str, time_s: f64, note: &Value) -> Result<(), SinkError> {
        let Mcap { writer, notes, .. } = self;
        let mut write = || {
            if !notes.contains_key(topic) {
                notes.insert(topic, Channel::of_note(writer, topic, note)?);
            }
            let channel = notes.get_mut(topic).expect("it was inserted above");
            channel.send(writer, time_s, &note.to_string())
        };
        write().map_err(|error| sink_error(&self.path, error))
    }

    fn decide(&mut self, time_s: f64, finding: &Finding) -> Result<(), SinkError> {
        let mut decision = serde_json::to_value(finding).unwrap_or_default();
        decision["time_s"] = json!(time_s);
        self.note("/decisions", time_s, &decision)
    }
}

/// The channels of numbers, with name and unit of each number.
fn numbers(writer: &mut Writer<AtomicFile>, scene: &Scene) -> Result<Vec<Channel>, McapError> {
    let si = |trace: &Trace| {
        let (id, suffix) = (&trace.id, trace.unit.suffix());
        let name = if id.ends_with(suffix) { id.clone() } else { format!("{id}{suffix}") };
        (name, trace.unit.symbol().to_owned())
    };
    let share = |(trace, divisor): (&Trace, &&str)| {
        (trace.id.clone(), format!("share of the sensor's {divisor}"))
    };
    let inputs: Vec<_> = scene.inputs.iter().map(si).collect();
    let sensors: Vec<_> = scene.sensors.iter().map(si).collect();
    let shares: Vec<_> = scene.sensors.iter().zip(&scene.residual_divisors).map(share).collect();
    let topics = [
        ("/inputs", &inputs),
        ("/measured", &sensors),
        ("/twin", &sensors),
        ("/residuals", &shares),
        ("/bands", &shares),
    ];
    let channel = |(topic, numbers): (&str, &Vec<(String, String)>)| {
        let number = |(name, unit): &(String, String)| {
            (name.clone(), json!({ "type": ["number", "null"], "description": unit }))
        };
        let keys = numbers.iter().map(|(name, _)| format!(",{}:", json!(name))).collect();
        Channel::new(writer, topic, numbers.iter().map(number).collect(), keys)
    };
    topics.into_iter().map(channel).collect()
}

impl Sink for Mcap {
    fn sample(&mut self, sample: &Arc<Sample>) -> Result<(), SinkError> {
        let Sample { time_s, inputs, measured, twin, residuals, .. } = &**sample;
        for (channel, values) in [inputs, measured, twin, residuals].into_iter().enumerate() {
            self.numbers(channel, *time_s, values)?;
        }
        if let Some(bands) = self.bands.take() {
            self.numbers(BANDS, *time_s, &bands)?;
        }
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
        self.note("/watch", now_s, &words)?;
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

impl Channel {
    /// A channel of which one message is known; any key may be null in others.
    fn of_note(
        writer: &mut Writer<AtomicFile>,
        topic: &str,
        note: &Value,
    ) -> Result<Self, McapError> {
        let kind = |value: &Value| match value {
            Value::Null => json!({}),
            Value::Bool(_) => json!({ "type": ["boolean", "null"] }),
            Value::Number(_) => json!({ "type": ["number", "null"] }),
            Value::String(_) => json!({ "type": ["string", "null"] }),
            Value::Array(_) => json!({ "type": "array" }),
            Value::Object(_) => json!({ "type": "object" }),
        };
        let known = note.as_object().into_iter().flatten();
        let properties = known.map(|(key, value)| (key.clone(), kind(value))).collect();
        Channel::new(writer, topic, properties, vec![])
    }

    fn new(
        writer: &mut Writer<AtomicFile>,
        topic: &str,
        mut properties: Map<String, Value>,
        keys: Vec<String>,
    ) -> Result<Self, McapError> {
        properties.insert("time_s".into(), json!({ "type": "number", "description": "s" }));
        let schema = json!({
            "$schema": "http://json-schema.org/draft-07/schema#",
            "type": "object",
            "properties": properties,
        });
        let name = format!("servotwin.{}", topic.trim_start_matches('/'));
        let schema = writer.add_schema(&name, "jsonschema", schema.to_string().as_bytes())?;
        let id = writer.add_channel(schema, topic, "json", &BTreeMap::new())?;
        Ok(Channel { id, sequence: 0, keys })
    }

    fn send(
        &mut self,
        writer: &mut Writer<AtomicFile>,
        time_s: f64,
        text: &str,
    ) -> Result<(), McapError> {
        // The format has no negative times: they are written as zero.
        let log_time = (time_s * 1e9).round() as u64;
        let (channel_id, sequence) = (self.id, self.sequence);
        let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        self.sequence = self.sequence.wrapping_add(1);
        writer.write_to_known_channel(&header, text.as_bytes())
    }
}

fn sink_error(path: &Path, error: McapError) -> SinkError {
    let cause = match error {
        McapError::Io(cause) => cause,
        error => std::io::Error::other(error.to_string()),
    };
    SinkError::File(FileError::from_io(path, cause))
}
