//! The protocols: how each holds variants out, and the results under it.

use crate::Material;
use crate::lines::{self, Who};
use crate::vocabulary::Vocabulary;
use crate::words::{by_kind, stacked};
use servotwin::learn::protocol::ProtocolResult;
use servotwin::measure;
use servotwin_view::document::{Document, Table};

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    if material.results.subjects.is_empty() {
        return;
    }
    let words = material.words();
    page.text(
        "A tree is only as good as its test is honest. A random third is the kindest test: for nearly every \
         variant a neighbour (the same fault at the same intensity in another operating case) was in training. \
         Leaving out a whole kind of fault asks how the trees behave where they have no experience. A fault \
         unseen at its intensity was learned at other intensities only. New commands are the hardest test that \
         the final trees take: no command of the judged cases was learned from.",
    );
    for result in &material.results.subjects {
        let evaluation = &result.evaluation;
        let stages = lines::stages(&words, &evaluation.protocols.iter().collect::<Vec<_>>());
        let named = |(id, finds): &(String, String)| format!("{id} {finds}");
        let named: Vec<String> = stages.iter().map(named).collect();
        page.table("", grid(&lines::answers(evaluation), &words).captioned(format!(
                "Scenario: {}. Accuracy of each stage where the stages above are right ({}), and of all \
                 together (end to end), with 95 % intervals from drawing kinds of fault at their intensities; the interval “by kind” draws \
                 whole kinds, and is that of a fault of a new kind. “Of all” is \
                 the share isolated of all faults, the undetectable ones included.",
                result.title,
                named.join(", ")
            )));
        if let Some(baseline) = &evaluation.baseline {
            page.table("", grid(&[(Who::Trees, baseline)], &words).captioned(format!(
                    "Scenario: {}. The same for trees with fewer features{}: mean, variance and indicator of \
                     each residual{}, and the fixed band of ±3 %.",
                    result.title,
                    words.paper(", the seed paper's"),
                    match words.has_several() {
                        true => format!(", each {} by itself", words.actuator()),
                        false => String::new(),
                    }
                )));
        }
    }
}

/// A table with protocols in rows and measures in columns.
fn grid(results: &[(Who, &ProtocolResult)], words: &Vocabulary) -> Table {
    let all: Vec<&ProtocolResult> = results.iter().map(|(_, result)| *result).collect();
    let stages = lines::stages(words, &all);
    let has_committee = results.iter().any(|(who, _)| *who == Who::Committee);
    let mut heads = vec!["held out", "splits"];
    heads.extend(has_committee.then_some("by"));
    heads.extend(stages.iter().map(|(letter, _)| letter.as_str()));
    let right_action = words.measure(&measure::RIGHT_ACTION);
    heads.extend([&right_action, "end to end", "by kind", "of all"]);
    let mut grid = Table::headed(heads);
    for &(who, result) in results {
        let title = match who {
            Who::Trees => words.adapted(&result.title),
            Who::Committee => String::new(),
        };
        let mut row = vec![title, result.splits.to_string()];
        row.extend(has_committee.then(|| who.title().to_owned()));
        let accuracy = |letter: &str| stacked(result.stage(letter).map(|score| score.accuracy));
        row.extend(stages.iter().map(|(letter, _)| accuracy(letter)));
        row.push(stacked(result.rates.counted(&measure::RIGHT_ACTION)));
        let end_to_end = result.rates.counted(&measure::END_TO_END);
        row.push(stacked(end_to_end));
        row.push(by_kind(end_to_end));
        row.push(stacked(result.rates.counted(&measure::END_TO_END_OF_ALL)));
        grid.push_if(who == Who::Committee, row);
    }
    grid
}
