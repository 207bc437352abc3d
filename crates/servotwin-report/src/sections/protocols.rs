//! The protocols: how each holds variants out, and the results under it.

use crate::Material;
use crate::lines;
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
        page.table("", grid(&evaluation.protocols, &words).captioned(format!(
                "Scenario: {}. Accuracy of each stage where the stages above are right ({}), and of all \
                 together (end to end), with 95 % intervals from drawing kinds of fault at their intensities; the interval “by kind” draws \
                 whole kinds, and is that of a fault of a new kind. “Of all” is \
                 the share isolated of all faults, the undetectable ones included.",
                result.title,
                named.join(", ")
            )));
        if !evaluation.baseline.is_empty() {
            page.table("", grid(&evaluation.baseline, &words).captioned(format!(
                    "Scenario: {}. The same for trees with fewer features{}: mean, variance and indicator of \
                     each residual{}, and the fixed band of ±3 %.",
                    result.title,
                    words.paper(", the seed paper's"),
                    match words.has_several() {
                        true => format!(", each {} by itself", words.unit()),
                        false => String::new(),
                    }
                )));
        }
    }
}

/// A table with protocols in rows and measures in columns.
fn grid(results: &[ProtocolResult], words: &Vocabulary) -> Table {
    let stages = lines::stages(words, &results.iter().collect::<Vec<_>>());
    let mut heads = vec!["held out", "splits"];
    heads.extend(stages.iter().map(|(letter, _)| letter.as_str()));
    let whole = ["end to end", "by kind", "of all"];
    heads.extend(whole);
    let mut grid = Table::headed(heads);
    for result in results {
        let mut row = vec![words.adapted(&result.title), result.splits.to_string()];
        let accuracy = |letter: &str| stacked(result.stage(letter).map(|score| score.accuracy));
        row.extend(stages.iter().map(|(letter, _)| accuracy(letter)));
        let end_to_end = result.rates.counted(&measure::END_TO_END);
        row.push(stacked(end_to_end));
        row.push(by_kind(end_to_end));
        row.push(stacked(result.rates.counted(&measure::END_TO_END_OF_ALL)));
        grid.push(row);
    }
    grid
}
