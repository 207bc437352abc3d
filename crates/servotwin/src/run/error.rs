//! Errors of records and flights.

use crate::files::FileError;
use crate::study::{Scenario, Section, Study};
use crate::table::TableError;
use crate::toml_text::TomlError;
use std::path::{Path, PathBuf};

/// Why runs failed or stopped.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
pub enum RunError {
    /// A folder or file could not be written.
    #[error(transparent)]
    File(FileError),
    /// A data set could not be read or written.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The study has neither faults nor healthy specimens.
    #[error("the study has no faults: add [[classes]] with 'faults'")]
    NoVariants,
    /// The study lacks sections that a scenario needs.
    #[error("{}", lacking_sections(*.scenario, .lacks))]
    NoSection { scenario: Scenario, lacks: Vec<Section> },
    /// A specimen's twin could not be fitted.
    #[error("the twin of specimen {specimen} cannot be fitted: {reason}")]
    Calibration { specimen: usize, reason: String },
    /// Data sets were requested of incomplete records.
    #[error("{}", unfinished(*.missing, .damaged.as_deref()))]
    Unfinished { missing: usize, damaged: Option<PathBuf> },
    /// A command of a suite cannot be flown.
    #[error(transparent)]
    Study(Box<TomlError>),
    /// The run was stopped.
    #[error("cancelled")]
    Cancelled,
    /// The plants of `[flights.other_plant]` are impossible.
    #[error("the system is impossible with the kinds of [flights.other_plant]")]
    OtherPlant,
    /// The healthy twin could not be simulated.
    #[error("the healthy system cannot be simulated in case {case}: {reason}")]
    Twin { case: String, reason: String },
}

impl From<TomlError> for RunError {
    fn from(error: TomlError) -> Self {
        RunError::Study(Box::new(error))
    }
}

impl RunError {
    /// Checks that a study has the sections that a scenario needs.
    ///
    /// # Errors
    /// [`RunError::NoSection`].
    pub fn check(scenario: Scenario, study: &Study) -> Result<(), Self> {
        match scenario.is_possible(study) {
            true => Ok(()),
            false => Err(RunError::no_section(scenario, study)),
        }
    }

    /// The error for a study that lacks sections needed by a scenario.
    pub(super) fn no_section(scenario: Scenario, study: &Study) -> Self {
        RunError::NoSection { scenario, lacks: scenario.lacks(study) }
    }
}

fn lacking_sections(scenario: Scenario, lacks: &[Section]) -> String {
    let names: Vec<String> = lacks.iter().map(|section| format!("[{}]", section.name)).collect();
    let examples: String = lacks.iter().map(|section| format!("\n  {}", section.example)).collect();
    format!(
        "the study lacks {}, which scenario '{}' needs; for example, above its first section:{examples}",
        names.join(" and "),
        scenario.name()
    )
}

fn unfinished(missing: usize, damaged: Option<&Path>) -> String {
    match damaged {
        Some(path) => format!(
            "{} is damaged: 'servotwin study --suite records' simulates its variants again ({missing} are missing)",
            path.display()
        ),
        None => format!(
            "{missing} variants of this study have not been simulated: run 'servotwin study --suite records'"
        ),
    }
}
