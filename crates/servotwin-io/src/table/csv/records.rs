//! Splits text into records of cells, one after another, in a reused buffer.

use super::super::ContentError;
use super::Stop;
use std::io::BufRead;

/// The records of a text.
pub(crate) struct Records<R> {
    reader: R,
    separator: u8,
    /// The bytes of all cells of the record, without quotes.
    bytes: Vec<u8>,
    /// End of each cell in `bytes`, and whether it was quoted.
    ends: Vec<(usize, bool)>,
    /// The line on which the record begins, from 1.
    line: usize,
    /// The line being read.
    next_line: usize,
}

/// Position of the reader in a cell.
#[derive(Clone, Copy, PartialEq)]
enum State {
    /// Before the first byte.
    Begin,
    /// In an unquoted cell.
    Plain,
    /// Inside quotes that were opened on this line.
    Quoted(usize),
    /// After a quote that closes the cell, or is the first of a doubled quote.
    Closed(usize),
    /// After a closed cell and a carriage return.
    ClosedReturn,
}

impl<R: BufRead> Records<R> {
    /// Reads the records of a reader.
    pub(crate) fn new(reader: R, separator: u8) -> Self {
        Records { reader, separator, bytes: vec![], ends: vec![], line: 1, next_line: 1 }
    }

    /// The line on which the current record begins.
    pub(crate) fn line(&self) -> usize {
        self.line
    }

    /// The cells of the current record, and whether each was quoted.
    pub(crate) fn cells(&self) -> impl Iterator<Item = (&[u8], bool)> {
        let starts = std::iter::once(0).chain(self.ends.iter().map(|(end, _)| *end));
        starts.zip(&self.ends).map(|(start, &(end, quoted))| (&self.bytes[start..end], quoted))
    }

    /// Reads the next record; `false` at the end. Blank lines are skipped: an empty text would be quoted.
    pub(crate) fn advance(&mut self) -> Result<bool, Stop> {
        self.bytes.clear();
        self.ends.clear();
        self.line = self.next_line;
        let mut state = State::Begin;
        loop {
            let buffer = self.reader.fill_buf()?;
            if buffer.is_empty() {
                return self.end_of_file(state);
            }
            let length = buffer.len();
            let mut place = 0;
            while place < length {
                let byte = buffer[place];
                place += 1;
                match state {
                    State::Begin | State::Plain => {
                        if byte == self.separator {
                            self.ends.push((self.bytes.len(), false));
                            state = State::Begin;
                        } else if byte == b'\n' {
                            self.next_line += 1;
                            let cell = self.ends.last().map_or(0, |(end, _)| *end);
                            while self.bytes.len() > cell && self.bytes.last() == Some(&b'\r') {
                                self.bytes.pop();
                            }
                            if self.ends.is_empty() && self.bytes.is_empty() {
                                self.line = self.next_line;
                                state = State::Begin;
                                continue;
                            }
                            self.ends.push((self.bytes.len(), false));
                            self.reader.consume(place);
                            return Ok(true);
                        } else if byte == b'"' && state == State::Begin {
                            state = State::Quoted(self.next_line);
                        } else {
                            self.bytes.push(byte);
                            state = State::Plain;
                        }
                    }
                    State::Quoted(opened) => match byte {
                        b'"' => state = State::Closed(opened),
                        _ => {
                            self.next_line += usize::from(byte == b'\n');
                            self.bytes.push(byte);
                        }
                    },
                    State::Closed(_) | State::ClosedReturn => match (byte, state) {
                        (b'"', State::Closed(opened)) => {
                            self.bytes.push(b'"');
                            state = State::Quoted(opened);
                        }
                        (b'\n', _) => {
                            self.next_line += 1;
                            self.ends.push((self.bytes.len(), true));
                            self.reader.consume(place);
                            return Ok(true);
                        }
                        (b'\r', State::Closed(_)) => state = State::ClosedReturn,
                        (byte, State::Closed(_)) if byte == self.separator => {
                            self.ends.push((self.bytes.len(), true));
                            state = State::Begin;
                        }
                        _ => {
                            let line = self.next_line;
                            return Err(ContentError::TextAfterQuote { line }.into());
                        }
                    },
                }
            }
            self.reader.consume(length);
        }
    }

    fn end_of_file(&mut self, state: State) -> Result<bool, Stop> {
        match state {
            State::Quoted(line) => return Err(ContentError::OpenQuote { line }.into()),
            State::ClosedReturn => {
                return Err(ContentError::TextAfterQuote { line: self.next_line }.into());
            }
            State::Begin if self.ends.is_empty() => return Ok(false),
            State::Closed(_) => self.ends.push((self.bytes.len(), true)),
            State::Begin | State::Plain => {
                let cell = self.ends.last().map_or(0, |(end, _)| *end);
                while self.bytes.len() > cell && self.bytes.last() == Some(&b'\r') {
                    self.bytes.pop();
                }
                if self.ends.is_empty() && self.bytes.is_empty() {
                    return Ok(false);
                }
                self.ends.push((self.bytes.len(), false));
            }
        }
        Ok(true)
    }
}
