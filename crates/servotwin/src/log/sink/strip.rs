//! The whole watch as a few lines of text: a strip of states, and what changed when.

use super::{Sample, Sink, SinkError};
use crate::log::observer::{Finding, State};
use std::fmt::Write;

/// Parts of the strip while it grows; shown are half of them or more.
const PARTS: usize = 128;

/// The most changes that are kept; of more, the number is said.
const CHANGES: usize = 1000;

/// Gathers states and changes.
#[derive(Debug, Default)]
pub struct Strip {
    /// The most severe state of every part.
    parts: Vec<State>,
    /// Samples in a part, and in the last one.
    width: usize,
    filled: usize,
    begin_s: f64,
    end_s: f64,
    changes: Vec<(f64, Finding)>,
    left_out: usize,
}

/// The state that a part shows, if it has both.
fn severity(state: State) -> usize {
    match state {
        State::NoData => 0,
        State::Healthy => 1,
        State::Undecided => 2,
        State::EnvironmentInvalid => 3,
        State::Unknown => 4,
        State::Detected => 5,
        State::Isolated => 6,
    }
}

fn severest(one: State, other: State) -> State {
    if severity(other) > severity(one) { other } else { one }
}

impl Sink for Strip {
    fn sample(&mut self, sample: &Sample) -> Result<(), SinkError> {
        let finding = sample.observation.finding;
        if self.parts.is_empty() {
            (self.begin_s, self.width) = (sample.time_s, 1);
        }
        self.end_s = sample.time_s;
        if self.parts.is_empty() || self.filled == self.width {
            if self.parts.len() == PARTS {
                let pairs = self.parts.chunks(2);
                self.parts = pairs.map(|pair| severest(pair[0], pair[pair.len() - 1])).collect();
                self.width *= 2;
            }
            self.parts.push(finding.state);
            self.filled = 0;
        }
        self.filled += 1;
        if let Some(last) = self.parts.last_mut() {
            *last = severest(*last, finding.state);
        }
        match sample.changed {
            true if self.changes.len() < CHANGES => {
                self.changes.push((sample.time_s, finding.clone()));
            }
            true => self.left_out += 1,
            false => {}
        }
        Ok(())
    }
}

impl Strip {
    /// The lines.
    pub fn text(&self) -> String {
        if self.parts.is_empty() {
            return "no sample\n".into();
        }
        let strip: String = self.parts.iter().map(|state| state.mark()).collect();
        let mut text = format!("{:.1} s |{strip}| {:.1} s\n", self.begin_s, self.end_s);
        let met = |state: &State| self.parts.contains(state);
        let legend = State::ALL.into_iter().filter(met);
        let legend: Vec<String> =
            legend.map(|state| format!("'{}' {}", state.mark(), state.words())).collect();
        let _ = writeln!(text, "{}\n", legend.join(", "));
        for (time_s, finding) in &self.changes {
            let sure = match finding.confidence {
                sure if sure > 0.0 => format!(" ({:.0} %)", 100.0 * sure),
                _ => String::new(),
            };
            let _ = writeln!(text, "{time_s:>10.2} s  {}{sure}", finding.words());
        }
        if self.left_out > 0 {
            let _ = writeln!(text, "and {} changes more", self.left_out);
        }
        text
    }
}
