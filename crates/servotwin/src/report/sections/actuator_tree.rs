//! The tree that finds the failed actuator (figure 9 of the seed paper), and the others.

use crate::report::page::{Grid, Page, Side};
use crate::report::words::{percent, unit};
use crate::report::{Material, Section, stages};
use crate::study::campaign::data_features;
use servotwin_diagnosis::features::Feature;
use servotwin_diagnosis::hierarchy::{Hierarchy, Question};

/// See the module.
pub struct ActuatorTree;

impl Section for ActuatorTree {
    fn id(&self) -> &'static str {
        "trees"
    }

    fn title(&self) -> &'static str {
        "The trees"
    }

    fn write(&self, material: &Material, page: &mut Page) {
        let Some(result) = material.main() else {
            return;
        };
        let Some(hierarchy) = material.hierarchy(result.subject) else {
            return;
        };
        let features: Vec<Feature> =
            data_features(material.study).into_iter().map(|known| known.feature).collect();
        page.text(&format!(
            "Setting: {}, trained with everything there is to learn from. How often the answer to each \
             question hangs on less than a sensor shows stands under “Answers that hang on less than a \
             sensor shows”.",
            result.title
        ));
        for stage in &hierarchy.stages {
            let Some(drawing) = stages::drawing(hierarchy, stage, &features) else {
                continue;
            };
            let asks = match stage.place.question {
                Question::Actuator => "which actuator has failed (figure 9 of the seed paper)",
                Question::Command => "what the flight control computer must do",
                Question::Detail => "which component is at fault, within one command",
            };
            page.figure(&format!("tree_{}", stage.id), drawing.draw(), &format!(
                "Tree {}: {asks}. A variant goes left where the answer is yes; n counts training \
                 variants (and their mirror images), purity is the share of the most frequent class.",
                stage.id
            ));
        }
        page.table(
            &meanings(hierarchy, &features),
            "The features that the trees ask for. “Of \
             scale” means: of the sensor's scale in the table above.",
        );
        let mut grid = Grid::new([
            ("tree", Side::Left),
            ("nodes", Side::Right),
            ("depth", Side::Right),
            ("what carries it (share of the impurity removed)", Side::Left),
        ]);
        for stage in &result.evaluation.stages {
            let count = |value: Option<usize>| value.map_or("–".into(), |v| v.to_string());
            let best = stage.importances.iter().take(4);
            let best = best.map(|(name, share)| format!("{name} {}", percent(Some(*share))));
            let best = best.collect::<Vec<_>>().join(", ");
            grid.push(vec![stage.stage.clone(), count(stage.nodes), count(stage.depth), best]);
        }
        page.table(&grid, "The trees' sizes: what would be flown.");
    }
}

fn meanings(hierarchy: &Hierarchy, features: &[Feature]) -> Grid {
    let mut asked: Vec<&str> = vec![];
    for stage in &hierarchy.stages {
        for name in stages::asked(hierarchy, stage) {
            if !asked.contains(&name) {
                asked.push(name);
            }
        }
    }
    let mut grid =
        Grid::new([("feature", Side::Left), ("unit", Side::Left), ("meaning", Side::Left)]);
    for feature in features.iter().filter(|known| asked.contains(&known.name.as_str())) {
        let unit = unit(feature.unit).to_owned();
        grid.push(vec![feature.name.clone(), unit, feature.meaning.clone()]);
    }
    grid
}
