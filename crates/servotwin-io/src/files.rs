//! Reading and writing whole files: every writer of the toolkit goes through here.
//!
//! A result file is either the old one or the complete new one, never half of it. [`AtomicFile`] writes beside the
//! target under a hidden temporary name. [`AtomicFile::commit`] flushes it to the disk and renames it over the target.
//! If it is dropped without a commit, on an error or during a panic, it removes the temporary file.
//!
//! A target that is no regular file (`/dev/stdout`, a pipe) cannot be replaced by renaming, so it is written directly.
//! A file that is mounted by itself, as in a container, is overwritten when the new content is complete.

use crate::leftovers::{PREFIX, is_abandoned};
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use tempfile::TempPath;

/// Errors of reading or writing a file, with its path.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
pub enum FileError {
    /// The file does not exist.
    #[error("{path}: no such file")]
    Missing { path: PathBuf },
    /// The file does not exist, and there is no built-in of that name.
    #[error(
        "{path}: no such file, and nothing is built in by that name{}",
        built_in(*.nearest, .known)
    )]
    NotBuiltIn { path: PathBuf, nearest: Option<&'static str>, known: Vec<&'static str> },
    /// The folder that should hold the file does not exist.
    #[error("{path}: the folder {} does not exist", folder_of(.path).display())]
    MissingFolder { path: PathBuf },
    /// The path names a folder where a file is needed.
    #[error("{path}: this is a folder, a file is needed")]
    IsFolder { path: PathBuf },
    /// A part of the path that should be a folder is a file.
    #[error("{path}: a part of this path is a file where a folder is needed")]
    NotFolder { path: PathBuf },
    /// The file or its folder may not be read or written by this user.
    #[error("{path}: permission denied")]
    Denied { path: PathBuf },
    /// The file, its folder or the file system is read-only.
    #[error("{path}: read-only, it cannot be written")]
    ReadOnly { path: PathBuf },
    /// The disk or the user's quota is full.
    #[error("{path}: the disk is full")]
    DiskFull { path: PathBuf },
    /// The content is no UTF-8 text.
    #[error("{path}: line {line} is not UTF-8 text")]
    NotText { path: PathBuf, line: usize },
    /// The content changed since it was written: by damage or by hand.
    #[error("{path}: damaged, or changed since: {remedy}")]
    Altered { path: PathBuf, remedy: String },
    /// The operating system limits the size of files.
    #[error("{path}: the file would exceed the limit of size for this process (ulimit -f)")]
    SizeLimit { path: PathBuf },
    /// The path names a device or a pipe where a regular file is needed.
    #[error("{path}: this is a {what}, a regular file is needed")]
    NotRegular { path: PathBuf, what: &'static str },
    /// The file is longer than such a file can be.
    #[error("{path}: longer than {} MiB, the limit for such a file", limit >> 20)]
    TooLong { path: PathBuf, limit: u64 },
    /// Any other failure reported by the operating system.
    #[error("{path}: {source}")]
    System { path: PathBuf, source: io::Error },
}

impl FileError {
    /// Classifies an operating system's error on `path`.
    pub fn from_io(path: &Path, source: io::Error) -> Self {
        use io::ErrorKind as Kind;
        let path = path.to_path_buf();
        match source.kind() {
            Kind::NotFound => FileError::Missing { path },
            Kind::IsADirectory => FileError::IsFolder { path },
            Kind::NotADirectory => FileError::NotFolder { path },
            Kind::PermissionDenied => FileError::Denied { path },
            Kind::ReadOnlyFilesystem => FileError::ReadOnly { path },
            Kind::StorageFull | Kind::QuotaExceeded => FileError::DiskFull { path },
            Kind::FileTooLarge => FileError::SizeLimit { path },
            Kind::WouldBlock => FileError::NotRegular { path, what: "file without an end" },
            _ => FileError::System { path, source },
        }
    }

    /// The affected file.
    pub fn path(&self) -> &Path {
        match self {
            FileError::Missing { path }
            | FileError::NotBuiltIn { path, .. }
            | FileError::MissingFolder { path }
            | FileError::IsFolder { path }
            | FileError::NotFolder { path }
            | FileError::Denied { path }
            | FileError::ReadOnly { path }
            | FileError::DiskFull { path }
            | FileError::NotText { path, .. }
            | FileError::Altered { path, .. }
            | FileError::SizeLimit { path }
            | FileError::NotRegular { path, .. }
            | FileError::TooLong { path, .. }
            | FileError::System { path, .. } => path,
        }
    }
}

fn built_in(nearest: Option<&str>, known: &[&str]) -> String {
    match nearest {
        Some(name) => format!("; did you mean '{name}'?"),
        None => format!(": there are {}", known.join(", ")),
    }
}

/// A file that replaces its target only when committed.
#[derive(Debug)]
pub struct AtomicFile {
    target: PathBuf,
    /// `None` once committed.
    writer: Option<BufWriter<File>>,
    /// Beside the target; `None` when the target is a device or a pipe and is written directly.
    temporary: Option<TempPath>,
    /// The operating system's code of the last error.
    failure: Option<i32>,
}

