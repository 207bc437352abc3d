//! The output folder: which file is where.
//!
//! | file | written by |
//! |---|---|
//! | `study.toml`, `system.toml` | campaign: the texts that everything comes from |
//! | `dataset-<setting>.parquet`, `shards/` | campaign |
//! | `hierarchy-<subject>.json` | train |
//! | `evaluation.json` | evaluate |

use super::{JobError, Subject};
use crate::files::{self, create_folder, write_atomically};
use crate::study::{Setting, Study};
use std::path::{Path, PathBuf};

/// An output folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Folder(PathBuf);

impl Folder {
    /// The folder at a path, which need not exist.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Folder(path.into())
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// The text of the study.
    pub fn study(&self) -> PathBuf {
        self.0.join("study.toml")
    }

    /// The text of the system.
    pub fn system(&self) -> PathBuf {
        self.0.join("system.toml")
    }

    /// The data set of a setting.
    pub fn data_set(&self, setting: Setting) -> PathBuf {
        self.0.join(format!("dataset-{}.parquet", setting.name()))
    }

    /// The hierarchy trained for a subject.
    pub fn hierarchy(&self, subject: Subject) -> PathBuf {
        self.0.join(format!("hierarchy-{}.json", subject.name()))
    }

    /// What was measured of all subjects.
    pub fn results(&self) -> PathBuf {
        self.0.join("evaluation.json")
    }

    /// Makes the folder and writes the texts of the study and its system into it.
    ///
    /// # Errors
    /// The folder or a file cannot be written.
    pub fn keep_study(&self, study: &Study) -> Result<(), JobError> {
        create_folder(&self.0)?;
        write_text(&self.study(), &study.text)?;
        write_text(&self.system(), &study.system.text)
    }

    /// Reads the study back.
    ///
    /// # Errors
    /// It is missing or has mistakes.
    pub fn read_study(&self) -> Result<Study, JobError> {
        if !self.study().exists() {
            return Err(JobError::NoDataSet { folder: self.0.clone() });
        }
        let text = files::read_text(self.study())?;
        Ok(Study::parse_with_system(&text, &self.study(), &self.system())?)
    }
}

fn write_text(path: &Path, text: &str) -> Result<(), JobError> {
    Ok(write_atomically(path, |out| out.write_all(text.as_bytes()))?)
}
