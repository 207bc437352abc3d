//! `servotwin report`: writes the results of the other stages as one HTML file.

use crate::Global;
use crate::failure::Failure;
use crate::render::json;
use serde_json::json;
use servotwin::job::Folder;
use std::path::PathBuf;

/// Write a report: one HTML file that needs no network.
///
/// Writes report.html and its figures as SVG into the folder.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The output folder of a campaign that `servotwin evaluate` has processed.
    folder: PathBuf,
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let folder = Folder::new(&options.folder);
    let (study, _hold) = folder.open()?;
    servotwin_report::write(&folder, &study)?;
    let path = folder.report().display().to_string();
    Ok(match global {
        Global { json: true, .. } => json(&json!({ "report": path })),
        Global { quiet: true, .. } => String::new(),
        _ => format!("{path}\n"),
    })
}
