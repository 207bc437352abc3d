//! The output folder and the location of each file in it.
//!
//! | file | written by |
//! |---|---|
//! | `study.toml`, `system.toml` | `keep_study`: the texts of the study and its system |
//! | `parts/` | every suite: its runs, see `crate::run::part`, and what the flights to learn from need |
//! | `dataset-<scenario>.parquet` | records: the operating cases of the evaluation |
//! | `dataset-<scenario>-training.parquet` | records: the training commands |
//! | `data-card.md` | records: what the data sets are, see [`super::data_card`] |
//! | `calibration-fitted.parquet`, `…-training.parquet` | records: true and fitted parameters of the pool |
//! | `records-<subject>.json` | train: the diagnoser of records, with the nine trees, committee and bands |
//! | `diagnoser-<scenario>.json` | flights: everything that the diagnosis in operation needs |
//! | `flights.json` | flights: figures of merit of the diagnosers |
//! | `left_out-<scenario>.json` | flights: training flights that taught nothing |
//! | `flights-sealed.json` | flights --sealed: the same figures in sealed environments |
//! | `outcomes-<suite>-<scenario>.parquet` | train and flights: what was simulated and what a diagnosis did, a row for each run |
//! | `sealed-openings.csv` | flights --sealed, outside of a repository: never removed, see [`super::sealed`] |
//! | `evaluation.json` | evaluate |
//! | `report.html`, `figures/` | report |
//! | `windows.parquet`, `outcomes.parquet`, `diagnoser-of-TARGET.json`, `diagnoser-novelty.json`, `recordings.json` | a study of recordings |
//! | `ground_test/` | test: all files of the tests on the ground, which are a study of their own |
//! | `manifest.json` | every stage |
//! | `.servotwin.lock` | every stage; always empty, see [`super::hold`] |
//!
//! Writers hold the folder ([`Hold`]); readers do not.

use super::hold::{self, Among, Hold};
use super::manifest::Manifest;
use super::{JobError, Subject};
use crate::files::{self, FileError, create_folder};
use crate::manifest;
use crate::records::calibration_file;
use crate::run::part::PARTS;
use crate::study::{Purpose, Scenario, Study};
use crate::system::System;
use std::path::{Path, PathBuf};

/// The prefix of the figures' names in the manifest.
const FIGURES: &str = "figures/";

/// An output folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Folder(PathBuf);

