//! The end of the main job on a terminal: safety first, then accuracies.

use crate::render::{Grid, Side};
use servotwin::evaluation::protocol::Protocol;
use servotwin::job::Results;
use servotwin::job::results::SubjectResult;
use servotwin::report::lines::{ACCURACY, PAPER, PROTOCOLS, SAFETY};
use servotwin::report::words::{percent, share};

/// A table for each subject.
pub fn text(results: &Results) -> String {
    let is_papers = results.study == PAPER;
    let of = |subject| of_subject(subject, is_papers);
    results.subjects.iter().map(of).collect::<Vec<_>>().join("\n")
}

fn of_subject(result: &SubjectResult, is_papers: bool) -> String {
    let evaluation = &result.evaluation;
    let mut heads = vec![("", Side::Left)];
    heads.extend(PROTOCOLS.map(|(_, head)| (head, Side::Right)));
    heads.push(("paper's features", Side::Right));
    if is_papers {
        heads.push(("paper", Side::Right));
    }
    let mut grid = Grid::new(&heads);
    for line in SAFETY.iter().chain(&ACCURACY) {
        let mut row = vec![line.title.to_owned()];
        row.extend(PROTOCOLS.map(|(protocol, _)| share(line.of(evaluation, protocol))));
        row.push(share(line.of_baseline(evaluation, Protocol::RandomThird)));
        if is_papers {
            row.push(line.paper.map(|paper| percent(Some(paper))).unwrap_or_default());
        }
        grid.push(row);
    }
    let detection = &evaluation.detection;
    let mut text = format!("Setting: {}\n{}", result.title, grid.text());
    text += &format!("{} of faults detectable", share(Some(detection.detected)));
    if let Some(alarms) = &evaluation.false_alarms {
        let (all, shutdowns) = (share(Some(alarms.alarms)), share(Some(alarms.tree_shutdowns)));
        text += &format!("; {all} of healthy specimens give an alarm, {shutdowns} a shutdown");
    }
    text + "\n"
}
