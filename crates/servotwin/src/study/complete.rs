//! Completeness of a study for the main job. An incomplete file is readable and serves commands that
//! simulate nothing, such as `watch`. `check` and the stages reject it before any simulation.

use super::Study;
use super::realism::REALISTIC;
use super::suites::LEARN;
use crate::toml_text::{Collector, Diagnostic, TomlError};

impl Study {
    /// Checks that the study has everything that its records and flights need.
    ///
    /// # Errors
    /// [`TomlError::Mistakes`] with everything that is missing, at its place.
    pub fn complete(&self) -> Result<(), TomlError> {
        let mut found = Collector::default();
        if self.classes.is_empty() {
            let mistake = Diagnostic::new("the study has no faults");
            found.note(&(0..0), mistake.with_help("add [[classes]] with 'faults'"));
        }
        if self.intensities.is_empty() {
            let at = &self.parsed.intensities.at;
            found.note(at, Diagnostic::new("'intensities' is empty"));
        }
        if let (Some(flights), None) = (&self.parsed.flights, &self.realism) {
            let mistake = Diagnostic::new("flights need the section 'realistic'");
            found.note(&flights.at, mistake.with_help(REALISTIC.example));
        }
        if self.suite(LEARN).is_some_and(|learn| learn.repeats == 0) {
            let own = self.parsed.suites.get(LEARN).and_then(|learn| learn.0.repeats.as_ref());
            let at = own.map_or(0..0, |repeats| repeats.at.clone());
            found.note(&at, Diagnostic::not_allowed("suites.learn.repeats", 0, "at least 1"));
        }
        if found.is_empty() { Ok(()) } else { Err(found.refuse(&self.path, &self.text)) }
    }
}
