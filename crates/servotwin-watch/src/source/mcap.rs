//! Reads JSON messages from all channels of an MCAP file; messages with the same time form one row.
//!
//! A column is named by the topic without its leading `/`, a point, and the key in the message (`measured.p_a_1_pa`).
//! `log_time` is the time of the message in ns. A damaged chunk is skipped and counted; reading continues after it.
//!
//! Rows are ordered by time. A first pass finds out whether messages are in order, as recorders write them. Ordered
//! messages are read one by one. In any other file (written topic by topic, or merged), the wanted numbers are read
//! into memory and sorted.

use super::frame::Frames;
use super::object::Leaf;
use super::survey::{LogColumn, Objects};
use super::{Bad, LogRow, Read, Source, SourceError, Wanted};
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

/// The most numbers of an unordered file that are sorted in memory: a gigabyte.
const MOST_SORTED: usize = 50_000_000;

/// A file whose messages are in order.
struct InOrder {
    messages: Messages,
    frames: Frames,
    /// The number of wanted columns.
    width: usize,
    /// The index of the message time in a row.
    log_time: Option<usize>,
    /// The first message of the next row.
    next: Option<Message>,
    read: u64,
}

/// Opens a file that must have the wanted columns.
pub(crate) fn open(path: &Path, wanted: &Wanted) -> Result<Box<dyn Source>, SourceError> {
    let Survey { columns, is_in_order } = survey(path, Some(wanted))?;
    let known: Vec<String> = columns.into_iter().map(|column| column.name).collect();
    wanted.require(&path.display().to_string(), &known)?;
    if !is_in_order {
        return Ok(Box::new(Sorted::open(path, wanted)?));
    }
    let log_time = wanted.names.iter().position(|name| name == LOG_TIME);
    let (messages, frames) = (Messages::open(path)?, Frames::new(wanted));
    let width = wanted.names.len();
    Ok(Box::new(InOrder { messages, frames, width, log_time, next: None, read: 0 }))
}

/// A message in JSON.
struct Message {
    number: u64,
    log_time_ns: u64,
    /// The topic without its leading slash, followed by a point.
    prefix: String,
    data: Vec<u8>,
}

/// The next item of a file.
enum Next {
    Message(Message),
    Flawed(Flaw),
    End,
}

