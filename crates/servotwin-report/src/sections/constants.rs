//! The constants of the diagnosis in operation, with where their values come from.

use crate::Material;
use crate::vocabulary::Vocabulary;
use crate::words::three_digits;
use servotwin::study::Scenario;
use servotwin_diagnosis::diagnoser::tuning::Constant;
use servotwin_view::document::{Document, Table};

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    let words = &material.words();
    for (scenarios, constants) in grouped(material.constants) {
        let names: Vec<&str> = scenarios.iter().map(|scenario| scenario.name()).collect();
        page.table("", grid(constants, words).captioned(format!(
                "The constants of the diagnoser, scenario {}. Physical: from what {}s, sensors and computers \
                 are. Statistical: from an error rate, odds or a criterion of statistics. Tuned: the best of several \
                 in flights of a seed that no evaluation uses.",
                names.join(" and "),
                words.actuator()
            )));
    }
}

/// The scenarios whose diagnosers have the same constants, with these.
fn grouped(all: &[(Scenario, Vec<Constant>)]) -> Vec<(Vec<Scenario>, &[Constant])> {
    let mut groups: Vec<(Vec<Scenario>, &[Constant])> = vec![];
    for (scenario, constants) in all {
        match groups.iter_mut().find(|(_, known)| known == constants) {
            Some((scenarios, _)) => scenarios.push(*scenario),
            None => groups.push((vec![*scenario], constants)),
        }
    }
    groups
}

fn grid(constants: &[Constant], words: &Vocabulary) -> Table {
    let mut grid = Table::headed(["constant", "value", "", "meaning", "source"]);
    for constant in constants {
        let value = format!("{} {}", three_digits(constant.value), constant.unit);
        grid.push(vec![
            constant.name.replace('_', " "),
            value.trim_end().into(),
            constant.label(),
            words.adapted(constant.meaning),
            constant.source.into(),
        ]);
    }
    grid
}
