//! The least pure leaves, and the classes in them.

use crate::Material;
use crate::page::{Alignment, HtmlTable, Page};
use crate::words::{of_unit, percent, spoken};
use servotwin::campaign::data_features;
use servotwin::evaluation::leaves::{Condition, Content};
use servotwin_diagnosis::hierarchy::{Question, StagePlace};

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Page) {
    let units = data_features(material.study);
    let words = material.words();
    let first = StagePlace { question: Question::Actuator, actuator: None, action: None }.id();
    let class = |stage: &str, name| match stage == first {
        true => words.class(Question::Actuator, name),
        false => name,
    };
    let condition = |condition: &Condition| {
        let known = units.iter().find(|known| known.feature.name == condition.feature);
        let unit = known.map_or("", |known| known.feature.unit);
        let sign = if condition.above { ">" } else { "≤" };
        format!("{} {sign} {}", condition.feature, of_unit(condition.threshold, unit))
    };
    for result in &material.results.subjects {
        let mut grid = HtmlTable::new([
            ("tree", Alignment::Left),
            ("answer", Alignment::Left),
            ("purity", Alignment::Right),
            ("variants", Alignment::Right),
            ("because", Alignment::Left),
            ("holds", Alignment::Left),
        ]);
        for leaf in &result.evaluation.worst_leaves {
            let because: Vec<String> = leaf.conditions.iter().map(condition).collect();
            grid.push(vec![
                leaf.stage.clone(),
                spoken(class(&leaf.stage, &leaf.class)),
                percent(Some(leaf.purity)),
                leaf.rows.to_string(),
                because.join(", "),
                contents(&leaf.contents, &|name| class(&leaf.stage, name)),
            ]);
        }
        if grid.is_empty() {
            page.text(&format!("Setting: {}. Every leaf holds one class only.", result.title));
        } else {
            page.table(
                &grid,
                &format!(
                    "Setting: {}. Leaves that hold more than one class: where the trees guess.",
                    result.title
                ),
            );
        }
    }
}

fn contents<'c>(contents: &'c [Content], class: &dyn Fn(&'c str) -> &'c str) -> String {
    let shown = contents.iter().take(5);
    let one =
        |c: &'c Content| format!("{} × {} ({})", c.rows, spoken(&c.kind), spoken(class(&c.class)));
    let mut texts: Vec<String> = shown.map(one).collect();
    if contents.len() > texts.len() {
        texts.push(format!("{} more", contents.len() - texts.len()));
    }
    texts.join("; ")
}
