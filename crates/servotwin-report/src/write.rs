//! The stage that writes the report.

use crate::{Material, document, examples};
use serde::Deserialize;
use servotwin::job::{Folder, JobError, Results, Subject, flights, manifest, outcomes, panel};
use servotwin::learn::model_file;
use servotwin::records;
use servotwin::study::{Purpose, Scenario, Study};
use servotwin_diagnosis::diagnoser::Tuning;
use servotwin_diagnosis::diagnoser::decision::Allowances;
use servotwin_diagnosis::diagnoser::tuning::Constant;
use servotwin_diagnosis::hierarchy::Hierarchy;
use servotwin_io::files::{create_folder, write_text};
use servotwin_view::render::page;

/// Writes the report, its figures and the manifest from the results of the other stages. Without an evaluation of
/// records, the report has the flights alone.
///
/// # Errors
/// The folder has neither an evaluation nor flights; a file cannot be read or written; the healthy system cannot be
/// simulated.
pub fn write(folder: &Folder, study: &Study) -> Result<(), JobError> {
    let results = Results::read(folder)?;
    let subjects = results.subjects.iter().map(|result| result.subject);
    let hierarchies: Vec<(Subject, Hierarchy)> = subjects
        .map(|subject| Ok((subject, panel(folder, subject)?.trees)))
        .collect::<Result<_, JobError>>()?;
    // Remove the older report first. The manifest written at the end keeps the entries of the one in the folder,
    // and would otherwise keep the older report's hashes.
    folder.remove_report()?;
    let manifest = manifest::write(folder, study)?;
    let flights = flights::results(folder)?;
    let sealed = flights::sealed_results(folder)?;
    let healthy = outcomes::healthy(folder)?;
    let constants = constants(folder)?;
    let calibrations =
        Purpose::OF_RECORDS.map(|purpose| records::calibrations(folder.path(), purpose));
    let calibrations = calibrations.into_iter().collect::<Result<Vec<_>, _>>()?.concat();
    let report = document(&Material {
        study,
        results: &results,
        hierarchies: &hierarchies,
        flights: flights.as_ref(),
        sealed: sealed.as_ref(),
        healthy: &healthy,
        constants: &constants,
        calibrations: &calibrations,
        examples: &examples::simulate(study)?,
        manifest: &manifest,
    });
    create_folder(folder.figures())?;
    let mut drawn = vec![];
    for (name, figure) in report.figures() {
        let path = folder.figures().join(format!("{name}.svg"));
        figure.save(&path)?;
        drawn.push(path);
    }
    drawn.sort();
    write_text(folder.report(), &page(&report))?;
    manifest::write_with(folder, study, &drawn).map(drop)
}

/// The constants of a stored diagnoser, without its models.
#[derive(Deserialize)]
struct OfDiagnoser {
    tuning: Tuning,
    lengths: Vec<OfLength>,
}

/// The allowances of one window length.
#[derive(Deserialize)]
struct OfLength {
    baseline_corrected: Option<Allowances>,
}

/// Reads the constants of the stored diagnosers.
///
/// # Errors
/// A file cannot be read.
fn constants(folder: &Folder) -> Result<Vec<(Scenario, Vec<Constant>)>, JobError> {
    let stored = Scenario::ALL.into_iter().filter(|scenario| folder.diagnoser(*scenario).exists());
    let read = |scenario: Scenario| {
        let OfDiagnoser { tuning, lengths } = model_file::read(folder.diagnoser(scenario))?;
        let corrected = lengths.iter().find_map(|length| length.baseline_corrected.as_ref());
        Ok((scenario, tuning.constants(corrected)))
    };
    stored.map(read).collect()
}
