//! A diagnoser as C99.
//!
//! The code is written by hand and the same for every diagnoser; it lies in `runtime/`. What was learned is printed as
//! constant tables. So the code can be reviewed once, and a new training changes numbers only.

mod features;
mod literal;
mod tables;

use crate::error::ExportError;
use servotwin_diagnosis::diagnoser::{Diagnoser, Length};

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

/// All files of a diagnoser.
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
    let names = |length: &Length| length.panel.trees.names.features.clone();
    if diagnoser.lengths.iter().any(|length| names(length) != names(&diagnoser.lengths[0])) {
        let why = "window lengths with different features cannot be exported";
        return Err(ExportError::Unsupported(why));
    }
    let runtime = RUNTIME.iter().map(|&(name, text)| CFile { name, text: text.into() });
    let features = features::file(&diagnoser.sensors_seen(), diagnoser.names());
    Ok(runtime.chain(tables::files(diagnoser)?).chain([features]).collect())
}