impl AtomicFile {
    /// Opens a temporary file in the folder of `path`.
    pub fn create(path: impl AsRef<Path>) -> Result<Self, FileError> {
        // For a symbolic link, the target file is replaced and the link stays.
        let target = resolve_links(path.as_ref());
        let existing = fs::metadata(&target).ok();
        match &existing {
            Some(found) if found.is_dir() => Err(FileError::IsFolder { path: target }),
            Some(found) if !found.is_file() => Self::open_directly(target),
            // Renaming would replace a read-only file: respect the user's protection instead.
            Some(found) if found.permissions().readonly() => {
                Err(FileError::ReadOnly { path: target })
            }
            _ => Self::open_beside(target, existing.map(|found| found.permissions())),
        }
    }

    fn open_directly(target: PathBuf) -> Result<Self, FileError> {
        let file = OpenOptions::new().write(true).open(&target);
        let file = file.map_err(|cause| FileError::from_io(&target, cause))?;
        Ok(Self { target, temporary: None, writer: Some(BufWriter::new(file)), failure: None })
    }

    fn open_beside(
        target: PathBuf,
        permissions: Option<fs::Permissions>,
    ) -> Result<Self, FileError> {
        let name = format!(".{PREFIX}");
        let file = tempfile::Builder::new().prefix(&name).suffix(".tmp").make_in(
            folder_of(&target),
            |path| {
                let file = OpenOptions::new().write(true).create_new(true).open(path)?;
                // Best effort: not every file system has locks.
                let _ = file.lock();
                // Another process that removes leftovers may have had the lock first.
                if path.exists() { Ok(file) } else { Err(io::ErrorKind::AlreadyExists.into()) }
            },
        );
        let file = file.map_err(|cause| match cause.kind() {
            // A file system such as /proc has the folder and takes no new file.
            io::ErrorKind::NotFound if folder_of(&target).is_dir() => {
                FileError::ReadOnly { path: target.clone() }
            }
            io::ErrorKind::NotFound => FileError::MissingFolder { path: target.clone() },
            _ => FileError::from_io(&target, cause),
        })?;
        let (file, temporary) = file.into_parts();
        if let Some(permissions) = permissions {
            // Best effort: a file system without permissions must not lose a result.
            let _ = file.set_permissions(permissions);
        }
        let writer = Some(BufWriter::new(file));
        Ok(Self { target, writer, temporary: Some(temporary), failure: None })
    }

    /// The file that [`commit`](Self::commit) will replace.
    pub(crate) fn path(&self) -> &Path {
        &self.target
    }

    /// Flushes everything to the disk and replaces the target.
    pub fn commit(mut self) -> Result<(), FileError> {
        let target = self.target.clone();
        self.finish().map_err(|cause| FileError::from_io(&target, cause))
    }

    /// The cause of the last failed write, for callers behind a library that wraps the error in its own.
    pub(crate) fn failure(&self) -> Option<io::Error> {
        self.failure.map(io::Error::from_raw_os_error)
    }

    fn finish(&mut self) -> io::Result<()> {
        let Some(mut writer) = self.writer.take() else {
            return Ok(());
        };
        writer.flush()?;
        let Some(temporary) = self.temporary.take() else {
            return Ok(());
        };
        writer.get_ref().sync_all()?;
        drop(writer);
        match temporary.persist(&self.target) {
            // A mounted file cannot be replaced by another.
            Err(refused) if refused.error.kind() == io::ErrorKind::ResourceBusy => {
                fs::copy(&refused.path, &self.target)?;
                File::open(&self.target)?.sync_all()?;
            }
            renamed => renamed?,
        }
        // Only a synchronized folder makes the rename durable; not every file system supports it.
        if let Ok(folder) = File::open(folder_of(&self.target)) {
            let _ = folder.sync_all();
        }
        Ok(())
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let Some(writer) = &mut self.writer else {
            return Err(io::ErrorKind::BrokenPipe.into());
        };
        writer.write(bytes).inspect_err(|error| self.failure = error.raw_os_error())
    }

    fn flush(&mut self) -> io::Result<()> {
        let flushed = self.writer.as_mut().map_or(Ok(()), BufWriter::flush);
        flushed.inspect_err(|error| self.failure = error.raw_os_error())
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match &mut self.writer {
            Some(writer) => writer.seek(to),
            None => Err(io::ErrorKind::BrokenPipe.into()),
        }
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if let Some(writer) = self.writer.take() {
            // Without a commit, discard the buffer instead of writing it.
            let _ = writer.into_parts();
        }
    }
}

/// Writes a whole file through `fill`; on any error the old file stays as it was.
pub fn write_atomically(
    path: impl AsRef<Path>,
    fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), FileError> {
    let mut file = AtomicFile::create(path)?;
    fill(&mut file).map_err(|cause| FileError::from_io(file.path(), cause))?;
    file.commit()
}

