//! Reads a text file (CSV or JSON lines) line by line. Only one line is in memory, whatever the file's size.

use super::frame::{self, Frames};
use super::survey::{self, LogColumn, Objects, Sheet};
use super::{LogRow, Read, Source, SourceError, Wanted};
use crate::counts::Irregularity;
use servotwin_io::files::FileError;
use servotwin_io::sanitize;
use servotwin_io::table::csv::encoding;
use servotwin_io::table::csv::records::{self, Line};
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
    // A map may name the columns of a log without a header.
    if wanted.columns.is_empty() {
        wanted.require_columns(path, survey(path, Some(wanted))?)?;
    }
    Ok(Box::new(Lines {
        path: path.into(),
        reader: encoding::open(path)?.0,
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
        self.read += self.line.len() as u64;
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

/// The columns of a file. A line of units may follow the header of cells. For objects, the keys of all lines are
/// gathered.
pub(super) fn columns(path: &Path) -> Result<Vec<LogColumn>, SourceError> {
    survey(path, None)
}

/// The columns of a file; with `wanted` ones, objects are read until they have these, and the first line that has them is
/// the header.
fn survey(path: &Path, wanted: Option<&Wanted>) -> Result<Vec<LogColumn>, SourceError> {
    let lines = first_lines(path)?;
    let heads = &lines[..lines.len().min(PREAMBLE)];
    let has_all = |line: &Vec<u8>| {
        let names = frame::marked_columns(line);
        wanted.zip(names).is_some_and(|(wanted, names)| wanted.require("", names).is_ok())
    };
    let found = if heads.iter().any(|line| frame::object(line).is_some()) {
        objects(path, wanted)?
    } else if let Some(header) = heads.iter().position(has_all).or_else(|| find_header(&lines)) {
        let (separator, names) = frame::header(&lines[header]);
        let mut sheet = Sheet::new(names, separator);
        for line in &lines[header + 1..] {
            let line = frame::behind_mark(line).unwrap_or(line);
            sheet.add(&frame::texts(line, separator));
        }
        sheet.finish()
    } else {
        vec![]
    };
    match found.is_empty() {
        true => Err(no_header(path.display().to_string(), &lines)),
        false => Ok(found),
    }
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
        let mut below = lines[line + 1..].iter().filter(|line| frame::behind_mark(line).is_none());
        !is_units && below.any(|line| sheet.add(&frame::texts(line, separator)))
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

/// The columns of the objects in a file, read until it has the wanted ones.
fn objects(path: &Path, wanted: Option<&Wanted>) -> Result<Vec<LogColumn>, SourceError> {
    let (mut reader, mut line, mut found) = (encoding::open(path)?.0, vec![], Objects::default());
    let failed = |cause| FileError::from_io(path, cause);
    while next_line(&mut *reader, &mut line).map_err(failed)? != Line::None {
        frame::object(&line).iter().for_each(|object| found.add(object));
        if wanted.is_some_and(|wanted| found.has_all(wanted)) {
            break;
        }
    }
    Ok(found.finish())
}

/// Reads a line of at most [`LONGEST`] bytes.
pub(super) fn next_line(reader: &mut dyn BufRead, line: &mut Vec<u8>) -> io::Result<Line> {
    line.clear();
    records::next_line(reader, line, LONGEST)
}

/// The first lines of a file; an error if they are empty.
fn first_lines(path: &Path) -> Result<Vec<Vec<u8>>, SourceError> {
    let (mut reader, mut line, mut found) = (encoding::open(path)?.0, vec![], vec![]);
    let (failed, mut too_long) = (|cause| FileError::from_io(path, cause), None);
    for place in 1..=BEGINNING {
        match next_line(&mut *reader, &mut line).map_err(failed)? {
            Line::None => break,
            Line::TooLong => _ = too_long.get_or_insert(place),
            Line::Whole | Line::Unended => found.push(line.clone()),
        }
    }
    let address = path.display().to_string();
    let is_mdf = |line: &Vec<u8>| line.starts_with(b"MDF  ") || line.starts_with(b"UnFinMF ");
    let seen = match too_long {
        _ if found.first().is_some_and(is_mdf) => {
            "it is a recording in MDF, which asammdf writes as CSV".to_owned()
        }
        _ if found.iter().any(|line| !line.trim_ascii().is_empty()) => return Ok(found),
        Some(place) => format!("line {place} is longer than {} MiB", LONGEST >> 20),
        None => return Err(SourceError::Empty { address }),
    };
    Err(SourceError::NoHeader { address, seen })
}
