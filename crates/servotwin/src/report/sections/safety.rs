//! What errors would do to the aircraft, by name.

use crate::evaluation::protocol::{ALL, ProtocolResult};
use crate::evaluation::score::Rate;
use crate::job::results::SubjectResult;
use crate::report::lines::{self, SAFETY, Who};
use crate::report::page::{Grid, Page, Side};
use crate::report::words::{rate, share, spoken, stacked};
use crate::report::{Material, Section};

/// See the module.
pub struct Safety;

impl Section for Safety {
    fn id(&self) -> &'static str {
        "safety"
    }

    fn title(&self) -> &'static str {
        "Safety"
    }

    fn write(&self, material: &Material, page: &mut Page) {
        page.text(
            "Not every error is equally bad. Worst is to shut down the healthy actuator because the \
             other one has a fault: both are then lost. To miss a shutdown leaves a failed actuator \
             in the loop. To shut down where a warning would do costs redundancy.",
        );
        page.text(
            "A fault that is never detected is not shut down either: so missed shutdowns are given \
             twice, of the detected faults that need one and of all that do. Protocols that test some \
             faults several times or not at all have no second figure.",
        );
        if material.study.shutdowns().is_empty() {
            page.note(
                "The study says of no command that it switches its actuator off ([reactions], \
                 switches_off): so there are no figures of safety.",
            );
            return;
        }
        for result in &material.results.subjects {
            page.table(
                &grid(result),
                &format!(
                    "Setting: {}. 95 % intervals from drawing kinds of fault at their intensities.",
                    result.title
                ),
            );
        }
        healthy(material, page);
        for result in lines::settings(material.results) {
            if let Some(headline) = result.evaluation.headline() {
                components(headline, &result.title, page);
            }
        }
    }
}

/// Protocols in rows, trees and committee below each other; measures in columns.
fn grid(result: &SubjectResult) -> Grid {
    let mut heads = vec![("held out", Side::Left), ("by", Side::Left)];
    heads.extend(SAFETY.iter().map(|measure| (measure.title, Side::Right)));
    let mut grid = Grid::new(heads);
    for protocol in ALL {
        for who in Who::ALL {
            let Some(judged) = who.under(&result.evaluation, protocol) else { continue };
            if judged.safety.is_none() {
                continue;
            }
            let title = if who == Who::Trees { judged.title.clone() } else { String::new() };
            let mut row = vec![title, who.title().to_owned()];
            row.extend(SAFETY.iter().map(|measure| stacked((measure.rate)(judged))));
            grid.push(row);
        }
    }
    grid
}

/// What is done with healthy specimens, settings in rows.
fn healthy(material: &Material, page: &mut Page) {
    let mut grid = Grid::new([
        ("setting", Side::Left),
        ("specimens", Side::Right),
        ("alarm", Side::Right),
        ("faulty by trees", Side::Right),
        ("shut down by trees", Side::Right),
        ("faulty by committee", Side::Right),
        ("shut down by committee", Side::Right),
    ]);
    for result in &material.results.subjects {
        let Some(alarms) = &result.evaluation.false_alarms else { continue };
        let mut row = vec![result.title.clone(), alarms.alarms.of.to_string()];
        let rates = [
            alarms.alarms,
            alarms.trees,
            alarms.tree_shutdowns,
            alarms.committee,
            alarms.committee_shutdowns,
        ];
        row.extend(rates.map(|rate| stacked(Some(rate))));
        grid.push(row);
    }
    if !grid.is_empty() {
        page.table(
            &grid,
            "Specimens without a fault, of the judged operating cases: share that leaves the bands in \
             use, and of these who are then taken for faulty or shut down, always of all specimens. \
             Trees and committee may answer “healthy”.",
        );
    }
}

/// The components whose faults are given to the wrong actuator, or not isolated.
fn components(result: &ProtocolResult, title: &str, page: &mut Page) {
    let mut grid = Grid::new([
        ("component", Side::Left),
        ("tests", Side::Right),
        ("wrong actuator", Side::Right),
        ("wrong actuator shut down", Side::Right),
        ("actuator, command and detail right", Side::Right),
    ]);
    let mut list: Vec<_> = result.components.iter().collect();
    let right = |rate: Rate| rate.share.unwrap_or(1.0);
    list.sort_by(|a, b| right(a.right).total_cmp(&right(b.right)));
    for component in list {
        grid.push(vec![
            spoken(&component.component),
            component.right.of.to_string(),
            share(Some(component.wrong_actuator)),
            share(Some(component.wrong_actuator_shutdown)),
            rate(Some(component.right)),
        ]);
    }
    if !grid.is_empty() {
        page.table(&grid, &format!(
            "Setting: {title}; trees; {}. Errors by the component that is broken, the worst first.",
            result.title
        ));
    }
}
