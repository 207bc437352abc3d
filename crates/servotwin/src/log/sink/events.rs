//! One line of JSON for every change of what the observer says.

use super::{Sample, Sink, SinkError};
use crate::files::FileError;
use crate::log::observer::Finding;
use crate::moment;
use serde::Serialize;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// A change, as a line of JSON shows it.
#[derive(Debug, Serialize)]
struct Event<'e> {
    time_s: f64,
    /// The same as a date, where it counts from 1970.
    #[serde(skip_serializing_if = "Option::is_none")]
    date: Option<String>,
    place: u64,
    #[serde(flatten)]
    finding: &'e Finding,
}

/// Writes events as they come: whoever reads along sees each at once.
pub struct Events<W> {
    out: W,
    /// The file; `None` for standard output.
    path: Option<PathBuf>,
}

impl<W: Write> Events<W> {
    /// Writes to standard output.
    pub fn new(out: W) -> Self {
        Events { out, path: None }
    }

    /// Writes to a file that is open, and named where it cannot be written.
    pub fn to_file(out: W, path: &Path) -> Self {
        Events { out, path: Some(path.into()) }
    }

    fn failed(&self, cause: io::Error) -> SinkError {
        match &self.path {
            Some(path) => SinkError::File(FileError::from_io(path, cause)),
            None => SinkError::Output(cause),
        }
    }
}

impl<W: Write> Sink for Events<W> {
    fn sample(&mut self, sample: &Sample) -> Result<(), SinkError> {
        if !sample.changed {
            return Ok(());
        }
        let (time_s, place) = (sample.time_s, sample.place);
        let date = moment::date_of(time_s);
        let event = Event { time_s, date, place, finding: sample.observation.finding };
        let line = serde_json::to_string(&event).unwrap_or_default();
        match writeln!(self.out, "{line}").and_then(|()| self.out.flush()) {
            // A reader that has gone is no failure.
            Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(self.failed(error)),
            _ => Ok(()),
        }
    }
}
