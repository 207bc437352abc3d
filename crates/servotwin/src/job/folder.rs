//! The output folder: which file is where.
//!
//! | file | written by |
//! |---|---|
//! | `study.toml`, `system.toml` | campaign: the texts that everything comes from |
//! | `dataset-<setting>.parquet`, `shards/` | campaign: the cases that are judged |
//! | `dataset-<setting>-training.parquet` | campaign: the training commands |
//! | `calibration-fitted.parquet`, `…-training.parquet` | campaign: true and fitted parameters of the pool |
//! | `hierarchy-<subject>.json` | train: the nine trees |
//! | `panel-<subject>.json` | train: trees, committee and bands |
//! | `diagnoser-<setting>.json` | flights: all that it takes to diagnose beside an actuator |
//! | `flights.json` | flights: what that is worth |
//! | `band-<setting>.json` | band: the confidence band as a field, and what it is worth |
//! | `evaluation.json` | evaluate |
//! | `report.html`, `figures/` | report |
//! | `manifest.json` | every stage |
//! | `.servotwin.lock` | every stage, and nothing into it: [`super::hold`] |
//!
//! Who writes holds the folder ([`Hold`]); who only reads does not.

use super::hold::{self, Among, Hold};
use super::{JobError, Subject};
use crate::files::{self, FileError, create_folder, write_atomically};
use crate::manifest;
use crate::study::campaign::{CampaignError, calibration_file};
use crate::study::{Role, Setting, Study};
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
    pub fn data_set(&self, setting: Setting, role: Role) -> PathBuf {
        self.0.join(format!("dataset-{}{}.parquet", setting.name(), role.suffix()))
    }

    /// The hierarchy trained for a subject.
    pub fn hierarchy(&self, subject: Subject) -> PathBuf {
        self.0.join(format!("hierarchy-{}.json", subject.name()))
    }

    /// Trees, committee and bands of a subject.
    pub fn panel(&self, subject: Subject) -> PathBuf {
        self.0.join(format!("panel-{}.json", subject.name()))
    }

    /// The diagnoser of a setting.
    pub fn diagnoser(&self, setting: Setting) -> PathBuf {
        self.0.join(format!("diagnoser-{}.json", setting.name()))
    }

    /// The confidence band that was learned in a setting.
    pub fn band(&self, setting: Setting) -> PathBuf {
        self.0.join(format!("band-{}.json", setting.name()))
    }

    /// What was measured in flights.
    pub fn flights(&self) -> PathBuf {
        self.0.join("flights.json")
    }

    /// What the diagnosis at work is worth without a sensor.
    pub fn missing_sensors(&self) -> PathBuf {
        self.0.join("missing_sensors.json")
    }

    /// What was measured of all subjects.
    pub fn results(&self) -> PathBuf {
        self.0.join("evaluation.json")
    }

    /// The report.
    pub fn report(&self) -> PathBuf {
        self.0.join("report.html")
    }

    /// The folder of the report's figures.
    pub fn figures(&self) -> PathBuf {
        self.0.join("figures")
    }

    /// Where everything comes from.
    pub fn manifest(&self) -> PathBuf {
        self.0.join(manifest::NAME)
    }

    /// Every result file that is there, the same order on every system.
    ///
    /// # Errors
    /// The folder of the figures cannot be read.
    pub fn results_there(&self) -> Result<Vec<PathBuf>, JobError> {
        let both = |setting| Role::ALL.map(|role| self.data_set(setting, role));
        let mut files: Vec<PathBuf> = Setting::ALL.into_iter().flat_map(both).collect();
        let models = |subject| [self.hierarchy(subject), self.panel(subject)];
        files.extend(Subject::ALL.into_iter().flat_map(models));
        files.extend(Setting::ALL.map(|setting| self.diagnoser(setting)));
        files.extend(Setting::ALL.map(|setting| self.band(setting)));
        files.extend(Role::ALL.map(|role| calibration_file(&self.0, role)));
        files.extend([self.flights(), self.missing_sensors(), self.results(), self.report()]);
        files.retain(|file| file.exists());
        files.extend(self.figure_files()?);
        Ok(files)
    }

    fn figure_files(&self) -> Result<Vec<PathBuf>, JobError> {
        let folder = self.figures();
        if !folder.exists() {
            return Ok(vec![]);
        }
        let wrong = |cause| FileError::from_io(&folder, cause);
        let mut files = vec![];
        for entry in std::fs::read_dir(&folder).map_err(wrong)? {
            let path = entry.map_err(wrong)?.path();
            if path.extension().is_some_and(|ending| ending == "svg") {
                files.push(path);
            }
        }
        files.sort();
        Ok(files)
    }

    /// Removes the report and its figures.
    ///
    /// # Errors
    /// They cannot be removed.
    pub fn remove_report(&self) -> Result<(), JobError> {
        let mut files = self.figure_files()?;
        files.extend(Some(self.report()).filter(|report| report.exists()));
        files.iter().try_for_each(|file| remove(file))
    }

    /// Makes the folder, so that somebody may write into it.
    ///
    /// # Errors
    /// [`JobError::Busy`]; the folder cannot be made.
    pub fn hold(&self, among: Among) -> Result<Hold, JobError> {
        create_folder(&self.0)?;
        hold::take(&self.0, among)
    }

    /// Holds the folder and writes the texts of the study and its system into it. Results of
    /// another study are removed: they would be taken for this one's.
    ///
    /// # Errors
    /// The study has no faults; [`JobError::Busy`]; the folder or a file cannot be written.
    pub fn keep_study(&self, study: &Study) -> Result<Hold, JobError> {
        if study.faults.is_empty() {
            return Err(CampaignError::NoVariants.into());
        }
        let hold = self.hold(Among::Nobody)?;
        for folder in [self.0.clone(), self.0.join("shards"), self.figures()] {
            files::remove_leftovers(&folder)?;
        }
        if !self.is_made_of(study)? {
            self.remove_report()?;
            for file in self.results_there()? {
                remove(&file)?;
            }
        }
        write_text(&self.study(), &study.text)?;
        write_text(&self.system(), &study.system.text)?;
        Ok(hold)
    }

    /// As [`Folder::keep_study`], where other parts may be working in the folder at the same time: nothing is
    /// removed.
    ///
    /// # Errors
    /// The folder holds another study; [`JobError::Busy`]; a file cannot be written.
    pub fn join_study(&self, study: &Study) -> Result<Hold, JobError> {
        if study.faults.is_empty() {
            return Err(CampaignError::NoVariants.into());
        }
        let hold = self.hold(Among::Parts)?;
        if self.holds(study) {
            return Ok(hold);
        }
        let other =
            |path: PathBuf, text: &str| files::read_text(path).is_ok_and(|there| there != text);
        if other(self.study(), &study.text) || other(self.system(), &study.system.text) {
            return Err(JobError::OtherStudy { folder: self.0.clone() });
        }
        write_text(&self.system(), &study.system.text)?;
        write_text(&self.study(), &study.text)?;
        Ok(hold)
    }

    /// Whether the results in the folder come from a study. That is what the manifest says: a text may have been damaged
    /// or changed since. Where it says nothing, the texts in the folder do.
    fn is_made_of(&self, study: &Study) -> Result<bool, JobError> {
        let known = manifest::read(&self.0)?;
        let is_from = |path: PathBuf, text: &str| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            match known.as_ref().and_then(|known| known.hash_of(&name)) {
                Some(known) => known.sha256 == manifest::sha256_of_text(text),
                None => is_text(path, text),
            }
        };
        Ok(is_from(self.study(), &study.text) && is_from(self.system(), &study.system.text))
    }

    /// Whether the texts in the folder are those of a study.
    fn holds(&self, study: &Study) -> bool {
        is_text(self.study(), &study.text) && is_text(self.system(), &study.system.text)
    }

    /// Holds the folder and reads the study back.
    ///
    /// # Errors
    /// [`JobError::Busy`]; as [`Folder::read_study`].
    pub fn open(&self) -> Result<(Study, Hold), JobError> {
        self.has_study()?;
        let hold = self.hold(Among::Nobody)?;
        Ok((self.read_study()?, hold))
    }

    /// Reads the study back, for who writes nothing.
    ///
    /// # Errors
    /// It is missing, is not what the manifest says, or has mistakes.
    pub fn read_study(&self) -> Result<Study, JobError> {
        self.has_study()?;
        manifest::check(&self.study())?;
        manifest::check(&self.system())?;
        let text = files::read_text(self.study())?;
        Ok(Study::parse_with_system(&text, &self.study(), &self.system())?)
    }

    fn has_study(&self) -> Result<(), JobError> {
        match self.study().exists() {
            true => Ok(()),
            false => Err(JobError::NoDataSet { folder: self.0.clone() }),
        }
    }
}

fn remove(file: &Path) -> Result<(), JobError> {
    Ok(std::fs::remove_file(file).map_err(|cause| FileError::from_io(file, cause))?)
}

fn is_text(path: impl AsRef<Path>, text: &str) -> bool {
    files::read_text(path).is_ok_and(|there| there == text)
}

/// Writes a text, unless it is there already: then the manifest goes on to vouch for it.
fn write_text(path: &Path, text: &str) -> Result<(), JobError> {
    if is_text(path, text) && manifest::check(path).is_ok() {
        return Ok(());
    }
    manifest::forget(path)?;
    Ok(write_atomically(path, |out| out.write_all(text.as_bytes()))?)
}
