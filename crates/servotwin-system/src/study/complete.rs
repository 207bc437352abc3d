//! Completeness of a study for the main job. An incomplete file is readable and serves commands that
//! simulate nothing, such as `watch`. `check` and the stages reject it before any simulation.

use super::mistake::StudyMistake;
use super::suites::LEARN;
use super::{Study, StudyError};
use crate::document::{Collector, Diagnostic, KeyPath};

impl Study {
    /// Checks that the study has everything that its campaign and flights need.
    ///
    /// # Errors
    /// [`StudyError::Mistakes`] with everything that is missing, at its place.
    pub fn complete(&self) -> Result<(), StudyError> {
        let mistakes = self.missing_for_a_campaign();
        if mistakes.is_empty() {
            return Ok(());
        }
        Err(StudyError::Mistakes { path: self.path.clone(), mistakes })
    }

    fn missing_for_a_campaign(&self) -> Vec<Diagnostic> {
        let reader = self.reader();
        let mut found = Collector::<StudyMistake>::new();
        let mut note = |at: KeyPath, mistake| found.note(&reader.span(&at), mistake);
        if self.classes.is_empty() {
            note(KeyPath::of(&["classes"]), StudyMistake::NoFaults);
        }
        if self.intensities.is_empty() {
            note(KeyPath::of(&["intensities"]), StudyMistake::Empty { field: "intensities" });
        }
        if self.flights.is_some() && self.realism.is_none() {
            note(KeyPath::of(&["flights"]), StudyMistake::NoRealism);
        }
        for is_full in [false, true] {
            if self.suite(LEARN, is_full).is_some_and(|learn| learn.repeats == 0) {
                let at = KeyPath::of(&["suites", LEARN, "repeats"]);
                let (field, allowed) = (at.to_string(), "at least 1".to_owned());
                note(at, StudyMistake::OutOfRange { field, value: 0.0, allowed });
            }
        }
        found.locate(&self.text)
    }
}
