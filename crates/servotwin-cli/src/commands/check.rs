//! `servotwin check`: whether a system file is right.

use super::read_system;
use crate::Global;
use crate::failure::Failure;
use crate::render::json;
use serde_json::json;
use servotwin::system::SystemError;
use std::path::PathBuf;

/// Check a system file and show every mistake at its place.
#[derive(clap::Args)]
pub struct Options {
    /// The system file.
    file: PathBuf,
}

/// The text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let system = match read_system(&options.file) {
        Err(Failure::System(SystemError::Mistakes { path, mistakes })) if global.json => {
            let list = mistakes.iter().map(|located| {
                json!({
                    "line": located.line,
                    "column": located.column,
                    "message": located.mistake.to_string(),
                })
            });
            let list: Vec<_> = list.collect();
            crate::print(&json(&json!({ "file": path, "valid": false, "mistakes": list })))?;
            return Err(Failure::System(SystemError::Mistakes { path, mistakes }));
        }
        other => other?,
    };
    let components = &system.network().components;
    let faults: usize = components.iter().map(|c| c.component.spec().faults.len()).sum();
    let (states, inputs) = (system.program.states().len(), system.network().inputs.len());
    if global.json {
        return Ok(json(&json!({
            "file": options.file, "valid": true, "mistakes": [], "name": system.name,
            "components": components.len(), "states": states, "faults": faults,
            "inputs": inputs, "sensors": system.sensors.len(),
        })));
    }
    if global.quiet {
        return Ok(String::new());
    }
    Ok(format!(
        "{}: no mistakes: {}, {} components, {states} states, {faults} faults, {inputs} inputs, \
         {} sensors\n",
        options.file.display(),
        system.name,
        components.len(),
        system.sensors.len(),
    ))
}
