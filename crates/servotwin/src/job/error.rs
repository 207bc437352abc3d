//! Why a stage of the main job stops.

use crate::campaign::CampaignError;
use crate::document::counted;
use crate::evaluation::EvaluationError;
use crate::files::FileError;
use crate::parallel::Cancelled;
use crate::study::StudyError;
use crate::table::TableError;
use std::path::{Path, PathBuf};

/// Why a stage of the main job stops.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JobError {
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The study beside the results has mistakes.
    #[error(transparent)]
    Study(Box<StudyError>),
    /// A campaign, or the examples of a report, could not be simulated.
    #[error(transparent)]
    Campaign(#[from] CampaignError),
    /// There is no data set in the folder.
    #[error("{folder}: there is no data set here")]
    NoDataSet {
        /// The folder.
        folder: PathBuf,
    },
    /// Another program works in the folder.
    #[error(
        "{folder}: another servotwin is working in this folder: wait until it has ended, or choose another folder"
    )]
    Busy {
        /// The folder.
        folder: PathBuf,
    },
    /// A folder in which a part of a campaign shall work holds another study.
    #[error(
        "{folder}: another study lies here; a part of a campaign removes nothing: choose another folder"
    )]
    OtherStudy {
        /// The folder.
        folder: PathBuf,
    },
    /// A folder holds what is of another study.
    #[error(
        "{folder}: {there} is here, with {}, which stay as they are: choose another folder",
        counted(*.count, "result file")
    )]
    OtherResults {
        /// The folder.
        folder: PathBuf,
        /// Of what, in words.
        there: String,
        /// How many results.
        count: usize,
    },
    /// What an earlier stage should have written is not there.
    #[error("{path}: no such file; 'servotwin {stage}' writes it")]
    Missing {
        /// The file.
        path: PathBuf,
        /// The command that writes it.
        stage: &'static str,
    },
    /// A file that a stage adds to cannot be read. Written over, it would lose what it holds.
    #[error(
        "{error}; it stays as it is: move it away or delete it, and 'servotwin {stage}' makes it anew"
    )]
    Unreadable {
        /// What is wrong, with its path.
        error: EvaluationError,
        /// The command that adds to it.
        stage: &'static str,
    },
    /// A data set is not as the study says.
    #[error("{}", in_data_set(.path, .error))]
    DataSet {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        error: EvaluationError,
    },
    /// A data set has other rows than the shards that it was made of.
    #[error(
        "{path}: with its training commands {rows} rows, but the shards beside it hold {windows}; 'servotwin \
         features' makes it anew"
    )]
    OtherRows {
        /// The data set.
        path: PathBuf,
        /// How many rows it has.
        rows: usize,
        /// How many the shards have.
        windows: usize,
    },
    /// Training or evaluation refused the data.
    #[error(transparent)]
    Evaluation(#[from] EvaluationError),
}

fn in_data_set(path: &Path, error: &EvaluationError) -> String {
    if names_its_file(error) { error.to_string() } else { format!("{}: {error}", path.display()) }
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

impl From<StudyError> for JobError {
    fn from(error: StudyError) -> Self {
        JobError::Study(Box::new(error))
    }
}

impl From<Cancelled> for JobError {
    fn from(_: Cancelled) -> Self {
        CampaignError::Cancelled.into()
    }
}
