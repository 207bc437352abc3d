//! The blocks of an MDF 4 file: groups, channels, and the records in their data blocks.

use super::super::SourceError;
use super::super::groups::bytes;
use servotwin_io::files::{self, FileError};
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Read as _, Seek, SeekFrom};
use std::path::Path;

/// The largest block except data blocks, bytes.
const MAX_BLOCK: u64 = 1 << 24;

/// Longer names and units are cut, characters.
const MAX_TEXT: usize = 512;

/// The most blocks that are followed.
const MAX_BLOCKS: usize = 1 << 20;

/// The largest unzipped block, bytes.
const MAX_UNZIPPED: u64 = 1 << 28;

/// Data are read in parts of this size, bytes.
const PART: u64 = 1 << 20;

/// An open file with its groups.
pub(super) struct Mdf {
    file: File,
    size: u64,
    pub groups: Vec<ChannelGroup>,
    visited: BTreeSet<u64>,
}

/// Channels that are recorded together.
#[derive(Debug, Clone)]
pub(super) struct ChannelGroup {
    /// The address of the first data block of its data group.
    data: u64,
    record_id_bytes: usize,
    record_id: u64,
    /// The record lengths of all groups in the same data group, by record id.
    lengths: Vec<(u64, u64)>,
    pub records: u64,
    pub data_bytes: u64,
    pub invalidation_bytes: u64,
    pub channels: Vec<Channel>,
    /// The index of the time channel.
    pub master: Option<usize>,
}

/// A channel, as stored in its CN block.
#[derive(Debug, Clone)]
pub(super) struct Channel {
    pub name: String,
    pub unit: String,
    pub conversion: u64,
    pub kind: u8,
    pub sync: u8,
    pub data_type: u8,
    pub bit_offset: u8,
    pub byte_offset: u32,
    pub bits: u32,
    pub flags: u32,
    pub invalidation_bit: u32,
    pub is_composed: bool,
}

/// A block other than a data block: its links and its content.
pub(super) struct Block {
    pub links: Vec<u64>,
    pub data: Vec<u8>,
}

impl Block {
    pub(crate) fn link(&self, place: usize) -> u64 {
        self.links.get(place).copied().unwrap_or(0)
    }
}

type Outcome<T> = Result<T, String>;

impl Mdf {
    pub(crate) fn open(path: &Path) -> Result<Self, SourceError> {
        let failed = |cause| FileError::from_io(path, cause);
        let file = files::open(path)?;
        let size = file.metadata().map_err(failed)?.len();
        let mut mdf = Mdf { file, size, groups: vec![], visited: BTreeSet::new() };
        let read = mdf.identify().and_then(|()| mdf.read_groups());
        read.map_err(|cause| SourceError::unreadable(&path.display().to_string(), &cause))?;
        Ok(mdf)
    }

    fn identify(&mut self) -> Outcome<()> {
        let head: [u8; 64] = bytes(&self.part(0, 64)?, 0).ok_or("no MDF file")?;
        if head.starts_with(b"UnFinMF") {
            return Err(
                "the recording was not finished; finalize it, for example with asammdf".into()
            );
        }
        if !head.starts_with(b"MDF     ") {
            return Err("no MDF file".into());
        }
        match u16::from_le_bytes([head[28], head[29]]) {
            400..500 => Ok(()),
            version => Err(format!(
                "MDF of version {version}, and 400 to 499 is read; convert it, for example with asammdf"
            )),
        }
    }

    /// Reads `length` bytes at an address.
    fn part(&mut self, at: u64, length: u64) -> Outcome<Vec<u8>> {
        if at.checked_add(length).is_none_or(|end| end > self.size) {
            return Err(format!("the file ends within a block ({length} bytes from byte {at})"));
        }
        let mut found = vec![0; length as usize];
        let read =
            self.file.seek(SeekFrom::Start(at)).and_then(|_| self.file.read_exact(&mut found));
        read.map(|()| found).map_err(|cause: io::Error| cause.to_string())
    }

