//! All classifiers, compared under the same protocol.

use crate::Material;
use crate::words::{distinct, stacked};
use servotwin::learn::Evaluation;
use servotwin::learn::protocol::Protocol;
use servotwin_diagnosis::hierarchy::Question;
use servotwin_view::document::{Document, Table};

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    for result in &material.results.subjects {
        let holding = result.settings.comparison_holding;
        let words = material.words();
        for (stage, question) in [("A", Question::Actuator), ("B", Question::Action)] {
            let asks = words.question(question);
            let grid = accuracies(&result.evaluation, stage);
            // With one actuator there is no actuator stage.
            if grid.is_empty() {
                continue;
            }
            page.table(
                "",
                grid.captioned(format!(
                    "Scenario: {}. Accuracy for {asks} (stage {stage}) of all classifiers with the \
                     same features and default settings; random thirds: {}. The intervals are of 95 %.",
                    result.title, holding.repeats
                )),
            );
        }
    }
}

/// The accuracy of each classifier at one stage, under the kindest and the hardest protocol.
fn accuracies(evaluation: &Evaluation, stage: &str) -> Table {
    let own = || evaluation.classifiers.iter().filter(|compared| compared.stage == stage);
    let hardest = evaluation.headline().map_or(Protocol::NewCommand, |result| result.protocol);
    let protocols = [Protocol::RandomThird, hardest];
    let heads = ["classifier"].into_iter().chain(protocols.map(Protocol::title));
    let mut grid = Table::headed(heads);
    for title in distinct(own().map(|compared| compared.title.as_str())) {
        let accuracy = |protocol: Protocol| {
            stacked(
                own()
                    .find(|compared| compared.title == title && compared.protocol == protocol)
                    .map(|compared| compared.score.accuracy),
            )
        };
        grid.push([title.to_owned()].into_iter().chain(protocols.map(accuracy)));
    }
    grid
}
