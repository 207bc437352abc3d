//! The files of an export.

use servotwin_io::manifest::sha256_of_text;
use std::collections::BTreeMap;

/// A file of an export.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourceFile {
    /// Its name.
    pub name: &'static str,
    /// Its text.
    pub text: String,
}

impl SourceFile {
    /// The SHA-256 of each file.
    pub(crate) fn hashes(files: &[Self]) -> BTreeMap<String, String> {
        files.iter().map(|file| (file.name.into(), sha256_of_text(&file.text))).collect()
    }
}