    /// The identifier of a block, its length and its number of links.
    fn head(&mut self, at: u64) -> Outcome<([u8; 4], u64, u64)> {
        let head = self.part(at, 24)?;
        let damaged = || format!("a damaged block at byte {at}");
        let id = bytes(&head, 0).ok_or_else(damaged)?;
        let number = |place| bytes(&head, place).map(u64::from_le_bytes).ok_or_else(damaged);
        let (length, links) = (number(8)?, number(16)?);
        let fits = length >= 24 && links <= (length - 24) / 8;
        if fits { Ok((id, length, links)) } else { Err(damaged()) }
    }

    /// Reads a block of a given kind.
    pub(crate) fn block(&mut self, at: u64, id: &[u8; 4]) -> Outcome<Block> {
        let (found, length, links) = self.head(at)?;
        if found != *id || length > MAX_BLOCK {
            return Err(format!("no {} block at byte {at}", String::from_utf8_lossy(&id[2..])));
        }
        let body = self.part(at + 24, length - 24)?;
        let (links, data) = body.split_at(8 * links as usize);
        let links = links.chunks_exact(8).filter_map(|link| bytes(link, 0).map(u64::from_le_bytes));
        Ok(Block { links: links.collect(), data: data.to_vec() })
    }

    /// The text of a TX block, or of the `TX` element of an MD block.
    fn text(&mut self, at: u64) -> Outcome<String> {
        if at == 0 {
            return Ok(String::new());
        }
        let is_plain = self.head(at)?.0 == *b"##TX";
        let block = self.block(at, if is_plain { b"##TX" } else { b"##MD" })?;
        let text = String::from_utf8_lossy(&block.data);
        let text = text.trim_end_matches('\0').trim();
        let inner = text.split_once("<TX>").and_then(|(_, rest)| rest.split_once("</TX>"));
        let text = if is_plain { text } else { inner.map_or("", |(inner, _)| inner) };
        Ok(text.chars().take(MAX_TEXT).collect())
    }

    /// Marks a block as visited; a list that returns to a visited block is rejected as endless.
    fn visit(&mut self, at: u64) -> Outcome<()> {
        match self.visited.insert(at) && self.visited.len() <= MAX_BLOCKS {
            true => Ok(()),
            false => {
                Err(format!("the block at byte {at} stands in two lists, or there are too many"))
            }
        }
    }

    fn read_groups(&mut self) -> Outcome<()> {
        let mut next = self.block(64, b"##HD")?.link(0);
        while next != 0 {
            self.visit(next)?;
            let data_group = self.block(next, b"##DG")?;
            next = data_group.link(0);
            let record_id_bytes = usize::from(data_group.data.first().copied().unwrap_or(0));
            if !matches!(record_id_bytes, 0 | 1 | 2 | 4 | 8) {
                return Err(format!("numbers of records with {record_id_bytes} bytes"));
            }
            let first = self.groups.len();
            let mut group = data_group.link(1);
            while group != 0 {
                self.visit(group)?;
                group = self.read_group(group, data_group.link(2), record_id_bytes)?;
            }
            let length = |group: &ChannelGroup| {
                (group.record_id, group.data_bytes + group.invalidation_bytes)
            };
            let lengths: Vec<(u64, u64)> = self.groups[first..].iter().map(length).collect();
            if record_id_bytes == 0 && lengths.len() > 1 {
                return Err(
                    "several groups have the same data, and their records no numbers".into()
                );
            }
            for group in &mut self.groups[first..] {
                group.lengths.clone_from(&lengths);
            }
        }
        Ok(())
    }

