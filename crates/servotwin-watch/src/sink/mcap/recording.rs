//! Writes a finished recording as an MCAP file: topics of numbers with a message for each sample, and topics of JSON.

use super::{Channel, channel_id, sink_error};
use crate::sink::SinkError;
use ::mcap::{McapError, WriteOptions, Writer};
use servotwin_io::files::AtomicFile;
use std::collections::BTreeMap;
use std::path::Path;

/// A topic whose messages are numbers.
pub struct Topic {
    /// The name, with a leading slash.
    pub name: String,
    /// Name and unit of each number.
    pub numbers: Vec<(String, String)>,
}

/// A message of JSON.
pub struct Note {
    /// The topic, with a leading slash.
    pub topic: &'static str,
    /// The time, s.
    pub time_s: f64,
    /// The JSON.
    pub text: String,
}

/// A recording that is written sample by sample.
pub struct Recording<'p> {
    path: &'p Path,
    writer: Writer<AtomicFile>,
    topics: Vec<Channel>,
    notes: BTreeMap<&'static str, Channel>,
    text: String,
}

impl<'p> Recording<'p> {
    /// Begins a file, which appears when [`finish`](Self::finish)ed.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn create(path: &'p Path, topics: &[Topic]) -> Result<Self, SinkError> {
        let failed = |error| sink_error(path, error);
        let library = concat!("servotwin ", env!("CARGO_PKG_VERSION"));
        let options = WriteOptions::new().library(library).chunk_size(Some(super::CHUNK));
        let mut writer = options.create(AtomicFile::create(path)?).map_err(failed)?;
        let channels = topics.iter().map(|t| Channel::new(&mut writer, &t.name, &t.numbers));
        let topics = channels.collect::<Result<_, _>>().map_err(failed)?;
        Ok(Recording { path, writer, topics, notes: BTreeMap::new(), text: String::new() })
    }

    /// Writes one sample: for each topic its values; NaN becomes null.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn sample(&mut self, time_s: f64, values: &[Vec<f64>]) -> Result<(), SinkError> {
        for (topic, values) in self.topics.iter_mut().zip(values) {
            topic.numbers(time_s, values, &mut self.text);
            let sent = topic.send(&mut self.writer, time_s, &self.text);
            sent.map_err(|error| sink_error(self.path, error))?;
        }
        Ok(())
    }

    /// Writes a message of JSON; its topic appears with the first one.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn note(&mut self, note: &Note) -> Result<(), SinkError> {
        self.write_note(note).map_err(|error| sink_error(self.path, error))
    }

    fn write_note(&mut self, note: &Note) -> Result<(), McapError> {
        if !self.notes.contains_key(note.topic) {
            let id = channel_id(&mut self.writer, note.topic, serde_json::Map::new())?;
            self.notes.insert(note.topic, Channel { id, sequence: 0, keys: vec![] });
        }
        let channel = self.notes.get_mut(note.topic).expect("it was inserted above");
        channel.send(&mut self.writer, note.time_s, &note.text)
    }

    /// Completes the file and moves it into place.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(mut self) -> Result<(), SinkError> {
        self.writer.finish().map_err(|error| sink_error(self.path, error))?;
        Ok(self.writer.into_inner().commit()?)
    }
}
