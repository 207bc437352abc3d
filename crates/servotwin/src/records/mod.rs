//! Records: simulates every fault in every operating case on all cores, directly into windows.
//!
//! They are the runs of a suite ([`Study::records`]), which `crate::run::runner` simulates.
//!
//! Records are written in *parts* (`crate::run::part`). A resumed suite skips existing parts. Every record has the same
//! bits whenever it runs, so the result has the same bytes. Parts are simulated in rounds and joined one after the other.
//! Memory holds the twins of a round, its open lanes and unfinished parts; it does not grow with the number of variants,
//! nor with the length of faulty runs.
//!
//! A part contains windows, not features. The data set is made from the parts, so features can be changed without new
//! simulations.

mod calibration;
pub mod columns;
mod data_set;
mod effort;
mod files;
mod join;
mod row;
mod runner;

pub use crate::run::{RunError, ensemble};
pub use calibration::{Comparison, calibration_file, calibrations};
pub use columns::largest_column;
pub use data_set::{DataFeature, FOLDS, data_features};
pub(crate) use effort::VariantEffort;
pub use row::PartRow;

use crate::ensemble::Ensemble;
use crate::parallel::Workers;
use crate::run::SpecimenDraw;
use crate::run::part::PartFiles;
use crate::study::{Plants, Purpose, Scenario, Study, Suite};
use servotwin_model::solver::Statistics;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// The records of a purpose in scenarios with the same plants: a suite, with the files of its parts.
pub struct Records<'s> {
    /// The study to simulate.
    pub study: &'s Study,
    /// The runs, one for each record. Without noise, healthy specimens equal the twin and are left out.
    pub suite: Suite,
    /// One of the groups of [`Scenario::groups`].
    scenarios: Vec<Scenario>,
    workers: Workers<'s>,
    folder: PathBuf,
    /// The files of each scenario.
    files: Vec<PartFiles>,
}

/// The result of simulating records.
#[derive(Clone, Debug)]
pub struct RecordsOutcome {
    /// Whether the diagnosis is judged on it or trained on it.
    pub purpose: Purpose,
    /// The scenarios.
    pub scenarios: Vec<Scenario>,
    /// The length of a record with a fault, s.
    pub duration_s: f64,
    /// The time that it took, s.
    pub seconds: f64,
    /// Number of variants in all scenarios.
    pub variants: usize,
    /// Number of variants that were already done.
    pub resumed: usize,
    /// The solver's work in this run.
    pub statistics: Statistics,
    /// Variants that failed, with the reason.
    pub failed: Vec<(Scenario, usize, String)>,
    /// Number of variants that began without a steady state, in all scenarios; the data sets flag them.
    pub on_the_move: usize,
}

/// The title of records for readers.
pub(crate) fn title(purpose: Purpose, scenarios: &[Scenario]) -> String {
    let names: Vec<&str> = scenarios.iter().map(|scenario| scenario.name()).collect();
    let training = if purpose == Purpose::Train { ", training commands" } else { "" };
    format!("{}{training}", names.join(" and "))
}

impl RecordsOutcome {
    /// The title of its records for readers.
    pub fn title(&self) -> String {
        title(self.purpose, &self.scenarios)
    }
}

/// The records of a study: training commands and judged cases for each group of scenarios.
pub(crate) fn runs(
    study: &Study,
    choice: impl Fn(Scenario) -> bool,
) -> Vec<(Purpose, Vec<Scenario>)> {
    let groups = Scenario::groups(study, choice).into_iter();
    let of = |scenarios: Vec<Scenario>| {
        study.purposes().into_iter().map(move |r| (r, scenarios.clone()))
    };
    groups.flat_map(of).collect()
}

impl<'s> Records<'s> {
    /// Plans the records of a purpose in an output folder.
    ///
    /// # Errors
    /// The study is empty, or lacks a section that a scenario needs.
    pub fn new(
        folder: &Path,
        study: &'s Study,
        (purpose, scenarios): (Purpose, Vec<Scenario>),
        workers: Workers<'s>,
    ) -> Result<Self, RunError> {
        let mut suite = study.records(purpose);
        if !scenarios.iter().any(|scenario| scenario.has_noise()) {
            suite.healthy = 0;
        }
        let files = files::of(folder, study, &suite, &scenarios)?;
        let folder = folder.into();
        Ok(Records { study, suite, scenarios, workers, folder, files })
    }
}

impl Records<'_> {
    /// Simulates what is missing and writes the data sets. `progress` receives the number of rows done and their total.
    ///
    /// # Errors
    /// A file cannot be written, the healthy system cannot be simulated, or
    /// [`RunError::Cancelled`]. Failures of single variants are in the outcome.
    pub fn run(
        &self,
        progress: &(dyn Fn(usize, usize) + Sync),
    ) -> Result<RecordsOutcome, RunError> {
        let begin = Instant::now();
        let all: Vec<usize> = (0..self.part_count()).collect();
        let mut outcome = self.run_parts(&all, progress)?;
        self.write_data_sets(&mut outcome)?;
        outcome.seconds = begin.elapsed().as_secs_f64();
        Ok(outcome)
    }

    /// How plants and twins are paired, common to all scenarios of a group.
    fn plants(&self) -> Plants {
        self.scenarios[0].plants()
    }

    fn ensemble(&self) -> Ensemble<'_> {
        let (threads, cancel) = (self.workers.threads(), self.workers.cancel());
        Ensemble { threads, cancel, ..ensemble(self.study) }
    }
}
