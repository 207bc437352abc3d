//! Reads lines of standard input on a separate thread, so that a quiet stream does not block the watch.

use super::frame::{self, Frames};
use super::lines::{next_line, no_header};
use super::live::{Live, News};
use super::{Read, Source, SourceError, Wanted};
use crate::counts::Irregularity;
use servotwin_io::table::csv::records::Line;
use std::io::{self, BufRead, BufReader};
use std::sync::mpsc::sync_channel;

/// The most lines that wait to be processed; beyond that, the writer waits.
const WAITING: usize = 4096;

/// The stream in messages.
const NAME: &str = "standard input";

/// Starts the reading thread.
pub(crate) fn open(stream: impl io::Read + Send + 'static, wanted: &Wanted) -> Box<dyn Source> {
    let (send, news) = sync_channel(WAITING);
    std::thread::spawn(move || {
        let mut reader = BufReader::new(stream);
        loop {
            let mut line = vec![];
            let flawed = |kind: Irregularity| News::Other(Read::Flawed(kind.into()));
            let found = match next_line(&mut reader, &mut line) {
                Ok(Line::Whole) => News::Lines((), line),
                Ok(Line::TooLong) => flawed(Irregularity::TooLong),
                // The writer may have died in the middle of a number.
                Ok(Line::Unended) => flawed(Irregularity::CutShort),
                Ok(Line::None) => News::Other(Read::End),
                Err(cause) => News::Failed(cause.to_string()),
            };
            let is_last = matches!(found, News::Other(Read::End) | News::Failed(_));
            // A closed receiver needs no more lines.
            if send.send(found).is_err() || is_last {
                break;
            }
        }
    });
    let mut frames = Frames::new(wanted);
    Box::new(Live::new(NAME.into(), "line", news, move |(), line, row| frames.read(line, row)))
}

/// The columns of the first line that names any.
pub(crate) fn columns(mut stream: impl BufRead) -> Result<Vec<String>, SourceError> {
    let (mut line, mut first, mut marked) = (vec![], vec![], None);
    loop {
        if next_line(&mut stream, &mut line).map_err(|cause| failed(&cause))? == Line::None {
            return Err(no_header(NAME.into(), &first));
        }
        // Names behind a mark are those of the row of numbers below them.
        if frame::behind_mark(&line).is_some() {
            marked = frame::marked_columns(&line);
        } else if let Some(names) =
            frame::columns(&line).or(marked.take_if(|_| !line.trim_ascii().is_empty()))
        {
            return Ok(names);
        }
        if first.is_empty() && !line.trim_ascii().is_empty() {
            first.push(line.clone());
        }
    }
}

fn failed(cause: &io::Error) -> SourceError {
    SourceError::Connection { address: NAME.into(), cause: cause.to_string() }
}

#[cfg(test)]
mod tests {
    use super::super::LogRow;
    use super::*;

    #[test]
    fn a_stream_that_ends_within_a_line() {
        let names = ["t", "p"].map(String::from).to_vec();
        let wanted = Wanted { names, time: Some(0), ..Wanted::default() };
        let mut source = open(&b"t,p\n1,2\n\n3,4"[..], &wanted);
        let mut row = LogRow::default();
        let mut found = vec![];
        while found.last() != Some(&Read::End) {
            found.push(source.read(&mut row).unwrap());
        }
        let cut = Read::Flawed(Irregularity::CutShort.into());
        assert_eq!(found, [Read::Nothing, Read::Row, Read::Nothing, cut, Read::End]);
        assert_eq!((row.place, &*row.values), (4, &[1.0, 2.0][..]));
    }
}
