//! Summarizes a watch as a few lines of text: a strip of states, and a list of changes.

use super::{Sample, Sink, SinkError};
use crate::watchdog::Notice;
use servotwin::live::observer::{DiagnosisState, Finding};
use servotwin_io::moment;
use std::fmt::Write;
use std::sync::Arc;

/// The maximum number of parts while the strip grows; the shown strip has at least half as many.
const PARTS: usize = 128;

/// The most changes that are kept; later ones are only counted.
const CHANGES: usize = 1000;

/// This many alternations between two findings are shown; later ones are summarized in one line.
const TO_AND_FRO: usize = 6;

/// A change of the finding.
#[derive(Debug)]
struct Change {
    time_s: f64,
    finding: Finding,
    /// How many further alternations between this finding and the previous one followed, and the time of the last.
    more: usize,
    last_s: f64,
}

/// Gathers states and changes.
#[derive(Debug, Default)]
pub struct Strip {
    /// The most severe state of every part.
    parts: Vec<DiagnosisState>,
    /// Samples in a full part, and in the last part.
    width: usize,
    filled: usize,
    begin_s: f64,
    end_s: f64,
    changes: Vec<Change>,
    left_out: usize,
    /// The last two findings, and how many in a row were those before the last.
    last: [Option<Finding>; 2],
    returns: usize,
    /// The notices of the watchdog, each with the time of the last sample, s.
    notices: Vec<(f64, String)>,
}

/// The order of states: a part shows the most severe.
fn severity(state: DiagnosisState) -> usize {
    match state {
        DiagnosisState::NoData => 0,
        DiagnosisState::Healthy => 1,
        DiagnosisState::Undecided => 2,
        DiagnosisState::EnvironmentInvalid => 3,
        DiagnosisState::Unknown => 4,
        DiagnosisState::Detected => 5,
        DiagnosisState::Isolated => 6,
    }
}

fn severest(one: DiagnosisState, other: DiagnosisState) -> DiagnosisState {
    if severity(other) > severity(one) { other } else { one }
}

impl Sink for Strip {
    fn sample(&mut self, sample: &Arc<Sample>) -> Result<(), SinkError> {
        let finding = &sample.finding;
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
        if sample.changed {
            self.change(sample.time_s, finding);
        }
        Ok(())
    }

    fn notice(&mut self, notice: &Notice) -> Result<(), SinkError> {
        let words = notice.words().filter(|_| self.notices.len() < CHANGES);
        self.notices.extend(words.map(|words| (notice.time_s.unwrap_or(0.0), words)));
        Ok(())
    }
}

impl Strip {
    fn change(&mut self, time_s: f64, finding: &Finding) {
        let is_back = self.last[0].as_ref().is_some_and(|before| before.says_the_same(finding));
        self.returns = if is_back { self.returns + 1 } else { 0 };
        self.last = [self.last[1].take(), Some(finding.clone())];
        let is_to_and_fro = self.returns > TO_AND_FRO - 2;
        if let Some(last) = self.changes.last_mut().filter(|_| is_to_and_fro) {
            (last.more, last.last_s) = (last.more + 1, time_s);
        } else if self.changes.len() < CHANGES {
            let (finding, more, last_s) = (finding.clone(), 0, time_s);
            self.changes.push(Change { time_s, finding, more, last_s });
        } else {
            self.left_out += 1;
        }
    }

    /// The summary as text.
    pub fn text(&self) -> String {
        if self.parts.is_empty() {
            return "no sample\n".into();
        }
        let strip: String = self.parts.iter().map(|state| state.mark()).collect();
        let [begin, end] = [self.begin_s, self.end_s].map(moment::shown);
        let mut text = format!("{begin} |{strip}| {end}\n");
        let met = |state: &DiagnosisState| self.parts.contains(state);
        let legend = DiagnosisState::ALL.into_iter().filter(met);
        let legend: Vec<String> =
            legend.map(|state| format!("'{}' {}", state.mark(), state.words())).collect();
        let _ = writeln!(text, "{}\n", legend.join(", "));
        for Change { time_s, finding, more, last_s } in &self.changes {
            let sure = match finding.confidence {
                sure if sure > 0.0 => format!(" ({:.0} %)", 100.0 * sure),
                _ => String::new(),
            };
            let _ = writeln!(text, "{:>12}  {}{sure}", moment::shown(*time_s), finding.words());
            if *more > 0 {
                let last = moment::shown(*last_s);
                let _ = writeln!(text, "{last:>12}  until here {more} more between these two");
            }
        }
        if self.left_out > 0 {
            let _ = writeln!(text, "and {} changes more", self.left_out);
        }
        for (time_s, words) in &self.notices {
            let _ = writeln!(text, "after {time_s:.2} s  {words}");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(states: impl IntoIterator<Item = DiagnosisState>) -> String {
        let mut strip = Strip { parts: vec![DiagnosisState::NoData], ..Strip::default() };
        for (second, state) in states.into_iter().enumerate() {
            strip.change(second as f64, &Finding { state, ..Finding::default() });
        }
        strip.text()
    }

    #[test]
    fn what_goes_to_and_fro_for_long_is_one_line() {
        let two = [DiagnosisState::NoData, DiagnosisState::EnvironmentInvalid];
        let text = told(two.into_iter().cycle().take(6));
        assert!(text.matches(" s  ").count() == 6 && !text.contains("more"), "{text}");
        let longer = two.into_iter().cycle().take(1001);
        let text = told(longer.chain([DiagnosisState::Healthy, DiagnosisState::NoData]));
        assert!(text.contains("   1000.00 s  until here 995 more between these two"), "{text}");
        assert_eq!(text.matches(" s  ").count(), 9, "{text}");
        let three = [DiagnosisState::NoData, DiagnosisState::Healthy, DiagnosisState::Unknown];
        assert!(!told(three.into_iter().cycle().take(90)).contains("more"));
    }
}
