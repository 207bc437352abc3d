//! Table 1 of the seed paper, and the physical meaning of each fault.

use crate::words::{number, spoken};
use crate::{Material, table};
use servotwin::study::Study;
use servotwin_model::program::FaultAt;
use servotwin_view::document::{Document, Table};

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    let study = material.study;
    if study.faults.is_empty() {
        return;
    }
    let mut grid = Table::headed(["action", "failure", "components", "faults"]);
    let rows = table::rows(study);
    for row in &rows {
        let (components, faults) = (row.components.to_string(), row.faults.to_string());
        grid.push(vec![spoken(&row.action), spoken(&row.detail), components, faults]);
    }
    let sum = table::sum(study);
    let words = material.words();
    let head = match words.has_several() {
        true => format!("sum (× {})", study.actuators.len()),
        false => "sum".into(),
    };
    grid.push_strong(vec![head, String::new(), sum.0.to_string(), sum.1.to_string()]);
    page.table(
        "",
        grid.captioned(format!(
            "What can fail{}, and what must be done then{}. Each kind of fault has {} intensities.",
            match words.has_several() {
                true => format!(" in one of the {} {}", study.actuators.len(), words.actuators()),
                false => String::new(),
            },
            words.paper(" (table 1 of the seed paper)"),
            study.faults.len() / (study.actuators.len() * kinds(study).len()).max(1),
        )),
    );
    page.table(
        "",
        physical(study).captioned(
            "Every kind of fault: the parameter that it changes, healthy \
             and at intensity 1.",
        ),
    );
}

/// The first fault case of each kind, in the order of the classes.
fn kinds(study: &Study) -> Vec<FaultAt> {
    let mut known: Vec<&str> = vec![];
    let mut kinds = vec![];
    for fault in &study.faults {
        if !known.contains(&fault.kind.as_str()) {
            known.push(&fault.kind);
            kinds.push(fault.at);
        }
    }
    kinds
}

fn physical(study: &Study) -> Table {
    let mut grid =
        Table::headed(["fault", "meaning", "parameter", "healthy", "intensity 1", "unit"]);
    let program = &study.system.program;
    let components = &study.system.network().components;
    for at in kinds(study) {
        let instance = &components[at.component];
        let spec = instance.component;
        let declared = &spec.faults[at.fault];
        let Some(place) = spec.parameter(declared.parameter) else {
            continue;
        };
        let unit = spec.parameters[place].unit;
        let value = |faults: &[FaultAt]| {
            number(unit.to_shown(program.parameters(faults)[at.component][place]))
        };
        let name = instance.id.rsplit('.').next().unwrap_or(&instance.id);
        grid.push(vec![
            spoken(&format!("{name}.{}", declared.name)),
            declared.summary.into(),
            spoken(declared.parameter.trim_end_matches(unit.suffix())),
            value(&[]),
            value(&[FaultAt { intensity: 1.0, ..at }]),
            unit.shown().into(),
        ]);
    }
    grid
}