/// Writes a text as a whole file; on any error the old file stays as it was.
pub fn write_text(path: impl AsRef<Path>, text: &str) -> Result<(), FileError> {
    write_atomically(path, |out| out.write_all(text.as_bytes()))
}

/// Checks that a file can be written, and leaves everything as it is.
pub fn check_writable(path: impl AsRef<Path>) -> Result<(), FileError> {
    let path = path.as_ref();
    match fs::metadata(path) {
        // A device or a pipe is not opened before there is something to write.
        Ok(found) if !found.is_file() && !found.is_dir() => Ok(()),
        _ => AtomicFile::create(path).map(drop),
    }
}

/// Opens a regular file for reading. A device may have no end, and a pipe may have no beginning. A read never waits:
/// some files of the kernel (`/proc/kmsg`) pass for regular ones and wait for new messages.
pub fn open(path: impl AsRef<Path>) -> Result<File, FileError> {
    let path = path.as_ref();
    // The opening of a pipe waits for its writer, so its kind is asked first.
    match fs::metadata(path) {
        Ok(data) if !data.is_file() && !data.is_dir() => {
            let what = kind_in_words(data.file_type());
            Err(FileError::NotRegular { path: path.to_path_buf(), what })
        }
        _ => {
            let mut options = File::options();
            #[cfg(unix)]
            std::os::unix::fs::OpenOptionsExt::custom_flags(&mut options, libc::O_NONBLOCK);
            options.read(true).open(path).map_err(|cause| FileError::from_io(path, cause))
        }
    }
}

/// The word for an entry of a folder that is no regular file.
pub fn kind_in_words(kind: fs::FileType) -> &'static str {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        if kind.is_fifo() {
            return "named pipe";
        }
        if kind.is_socket() {
            return "socket";
        }
    }
    if kind.is_dir() { "folder" } else { "device" }
}

/// The most bytes of a file that is read whole: the largest models have a tenth of it.
const MAX_WHOLE: u64 = 1 << 30;
/// The most bytes of a file that a person writes: the largest systems have a tenth of it.
const MAX_DOCUMENT: u64 = 1 << 20;

/// Reads a whole file of at most 1 GiB.
pub fn read_bytes(path: impl AsRef<Path>) -> Result<Vec<u8>, FileError> {
    read_at_most(MAX_WHOLE, path.as_ref())
}

fn read_at_most(limit: u64, path: &Path) -> Result<Vec<u8>, FileError> {
    let mut bytes = vec![];
    let read = open(path)?.take(limit + 1).read_to_end(&mut bytes);
    read.map_err(|cause| FileError::from_io(path, cause))?;
    match bytes.len() as u64 > limit {
        true => Err(FileError::TooLong { path: path.to_path_buf(), limit }),
        false => Ok(bytes),
    }
}

/// Reads a whole UTF-8 text file of at most 1 GiB, without a byte order mark at its start.
pub fn read_text(path: impl AsRef<Path>) -> Result<String, FileError> {
    text_of(read_bytes(&path)?, path.as_ref())
}

/// As [`read_text`], for a file that a person writes: at most 1 MiB.
pub fn read_toml(path: impl AsRef<Path>) -> Result<String, FileError> {
    text_of(read_at_most(MAX_DOCUMENT, path.as_ref())?, path.as_ref())
}

fn text_of(bytes: Vec<u8>, path: &Path) -> Result<String, FileError> {
    let text = String::from_utf8(bytes).map_err(|cause| {
        let valid = cause.utf8_error().valid_up_to();
        let line = 1 + cause.as_bytes()[..valid].iter().filter(|byte| **byte == b'\n').count();
        FileError::NotText { path: path.to_path_buf(), line }
    })?;
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
}

/// Creates a folder and its parents; an existing folder is no error.
pub fn create_folder(path: impl AsRef<Path>) -> Result<(), FileError> {
    let path = path.as_ref();
    fs::create_dir_all(path).map_err(|cause| match cause.kind() {
        io::ErrorKind::AlreadyExists => FileError::NotFolder { path: path.to_path_buf() },
        // Missing parents are made, so a file system such as /proc makes none.
        io::ErrorKind::NotFound => FileError::ReadOnly { path: path.to_path_buf() },
        _ => FileError::from_io(path, cause),
    })
}

/// Removes temporary files of killed writers in a folder, as far as possible. Those of running ones stay.
pub fn remove_leftovers(folder: impl AsRef<Path>) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_ours = name.strip_prefix('.').is_some_and(|name| name.starts_with(PREFIX));
        if is_ours && name.ends_with(".tmp") && is_abandoned(&entry) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// The file that a path leads to through symbolic links, also if that file does not exist yet.
pub fn resolve_links(path: &Path) -> PathBuf {
    /// As many links as Linux follows.
    const MAX_LINKS: usize = 40;
    let mut target = path.to_path_buf();
    for _ in 0..MAX_LINKS {
        if fs::metadata(&target).is_ok() {
            break;
        }
        let Ok(next) = fs::read_link(&target) else { break };
        target = folder_of(&target).join(next);
    }
    fs::canonicalize(&target).unwrap_or(target)
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}
