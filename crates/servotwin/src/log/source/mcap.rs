//! MCAP files: the messages of all channels in JSON, those of one time as one row.
//!
//! A column is the topic without its leading `/`, a point, and the key in the message
//! (`measured.p_a_1_pa`); `log_time` is the time of the message in ns. A damaged chunk is left out and
//! counted; what comes behind it is read.

use super::frame::{Flaw, Frames};
use super::{Read, Row, Source, SourceError, Wanted};
use crate::files::FileError;
use ::mcap::McapError;
use ::mcap::read::ChunkReader;
use ::mcap::records::{ChunkHeader, Record};
use ::mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::io::{self, BufReader, Read as _};
use std::path::{Path, PathBuf};

/// The column with the time of a message.
pub const LOG_TIME: &str = "log_time";

/// No chunk and no record is larger.
const LARGEST: usize = 1 << 28;

/// A file.
pub struct Mcap {
    messages: Messages,
    frames: Frames,
    /// The place of the time of a message in a row.
    log_time: Option<usize>,
    /// A message of the next row.
    next: Option<Message>,
    read: u64,
}

/// A message in JSON.
struct Message {
    number: u64,
    log_time_ns: u64,
    /// The topic, without its leading slash, and a point.
    prefix: String,
    data: Vec<u8>,
}

/// What comes next in a file.
enum Next {
    Message(Message),
    Flawed(Flaw),
    End,
}

impl Mcap {
    /// Opens a file that must have some columns.
    pub fn open(path: &Path, wanted: &Wanted) -> Result<Self, SourceError> {
        let known: Vec<String> = columns(path)?.into_iter().map(|(name, _)| name).collect();
        let address = path.display().to_string();
        if let Some(error) = SourceError::lacking(&address, wanted, &known) {
            return Err(error);
        }
        let log_time = wanted.names.iter().position(|name| name == LOG_TIME);
        let (messages, frames) = (Messages::open(path)?, Frames::new(wanted));
        Ok(Mcap { messages, frames, log_time, next: None, read: 0 })
    }
}

impl Source for Mcap {
    fn read(&mut self, row: &mut Row) -> Result<Read, SourceError> {
        let first = match self.next.take() {
            Some(message) => message,
            None => match self.messages.next()? {
                Next::Message(message) => message,
                Next::Flawed(flaw) => {
                    row.place = self.messages.count;
                    return Ok(Read::Flawed(flaw));
                }
                Next::End => return Ok(Read::End),
            },
        };
        self.frames.begin(row);
        row.place = first.number;
        let time_ns = first.log_time_ns;
        let mut result = self.frames.add(&first.prefix, &first.data, row);
        while result.is_ok() {
            match self.messages.next()? {
                Next::Message(message) if message.log_time_ns == time_ns => {
                    result = self.frames.add(&message.prefix, &message.data, row);
                }
                Next::Message(message) => {
                    self.next = Some(message);
                    break;
                }
                // It is told with the next row.
                Next::Flawed(flaw) => {
                    self.messages.waiting.push_front(Next::Flawed(flaw));
                    break;
                }
                Next::End => break,
            }
        }
        self.read = self.messages.read;
        if let Err(flaw) = result {
            return Ok(Read::Flawed(flaw));
        }
        if let Some(place) = self.log_time {
            row.values[place] = time_ns as f64;
        }
        Ok(self.frames.end(row))
    }

    fn counted(&self) -> &'static str {
        "message"
    }

    fn share(&self) -> Option<f64> {
        let size = self.messages.size;
        (size > 0).then(|| (self.read as f64 / size as f64).min(1.0))
    }
}

/// The columns of the first message of every channel, with the unit of the time.
pub fn columns(path: &Path) -> Result<Vec<(String, String)>, SourceError> {
    let mut messages = Messages::open(path)?;
    let mut found = vec![(LOG_TIME.to_owned(), "ns".to_owned())];
    let mut seen = BTreeMap::new();
    // Channels are told at the beginning; one that speaks later than this is not offered.
    for _ in 0..10_000 {
        let message = match messages.next()? {
            Next::Message(message) => message,
            Next::Flawed(_) => continue,
            Next::End => break,
        };
        if seen.insert(message.prefix.clone(), ()).is_none() {
            let keys = super::frame::columns(&message.data).unwrap_or_default();
            let named = keys.iter().map(|key| (format!("{}{key}", message.prefix), String::new()));
            found.extend(named);
        }
    }
    match found.len() {
        1 => Err(SourceError::NoHeader { address: path.display().to_string() }),
        _ => Ok(found),
    }
}

/// The messages of a file in its order.
struct Messages {
    path: PathBuf,
    file: BufReader<File>,
    reader: LinearReader,
    /// The prefixes of channels in JSON.
    channels: BTreeMap<u16, String>,
    waiting: VecDeque<Next>,
    count: u64,
    read: u64,
    size: u64,
    ended: bool,
}

