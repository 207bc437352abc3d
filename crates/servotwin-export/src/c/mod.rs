//! A diagnoser as C99.
//!
//! Most of the code is written by hand and the same for every diagnoser; it lies in `runtime/`. What was learned is
//! printed as constant tables, and the features as statements. So the code can be reviewed once.

mod features;
mod literal;
mod tables;

use crate::error::ExportError;
use servotwin_diagnosis::diagnoser::{Diagnoser, Length};
use servotwin_io::manifest::sha256_of_text;
use std::collections::BTreeMap;

/// `SERVOTWIN_MOST_CLASSES` of the C code.
const MOST_CLASSES: usize = 32;

/// A file of an export.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CFile {
    /// Its name.
    pub name: &'static str,
    /// Its text.
    pub text: String,
}

macro_rules! runtime {
    ($($name:literal,)*) => {
        /// The hand-written files: name and text.
        const RUNTIME: &[(&str, &str)] = &[$(($name, include_str!(concat!("../../runtime/", $name))),)*];
    };
}

runtime! {
    "servotwin_math.h",
    "servotwin_math.c",
    "servotwin_random.h",
    "servotwin_random.c",
    "servotwin_models.h",
    "servotwin_models.c",
    "servotwin_windows.h",
    "servotwin_windows.c",
    "servotwin_tables.h",
    "servotwin_features.h",
    "servotwin_judge.h",
    "servotwin_judge.c",
    "servotwin_decision.h",
    "servotwin_decision.c",
    "servotwin_boundary.h",
    "servotwin_boundary.c",
    "servotwin_session.h",
    "servotwin_session.c",
    "main.c",
}

/// The files that are printed.
const PRINTED: [&str; 3] = ["servotwin_sizes.h", "servotwin_tables.c", "servotwin_features.c"];

/// The names of all files.
pub fn names() -> impl Iterator<Item = &'static str> {
    RUNTIME.iter().map(|(name, _)| *name).chain(PRINTED)
}

/// The SHA-256 of each file.
pub fn hashes(files: &[CFile]) -> BTreeMap<String, String> {
    files.iter().map(|file| (file.name.into(), sha256_of_text(&file.text))).collect()
}

/// All files of a diagnoser, in the order of [`names`].
///
/// # Errors
/// The errors of [`Diagnoser::check`]; [`ExportError::Classifier`], [`ExportError::TooMany`] and
/// [`ExportError::Unsupported`] for what the C code does not know.
pub fn files(diagnoser: &Diagnoser) -> Result<Vec<CFile>, ExportError> {
    diagnoser.check()?;
    if diagnoser.conditional_band.is_some() {
        let why = "a band that depends on the operating point has no C counterpart yet";
        return Err(ExportError::Unsupported(why));
    }
    let differs = |length: &Length| length.panel.trees.names.features != diagnoser.names().features;
    if diagnoser.lengths.iter().any(differs) {
        let why = "window lengths with different features cannot be exported";
        return Err(ExportError::Unsupported(why));
    }
    let runtime = RUNTIME.iter().map(|&(_, text)| text.to_owned());
    let features = features::text(&diagnoser.sensors_seen(), diagnoser.names());
    let texts = runtime.chain(tables::texts(diagnoser)?).chain([features]);
    Ok(names().zip(texts).map(|(name, text)| CFile { name, text }).collect())
}
