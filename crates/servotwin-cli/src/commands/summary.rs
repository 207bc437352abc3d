//! The end of the main job on a terminal: safety first, then accuracies.

use crate::render::{Grid, Side};
use servotwin::evaluation::Evaluation;
use servotwin::evaluation::protocol::{Protocol, ProtocolResult};
use servotwin::evaluation::score::Rate;
use servotwin::job::Results;
use servotwin::job::results::SubjectResult;

/// The paper's accuracies, with a third held out at random.
const PAPER: [(&str, f64); 2] = [("A", 0.9149), ("B", 0.9844)];

/// One line of the table: its head, and what it shows of a protocol.
type Line = (&'static str, fn(&ProtocolResult) -> Option<Rate>);

const SAFETY: [Line; 3] = [
    ("wrong actuator shut down", |r| Some(r.safety.as_ref()?.wrong_actuator_shutdown)),
    ("shutdown missed", |r| Some(r.safety.as_ref()?.missed_shutdown)),
    ("needless shutdown", |r| Some(r.safety.as_ref()?.needless_shutdown)),
];

const ACCURACY: [Line; 6] = [
    ("A  actuator", |r| Some(r.stage("A")?.accuracy)),
    ("B  command", |r| Some(r.stage("B")?.accuracy)),
    ("C  detail, shut down", |r| Some(r.stage("C")?.accuracy)),
    ("D  detail, change mode", |r| Some(r.stage("D")?.accuracy)),
    ("E  detail, warning", |r| Some(r.stage("E")?.accuracy)),
    ("end to end", |r| r.end_to_end),
];

/// A table for each subject.
pub fn text(results: &Results) -> String {
    results.subjects.iter().map(of_subject).collect::<Vec<_>>().join("\n")
}

fn of_subject(result: &SubjectResult) -> String {
    let evaluation = &result.evaluation;
    let mut grid = Grid::new(&[
        ("", Side::Left),
        ("random third", Side::Right),
        ("grouped", Side::Right),
        ("new intensity", Side::Right),
        ("new case", Side::Right),
        ("36 features", Side::Right),
        ("paper", Side::Right),
    ]);
    for (name, value) in SAFETY.iter().chain(&ACCURACY) {
        grid.push(row(evaluation, name, *value));
    }
    let detection = &evaluation.detection;
    let mut text = format!("{}\n{}", result.title, grid.text());
    text += &format!("{} of faults detectable", percent(Some(detection.detected)));
    if let Some(alarms) = &evaluation.false_alarms {
        let (all, shutdowns) = (percent(Some(alarms.alarms)), percent(Some(alarms.shutdowns)));
        text += &format!("; {all} of healthy specimens give an alarm, {shutdowns} a shutdown");
    }
    text + "\n"
}

fn row(
    evaluation: &Evaluation,
    name: &str,
    value: fn(&ProtocolResult) -> Option<Rate>,
) -> Vec<String> {
    let of = |protocol| percent(evaluation.protocol(protocol).and_then(value));
    let mut baseline = evaluation.baseline.iter();
    let third = baseline.find(|r| r.protocol == Protocol::RandomThird).and_then(value);
    let paper = PAPER.iter().find(|(stage, _)| name.starts_with(stage));
    vec![
        name.into(),
        of(Protocol::RandomThird),
        of(Protocol::Grouped),
        of(Protocol::LeaveIntensityOut),
        of(Protocol::LeaveCaseOut),
        percent(third),
        paper.map(|(_, share)| format!("{:.2} %", 100.0 * share)).unwrap_or_default(),
    ]
}

fn percent(rate: Option<Rate>) -> String {
    let share = rate.and_then(|rate| rate.share);
    share.map_or_else(|| "–".into(), |share| format!("{:.2} %", 100.0 * share))
}