impl Source for InOrder {
    fn read(&mut self, row: &mut LogRow) -> Result<Read, SourceError> {
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
        row.begin(self.width);
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
                // The flaw is reported with the next row.
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

/// The columns of all channels, with the time and its unit.
pub(crate) fn columns(path: &Path) -> Result<Vec<LogColumn>, SourceError> {
    let found = survey(path, None)?.columns;
    match found.len() {
        1 => {
            let (address, seen) = (path.display().to_string(), "no message is in JSON".into());
            Err(SourceError::NoHeader { address, seen })
        }
        _ => Ok(found),
    }
}

/// The result of a first pass through a file.
struct Survey {
    columns: Vec<LogColumn>,
    is_in_order: bool,
}

/// Scans a file for columns: a channel may begin anywhere. If columns are `wanted`, the scan may stop collecting once
/// it has them.
fn survey(path: &Path, wanted: Option<&Wanted>) -> Result<Survey, SourceError> {
    let mut messages = Messages::open(path)?;
    let (mut found, mut last_ns, mut is_in_order) = (Objects::default(), 0, true);
    found.name(LOG_TIME, "ns");
    let mut has_all = false;
    loop {
        let message = match messages.next()? {
            Next::Message(message) => message,
            Next::Flawed(_) => continue,
            Next::End => break,
        };
        is_in_order &= last_ns <= message.log_time_ns;
        last_ns = message.log_time_ns;
        if !has_all {
            found.take(LOG_TIME, &Leaf::Number(message.log_time_ns as f64));
            found.add(&message.prefix, &message.data);
            has_all = wanted.is_some_and(|wanted| found.has_all(wanted));
        }
    }
    Ok(Survey { columns: found.finish(), is_in_order })
}

/// The wanted numbers of an unordered file, sorted by message time.
struct Sorted {
    wanted: Wanted,
    log_time: Option<usize>,
    parts: Vec<Part>,
    /// Flawed messages, reported while the file is read.
    flaws: VecDeque<(u64, Flaw)>,
    next: usize,
}

/// The values of one message.
struct Part {
    log_time_ns: u64,
    number: u64,
    /// The index in a row of every number, and the number.
    values: Box<[(u16, f64)]>,
    bad: u64,
    first_bad: Option<Box<Bad>>,
}

impl Sorted {
    fn open(path: &Path, wanted: &Wanted) -> Result<Self, SourceError> {
        let log_time = wanted.names.iter().position(|name| name == LOG_TIME);
        let (wanted, parts, flaws) = (wanted.clone(), vec![], VecDeque::new());
        let mut sorted = Sorted { wanted, log_time, parts, flaws, next: 0 };
        let (mut messages, frames) = (Messages::open(path)?, Frames::new(&sorted.wanted));
        let (mut row, mut numbers) = (LogRow::default(), 0);
        loop {
            match messages.next()? {
                Next::Message(message) => numbers += sorted.take(&frames, &message, &mut row),
                Next::Flawed(flaw) => sorted.flaws.push_back((messages.count, flaw)),
                Next::End => break,
            }
            if numbers > MOST_SORTED {
                let address = path.display().to_string();
                return Err(SourceError::Unsorted { address, most: MOST_SORTED });
            }
        }
        sorted.parts.sort_by_key(|part| (part.log_time_ns, part.number));
        Ok(sorted)
    }

    /// Keeps the wanted numbers of a message; returns how many there are.
    fn take(&mut self, frames: &Frames, message: &Message, row: &mut LogRow) -> usize {
        row.begin(self.wanted.names.len());
        let &Message { log_time_ns, number, .. } = message;
        if let Err(flaw) = frames.add(&message.prefix, &message.data, row) {
            self.flaws.push_back((number, flaw));
            return 0;
        }
        let known = row.values.iter().enumerate().filter(|(_, value)| !value.is_nan());
        let values: Box<[_]> = known.map(|(place, value)| (place as u16, *value)).collect();
        let (count, first_bad) = (values.len(), row.first_bad.take().map(Box::new));
        if count > 0 || row.bad > 0 {
            self.parts.push(Part { log_time_ns, number, values, bad: row.bad, first_bad });
        }
        count
    }
}

impl Source for Sorted {
    fn read(&mut self, row: &mut LogRow) -> Result<Read, SourceError> {
        if let Some((place, flaw)) = self.flaws.pop_front() {
            row.place = place;
            return Ok(Read::Flawed(flaw));
        }
        let Some(first) = self.parts.get(self.next) else { return Ok(Read::End) };
        row.begin(self.wanted.names.len());
        row.place = first.number;
        if let Some(place) = self.log_time {
            row.values[place] = first.log_time_ns as f64;
        }
        let is_same = |part: &&Part| part.log_time_ns == first.log_time_ns;
        for part in self.parts[self.next..].iter().take_while(is_same) {
            for &(place, value) in &part.values {
                row.values[usize::from(place)] = value;
            }
            row.bad += part.bad;
            row.first_bad = row.first_bad.take().or_else(|| part.first_bad.as_deref().cloned());
            self.next += 1;
        }
        Ok(super::frame::with_time(&self.wanted, row))
    }

    fn counted(&self) -> &'static str {
        "message"
    }

    fn share(&self) -> Option<f64> {
        let all = self.parts.len();
        (all > 0).then(|| self.next as f64 / all as f64)
    }
}

/// The messages of a file in file order.
struct Messages {
    path: PathBuf,
    file: BufReader<File>,
    reader: LinearReader,
    /// The column prefixes of JSON channels.
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
                // After this error, record boundaries are unknown.
                self.ended = true;
                let flaw = match error {
                    McapError::UnexpectedEof | McapError::UnexpectedEoc => {
                        Irregularity::CutShort.into()
                    }
                    error => Flaw::new(Irregularity::BadObject, error.to_string()),
                };
                self.waiting.push_back(Next::Flawed(flaw));
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
