//! The manifest of an output folder, `manifest.json`: the origin of the results, and the SHA-256 of each file.
//!
//! Readers of a table, a model or the study call [`check`] first, and writers call [`forget`] first. So a damaged or
//! edited file never passes as the written one, and an interrupted stage leaves no claims about its file. Without a
//! manifest, nothing is compared.

use crate::files::{self, FileError};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::io::Read;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// The format name in a manifest.
pub const FORMAT: &str = "servotwin manifest 1";

/// The manifest's file name.
pub const NAME: &str = "manifest.json";

/// The part of a manifest with the file hashes; the writer's other entries stay as they are.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct FileHashes {
    /// The study and system texts that the results come from.
    pub inputs: Vec<FileHash>,
    /// Every result file.
    pub outputs: Vec<FileHash>,
    #[serde(flatten)]
    words: serde_json::Map<String, serde_json::Value>,
}

/// A file with the hash of its content.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FileHash {
    /// Path relative to the folder.
    pub file: String,
    /// SHA-256 of its bytes, in hexadecimal digits.
    pub sha256: String,
}

/// The hash of a file that the inputs and outputs of a manifest know.
pub fn hash_of<'m>(known: [&'m [FileHash]; 2], file: &str) -> Option<&'m FileHash> {
    known.into_iter().flatten().find(|known| known.file == file)
}

/// Writes a manifest into its folder; the same manifest gives the same bytes.
///
/// # Errors
/// If it cannot be written.
pub fn write(folder: &Path, manifest: &impl Serialize) -> Result<(), FileError> {
    let text = serde_json::to_string_pretty(manifest).expect("a manifest is JSON") + "\n";
    files::write_text(folder.join(NAME), &text)
}

/// Reads the manifest of a folder; `None` if there is none of this format.
///
/// # Errors
/// If it cannot be read or is damaged.
pub fn read<Manifest: DeserializeOwned>(folder: &Path) -> Result<Option<Manifest>, FileError> {
    let path = folder.join(NAME);
    let text = match files::read_text(&path) {
        Ok(text) => text,
        Err(FileError::Missing { .. } | FileError::NotFolder { .. }) => return Ok(None),
        Err(error) => return Err(error),
    };
    // Other programs use this file name, and later versions other formats.
    if !text.contains(&format!("\"{FORMAT}\"")) {
        return Ok(None);
    }
    match serde_json::from_str(&text) {
        Ok(manifest) => Ok(Some(manifest)),
        Err(error) => Err(FileError::Altered {
            remedy: format!("{error}; remove it, and the next stage writes it anew"),
            path,
        }),
    }
}

/// Compares a file with its hash in the manifest beside it, if there is one.
///
/// # Errors
/// [`FileError::Altered`], or if the file or the manifest cannot be read.
pub fn check(path: &Path) -> Result<(), FileError> {
    let Some((folder, name)) = place(path).filter(|_| path.is_file()) else { return Ok(()) };
    let Some(manifest) = read::<FileHashes>(folder)? else { return Ok(()) };
    match hash_of([&manifest.inputs, &manifest.outputs], name) {
        Some(known) if known.sha256 != sha256(path)? => {
            Err(FileError::Altered { path: path.into(), remedy: remedy(folder, name) })
        }
        _ => Ok(()),
    }
}

/// Removes a file from the manifest before it is written. A damaged manifest is no error here; readers report it.
///
/// # Errors
/// If the manifest cannot be written.
pub fn forget(path: &Path) -> Result<(), FileError> {
    // Several threads write models and share the manifest.
    static WRITING: Mutex<()> = Mutex::new(());
    let _writing = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
    let Some((folder, name)) = place(path) else { return Ok(()) };
    let Ok(Some(mut manifest)) = read::<FileHashes>(folder) else { return Ok(()) };
    if hash_of([&manifest.inputs, &manifest.outputs], name).is_none() {
        return Ok(());
    }
    manifest.inputs.retain(|known| known.file != name);
    manifest.outputs.retain(|known| known.file != name);
    write(folder, &manifest)
}

/// SHA-256 of a file's bytes, in hexadecimal digits.
///
/// # Errors
/// If the file cannot be read.
pub fn sha256(path: &Path) -> Result<String, FileError> {
    let (mut digest, file) = (Sha256::new(), files::open(path)?);
    loop {
        let mut part = vec![];
        let read = (&file).take(1 << 16).read_to_end(&mut part);
        read.map_err(|cause| FileError::from_io(path, cause))?;
        if part.is_empty() {
            return Ok(in_hexadecimal(digest));
        }
        digest.update(part);
    }
}

/// SHA-256 of a text, in hexadecimal digits.
pub fn sha256_of_text(text: &str) -> String {
    in_hexadecimal(Sha256::new_with_prefix(text))
}

/// The sum of what a digest has taken, in hexadecimal digits.
pub fn in_hexadecimal(digest: Sha256) -> String {
    digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A file's folder and its name in it.
fn place(path: &Path) -> Option<(&Path, &str)> {
    Some((path.parent()?, path.file_name()?.to_str()?))
}

/// File name prefixes with the command that writes such files; `FOLDER` stands for their folder.
const WRITERS: [(&str, &str); 12] = [
    ("study.toml", "study STUDY --suite records --out FOLDER"),
    ("system.toml", "study STUDY --suite records --out FOLDER"),
    ("data-card.md", "study FOLDER --suite records"),
    ("dataset-", "study FOLDER --suite records"),
    ("calibration-", "study FOLDER --suite records --scenario fitted"),
    ("records-", "study FOLDER"),
    ("diagnoser-", "study FOLDER --suite flights"),
    ("flights.json", "study FOLDER --suite flights"),
    ("outcomes-", "study FOLDER --suite flights"),
    ("flights-sealed.json", "study FOLDER --sealed"),
    ("left_out-", "study FOLDER --suite flights"),
    ("evaluation.json", "study FOLDER"),
];

/// The remedy for a file that changed since it was written.
pub fn remedy(folder: &Path, name: &str) -> String {
    let writer = WRITERS.iter().find(|(beginning, _)| name.starts_with(beginning));
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let again = writer.map_or(String::new(), |(_, command)| {
        let command = command.replace("FOLDER", &folder.display().to_string());
        format!("'servotwin {command}' makes it anew; ")
    });
    let manifest = folder.join(NAME);
    format!(
        "its SHA-256 is not the one in {NAME}; {again}if you changed it on purpose, remove {}",
        manifest.display()
    )
}
