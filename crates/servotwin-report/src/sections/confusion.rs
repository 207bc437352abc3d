//! Confusion matrices.

use crate::Material;
use crate::lines::decides;
use crate::words::spoken;
use servotwin::learn::protocol::StageScore;
use servotwin_view::document::Document;
use servotwin_view::value_map::ValueMap;

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
                let classes: Vec<String> = stage.score.classes.iter().map(class).collect();
                let within = match &stage.action {
                    Some(action) => format!(", failures that call for “{}”", spoken(action)),
                    None => String::new(),
                };
                page.figure(
                    format!("confusion_{}_{}", result.subject.name(), stage.id),
                    matrix(classes, &stage.score.confusion).draw(),
                    format!(
                        "Tree {}{within}: each row is a true class with its number of variants, each \
                         column the answer, for variants not seen in training ({}).",
                        stage.id, judged.title
                    ),
                );
            }
        });
    }
}

/// The share of each answer among the variants of each true class.
fn matrix(classes: Vec<String>, counts: &[Vec<u64>]) -> ValueMap {
    let total = |row: &Vec<u64>| row.iter().sum::<u64>();
    let share = |count: u64, of: u64| (of > 0).then(|| 100.0 * count as f64 / of as f64);
    let shares = |row: &Vec<u64>| row.iter().map(|&count| share(count, total(row))).collect();
    let named = |(class, row): (&String, &Vec<u64>)| format!("{class} ({})", total(row));
    ValueMap {
        rows: classes.iter().zip(counts).map(named).collect(),
        columns: classes,
        values: counts.iter().map(shares).collect(),
        range: (0.0, 100.0),
        digits: 1,
        meaning: "share of the true class / %".into(),
        ..ValueMap::default()
    }
}
