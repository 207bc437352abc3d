//! Table 1 of the seed paper, and the physical meaning of each fault.

use crate::Material;
use crate::words::{spoken, three_digits};
use servotwin::study::{Class, FaultCase, Study};
use servotwin_view::document::{Document, Table};

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    let study = material.study;
    if study.faults.is_empty() {
        return;
    }
    let mut grid = Table::headed(["action", "failure", "components", "faults"]);
    for (class, faults) in rows(study) {
        let counts = [class.components(), faults].map(|count| count.to_string());
        grid.push([spoken(&class.action), spoken(&class.detail)].into_iter().chain(counts));
    }
    let [components, faults] = sum(study).map(|count| count.to_string());
    let words = material.words();
    let head = match words.has_several() {
        true => format!("sum (× {})", study.actuators.len()),
        false => "sum".into(),
    };
    grid.push_strong(vec![head, String::new(), components, faults]);
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

/// Each class with its number of faults in one actuator, counting every intensity.
fn rows(study: &Study) -> impl Iterator<Item = (&Class, usize)> {
    let of = |class: usize| {
        let own = |fault: &&FaultCase| fault.class == class && fault.actuator == 0;
        study.faults.iter().filter(own).count()
    };
    study.classes.iter().enumerate().map(move |(place, class)| (class, of(place)))
}

/// The components and the faults of all actuators.
fn sum(study: &Study) -> [usize; 2] {
    let components: usize = study.classes.iter().map(Class::components).sum();
    [components * study.actuators.len(), study.faults.len()]
}

/// The first fault case of each kind, in the order of the classes.
fn kinds(study: &Study) -> Vec<&FaultCase> {
    let mut kinds: Vec<&FaultCase> = vec![];
    for fault in &study.faults {
        if kinds.iter().all(|known| known.kind != fault.kind) {
            kinds.push(fault);
        }
    }
    kinds
}

fn physical(study: &Study) -> Table {
    let mut grid =
        Table::headed(["fault", "meaning", "parameter", "healthy", "intensity 1", "unit"]);
    let all = study.system.fault_list();
    for kind in kinds(study) {
        let Some(fault) = all.iter().find(|fault| fault.id == kind.id) else { continue };
        // Without the actuator.
        let at = fault.id.rmatch_indices('.').nth(1).map_or(0, |(dot, _)| dot + 1);
        let unit = fault.unit;
        grid.push(vec![
            spoken(&fault.id[at..]),
            fault.summary.into(),
            spoken(fault.parameter.trim_end_matches(unit.suffix())),
            three_digits(unit.to_shown(fault.healthy)),
            three_digits(unit.to_shown(fault.full)),
            unit.shown().into(),
        ]);
    }
    grid
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_1_is_that_of_the_seed_paper() {
        let study = Study::default();
        let expected = [
            ("shut_down", "external_leakage", 4, 40),
            ("shut_down", "control_valve", 1, 100),
            ("shut_down", "supply_valve", 1, 10),
            ("shut_down", "tank_valve", 1, 10),
            ("change_mode", "cylinder_pressure_sensor", 2, 80),
            ("change_mode", "displacement_sensor", 1, 40),
            ("warning", "internal_leakage", 1, 10),
            ("warning", "valve_displacement_sensor", 1, 40),
            ("warning", "supply_tank_pressure_sensor", 2, 80),
        ];
        let found: Vec<_> = rows(&study)
            .map(|(class, faults)| (&*class.action, &*class.detail, class.components(), faults))
            .collect();
        assert_eq!(found, expected);
        assert_eq!(sum(&study), [28, 820]);
        assert_eq!(study.cases.len() * study.faults.len(), 4920);
    }
}
