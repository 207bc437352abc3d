//! Why a stage of the main job stops.

use crate::campaign::CampaignError;
use crate::document::counted;
use crate::evaluation::EvaluationError;
use crate::files::FileError;
use crate::parallel::Cancelled;
use crate::study::StudyError;
use crate::table::TableError;
use std::fmt;
use std::path::PathBuf;

/// Why a stage of the main job stops.
#[derive(Debug)]
#[non_exhaustive]
pub enum JobError {
    /// A file cannot be read or written.
    File(FileError),
    /// The study beside the results has mistakes.
    Study(Box<StudyError>),
    /// A campaign, or the examples of a report, could not be simulated.
    Campaign(CampaignError),
    /// There is no data set in the folder.
    NoDataSet {
        /// The folder.
        folder: PathBuf,
    },
    /// Another program works in the folder.
    Busy {
        /// The folder.
        folder: PathBuf,
    },
    /// A folder in which a part of a campaign shall work holds another study.
    OtherStudy {
        /// The folder.
        folder: PathBuf,
    },
    /// A folder holds what is of another study.
    OtherResults {
        /// The folder.
        folder: PathBuf,
        /// Of what, in words.
        there: String,
        /// How many results.
        count: usize,
    },
    /// What an earlier stage should have written is not there.
    Missing {
        /// The file.
        path: PathBuf,
        /// The command that writes it.
        stage: &'static str,
    },
    /// A file that a stage adds to cannot be read. Written over, it would lose what it holds.
    Unreadable {
        /// What is wrong, with its path.
        error: EvaluationError,
        /// The command that adds to it.
        stage: &'static str,
    },
    /// A data set is not as the study says.
    DataSet {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        error: EvaluationError,
    },
    /// A data set has other rows than the shards that it was made of.
    OtherRows {
        /// The data set.
        path: PathBuf,
        /// How many rows it has.
        rows: usize,
        /// How many the shards have.
        windows: usize,
    },
    /// Training or evaluation refused the data.
    Evaluation(EvaluationError),
}

impl fmt::Display for JobError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            JobError::File(error) => write!(out, "{error}"),
            JobError::Study(error) => write!(out, "{error}"),
            JobError::Campaign(error) => write!(out, "{error}"),
            JobError::NoDataSet { folder } => write!(
                out,
                "{}: there is no data set here; 'servotwin campaign --out {0}' makes it",
                folder.display()
            ),
            JobError::OtherRows { path, rows, windows } => write!(
                out,
                "{}: with its training commands {rows} rows, but the shards beside it hold {windows}; 'servotwin features' makes it anew",
                path.display()
            ),
            JobError::Busy { folder } => write!(
                out,
                "{}: another servotwin is working in this folder: wait until it has ended, or choose another folder",
                folder.display()
            ),
            JobError::OtherStudy { folder } => write!(
                out,
                "{}: another study lies here; a part of a campaign removes nothing: choose another folder",
                folder.display()
            ),
            JobError::OtherResults { folder, there, count } => write!(
                out,
                "{}: {there} is here, with {}, which stay as they are: choose another folder (--out), or --replace removes them",
                folder.display(),
                counted(*count, "result file")
            ),
            JobError::Missing { path, stage } => {
                write!(out, "{}: no such file; 'servotwin {stage}' writes it", path.display())
            }
            JobError::Unreadable { error, stage } => write!(
                out,
                "{error}; it stays as it is: move it away or delete it, and 'servotwin {stage}' makes it anew"
            ),
            JobError::DataSet { error, .. } if names_its_file(error) => write!(out, "{error}"),
            JobError::DataSet { path, error } => write!(out, "{}: {error}", path.display()),
            JobError::Evaluation(error) => write!(out, "{error}"),
        }
    }
}

/// Whether an error says by itself in which file it is.
fn names_its_file(error: &EvaluationError) -> bool {
    let in_table =
        |error: &TableError| matches!(error, TableError::File(_) | TableError::Content { .. });
    match error {
        EvaluationError::File(_) => true,
        EvaluationError::Table(error) => in_table(error),
        _ => false,
    }
}

impl std::error::Error for JobError {}

impl From<FileError> for JobError {
    fn from(error: FileError) -> Self {
        JobError::File(error)
    }
}

impl From<StudyError> for JobError {
    fn from(error: StudyError) -> Self {
        JobError::Study(Box::new(error))
    }
}

impl From<CampaignError> for JobError {
    fn from(error: CampaignError) -> Self {
        JobError::Campaign(error)
    }
}

impl From<Cancelled> for JobError {
    fn from(_: Cancelled) -> Self {
        CampaignError::Cancelled.into()
    }
}

impl From<EvaluationError> for JobError {
    fn from(error: EvaluationError) -> Self {
        JobError::Evaluation(error)
    }
}
