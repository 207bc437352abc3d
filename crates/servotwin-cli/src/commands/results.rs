//! `servotwin results`: writes the measured results of a study on one page.

use crate::Global;
use crate::failure::Failure;
use crate::render::json;
use serde_json::json;
use servotwin::job::sealed::OpeningRecord;
use servotwin::job::{Folder, Results, flights, outcomes};
use servotwin_report::measured::Measured;
use std::path::PathBuf;

/// Write the measured results of a study to standard output, as Markdown.
///
/// Every share comes with its count and its 95 % interval. The command reads evaluation.json, and if they exist
/// flights.json, outcomes-healthy-SCENARIO.parquet and flights-sealed.json. Nothing on the page depends on the machine.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The output folder of an evaluated study.
    #[arg(default_value = "out")]
    folder: PathBuf,
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let folder = Folder::new(&options.folder);
    let study = folder.read_study()?;
    let results = Results::read(&folder)?;
    let flights = flights::results(&folder)?;
    let mut measured = Measured::new(&study, &results, flights.as_ref());
    outcomes::healthy(&folder)?.iter().for_each(|run| measured.add_healthy(run));
    if let Some(sealed) = flights::sealed_results(&folder)? {
        let here = std::env::current_dir().unwrap_or_default();
        let known = OpeningRecord::find(&here, folder.path()).count()?;
        // The record of another repository may know less than the results.
        let known = Some(known).filter(|known| known.opened >= sealed.opening.number);
        measured.add_sealed(&study, &sealed, known);
    }
    Ok(match global.json {
        true => json(&json!(measured)),
        false => measured.markdown(),
    })
}
