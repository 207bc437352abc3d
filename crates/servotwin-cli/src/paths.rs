//! The input and output files of a command, checked before it reads or writes any of them.
//!
//! A result that overwrites its own source is lost work. So no output may be the same file as an input or as
//! another output, under any name or link. No output may have the extension of another kind of
//! file.

use crate::failure::Failure;
use servotwin::files::{check_writable, remove_leftovers, resolve_links};
use servotwin::study::Study;
use servotwin::table;
use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::{fmt, fs};

/// A file, with the option that names it or a description of it.
#[derive(Debug)]
struct Named {
    option: &'static str,
    path: PathBuf,
}

/// The kind of an output, which determines the allowed extensions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Format {
    /// A table; its extension selects the format.
    Table,
    /// One fixed format. The name has one of these extensions, or none.
    Only(&'static [&'static str]),
    /// A file with any extension, or one whose command checks it.
    Any,
}

impl Format {
    /// An HTML page.
    pub(crate) const HTML: Format = Format::Only(&["html", "htm"]);
    /// A figure.
    pub(crate) const SVG: Format = Format::Only(&["svg"]);
    /// A system or a map.
    pub(crate) const TOML: Format = Format::Only(&["toml"]);
    /// Events, one in each line.
    pub(crate) const LINES: Format = Format::Only(&["jsonl", "ndjson", "json", "log", "txt"]);

    fn check(self, option: &'static str, path: &Path) -> Result<(), Failure> {
        let ending = path.extension().and_then(OsStr::to_str).unwrap_or_default();
        let ending = ending.to_ascii_lowercase();
        match self {
            Format::Table => Ok(table::format_of(path).map(|_| ())?),
            Format::Only(allowed) if !ending.is_empty() && !allowed.contains(&&*ending) => {
                let (ending, path) = (allowed[0], path.display());
                Err(Failure::usage(format!("{option} must end in .{ending}, not as {path} does")))
            }
            _ => Ok(()),
        }
    }
}

/// The input and output files of a command.
#[derive(Debug, Default)]
pub(crate) struct Paths {
    reads: Vec<Named>,
    writes: Vec<(Named, Format)>,
}

impl Paths {
    /// Adds input files, with their name in messages.
    pub(crate) fn read<P: AsRef<Path>>(
        mut self,
        option: &'static str,
        paths: impl IntoIterator<Item = P>,
    ) -> Self {
        let named = paths.into_iter().map(|path| Named { option, path: path.as_ref().into() });
        self.reads.extend(named);
        self
    }

    /// Adds a study file, and the file of the system that it names.
    pub(crate) fn read_study(self, study: Option<&PathBuf>) -> Self {
        let system = study.and_then(|path| Study::system_file(path));
        self.read("the study", study).read("the study's system", system)
    }

    /// Adds output files.
    pub(crate) fn write<P: AsRef<Path>>(
        mut self,
        option: &'static str,
        format: Format,
        paths: impl IntoIterator<Item = P>,
    ) -> Self {
        let named = paths.into_iter().map(|path| Named { option, path: path.as_ref().into() });
        self.writes.extend(named.map(|named| (named, format)));
        self
    }

    /// Removes temporary files that killed commands left next to the outputs.
    pub(crate) fn remove_leftovers(&self) {
        let beside = self.writes.iter().filter_map(|(written, _)| {
            // For a link, the file that it points to is replaced.
            let target = resolve_links(&written.path);
            let folder = target.parent()?.to_path_buf();
            Some(if folder.as_os_str().is_empty() { PathBuf::from(".") } else { folder })
        });
        let folders: BTreeSet<PathBuf> = beside.collect();
        folders.iter().for_each(remove_leftovers);
    }

    /// Checks that the command may read and write all files together.
    ///
    /// # Errors
    /// The first conflict.
    pub(crate) fn check(self) -> Result<(), Failure> {
        let Paths { mut reads, writes } = self;
        let mut before: Vec<(Named, Format)> = vec![];
        for (written, format) in writes {
            let is_same = |other: &Named| are_one(&written.path, &other.path);
            if let Some(place) = reads.iter().position(is_same) {
                return Err(Failure::usage(format!(
                    "{written} would overwrite {}, which is read: name another file",
                    reads.swap_remove(place)
                )));
            }
            if let Some(place) = before.iter().position(|(other, _)| is_same(other)) {
                let (first, _) = before.swap_remove(place);
                return Err(Failure::usage(format!(
                    "{first} and {written} are the same file: name two"
                )));
            }
            before.push((written, format));
        }
        // Report a file that would be lost first; another extension would not save it.
        before
            .iter()
            .try_for_each(|(written, format)| format.check(written.option, &written.path))?;
        // Nobody waits hours for a result that cannot be written.
        before.iter().try_for_each(|(written, _)| Ok(check_writable(&written.path)?))
    }
}

impl fmt::Display for Named {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{} {}", self.option, self.path.display())
    }
}

/// Whether two paths lead, or would lead, to the same regular file. Devices and pipes may be shared.
fn are_one(one: &Path, other: &Path) -> bool {
    match (fs::metadata(one), fs::metadata(other)) {
        (Ok(own), Ok(others)) => {
            own.is_file()
                && others.is_file()
                && same_file::is_same_file(one, other).unwrap_or(false)
        }
        (Err(_), Err(_)) => resolved(one) == resolved(other),
        _ => false,
    }
}

/// Resolves the links of a path to a file that does not exist yet, and those of its folder.
fn resolved(path: &Path) -> PathBuf {
    let path = resolve_links(path);
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    match (fs::canonicalize(folder.unwrap_or(Path::new("."))), path.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => path,
    }
}
