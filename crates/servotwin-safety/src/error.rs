//! Reasons why an artefact cannot be made.

use servotwin::files::FileError;
use servotwin::job::JobError;
use servotwin::learn::EvaluationError;
use servotwin::nearest::nearest;
use servotwin::table::TableError;
use servotwin::text::first_of;
use std::path::PathBuf;

/// The reason why an artefact cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
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
    /// The folder has no manifest, so system, study and model of its results are unknown.
    #[error(
        "{folder}: there is no manifest.json here, so nothing says what the results were made of; 'servotwin study \
         STUDY --out {folder}' writes one"
    )]
    NoManifest { folder: PathBuf },
    /// The folder, or a file of it, has no results of the wanted scenario.
    #[error("{path}: there are no results of the scenario '{given}'; there are: {}", .known.join(", "))]
    NoScenario { path: PathBuf, given: String, known: Vec<String> },
    /// Nothing flies in the wanted scenario.
    #[error("nothing flies in the scenario '{given}'; flights have the scenarios {}: choose one with --scenario", .known.join(", "))]
    NoFlights { given: &'static str, known: [&'static str; 2] },
    /// A sheet or a table of rates lacks a column.
    #[error("{path}: there is no column '{column}'; needed are: {}", .needed.join(", "))]
    NoColumn { path: PathBuf, column: String, needed: Vec<String> },
    /// A cell is not allowed.
    #[error("{path}: line {line}, column '{column}': {problem}")]
    Cell { path: PathBuf, line: usize, column: &'static str, problem: String },
    /// A sheet was written by another version of this program.
    #[error(
        "{path}: line {line}: the seal is not of this version: take the cells that people filled in from it by hand, \
         or restore column 'seal'"
    )]
    Seal { path: PathBuf, line: usize },
    /// Faults of the tree without a rate.
    #[error("{path}: {} of the tree have no rate: {}; write a rate and its source for each ('servotwin fault-tree --template FILE' lists them)", faults(.missing.len()), first_of(.missing, MAX_LISTED))]
    NoRates { path: PathBuf, missing: Vec<String> },
    /// A sensor that is to be kept does not exist.
    #[error("there is no sensor '{given}' to keep; there are: {}", .known.join(", "))]
    NoSensor { given: String, known: Vec<String> },
    /// Too many sets of sensors to judge them all.
    #[error(
        "{free} sensors may be left out, which is too many to judge every set; allowed are {most}: keep some with --keep SENSOR"
    )]
    TooManySensors { free: usize, most: usize },
    /// Sensors without a cost.
    #[error("{path}: sensors without a cost: {}; each needs a row 'sensor,cost,source'", first_of(.missing, MAX_LISTED))]
    NoCosts { path: PathBuf, missing: Vec<String> },
    /// A classifier cannot be trained.
    #[error(transparent)]
    Evaluation(#[from] EvaluationError),
    /// The study has nothing to build a tree from.
    #[error("the study '{study}': {problem}")]
    Study { study: String, problem: &'static str },
    /// A number of hours outside of its range.
    #[error("{name} {given} is out of range: {range}")]
    Hours { name: &'static str, given: f64, range: &'static str },
    /// A sheet is no CSV file.
    #[error("{path}: a sheet ends in .csv")]
    SheetFormat { path: PathBuf },
    /// No fault of the study is of use to an objective of a worst-case search.
    #[error(
        "the study has no fault that {objective} can search: it needs a class whose action switches off"
    )]
    NothingToSearch { objective: &'static str },
    /// The caller stopped the work.
    #[error("stopped")]
    Cancelled,
}

/// The most names in a message.
const MAX_LISTED: usize = 4;

fn faults(count: usize) -> String {
    servotwin::toml_text::counted(count, "fault")
}

/// Describes an unknown name, with the nearest known one.
pub(crate) fn unknown(what: &str, given: &str, known: &[String]) -> String {
    match nearest(given, known.iter().map(String::as_str)) {
        Some(name) => format!("there is no {what} '{given}'; did you mean '{name}'?"),
        None => format!("there is no {what} '{given}'; 'servotwin describe --faults' lists all"),
    }
}
