//! Reasons why an artefact cannot be made.

use servotwin::evaluation::EvaluationError;
use servotwin::files::FileError;
use servotwin::flight::runtime::RuntimeError;
use servotwin::flight::worst_case::SearchError;
use servotwin::job::JobError;
use servotwin::nearest::nearest;
use servotwin::system::RewriteError;
use servotwin::table::TableError;
use std::path::PathBuf;

/// The line that builds a program with sheets of Excel.
pub const XLSX_LINE: &str = "cargo install --path crates/servotwin-cli --features xlsx (or cargo run --release --features xlsx -- …)";

/// The reason why an artefact cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SafetyError {
    /// A stage's file is missing or cannot be read.
    #[error(transparent)]
    Job(#[from] JobError),
    /// A table cannot be read or written.
    #[error(transparent)]
    Table(#[from] TableError),
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The twin or the diagnosis could not run.
    #[error("the flight of {fault} at intensity {intensity}: {error}")]
    Flight {
        /// The fault.
        fault: String,
        /// Its intensity.
        intensity: f64,
        /// The reason.
        error: RuntimeError,
    },
    /// The folder has no manifest, so system, study and model of its results are unknown.
    #[error(
        "{folder}: there is no manifest.json here, so nothing says what the results were made of; 'servotwin study \
         STUDY --out {folder}' writes one"
    )]
    NoManifest {
        /// The output folder.
        folder: PathBuf,
    },
    /// The results in the folder do not have the wanted scenario.
    #[error("{folder}: there are no results of the scenario '{given}'; there are: {}", .known.join(", "))]
    NoScenario {
        /// The output folder.
        folder: PathBuf,
        /// The wanted scenario.
        given: String,
        /// Those in the folder.
        known: Vec<String>,
    },
    /// A sheet or a table of rates lacks a column.
    #[error("{path}: there is no column '{column}'; needed are: {}", .needed.join(", "))]
    NoColumn {
        /// The file.
        path: PathBuf,
        /// The missing column.
        column: String,
        /// All columns that are needed.
        needed: Vec<String>,
    },
    /// A cell is not allowed.
    #[error("{path}: line {line}, column '{column}': {problem}")]
    Cell {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// The column.
        column: &'static str,
        /// What is wrong, and what is allowed.
        problem: String,
    },
    /// A sheet was written by another version of this program.
    #[error(
        "{path}: line {line}: the seal is not of this version: take the cells that people filled in from it by hand, \
         or restore column 'seal'"
    )]
    Seal {
        /// The sheet.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
    },
    /// Faults of the tree without a rate.
    #[error("{path}: {} of the tree have no rate: {}; write a rate and its source for each ('servotwin faulttree --template FILE' lists them)", faults(.missing.len()), first(.missing))]
    NoRates {
        /// The table of rates.
        path: PathBuf,
        /// The faults.
        missing: Vec<String>,
    },
    /// A sensor that is to be kept does not exist.
    #[error("there is no sensor '{given}' to keep; there are: {}", .known.join(", "))]
    NoSensor {
        /// The unknown name.
        given: String,
        /// The sensors.
        known: Vec<String>,
    },
    /// Too many sets of sensors to judge them all.
    #[error(
        "{free} sensors may be left out, which is too many to judge every set; allowed are {most}: keep some with --keep SENSOR"
    )]
    TooManySensors {
        /// Number of sensors that may be left out.
        free: usize,
        /// The most that are allowed.
        most: usize,
    },
    /// Sensors without a cost.
    #[error("{path}: sensors without a cost: {}; each needs a row 'sensor,cost,source'", first(.missing))]
    NoCosts {
        /// The table of costs.
        path: PathBuf,
        /// The sensors.
        missing: Vec<String>,
    },
    /// The system file cannot hold an upgraded parameter.
    #[error(transparent)]
    Rewrite(#[from] RewriteError),
    /// A classifier cannot be trained.
    #[error(transparent)]
    Evaluation(#[from] EvaluationError),
    /// The study has nothing to build a tree from.
    #[error("the study '{study}': {problem}")]
    Study {
        /// The study's name.
        study: String,
        /// What is missing.
        problem: &'static str,
    },
    /// A number of hours outside of its range.
    #[error("{name} {given} is out of range: {range}")]
    Hours {
        /// The option.
        name: &'static str,
        /// The given number, h.
        given: f64,
        /// The allowed range.
        range: &'static str,
    },
    /// A sheet's format is neither CSV nor XLSX.
    #[error("{path}: a sheet ends in .csv or .xlsx")]
    SheetFormat {
        /// The file.
        path: PathBuf,
    },
    /// The program was built without the feature for XLSX.
    #[error(
        "{path}: a .xlsx file needs the feature 'xlsx', which this program was built without: name a .csv file, or {XLSX_LINE}"
    )]
    Feature {
        /// The file.
        path: PathBuf,
    },
    /// A sheet of Excel cannot be read or written.
    #[error("{path}: {problem}")]
    Xlsx {
        /// The file.
        path: PathBuf,
        /// The library's message.
        problem: String,
    },
    /// A point of a worst-case search cannot be flown.
    #[error(transparent)]
    Search(#[from] SearchError),
    /// The line of a finding cannot be read.
    #[error(
        "the line of a finding: {problem}; servotwin worst-case prints such lines, and worst-case.csv has them"
    )]
    FindingLine {
        /// What is wrong, and what is allowed.
        problem: String,
    },
    /// A finding was not reproduced.
    #[error(
        "the flight has margin {flown:?}, the line states {stated:?}: the line comes from another study, diagnoser or version"
    )]
    NotReproduced {
        /// The margin of the flight.
        flown: f64,
        /// The margin of the line.
        stated: f64,
    },
    /// The caller stopped the work.
    #[error("stopped")]
    Cancelled,
}

fn faults(count: usize) -> String {
    servotwin::document::counted(count, "fault")
}

/// The first names of a list, and how many follow.
fn first(names: &[String]) -> String {
    const SHOWN: usize = 4;
    let shown = names.iter().take(SHOWN).cloned().collect::<Vec<_>>().join(", ");
    match names.len().saturating_sub(SHOWN) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}

/// Describes an unknown name, with the nearest known one.
pub(crate) fn unknown(what: &str, given: &str, known: &[String]) -> String {
    match nearest(given, known.iter().map(String::as_str)) {
        Some(name) => format!("there is no {what} '{given}'; did you mean '{name}'?"),
        None => format!("there is no {what} '{given}'; 'servotwin faults' lists all"),
    }
}
