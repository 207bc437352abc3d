//! Confusion matrices.

use crate::Material;
use crate::lines::decides;
use crate::words::spoken;
use servotwin::evaluation::protocol::StageScore;
use servotwin_view::document::Document;
use servotwin_view::heatmap::ConfusionMatrix;

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    let words = material.words();
    for result in material.results.subjects.iter().filter(|r| !r.subject.extra_sensor()) {
        let Some(judged) = result.evaluation.headline() else {
            continue;
        };
        page.heading(format!("Scenario: {}", result.title));
        // Shared stages only; a stage with one class cannot be wrong.
        let shown = |stage: &&StageScore| {
            stage.actuator.is_none() && stage.score.classes.len() > 1 && decides(stage)
        };
        page.beside(|page| {
            for stage in judged.stages.iter().filter(shown) {
                let class = |name: &String| spoken(words.class(stage.question, name));
                let classes = stage.score.classes.iter().map(class).collect();
                let counts = stage.score.confusion.clone();
                let within = match &stage.command {
                    Some(command) => format!(", failures that call for “{}”", spoken(command)),
                    None => String::new(),
                };
                page.figure(
                    format!("confusion_{}_{}", result.subject.name(), stage.id),
                    ConfusionMatrix::new("", classes, counts).draw(),
                    format!(
                        "Tree {}{within}: rows are the truth, columns what was said of variants \
                         not seen in training ({}).",
                        stage.id, judged.title
                    ),
                );
            }
        });
    }
}
