//! Completeness of a study for the main job. An incomplete file is readable and serves commands that
//! simulate nothing, such as `watch`. `check` and the stages reject it before any simulation.

use super::mistake::Mistake;
use super::{Study, StudyError};
use crate::document::{Collector, Diagnostic, Place};

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
        let mut found = Collector::<Mistake>::new();
        let mut note = |at: Place, mistake| found.note(&reader.span(&at), mistake);
        if self.classes.is_empty() {
            note(Place::of(&["classes"]), Mistake::NoFaults);
        }
        if self.intensities.is_empty() {
            note(Place::of(&["intensities"]), Mistake::Empty { field: "intensities" });
        }
        if let Some(flights) = &self.parsed.flights {
            if self.realism.is_none() {
                note(Place::of(&["flights"]), Mistake::NoRealism);
            }
            for at in flights.without_faults_to_learn() {
                let (field, allowed) = (at.to_string(), "at least 1".to_owned());
                note(at, Mistake::OutOfRange { field, value: 0.0, allowed });
            }
        }
        found.locate(&self.text)
    }
}
