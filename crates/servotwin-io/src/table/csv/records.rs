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
                            if end_plain(&mut self.bytes, &mut self.ends) {
                                self.reader.consume(place);
                                return Ok(true);
                            }
                            self.line = self.next_line;
                            state = State::Begin;
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
                        _ => return Err(text_after_quote(self.next_line)),
                    },
                }
            }
            self.reader.consume(length);
        }
    }

    fn end_of_file(&mut self, state: State) -> Result<bool, Stop> {
        match state {
            State::Quoted(line) => {
                Err(ContentError::line(line, ": a quote is opened and never closed").into())
            }
            State::ClosedReturn => Err(text_after_quote(self.next_line)),
            State::Closed(_) => {
                self.ends.push((self.bytes.len(), true));
                Ok(true)
            }
            State::Begin | State::Plain => Ok(end_plain(&mut self.bytes, &mut self.ends)),
        }
    }
}

/// Ends the last cell of a record, which is not quoted; `false` if the record is a blank line.
fn end_plain(bytes: &mut Vec<u8>, ends: &mut Vec<(usize, bool)>) -> bool {
    let cell = ends.last().map_or(0, |(end, _)| *end);
    while bytes.len() > cell && bytes.last() == Some(&b'\r') {
        bytes.pop();
    }
    let is_blank = ends.is_empty() && bytes.is_empty();
    if !is_blank {
        ends.push((bytes.len(), false));
    }
    !is_blank
}

fn text_after_quote(line: usize) -> Stop {
    ContentError::line(line, ": a separator is needed after the closing quote").into()
}
