//! What a folder's `manifest.json` says of the files beside it: where results come from, and the SHA-256 of each.
//!
//! Who reads a table, a model or the study asks [`check`] first, who writes one tells [`forget`] first. So a file that was damaged or
//! changed by hand is never taken for the one that was written, and a stage that ends early leaves a file of which
//! nothing is claimed. Where there is no manifest, nothing is compared.

use crate::files::{self, FileError, read_through, write_atomically};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// The word that a manifest begins with.
pub const FORMAT: &str = "servotwin manifest 1";

/// Its name in the folder.
pub const NAME: &str = "manifest.json";

/// The part of a manifest that concerns its files; the writer's own words stand beside it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FileHashes {
    /// The texts that everything comes from.
    pub inputs: Vec<FileHash>,
    /// Every result file.
    pub outputs: Vec<FileHash>,
    #[serde(flatten)]
    words: serde_json::Map<String, serde_json::Value>,
}

/// A file and what was in it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FileHash {
    /// The file, seen from the folder.
    pub file: String,
    /// SHA-256 of its bytes, in hexadecimal digits.
    pub sha256: String,
}

impl FileHashes {
    /// What was in a file when it was written, if that is known.
    fn hash_of(&self, file: &str) -> Option<&FileHash> {
        self.inputs.iter().chain(&self.outputs).find(|known| known.file == file)
    }
}

/// Writes a manifest into its folder; the same manifest gives the same bytes.
///
/// # Errors
/// It cannot be written.
pub fn write(folder: &Path, manifest: &impl Serialize) -> Result<(), FileError> {
    let text = serde_json::to_string_pretty(manifest).expect("a manifest is JSON") + "\n";
    write_atomically(folder.join(NAME), |out| out.write_all(text.as_bytes()))
}

/// The manifest of a folder; `None` if there is none of ours.
///
/// # Errors
/// It cannot be read, or is damaged.
pub fn read<Manifest: DeserializeOwned>(folder: &Path) -> Result<Option<Manifest>, FileError> {
    let path = folder.join(NAME);
    let text = match files::read_text(&path) {
        Ok(text) => text,
        Err(FileError::Missing { .. } | FileError::NotFolder { .. }) => return Ok(None),
        Err(error) => return Err(error),
    };
    // Other programs have files of this name, and later versions of this one other formats.
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

/// Compares a file with what the manifest beside it says, if it says anything.
///
/// # Errors
/// [`FileError::Altered`]; the file or the manifest cannot be read.
pub fn check(path: &Path) -> Result<(), FileError> {
    let Some((folder, name)) = place(path).filter(|_| path.is_file()) else { return Ok(()) };
    let Some(manifest) = read::<FileHashes>(folder)? else { return Ok(()) };
    match manifest.hash_of(name) {
        Some(known) if known.sha256 != sha256(path)? => {
            Err(FileError::Altered { path: path.into(), remedy: remedy(folder, name) })
        }
        _ => Ok(()),
    }
}

/// Takes a file that is about to be written off the manifest beside it. What was lost with a damaged manifest is told to
/// who reads, not to who writes.
///
/// # Errors
/// The manifest cannot be written.
pub fn forget(path: &Path) -> Result<(), FileError> {
    // Subjects are trained on several threads, and all of them share the manifest.
    static WRITING: Mutex<()> = Mutex::new(());
    let _writing = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
    let Some((folder, name)) = place(path) else { return Ok(()) };
    let Ok(Some(mut manifest)) = read::<FileHashes>(folder) else { return Ok(()) };
    if manifest.hash_of(name).is_none() {
        return Ok(());
    }
    manifest.inputs.retain(|known| known.file != name);
    manifest.outputs.retain(|known| known.file != name);
    write(folder, &manifest)
}

/// SHA-256 of a file's bytes, in hexadecimal digits.
///
/// # Errors
/// The file cannot be read.
pub fn sha256(path: &Path) -> Result<String, FileError> {
    let mut digest = Sha256::new();
    read_through(path, |bytes| digest.update(bytes))?;
    Ok(in_hexadecimal(digest))
}

/// The same of a text.
pub fn sha256_of_text(text: &str) -> String {
    in_hexadecimal(Sha256::new_with_prefix(text))
}

fn in_hexadecimal(digest: Sha256) -> String {
    digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A file's folder and its name there.
fn place(path: &Path) -> Option<(&Path, &str)> {
    Some((path.parent()?, path.file_name()?.to_str()?))
}

/// The command that writes the files whose names begin so, `FOLDER` standing for theirs.
const WRITERS: [(&str, &str); 11] = [
    ("study.toml", "campaign STUDY --out FOLDER"),
    ("system.toml", "campaign STUDY --out FOLDER"),
    ("dataset-", "features FOLDER"),
    ("calibration-", "campaign STUDY --setting fitted --out FOLDER"),
    ("hierarchy-", "train FOLDER"),
    ("panel-", "train FOLDER"),
    ("diagnoser-", "flights STUDY --out FOLDER"),
    ("band-", "band STUDY --out FOLDER"),
    ("flights.json", "flights STUDY --out FOLDER"),
    ("missing_sensors.json", "flights STUDY --missing-sensors --out FOLDER"),
    ("evaluation.json", "evaluate FOLDER"),
];

/// A file to which its command adds: it writes over none that is not what was written.
const ADDED_TO: &str = "flights.json";

/// What the user can do about a file that changed since it was written.
pub fn remedy(folder: &Path, name: &str) -> String {
    let writer = WRITERS.iter().find(|(beginning, _)| name.starts_with(beginning));
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let first = if name == ADDED_TO { "move it away or delete it, and " } else { "" };
    let again = writer.map_or(String::new(), |(_, command)| {
        let command = command.replace("FOLDER", &folder.display().to_string());
        format!("{first}'servotwin {command}' makes it anew; ")
    });
    let manifest = folder.join(NAME);
    format!(
        "its SHA-256 is not the one in {NAME}; {again}if you changed it on purpose, remove {}",
        manifest.display()
    )
}
