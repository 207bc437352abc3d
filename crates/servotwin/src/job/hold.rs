//! Locks an output folder with a lock file, so that no two programs change its manifest at the same time.
//!
//! The operating system releases the lock when the program ends for any reason. The empty file stays: if it were
//! removed, a third program could lock a new file while a second still holds the old one.

use super::JobError;
use std::fs::{File, OpenOptions, TryLockError};
use std::path::Path;

/// The name of the lock file.
pub const NAME: &str = ".servotwin.lock";

/// Which other processes may work in the folder at the same time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Among {
    /// None.
    Nobody,
    /// Other parts of the same suites. They remove no results and do not write the manifest.
    Parts,
}

/// The right to write into an output folder, released on drop.
#[derive(Debug)]
#[must_use = "the folder is free again when this is dropped"]
pub struct Hold {
    _file: Option<File>,
}

/// Takes the right to write into a folder. If the lock file cannot be created or the file system has no locks, the
/// right is granted without a lock; the later write reports the real error.
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
    fn one_program_or_the_parts_of_a_suite_hold_a_folder() {
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
