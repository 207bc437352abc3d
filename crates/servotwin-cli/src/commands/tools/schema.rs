//! `servotwin tools schema`: writes the JSON Schema of a file format, for editors.

use crate::render::json;
use servotwin::{format, schema};
use servotwin_watch::map;

/// Write the JSON Schema (draft 2020-12) of system, study or map files, for completion and checks in editors.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The file format.
    format: Format,
}

/// A format of files.
#[derive(Clone, Copy, clap::ValueEnum)]
enum Format {
    /// System files.
    System,
    /// Study files.
    Study,
    /// Map files.
    Map,
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options) -> String {
    json(&match options.format {
        Format::System => schema::system(),
        Format::Study => schema::study(),
        Format::Map => format::schema("servotwin map file", map::keys(), Default::default()),
    })
}
