//! Who works in an output folder: a lock on a file there, so that no two programs change its manifest at the same time.
//!
//! The operating system takes the lock back when the program ends, however it ends. The file stays, empty: were it
//! removed, a third program could lock a new one while a second still has the old one.

use super::JobError;
use std::fs::{File, OpenOptions, TryLockError};
use std::path::Path;

/// The name of the file.
pub const NAME: &str = ".servotwin.lock";

/// Who else may work in the folder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Among {
    /// Nobody.
    Nobody,
    /// Other parts of the same campaign: none of them removes anything or writes the manifest.
    Parts,
}

/// The right to write into an output folder, until it is dropped.
#[derive(Debug)]
#[must_use = "the folder is free again when this is dropped"]
pub struct Hold {
    _file: Option<File>,
}

/// Takes the right to write into a folder. Where no such file can be made, or the file system has no locks, it is given
/// without asking: whether results can be written is told by who writes them.
///
/// # Errors
/// [`JobError::Busy`].
pub(super) fn take(folder: &Path, among: Among) -> Result<Hold, JobError> {
    let mut options = OpenOptions::new();
    let options = options.read(true).write(true).create(true).truncate(false);
    let Ok(file) = options.open(folder.join(NAME)) else { return Ok(Hold { _file: None }) };
    let taken = match among {
        Among::Nobody => file.try_lock(),
        Among::Parts => file.try_lock_shared(),
    };
    match taken {
        Err(TryLockError::WouldBlock) => Err(JobError::Busy { folder: folder.into() }),
        Ok(()) | Err(TryLockError::Error(_)) => Ok(Hold { _file: Some(file) }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_busy(taken: &Result<Hold, JobError>) -> bool {
        matches!(taken, Err(JobError::Busy { .. }))
    }

    #[test]
    fn one_program_or_the_parts_of_a_campaign_hold_a_folder() {
        let folder = std::env::temp_dir().join(format!("servotwin-hold-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let try_as = |among| take(&folder, among);
        let alone = try_as(Among::Nobody).unwrap();
        assert!([Among::Nobody, Among::Parts].map(try_as).iter().all(is_busy));
        drop(alone);
        let parts = [Among::Parts; 2].map(|among| try_as(among).unwrap());
        assert!(is_busy(&try_as(Among::Nobody)));
        drop(parts);
        assert!(try_as(Among::Nobody).is_ok());
        std::fs::remove_dir_all(&folder).unwrap();
        assert!(try_as(Among::Nobody).is_ok(), "where nothing can be locked, nothing is");
    }
}
