//! Reasons why a stage of the main job stops.

use crate::files::FileError;
use crate::learn::EvaluationError;
use crate::live::runtime::RuntimeError;
use crate::parallel::Cancelled;
use crate::records::RunError;
use crate::table::TableError;
use crate::toml_text::TomlError;
use crate::toml_text::counted;
use servotwin_diagnosis::diagnoser::HealthyEvidence;
use std::path::{Path, PathBuf};

/// The reason why a stage of the main job stops.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
pub enum JobError {
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The study stored in the folder has mistakes.
    #[error(transparent)]
    Study(Box<TomlError>),
    /// Records, flights, or an example of the report, cannot be simulated.
    #[error(transparent)]
    Run(#[from] RunError),
    /// There is no data set in the folder.
    #[error("{folder}: there is no data set here")]
    NoDataSet { folder: PathBuf },
    /// Healthy flights come near a shutdown, whatever the margin.
    #[error(
        "{scenario}: unsafe in health: with {} nats more against a shutdown, the evidence for one still reaches {:.2} of its \
         limit in {} held-out healthy flights (at most {allowed} is safe); training had {} environments: add {missing} to \
         'environments' in [suites.hard_negatives]",
        .evidence.added_nats, .evidence.largest, .evidence.held_out, .evidence.learned
    )]
    UnsafeInHealth { scenario: &'static str, evidence: HealthyEvidence, allowed: f64, missing: u64 },
    /// A name of no run.
    #[error(
        "{name}: the study has no such run for judging; a run is suite#number@scenario, such as judge#17@realistic"
    )]
    NoRun { name: String },
    /// A name of no suite.
    #[error("there is no suite '{name}'; there are {known}")]
    NoSuite { name: String, known: String },
    /// The study has no flights.
    #[error("the study has no [flights]: docs/study-format.md describes this section")]
    NoFlights,
    /// The study has no tests on the ground.
    #[error("the study has no [ground_test]: docs/study-format.md describes this section")]
    NoGroundTest,
    /// Held-out flights failed, and nobody knows what they would have shown.
    #[error(
        "{scenario}: {failed} of {of} held-out healthy flights cannot be simulated to their end, so nothing shows that their \
         plants are not shut down: narrow the inputs of [flights] and the draws"
    )]
    HeldOutFailed { scenario: &'static str, failed: u64, of: u64 },
    /// Another servotwin process holds the folder.
    #[error(
        "{folder}: another servotwin is working in this folder: wait until it has ended, or choose another folder"
    )]
    Busy { folder: PathBuf },
    /// The record of sealed openings has a line that no opening wrote.
    #[error("{path}: line {line}: {reason}; the record only grows: restore it from the repository")]
    SealedRecord { path: PathBuf, line: usize, reason: String },
    /// The folder for a part of a suite belongs to another study.
    #[error(
        "{folder}: another study lies here; a part of a suite removes nothing: choose another folder"
    )]
    OtherStudy { folder: PathBuf },
    /// The folder contains results of another study.
    #[error(
        "{folder}: {there} is here, with {}, which stay as they are: choose another folder",
        counted(*.count, "result file")
    )]
    OtherResults { folder: PathBuf, there: String, count: usize },
    /// A file that another command should have written is missing.
    #[error("{path}: no such file; 'servotwin {command}' writes it")]
    Missing { path: PathBuf, command: &'static str },
    /// A data set or a table of outcomes cannot be read or written, or contradicts the study.
    #[error("{}", in_data_set(.path, .error))]
    DataSet { path: PathBuf, error: EvaluationError },
    /// A data set and the parts that it was computed from have different numbers of rows.
    #[error(
        "{path}: with its training commands {rows} rows, but the parts beside it hold {windows}; 'servotwin \
         study --suite records' makes it anew"
    )]
    OtherRows { path: PathBuf, rows: usize, windows: usize },
    /// Training or evaluation rejected the data.
    #[error(transparent)]
    Evaluation(#[from] EvaluationError),
    /// The twin cannot be simulated at rest.
    #[error(transparent)]
    Twin(#[from] RuntimeError),
}

fn in_data_set(path: &Path, error: &EvaluationError) -> String {
    if names_its_file(error) { error.to_string() } else { format!("{}: {error}", path.display()) }
}

/// Whether the error's message already names the file.
fn names_its_file(error: &EvaluationError) -> bool {
    let in_table =
        |error: &TableError| matches!(error, TableError::File(_) | TableError::Content { .. });
    match error {
        EvaluationError::File(_) => true,
        EvaluationError::Table(error) => in_table(error),
        _ => false,
    }
}

impl From<TomlError> for JobError {
    fn from(error: TomlError) -> Self {
        JobError::Study(Box::new(error))
    }
}

impl From<Cancelled> for JobError {
    fn from(_: Cancelled) -> Self {
        RunError::Cancelled.into()
    }
}
