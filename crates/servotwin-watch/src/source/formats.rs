//! The formats of log files. A new format is one module here and one entry in [`FORMATS`].

use super::{LogColumn, Source, SourceError, Wanted, lines, table};
use servotwin_io::files::{self, FileError};
use std::io::Read as _;
use std::path::Path;

/// A format of log files.
struct LogFormat {
    /// The extensions of its files, in lower case.
    extensions: &'static [&'static str],
    /// The first bytes of its files, whatever their names are; empty for text.
    mark: &'static [u8],
    reader: Reader,
}

type Opened = Result<Box<dyn Source>, SourceError>;

/// How files of a format are read.
#[derive(Clone, Copy)]
pub(super) struct Reader {
    /// Opens a file that must have the wanted columns.
    pub open: fn(&Path, &Wanted) -> Opened,
    /// The columns of a file, with units and first numbers if known.
    pub columns: fn(&Path) -> Result<Vec<LogColumn>, SourceError>,
}

/// All formats. A file that is of no other is text.
static FORMATS: [LogFormat; 2] = [
    LogFormat {
        extensions: &["csv", "tsv", "jsonl", "ndjson"],
        mark: b"",
        reader: Reader { open: lines::open, columns: lines::columns },
    },
    LogFormat {
        extensions: &["parquet"],
        mark: b"PAR1",
        reader: Reader { open: table::open, columns: table::columns },
    },
];

impl LogFormat {
    fn has_extension_of(&self, path: &Path) -> bool {
        let own = path.extension().and_then(|extension| extension.to_str());
        own.is_some_and(|own| self.extensions.iter().any(|known| own.eq_ignore_ascii_case(known)))
    }
}

/// Whether a file may be a log, judged by its extension.
pub fn is_log(path: &Path) -> bool {
    FORMATS.iter().any(|format| format.has_extension_of(path))
}

/// The extensions of all formats, for messages.
pub fn extensions() -> String {
    let all = FORMATS.iter().flat_map(|format| format.extensions);
    all.map(|extension| format!(".{extension}")).collect::<Vec<_>>().join(", ")
}

/// The reader of a file: by its first bytes, or else by its extension.
pub(super) fn reader_of(path: &Path) -> Result<Reader, SourceError> {
    let mut head = vec![];
    let read = files::open(path)?.take(8).read_to_end(&mut head);
    read.map_err(|cause| FileError::from_io(path, cause))?;
    let is_marked = |format: &&LogFormat| !format.mark.is_empty() && head.starts_with(format.mark);
    let by_name = || FORMATS.iter().find(|format| format.has_extension_of(path));
    let found = FORMATS.iter().find(is_marked).or_else(by_name);
    Ok(found.unwrap_or(&FORMATS[0]).reader)
}
