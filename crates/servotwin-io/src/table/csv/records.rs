//! Lines of a text, and the cells of a line: the one splitter of tables and of logs.

use super::super::ContentError;
use super::{Stop, encoding};
use std::borrow::Cow;
use std::io::{self, BufRead};
use std::ops::Range;

/// The result of reading a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Line {
    /// A line with its end.
    Whole,
    /// A line without an end: the stream ended in it.
    Unended,
    /// Nothing: the line was too long.
    TooLong,
    /// Nothing: the stream has ended.
    None,
}

/// Appends a line with its end (LF, CR LF or CR) to `text`, unless it has more than `limit` bytes.
///
/// # Errors
/// The stream cannot be read.
pub fn next_line(reader: &mut dyn BufRead, text: &mut Vec<u8>, limit: usize) -> io::Result<Line> {
    let begin = text.len();
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
        let part = &buffer[..end.map_or(buffer.len(), |end| end + 1)];
        text.extend_from_slice(part);
        let (length, is_return) = (part.len(), part.ends_with(b"\r"));
        reader.consume(length);
        if is_return && reader.fill_buf().is_ok_and(|next| next.first() == Some(&b'\n')) {
            text.push(b'\n');
            reader.consume(1);
        }
        too_long |= text.len() - begin > limit;
        if too_long {
            text.truncate(begin);
        }
        if end.is_some() {
            return Ok(if too_long { Line::TooLong } else { Line::Whole });
        }
    }
}

/// A line without its end.
fn without_end(mut line: &[u8]) -> &[u8] {
    while let [rest @ .., b'\n' | b'\r'] = line {
        line = rest;
    }
    line
}

/// A cell of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cell<'l> {
    /// Its bytes, without the quotes around them.
    pub bytes: &'l [u8],
    /// Whether it is quoted: then two quotes in it stand for one.
    pub is_quoted: bool,
}

impl<'l> Cell<'l> {
    /// Its text.
    pub fn text(self) -> Cow<'l, str> {
        match encoding::text(self.bytes) {
            text if self.is_quoted && text.contains('"') => text.replace("\"\"", "\"").into(),
            text => text,
        }
    }
}

/// What is wrong with a quote at the beginning of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum QuoteMistake {
    /// It is not closed.
    Open,
    /// Text follows the quote that closes it.
    Text,
}

/// Where a cell stands in a line, and whether it is quoted.
type CellRange = (Range<usize>, bool);

/// The cells of a line. Blanks before a quote do not count, nor do those between cells that blanks separate. A cell whose
/// quote is not closed, or not at its end, is taken as it stands.
#[derive(Debug, Clone)]
pub struct Cells<'l> {
    line: &'l [u8],
    separator: u8,
    /// The beginning of the next cell.
    at: Option<usize>,
    /// Before this place, no quote closes the next cell.
    searched: usize,
}

impl<'l> Cells<'l> {
    /// The cells of a line, with or without its end.
    pub fn new(line: &'l [u8], separator: u8) -> Self {
        let line = without_end(line);
        let line = if separator == b' ' { line.trim_ascii() } else { line };
        Cells { line, separator, at: Some(0), searched: 0 }
    }

    fn advance(&mut self) -> Option<(CellRange, Option<QuoteMistake>)> {
        let at = self.at?;
        let blanks = self.line[at..].iter().take_while(|byte| **byte == b' ').count();
        let is_quote = self.line[at + blanks..].starts_with(b"\"");
        let begin = if is_quote || self.separator == b' ' { at + blanks } else { at };
        let closing = is_quote.then(|| self.closing_quote(self.searched.max(begin + 1)));
        if let Some(Ok(quote)) = closing {
            self.at = (quote + 1 < self.line.len()).then_some(quote + 2);
            return Some(((begin + 1..quote, true), None));
        }
        let end = self.line[begin..].iter().position(|byte| *byte == self.separator);
        self.at = end.map(|end| begin + end + 1);
        let range = begin..end.map_or(self.line.len(), |end| begin + end);
        Some(((range, false), closing.and_then(Result::err)))
    }

    fn closing_quote(&self, mut from: usize) -> Result<usize, QuoteMistake> {
        while let Some(found) = self.line[from..].iter().position(|byte| *byte == b'"') {
            let quote = from + found;
            match self.line.get(quote + 1) {
                Some(b'"') => from = quote + 2,
                Some(next) if *next != self.separator => return Err(QuoteMistake::Text),
                _ => return Ok(quote),
            }
        }
        Err(QuoteMistake::Open)
    }
}

impl<'l> Iterator for Cells<'l> {
    type Item = Cell<'l>;

    fn next(&mut self) -> Option<Cell<'l>> {
        let ((range, is_quoted), _) = self.advance()?;
        Some(Cell { bytes: &self.line[range], is_quoted })
    }
}

/// The records of a table: lines, which go on as long as a quote is open.
pub(super) struct Records<R> {
    reader: R,
    separator: u8,
    text: Vec<u8>,
    cells: Vec<CellRange>,
    /// The line on which the record begins, from 1.
    line: usize,
    /// How many lines were read.
    lines: usize,
}

impl<R: BufRead> Records<R> {
    /// Reads the records of a reader.
    pub(super) fn new(reader: R, separator: u8) -> Self {
        Records { reader, separator, text: vec![], cells: vec![], line: 0, lines: 0 }
    }

    /// The line on which the current record begins.
    pub(super) fn line(&self) -> usize {
        self.line
    }

    /// The cells of the current record.
    pub(super) fn cells(&self) -> impl ExactSizeIterator<Item = Cell<'_>> {
        let cell = |(range, is_quoted): &CellRange| Cell {
            bytes: &self.text[range.clone()],
            is_quoted: *is_quoted,
        };
        self.cells.iter().map(cell)
    }

    /// Reads the next record; `false` at the end. Blank lines are skipped: an empty text would be quoted.
    pub(super) fn advance(&mut self) -> Result<bool, Stop> {
        self.text.clear();
        self.cells.clear();
        while without_end(&self.text).is_empty() {
            self.text.clear();
            if !self.add_line()? {
                return Ok(false);
            }
        }
        self.line = self.lines;
        let (mut at, mut searched, mut opened) = (0, 0, self.lines);
        loop {
            let mut cells =
                Cells { at: Some(at), searched, ..Cells::new(&self.text, self.separator) };
            let open = loop {
                let begin = cells.at;
                match cells.advance() {
                    None => return Ok(true),
                    Some((cell, None)) => self.cells.push(cell),
                    Some((_, Some(QuoteMistake::Open))) => break begin.unwrap_or(at),
                    Some((_, Some(QuoteMistake::Text))) => {
                        let what = ": a separator is needed after the closing quote";
                        return Err(ContentError::line(self.lines, what).into());
                    }
                }
            };
            if open > at || searched == 0 {
                opened = self.lines;
            }
            (at, searched) = (open, cells.line.len());
            if !self.add_line()? {
                let what = ": a quote is opened and never closed";
                return Err(ContentError::line(opened, what).into());
            }
        }
    }

    /// Appends a line to the record; `false` at the end.
    fn add_line(&mut self) -> io::Result<bool> {
        self.lines += 1;
        Ok(next_line(&mut self.reader, &mut self.text, usize::MAX)? != Line::None)
    }
}
