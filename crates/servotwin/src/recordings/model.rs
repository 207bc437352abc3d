//! The models that a study of recordings learned, and their answers for the windows of a new record.

use super::novelty::LearnedNovelty;
use super::windows::{Nominals, Windows};
use super::{RecordingError, RecordingStudy};
use crate::learn::{EvaluationError, model_file};
use crate::system::System;
use crate::table::Table;
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::classifiers::{Classifier, Model};
use servotwin_diagnosis::error::{Error, require_sound};
use std::path::Path;

/// The format name at the start of a stored model.
pub const FORMAT: &str = "servotwin recordings 1";

/// The learned models of a study, which answer for the windows of a new record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RecordingModel {
    /// [`FORMAT`].
    pub format: String,
    /// The text of the study.
    pub study: String,
    /// The text of the twin's system, if there is a twin.
    pub system: Option<String>,
    /// The features of a window.
    pub features: Vec<String>,
    /// The nominal values, learned from all healthy rows, or those of the novelty if there is no target.
    pub nominals: Nominals,
    /// Every target with every classifier. The last classifier of a target answers.
    pub targets: Vec<TargetModel>,
    /// The novelty learned from the first healthy groups.
    pub novelty: Option<LearnedNovelty>,
}

/// A classifier that has learned a target from all windows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TargetModel {
    /// The column.
    pub column: String,
    /// Its values, in the order of the model's classes.
    pub classes: Vec<String>,
    /// The model.
    pub model: Model,
}

/// The answers for the windows of a record.
#[derive(Debug, Clone)]
pub struct Answers {
    /// The windows.
    pub windows: Windows,
    /// Each target with its answer for every window.
    pub targets: Vec<(String, Vec<String>)>,
    /// The distance of every window from the healthy groups; above 1 it is unlike them. `None` without novelty.
    pub distances: Option<Vec<f64>>,
}

impl RecordingModel {
    /// Reads a model and checks it.
    ///
    /// # Errors
    /// As [`model_file::read`]; [`EvaluationError::CorruptModel`].
    pub fn read(path: &Path) -> Result<Self, EvaluationError> {
        model_file::read_checked(path, RecordingModel::check)
    }

    fn check(&self) -> Result<(), Error> {
        require_sound(self.format == FORMAT, "the format is another one")?;
        let study = self
            .new_record()
            .map_err(|_| Error::CorruptModel { broken: "its study has mistakes" })?;
        let novelty = self.novelty.as_ref();
        let nominals = novelty.map(|novelty| &novelty.nominals).into_iter().chain([&self.nominals]);
        for nominals in nominals {
            require_sound(study.has_nominals(nominals), "its nominal values are of other sensors")?;
        }
        for TargetModel { classes, model, .. } in &self.targets {
            model.check()?;
            let fits = model.features() == self.features.len() && model.classes() == classes.len();
            require_sound(fits, "a classifier has other features or classes")?;
        }
        novelty.map_or(Ok(()), |novelty| novelty.known.check(0, self.features.len()))
    }

    /// The study, which copies nothing of a record whose labels are not known.
    fn new_record(&self) -> Result<RecordingStudy, RecordingError> {
        let known = RecordingStudy::parse(&self.study, "the study of the model")?;
        let (record, novelty) = (None, None);
        Ok(RecordingStudy {
            record,
            novelty,
            groups: vec![],
            keep: vec![],
            targets: vec![],
            ..known
        })
    }

    /// Answers for every window of a record.
    ///
    /// # Errors
    /// As [`RecordingStudy::windows`]; the features are not those of the model.
    pub fn answer(&self, record: &Table) -> Result<Answers, RecordingError> {
        let study = self.new_record()?;
        let mut record = record.clone();
        if let Some(text) = &self.system {
            let system = System::parse(text, "the twin of the model");
            let system = system.map_err(|error| RecordingError::System(Box::new(error)))?;
            study.add_twin(&mut record, &system)?;
        }
        let windows = study.windows(&record, &self.nominals)?;
        let features = windows.features().iter().map(|feature| &feature.name);
        require_sound(features.eq(&self.features), "its features are not those of its study")?;
        let mut targets: Vec<(String, Vec<String>)> = vec![];
        for known in &self.targets {
            let answer = |row: &[f64]| known.classes[known.model.predict_row(row) as usize].clone();
            // The last classifier of a target answers.
            targets.retain(|(column, _)| *column != known.column);
            targets.push((known.column.clone(), windows.each(answer)?));
        }
        let distances = self
            .novelty
            .as_ref()
            .map(|novelty| novelty.known_distances(&study.windows(&record, &novelty.nominals)?));
        Ok(Answers { targets, distances: distances.transpose()?, windows })
    }
}
