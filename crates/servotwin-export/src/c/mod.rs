//! A diagnoser as C99.
//!
//! The code is written by hand and the same for every diagnoser; it lies in `runtime/`. What was learned is printed as
//! constant tables. So the code can be reviewed once, and a new training changes numbers only.

mod literal;
mod stage;
mod tables;

use crate::error::ExportError;
use servotwin_diagnosis::diagnoser::Diagnoser;

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

/// The hand-written files: name and text.
const RUNTIME: &[(&str, &str)] = &[
    ("servotwin_math.h", include_str!("../../runtime/servotwin_math.h")),
    ("servotwin_math.c", include_str!("../../runtime/servotwin_math.c")),
    ("servotwin_models.h", include_str!("../../runtime/servotwin_models.h")),
    ("servotwin_models.c", include_str!("../../runtime/servotwin_models.c")),
];

/// All files of a diagnoser.
///
/// # Errors
/// The errors of [`Diagnoser::check`]; [`ExportError::Classifier`] and [`ExportError::TooMany`] for models that the C
/// code does not know.
pub fn files(diagnoser: &Diagnoser) -> Result<Vec<CFile>, ExportError> {
    diagnoser.check()?;
    let runtime = RUNTIME.iter().map(|&(name, text)| CFile { name, text: text.into() });
    Ok(runtime.chain(tables::files(diagnoser)?).collect())
}
