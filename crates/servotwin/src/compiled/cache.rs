//! Compiled libraries that later runs find again.
//!
//! The folder is `$SERVOTWIN_CACHE`, or else `servotwin` in the user's folder for caches; an empty `$SERVOTWIN_CACHE`
//! means none. A file is named after the hash of all that it was compiled from and the hash of its content, so a
//! damaged or half-written one is not loaded. A folder of another user, or into which others can write, is not used:
//! its libraries run as part of this program. Whatever cannot be read or written there is compiled again.

use crate::files::write_atomically;
use crate::leftovers::is_private;
use servotwin_model::lanes::Level;
use sha2::{Digest, Sha256};
use std::env;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// The variable that names the folder.
pub const VARIABLE: &str = "SERVOTWIN_CACHE";

/// The beginning of every file name in the folder.
const PREFIX: &str = "step-";

/// The newest libraries that stay; older ones are removed.
const MAX_LIBRARIES: usize = 100;

/// The folder; `None` where there is none.
pub fn folder() -> Option<PathBuf> {
    if let Some(named) = env::var_os(VARIABLE) {
        return Some(PathBuf::from(named)).filter(|folder| !folder.as_os_str().is_empty());
    }
    let from =
        |variable: &str| env::var_os(variable).map(PathBuf::from).filter(|p| p.is_absolute());
    let of_user = from("XDG_CACHE_HOME").or_else(|| Some(from("HOME")?.join(".cache")));
    Some(of_user.or_else(|| from("LOCALAPPDATA"))?.join("servotwin"))
}

/// The libraries in the folder: path and size in bytes, the newest first.
///
/// # Errors
/// The folder exists and cannot be read.
pub fn libraries(folder: &Path) -> io::Result<Vec<(PathBuf, u64)>> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(vec![]),
        entries => entries?,
    };
    let mut found = vec![];
    for entry in entries {
        let entry = entry?;
        let is_ours = entry.file_name().to_string_lossy().starts_with(PREFIX);
        let data = entry.metadata()?;
        if is_ours && data.is_file() {
            found.push((data.modified()?, entry.path(), data.len()));
        }
    }
    found.sort();
    Ok(found.into_iter().rev().map(|(_, path, bytes)| (path, bytes)).collect())
}

/// Removes all libraries and returns their number.
///
/// # Errors
/// The folder cannot be read, or a file cannot be removed.
pub fn clear(folder: &Path) -> io::Result<usize> {
    let found = libraries(folder)?;
    found.iter().try_for_each(|(path, _)| fs::remove_file(path))?;
    Ok(found.len())
}

/// The libraries of one text and one way to compile it.
pub(super) struct CacheEntry {
    folder: PathBuf,
    key: String,
}

impl CacheEntry {
    /// `None` without a folder.
    pub(crate) fn new(text: &str, compiler: &str) -> Option<Self> {
        let mut digest = Sha256::new();
        for part in [env!("CARGO_PKG_VERSION"), text, compiler] {
            digest.update((part.len() as u64).to_le_bytes());
            digest.update(part);
        }
        Some(CacheEntry { folder: folder()?, key: short(&digest.finalize()) })
    }

    fn stem(&self, level: Level) -> String {
        format!("{PREFIX}{}-{}-", self.key, level.name())
    }

    /// The undamaged library of a level.
    pub(crate) fn find(&self, level: Level) -> Option<PathBuf> {
        let stem = self.stem(level);
        if !is_private(&self.folder) {
            return None;
        }
        fs::read_dir(&self.folder).ok()?.flatten().find_map(|entry| {
            let name = entry.file_name().to_string_lossy().into_owned();
            let hash = name.strip_prefix(&stem)?.strip_suffix(".so")?;
            let content = fs::read(entry.path()).ok()?;
            (content_hash(&content) == hash).then(|| entry.path())
        })
    }

    /// Copies a library into the folder. Failing to do so costs the next run some seconds, no result.
    pub(crate) fn keep(&self, level: Level, library: &Path) {
        let Ok(content) = fs::read(library) else { return };
        if create(&self.folder).is_err() || !is_private(&self.folder) {
            return;
        }
        let name = format!("{}{}.so", self.stem(level), content_hash(&content));
        let _ = write_atomically(self.folder.join(name), |out| out.write_all(&content));
        for (path, _) in libraries(&self.folder).unwrap_or_default().iter().skip(MAX_LIBRARIES) {
            let _ = fs::remove_file(path);
        }
    }
}

/// Creates the folder, for this user alone.
fn create(folder: &Path) -> io::Result<()> {
    let mut builder = fs::DirBuilder::new();
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.recursive(true).create(folder)
}

fn content_hash(content: &[u8]) -> String {
    short(&Sha256::digest(content))
}

/// The first 16 hexadecimal digits.
fn short(hash: &[u8]) -> String {
    hash[..8].iter().map(|byte| format!("{byte:02x}")).collect()
}
