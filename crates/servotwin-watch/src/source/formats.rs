//! The formats of log files. A new format is one module here and one entry in [`FORMATS`].

use super::{LogColumn, Source, SourceError, Wanted};
use servotwin_io::files::{self, FileError};
use std::io::Read as _;
use std::path::Path;

/// How many bytes of a file are examined for the marks of its format.
const HEAD: u64 = 512;

/// A format of log files.
struct LogFormat {
    /// The extensions of its files, in lower case.
    extensions: &'static [&'static str],
    /// Whether the first bytes of a file are those of the format, whatever its name is.
    probe: fn(&[u8]) -> bool,
    /// Its reader, or the feature that this program was built without.
    reader: Result<Reader, &'static str>,
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

/// The reader of a module, or the name of its feature if that is off.
macro_rules! reader {
    ($module:ident) => {
        Ok(Reader { open: super::$module::open, columns: super::$module::columns })
    };
    ($module:ident, $feature:literal) => {{
        #[cfg(feature = $feature)]
        {
            reader!($module)
        }
        #[cfg(not(feature = $feature))]
        {
            Err($feature)
        }
    }};
}

/// All formats. A file that is of no other is text.
static FORMATS: [LogFormat; 4] = [
    LogFormat {
        extensions: &["csv", "tsv", "jsonl", "ndjson"],
        probe: |_| false,
        reader: reader!(lines),
    },
    LogFormat {
        extensions: &["parquet"],
        probe: |head| head.starts_with(b"PAR1"),
        reader: reader!(table),
    },
    LogFormat {
        extensions: &["mcap"],
        probe: |head| head.starts_with(b"\x89MCAP"),
        reader: reader!(mcap, "mcap"),
    },
    LogFormat {
        extensions: &["mf4", "mdf"],
        probe: |head| head.starts_with(b"MDF     ") || head.starts_with(b"UnFinMF "),
        reader: reader!(mf4, "mf4"),
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
    let read = files::open(path)?.take(HEAD).read_to_end(&mut head);
    read.map_err(|cause| FileError::from_io(path, cause))?;
    let by_content = FORMATS.iter().find(|format| (format.probe)(&head));
    let found = by_content.or_else(|| FORMATS.iter().find(|format| format.has_extension_of(path)));
    let feature_needed =
        |feature| SourceError::Feature { what: path.display().to_string(), feature };
    found.unwrap_or(&FORMATS[0]).reader.map_err(feature_needed)
}
