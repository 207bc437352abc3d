//! An export on disk: its files, and `export.json`, which names what they were made of.

use crate::c;
use crate::certificate::Certificate;
use crate::comparison::FolderComparison;
use crate::description::{DESCRIPTION, Description, TwinDescription};
use crate::error::ExportError;
use crate::source_file::SourceFile;
use crate::twin::ExportedTwin;
use serde::Serialize;
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_io::files::{create_folder, read_bytes, read_text, write_atomically, write_text};
use servotwin_io::manifest::sha256;
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The name of a certificate.
const CERTIFICATE: &str = "proof.json";

/// The same as a page.
const PAGE: &str = "proof.html";

/// The hashes of what a diagnoser was made of, as far as it lies beside its file.
fn sources(diagnoser: &Path) -> Result<BTreeMap<String, String>, ExportError> {
    let file = absolute(diagnoser);
    let folder = file.parent().unwrap_or(Path::new(""));
    let entries = folder.read_dir().into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    let is_source = |name: &String| {
        name == "system.toml"
            || name == "study.toml"
            || (name.starts_with("dataset-") && name.ends_with(".parquet"))
    };
    names.filter(is_source).map(|name| Ok((name.clone(), sha256(&folder.join(name))?))).collect()
}

/// A path that means the same in any working folder.
fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.into())
}

/// The files of an export, and what they are made of.
fn export(
    diagnoser: &Diagnoser,
    file: &Path,
    (twin, study): (&ExportedTwin, &Path),
) -> Result<(Vec<SourceFile>, Description), ExportError> {
    let files = c::files_with_twin(diagnoser, twin)?;
    let twin = TwinDescription {
        // A built-in study has no path.
        study: if study.exists() { absolute(study) } else { study.into() },
        system: twin.program.identity(),
        has_fixed_step: twin.has_fixed_step(),
    };
    let description = Description {
        version: env!("CARGO_PKG_VERSION").into(),
        diagnoser: absolute(file),
        diagnoser_sha256: sha256(file)?,
        twin,
        sources_sha256: sources(file)?,
        files_sha256: SourceFile::hashes(&files),
    };
    Ok((files, description))
}

/// A folder with an export.
#[derive(Debug, Clone)]
pub struct ExportFolder {
    path: PathBuf,
}

impl ExportFolder {
    /// A folder, which need not exist.
    pub fn new(path: &Path) -> Self {
        ExportFolder { path: path.into() }
    }

    /// Writes an export of the diagnoser in a file, with a twin of the study of that name. An earlier one is replaced, and
    /// its certificate removed.
    ///
    /// # Errors
    /// [`ExportError::FolderInUse`], [`ExportError::Damaged`], the errors of [`c::files_with_twin`], and files that cannot
    /// be written or removed.
    pub fn write(
        &self,
        (diagnoser, file): (&Diagnoser, &Path),
        twin: (&ExportedTwin, &Path),
    ) -> Result<Description, ExportError> {
        let (files, description) = export(diagnoser, file, twin)?;
        let holds_files = self.path.read_dir().is_ok_and(|mut entries| entries.next().is_some());
        if holds_files {
            self.description().map_err(|error| match error {
                ExportError::NoExport(_) => ExportError::FolderInUse(self.path.clone()),
                error => error,
            })?;
        }
        self.forget_certificate()?;
        create_folder(&self.path)?;
        // First: a folder that names itself an export can be written again after a failure.
        self.write_json(DESCRIPTION, &description)?;
        for SourceFile { name, text } in &files {
            write_text(self.file(name), text)?;
        }
        Ok(description)
    }

    /// Removes a certificate: one of another text is worse than none.
    ///
    /// # Errors
    /// It is there and cannot be removed.
    pub fn forget_certificate(&self) -> Result<(), ExportError> {
        for name in [CERTIFICATE, PAGE] {
            let path = self.file(name);
            match std::fs::remove_file(&path) {
                Err(cause) if cause.kind() != ErrorKind::NotFound => {
                    return Err(ExportError::from_io(&path, cause));
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// What the export was made of.
    ///
    /// # Errors
    /// [`ExportError::NoExport`] if there is none; [`ExportError::Damaged`] if it cannot be read.
    pub fn description(&self) -> Result<Description, ExportError> {
        let path = self.file(DESCRIPTION);
        if !path.exists() {
            return Err(ExportError::NoExport(self.path.clone()));
        }
        serde_json::from_str(&read_text(&path)?)
            .map_err(|cause| ExportError::Damaged { path, cause })
    }

    /// Compares the folder with what is exported today for its diagnoser, in `file`, and its twin.
    ///
    /// # Errors
    /// The errors of [`Self::write`].
    pub fn compare(
        &self,
        exported: &Description,
        (diagnoser, file): (&Diagnoser, &Path),
        twin: (&ExportedTwin, &Path),
    ) -> Result<FolderComparison, ExportError> {
        let mut compared = FolderComparison::default();
        let (files, right) = export(diagnoser, file, twin)?;
        compared.description(exported, &right);
        for right in &files {
            // Also a byte order mark is a difference.
            match read_bytes(self.file(right.name)) {
                Ok(bytes) => compared.file(right, String::from_utf8_lossy(&bytes).into_owned()),
                Err(error) => compared.differ(right.name, &error.to_string()),
            }
        }
        let entries = self.path.read_dir().into_iter().flatten().flatten();
        let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
        let is_foreign = |name: &String| {
            (name.ends_with(".c") || name.ends_with(".h")) && !right.files_sha256.contains_key(name)
        };
        let foreign = names.filter(is_foreign).map(|name| format!("{name}: no file of the export"));
        compared.not_compared.extend(foreign);
        compared.not_compared.sort();
        Ok(compared)
    }

    /// Writes a certificate as data and as a page; returns their paths.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write_certificate(
        &self,
        certificate: &Certificate,
    ) -> Result<[PathBuf; 2], ExportError> {
        self.write_json(CERTIFICATE, certificate)?;
        let page = self.file(PAGE);
        write_text(&page, &servotwin::view::render::page(&certificate.document()))?;
        Ok([self.file(CERTIFICATE), page])
    }

    fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    fn write_json(&self, name: &str, content: &impl Serialize) -> Result<(), ExportError> {
        Ok(write_atomically(self.file(name), |out| {
            serde_json::to_writer_pretty(&mut *out, content)?;
            out.write_all(b"\n")
        })?)
    }
}
