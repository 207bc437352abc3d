//! A diagnoser and its twin as C99.
//!
//! Most of the code is written by hand and the same for every diagnoser; it lies in `runtime/`. What was learned is
//! printed as constant tables, and the features as statements. So the code can be reviewed once.

use crate::error::ExportError;
use crate::source_file::SourceFile;
use crate::twin::ExportedTwin;
use crate::{features, tables};
use servotwin_diagnosis::diagnoser::Diagnoser;

macro_rules! runtime {
    ($(#[$note:meta])* $list:ident: $($name:literal,)*) => {
        $(#[$note])*
        const $list: &[(&str, &str)] =
            &[$(($name, include_str!(concat!("../runtime/", $name))),)*];
    };
}

runtime! {
    /// The hand-written file that every other one includes: name and text.
    COMMON:
    "servotwin_exact.h",
}

runtime! {
    /// Those of a diagnosis.
    DIAGNOSIS:
    "servotwin_math.h",
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
}

runtime! {
    /// Those of arithmetic.
    ARITHMETIC:
    "servotwin_real.h",
    "servotwin_math.c",
}

runtime! {
    /// Those of a twin.
    TWIN:
    "servotwin_equations.h",
    "servotwin_twin.h",
    "servotwin_twin.c",
}

runtime! {
    /// Those that run a twin beside a diagnosis.
    HYBRID:
    "servotwin_hybrid.h",
    "servotwin_hybrid.c",
    "main.c",
}

/// The files that are printed for a diagnosis.
const PRINTED: [&str; 3] = ["servotwin_sizes.h", "servotwin_tables.c", "servotwin_features.c"];

/// Those for a twin.
const PRINTED_OF_TWIN: [&str; 3] =
    ["servotwin_twin_sizes.h", "servotwin_twin_tables.c", "servotwin_equations.c"];

/// All files of a diagnoser, without a twin.
///
/// # Errors
/// The errors of [`Diagnoser::check`]; [`ExportError::Classifier`], [`ExportError::TooMany`] and
/// [`ExportError::Unsupported`] for what the C code does not know.
pub fn files(diagnoser: &Diagnoser) -> Result<Vec<SourceFile>, ExportError> {
    tables::check(diagnoser)?;
    let features = features::text(&diagnoser.sensors_seen(), diagnoser.names());
    let printed = tables::texts(diagnoser)?.into_iter().chain([features]);
    let common = written(COMMON.iter().chain(DIAGNOSIS).copied());
    Ok(common.chain(together(ARITHMETIC.iter().copied(), PRINTED, printed)).collect())
}

/// All files of a diagnoser with a twin beside it.
///
/// # Errors
/// The errors of [`files`] and `files_of_twin`.
pub fn files_with_twin(
    diagnoser: &Diagnoser,
    twin: &ExportedTwin,
) -> Result<Vec<SourceFile>, ExportError> {
    let hybrid = written(HYBRID.iter().copied());
    Ok([files(diagnoser)?, own_files_of_twin(twin)?, hybrid.collect()].concat())
}

/// The hand-written files of random numbers.
pub(crate) fn files_of_random() -> impl Iterator<Item = SourceFile> {
    named("servotwin_random")
}

/// The hand-written files of a diagnosis whose names begin thus.
fn named(beginning: &str) -> impl Iterator<Item = SourceFile> {
    let all = ARITHMETIC.iter().chain(DIAGNOSIS).copied();
    written(all.filter(move |(name, _)| name.starts_with(beginning)))
}

/// The files of a twin alone.
///
/// # Errors
/// [`ExportError::Unsupported`] for an explicit method.
pub(crate) fn files_of_twin(twin: &ExportedTwin) -> Result<Vec<SourceFile>, ExportError> {
    Ok(arithmetic().chain(own_files_of_twin(twin)?).collect())
}

/// The hand-written files of trained models.
pub(crate) fn files_of_models() -> impl Iterator<Item = SourceFile> {
    arithmetic().chain(named("servotwin_models"))
}

fn arithmetic() -> impl Iterator<Item = SourceFile> {
    let common = written(COMMON.iter().copied());
    common.chain(named("servotwin_real")).chain(named("servotwin_math"))
}

fn own_files_of_twin(twin: &ExportedTwin) -> Result<Vec<SourceFile>, ExportError> {
    Ok(together(TWIN.iter().copied(), PRINTED_OF_TWIN, tables::twin::texts(twin)?))
}

fn together(
    list: impl IntoIterator<Item = (&'static str, &'static str)>,
    names: [&'static str; 3],
    printed: impl IntoIterator<Item = String>,
) -> Vec<SourceFile> {
    let printed = names.into_iter().zip(printed).map(|(name, text)| SourceFile { name, text });
    written(list).chain(printed).collect()
}

/// The hand-written files of a list.
fn written(
    list: impl IntoIterator<Item = (&'static str, &'static str)>,
) -> impl Iterator<Item = SourceFile> {
    list.into_iter().map(|(name, text)| SourceFile { name, text: text.to_owned() })
}
