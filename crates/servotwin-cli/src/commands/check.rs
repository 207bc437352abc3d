//! `servotwin check`: checks a system or a study file.

use super::features::read_recording_study;
use super::warn;
use crate::Global;
use crate::failure::Failure;
use crate::render::json;
use serde_json::{Value, json};
use servotwin::built_in::{STUDIES, SYSTEMS, find};
use servotwin::document::{Diagnostic, counted};
use servotwin::kind::FileType;
use servotwin::plausibility;
use servotwin::study::{Scenario, Study, StudyError};
use servotwin::system::{System, SystemError};
use std::path::PathBuf;

/// Check a system or a study file, and show each mistake at its place.
///
/// The check reports every mistake for which 'study' would reject the file. It also warns about what is valid but
/// probably not intended: a fault that changes nothing, a pump without a relief valve, a system that is unstable or in an
/// end stop at its default inputs.
///
/// The content decides whether a file is a system or a study: a study names its system. The output shows the first 20
/// mistakes, or all of them with --json. If a built-in name stands for a system and a study, both are checked, and
/// --json returns a list of both.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// A file, or the name of a built-in system or study.
    file: PathBuf,
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let checked = what(options)?.into_iter().map(|kind| match kind {
        FileType::System => {
            let system = System::read(&options.file);
            let system = system.map_err(|error| told(StudyError::System(error), global))?;
            let implausible = plausibility::warnings(&system);
            warn(global, &implausible);
            Ok(of_system(options, &system, &implausible))
        }
        FileType::Study => {
            let study = Study::read(&options.file).map_err(|error| told(error, global))?;
            study.complete().map_err(|error| told(error, global))?;
            let implausible = plausibility::warnings(&study.system);
            warn(global, &[study.warnings_in_words(), implausible.clone()].concat());
            Ok(of_study(options, &study, &implausible))
        }
        FileType::Recordings => of_recordings(options),
    });
    let checked: Vec<Checked> = checked.collect::<Result<_, Failure>>()?;
    Ok(match (global, checked.as_slice()) {
        (Global { json: true, .. }, [one]) => json(&one.json),
        (Global { json: true, .. }, all) => {
            json(&json!(all.iter().map(|one| &one.json).collect::<Vec<_>>()))
        }
        (Global { quiet: true, .. }, _) => String::new(),
        (_, all) => all.iter().map(|one| one.text.as_str()).collect(),
    })
}

/// The output for a file without mistakes.
struct Checked {
    text: String,
    json: Value,
}

/// The type of the file. A file with sections that only studies have is a study. A built-in name may stand for a system
/// and for a study.
fn what(options: &Options) -> Result<Vec<FileType>, SystemError> {
    let name = options.file.to_str().unwrap_or_default();
    let lists = [(FileType::System, &SYSTEMS[..]), (FileType::Study, &STUDIES[..])];
    let built_in = lists.into_iter().filter(|(_, list)| find(list, name).is_some());
    let built_in: Vec<FileType> = built_in.map(|(kind, _)| kind).collect();
    if !built_in.is_empty() {
        return Ok(built_in);
    }
    let (text, _) = FileType::System.read(&options.file).map_err(SystemError::File)?;
    Ok(vec![FileType::of(&text).unwrap_or(FileType::System)])
}

/// Makes a failure, and also prints its mistakes as JSON with `--json`.
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

fn report(path: &str, mistakes: &[Diagnostic]) -> Value {
    let list = mistakes.iter().map(|mistake| {
        json!({
            "line": mistake.line,
            "column": mistake.column,
            "message": mistake.message,
            "help": mistake.help,
        })
    });
    json!({ "file": path, "valid": false, "mistakes": list.collect::<Vec<_>>() })
}

fn of_system(options: &Options, system: &System, implausible: &[String]) -> Checked {
    let components = &system.network().components;
    let faults: usize = components.iter().map(|c| c.component.spec().faults.len()).sum();
    let (states, inputs) = (system.program.states().len(), system.network().inputs.len());
    Checked {
        json: json!({
            "file": options.file, "kind": "system", "valid": true, "mistakes": [],
            "name": system.name, "components": components.len(), "states": states,
            "faults": faults, "inputs": inputs, "sensors": system.sensors.len(),
            "warnings": implausible.iter().map(|doubt| json!({ "message": doubt })).collect::<Vec<_>>(),
        }),
        text: format!(
            "{}: no mistakes: {}, {}, {}, {}, {}, {}\n",
            options.file.display(),
            system.name,
            counted(components.len(), "component"),
            counted(states, "state"),
            counted(faults, "fault"),
            counted(inputs, "input"),
            counted(system.sensors.len(), "sensor"),
        ),
    }
}

fn of_study(options: &Options, study: &Study, implausible: &[String]) -> Checked {
    let (cases, faults) = (study.cases.len(), study.faults.len());
    let scenarios = Scenario::groups(study, |_| true).concat();
    let scenarios: Vec<&str> = scenarios.into_iter().map(Scenario::name).collect();
    Checked {
        text: format!(
            "{}: no mistakes: {} with the system {}, {} with their intensities in {}, {}, scenarios {}\n",
            options.file.display(),
            study.name,
            study.system.name,
            counted(faults, "fault"),
            counted(cases, "case"),
            counted(study.measured.len(), "sensor"),
            scenarios.join(", "),
        ),
        json: json!({
            "file": options.file, "kind": "study", "valid": true, "mistakes": [],
            "name": study.name, "system": study.system.name, "units": study.units,
            "cases": cases, "faults": faults, "sensors": study.measured.len(),
            "scenarios": scenarios, "warnings": warnings(study, implausible),
        }),
    }
}

fn warnings(study: &Study, implausible: &[String]) -> Value {
    let warnings = study.warnings().into_iter().map(|Diagnostic { line, column, message, .. }| {
        json!({ "line": line, "column": column, "message": message })
    });
    warnings.chain(implausible.iter().map(|doubt| json!({ "message": doubt }))).collect()
}

/// Checks a study of recordings. It names columns of a table instead of a system.
fn of_recordings(options: &Options) -> Result<Checked, Failure> {
    let file = &options.file;
    let study = read_recording_study(file)?;
    let in_study = |error| Failure::Recording { path: file.clone(), error };
    let (rows, sensors) = (study.window_rows(), study.sensors().map_err(in_study)?.0.len());
    Ok(Checked {
        text: format!(
            "{}: no mistakes: a study of recordings, {sensors} sensors or residuals, windows of \
             {rows} rows\n",
            file.display()
        ),
        json: json!({
            "file": file, "kind": "recordings", "valid": true, "mistakes": [], "sensors": sensors,
            "window_rows": rows,
        }),
    })
}
