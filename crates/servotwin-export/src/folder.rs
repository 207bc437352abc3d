//! An export on disk: its files, and `export.json`, which names what they were made of.

use crate::c;
use crate::certificate::{Certificate, DECISIONS, Description, TwinDescription};
use crate::error::ExportError;
use crate::precision::Precision;
use crate::source_file::SourceFile;
use crate::twin::ExportedTwin;
use serde::Serialize;
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_io::files::{create_folder, read_text, write_atomically};
use servotwin_io::manifest::sha256;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The name of the description.
const DESCRIPTION: &str = "export.json";

/// The name of a certificate.
const CERTIFICATE: &str = "proof.json";

/// The same as a page.
const PAGE: &str = "proof.html";

/// The hashes of what a diagnoser was made of, as far as it lies beside its file.
fn sources(diagnoser: &Path) -> Result<BTreeMap<String, String>, ExportError> {
    let folder = diagnoser.parent().unwrap_or(Path::new(""));
    let entries = folder.read_dir().into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    let is_source = |name: &String| {
        name == "system.toml"
            || name == "study.toml"
            || (name.starts_with("dataset-") && name.ends_with(".parquet"))
    };
    names.filter(is_source).map(|name| Ok((name.clone(), sha256(&folder.join(name))?))).collect()
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

    /// Writes an export of the diagnoser in a file and of a twin of the study of that name. An earlier one is replaced, and
    /// its certificate removed.
    ///
    /// # Errors
    /// [`ExportError::FolderInUse`], the errors of [`c::files_with_twin`], and files that cannot be written.
    pub fn write(
        &self,
        (diagnoser, file): (&Diagnoser, &Path),
        (twin, study): (&ExportedTwin, &Path),
    ) -> Result<Description, ExportError> {
        let twin_description = TwinDescription {
            study: study.into(),
            system: twin.program.identity(),
            has_fixed_step: twin.has_fixed_step(),
        };
        let files = c::files_with_twin(diagnoser, twin)?;
        self.write_files(&files, file, Precision::F64, Some(twin_description))
    }

    /// Writes an export of the diagnoser in a file in single precision, without a twin. An earlier one is replaced, and
    /// its certificate removed.
    ///
    /// # Errors
    /// [`ExportError::FolderInUse`], the errors of [`c::files_in`], and files that cannot be written.
    pub fn write_single(
        &self,
        diagnoser: &Diagnoser,
        file: &Path,
    ) -> Result<Description, ExportError> {
        let files = c::files_in(diagnoser, Precision::F32)?;
        self.write_files(&files, file, Precision::F32, None)
    }

    fn write_files(
        &self,
        files: &[SourceFile],
        diagnoser: &Path,
        precision: Precision,
        twin: Option<TwinDescription>,
    ) -> Result<Description, ExportError> {
        let holds_files = self.path.read_dir().is_ok_and(|mut entries| entries.next().is_some());
        let is_own = |description: Description| description.precision == precision;
        let is_earlier = self.description().map_or(self.file(DESCRIPTION).exists(), is_own);
        if holds_files && !is_earlier {
            return Err(ExportError::FolderInUse(self.path.clone()));
        }
        // A certificate of another text is worse than none.
        for name in [CERTIFICATE, PAGE, DECISIONS] {
            let _ = std::fs::remove_file(self.file(name));
        }
        create_folder(&self.path)?;
        for SourceFile { name, text } in files {
            write_atomically(self.file(name), |out| out.write_all(text.as_bytes()))?;
        }
        let description = Description {
            version: env!("CARGO_PKG_VERSION").into(),
            diagnoser: std::path::absolute(diagnoser).unwrap_or_else(|_| diagnoser.into()),
            diagnoser_sha256: sha256(diagnoser)?,
            precision,
            twin,
            sources_sha256: sources(diagnoser)?,
            files_sha256: SourceFile::hashes(files),
        };
        self.write_json(DESCRIPTION, &description)?;
        Ok(description)
    }

    /// What the export was made of.
    ///
    /// # Errors
    /// [`ExportError::NoExport`] if there is none.
    pub fn description(&self) -> Result<Description, ExportError> {
        let none = || ExportError::NoExport(self.path.clone());
        let path = self.file(DESCRIPTION);
        let text = if path.exists() { read_text(path)? } else { return Err(none()) };
        serde_json::from_str(&text).map_err(|_| none())
    }

    /// Checks that a twin is the exported one.
    ///
    /// # Errors
    /// [`ExportError::OtherSystem`] if it is not.
    pub fn check_system(
        &self,
        exported: &TwinDescription,
        twin: &ExportedTwin,
        study: &Path,
    ) -> Result<(), ExportError> {
        if twin.program.identity() == exported.system {
            return Ok(());
        }
        Err(ExportError::OtherSystem { study: study.into(), folder: self.path.clone() })
    }

    /// The files as they are now. `file` must be the exported diagnoser.
    ///
    /// # Errors
    /// [`ExportError::OtherDiagnoser`] if it is not, and files that are missing.
    pub fn files(
        &self,
        exported: &Description,
        file: &Path,
    ) -> Result<Vec<SourceFile>, ExportError> {
        if sha256(file)? != exported.diagnoser_sha256 {
            let folder = self.path.clone();
            return Err(ExportError::OtherDiagnoser { diagnoser: file.into(), folder });
        }
        let read = |name| Ok(SourceFile { name, text: read_text(self.file(name))? });
        c::names(exported.precision).map(read).collect()
    }

    /// Writes a certificate as data and as a page, and what single precision decides differently; returns their paths.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write_certificate(
        &self,
        certificate: &Certificate,
    ) -> Result<Vec<PathBuf>, ExportError> {
        self.write_json(CERTIFICATE, certificate)?;
        let mut texts = vec![(PAGE, certificate.page())];
        texts.extend(certificate.single.iter().map(|single| (DECISIONS, single.csv())));
        let mut written = vec![self.file(CERTIFICATE)];
        for (name, text) in texts {
            write_atomically(self.file(name), |out| out.write_all(text.as_bytes()))?;
            written.push(self.file(name));
        }
        Ok(written)
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
