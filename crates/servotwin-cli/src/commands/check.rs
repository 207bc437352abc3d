//! `servotwin check`: whether a system or a study file is right.

use crate::Global;
use crate::failure::Failure;
use crate::render::json;
use serde_json::{Value, json};
use servotwin::built_in::{STUDIES, SYSTEMS, find};
use servotwin::document::{Explained, Located};
use servotwin::files;
use servotwin::kind::Kind;
use servotwin::study::{Setting, Study, StudyError};
use servotwin::system::{System, SystemError};
use std::path::PathBuf;

/// Check a system or a study file and show its mistakes at their places.
///
/// What a file is shows in its content: a study names its system. The first 20 mistakes are shown,
/// with --json all of them.
#[derive(clap::Args)]
pub struct Options {
    /// The file, or the name of a built-in system or study.
    file: PathBuf,
}

/// The text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let (is_system, is_study) = what(options)?;
    let mut text = String::new();
    if is_system {
        let system = System::read(&options.file);
        let system = system.map_err(|error| told(StudyError::System(error), global))?;
        text += &system_text(options, &system, global);
    }
    if is_study {
        let study = Study::read(&options.file).map_err(|error| told(error, global))?;
        text += &study_text(options, &study, global);
    }
    Ok(text)
}

/// Whether the file is a system, and whether it is a study: what has sections that only studies have is
/// one. A built-in name may stand for both.
fn what(options: &Options) -> Result<(bool, bool), SystemError> {
    let name = options.file.to_str().unwrap_or_default();
    let built_in = (find(&SYSTEMS, name).is_some(), find(&STUDIES, name).is_some());
    if built_in.0 || built_in.1 {
        return Ok(built_in);
    }
    let text = files::read_text(&options.file).map_err(SystemError::File)?;
    let is_study = Kind::of(&text) == Some(Kind::Study);
    Ok((!is_study, is_study))
}

/// Mistakes as JSON, too, where it is wanted.
fn told(error: StudyError, global: Global) -> Failure {
    if global.json {
        let report = match &error {
            StudyError::System(SystemError::Mistakes { path, mistakes }) => {
                Some(report(path, mistakes))
            }
            StudyError::Mistakes { path, mistakes } => Some(report(path, mistakes)),
            _ => None,
        };
        if let Some(Err(failure)) = report.map(|report| crate::print(&json(&report))) {
            return failure;
        }
    }
    match error {
        StudyError::System(error) => Failure::System(error),
        error => error.into(),
    }
}

fn report<M: Explained>(path: &str, mistakes: &[Located<M>]) -> Value {
    let list = mistakes.iter().map(|located| {
        json!({
            "line": located.line,
            "column": located.column,
            "message": located.mistake.to_string(),
            "help": located.mistake.help(),
        })
    });
    json!({ "file": path, "valid": false, "mistakes": list.collect::<Vec<_>>() })
}

fn system_text(options: &Options, system: &System, global: Global) -> String {
    let components = &system.network().components;
    let faults: usize = components.iter().map(|c| c.component.spec().faults.len()).sum();
    let (states, inputs) = (system.program.states().len(), system.network().inputs.len());
    match global {
        Global { json: true, .. } => json(&json!({
            "file": options.file, "valid": true, "mistakes": [], "name": system.name,
            "components": components.len(), "states": states, "faults": faults,
            "inputs": inputs, "sensors": system.sensors.len(),
        })),
        Global { quiet: true, .. } => String::new(),
        _ => format!(
            "{}: no mistakes: {}, {} components, {states} states, {faults} faults, {inputs} \
             inputs, {} sensors\n",
            options.file.display(),
            system.name,
            components.len(),
            system.sensors.len(),
        ),
    }
}

fn study_text(options: &Options, study: &Study, global: Global) -> String {
    let (cases, faults) = (study.cases.len(), study.faults.len());
    let settings = Setting::groups(study, |_| true).concat();
    let settings: Vec<&str> = settings.into_iter().map(Setting::name).collect();
    match global {
        Global { json: true, .. } => json(&json!({
            "file": options.file, "valid": true, "mistakes": [], "name": study.name,
            "system": study.system.name, "units": study.units, "cases": cases, "faults": faults,
            "sensors": study.measured.len(), "settings": settings,
        })),
        Global { quiet: true, .. } => String::new(),
        _ => format!(
            "{}: no mistakes: {} with the system {}, {faults} faults with their intensities in \
             {cases} cases, {} sensors, settings {}\n",
            options.file.display(),
            study.name,
            study.system.name,
            study.measured.len(),
            settings.join(", "),
        ),
    }
}
