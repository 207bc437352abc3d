//! Reads lines of standard input on a separate thread, so that a quiet stream does not block the watch.

use super::frame::{self, Flaw, Frames};
use super::lines::{Line, next_line, no_header};
use super::{LogRow, PAUSE, Read, Source, SourceError, Wanted};
use std::io::{self, BufRead, BufReader};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};

/// The most lines that wait to be processed; beyond that, the writer waits.
const WAITING: usize = 4096;

/// A stream of lines.
pub(crate) struct Stdin {
    lines: Receiver<io::Result<(Line, Vec<u8>)>>,
    frames: Frames,
    place: u64,
}

impl Stdin {
    /// Starts the reading thread.
    pub(crate) fn new(stream: impl io::Read + Send + 'static, wanted: &Wanted) -> Self {
        let (send, lines) = sync_channel(WAITING);
        std::thread::spawn(move || {
            let mut reader = BufReader::new(stream);
            loop {
                let mut line = vec![];
                let found = next_line(&mut reader, &mut line).map(|found| (found, line));
                let last = !matches!(found, Ok((Line::Whole | Line::TooLong, _)));
                // A closed receiver needs no more lines.
                if send.send(found).is_err() || last {
                    break;
                }
            }
        });
        Stdin { lines, frames: Frames::new(wanted), place: 0 }
    }
}

impl Source for Stdin {
    fn read(&mut self, row: &mut LogRow) -> Result<Read, SourceError> {
        let received = match self.lines.recv_timeout(PAUSE) {
            Ok(received) => received,
            Err(RecvTimeoutError::Timeout) => return Ok(Read::Pause),
            Err(RecvTimeoutError::Disconnected) => return Ok(Read::End),
        };
        self.place += 1;
        row.place = self.place;
        let (found, line) = received.map_err(|cause| failed(&cause))?;
        Ok(match found {
            Line::None => Read::End,
            Line::TooLong => Read::Flawed(Flaw::TooLong),
            // The writer may have died in the middle of a number.
            Line::Unended => Read::Flawed(Flaw::CutShort),
            Line::Whole => self.frames.read(&line, row),
        })
    }

    fn counted(&self) -> &'static str {
        "line"
    }

    fn is_live(&self) -> bool {
        true
    }

    fn zone_s(&self) -> Option<f64> {
        self.frames.zone_s()
    }
}

/// The columns of the first line that names any.
pub(crate) fn columns(mut stream: impl BufRead) -> Result<Vec<String>, SourceError> {
    let (mut line, mut first, mut marked) = (vec![], vec![], None);
    loop {
        if next_line(&mut stream, &mut line).map_err(|cause| failed(&cause))? == Line::None {
            return Err(no_header("standard input".into(), &first));
        }
        // Names behind a mark are those of the row of numbers below them.
        if frame::behind_mark(&line).is_some() {
            marked = frame::marked_columns(&line);
        } else if let Some(names) = frame::columns(&line).or(marked.take_if(|_| !line.is_empty())) {
            return Ok(names);
        }
        if first.is_empty() && !line.is_empty() {
            first.push(line.clone());
        }
    }
}

fn failed(cause: &io::Error) -> SourceError {
    SourceError::Connection { address: "standard input".into(), cause: cause.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_that_ends_within_a_line() {
        let names = ["t", "p"].map(String::from).to_vec();
        let wanted = Wanted { names, time: Some(0), ..Wanted::default() };
        let mut source = Stdin::new(&b"t,p\n1,2\n\n3,4"[..], &wanted);
        let mut row = LogRow::default();
        let mut found = vec![];
        while found.last() != Some(&Read::End) {
            found.push(source.read(&mut row).unwrap());
        }
        let cut = Read::Flawed(Flaw::CutShort);
        assert_eq!(found, [Read::Nothing, Read::Row, Read::Nothing, cut, Read::End]);
        assert_eq!((row.place, &*row.values), (4, &[1.0, 2.0][..]));
    }
}
