//! The tables of a hierarchy of stages.

use super::super::MOST_CLASSES;
use super::super::literal::array;
use super::stage;
use crate::error::ExportError;
use servotwin_diagnosis::hierarchy::{Hierarchy, Names, Question, Stage};
use std::fmt::Write;

/// Writes a hierarchy with its stages.
pub(super) fn write(c: &mut String, name: &str, hierarchy: &Hierarchy) -> Result<(), ExportError> {
    let Names { actuators, actions, .. } = &hierarchy.names;
    let count = 1 + actuators.len() * actions.len();
    if count > MOST_CLASSES {
        let what = "hypotheses";
        return Err(ExportError::TooMany { stage: "A".into(), what, count, most: MOST_CLASSES });
    }
    let entries = hierarchy.stages.iter().enumerate().map(|(place, stage)| {
        let _ = writeln!(c, "\n/* {name}, stage {} */", stage.id);
        stage::write(c, &format!("{name}_{place}"), stage)
    });
    let entries = entries.collect::<Result<Vec<_>, _>>()?;
    let find = |question, actuator: usize, action: usize| {
        let is_asked = |stage: &Stage| {
            let place = stage.place;
            place.question == question && place.is_asked(actuator as u32, action as u32)
        };
        hierarchy.stages.iter().position(is_asked).map_or(-1, |place| place as i64)
    };
    let pairs = (0..actuators.len()).flat_map(|u| (0..actions.len()).map(move |a| (u, a)));
    let of_actions = (0..actuators.len()).map(|u| find(Question::Action, u, 0));
    array(c, "int8_t", &format!("{name}_action_stages"), of_actions);
    let of_details = pairs.map(|(u, a)| find(Question::Detail, u, a));
    array(c, "int8_t", &format!("{name}_detail_stages"), of_details);
    let _ = writeln!(
        c,
        "static const servotwin_stage {name}_stages[{}] = {{\n{}\n}};\n\
         static const servotwin_hierarchy {name} = {{\n    {name}_stages, {}, {}, {}, {name}_action_stages, \
         {name}_detail_stages\n}};",
        entries.len(),
        entries.join("\n"),
        actuators.len(),
        actions.len(),
        find(Question::Actuator, 0, 0)
    );
    Ok(())
}
