//! Reads a text file (CSV or JSON lines) line by line. Only one line is in memory, whatever the file's size.

use super::frame::{self, Frames};
use super::survey::{self, LogColumn, Objects, Sheet};
use super::{LogRow, Read, Source, SourceError, Wanted};
use crate::counts::Irregularity;
use servotwin_io::files::FileError;
use servotwin_io::sanitize;
use servotwin_io::table::csv::encoding;
use std::io::{self, BufRead};
use std::path::{Path, PathBuf};

/// The longest line that is read, bytes; a longer one is dropped.
const LONGEST: usize = 1 << 20;

/// The header is expected within this many first lines.
const PREAMBLE: usize = 100;

/// This many first lines are examined for units, dates and first numbers.
const BEGINNING: usize = 400;

/// An open text file with its parser.
pub(crate) struct Lines {
    path: PathBuf,
    reader: Box<dyn BufRead + Send>,
    frames: Frames,
    line: Vec<u8>,
    place: u64,
    read: u64,
    size: u64,
}

/// Opens a file that must have the wanted columns.
pub(super) fn open(path: &Path, wanted: &Wanted) -> Result<Box<dyn Source>, SourceError> {
    require(path, text_of(path)?, wanted)?;
    Ok(Box::new(Lines {
        path: path.into(),
        reader: text_of(path)?,
        frames: Frames::new(wanted),
        line: vec![],
        place: 0,
        read: 0,
        size: std::fs::metadata(path).map_or(0, |data| data.len()),
    }))
}

impl Source for Lines {
    fn read(&mut self, row: &mut LogRow) -> Result<Read, SourceError> {
        let found = next_line(&mut *self.reader, &mut self.line)
            .map_err(|cause| FileError::from_io(&self.path, cause))?;
        self.place += 1;
        self.read += self.line.len() as u64 + 1;
        row.place = self.place;
        Ok(match found {
            Line::None => Read::End,
            Line::TooLong => Read::Flawed(Irregularity::TooLong.into()),
            // The last line of a file may lack a line end.
            Line::Whole | Line::Unended => self.frames.read(&self.line, row),
        })
    }

    fn counted(&self) -> &'static str {
        "line"
    }

    fn zone_s(&self) -> Option<f64> {
        self.frames.zone_s()
    }

    fn share(&self) -> Option<f64> {
        (self.size > 0).then(|| (self.read as f64 / self.size as f64).min(1.0))
    }
}

/// Checks that a file has the wanted columns, unless the map names them.
fn require(
    path: &Path,
    reader: Box<dyn BufRead + Send>,
    wanted: &Wanted,
) -> Result<(), SourceError> {
    if !wanted.columns.is_empty() {
        return Ok(());
    }
    let address = path.display().to_string();
    let lines = first_lines(path, reader, BEGINNING)?;
    let heads = &lines[..lines.len().min(PREAMBLE)];
    if heads.iter().any(|line| frame::object(line).is_some()) {
        let known = objects(path, &|found| found.has_all(wanted))?;
        let known: Vec<String> = known.into_iter().map(|column| column.name).collect();
        return wanted.require(&address, &known);
    }
    let names = heads.iter().filter_map(|line| frame::marked_columns(line));
    if names.into_iter().any(|names| wanted.require(&address, &names).is_ok()) {
        return Ok(());
    }
    let known = find_header(&lines).map(|line| frame::header(&lines[line]).1);
    let lacking = known.and_then(|names| wanted.require(&address, &names).err());
    Err(lacking.unwrap_or_else(|| no_header(address, &lines)))
}

/// The columns of a file. A line of units may follow the header of cells. For objects, the keys of all lines are
/// gathered.
pub(crate) fn columns(path: &Path) -> Result<Vec<LogColumn>, SourceError> {
    let lines = first_lines(path, text_of(path)?, BEGINNING)?;
    let heads = &lines[..lines.len().min(PREAMBLE)];
    let none = || no_header(path.display().to_string(), &lines);
    if heads.iter().any(|line| frame::object(line).is_some()) {
        let found = objects(path, &|_| false)?;
        return if found.is_empty() { Err(none()) } else { Ok(found) };
    }
    let header = find_header(&lines).ok_or_else(none)?;
    let (separator, names) = frame::header(&lines[header]);
    let mut sheet = Sheet::new(names, separator);
    for line in &lines[header + 1..] {
        let line = frame::behind_mark(line).unwrap_or(line);
        sheet.add(&frame::texts(line, separator));
    }
    Ok(sheet.finish())
}

/// The line with the names of columns: of those with a row of as many numbers below, the first with the most names, or
/// else the last of them behind `#`. Without such a row it is the first line with the most names.
fn find_header(lines: &[Vec<u8>]) -> Option<usize> {
    let heads = 0..lines.len().min(PREAMBLE);
    let filled = |names: Vec<String>| names.iter().filter(|name| !name.is_empty()).count();
    let count = |line: &usize| frame::marked_columns(&lines[*line]).map_or(0, filled);
    let is_marked = |line: &usize| frame::behind_mark(&lines[*line]).is_some();
    let has_rows = |line: &usize| {
        let (separator, names) = frame::header(&lines[*line]);
        let is_units = is_marked(line) && survey::is_units(&names);
        let mut sheet = Sheet::new(names, separator);
        let below = lines[line + 1..].iter().filter(|line| frame::behind_mark(line).is_none());
        !is_units && below.into_iter().any(|line| sheet.is_row(&frame::texts(line, separator)))
    };
    let named: Vec<usize> = heads.filter(|line| count(line) > 0).collect();
    // `rev` makes the first of equally long lines win.
    let first = |has_rows: &dyn Fn(&usize) -> bool| {
        let fits = |line: &&usize| !is_marked(line) && has_rows(line);
        named.iter().rev().filter(fits).max_by_key(|line| count(line)).copied()
    };
    let last = || named.iter().rev().find(|line| is_marked(line) && has_rows(line)).copied();
    // Any sentence is words between blanks.
    let is_list = |line: &usize| frame::header(&lines[*line]).0 != b' ';
    first(&has_rows).or_else(last).or_else(|| first(&is_list))
}

