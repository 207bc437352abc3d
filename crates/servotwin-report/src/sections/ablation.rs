//! Ablation: the diagnosis on new commands with parts taken away.

use crate::Material;
use crate::words::{NONE, share, spoken, stacked};
use servotwin::campaign::data_features;
use servotwin_diagnosis::features::{self, Family};
use servotwin_view::document::{Document, Table};

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    let mut families = Table::headed(["family", "what it computes"]);
    let words = material.words();
    let known = data_features(material.study);
    let has = |family: &&&dyn Family| known.iter().any(|one| one.family == family.name());
    for family in features::ALL.iter().filter(has) {
        families.push(vec![family.name().into(), words.adapted(family.summary())]);
    }
    let mut tables = vec![];
    for result in &material.results.subjects {
        let mut heads = vec!["variation".to_owned(), "features".to_owned()];
        if words.has_several() {
            heads.push("A".to_owned());
        }
        heads.push("B".to_owned());
        heads.push("end to end".to_owned());
        if words.has_several() {
            let head = format!("most often given to the wrong {}", words.unit());
            heads.push(head);
        }
        let mut grid = Table::headed(heads);
        for row in &result.evaluation.ablation {
            // Without features of individual actuators, only stage A can be asked.
            let asked = row.command.is_some_and(|rate| rate.count > 0);
            let worst = row.worst_component.as_ref().filter(|(_, rate)| rate.count > 0);
            let mut cells = vec![words.adapted(&row.title), row.features.to_string()];
            cells.extend(words.has_several().then(|| share(row.actuator)));
            cells.push(share(row.command.filter(|_| asked)));
            cells.push(stacked(row.end_to_end.filter(|_| asked)));
            cells.extend(words.has_several().then(|| {
                worst.map_or(NONE.into(), |(name, rate)| {
                    format!("{} {}", spoken(name), share(Some(*rate)))
                })
            }));
            grid.push(cells);
        }
        if !grid.is_empty() {
            tables.push((result, grid));
        }
    }
    if tables.is_empty() {
        return;
    }
    page.table("", families.captioned("Families of features."));
    for (result, grid) in tables {
        page.table("", grid.captioned(format!(
                "Scenario: {}. New commands (without training commands: faults unseen at their \
                 intensity) with families of features alone, added one after the other and left out{}; \
                 and with other depths.",
                result.title,
                words.several("; without mirror images and shared trees")
            )));
    }
}
