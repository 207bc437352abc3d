//! Adds helpful options to errors of the library, which does not know the command line.

use servotwin::job::JobError;
use servotwin::recordings::RecordingError;
use servotwin_watch::WatchError;
use servotwin_watch::checkpoint::CheckpointError;
use servotwin_watch::source::SourceError;
use servotwin_watch::span::CutError;
use std::path::Path;

/// The message of a stage's error. Mistakes of a study begin with their place instead of `error`.
pub(crate) fn of_job(error: &JobError) -> String {
    match error {
        JobError::Study(error) => error.to_string(),
        JobError::NoDataSet { folder } => {
            let folder = folder.display();
            format!("error: {error}; 'servotwin study --suite records --out {folder}' makes it")
        }
        JobError::OtherResults { .. } => {
            format!("error: {error} (--out), or --replace removes them")
        }
        error => format!("error: {error}"),
    }
}

/// The message for recordings that contradict their study.
pub(crate) fn of_recordings(path: &Path, error: &RecordingError) -> String {
    let hint = match error {
        RecordingError::NoHealthyRows { .. } => " with --healthy",
        _ => "",
    };
    format!("error: {}: {error}{hint}", path.display())
}

/// The message of a watch's error.
pub(crate) fn of_watch(error: &WatchError) -> String {
    match error {
        WatchError::Source(SourceError::Cut(CutError::NoTime { .. })) => {
            format!("error: --{error}")
        }
        WatchError::Source(SourceError::Cut(_)) => format!("error: {error} (--from, --to)"),
        WatchError::Checkpoint(
            CheckpointError::Content { .. } | CheckpointError::Damaged { .. },
        ) => {
            format!("error: {error}; begin anew without --resume")
        }
        error => format!("error: {error}"),
    }
}
