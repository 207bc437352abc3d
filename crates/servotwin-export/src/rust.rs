//! A diagnoser as a Rust crate without the standard library.
//!
//! As in [`c`](crate::c), most of the code is written by hand and lies in `runtime/rust/`; what was learned is printed as
//! constant tables, and the features as statements. The random numbers are the text of `servotwin-diagnosis`.

use crate::error::ExportError;
use crate::language::Language;
use crate::source_file::SourceFile;
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

macro_rules! runtime {
    ($($name:literal,)*) => {
        &[$((concat!("src/", $name), include_str!(concat!("../runtime/rust/", $name))),)*]
    };
}

/// The files that are the same for every diagnoser: name and text.
const WRITTEN: &[(&str, &str)] = runtime! {
    "lib.rs",
    "alarm.rs",
    "boundary.rs",
    "decision.rs",
    "judge.rs",
    "models.rs",
    "session.rs",
    "trained.rs",
    "windows.rs",
};

/// The files that are the same and lie elsewhere.
const SHARED: [(&str, &str); 2] = [
    ("Cargo.toml", MANIFEST),
    ("src/random.rs", include_str!("../../servotwin-diagnosis/src/random.rs")),
];

/// The files that are printed.
const PRINTED: [&str; 3] = ["src/sizes.rs", "src/tables.rs", "src/features.rs"];

/// The names of all files.
pub fn names() -> impl Iterator<Item = &'static str> {
    WRITTEN.iter().chain(&SHARED).map(|(name, _)| *name).chain(PRINTED)
}

/// All files of a diagnoser.
///
/// # Errors
/// As [`c::files`](crate::c::files).
pub fn files(diagnoser: &Diagnoser) -> Result<Vec<SourceFile>, ExportError> {
    tables::check(diagnoser)?;
    let features = features::text(&diagnoser.sensors_seen(), diagnoser.names(), Language::Rust);
    let printed = tables::texts(diagnoser, Language::Rust)?.into_iter().chain([features]);
    let written = WRITTEN.iter().chain(&SHARED).map(|&(name, text)| (name, text.to_owned()));
    let all = written.chain(PRINTED.into_iter().zip(printed));
    Ok(all.map(|(name, text)| SourceFile { name, text }).collect())
}
