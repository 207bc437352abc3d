//! Splits that would have been better but that no sensor could resolve.

use crate::report::page::{Grid, Page, Side};
use crate::report::words::{number, of_unit, share};
use crate::report::{Material, Section};
use crate::study::campaign::data_features;

/// See the module.
pub struct Implausible;

impl Section for Implausible {
    fn id(&self) -> &'static str {
        "implausible"
    }

    fn title(&self) -> &'static str {
        "Implausible splits"
    }

    fn write(&self, material: &Material, page: &mut Page) {
        let limits = |result: &crate::job::results::SubjectResult| {
            result.settings.training.resolutions.len()
        };
        if material.results.subjects.iter().all(|result| limits(result) == 0) {
            page.text(
                "No feature had a resolution set for this evaluation, so no split was refused as \
                 lying inside the sensors' noise. (The seed paper took the drain sensor out by hand.)",
            );
            return;
        }
        let units = data_features(material.study);
        for result in &material.results.subjects {
            let implausible = &result.evaluation.implausible;
            let mut grid = Grid::new([
                ("tree", Side::Left),
                ("node", Side::Right),
                ("refused question", Side::Left),
                ("impurity it would remove", Side::Right),
                ("the used one removes", Side::Right),
            ]);
            for split in &implausible.splits {
                let known = units.iter().find(|known| known.feature.name == split.feature);
                let unit = known.map_or("", |known| known.feature.unit);
                grid.push(vec![
                    split.stage.clone(),
                    split.node.to_string(),
                    format!("{} ≤ {}", split.feature, of_unit(split.threshold, unit)),
                    number(split.decrease),
                    number(split.used_decrease),
                ]);
            }
            match grid.is_empty() {
                true => page.text(&format!(
                    "Setting: {}. {} features have a resolution; no better split had to be refused.",
                    result.title,
                    limits(result)
                )),
                false => page.table(&grid, &format!(
                    "Setting: {}. Splits refused because they lie inside sensor noise, quantisation \
                     or numerical error.",
                    result.title
                )),
            }
            for (stage, pair) in [("A", implausible.actuator), ("B", implausible.command)] {
                if let Some((forbidden, allowed)) = pair {
                    page.text(&format!(
                        "Stage {stage}, grouped: {} without them, {} with them.",
                        share(Some(forbidden)),
                        share(Some(allowed))
                    ));
                }
            }
        }
    }
}