/// The error for a text without columns, with what was seen instead.
pub(super) fn no_header(address: String, lines: &[Vec<u8>]) -> SourceError {
    let is_filled = |line: &&(usize, &Vec<u8>)| !line.1.trim_ascii().is_empty();
    let lines: Vec<(usize, &Vec<u8>)> = lines.iter().enumerate().collect();
    let (place, line) = lines.iter().find(is_filled).map_or((0, &[][..]), |(n, line)| (*n, line));
    let text = String::from_utf8_lossy(&line[..line.len().min(80)]);
    let advice = match line.trim_ascii().first() {
        Some(b'[' | b'{') => "JSON needs one object a line",
        Some(b'0'..=b'9' | b'-' | b'+' | b'.' | b'"') => {
            "if the log has no names, columns below [samples] of a map file gives them"
        }
        _ => "a header has names between commas, semicolons, tabs or blanks",
    };
    let seen = format!("line {} is '{}'; {advice}", place + 1, sanitize::text(text.trim()));
    SourceError::NoHeader { address, seen }
}

/// The columns of the objects in a file, read until there are `enough`.
fn objects(path: &Path, enough: &dyn Fn(&Objects) -> bool) -> Result<Vec<LogColumn>, SourceError> {
    let (mut reader, mut line, mut found) = (text_of(path)?, vec![], Objects::default());
    loop {
        let next = next_line(&mut *reader, &mut line);
        match next.map_err(|cause| FileError::from_io(path, cause))? {
            Line::None => break,
            Line::TooLong => {}
            Line::Whole | Line::Unended => {
                if let Some(object) = frame::object(&line) {
                    found.add("", object);
                }
                if enough(&found) {
                    break;
                }
            }
        }
    }
    Ok(found.finish())
}

fn text_of(path: &Path) -> Result<Box<dyn BufRead + Send>, SourceError> {
    Ok(encoding::open(path)?.0)
}

/// The first `count` lines of a file; an error if they are empty.
fn first_lines(
    path: &Path,
    mut reader: Box<dyn BufRead + Send>,
    count: usize,
) -> Result<Vec<Vec<u8>>, SourceError> {
    let (mut line, mut found, mut too_long) = (vec![], vec![], None);
    for place in 1..=count {
        let next = next_line(&mut *reader, &mut line);
        match next.map_err(|cause| FileError::from_io(path, cause))? {
            Line::None => break,
            Line::TooLong => _ = too_long.get_or_insert(place),
            Line::Whole | Line::Unended => found.push(line.clone()),
        }
    }
    if found.iter().all(|line| line.trim_ascii().is_empty()) {
        let address = path.display().to_string();
        return Err(match too_long {
            Some(place) => {
                let seen = format!("line {place} is longer than {} MiB", LONGEST >> 20);
                SourceError::NoHeader { address, seen }
            }
            None => SourceError::Empty { address },
        });
    }
    Ok(found)
}

/// The result of reading a line into a buffer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Line {
    /// A line, without its line end.
    Whole,
    /// A line without a line end: the stream ended in it.
    Unended,
    /// Nothing: the line was too long.
    TooLong,
    /// Nothing: the stream has ended.
    None,
}

/// Reads a line, which ends with LF, CR LF or CR.
pub(crate) fn next_line(reader: &mut dyn BufRead, line: &mut Vec<u8>) -> io::Result<Line> {
    line.clear();
    let (mut any, mut too_long) = (false, false);
    loop {
        let buffer = match reader.fill_buf() {
            Ok(buffer) => buffer,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        };
        if buffer.is_empty() {
            return Ok(match (any, too_long) {
                (false, _) => Line::None,
                (true, true) => Line::TooLong,
                (true, false) => Line::Unended,
            });
        }
        any = true;
        let end = buffer.iter().position(|byte| matches!(byte, b'\n' | b'\r'));
        let is_return = end.is_some_and(|end| buffer[end] == b'\r');
        let part = &buffer[..end.unwrap_or(buffer.len())];
        too_long |= line.len() + part.len() > LONGEST;
        if too_long {
            line.clear();
        } else {
            line.extend_from_slice(part);
        }
        let length = part.len() + usize::from(end.is_some());
        reader.consume(length);
        if end.is_some() {
            if is_return && reader.fill_buf().is_ok_and(|next| next.first() == Some(&b'\n')) {
                reader.consume(1);
            }
            return Ok(if too_long { Line::TooLong } else { Line::Whole });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_and_are_not_too_long() {
        let text = format!("a\r\n\r{}\nb", "x".repeat(LONGEST + 1));
        // Lines are longer than this buffer.
        let mut reader = io::BufReader::with_capacity(1000, text.as_bytes());
        let (mut line, mut found) = (vec![], vec![]);
        for _ in 0..5 {
            let kind = next_line(&mut reader, &mut line).unwrap();
            found.push((kind, String::from_utf8(line.clone()).unwrap()));
        }
        let expected = [
            (Line::Whole, "a"),
            (Line::Whole, ""),
            (Line::TooLong, ""),
            (Line::Unended, "b"),
            (Line::None, ""),
        ];
        assert_eq!(found, expected.map(|(kind, text)| (kind, text.to_owned())));
    }
}
