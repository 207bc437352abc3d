//! Reads a text file (CSV or JSON lines) line by line. Only one line is in memory, whatever the file's size.

use super::frame::{self, Flaw, Frames};
use super::survey::{LogColumn, Objects, Sheet};
use super::{LogRow, Read, Source, SourceError, Wanted};
use servotwin_io::files::FileError;
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
pub struct Lines {
    path: PathBuf,
    reader: Box<dyn BufRead + Send>,
    frames: Frames,
    line: Vec<u8>,
    place: u64,
    read: u64,
    size: u64,
}

impl Lines {
    /// Opens a file that must have the wanted columns.
    pub fn open(path: &Path, wanted: &Wanted) -> Result<Self, SourceError> {
        require(path, open(path)?, wanted)?;
        let size = std::fs::metadata(path).map_or(0, |data| data.len());
        Ok(Lines {
            path: path.into(),
            reader: open(path)?,
            frames: Frames::new(wanted),
            line: vec![],
            place: 0,
            read: 0,
            size,
        })
    }
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
            Line::TooLong => Read::Flawed(Flaw::TooLong),
            // The last line of a file may lack a line end.
            Line::Whole | Line::Unended => self.frames.read(&self.line, row),
        })
    }

    fn counted(&self) -> &'static str {
        "line"
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
    let lines = first_lines(path, reader, PREAMBLE)?;
    if lines.iter().any(|line| frame::is_object(line)) {
        let known = objects(path, &|found| found.has_all(wanted))?;
        let known: Vec<String> = known.into_iter().map(|column| column.name).collect();
        return SourceError::lacking(&address, wanted, &known).map_or(Ok(()), Err);
    }
    let mut best: Option<Vec<String>> = None;
    for names in lines.iter().filter_map(|line| frame::columns(line)) {
        match SourceError::lacking(&address, wanted, &names) {
            None => return Ok(()),
            // Keep the longest list of names: it is most likely the header.
            Some(_) if best.as_ref().is_none_or(|best| best.len() < names.len()) => {
                best = Some(names);
            }
            Some(_) => {}
        }
    }
    let lacking = best.and_then(|names| SourceError::lacking(&address, wanted, &names));
    Err(lacking.unwrap_or(SourceError::NoHeader { address }))
}

/// The columns of a file. For cells, the header is the first line with the most names; a line of units may follow it.
/// For objects, the keys of all lines are gathered.
pub fn columns(path: &Path) -> Result<Vec<LogColumn>, SourceError> {
    let lines = first_lines(path, open(path)?, BEGINNING)?;
    let heads = &lines[..lines.len().min(PREAMBLE)];
    let none = || SourceError::NoHeader { address: path.display().to_string() };
    if heads.iter().any(|line| frame::is_object(line)) {
        let found = objects(path, &|_| false)?;
        return if found.is_empty() { Err(none()) } else { Ok(found) };
    }
    let count = |line: usize| frame::columns(&heads[line]).map_or(0, |names| names.len());
    // `rev` makes the first of equally long lines win.
    let best = (0..heads.len()).rev().max_by_key(|&line| count(line));
    let best = best.filter(|&line| count(line) > 0).ok_or_else(none)?;
    let (separator, names) = frame::header(&lines[best]);
    let mut sheet = Sheet::new(names, separator);
    for line in &lines[best + 1..] {
        sheet.add(&frame::names(line, separator));
    }
    Ok(sheet.finish())
}

/// The columns of the objects in a file, read until there are `enough`.
fn objects(path: &Path, enough: &dyn Fn(&Objects) -> bool) -> Result<Vec<LogColumn>, SourceError> {
    let (mut reader, mut line, mut found) = (open(path)?, vec![], Objects::default());
    loop {
        let next = next_line(&mut *reader, &mut line);
        match next.map_err(|cause| FileError::from_io(path, cause))? {
            Line::None => break,
            Line::TooLong => {}
            Line::Whole | Line::Unended if frame::is_object(&line) => {
                found.add("", line.trim_ascii());
                if enough(&found) {
                    break;
                }
            }
            Line::Whole | Line::Unended => {}
        }
    }
    Ok(found.finish())
}

fn open(path: &Path) -> Result<Box<dyn BufRead + Send>, SourceError> {
    Ok(encoding::open(path)?.0)
}

/// The first `count` lines of a file; an error if they are empty.
fn first_lines(
    path: &Path,
    mut reader: Box<dyn BufRead + Send>,
    count: usize,
) -> Result<Vec<Vec<u8>>, SourceError> {
    let (mut line, mut found) = (vec![], vec![]);
    for _ in 0..count {
        let next = next_line(&mut *reader, &mut line);
        match next.map_err(|cause| FileError::from_io(path, cause))? {
            Line::None => break,
            Line::TooLong => {}
            Line::Whole | Line::Unended => found.push(line.clone()),
        }
    }
    if found.iter().all(|line| line.trim_ascii().is_empty()) {
        return Err(SourceError::Empty { address: path.display().to_string() });
    }
    Ok(found)
}

/// The result of reading a line into a buffer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Line {
    /// A line, without its line end.
    Whole,
    /// A line without a line end: the stream ended in it.
    Unended,
    /// Nothing: the line was too long.
    TooLong,
    /// Nothing: the stream has ended.
    None,
}

/// Reads a line.
pub fn next_line(reader: &mut dyn BufRead, line: &mut Vec<u8>) -> io::Result<Line> {
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
        let end = buffer.iter().position(|&byte| byte == b'\n');
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
            return Ok(if too_long { Line::TooLong } else { Line::Whole });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_and_are_not_too_long() {
        let text = format!("a\n\n{}\nb", "x".repeat(LONGEST + 1));
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
