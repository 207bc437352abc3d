//! Variants that were left out, with counts.

use crate::Material;
use crate::page::{Alignment, HtmlTable, Page};
use crate::words::number;

/// The maximum number of failed variants listed one by one.
const SHOWN: usize = 50;

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Page) {
    let words = material.words();
    let mut grid = HtmlTable::new([
        ("data set", Alignment::Left),
        ("for", Alignment::Left),
        ("variants", Alignment::Right),
        ("without a fault", Alignment::Right),
        ("undetectable", Alignment::Right),
        ("not simulated to the end", Alignment::Right),
        ("faults left", Alignment::Right),
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
        page.table(&grid, &note);
    }
    for set in material.manifest.data_sets.iter().filter(|set| !set.failed.is_empty()) {
        let mut grid = HtmlTable::new([
            ("variant", Alignment::Right),
            ("fault", Alignment::Left),
            ("intensity", Alignment::Right),
            ("case", Alignment::Left),
            ("reason", Alignment::Left),
        ]);
        for failed in set.failed.iter().take(SHOWN) {
            grid.push(vec![
                failed.variant.to_string(),
                failed.fault.clone(),
                number(failed.intensity),
                failed.case.clone(),
                failed.reason.clone(),
            ]);
        }
        page.table(
            &grid,
            &format!(
                "{}: variants that could not be simulated to the end ({} in all).",
                set.scenario,
                set.failed.len()
            ),
        );
    }
    for result in &material.results.subjects {
        let constant = &result.evaluation.constant_features;
        if !constant.is_empty() {
            page.text(&format!(
                "Scenario: {}. Features that never change, and so say nothing: {}.",
                result.title,
                constant.join(", ")
            ));
        }
    }
}