impl Messages {
    fn open(path: &Path) -> Result<Self, SourceError> {
        let failed = |cause| FileError::from_io(path, cause);
        let file = File::open(path).map_err(failed)?;
        let size = file.metadata().map_err(failed)?.len();
        let options = LinearReaderOptions::default()
            .with_emit_chunks(true)
            .with_skip_end_magic(true)
            .with_record_length_limit(LARGEST);
        Ok(Messages {
            path: path.into(),
            file: BufReader::new(file),
            reader: LinearReader::new_with_options(options),
            channels: BTreeMap::new(),
            waiting: VecDeque::new(),
            count: 0,
            read: 0,
            size,
            ended: false,
        })
    }

    fn next(&mut self) -> Result<Next, SourceError> {
        loop {
            if let Some(next) = self.waiting.pop_front() {
                return Ok(next);
            }
            if self.ended {
                return Ok(Next::End);
            }
            self.advance()?;
        }
    }

    /// Reads a record.
    fn advance(&mut self) -> Result<(), SourceError> {
        let record = match self.reader.next_event() {
            None => {
                self.ended = true;
                return Ok(());
            }
            Some(Ok(LinearReadEvent::ReadRequest(needed))) => {
                let buffer = self.reader.insert(needed);
                let length = self
                    .file
                    .read(buffer)
                    .map_err(|cause| FileError::from_io(&self.path, cause))?;
                self.reader.notify_read(length);
                self.read += length as u64;
                return Ok(());
            }
            Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                ::mcap::parse_record(opcode, data).map(Record::into_owned)
            }
            Some(Err(error)) => Err(error),
        };
        match record {
            Ok(Record::Chunk { header, data }) => {
                if let Err(flaw) = self.chunk(header, &data) {
                    self.waiting.push_back(Next::Flawed(flaw));
                }
            }
            Ok(record) => self.record(record),
            Err(error) => {
                // Behind this nothing can be told apart.
                self.ended = true;
                let flaw = match error {
                    McapError::UnexpectedEof | McapError::UnexpectedEoc => Flaw::CutShort,
                    error => Flaw::BadObject { cause: error.to_string() },
                };
                self.waiting.push_back(Next::Flawed(flaw));
            }
        }
        Ok(())
    }

    fn chunk(&mut self, header: ChunkHeader, data: &[u8]) -> Result<(), Flaw> {
        let flaw = |cause: &dyn ToString| Flaw::BadObject { cause: cause.to_string() };
        let content = unpacked(&header, data).map_err(|cause| flaw(&cause))?;
        let size = content.len() as u64;
        let plain = ChunkHeader { compression: String::new(), compressed_size: size, ..header };
        for record in ChunkReader::new(plain, &content).map_err(|cause| flaw(&cause))? {
            self.record(record.map_err(|cause| flaw(&cause))?);
        }
        Ok(())
    }

    fn record(&mut self, record: Record) {
        match record {
            Record::Channel(channel) if channel.message_encoding == "json" => {
                let prefix = format!("{}.", channel.topic.trim_start_matches('/'));
                self.channels.insert(channel.id, prefix);
            }
            Record::Message { header, data } => {
                self.count += 1;
                if let Some(prefix) = self.channels.get(&header.channel_id) {
                    self.waiting.push_back(Next::Message(Message {
                        number: self.count,
                        log_time_ns: header.log_time,
                        prefix: prefix.clone(),
                        data: data.into_owned(),
                    }));
                }
            }
            _ => {}
        }
    }
}

/// The records of a chunk.
fn unpacked(header: &ChunkHeader, data: &[u8]) -> io::Result<Vec<u8>> {
    let wrong = |cause: String| io::Error::new(io::ErrorKind::InvalidData, cause);
    let size = header.uncompressed_size;
    if size > LARGEST as u64 {
        return Err(wrong(format!("a chunk of {size} bytes")));
    }
    let mut content = vec![];
    match &*header.compression {
        "" => content.extend_from_slice(data),
        "lz4" => {
            let decoder = lz4_flex::frame::FrameDecoder::new(data);
            decoder.take(size).read_to_end(&mut content)?;
        }
        "zstd" => {
            let decoder = ruzstd::decoding::StreamingDecoder::new(data);
            let decoder = decoder.map_err(|error| wrong(error.to_string()))?;
            decoder.take(size).read_to_end(&mut content)?;
        }
        other => return Err(wrong(format!("a chunk compressed with '{other}'"))),
    }
    match content.len() as u64 == size {
        true => Ok(content),
        false => Err(wrong("a chunk that is shorter than it says".into())),
    }
}
