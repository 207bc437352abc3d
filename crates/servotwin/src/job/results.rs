//! The evaluation of all subjects: `evaluation.json`.

use super::{Folder, JobError, Subject};
use crate::learn::{Evaluation, EvaluationSettings, model_file};
use crate::study::Study;
use serde::{Deserialize, Serialize};

/// Identifies the file format of a stored evaluation.
pub const FORMAT: &str = "servotwin evaluation 1";

/// The evaluation of all subjects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Results {
    /// [`FORMAT`].
    pub format: String,
    /// The name of the study.
    pub study: String,
    /// One entry for each evaluated subject.
    pub subjects: Vec<SubjectResult>,
}

/// The evaluation of one subject.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SubjectResult {
    /// The evaluated subject.
    pub subject: Subject,
    /// The subject's title for readers.
    pub title: String,
    /// The settings of training and evaluation.
    pub settings: EvaluationSettings,
    /// The results under all protocols.
    pub evaluation: Evaluation,
}

impl Results {
    /// Assembles the results of a study.
    pub fn new(study: &Study, subjects: Vec<SubjectResult>) -> Self {
        Results { format: FORMAT.into(), study: study.name.clone(), subjects }
    }

    /// Reads the results in a folder. A folder of flights alone has no subjects.
    ///
    /// # Errors
    /// [`JobError::Missing`] without an evaluation and without flights; the file is not an evaluation, or the study
    /// cannot be read.
    pub fn read(folder: &Folder) -> Result<Self, JobError> {
        let path = folder.results();
        match (path.exists(), folder.flights().exists()) {
            (true, _) => Ok(model_file::read(path)?),
            (false, true) => Ok(Results::new(&folder.read_study()?, vec![])),
            (false, false) => Err(JobError::Missing { path, command: "study" }),
        }
    }

    /// The result of a subject.
    pub fn of(&self, subject: Subject) -> Option<&SubjectResult> {
        self.subjects.iter().find(|result| result.subject == subject)
    }
}

impl SubjectResult {
    /// Assembles the result of a subject.
    pub fn new(
        subject: Subject,
        study: &Study,
        settings: EvaluationSettings,
        result: Evaluation,
    ) -> Self {
        SubjectResult { subject, title: subject.title(study), settings, evaluation: result }
    }
}
