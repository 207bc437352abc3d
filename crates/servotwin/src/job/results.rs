//! What was measured of all subjects: `evaluation.json`.

use super::{Folder, JobError, Subject};
use crate::evaluation::robustness::Cross;
use crate::evaluation::{Evaluation, Settings, model_file};
use crate::study::Study;
use serde::{Deserialize, Serialize};

/// The word that a stored evaluation begins with.
pub const FORMAT: &str = "servotwin evaluation 2";

/// What was measured of all subjects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Results {
    /// [`FORMAT`].
    pub format: String,
    /// The name of the study.
    pub study: String,
    /// One entry for each subject.
    pub subjects: Vec<SubjectResult>,
    /// Trained on one setting, tested on another.
    pub robustness: Vec<Cross>,
}

/// What was measured of one subject.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SubjectResult {
    /// Which.
    pub subject: Subject,
    /// What it is, for people.
    pub title: String,
    /// How it was evaluated.
    pub settings: Settings,
    /// The result.
    pub evaluation: Evaluation,
}

impl Results {
    /// The results of a study.
    pub fn new(study: &Study, subjects: Vec<SubjectResult>, robustness: Vec<Cross>) -> Self {
        Results { format: FORMAT.into(), study: study.name.clone(), subjects, robustness }
    }

    /// Reads the results that a folder holds.
    ///
    /// # Errors
    /// [`JobError::Missing`], or the file holds no evaluation.
    pub fn read(folder: &Folder) -> Result<Self, JobError> {
        let path = folder.results();
        match path.exists() {
            true => Ok(model_file::read(path)?),
            false => Err(JobError::Missing { path, stage: "evaluate" }),
        }
    }

    /// The result of a subject.
    pub fn of(&self, subject: Subject) -> Option<&SubjectResult> {
        self.subjects.iter().find(|result| result.subject == subject)
    }
}

impl SubjectResult {
    /// The result of a subject of a study.
    pub fn new(subject: Subject, study: &Study, settings: Settings, result: Evaluation) -> Self {
        SubjectResult { subject, title: subject.title(study), settings, evaluation: result }
    }
}
