//! Writes one line of JSON for every change of the finding, and for every notice of the watch.

use super::{Sample, Sink, SinkError};
use crate::watchdog::Notice;
use serde::Serialize;
use servotwin::live::observer::Finding;
use servotwin_io::files::FileError;
use servotwin_io::moment;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A change of the finding as a line of JSON.
#[derive(Debug, Serialize)]
struct Event<'e> {
    time_s: f64,
    /// The time as a date, if it counts from 1970.
    #[serde(skip_serializing_if = "Option::is_none")]
    date: Option<String>,
    place: u64,
    #[serde(flatten)]
    finding: &'e Finding,
}

/// Whether a line of an event file is a change of the finding. All other lines are notices, which begin with `event`.
pub fn is_change(line: &str) -> bool {
    !line.starts_with("{\"event\":")
}

/// Writes and flushes each event at once.
pub struct Events<W> {
    out: W,
    /// `None` for standard output.
    file: Option<Kept>,
}

/// A file of complete lines.
struct Kept {
    path: PathBuf,
    /// A handle for truncating an incomplete line when the disk is full.
    file: Option<File>,
    /// The length of its complete lines, bytes.
    length: u64,
}

impl<W: Write> Events<W> {
    /// Writes to standard output.
    pub fn new(out: W) -> Self {
        Events { out, file: None }
    }

    fn line(&mut self, event: &impl Serialize) -> Result<(), SinkError> {
        let mut write = || -> io::Result<u64> {
            let line = serde_json::to_string(event)?;
            writeln!(self.out, "{line}")?;
            self.out.flush()?;
            Ok(line.len() as u64 + 1)
        };
        match (write(), &mut self.file) {
            (Ok(length), Some(kept)) => kept.length += length,
            (Ok(_), None) => {}
            // A reader that has closed the pipe is not a failure.
            (Err(error), _) if error.kind() == io::ErrorKind::BrokenPipe => {}
            (Err(error), None) => return Err(SinkError::Output(error)),
            (Err(error), Some(kept)) => {
                // Best effort: the file is already unusable.
                let _ = kept.file.as_ref().map(|file| file.set_len(kept.length));
                return Err(SinkError::File(FileError::from_io(&kept.path, error)));
            }
        }
        Ok(())
    }
}

impl Events<File> {
    /// Appends to an open file; `path` names it in errors. An incomplete line on a full disk is cut off.
    pub fn to_file(out: File, path: &Path) -> Self {
        let is_regular = out.metadata().is_ok_and(|data| data.is_file());
        let length = out.metadata().map_or(0, |data| data.len());
        let file = if is_regular { out.try_clone().ok() } else { None };
        Events { out, file: Some(Kept { path: path.into(), file, length }) }
    }
}

impl<W: Write> Sink for Events<W> {
    fn sample(&mut self, sample: &Arc<Sample>) -> Result<(), SinkError> {
        if !sample.changed {
            return Ok(());
        }
        let (time_s, place) = (sample.time_s, sample.place);
        let date = moment::date_of(time_s);
        let event = Event { time_s, date, place, finding: &sample.finding };
        self.line(&event)
    }

    fn notice(&mut self, notice: &Notice) -> Result<(), SinkError> {
        self.line(notice)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct NoJson;

    impl Serialize for NoJson {
        fn serialize<S: serde::Serializer>(&self, _: S) -> Result<S::Ok, S::Error> {
            Err(serde::ser::Error::custom("no JSON"))
        }
    }

    #[test]
    fn an_event_that_cannot_be_written_is_an_error_and_no_empty_line() {
        let mut events = Events::new(vec![]);
        assert!(events.line(&NoJson).is_err());
        events.line(&1).unwrap();
        assert_eq!(events.out, b"1\n");
    }
}
