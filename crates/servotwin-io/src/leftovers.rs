//! Files and folders that a killed process leaves behind, and their removal by the next one.
//!
//! A process locks what it writes, and the operating system ends the lock with the process. What can be locked is
//! therefore abandoned, whichever container or restart it comes from.

use std::fs::{self, File};
use std::io;
use std::path::Path;
use tempfile::TempDir;

/// The prefix of every temporary folder; a dot precedes it in the names of temporary files.
pub(crate) const PREFIX: &str = "servotwin-";

/// Whether no running process holds the lock of a file or folder. Links are not followed, and what cannot be locked
/// counts as held.
pub(crate) fn is_abandoned(entry: &fs::DirEntry) -> bool {
    let is_there = entry.file_type().is_ok_and(|kind| kind.is_file() || kind.is_dir());
    is_there && File::open(entry.path()).is_ok_and(|file| file.try_lock().is_ok())
}

/// A folder for temporary files that nobody else can read or guess, removed on drop.
#[derive(Debug)]
pub struct TemporaryFolder {
    folder: TempDir,
    _lock: File,
}

impl TemporaryFolder {
    /// Creates a folder among those of the system, and removes those of killed processes.
    ///
    /// # Errors
    /// The folder for temporary files cannot be written.
    pub fn new() -> io::Result<Self> {
        Self::beneath(&std::env::temp_dir())
    }

    fn beneath(parent: &Path) -> io::Result<Self> {
        for entry in fs::read_dir(parent).into_iter().flatten().flatten() {
            let is_ours = entry.file_name().to_string_lossy().starts_with(PREFIX);
            if is_ours && entry.path().join(MARK).is_file() && is_abandoned(&entry) {
                // Best effort: it may be another user's.
                let _ = fs::remove_dir_all(entry.path());
            }
        }
        let mut builder = tempfile::Builder::new();
        builder.prefix(PREFIX);
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o700));
        let folder = builder.tempdir_in(parent)?;
        let lock = File::open(folder.path())?;
        lock.lock()?;
        // From here on it is known as ours; before, it may not be locked yet.
        fs::write(folder.path().join(MARK), "")?;
        Ok(Self { folder, _lock: lock })
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }
}

/// The file that marks a temporary folder of this toolkit.
const MARK: &str = ".servotwin";

/// Whether only this user can change what is in a folder: it belongs to no other, and neither its group nor everybody
/// can write into it.
#[cfg(unix)]
pub fn is_private(folder: &Path) -> bool {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    let is_ours = |data: &fs::Metadata| {
        fs::metadata("/proc/self").is_ok_and(|own| own.uid() == data.uid())
            && data.permissions().mode() & 0o022 == 0
    };
    fs::metadata(folder).is_ok_and(|data| data.is_dir() && is_ours(&data))
}

#[cfg(not(unix))]
pub fn is_private(folder: &Path) -> bool {
    folder.is_dir()
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn only_folders_of_killed_processes_are_removed_and_no_link_is_followed() {
        let parent = tempfile::tempdir().unwrap();
        let there = |name: &str| parent.path().join(name);
        let running = TemporaryFolder::beneath(parent.path()).unwrap();
        let outside = tempfile::tempdir().unwrap();
        fs::write(outside.path().join(MARK), "").unwrap();
        for (name, has_mark) in [("servotwin-1", true), ("servotwin-2", false), ("other", true)] {
            fs::create_dir(there(name)).unwrap();
            has_mark.then(|| fs::write(there(name).join(MARK), "").unwrap());
        }
        std::os::unix::fs::symlink(outside.path(), there("servotwin-3")).unwrap();
        std::os::unix::fs::symlink(outside.path(), there("servotwin-1/inside")).unwrap();
        drop(TemporaryFolder::beneath(parent.path()).unwrap());
        assert!(!there("servotwin-1").exists());
        assert!(there("servotwin-2").exists() && there("other").exists());
        assert!(there("servotwin-3").is_symlink() && outside.path().join(MARK).exists());
        assert!(running.path().exists());
    }
}
