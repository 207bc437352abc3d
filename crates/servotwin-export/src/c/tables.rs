//! The tables of a diagnoser: `servotwin_tables.h` and `servotwin_tables.c`.

use super::literal::array;
use super::{CFile, MOST_CLASSES, stage};
use crate::error::ExportError;
use servotwin_diagnosis::diagnoser::{Diagnoser, Length};
use servotwin_diagnosis::hierarchy::{Hierarchy, Names, Question};
use std::fmt::Write;

/// Header and source of the tables.
pub(super) fn files(diagnoser: &Diagnoser) -> Result<[CFile; 2], ExportError> {
    let mut c =
        String::from("/* Trained by servotwin; do not edit. */\n#include \"servotwin_tables.h\"\n");
    let (mut trees, mut committees) = (String::new(), String::new());
    for (place, length) in diagnoser.lengths.iter().enumerate() {
        let Length { panel, .. } = length;
        trees += &hierarchy(&mut c, &format!("trees_{place}"), &panel.trees)?;
        committees += &hierarchy(&mut c, &format!("committee_{place}"), &panel.committee)?;
    }
    for (name, list) in [("servotwin_trees", trees), ("servotwin_committees", committees)] {
        let _ =
            writeln!(c, "\nconst servotwin_hierarchy {name}[SERVOTWIN_LENGTHS] = {{\n{list}}};");
    }
    names(&mut c, diagnoser.names());
    Ok([
        CFile { name: "servotwin_tables.h", text: header(diagnoser) },
        CFile { name: "servotwin_tables.c", text: c },
    ])
}

/// Writes the arrays of a hierarchy, and returns its entry in the array of hierarchies.
fn hierarchy(c: &mut String, prefix: &str, hierarchy: &Hierarchy) -> Result<String, ExportError> {
    let Names { actuators, actions, .. } = &hierarchy.names;
    let count = 1 + actuators.len() * actions.len();
    if count > MOST_CLASSES {
        let what = "hypotheses";
        return Err(ExportError::TooMany { stage: "A".into(), what, count, most: MOST_CLASSES });
    }
    let entries = hierarchy.stages.iter().enumerate().map(|(place, stage)| {
        let _ = writeln!(c, "\n/* {prefix}, stage {} */", stage.id);
        stage::write(c, &format!("{prefix}_{place}"), stage)
    });
    let entries = entries.collect::<Result<Vec<_>, _>>()?;
    let _ = writeln!(
        c,
        "static const servotwin_stage {prefix}_stages[{}] = {{\n{}\n}};",
        entries.len(),
        entries.join("\n")
    );
    let find = |question, actuator: usize, action: usize| {
        let is_asked = |s: &servotwin_diagnosis::hierarchy::Stage| {
            s.place.question == question && s.place.is_asked(actuator as u32, action as u32)
        };
        hierarchy.stages.iter().position(is_asked).map_or(-1, |place| place as i64)
    };
    let pairs = (0..actuators.len()).flat_map(|u| (0..actions.len()).map(move |a| (u, a)));
    let of_actions = (0..actuators.len()).map(|u| find(Question::Action, u, 0));
    array(c, "int8_t", &format!("{prefix}_action_stages"), of_actions);
    let of_details = pairs.map(|(u, a)| find(Question::Detail, u, a));
    array(c, "int8_t", &format!("{prefix}_detail_stages"), of_details);
    Ok(format!(
        "    {{ {prefix}_stages, {}, {}, {}, {prefix}_action_stages, {prefix}_detail_stages }},\n",
        actuators.len(),
        actions.len(),
        find(Question::Actuator, 0, 0)
    ))
}

fn names(c: &mut String, names: &Names) {
    let lists =
        [("actuator", &names.actuators), ("action", &names.actions), ("detail", &names.details)];
    for (what, list) in lists {
        let quoted: Vec<String> =
            list.iter().map(|name| format!("    \"{}\",", escaped(name))).collect();
        let _ = writeln!(
            c,
            "\nconst char *const servotwin_{what}_names[{}] = {{\n{}\n}};",
            list.len().max(1),
            if quoted.is_empty() { "    \"\",".into() } else { quoted.join("\n") }
        );
    }
}

/// A name within a string literal of C. Names are identifiers or short words; anything else is replaced.
fn escaped(name: &str) -> String {
    name.chars()
        .map(|c| if matches!(c, ' '..='~') && c != '"' && c != '\\' { c } else { '?' })
        .collect()
}

fn header(diagnoser: &Diagnoser) -> String {
    let names = diagnoser.names();
    let sizes = [
        ("LENGTHS", diagnoser.lengths.len()),
        ("ACTUATORS", names.actuators.len()),
        ("ACTIONS", names.actions.len()),
        ("DETAILS", names.details.len()),
        ("HYPOTHESES", 1 + names.actuators.len() * names.actions.len()),
        ("FEATURES", names.features.len()),
    ];
    let mut h = String::from(
        "/* Trained by servotwin; do not edit. */\n#ifndef SERVOTWIN_TABLES_H\n#define SERVOTWIN_TABLES_H\n\n\
         #include \"servotwin_models.h\"\n\n",
    );
    for (name, size) in sizes {
        let _ = writeln!(h, "#define SERVOTWIN_{name} {size}");
    }
    h += "\n/* For each window length: the trees that explain, and the boosted trees that must agree. */\n\
          extern const servotwin_hierarchy servotwin_trees[SERVOTWIN_LENGTHS];\n\
          extern const servotwin_hierarchy servotwin_committees[SERVOTWIN_LENGTHS];\n\n";
    for what in ["actuator", "action", "detail"] {
        let _ = writeln!(h, "extern const char *const servotwin_{what}_names[];");
    }
    h + "\n#endif\n"
}