impl Folder {
    /// The folder at a path. It need not exist yet.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Folder(path.into())
    }

    /// The path of the folder.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// The file with the text of the study.
    pub fn study(&self) -> PathBuf {
        self.0.join("study.toml")
    }

    /// The file with the text of the system.
    pub(crate) fn system(&self) -> PathBuf {
        self.0.join("system.toml")
    }

    /// The file of a scenario's data set.
    pub fn data_set(&self, scenario: Scenario, purpose: Purpose) -> PathBuf {
        self.0.join(format!("dataset-{}{}.parquet", scenario.name(), purpose.suffix()))
    }

    /// The file that describes the data sets.
    pub fn data_card(&self) -> PathBuf {
        self.0.join("data-card.md")
    }

    /// The file of the diagnoser of records that was trained for a subject: bands, trees and committee.
    pub fn records(&self, subject: Subject) -> PathBuf {
        self.0.join(format!("records-{}.json", subject.name()))
    }

    /// The file of a scenario's diagnoser.
    pub fn diagnoser(&self, scenario: Scenario) -> PathBuf {
        self.0.join(format!("diagnoser-{}.json", scenario.name()))
    }

    /// The file with the results of the flights.
    pub fn flights(&self) -> PathBuf {
        self.0.join("flights.json")
    }

    /// The folder with everything about the tests on the ground, which are a study of their own.
    pub fn ground_test(&self) -> Folder {
        Folder(self.0.join("ground_test"))
    }

    /// The file with the outcomes of a suite of flights in a scenario.
    pub fn outcomes(&self, suite: &str, scenario: &str) -> PathBuf {
        self.0.join(format!("outcomes-{suite}-{scenario}.parquet"))
    }

    /// The folder of the parts of all suites.
    pub(crate) fn parts(&self) -> PathBuf {
        self.0.join(PARTS)
    }

    /// The file of the spreads of a scenario, which the parts of its flights to learn from need.
    pub(super) fn spreads(&self, scenario: Scenario) -> PathBuf {
        self.parts().join(format!("spreads-{}.json", scenario.name()))
    }

    /// The file of the bands of a scenario, which the parts of its hard negatives need.
    pub(super) fn bands(&self, scenario: Scenario) -> PathBuf {
        self.parts().join(format!("bands-{}.json", scenario.name()))
    }

    /// The file that names the training flights of a scenario that taught nothing.
    pub fn left_out(&self, scenario: Scenario) -> PathBuf {
        self.0.join(format!("left_out-{}.json", scenario.name()))
    }

    /// The file with the results in sealed environments.
    pub(crate) fn sealed_flights(&self) -> PathBuf {
        self.0.join("flights-sealed.json")
    }

    /// The file with the evaluation of all subjects.
    pub fn results(&self) -> PathBuf {
        self.0.join("evaluation.json")
    }

    /// The file of the report.
    pub fn report(&self) -> PathBuf {
        self.0.join("report.html")
    }

    /// The folder of the report's figures.
    pub fn figures(&self) -> PathBuf {
        self.0.join(FIGURES)
    }

    /// The file of the manifest.
    pub fn manifest(&self) -> PathBuf {
        self.0.join(manifest::NAME)
    }

    /// Lists the existing result files, in the same order on every system.
    ///
    /// # Errors
    /// The folder of the figures cannot be read.
    pub fn results_there(&self) -> Result<Vec<PathBuf>, JobError> {
        let both = |scenario| Purpose::OF_RECORDS.map(|purpose| self.data_set(scenario, purpose));
        let mut files: Vec<PathBuf> = Scenario::ALL.into_iter().flat_map(both).collect();
        files.extend(Subject::ALL.map(|subject| self.records(subject)));
        files.extend(Scenario::ALL.map(|scenario| self.diagnoser(scenario)));
        files.extend(Scenario::ALL.map(|scenario| self.left_out(scenario)));
        files.extend(self.all_outcomes()?);
        files.extend(Purpose::OF_RECORDS.map(|purpose| calibration_file(&self.0, purpose)));
        files.extend([self.data_card(), self.sealed_flights(), self.flights()]);
        files.extend([self.results(), self.report()]);
        files.extend(self.figure_files()?);
        files.retain(|file| file.exists());
        Ok(files)
    }

    /// The outcomes of all suites: a study may name its own.
    fn all_outcomes(&self) -> Result<Vec<PathBuf>, JobError> {
        let Ok(entries) = std::fs::read_dir(&self.0) else { return Ok(vec![]) };
        let mut found = vec![];
        for entry in entries {
            let path = entry.map_err(|cause| FileError::from_io(&self.0, cause))?.path();
            let name = path.file_stem().and_then(|name| name.to_str()).unwrap_or_default();
            let scenario = name.strip_prefix("outcomes-").and_then(|name| name.rsplit_once('-'));
            let is_parquet = path.extension().is_some_and(|ending| ending == "parquet");
            if is_parquet
                && scenario.is_some_and(|(_, scenario)| Scenario::named(scenario).is_some())
            {
                found.push(path);
            }
        }
        found.sort();
        Ok(found)
    }

    /// The report's figures according to the manifest. Other files in their folder belong to the user.
    fn figure_files(&self) -> Result<Vec<PathBuf>, JobError> {
        let known = Manifest::read(&self.0)?.map(|manifest| manifest.outputs).unwrap_or_default();
        let figures = known.iter().filter_map(|known| known.file.strip_prefix(FIGURES));
        Ok(figures.map(|name| self.figures().join(name)).collect())
    }

    /// Removes the report and its figures.
    ///
    /// # Errors
    /// A file cannot be removed.
    pub fn remove_report(&self) -> Result<(), JobError> {
        let mut files = self.figure_files()?;
        files.push(self.report());
        files.retain(|file| file.exists());
        files.iter().try_for_each(|file| remove(file))
    }

    /// Creates the folder and takes the right to write into it.
    ///
    /// # Errors
    /// [`JobError::Busy`]; the folder cannot be created.
    pub fn hold(&self, among: Among) -> Result<Hold, JobError> {
        create_folder(&self.0)?;
        hold::take(&self.0, among)
    }

    /// Holds the folder and writes the texts of the study and its system into it. Results of an earlier version of the
    /// study are removed, because they would look like results of this version. Results of another study are removed
    /// only if `replace` is set.
    ///
    /// # Errors
    /// [`Study::complete`]; [`JobError::Busy`]; [`JobError::OtherResults`]; the folder or a file cannot be written.
    pub fn keep_study(&self, study: &Study, replace: bool) -> Result<Kept, JobError> {
        study.complete()?;
        let hold = self.hold(Among::Nobody)?;
        let mut dropped = vec![];
        if !self.is_made_of(study)? {
            dropped = self.results_there()?;
            if !replace && let Some(there) = self.other_study(study, &dropped)? {
                let (folder, count) = (self.0.clone(), dropped.len());
                return Err(JobError::OtherResults { folder, there, count });
            }
        }
        self.remove_leftovers();
        dropped.iter().try_for_each(|file| remove(file))?;
        write_text(&self.study(), &study.text)?;
        write_text(&self.system(), &study.system.text)?;
        Ok(Kept { hold, dropped: dropped.len() })
    }

    /// Describes the folder's study if it has another name. An edited study keeps its name and counts as the same.
    fn other_study(&self, study: &Study, results: &[PathBuf]) -> Result<Option<String>, JobError> {
        let texts = [self.study(), self.system()];
        if results.is_empty() && texts.iter().all(|text| !text.exists()) {
            return Ok(None);
        }
        if !study.is_full && self.holds_full(study) {
            return Ok(Some(format!("the full size of the study '{}'", study.name)));
        }
        let told = Manifest::read(&self.0)?.map(|manifest| manifest.study);
        Ok(match told.or_else(|| name_in(&self.study())) {
            Some(name) if name == study.name => None,
            Some(name) => Some(format!("the study '{name}'")),
            None => Some("no study of this name".into()),
        })
    }

    /// Like [`Folder::keep_study`], for a folder in which other parts of its suites may be working. Removes no
    /// results.
    ///
    /// # Errors
    /// The folder holds another study; [`JobError::Busy`]; a file cannot be written.
    pub fn join_study(&self, study: &Study) -> Result<Hold, JobError> {
        study.complete()?;
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

    /// Whether the folder's results come from this study. The manifest decides, because a text may have been damaged or
    /// edited since. Without an entry there, the texts in the folder decide.
    fn is_made_of(&self, study: &Study) -> Result<bool, JobError> {
        let known = Manifest::read(&self.0)?;
        let is_from = |path: PathBuf, text: &str| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            match known.as_ref().and_then(|known| known.hash_of(&name)) {
                Some(known) => known.sha256 == manifest::sha256_of_text(text),
                None => is_text(path, text),
            }
        };
        Ok(is_from(self.study(), &study.text) && is_from(self.system(), &study.system.text))
    }

    /// Whether the folder contains the full-size version of the study.
    pub fn holds_full(&self, study: &Study) -> bool {
        is_text(self.study(), &study.full_text()) && is_text(self.system(), &study.system.text)
    }

    /// Whether the folder contains the texts of this study.
    fn holds(&self, study: &Study) -> bool {
        is_text(self.study(), &study.text) && is_text(self.system(), &study.system.text)
    }

    /// Holds the folder and reads its study.
    ///
    /// # Errors
    /// [`JobError::Busy`]; as [`Folder::read_study`].
    pub fn open(&self) -> Result<(Study, Hold), JobError> {
        self.has_study()?;
        let hold = self.hold(Among::Nobody)?;
        self.remove_leftovers();
        Ok((self.read_study()?, hold))
    }

    /// Removes files that killed writers left behind. The caller must hold the folder exclusively.
    fn remove_leftovers(&self) {
        self.written_folders().iter().for_each(files::remove_leftovers);
    }

    /// The folders into which stages write.
    fn written_folders(&self) -> [PathBuf; 3] {
        [self.0.clone(), self.parts(), self.figures()]
    }

    /// Reads the folder's study for a program that writes nothing.
    ///
    /// # Errors
    /// It is missing, contradicts the manifest, or has mistakes.
    pub fn read_study(&self) -> Result<Study, JobError> {
        self.has_study()?;
        manifest::check(&self.study())?;
        manifest::check(&self.system())?;
        let text = files::read_text(self.study())?;
        let path = self.study().display().to_string();
        Ok(Study::parse_for(&text, &path, System::read(self.system())?)?)
    }

    fn has_study(&self) -> Result<(), JobError> {
        match self.study().exists() {
            true => Ok(()),
            false => Err(JobError::NoDataSet { folder: self.0.clone() }),
        }
    }
}

