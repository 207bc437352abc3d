//! `servotwin report`: what the other stages have found, as one HTML file.

use crate::Global;
use crate::failure::Failure;
use crate::render::json;
use serde_json::json;
use servotwin::job::{Folder, report};
use std::path::PathBuf;

/// Write the report of an evaluated campaign: report.html, and its figures as SVG.
#[derive(clap::Args)]
pub struct Options {
    /// The output folder of a campaign for which `servotwin evaluate` has run.
    input: PathBuf,
}

/// The text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let folder = Folder::new(&options.input);
    let study = folder.read_study()?;
    report::write(&folder, &study)?;
    let path = folder.report().display().to_string();
    Ok(match global {
        Global { json: true, .. } => json(&json!({ "report": path })),
        Global { quiet: true, .. } => String::new(),
        _ => format!("{path}\n"),
    })
}
