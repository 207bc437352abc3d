//! The tables of a diagnoser and of its twin: the sizes of arrays, and everything that was trained.

mod hierarchy;
mod known_answer;
mod length;
pub(crate) mod stage;
mod system;
pub(crate) mod twin;

pub(crate) use known_answer::center;

use crate::error::ExportError;
use crate::notation::{sizes_text, write_list};
use servotwin_diagnosis::diagnoser::{Diagnoser, Length, common_mode};
use servotwin_io::manifest::sha256_of_text;

/// Most classes of a stage, and most hypotheses: `SERVOTWIN_MOST_CLASSES` of the hand-written code.
const MOST_CLASSES: usize = 32;

/// The head of each file with trained numbers.
pub(crate) const HEAD: &str = "/* Trained by servotwin; do not edit. */\n";

/// Checks that a diagnoser can be exported.
///
/// # Errors
/// The errors of [`Diagnoser::check`]; [`ExportError::Unsupported`] for what the exported code does not know.
pub(crate) fn check(diagnoser: &Diagnoser) -> Result<(), ExportError> {
    diagnoser.check()?;
    let differs = |length: &Length| length.panel.trees.names.features != diagnoser.names().features;
    if diagnoser.lengths.iter().any(differs) {
        let why = "window lengths with different features cannot be exported";
        return Err(ExportError::Unsupported(why));
    }
    Ok(())
}

/// The texts of both files: sizes and tables.
pub(crate) fn texts(diagnoser: &Diagnoser) -> Result<[String; 2], ExportError> {
    let mut text = [HEAD, "#include \"servotwin_tables.h\"\n"].concat();
    let lengths = 0..diagnoser.lengths.len();
    let lengths = lengths.map(|place| length::write(&mut text, place, diagnoser));
    let lengths = lengths.collect::<Result<Vec<_>, _>>()?;
    write_list(&mut text, "servotwin_length", "lengths", &lengths, "");
    system::write(&mut text, diagnoser);
    known_answer::write(&mut text, diagnoser)?;
    let made_of = [
        ("VERSION", env!("CARGO_PKG_VERSION").to_owned()),
        ("DIAGNOSER_SHA256", sha256_of_text(&file_text(diagnoser))),
        ("TABLES_SHA256", sha256_of_text(&text)),
    ];
    let sizes = sizes_text(HEAD, "SERVOTWIN", &made_of, &sizes(diagnoser), &names(diagnoser));
    Ok([sizes, text])
}

/// The text of a diagnoser's file.
fn file_text(diagnoser: &Diagnoser) -> String {
    serde_json::to_string_pretty(diagnoser).unwrap_or_default() + "\n"
}

/// The lists of names, which C code uses as indices.
pub(crate) fn names(diagnoser: &Diagnoser) -> [(&'static str, Vec<String>); 5] {
    let names = diagnoser.names();
    let inputs = diagnoser.environment.inputs.iter();
    [
        ("SENSOR", diagnoser.sensors.iter().map(|sensor| sensor.name.clone()).collect()),
        ("INPUT", inputs.map(|input| input.name.clone()).collect()),
        ("ACTUATOR", names.actuators.clone()),
        ("ACTION", names.actions.clone()),
        ("DETAIL", names.details.clone()),
    ]
}

/// The sizes of all arrays.
fn sizes(diagnoser: &Diagnoser) -> [(&'static str, usize); 14] {
    let names = diagnoser.names();
    let pairs = common_mode::corresponding(&diagnoser.sensors_seen(), diagnoser.watched());
    let panes = diagnoser.lengths.iter().map(|length| length.span.panes).max();
    let boundaries = diagnoser.boundaries.len();
    [
        ("SENSORS", diagnoser.sensors.len()),
        ("WATCHED", diagnoser.watched()),
        ("INPUTS", diagnoser.environment.inputs.len()),
        ("DIFFERENCES", diagnoser.environment.differences.len()),
        ("ACTUATORS", names.actuators.len()),
        ("ACTIONS", names.actions.len()),
        ("HYPOTHESES", 1 + names.actuators.len() * names.actions.len()),
        ("FEATURES", names.features.len()),
        ("VIEWS", diagnoser.views()),
        ("LENGTHS", diagnoser.lengths.len()),
        ("MOST_PANES", panes.unwrap_or(1) as usize),
        ("COMMON_PAIRS", pairs.len()),
        ("BOUNDARIES", boundaries),
        ("MOST_BOUNDARIES", boundaries.max(1)),
    ]
}
