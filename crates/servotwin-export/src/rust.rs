//! A diagnoser and its twin as a Rust crate without the standard library.
//!
//! As in [`c`](crate::c), most of the code is written by hand and lies in `runtime/rust/`; what was learned is printed as
//! constant tables, features and equations as statements. The random numbers are the text of `servotwin-diagnosis`.

use crate::error::ExportError;
use crate::notation::Notation;
use crate::source_file::SourceFile;
use crate::twin::ExportedTwin;
use crate::{features, tables};
use servotwin_diagnosis::diagnoser::Diagnoser;

/// Its manifest.
const MANIFEST: &str = "[package]
name = \"servotwin_flight\"
description = \"A trained diagnosis, exported by servotwin\"
version = \"0.1.0\"
edition = \"2024\"
publish = false

[dependencies]
libm = \"0.2\"
";

/// The files of the crate that are the same for every diagnoser: name and text.
macro_rules! runtime {
    ($($name:literal,)*) => {
        &[$((concat!("src/", $name), include_str!(concat!("../runtime/rust/", $name))),)*]
    };
}

/// The root of the crate.
const ROOT: &str = include_str!("../runtime/rust/lib.rs");

/// What the root also has with a twin.
const ROOT_OF_TWIN: &str = include_str!("../runtime/rust/lib_of_twin.rs");

/// The hand-written files of a diagnosis.
const DIAGNOSIS: &[(&str, &str)] = runtime! {
    "alarm.rs",
    "boundary.rs",
    "decision.rs",
    "judge.rs",
    "models.rs",
    "session.rs",
    "trained.rs",
    "windows.rs",
};

/// Those of a twin, alone and beside a diagnosis.
const TWIN: &[(&str, &str)] = runtime! {
    "course.rs",
    "following.rs",
    "hybrid.rs",
    "twin.rs",
};

/// The files that are the same and lie elsewhere.
const SHARED: [(&str, &str); 2] = [
    ("Cargo.toml", MANIFEST),
    ("src/random.rs", include_str!("../../servotwin-diagnosis/src/random.rs")),
];

/// The name of the root.
const ROOT_NAME: &str = "src/lib.rs";

/// The files that are printed for a diagnosis.
const PRINTED: [&str; 3] = ["src/sizes.rs", "src/tables.rs", "src/features.rs"];

/// Those for a twin.
const PRINTED_OF_TWIN: [&str; 3] = ["src/twin_sizes.rs", "src/twin_tables.rs", "src/equations.rs"];

/// The names of all files of a diagnosis and a twin.
pub fn names() -> impl Iterator<Item = &'static str> {
    let written = DIAGNOSIS.iter().chain(TWIN).chain(&SHARED).map(|(name, _)| *name);
    written.chain([ROOT_NAME]).chain(PRINTED).chain(PRINTED_OF_TWIN)
}

/// All files of a diagnoser, without a twin.
///
/// # Errors
/// As [`c::files`](crate::c::files).
pub fn files(diagnoser: &Diagnoser) -> Result<Vec<SourceFile>, ExportError> {
    let root = (ROOT_NAME, ROOT.to_owned());
    Ok(list(with_diagnosis(diagnoser)?.chain([root])))
}

/// All files of a diagnoser with a twin beside it.
///
/// # Errors
/// As [`c::files_with_twin`](crate::c::files_with_twin).
pub fn files_with_twin(
    diagnoser: &Diagnoser,
    twin: &ExportedTwin,
) -> Result<Vec<SourceFile>, ExportError> {
    let printed = PRINTED_OF_TWIN.into_iter().zip(tables::twin::texts(twin, Notation::RUST)?);
    let root = (ROOT_NAME, [ROOT, ROOT_OF_TWIN].concat());
    Ok(list(with_diagnosis(diagnoser)?.chain(written(TWIN)).chain(printed).chain([root])))
}

/// The files of a diagnosis but the root.
fn with_diagnosis(
    diagnoser: &Diagnoser,
) -> Result<impl Iterator<Item = (&'static str, String)>, ExportError> {
    tables::check(diagnoser)?;
    let features = features::text(&diagnoser.sensors_seen(), diagnoser.names(), Notation::RUST);
    let printed = tables::texts(diagnoser, Notation::RUST)?.into_iter().chain([features]);
    Ok(written(DIAGNOSIS).chain(written(&SHARED)).chain(PRINTED.into_iter().zip(printed)))
}

fn written(
    list: &'static [(&'static str, &'static str)],
) -> impl Iterator<Item = (&'static str, String)> {
    list.iter().map(|&(name, text)| (name, text.to_owned()))
}

fn list(files: impl Iterator<Item = (&'static str, String)>) -> Vec<SourceFile> {
    files.map(|(name, text)| SourceFile { name, text }).collect()
}
