//! The measures of every summary, on a terminal or in the report: safety first.
//!
//! What is reported first is the *headline*: each setting under the hardest protocol that the study
//! allows. One row is one measure of one kind; settings stand side by side.

use crate::evaluation::Evaluation;
use crate::evaluation::bands::Band;
use crate::evaluation::protocol::{Protocol, ProtocolResult};
use crate::evaluation::score::Rate;
use crate::job::Results;
use crate::job::results::SubjectResult;

/// The study whose results the seed paper has.
pub const PAPER: &str = "paper";

/// The accuracies that the seed paper reports, with a third of the variants held out at random.
pub const OF_PAPER: [(&str, f64); 2] = [("A", 0.9149), ("B", 0.9844)];

/// Who answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Who {
    /// The trees, which can be explained.
    Trees,
    /// The committee, which can be silent.
    Committee,
}

/// One measure of a diagnosis.
pub struct Measure {
    /// What it says.
    pub title: &'static str,
    /// Its rate under a protocol.
    pub rate: fn(&ProtocolResult) -> Option<Rate>,
}

/// What errors would do to the aircraft. Less is better.
pub const SAFETY: [Measure; 4] = [
    Measure {
        title: "wrong actuator shut down",
        rate: |result| Some(result.safety.as_ref()?.wrong_actuator_shutdown),
    },
    Measure {
        title: "shutdown missed (of detected)",
        rate: |result| Some(result.safety.as_ref()?.missed_shutdown),
    },
    Measure {
        title: "shutdown missed (of all)",
        rate: |result| result.safety.as_ref()?.missed_shutdown_of_all,
    },
    Measure {
        title: "needless shutdown",
        rate: |result| Some(result.safety.as_ref()?.needless_shutdown),
    },
];

/// How often the answer is right. More is better.
pub const RIGHT: [Measure; 2] = [
    Measure { title: "actuator and command right", rate: |result| result.right_action },
    Measure { title: "end to end right", rate: |result| result.end_to_end },
];

/// The stages of the hierarchy: the seed paper's letters and what they find.
pub const STAGES: [(&str, &str); 5] = [
    ("A", "actuator"),
    ("B", "command"),
    ("C", "first command's details"),
    ("D", "second command's details"),
    ("E", "third command's details"),
];

impl Who {
    /// The trees first: they explain their answer.
    pub const ALL: [Who; 2] = [Who::Trees, Who::Committee];

    /// The word in tables.
    pub fn title(self) -> &'static str {
        match self {
            Who::Trees => "trees",
            Who::Committee => "committee",
        }
    }

    /// The result under a protocol.
    pub fn under(self, evaluation: &Evaluation, protocol: Protocol) -> Option<&ProtocolResult> {
        match self {
            Who::Trees => evaluation.protocol(protocol),
            Who::Committee => evaluation.committee(protocol),
        }
    }

    /// The result under the hardest protocol of all that were possible.
    pub fn headline(self, evaluation: &Evaluation) -> Option<&ProtocolResult> {
        self.under(evaluation, evaluation.headline()?.protocol)
    }
}

/// One row of the headline.
pub struct Row {
    /// What is measured.
    pub title: &'static str,
    /// Who answers.
    pub who: &'static str,
    /// Whether it is about safety.
    pub is_safety: bool,
    /// One rate for each setting.
    pub rates: Vec<Option<Rate>>,
}

/// The results without those of an additional sensor: one for each setting, the kindest first.
pub fn settings(results: &Results) -> Vec<&SubjectResult> {
    results.subjects.iter().filter(|result| !result.subject.extra_sensor()).collect()
}

/// The bands in use, where they were learned from healthy specimens; otherwise the seed paper's is.
pub fn learned(result: &SubjectResult) -> Option<&[Band]> {
    result.evaluation.bands.as_deref().filter(|_| result.settings.learned_bands)
}

/// The headline of some settings; rows without a rate in any of them are left out.
pub fn headline(settings: &[&SubjectResult]) -> Vec<Row> {
    let mut rows = vec![];
    let mut push = |title, who, is_safety, of: &dyn Fn(&Evaluation) -> Option<Rate>| {
        let rates = settings.iter().map(|result| of(&result.evaluation));
        let rates: Vec<_> = rates.map(|rate| rate.filter(|rate| rate.of > 0)).collect();
        if rates.iter().any(Option::is_some) {
            rows.push(Row { title, who, is_safety, rates });
        }
    };
    for measure in &SAFETY {
        for who in Who::ALL {
            let of = |evaluation: &Evaluation| who.headline(evaluation).and_then(measure.rate);
            push(measure.title, who.title(), true, &of);
        }
    }
    let (trees, committee) = (Who::Trees.title(), Who::Committee.title());
    let healthy = "healthy specimen shut down";
    push(healthy, trees, true, &|e| Some(e.false_alarms.as_ref()?.tree_shutdowns));
    push(healthy, committee, true, &|e| Some(e.false_alarms.as_ref()?.committee_shutdowns));
    let healthy = "healthy specimen alarms";
    push(healthy, "bands", true, &|e| Some(e.false_alarms.as_ref()?.alarms));
    push("fault detected", "bands", false, &|e| Some(e.detection.detected));
    for measure in &RIGHT {
        for who in Who::ALL {
            let of = |evaluation: &Evaluation| who.headline(evaluation).and_then(measure.rate);
            push(measure.title, who.title(), false, &of);
        }
    }
    rows
}
