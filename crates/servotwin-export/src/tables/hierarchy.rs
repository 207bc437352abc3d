//! The tables of a hierarchy of stages.

use super::{MOST_CLASSES, stage};
use crate::error::ExportError;
use crate::notation::{place, record, write_array, write_private};
use servotwin_diagnosis::hierarchy::{Hierarchy, Names, Question, Stage};

/// Writes a hierarchy with its stages.
pub(super) fn write(
    text: &mut String,
    name: &str,
    hierarchy: &Hierarchy,
) -> Result<(), ExportError> {
    let Names { actuators, actions, .. } = &hierarchy.names;
    let count = 1 + actuators.len() * actions.len();
    if count > MOST_CLASSES {
        let what = "hypotheses";
        return Err(ExportError::TooMany { stage: "A".into(), what, count, most: MOST_CLASSES });
    }
    let entries = hierarchy.stages.iter().enumerate().map(|(number, stage)| {
        *text += &format!("\n/* {name}, stage {} */\n", stage.id);
        stage::write(text, &format!("{name}_{number}"), stage)
    });
    let entries = entries.collect::<Result<Vec<_>, _>>()?;
    let find = |question, actuator: usize, action: usize| {
        let is_asked = |stage: &Stage| {
            let place = stage.place;
            place.question == question && place.is_asked(actuator as u32, action as u32)
        };
        place(hierarchy.stages.iter().position(is_asked))
    };
    let pairs = (0..actuators.len()).flat_map(|u| (0..actions.len()).map(move |a| (u, a)));
    let [stages, of_actions, of_details] =
        ["stages", "action_stages", "detail_stages"].map(|what| format!("{name}_{what}"));
    let action_stages = (0..actuators.len()).map(|u| find(Question::Action, u, 0));
    write_array(text, "int8_t", &of_actions, action_stages);
    let detail_stages = pairs.map(|(u, a)| find(Question::Detail, u, a));
    write_array(text, "int8_t", &of_details, detail_stages);
    write_array(text, "servotwin_stage", &stages, entries);
    let [actuators, actions] = [actuators, actions].map(|names| names.len().to_string());
    let actuator_stage = find(Question::Actuator, 0, 0);
    let record = record(&[stages, actuators, actions, actuator_stage, of_actions, of_details]);
    write_private(text, "servotwin_hierarchy", name, &record);
    Ok(())
}
