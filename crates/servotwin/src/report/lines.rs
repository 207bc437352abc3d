//! The lines of every summary, on a terminal or in the report: safety first.

use crate::evaluation::Evaluation;
use crate::evaluation::protocol::{Protocol, ProtocolResult};
use crate::evaluation::score::Rate;

/// The study whose results the seed paper has.
pub const PAPER: &str = "paper";

/// One line of a summary.
pub struct Line {
    /// What it says.
    pub title: &'static str,
    /// Its rate under a protocol.
    pub rate: fn(&ProtocolResult) -> Option<Rate>,
    /// The seed paper's value, with a third held out at random.
    pub paper: Option<f64>,
}

/// What errors would do to the aircraft. Less is better.
pub const SAFETY: [Line; 3] = [
    Line {
        title: "wrong actuator shut down",
        rate: |result| Some(result.safety.as_ref()?.wrong_actuator_shutdown),
        paper: None,
    },
    Line {
        title: "shutdown missed",
        rate: |result| Some(result.safety.as_ref()?.missed_shutdown),
        paper: None,
    },
    Line {
        title: "needless shutdown",
        rate: |result| Some(result.safety.as_ref()?.needless_shutdown),
        paper: None,
    },
];

/// How often each stage is right. More is better.
pub const ACCURACY: [Line; 6] = [
    Line { title: "A  actuator", rate: |r| Some(r.stage("A")?.accuracy), paper: Some(0.9149) },
    Line { title: "B  command", rate: |r| Some(r.stage("B")?.accuracy), paper: Some(0.9844) },
    Line {
        title: "C  first command's details",
        rate: |r| Some(r.stage("C")?.accuracy),
        paper: None,
    },
    Line {
        title: "D  second command's details",
        rate: |r| Some(r.stage("D")?.accuracy),
        paper: None,
    },
    Line {
        title: "E  third command's details",
        rate: |r| Some(r.stage("E")?.accuracy),
        paper: None,
    },
    Line { title: "end to end", rate: |r| r.end_to_end, paper: None },
];

/// The protocols that a summary shows, with short heads.
pub const PROTOCOLS: [(Protocol, &str); 4] = [
    (Protocol::RandomThird, "random third"),
    (Protocol::Grouped, "grouped"),
    (Protocol::LeaveIntensityOut, "new intensity"),
    (Protocol::LeaveCaseOut, "new case"),
];

impl Line {
    /// The rate of the hierarchy under a protocol.
    pub fn of(&self, evaluation: &Evaluation, protocol: Protocol) -> Option<Rate> {
        evaluation.protocol(protocol).and_then(self.rate)
    }

    /// The rate of the seed paper's trees (its features only) under a protocol.
    pub fn of_baseline(&self, evaluation: &Evaluation, protocol: Protocol) -> Option<Rate> {
        evaluation.baseline.iter().find(|r| r.protocol == protocol).and_then(self.rate)
    }
}
