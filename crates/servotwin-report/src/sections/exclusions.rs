//! Variants that were left out, with counts.

use crate::Material;
use crate::words::three_digits;
use servotwin_view::document::{Document, Table};

/// The maximum number of failed variants listed one by one.
const SHOWN: usize = 50;

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    let words = material.words();
    let mut grid = Table::headed([
        "data set",
        "for",
        "variants",
        "without a fault",
        "undetectable",
        "not simulated to the end",
        "faults left",
    ]);
    for set in &material.manifest.data_sets {
        let used = set.variants - set.healthy - set.undetectable - set.failed.len();
        let mut row = vec![
            set.scenario.clone(),
            if set.is_training { "learning" } else { "judging" }.into(),
            set.variants.to_string(),
        ];
        let counts = [set.healthy, set.undetectable, set.failed.len(), used];
        row.extend(counts.map(|count| count.to_string()));
        grid.push(row);
    }
    let note = format!("Variants by what became of them; undetectable by {}.", words.fixed_band());
    if !grid.is_empty() {
        page.table("", grid.captioned(note));
    }
    for set in material.manifest.data_sets.iter().filter(|set| !set.failed.is_empty()) {
        let mut grid = Table::headed(["variant", "fault", "intensity", "case", "reason"]);
        for failed in set.failed.iter().take(SHOWN) {
            grid.push(vec![
                failed.variant.to_string(),
                failed.fault.clone(),
                three_digits(failed.intensity),
                failed.case.clone(),
                failed.reason.clone(),
            ]);
        }
        page.table(
            "",
            grid.captioned(format!(
                "{}: variants that could not be simulated to the end ({} in all).",
                set.scenario,
                set.failed.len()
            )),
        );
    }
    for result in &material.results.subjects {
        let constant = &result.evaluation.constant_features;
        if !constant.is_empty() {
            page.text(format!(
                "Scenario: {}. Features that never change, and so say nothing: {}.",
                result.title,
                constant.join(", ")
            ));
        }
    }
}