/// The right to write into an output folder that is prepared for a study.
#[derive(Debug)]
#[must_use = "the folder is free again when this is dropped"]
pub struct Kept {
    /// The right to write.
    pub hold: Hold,
    /// The number of removed results; they came from an earlier version of the study, or from a replaced one.
    pub dropped: usize,
}

/// The name in a study's text.
fn name_in(study: &Path) -> Option<String> {
    let text: toml::Table = toml::from_str(&files::read_text(study).ok()?).ok()?;
    Some(text.get("name")?.as_str()?.to_owned())
}

fn remove(file: &Path) -> Result<(), JobError> {
    Ok(std::fs::remove_file(file).map_err(|cause| FileError::from_io(file, cause))?)
}

fn is_text(path: impl AsRef<Path>, text: &str) -> bool {
    files::read_text(path).is_ok_and(|there| there == text)
}

/// Writes a text unless the file already contains it. In that case the manifest's hash stays valid.
pub(super) fn write_text(path: &Path, text: &str) -> Result<(), JobError> {
    if is_text(path, text) && manifest::check(path).is_ok() {
        return Ok(());
    }
    manifest::forget(path)?;
    Ok(files::write_text(path, text)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::built_in::STUDIES;

    #[test]
    fn a_quick_study_removes_no_full_one() {
        let path = std::env::temp_dir().join(format!("servotwin-full-{}", std::process::id()));
        let folder = Folder::new(&path);
        let quick = Study::default();
        let full = quick.full().unwrap();
        drop(folder.keep_study(&full, false).unwrap());
        assert!(folder.holds_full(&quick));
        let refused = folder.keep_study(&quick, false).unwrap_err();
        assert!(refused.to_string().contains("the full size of the study 'paper'"), "{refused}");
        drop(folder.keep_study(&quick, true).unwrap());
        assert!(!folder.holds_full(&quick));
        drop(folder.keep_study(&full, false).unwrap());
        std::fs::remove_dir_all(&path).unwrap();
    }

    #[test]
    fn what_is_of_another_study_or_of_somebody_else_stays() {
        let path = std::env::temp_dir().join(format!("servotwin-kept-{}", std::process::id()));
        let folder = Folder::new(&path);
        let study = |text: &str| Study::parse(text, "study.toml").unwrap();
        let (spring, press) = (study(STUDIES[1].1), study(STUDIES[2].1));
        let dropped = |study: &Study, replace| folder.keep_study(study, replace).unwrap().dropped;
        assert_eq!(dropped(&spring, false), 0);
        let figure = |name: &str| folder.figures().join(name);
        let (ours, others) = (figure("bands.svg"), [figure("my.svg"), path.join("notes.txt")]);
        let measure = |study: &Study| {
            create_folder(folder.figures()).unwrap();
            for file in [&folder.results(), &ours, &others[0], &others[1]] {
                std::fs::write(file, "{}").unwrap();
            }
            crate::job::manifest::write_with(&folder, study, std::slice::from_ref(&ours)).unwrap();
        };
        measure(&spring);
        let refused = folder.keep_study(&press, false).unwrap_err();
        assert!(matches!(refused, JobError::OtherResults { count: 2, .. }), "{refused}");
        assert!(refused.to_string().contains("the study 'spring_actuator' is here"), "{refused}");
        assert!(folder.results().exists() && ours.exists());
        assert_eq!(dropped(&spring, false), 0, "the same study goes on");
        let edited = study(&STUDIES[1].1.replace("duration_s = 30", "duration_s = 20"));
        assert_eq!(dropped(&edited, false), 2, "what was edited is the same study");
        assert!(!folder.results().exists() && !ours.exists());
        measure(&edited);
        assert_eq!(dropped(&press, true), 2);
        folder.remove_report().unwrap();
        assert!(others.iter().all(|file| file.exists()), "what others wrote is theirs");
        // A study of the user's own with the same file name, without any results.
        std::fs::remove_file(folder.manifest()).unwrap();
        std::fs::write(folder.study(), "name = \"mine\"\n").unwrap();
        assert!(matches!(folder.keep_study(&press, false), Err(JobError::OtherResults { .. })));
        std::fs::remove_dir_all(&path).unwrap();
    }
}
