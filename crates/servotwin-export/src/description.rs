//! What an export was made of, as data.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The name of the file.
pub(crate) const DESCRIPTION: &str = "export.json";

/// What an export was made of.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// The version of servotwin.
    pub version: String,
    /// The file of the diagnoser.
    pub diagnoser: PathBuf,
    /// Its SHA-256.
    pub diagnoser_sha256: String,
    /// The twin.
    pub twin: TwinDescription,
    /// The SHA-256 of the system, the study and the data sets that lie beside the diagnoser.
    pub(crate) sources_sha256: BTreeMap<String, String>,
    /// The SHA-256 of each file when it was written.
    pub files_sha256: BTreeMap<String, String>,
}

/// The twin of an export.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TwinDescription {
    /// The study, by the name or the file that was given.
    pub study: PathBuf,
    /// A number that other equations of the twin do not have.
    pub(crate) system: u64,
    /// Whether its steps are fixed.
    pub has_fixed_step: bool,
}
