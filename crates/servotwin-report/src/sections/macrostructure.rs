//! The structure of the hierarchy of trees (figure 10 of the seed paper).

use crate::looks::Looks;
use crate::page::Page;
use crate::words::{share, spoken};
use crate::{Material, stages};
use servotwin::evaluation::protocol::ProtocolResult;
use servotwin_diagnosis::hierarchy::{Hierarchy, Question, Stage, StagePlace};
use servotwin_plot::SemanticColor;
use servotwin_plot::diagram::{Block, Diagram, Wire};

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Page) {
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
            words.units()
        ),
        false => String::new(),
    };
    page.figure("macrostructure", diagram(hierarchy, judged, &material.looks()).draw(), &format!(
            "Scenario: {}. From residuals to the failure{}, with the accuracy of each tree on variants it has not seen ({}).{remark}",
            result.title,
            words.paper(" (figure 10 of the seed paper)"),
            judged.map_or("–", |judged| judged.title.as_str()),
        ));
}

fn diagram(hierarchy: &Hierarchy, judged: Option<&ProtocolResult>, looks: &Looks) -> Diagram {
    let names = &hierarchy.names;
    // Blocks of an action have the color of that action.
    let commands =
        names.actions.iter().map(|name| (spoken(name), looks.class(Question::Action, name)));
    let plain = [("decision", 0), ("residuals", 1), ("tree", 0)];
    let plain = plain.map(|(kind, place)| (kind.to_owned(), SemanticColor::Plain(place).look()));
    let (kinds, looks) = plain.into_iter().chain(commands).unzip();
    let mut diagram = Diagram { kinds, looks, ..Diagram::default() };
    let sensors = Block::new("residuals", "features of\nresiduals", "residuals", "");
    diagram.blocks.push(Block { layer: Some(0), ..sensors });
    let is_first = |stage: &&Stage| stage.place.question == Question::Actuator;
    let asked = hierarchy.stages.iter().find(is_first).is_some_and(stages::decides);
    let first = match (asked, names.actuators.len()) {
        (false, 0 | 1) => "residuals",
        (_, units) => {
            let asks = if units > 1 { "which one" } else { "faulty?" };
            let text = format!("A  {asks}\n{}", accuracy(judged, "A"));
            diagram.blocks.push(Block { layer: Some(1), ..Block::new("A", &text, "tree", "") });
            diagram.wires.push(arrow("residuals", "A"));
            "A"
        }
    };
    for (actuator, name) in names.actuators.iter().enumerate() {
        add_actuator(&mut diagram, hierarchy, judged, first, (actuator as u32, name));
    }
    diagram
}

fn add_actuator(
    diagram: &mut Diagram,
    hierarchy: &Hierarchy,
    judged: Option<&ProtocolResult>,
    first: &str,
    (actuator, name): (u32, &str),
) {
    let group = spoken(name);
    let own = |question, command| {
        let several = hierarchy.names.actuators.len() > 1;
        StagePlace { question, actuator: several.then_some(actuator), action: command }.id()
    };
    let command_id = own(Question::Action, None);
    let text = format!("{command_id}  command\n{}", accuracy(judged, &command_id));
    diagram.blocks.push(Block { layer: Some(2), ..Block::new(&command_id, &text, "tree", &group) });
    diagram.wires.push(arrow(first, &command_id));
    for (command, title) in hierarchy.names.actions.iter().enumerate() {
        let Some(stage) = hierarchy.stage(Question::Detail, actuator, command as u32) else {
            continue;
        };
        let id = own(Question::Detail, Some(command as u32));
        let text = format!("{id}  {}\n{}", spoken(title), accuracy(judged, &id));
        diagram
            .blocks
            .push(Block { layer: Some(3), ..Block::new(&id, &text, &spoken(title), &group) });
        diagram.wires.push(arrow(&command_id, &id));
        let leaves = format!("{id} details");
        let block = Block::new(&leaves, &details(hierarchy, stage), &spoken(title), &group);
        diagram.blocks.push(Block { layer: Some(4), ..block });
        diagram.wires.push(arrow(&id, &leaves));
    }
}

fn details(hierarchy: &Hierarchy, stage: &Stage) -> String {
    let name = |&class: &u32| spoken(&hierarchy.names.details[class as usize]);
    stage.classes.iter().map(name).collect::<Vec<_>>().join("\n")
}

fn arrow(from: &str, to: &str) -> Wire {
    Wire { arrow: true, ..Wire::new(from, to, "decision") }
}

fn accuracy(judged: Option<&ProtocolResult>, id: &str) -> String {
    share(judged.and_then(|result| result.stage(id)).map(|score| score.accuracy))
}
