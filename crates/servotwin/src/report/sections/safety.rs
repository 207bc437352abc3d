//! What errors would do to the aircraft, by name.

use crate::evaluation::protocol::{Protocol, ProtocolResult};
use crate::evaluation::score::Rate;
use crate::report::lines::{PROTOCOLS, SAFETY};
use crate::report::page::{Grid, Page, Side};
use crate::report::words::{rate, share, spoken};
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
        for result in &material.results.subjects {
            let mut heads = vec![("", Side::Left)];
            heads.extend(PROTOCOLS.map(|(_, head)| (head, Side::Right)));
            let mut grid = Grid::new(heads);
            for line in &SAFETY {
                let mut row = vec![line.title.to_owned()];
                let of = |(protocol, _)| rate(line.of(&result.evaluation, protocol));
                row.extend(PROTOCOLS.map(of));
                grid.push(row);
            }
            page.table(&grid, &format!("Setting: {}. Share of detected faults.", result.title));
            if let Some(alarms) = &result.evaluation.false_alarms {
                page.text(&format!(
                    "Of {} fault-free specimens {} give an alarm, and the trees would shut down {}.",
                    alarms.alarms.of,
                    rate(Some(alarms.alarms)),
                    rate(Some(alarms.tree_shutdowns))
                ));
            }
            if let Some(grouped) = result.evaluation.protocol(Protocol::Grouped) {
                components(grouped, &result.title, page);
            }
        }
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
            share(Some(component.right)),
        ]);
    }
    if !grid.is_empty() {
        page.table(&grid, &format!(
            "Setting: {title}, grouped. Errors by the component that is broken, the worst first."
        ));
    }
}
