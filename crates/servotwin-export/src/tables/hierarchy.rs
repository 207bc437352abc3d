//! The tables of a hierarchy of stages.

use super::{MOST_CLASSES, stage};
use crate::error::ExportError;
use crate::notation::{COUNT, Notation};
use servotwin_diagnosis::hierarchy::{Hierarchy, Names, Question, Stage};

/// Writes a hierarchy with its stages.
pub(super) fn write(
    text: &mut String,
    notation: Notation,
    name: &str,
    hierarchy: &Hierarchy,
) -> Result<(), ExportError> {
    let Names { actuators, actions, .. } = &hierarchy.names;
    let count = 1 + actuators.len() * actions.len();
    if count > MOST_CLASSES {
        let what = "hypotheses";
        return Err(ExportError::TooMany { stage: "A".into(), what, count, most: MOST_CLASSES });
    }
    let entries = hierarchy.stages.iter().enumerate().map(|(place, stage)| {
        *text += &format!("\n/* {name}, stage {} */\n", stage.id);
        stage::write(text, notation, &format!("{name}_{place}"), stage)
    });
    let entries = entries.collect::<Result<Vec<_>, _>>()?;
    let find = |question, actuator: usize, action: usize| {
        let is_asked = |stage: &Stage| {
            let place = stage.place;
            place.question == question && place.is_asked(actuator as u32, action as u32)
        };
        notation.place(hierarchy.stages.iter().position(is_asked))
    };
    let pairs = (0..actuators.len()).flat_map(|u| (0..actions.len()).map(move |a| (u, a)));
    let [stages, of_actions, of_details] =
        ["stages", "action_stages", "detail_stages"].map(|what| format!("{name}_{what}"));
    let action_stages = (0..actuators.len()).map(|u| find(Question::Action, u, 0));
    notation.write_array(text, "Option<u8>", &of_actions, action_stages);
    let detail_stages = pairs.map(|(u, a)| find(Question::Detail, u, a));
    notation.write_array(text, "Option<u8>", &of_details, detail_stages);
    notation.write_array(text, "Stage", &stages, entries);
    let record = notation.record(
        "Hierarchy",
        &[
            ("stages", notation.array(&stages)),
            (COUNT, actuators.len().to_string()),
            (COUNT, actions.len().to_string()),
            ("actuator_stage", find(Question::Actuator, 0, 0)),
            ("action_stages", notation.array(&of_actions)),
            ("detail_stages", notation.array(&of_details)),
        ],
    );
    notation.write_private(text, "Hierarchy", name, &record);
    Ok(())
}
