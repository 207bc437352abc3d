//! One file per command, and what they share.

pub mod campaign;
pub mod check;
pub mod completions;
pub mod describe;
pub mod evaluate;
pub mod faults;
pub mod features;
mod progress;
pub mod report;
pub mod simulate;
pub mod study;
mod summary;
pub mod train;

use crate::failure::Failure;
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

fn read_system(path: &Path) -> Result<System, Failure> {
    Ok(System::read(path)?)
}

/// The inputs of a system as they are where a run gives no signal.
fn default_inputs(system: &System) -> Vec<Piecewise> {
    let inputs = system.network().inputs.iter();
    let constant = |value| Piecewise::constant(value).expect("a system's defaults are finite");
    inputs.map(|input| constant(input.default)).collect()
}
