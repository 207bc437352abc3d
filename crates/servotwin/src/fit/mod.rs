//! Fits a twin to its actuator: parameters inside their tolerances that explain a record, how well they are known, and
//! what no tolerance explains.
//!
//! - `unknown`: what a fit may change, with priors and bounds
//! - `record`, `plausible`: tables of samples, and whether they can belong to this system
//! - `response`: residuals and their derivatives, one unknown per lane
//! - `solve`: the minimum, by Gauss–Newton steps within bounds
//! - `knowledge`: covariance, trade-offs and unknowns that are not seen, as sentences
//! - `finding`: what a solution says: an update or findings, and the verdict in one sentence
//! - `suspects`: the faults that a finding resembles
//! - `fleet`: many specimens with one calibration flight, for suites
//! - [`intensity`]: the intensity of a fault, and the comparison of several faults
//! - `onset`: when a fault began, if within the record
//! - [`design`]: which flight determines the unknowns best
//! - [`history`], [`trend`], [`repair`]: the flights of one tail number, the trend of wear, and repairs
//!
//! A fit is a finding or an update, never both: parameters must not absorb the effect of a fault.

pub mod design;
mod finding;
pub(crate) mod fleet;
pub mod history;
pub mod intensity;
mod knowledge;
mod linear;
mod onset;
mod plausible;
mod record;
pub mod repair;
mod response;
mod solve;
mod suspects;
#[cfg(test)]
mod tests;
pub mod trend;
mod unknown;
mod write;

pub use finding::{FitResults, FitVerdict, SensorFit};
pub use knowledge::FitKnowledge;
pub use onset::FoundOnset;
pub use plausible::still_command;
pub use record::{FitRecord, LeftOut, RecordError, TIME_UNIT, unit_key};
pub use suspects::Suspect;
pub use unknown::Unknown;

use crate::ensemble::processors;
use crate::rest::Stopped;
use crate::study::Study;
use crate::system::System;
use servotwin_model::solver::SolverSettings;
use std::sync::atomic::AtomicBool;

/// A fit: records, unknowns and solver settings.
#[derive(Clone)]
pub struct Fit<'s> {
    /// The system, with nominal parameters.
    pub system: &'s System,
    /// The parameters and intensities that may change.
    pub unknowns: Vec<Unknown>,
    /// The records to explain.
    pub records: Vec<FitRecord>,
    /// Faults that a finding is compared with: (component, fault).
    pub suspects: Vec<(usize, usize)>,
    /// When the faults among the unknowns begin, s after the first sample; `None` if they precede it.
    pub onset_s: Option<f64>,
    /// Solver settings of the runs.
    pub solver: SolverSettings,
    /// The number of worker threads.
    pub threads: usize,
    /// Set by another thread to stop the fit.
    pub cancel: Option<&'s AtomicBool>,
    /// Called after each run.
    pub progress: &'s (dyn Fn() + Sync),
}

/// Why a fit is impossible.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// There is nothing to estimate.
    #[error("there is nothing to estimate: the study names no tolerances")]
    NoUnknown,
    /// There is no record.
    #[error("there is no record to fit to")]
    NoRecord,
    /// A record cannot belong to this system.
    #[error("{name}: {error}")]
    Record {
        /// The name of the record.
        name: String,
        /// The reason.
        error: RecordError,
    },
    /// The solver failed.
    #[error("the twin of the record: {0}")]
    Run(Stopped),
    /// An unknown without a prior is not determined by the records.
    #[error("the records do not determine an unknown of which nothing is known before")]
    Undetermined,
    /// The fit was stopped.
    #[error("stopped")]
    Cancelled,
}

impl<'s> Fit<'s> {
    /// A fit of all tolerances of a study, with all its faults as suspects.
    pub fn of_study(study: &'s Study, records: Vec<FitRecord>) -> Self {
        let mut suspects: Vec<(usize, usize)> =
            study.faults.iter().map(|fault| (fault.at.component, fault.at.fault)).collect();
        suspects.dedup();
        Self { unknowns: Unknown::of_study(study), suspects, ..Self::new(&study.system, records) }
    }

    /// A fit without unknowns and suspects.
    pub(crate) fn new(system: &'s System, records: Vec<FitRecord>) -> Self {
        Self {
            system,
            unknowns: Vec::new(),
            records,
            suspects: Vec::new(),
            onset_s: None,
            solver: SolverSettings::of_runs(),
            threads: processors(),
            cancel: None,
            progress: &|| (),
        }
    }

    /// The same problem with another record.
    fn of_record(&self, record: FitRecord) -> Self {
        Fit {
            unknowns: self.unknowns.clone(),
            records: vec![record],
            suspects: self.suspects.clone(),
            ..*self
        }
    }

    /// Fits the unknowns to the records.
    ///
    /// # Errors
    /// A record cannot belong to this system, or a twin cannot be simulated.
    pub fn solve(&self) -> Result<FitResults, FitError> {
        self.check()?;
        self.judged(self.minimum(&self.nominal())?)
    }

    /// The name and the estimated value (SI) of each unknown.
    pub fn parameters<'f>(
        &'f self,
        results: &'f FitResults,
    ) -> impl Iterator<Item = (&'f str, f64)> + 'f {
        let pairs = self.unknowns.iter().zip(&results.z);
        pairs.map(|(unknown, z)| (unknown.name.as_str(), unknown.value(*z)))
    }
}
