//! The tables of a diagnoser: `servotwin_sizes.h` and `servotwin_tables.c`.

mod hierarchy;
mod length;
mod stage;
mod system;

use super::literal;
use crate::error::ExportError;
use servotwin_diagnosis::diagnoser::{Diagnoser, common_mode};
use std::fmt::Write;

/// The first line of every file with trained numbers.
const HEAD: &str = "/* Trained by servotwin; do not edit. */\n";

/// The texts of both files.
pub(super) fn texts(diagnoser: &Diagnoser) -> Result<[String; 2], ExportError> {
    let mut c = format!("{HEAD}#include \"servotwin_tables.h\"\n");
    let lengths = (0..diagnoser.lengths.len()).map(|place| length::write(&mut c, place, diagnoser));
    let lengths = lengths.collect::<Result<Vec<_>, _>>()?;
    let _ = writeln!(
        c,
        "\nconst servotwin_length servotwin_lengths[SERVOTWIN_LENGTHS] = {{\n{}\n}};",
        lengths.join("\n")
    );
    system::write(&mut c, diagnoser);
    Ok([sizes(diagnoser), c])
}

/// Most views that any length needs.
fn views(diagnoser: &Diagnoser) -> usize {
    diagnoser.lengths.iter().map(|length| diagnoser.views_of(length)).max().unwrap_or(1)
}

/// The sizes of all arrays.
fn sizes(diagnoser: &Diagnoser) -> String {
    let names = diagnoser.names();
    let pairs = common_mode::corresponding(&diagnoser.sensors_seen(), diagnoser.watched());
    let panes = diagnoser.lengths.iter().filter_map(|length| length.span.panes).max();
    let boundaries = diagnoser.boundaries.len();
    let all = [
        ("SENSORS", diagnoser.sensors.len()),
        ("WATCHED", diagnoser.watched()),
        ("INPUTS", diagnoser.environment.inputs.len()),
        ("DIFFERENCES", diagnoser.environment.differences.len()),
        ("ACTUATORS", names.actuators.len()),
        ("ACTIONS", names.actions.len()),
        ("HYPOTHESES", 1 + names.actuators.len() * names.actions.len()),
        ("FEATURES", names.features.len()),
        ("VIEWS", views(diagnoser)),
        ("LENGTHS", diagnoser.lengths.len()),
        ("MOST_PANES", panes.unwrap_or(1) as usize),
        ("COMMON_PAIRS", pairs.len()),
        ("BOUNDARIES", boundaries),
        ("MOST_BOUNDARIES", boundaries.max(1)),
    ];
    literal::sizes(HEAD, "SERVOTWIN", &all)
}
