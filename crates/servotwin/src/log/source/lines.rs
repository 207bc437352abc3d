//! A text file line by line: CSV, or lines of JSON objects. However large, one line of it is in memory.

use super::frame::{self, Flaw, Frames};
use super::{DATE, Read, Row, Source, SourceError, Wanted};
use crate::files::FileError;
use crate::table::csv::encoding;
use std::io::{self, BufRead};
use std::path::{Path, PathBuf};

/// The longest line that is read; of a longer one nothing is kept.
const LONGEST: usize = 1 << 20;

/// The header of a file stands in one of its first lines.
const PREAMBLE: usize = 100;

/// A text file.
pub struct Lines {
    path: PathBuf,
    reader: Box<dyn BufRead>,
    frames: Frames,
    line: Vec<u8>,
    place: u64,
    read: u64,
    size: u64,
}

impl Lines {
    /// Opens a file that must have some columns.
    pub fn open(path: &Path, wanted: &Wanted) -> Result<Self, SourceError> {
        let open = || encoding::open(path).map_err(|cause| FileError::from_io(path, cause));
        require(path, open()?.0, wanted)?;
        let size = std::fs::metadata(path).map_or(0, |data| data.len());
        Ok(Lines {
            path: path.into(),
            reader: open()?.0,
            frames: Frames::new(wanted),
            line: vec![],
            place: 0,
            read: 0,
            size,
        })
    }
}

impl Source for Lines {
    fn read(&mut self, row: &mut Row) -> Result<Read, SourceError> {
        let found = next_line(&mut *self.reader, &mut self.line)
            .map_err(|cause| FileError::from_io(&self.path, cause))?;
        self.place += 1;
        self.read += self.line.len() as u64 + 1;
        row.place = self.place;
        Ok(match found {
            Line::None => Read::End,
            Line::TooLong => Read::Flawed(Flaw::TooLong),
            // The last line of a file may do without an end.
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

/// That a file has the wanted columns, where it has a header at all.
fn require(path: &Path, reader: Box<dyn BufRead>, wanted: &Wanted) -> Result<(), SourceError> {
    if !wanted.columns.is_empty() {
        return Ok(());
    }
    let address = path.display().to_string();
    let mut best: Option<Vec<String>> = None;
    for names in headers(path, reader)? {
        match SourceError::lacking(&address, wanted, &names) {
            None => return Ok(()),
            // The line that looks most like it.
            Some(_) if best.as_ref().is_none_or(|best| best.len() < names.len()) => {
                best = Some(names);
            }
            Some(_) => {}
        }
    }
    let lacking = best.and_then(|names| SourceError::lacking(&address, wanted, &names));
    Err(lacking.unwrap_or(SourceError::NoHeader { address }))
}

/// The columns of a file: of its first lines the one with most names. Where dates stand below a name, that is its unit.
pub fn columns(path: &Path) -> Result<Vec<(String, String)>, SourceError> {
    let reader = encoding::open(path).map_err(|cause| FileError::from_io(path, cause))?.0;
    let lines = first_lines(path, reader)?;
    let headers = lines.iter().map(|line| frame::columns(line).unwrap_or_default());
    let headers: Vec<Vec<String>> = headers.collect();
    // Of equally long ones the first.
    let best = (0..headers.len()).rev().max_by_key(|&line| headers[line].len());
    let best = best.filter(|&line| !headers[line].is_empty());
    let Some(best) = best else {
        return Err(SourceError::NoHeader { address: path.display().to_string() });
    };
    let names = &headers[best];
    // An object has its values beside their names.
    let first = if frame::is_object(&lines[best]) { best } else { best + 1 };
    let below = lines[first..].iter().map(|line| frame::dates(line));
    let dates = below.into_iter().find(|dates| dates.len() == names.len()).unwrap_or_default();
    let unit = |place: usize| if dates.get(place) == Some(&true) { DATE } else { "" };
    let named = names.iter().enumerate();
    Ok(named.map(|(place, name)| (name.clone(), unit(place).to_owned())).collect())
}

/// What names columns in the first lines of a file.
fn headers(path: &Path, reader: Box<dyn BufRead>) -> Result<Vec<Vec<String>>, SourceError> {
    Ok(first_lines(path, reader)?.iter().filter_map(|line| frame::columns(line)).collect())
}

/// The first lines of a file, in one of which its header stands.
fn first_lines(path: &Path, mut reader: Box<dyn BufRead>) -> Result<Vec<Vec<u8>>, SourceError> {
    let (mut line, mut found) = (vec![], vec![]);
    for _ in 0..PREAMBLE {
        let next = next_line(&mut *reader, &mut line);
        match next.map_err(|cause| FileError::from_io(path, cause))? {
            Line::None => break,
            Line::TooLong => {}
            Line::Whole | Line::Unended => found.push(line.clone()),
        }
    }
    Ok(found)
}

/// What is in a buffer after reading a line into it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Line {
    /// A line; its end is left out.
    Whole,
    /// A line that the stream ended in.
    Unended,
    /// Nothing: it was too long.
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
        // A buffer that lines do not fit into.
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
