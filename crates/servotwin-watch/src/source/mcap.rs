//! Reads JSON messages from all channels of an MCAP file; messages with the same time form one row.
//!
//! A column is named by the topic without its leading `/`, a point, and the key in the message (`measured.p_a_1_pa`).
//! `log_time` is the time of the message in ns. A damaged chunk is skipped and counted; reading continues after it.
//!
//! A first pass finds the columns, and whether messages are in the order of their times, as recorders write them. A file
//! that was written topic by topic, or merged, is rejected.

use super::frame::Frames;
use super::object::Leaf;
use super::survey::{LogColumn, Objects};
use super::{LogRow, Read, Source, SourceError, Wanted};
use crate::counts::{Flaw, Irregularity};
use ::mcap::McapError;
use ::mcap::read::ChunkReader;
use ::mcap::records::{ChunkHeader, Record};
use ::mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use servotwin_io::files::{self, FileError};
use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::io::{self, BufReader, Read as _};
use std::path::{Path, PathBuf};

/// The column with the message time.
pub(crate) const LOG_TIME: &str = "log_time";

/// The largest chunk or record, bytes.
const LARGEST: usize = 1 << 28;

/// A message may be older than an earlier one by this time, ns: rows wait so long for late ones.
const DISORDER_NS: u64 = 50_000_000;

/// The rows of an open file.
struct Rows {
    messages: Messages,
    frames: Frames,
    /// The number of wanted columns, and which of them is the time of the message.
    width: usize,
    log_time: Option<usize>,
}

/// Opens a file that must have the wanted columns.
pub(crate) fn open(path: &Path, wanted: &Wanted) -> Result<Box<dyn Source>, SourceError> {
    wanted.require_columns(path, survey(path, Some(wanted))?)?;
    let log_time = wanted.names.iter().position(|name| name == LOG_TIME);
    let (messages, frames) = (Messages::open(path)?, Frames::new(wanted));
    Ok(Box::new(Rows { messages, frames, width: wanted.names.len(), log_time }))
}

/// A message in JSON.
struct Message {
    number: u64,
    log_time_ns: u64,
    /// The topic without its leading slash, followed by a point.
    prefix: String,
    data: Vec<u8>,
}

impl Source for Rows {
    fn read(&mut self, row: &mut LogRow) -> Result<Read, SourceError> {
        let mut message = match self.messages.next()? {
            Some(Ok(message)) => message,
            Some(Err(flaw)) => {
                row.place = self.messages.count;
                return Ok(Read::Flawed(flaw));
            }
            None => return Ok(Read::End),
        };
        row.begin(self.width);
        row.place = message.number;
        let time_ns = message.log_time_ns;
        loop {
            if let Err(flaw) = self.frames.add(&message.prefix, &message.data, row) {
                return Ok(Read::Flawed(flaw));
            }
            message = match self.messages.next()? {
                Some(Ok(next)) if next.log_time_ns == time_ns => next,
                next => {
                    next.into_iter().for_each(|next| self.messages.waiting.push_front(next));
                    break;
                }
            };
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
        let Messages { read, size, .. } = self.messages;
        (size > 0).then(|| (read as f64 / size as f64).min(1.0))
    }
}

/// The columns of all channels, with the time and its unit.
pub(crate) fn columns(path: &Path) -> Result<Vec<LogColumn>, SourceError> {
    let found = survey(path, None)?;
    if found.len() > 1 {
        return Ok(found);
    }
    let (address, seen) = (path.display().to_string(), "no message is in JSON".into());
    Err(SourceError::NoHeader { address, seen })
}

/// Scans a file for columns: a channel may begin anywhere. If columns are `wanted`, the scan may stop collecting once
/// it has them.
///
/// # Errors
/// The file cannot be read, or its messages are not in the order of their times.
fn survey(path: &Path, wanted: Option<&Wanted>) -> Result<Vec<LogColumn>, SourceError> {
    let mut messages = Messages::open(path)?;
    let (mut found, mut newest_ns) = (Objects::default(), 0);
    found.name(LOG_TIME, "ns");
    let mut has_all = false;
    while let Some(next) = messages.next()? {
        let Ok(message) = next else { continue };
        newest_ns = message.log_time_ns.max(newest_ns);
        if newest_ns - message.log_time_ns > DISORDER_NS {
            return Err(SourceError::Unsorted { address: path.display().to_string() });
        }
        if !has_all {
            found.take(LOG_TIME, &Leaf::Number(message.log_time_ns as f64));
            found.add(&message.prefix, &message.data);
            has_all = wanted.is_some_and(|wanted| found.has_all(wanted));
        }
    }
    Ok(found.finish())
}

/// The messages of a file in file order.
struct Messages {
    path: PathBuf,
    file: BufReader<File>,
    reader: LinearReader,
    /// The column prefixes of JSON channels.
    channels: BTreeMap<u16, String>,
    waiting: VecDeque<Result<Message, Flaw>>,
    count: u64,
    read: u64,
    size: u64,
    ended: bool,
}

impl Messages {
    fn open(path: &Path) -> Result<Self, SourceError> {
        let failed = |cause| FileError::from_io(path, cause);
        let file = files::open(path)?;
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

    /// The next message, or what is none; `None` at the end.
    fn next(&mut self) -> Result<Option<Result<Message, Flaw>>, SourceError> {
        while self.waiting.is_empty() && !self.ended {
            self.advance()?;
        }
        Ok(self.waiting.pop_front())
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
                    self.waiting.push_back(Err(flaw));
                }
            }
            Ok(record) => self.record(record),
            Err(error) => {
                // After this error, record boundaries are unknown.
                self.ended = true;
                let flaw = match error {
                    McapError::UnexpectedEof | McapError::UnexpectedEoc => {
                        Irregularity::CutShort.into()
                    }
                    error => Flaw::new(Irregularity::BadObject, error.to_string()),
                };
                self.waiting.push_back(Err(flaw));
            }
        }
        Ok(())
    }

    fn chunk(&mut self, header: ChunkHeader, data: &[u8]) -> Result<(), Flaw> {
        let flaw = |cause: &dyn ToString| Flaw::new(Irregularity::BadObject, cause.to_string());
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
                    self.waiting.push_back(Ok(Message {
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

/// Decompresses the records of a chunk.
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
        false => Err(wrong("a chunk that is shorter than it states".into())),
    }
}
