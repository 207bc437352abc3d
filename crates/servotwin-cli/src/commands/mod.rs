//! One file per command, and what they share.

pub mod campaign;
pub mod check;
pub mod completions;
pub mod describe;
pub mod evaluate;
pub mod explain;
pub mod faults;
pub mod features;
mod progress;
pub mod report;
pub mod simulate;
pub mod study;
mod summary;
pub mod train;

use crate::failure::Failure;
use servotwin::evaluation::foreign::{HoldOut, Selection};
use servotwin::study::Study;
use servotwin::system::System;
use servotwin_model::signal::Piecewise;
use std::path::{Path, PathBuf};

/// The system that a command is about.
#[derive(clap::Args)]
pub struct SystemOption {
    /// A system file; without it, the aileron with two actuators.
    #[arg(value_name = "SYSTEM")]
    path: Option<PathBuf>,
}

impl SystemOption {
    /// Reads the system.
    pub fn read(&self) -> Result<System, Failure> {
        match &self.path {
            Some(path) => read_system(path),
            None => Ok(System::default()),
        }
    }
}

/// The study that a command runs, and where its results go.
#[derive(clap::Args)]
pub struct StudyOptions {
    /// A study file; without it, the paper's study of the aileron.
    #[arg(value_name = "STUDY")]
    study: Option<PathBuf>,
    /// The folder for data sets, models, results and the report.
    #[arg(long, value_name = "FOLDER", default_value = "out")]
    out: PathBuf,
    /// Number of threads [default: all processors; the results do not depend
    /// on it].
    #[arg(long)]
    threads: Option<usize>,
}

impl StudyOptions {
    /// Reads the study.
    fn read(&self) -> Result<Study, Failure> {
        match &self.study {
            Some(path) => Ok(Study::read(path)?),
            None => Ok(Study::default()),
        }
    }
}

/// What a command makes of a table's columns and rows.
#[derive(clap::Args)]
pub struct TableOptions {
    /// The column with the class (tables only, as all options that follow).
    #[arg(long)]
    label: Option<String>,
    /// The column with the group; rows of one group are held out together.
    #[arg(long)]
    group: Option<String>,
    /// The columns to learn from; without, all other columns with numbers.
    #[arg(long, value_delimiter = ',')]
    features: Vec<String>,
    /// Number of folds.
    #[arg(long, default_value_t = 5)]
    folds: usize,
    /// The seed of the folds.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

impl TableOptions {
    fn selection(&self, label: &str) -> Selection {
        let (group, features) = (self.group.clone(), self.features.clone());
        Selection { label: label.into(), group, features }
    }

    fn hold_out(&self) -> HoldOut {
        HoldOut::Folds { folds: self.folds, seed: self.seed }
    }
}

fn read_system(path: &Path) -> Result<System, Failure> {
    Ok(System::read(path)?)
}

/// The inputs of a system as they are where a run gives no signal.
fn default_inputs(system: &System) -> Vec<Piecewise> {
    let inputs = system.network().inputs.iter();
    let constant = |value| Piecewise::constant(value).expect("a system's defaults are finite");
    inputs.map(|input| constant(input.default)).collect()
}
