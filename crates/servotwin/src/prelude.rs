//! The types that most programs need: `use servotwin::prelude::*`.

pub use crate::fit::{Fit, FitError, FitRecord, FitResults};
pub use crate::job::{Job, JobError, StudyEvent, StudyResults, StudyRun};
pub use crate::learn::model_file::read_diagnoser;
pub use crate::live::monitor::Monitor;
pub use crate::live::observer::{DiagnosisState, Finding};
pub use crate::nearest::UnknownName;
pub use crate::simulate::{
    InputSignal, Simulation, SimulationError, SimulationResults, Sweep, VariantSpec,
};
pub use crate::study::{Scenario, Study};
pub use crate::system::System;
pub use crate::table::{Table, TableError};
pub use crate::toml_text::TomlError;
pub use servotwin_diagnosis::diagnoser::Diagnoser;
pub use servotwin_diagnosis::hierarchy::Hierarchy;
