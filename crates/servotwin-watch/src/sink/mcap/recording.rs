//! Writes an MCAP file: topics of numbers with a schema, and topics of JSON.

use crate::sink::SinkError;
use ::mcap::records::MessageHeader;
use ::mcap::{McapError, WriteOptions, Writer};
use serde_json::{Map, Value, json};
use servotwin_io::files::{AtomicFile, FileError};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The size of a chunk, bytes; readers load chunks whole.
const CHUNK: u64 = 1 << 17;

/// A topic whose messages are numbers.
pub struct Topic {
    /// The name, with a leading slash.
    pub name: String,
    /// Name and unit of each number.
    pub numbers: Vec<(String, String)>,
}

/// A recording that is written message by message.
pub struct Recording {
    path: PathBuf,
    writer: Writer<AtomicFile>,
    topics: Vec<Channel>,
    notes: BTreeMap<&'static str, Channel>,
    text: String,
}

/// A topic in the file.
struct Channel {
    id: u16,
    sequence: u32,
    /// The JSON keys of its numbers: `,"p_a_1_pa":`
    keys: Vec<String>,
}

impl Recording {
    /// Begins a file with topics of numbers; it appears when [`finish`](Self::finish)ed.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn create(path: &Path, topics: &[Topic]) -> Result<Self, SinkError> {
        let failed = |error| sink_error(path, error);
        let library = concat!("servotwin ", env!("CARGO_PKG_VERSION"));
        let options = WriteOptions::new().library(library).chunk_size(Some(CHUNK));
        let mut writer = options.create(AtomicFile::create(path)?).map_err(failed)?;
        let channels = topics.iter().map(|topic| Channel::of_numbers(&mut writer, topic));
        let topics = channels.collect::<Result<_, _>>().map_err(failed)?;
        let (path, notes) = (path.to_owned(), BTreeMap::new());
        Ok(Recording { path, writer, topics, notes, text: String::new() })
    }

    /// Writes one message of a topic, by its index; NaN becomes null. There is nothing to write for a missing topic.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn numbers(&mut self, topic: usize, time_s: f64, values: &[f64]) -> Result<(), SinkError> {
        let Recording { writer, topics, text, .. } = self;
        let Some(topic) = topics.get_mut(topic) else { return Ok(()) };
        text.clear();
        let _ = write!(text, "{{\"time_s\":{time_s:?}");
        for (key, value) in topic.keys.iter().zip(values) {
            text.push_str(key);
            // `{:?}` prints the shortest text that reads back to the same bits.
            let _ = match value.is_finite() {
                true => write!(text, "{value:?}"),
                false => write!(text, "null"),
            };
        }
        text.push('}');
        topic.send(writer, time_s, text).map_err(|error| sink_error(&self.path, error))
    }

    /// Writes a message of JSON; its topic, with a leading slash, appears with the first one, whose keys are the
    /// schema.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn note(
        &mut self,
        topic: &'static str,
        time_s: f64,
        note: &Value,
    ) -> Result<(), SinkError> {
        let Recording { writer, notes, .. } = self;
        let mut write = || {
            if !notes.contains_key(topic) {
                notes.insert(topic, Channel::of_note(writer, topic, note)?);
            }
            let channel = notes.get_mut(topic).expect("it was inserted above");
            channel.send(writer, time_s, &note.to_string())
        };
        write().map_err(|error| sink_error(&self.path, error))
    }

    /// Completes the file and moves it into place.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(mut self) -> Result<(), SinkError> {
        self.writer.finish().map_err(|error| sink_error(&self.path, error))?;
        Ok(self.writer.into_inner().commit()?)
    }
}

impl Channel {
    fn of_numbers(writer: &mut Writer<AtomicFile>, topic: &Topic) -> Result<Self, McapError> {
        let number = |(name, unit): &(String, String)| {
            (name.clone(), json!({ "type": ["number", "null"], "description": unit }))
        };
        let properties = topic.numbers.iter().map(number).collect();
        let keys = topic.numbers.iter().map(|(name, _)| format!(",{}:", json!(name))).collect();
        Channel::new(writer, &topic.name, properties, keys)
    }

    /// Creates a topic of which one message is known; any key may be null in others.
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
