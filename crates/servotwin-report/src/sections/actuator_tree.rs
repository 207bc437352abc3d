//! The tree that finds the failed actuator (figure 9 of the seed paper), and the other trees of every scenario.

use crate::vocabulary::Vocabulary;
use crate::words::{percent, spoken, unit};
use crate::{Material, stages};
use servotwin::records::data_features;
use servotwin_diagnosis::features::Feature;
use servotwin_diagnosis::hierarchy::{Hierarchy, Question, Stage};
use servotwin_view::document::{Document, Table};

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    let Some(result) = material.main() else {
        return;
    };
    let Some(hierarchy) = material.hierarchy(result.subject) else {
        return;
    };
    let features: Vec<Feature> =
        data_features(material.study).into_iter().map(|known| known.feature).collect();
    let (words, looks) = (material.words(), material.looks());
    page.text(format!(
            "Scenario: {}, trained with everything there is to learn from. How often the answer to each \
             question hangs on less than a sensor shows stands under “Answers that hang on less than a \
             sensor shows”. A tree goes up where the answer is yes; n counts training variants{}, \
             purity is the share of the most frequent class. Large trees are scrolled.",
            result.title,
            words.several(" (and their mirror images)")
        ));
    let draw = |hierarchy: &Hierarchy, name: &str, title: &str, page: &mut Document| {
        for stage in &hierarchy.stages {
            let Some(drawing) = stages::drawing(hierarchy, stage, &features, &words, &looks) else {
                continue;
            };
            if !stages::decides(stage) {
                page.text(format!(
                        "Scenario: {title}. Tree {} asks nothing: where it was learned, nothing healthy left \
                         the bands.",
                        stage.id
                    ));
                continue;
            }
            let caption =
                format!("Tree {}, {title}: {}.", stage.id, asks(hierarchy, stage, &words));
            page.wide_figure(format!("tree_{name}{}", stage.id), drawing.draw(), caption);
        }
    };
    draw(hierarchy, "", &result.title, page);
    for other in material.results.subjects.iter().filter(|r| r.subject != result.subject) {
        let Some(hierarchy) = material.hierarchy(other.subject) else { continue };
        page.folded(&format!("The trees of scenario {}", other.title), |page| {
            draw(hierarchy, &format!("{}_", other.subject.name()), &other.title, page);
        });
    }
    page.table(
        "",
        meanings(hierarchy, &features, &words).captioned(
            "The features that the trees ask for. “Of \
             scale” means: of the sensor's scale in the table above.",
        ),
    );
    let mut grid = Table::headed([
        "tree",
        "nodes",
        "depth",
        "what carries it (share of the impurity removed)",
    ]);
    for stage in &result.evaluation.stages {
        let count = |value: Option<usize>| value.map_or("–".into(), |v| v.to_string());
        let best = stage.importances.iter().take(4);
        let best = best.map(|(name, share)| format!("{name} {}", percent(Some(*share))));
        let best = best.collect::<Vec<_>>().join(", ");
        grid.push(vec![stage.stage.clone(), count(stage.nodes), count(stage.depth), best]);
    }
    page.table(
        "",
        grid.captioned(format!(
            "The trees' sizes, scenario {}: what would be at work.",
            result.title
        )),
    );
}

fn asks(hierarchy: &Hierarchy, stage: &Stage, words: &Vocabulary) -> String {
    match stage.place.question {
        Question::Actuator if !words.has_several() => "whether something is wrong".into(),
        Question::Actuator => format!(
            "which {} has failed{}",
            words.actuator(),
            words.paper(" (figure 9 of the seed paper)")
        ),
        Question::Action => "what must be done".into(),
        Question::Detail => match stage.place.action {
            Some(action) => {
                let action = spoken(&hierarchy.names.actions[action as usize]);
                format!("what is broken, within the action “{action}”")
            }
            None => "what is broken, within one action".into(),
        },
    }
}

fn meanings(hierarchy: &Hierarchy, features: &[Feature], words: &Vocabulary) -> Table {
    let of_stages = hierarchy.stages.iter().map(|stage| stages::asked(hierarchy, stage));
    let asked: Vec<&str> = of_stages.flatten().collect();
    let mut grid = Table::headed(["feature", "unit", "meaning"]);
    for feature in features.iter().filter(|known| asked.contains(&known.name.as_str())) {
        let unit = unit(feature.unit).to_owned();
        grid.push(vec![feature.name.clone(), unit, words.adapted(&feature.meaning)]);
    }
    grid
}