    /// Reads a group; returns the address of the next.
    fn read_group(&mut self, at: u64, data: u64, record_id_bytes: usize) -> Outcome<u64> {
        let block = self.block(at, b"##CG")?;
        let damaged = || format!("a damaged group at byte {at}");
        let number = |place| bytes(&block.data, place).map(u64::from_le_bytes).ok_or_else(damaged);
        let short = |place| bytes(&block.data, place).map(u32::from_le_bytes).ok_or_else(damaged);
        let flags = u16::from_le_bytes(bytes(&block.data, 16).ok_or_else(damaged)?);
        let mut group = ChannelGroup {
            data,
            record_id_bytes,
            record_id: number(0)?,
            lengths: vec![],
            records: number(8)?,
            data_bytes: u64::from(short(24)?),
            invalidation_bytes: u64::from(short(28)?),
            channels: vec![],
            master: None,
        };
        // Records of variable length (bit 0) begin with their length.
        if flags & 1 != 0 {
            return Err(
                "a group of values of variable length; save it sorted, for example with asammdf"
                    .into(),
            );
        }
        let mut next = block.link(1);
        while next != 0 {
            self.visit(next)?;
            next = self.read_channel(next, &mut group)?;
        }
        group.master = group.channels.iter().position(|c| matches!(c.kind, 2 | 3) && c.sync == 1);
        self.groups.push(group);
        Ok(block.link(0))
    }

    fn read_channel(&mut self, at: u64, group: &mut ChannelGroup) -> Outcome<u64> {
        let block = self.block(at, b"##CN")?;
        let damaged = || format!("a damaged channel at byte {at}");
        let head: [u8; 4] = bytes(&block.data, 0).ok_or_else(damaged)?;
        let short = |place| bytes(&block.data, place).map(u32::from_le_bytes).ok_or_else(damaged);
        let mut unit = self.text(block.link(6))?;
        if unit.is_empty() && block.link(4) != 0 {
            let conversion = self.block(block.link(4), b"##CC")?;
            unit = self.text(conversion.link(1))?;
        }
        group.channels.push(Channel {
            name: self.text(block.link(2))?,
            unit,
            conversion: block.link(4),
            kind: head[0],
            sync: head[1],
            data_type: head[2],
            bit_offset: head[3],
            byte_offset: short(4)?,
            bits: short(8)?,
            flags: short(12)?,
            invalidation_bit: short(16)?,
            is_composed: block.link(1) != 0,
        });
        Ok(block.link(0))
    }

    /// Passes the records of a group, without their ids, to `take` in order.
    pub(crate) fn records(
        &mut self,
        group: &ChannelGroup,
        take: &mut dyn FnMut(&[u8]),
    ) -> Outcome<()> {
        self.visited.clear();
        let mut splitter = Splitter { group, rest: vec![], left: group.records };
        let mut parts = vec![];
        self.list(group.data, &mut parts)?;
        for at in parts {
            self.data(at, &mut |part| splitter.add(part, take))?;
        }
        Ok(())
    }

    /// Collects the data blocks behind an address, in order.
    fn list(&mut self, mut at: u64, parts: &mut Vec<u64>) -> Outcome<()> {
        while at != 0 {
            self.visit(at)?;
            match &self.head(at)?.0 {
                b"##DT" | b"##DZ" => {
                    parts.push(at);
                    return Ok(());
                }
                b"##HL" => at = self.block(at, b"##HL")?.link(0),
                b"##DL" => {
                    let list = self.block(at, b"##DL")?;
                    for &part in list.links.iter().skip(1).filter(|&&part| part != 0) {
                        self.visit(part)?;
                        parts.push(part);
                    }
                    at = list.link(0);
                }
                b"##LD" | b"##DV" => {
                    return Err("data in columns (MDF 4.2); save it as 4.10 or 4.11, for example with asammdf".into());
                }
                other => {
                    return Err(format!(
                        "no data in the block {} at byte {at}",
                        other.escape_ascii()
                    ));
                }
            }
        }
        Ok(())
    }

