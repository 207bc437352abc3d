//! Splits that would have been better but that no sensor could resolve.

use crate::report::page::{Grid, Page, Side};
use crate::report::words::{number, of_unit, percent, share};
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
        page.text(
            "A threshold that lies inside sensor noise, quantisation or numerical error decides about \
             nothing that a real sensor could measure. The seed paper took one sensor out by hand for \
             this; here every feature has a resolution, and no tree asks for less. These are the \
             questions that were refused, and what they would have bought.",
        );
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
            let error = percent(Some(implausible.residual_error));
            if grid.is_empty() {
                page.text(&format!(
                    "Setting: {}. With an error of {error} of scale no split had to be refused.",
                    result.title
                ));
                continue;
            }
            page.table(&grid, &format!(
                "Setting: {}. Splits that the rule refuses where residuals carry an error of {error} \
                 of scale, at most three of a node.",
                result.title
            ));
            for (stage, pair) in [("A", implausible.actuator), ("B", implausible.command)] {
                if let Some((forbidden, allowed)) = pair {
                    page.text(&format!(
                        "Stage {stage}, grouped: {} where such splits are refused, {} where they are allowed.",
                        share(Some(forbidden)),
                        share(Some(allowed))
                    ));
                }
            }
        }
    }
}
