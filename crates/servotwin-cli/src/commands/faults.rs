//! The list of every fault that the components of a system can have.

use crate::Global;
use crate::render::{Side, TextTable, json, number};
use serde_json::json;
use servotwin::system::listing::fault_table;
use servotwin::system::{ListedFault, System};
use servotwin::table::csv;

/// The list for people, or as JSON or CSV with numbers in SI units.
pub(super) fn text(system: &System, is_csv: bool, global: Global) -> String {
    let lines = system.fault_list();
    match global.json {
        true => json(&lines.iter().map(as_json).collect()),
        false if is_csv => csv_text(&lines),
        false => people(&lines),
    }
}

fn as_json(line: &ListedFault) -> serde_json::Value {
    json!({
        "id": line.id,
        "component": line.component,
        "kind": line.kind,
        "category": line.category,
        "intensity": [0, 1],
        "parameter": line.parameter,
        "unit": line.unit.symbol(),
        "healthy": line.healthy,
        "at_intensity_1": line.full,
        "summary": line.summary,
    })
}

fn csv_text(lines: &[ListedFault]) -> String {
    let mut text = Vec::new();
    csv::write_to(&mut text, &fault_table(lines)).expect("writing to memory does not fail");
    String::from_utf8(text).expect("a CSV table is UTF-8")
}

fn people(lines: &[ListedFault]) -> String {
    let mut grid = TextTable::new(&[
        ("fault", Side::Left),
        ("category", Side::Left),
        ("healthy", Side::Right),
        ("at intensity 1", Side::Right),
        ("unit", Side::Left),
        ("meaning", Side::Left),
    ]);
    for line in lines {
        grid.push(vec![
            line.id.clone(),
            line.category.into(),
            number(line.unit.to_shown(line.healthy), 5),
            number(line.unit.to_shown(line.full), 5),
            line.unit.shown().into(),
            line.summary.into(),
        ]);
    }
    format!("{}{} faults; intensities go from 0 (healthy) to 1.\n", grid.text(), lines.len())
}
