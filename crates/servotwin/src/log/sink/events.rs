//! One line of JSON for every change of what the observer says.

use super::{Sample, Sink, SinkError};
use crate::log::observer::Finding;
use serde::Serialize;
use std::io::{self, Write};

/// A change, as a line of JSON shows it.
#[derive(Debug, Serialize)]
struct Event<'e> {
    time_s: f64,
    place: u64,
    #[serde(flatten)]
    finding: &'e Finding,
}

/// Writes events as they come: whoever reads along sees each at once.
pub struct Events<W> {
    out: W,
}

impl<W: Write> Events<W> {
    /// Writes to a file or standard output.
    pub fn new(out: W) -> Self {
        Events { out }
    }
}

impl<W: Write> Sink for Events<W> {
    fn sample(&mut self, sample: &Sample) -> Result<(), SinkError> {
        if !sample.changed {
            return Ok(());
        }
        let (time_s, place) = (sample.time_s, sample.place);
        let event = Event { time_s, place, finding: sample.observation.finding };
        let line = serde_json::to_string(&event).unwrap_or_default();
        match writeln!(self.out, "{line}").and_then(|()| self.out.flush()) {
            // A reader that has gone is no failure.
            Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
                Err(SinkError::Output(error))
            }
            _ => Ok(()),
        }
    }
}
