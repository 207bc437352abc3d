//! What carries the result: new commands with parts taken away.

use crate::report::page::{Grid, Page, Side};
use crate::report::words::{NONE, rate, share, spoken};
use crate::report::{Material, Section};
use servotwin_diagnosis::features;

/// See the module.
pub struct Ablation;

impl Section for Ablation {
    fn id(&self) -> &'static str {
        "ablation"
    }

    fn title(&self) -> &'static str {
        "What carries the result"
    }

    fn write(&self, material: &Material, page: &mut Page) {
        let mut families = Grid::new([("family", Side::Left), ("what it computes", Side::Left)]);
        for family in features::ALL {
            families.push(vec![family.name().into(), family.summary().into()]);
        }
        let mut tables = vec![];
        for result in &material.results.subjects {
            let mut grid = Grid::new([
                ("variation", Side::Left),
                ("features", Side::Right),
                ("A", Side::Right),
                ("B", Side::Right),
                ("end to end", Side::Right),
                ("most often given to the wrong actuator", Side::Left),
            ]);
            for row in &result.evaluation.ablation {
                // Without a feature of one actuator alone, only A can be asked.
                let asked = row.command.is_some_and(|rate| rate.count > 0);
                let worst = row.worst_component.as_ref().filter(|(_, rate)| rate.count > 0);
                grid.push(vec![
                    row.title.clone(),
                    row.features.to_string(),
                    share(row.actuator),
                    share(row.command.filter(|_| asked)),
                    rate(row.end_to_end.filter(|_| asked)),
                    worst.map_or(NONE.into(), |(name, rate)| {
                        format!("{} {}", spoken(name), share(Some(*rate)))
                    }),
                ]);
            }
            if !grid.is_empty() {
                tables.push((result, grid));
            }
        }
        if tables.is_empty() {
            return;
        }
        page.table(&families, "Families of features.");
        for (result, grid) in tables {
            page.table(&grid, &format!(
                "Setting: {}. New commands (without training commands: faults unseen at their \
                 intensity) with families of features alone, added one after the other and left out; \
                 without mirror images and shared trees; and with other depths.",
                result.title
            ));
        }
    }
}
