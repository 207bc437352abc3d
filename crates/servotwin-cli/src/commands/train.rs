//! `servotwin train`: trains the hierarchies of a campaign.

use super::evaluate::workers;
use crate::failure::Failure;
use crate::render::json;
use crate::{Global, stop};
use serde_json::json;
use servotwin::job::{self, Folder, manifest};
use std::path::PathBuf;

/// Train the diagnosis of a campaign.
///
/// Writes a hierarchy for each data set into the folder.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The output folder of a campaign.
    folder: PathBuf,
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    stop::heed();
    let folder = Folder::new(&options.folder);
    let (study, _hold) = folder.open()?;
    let (mut text, mut results) = (String::new(), vec![]);
    for (subject, trained) in job::train_all(&folder, &study, workers(None))? {
        let path = folder.records(subject);
        let stages: Vec<&str> =
            trained.trees.stages.iter().map(|stage| stage.id.as_str()).collect();
        text += &format!(
            "{}: {} trees and a committee: {}\n",
            path.display(),
            stages.len(),
            stages.join(" ")
        );
        results.push(json!({ "subject": subject, "stages": stages }));
    }
    manifest::write(&folder, &study)?;
    Ok(match global {
        Global { json: true, .. } => json(&json!(results)),
        Global { quiet: true, .. } => String::new(),
        _ => text,
    })
}