    /// Passes the bytes of a data block to `take` in parts.
    fn data(&mut self, at: u64, take: &mut dyn FnMut(&[u8]) -> Outcome<()>) -> Outcome<()> {
        let (id, length, _) = self.head(at)?;
        match &id {
            b"##DT" => {
                let (mut place, end) = (at + 24, at.saturating_add(length));
                while place < end {
                    let part = self.part(place, PART.min(end - place))?;
                    place += part.len() as u64;
                    take(&part)?;
                }
                Ok(())
            }
            b"##DZ" => take(&self.unzipped(at, length)?),
            other => Err(format!("no data in the block {} at byte {at}", other.escape_ascii())),
        }
    }

    fn unzipped(&mut self, at: u64, length: u64) -> Outcome<Vec<u8>> {
        let damaged = || format!("a damaged zipped block at byte {at}");
        let head = self.part(at + 24, 24)?;
        let number = |place| bytes(&head, place).map(u64::from_le_bytes).ok_or_else(damaged);
        let (wanted, packed) = (number(8)?, number(16)?);
        // Deflate expands by at most about a factor of 1000.
        if packed > length - 24 || wanted > MAX_UNZIPPED || wanted / 1100 > packed {
            return Err(damaged());
        }
        let packed = self.part(at + 48, packed)?;
        let mut found = vec![];
        let mut unzip = flate2::read::ZlibDecoder::new(&packed[..]).take(wanted);
        unzip.read_to_end(&mut found).map_err(|_| damaged())?;
        if found.len() as u64 != wanted || !head.starts_with(b"DT") {
            return Err(damaged());
        }
        let columns = u32::from_le_bytes(bytes(&head, 4).ok_or_else(damaged)?) as usize;
        match head[2] {
            0 => Ok(found),
            1 if columns > 0 => Ok(transposed(&found, columns)),
            _ => Err(damaged()),
        }
    }
}

/// Restores rows from bytes packed column by column; an incomplete last row is stored as it is.
fn transposed(packed: &[u8], columns: usize) -> Vec<u8> {
    let rows = packed.len() / columns;
    let (whole, rest) = packed.split_at(rows * columns);
    let mut found = Vec::with_capacity(packed.len());
    for row in 0..rows {
        found.extend((0..columns).map(|column| whole[column * rows + row]));
    }
    found.extend(rest);
    found
}

/// Splits bytes into records; a record may span two blocks.
struct Splitter<'g> {
    group: &'g ChannelGroup,
    rest: Vec<u8>,
    /// How many records are still expected.
    left: u64,
}

impl Splitter<'_> {
    fn add(&mut self, part: &[u8], take: &mut dyn FnMut(&[u8])) -> Outcome<()> {
        self.rest.extend_from_slice(part);
        let (mut at, own) = (0, self.group.record_id);
        while self.left > 0 {
            let Some((id, head)) = self.record_id(at) else { break };
            let length = self.group.lengths.iter().find(|(known, _)| head == 0 || *known == id);
            let Some(&(_, length)) = length else {
                return Err(format!("a record with the unknown number {id}"));
            };
            if length == 0 && head == 0 {
                return Err("records without a length".into());
            }
            let Some(record) = self.rest.get(at + head..at + head + length as usize) else { break };
            if head == 0 || id == own {
                take(record);
                self.left -= 1;
            }
            at += head + length as usize;
        }
        if self.left == 0 {
            self.rest.clear()
        } else {
            drop(self.rest.drain(..at))
        }
        Ok(())
    }

    /// The id of the record at an offset, and the length of the id in bytes.
    fn record_id(&self, at: usize) -> Option<(u64, usize)> {
        let length = self.group.record_id_bytes;
        let number = self.rest.get(at..at + length)?;
        (at < self.rest.len())
            .then(|| (number.iter().rev().fold(0, |id, &byte| id << 8 | u64::from(byte)), length))
    }
}
