//! `servotwin report`: the results of a study as one HTML file, or its measures as a page of Markdown.

use crate::failure::Failure;
use crate::{Global, Run};
use servotwin::job::sealed::OpeningRecord;
use servotwin::job::{Folder, Results, flights, outcomes};
use servotwin_report::measured::Measured;
use servotwin_view::document::{Document, Verdict, line};
use servotwin_view::render;
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

impl Run for Options {
    fn run(&self, global: Global) -> Result<Document, Failure> {
        let folder = Folder::new(&self.folder);
        if self.markdown {
            let page = measures(&folder)?;
            return Ok(if global.json { page } else { Document::raw(render::markdown(&page)) });
        }
        let (study, _hold) = folder.open()?;
        servotwin_report::write(&folder, &study)?;
        let written = line("{report}", [("report", (&folder.report()).into())]);
        Ok(Document::new("report", Verdict::good(written)))
    }
}

/// The page of the measures.
fn measures(folder: &Folder) -> Result<Document, Failure> {
    let study = folder.read_study()?;
    let results = Results::read(folder)?;
    let flights = flights::results(folder)?;
    let healthy = outcomes::healthy(folder)?;
    let sealed = flights::sealed_results(folder)?;
    let known = sealed.as_ref().map(|sealed| {
        let here = std::env::current_dir().unwrap_or_default();
        let known = OpeningRecord::find(&here, folder.path()).count()?;
        // The record of another repository may know less than the results.
        Ok::<_, Failure>(Some(known).filter(|known| known.opened >= sealed.opening.number))
    });
    let measured = Measured {
        study: &study,
        results: &results,
        flights: flights.as_ref(),
        healthy: &healthy,
        sealed: sealed.as_ref().zip(known.transpose()?),
    };
    Ok(measured.document())
}
