//! Finds the logs in a folder: regular files with the extension of a table.

use crate::failure::Failure;
use servotwin::files::{FileError, kind_in_words};
use servotwin::text::natural_order;
use servotwin_watch::source;
use std::path::{Path, PathBuf};

/// The logs of a folder in the order of their names, in which numbers count as numbers, and the entries with such a name
/// that are no regular files.
#[derive(Default)]
pub(crate) struct LogFolder {
    /// The paths of the logs.
    pub paths: Vec<PathBuf>,
    /// The skipped entries, each with its name and its kind.
    pub skipped: Vec<(String, &'static str)>,
}

impl LogFolder {
    /// Lists the entries of a folder, following links.
    ///
    /// # Errors
    /// The folder cannot be listed, or has no log.
    pub(crate) fn read(folder: &Path) -> Result<Self, Failure> {
        let none = |reason: String| Failure::input(format!("{}: {reason}", folder.display()));
        if !folder.is_dir() {
            return Err(none("no such folder".into()));
        }
        let wrong = |cause| FileError::from_io(folder, cause);
        let mut found = LogFolder::default();
        for entry in std::fs::read_dir(folder).map_err(wrong)? {
            let path = entry.map_err(wrong)?.path();
            if source::is_log(&path) {
                found.take(path);
            }
        }
        found.paths.sort_by_cached_key(|path| natural_order(&path.to_string_lossy()));
        found.skipped.sort();
        match (found.paths.is_empty(), found.sentence()) {
            (false, _) => Ok(found),
            (true, None) => Err(none(format!("the folder has no logs ({})", source::extensions()))),
            (true, Some(skipped)) => Err(none(format!("the folder has no logs: {skipped}"))),
        }
    }

    fn take(&mut self, path: PathBuf) {
        let name = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        match std::fs::metadata(&path) {
            Ok(known) if known.is_file() => self.paths.push(path),
            Ok(known) => self.skipped.push((name, kind_in_words(known.file_type()))),
            Err(_) if path.is_symlink() => self.skipped.push((name, "broken link")),
            Err(_) => self.skipped.push((name, "cannot be read")),
        }
    }

    /// A sentence that counts and names the skipped entries.
    pub(crate) fn sentence(&self) -> Option<String> {
        let each: Vec<String> =
            self.skipped.iter().map(|(name, why)| format!("{name} ({why})")).collect();
        match each.len() {
            0 => None,
            1 => Some(format!("skipped 1 entry that is no regular file: {}", each[0])),
            n => {
                Some(format!("skipped {n} entries that are no regular files: {}", each.join(", ")))
            }
        }
    }
}
