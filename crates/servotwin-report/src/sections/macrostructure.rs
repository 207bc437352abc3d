//! The structure of the hierarchy of trees (figure 10 of the seed paper).

use crate::looks::Looks;
use crate::words::{share, spoken};
use crate::{Material, stages};
use servotwin::learn::protocol::ProtocolResult;
use servotwin_diagnosis::hierarchy::{Hierarchy, Question, Stage, StagePlace};
use servotwin_view::SemanticColor;
use servotwin_view::document::Document;
use servotwin_view::schematic::{Net, NetEnd, Part, Schematic};

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    let Some(result) = material.main() else {
        return;
    };
    let Some(hierarchy) = material.hierarchy(result.subject) else {
        return;
    };
    let judged = result.evaluation.headline();
    let shared = hierarchy
        .stages
        .iter()
        .any(|stage| stage.place.question != Question::Actuator && stage.place.actuator.is_none());
    let count = hierarchy.names.actuators.len();
    let words = material.words();
    let remark = match shared && count > 1 {
        true => format!(
            " All {} share the trees below A: what one learns serves the others.",
            words.actuators()
        ),
        false => String::new(),
    };
    page.figure("macrostructure", schematic(hierarchy, judged, &material.looks()).draw(), format!(
            "Scenario: {}. From residuals to the failure{}, with the accuracy of each tree on variants it has not seen ({}).{remark}",
            result.title,
            words.paper(" (figure 10 of the seed paper)"),
            judged.map_or("–", |judged| judged.title.as_str()),
        ));
}

/// The drawing: residuals, the tree of actuators, then a band for each actuator with its trees and their classes.
fn schematic(hierarchy: &Hierarchy, judged: Option<&ProtocolResult>, looks: &Looks) -> Schematic {
    let names = &hierarchy.names;
    // Parts of an action have the color of that action.
    let actions =
        names.actions.iter().map(|name| (spoken(name), looks.class(Question::Action, name)));
    let plain = [("tree", 0), ("residuals", 1)];
    let plain = plain.map(|(kind, place)| (kind.to_owned(), SemanticColor::Plain(place).look()));
    let kinds = plain.into_iter().chain(actions).collect();
    let actuators = names.actuators.iter().map(|name| spoken(name));
    let groups = [String::new()].into_iter().chain(actuators).collect();
    let mut drawn = Schematic { kinds, groups, ..Schematic::default() };
    let mut first = add(&mut drawn, ("residuals", "features of\nresiduals"), 1, (0, 0));
    let is_first = |stage: &&Stage| stage.place.question == Question::Actuator;
    let asked = hierarchy.stages.iter().find(is_first).is_some_and(stages::decides);
    if asked || names.actuators.len() > 1 {
        let asks = if names.actuators.len() > 1 { "which one" } else { "faulty?" };
        let tree =
            add(&mut drawn, ("A", &format!("A  {asks}\n{}", accuracy(judged, "A"))), 0, (0, 1));
        join(&mut drawn, first, &[tree]);
        first = tree;
    }
    let actuators = 0..names.actuators.len();
    let trees: Vec<usize> =
        actuators.map(|actuator| add_actuator(&mut drawn, hierarchy, judged, actuator)).collect();
    join(&mut drawn, first, &trees);
    drawn
}

/// Adds the trees of an actuator, and returns the one of its actions.
fn add_actuator(
    drawn: &mut Schematic,
    hierarchy: &Hierarchy,
    judged: Option<&ProtocolResult>,
    actuator: usize,
) -> usize {
    let id = |question, action| {
        let several = hierarchy.names.actuators.len() > 1;
        StagePlace { question, actuator: several.then_some(actuator as u32), action }.id()
    };
    let own = id(Question::Action, None);
    let text = format!("{own}  action\n{}", accuracy(judged, &own));
    let tree = add(drawn, (&own, &text), 0, (actuator + 1, 2));
    let mut below = vec![];
    for (action, title) in hierarchy.names.actions.iter().enumerate() {
        let Some(stage) = hierarchy.stage(Question::Detail, actuator as u32, action as u32) else {
            continue;
        };
        let id = id(Question::Detail, Some(action as u32));
        let text = format!("{id}  {}\n{}", spoken(title), accuracy(judged, &id));
        let causes = add(drawn, (&id, &text), 2 + action, (actuator + 1, 3));
        let leaves = (format!("{id} details"), details(hierarchy, stage));
        let leaves = add(drawn, (&leaves.0, &leaves.1), 2 + action, (actuator + 1, 4));
        join(drawn, causes, &[leaves]);
        below.push(causes);
    }
    join(drawn, tree, &below);
    tree
}

/// Adds a part, and returns its index.
fn add(
    drawn: &mut Schematic,
    (id, text): (&str, &str),
    kind: usize,
    (group, column): (usize, usize),
) -> usize {
    drawn.parts.push(Part { id: id.into(), text: text.into(), kind, group, column });
    drawn.parts.len() - 1
}

/// Leads arrows from a part to others.
fn join(drawn: &mut Schematic, from: usize, to: &[usize]) {
    let end = |part: usize| NetEnd { part, port: String::new(), arrow: part != from };
    let ends: Vec<NetEnd> = [from].iter().chain(to).map(|part| end(*part)).collect();
    drawn.nets.extend((!to.is_empty()).then_some(Net { kind: 0, ends }));
}

fn details(hierarchy: &Hierarchy, stage: &Stage) -> String {
    let name = |&class: &u32| spoken(&hierarchy.names.details[class as usize]);
    stage.classes.iter().map(name).collect::<Vec<_>>().join("\n")
}

fn accuracy(judged: Option<&ProtocolResult>, id: &str) -> String {
    share(judged.and_then(|result| result.stage(id)).map(|score| score.accuracy))
}
