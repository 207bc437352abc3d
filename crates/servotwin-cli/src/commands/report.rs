//! `servotwin report`: the results of a study as one HTML file, or its measures as a page of Markdown.

use crate::Global;
use crate::failure::Failure;
use crate::render::json;
use serde_json::json;
use servotwin::job::sealed::OpeningRecord;
use servotwin::job::{Folder, Results, flights, outcomes};
use servotwin_report::measured::Measured;
use std::path::PathBuf;

/// Write the report of a study: one HTML file that needs no network.
///
/// Writes report.html and its figures as SVG into the folder. With --markdown, writes a page of the measures to
/// standard output instead. Every share comes with its count and its 95 % interval, and nothing on the page depends
/// on the machine.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The output folder of a study.
    #[arg(default_value = "out")]
    folder: PathBuf,
    /// Write the measures to standard output, as Markdown.
    #[arg(long)]
    markdown: bool,
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let folder = Folder::new(&options.folder);
    if options.markdown {
        return measures(&folder, global);
    }
    let (study, _hold) = folder.open()?;
    servotwin_report::write(&folder, &study)?;
    let path = folder.report().display().to_string();
    Ok(match global {
        Global { json: true, .. } => json(&json!({ "report": path })),
        Global { quiet: true, .. } => String::new(),
        _ => format!("{path}\n"),
    })
}

/// The page of the measures, or their list as JSON.
fn measures(folder: &Folder, global: Global) -> Result<String, Failure> {
    let study = folder.read_study()?;
    let results = Results::read(folder)?;
    let flights = flights::results(folder)?;
    let mut measured = Measured::new(&study, &results, flights.as_ref());
    outcomes::healthy(folder)?.iter().for_each(|run| measured.add_healthy(run));
    if let Some(sealed) = flights::sealed_results(folder)? {
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
