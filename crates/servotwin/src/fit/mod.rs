//! A twin fitted to its actuator: parameters inside of their tolerances that explain a record, how well
//! they are known, and what a record shows that no tolerance explains.
//!
//! - [`unknown`]: what may change, with its prior and its bounds
//! - [`record`], `plausible`: a table of samples, and whether it can be of this system at all
//! - `response`: residuals and how they change, one unknown a lane
//! - `solve`: the minimum, by Gauss–Newton steps between bounds
//! - [`knowledge`]: covariance, trade-offs, what is not seen, as sentences
//! - [`finding`]: what is left: a deviation outside of tolerances is a finding, never an update
//! - [`suspects`]: what it looks like
//! - [`verdict`]: all of that in one sentence
//! - [`fleet`]: many specimens with one calibration flight, for campaigns
//! - [`intensity`]: how strong a fault is, and which of several it is
//! - [`onset`]: when it began, where that was within the record
//! - [`design`]: which flight shows the unknowns best
//! - [`history`], [`trend`], [`repair`]: the flights of one tail number, how wear goes on, and where it was repaired
//!
//! A fit is a finding or an update, never both: what a fault changed must not vanish in parameters.

pub mod design;
pub mod finding;
pub mod fleet;
pub mod history;
pub mod intensity;
pub mod knowledge;
pub mod linear;
pub mod onset;
mod plausible;
pub mod record;
pub mod repair;
mod response;
mod solve;
pub mod suspects;
#[cfg(test)]
mod tests;
pub mod trend;
pub mod unknown;
pub mod verdict;
mod write;

pub use finding::{FitFinding, SensorFit};
pub use knowledge::{Knowledge, Known};
pub use onset::Onset;
pub use record::{LeftOut, Record, RecordError, TIME_UNIT};
pub use suspects::Suspect;
pub use unknown::Unknown;
pub use verdict::FitVerdict;

use crate::ensemble::processors;
use crate::study::Study;
use crate::system::System;
use crate::system::imperfection::Imperfection;
use servotwin_model::solver::{self, Settings};
use std::fmt;
use std::sync::atomic::AtomicBool;

/// What is before is not compared: an actuator is at rest only in theory when its record begins, s.
const WARM_UP_S: f64 = 1.0;
/// What a sensor shows is never better known than this part of its scale: the error of the solver.
const SOLVER_ERROR: f64 = 1e-4;

/// What is fitted to what.
pub struct Fit<'s> {
    /// The system, with nominal parameters.
    pub system: &'s System,
    /// What may change.
    pub unknowns: Vec<Unknown>,
    /// The records.
    pub records: Vec<Record>,
    /// Faults that a finding is compared with: (component, fault).
    pub suspects: Vec<(usize, usize)>,
    /// When the faults among the unknowns begin, s from the first sample on; `None` for before it.
    pub onset_s: Option<f64>,
    /// How runs are made.
    pub solver: Settings,
    /// Number of threads.
    pub threads: usize,
    /// Set from elsewhere to stop.
    pub cancel: Option<&'s AtomicBool>,
    /// Called when a run has ended.
    pub progress: &'s (dyn Fn() + Sync),
}

/// Why there is no fit at all.
#[derive(Clone, Debug, PartialEq)]
pub enum FitError {
    /// There is nothing to estimate.
    NoUnknown,
    /// There is no record.
    NoRecord,
    /// A record cannot be of this system.
    Record {
        /// Its name.
        name: String,
        /// Why.
        error: RecordError,
    },
    /// The solver could not go on.
    Run {
        /// When, s.
        time_s: f64,
        /// The state with the largest error.
        state: String,
        /// What happened.
        cause: String,
    },
    /// An unknown without a prior is not determined by the records.
    Undetermined,
    /// It was stopped.
    Cancelled,
}

impl FitError {
    fn run(system: &System, failure: solver::Failure) -> Self {
        let state = system.program.states().get(failure.state);
        FitError::Run {
            time_s: failure.time_s,
            state: state.map_or_else(String::new, |state| state.name.clone()),
            cause: failure.cause.to_string(),
        }
    }
}

impl fmt::Display for FitError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FitError::NoUnknown => {
                write!(out, "there is nothing to estimate: the study names no tolerances")
            }
            FitError::NoRecord => write!(out, "there is no record to fit to"),
            FitError::Record { name, error } => write!(out, "{name}: {error}"),
            FitError::Run { time_s, state, cause } => {
                write!(out, "the twin of the record stopped at {time_s:.3} s at {state}: {cause}")
            }
            FitError::Undetermined => {
                write!(
                    out,
                    "the records do not determine an unknown of which nothing is known before"
                )
            }
            FitError::Cancelled => write!(out, "stopped"),
        }
    }
}

impl std::error::Error for FitError {}

/// What a fit gave.
#[derive(Clone, Debug)]
pub struct FitResults {
    /// The unknowns, in standard deviations of their tolerances or as intensities.
    pub z: Vec<f64>,
    /// How well each of them is known.
    pub known: Known,
    /// The parameters, as a variant takes them: (component, parameter, value).
    pub overrides: Vec<(usize, usize, f64)>,
    /// Half of the squared residuals and of the squared deviations from the priors.
    pub cost: f64,
    /// For each sensor of each record what is left.
    pub left: Vec<SensorFit>,
    /// What no tolerance explains; where there is any, the parameters are no update.
    pub findings: Vec<FitFinding>,
    /// What it looks like, the likeliest first.
    pub suspects: Vec<Suspect>,
    /// Steps that were taken.
    pub steps: usize,
}

impl FitResults {
    /// Whether the twin may take these parameters.
    pub fn is_update(&self) -> bool {
        self.findings.is_empty()
    }
}

fn silent() {}

impl<'s> Fit<'s> {
    /// All tolerances of a study and all its faults as suspects.
    pub fn of_study(study: &'s Study, records: Vec<Record>) -> Self {
        let mut suspects: Vec<(usize, usize)> =
            study.faults.iter().map(|fault| (fault.at.component, fault.at.fault)).collect();
        suspects.dedup();
        Self { unknowns: Unknown::of_study(study), suspects, ..Self::new(&study.system, records) }
    }

    /// Without unknowns and suspects.
    pub fn new(system: &'s System, records: Vec<Record>) -> Self {
        Self {
            system,
            unknowns: Vec::new(),
            records,
            suspects: Vec::new(),
            onset_s: None,
            solver: Settings::campaign(),
            threads: processors(),
            cancel: None,
            progress: &silent,
        }
    }

    /// Fits the unknowns to the records.
    ///
    /// # Errors
    /// A record that cannot be of this system, or a twin that cannot be simulated.
    pub fn solve(&self) -> Result<FitResults, FitError> {
        self.check()?;
        let found = self.minimum(&vec![0.0; self.unknowns.len()])?;
        self.judged(found)
    }

    /// The name and the estimated value (SI) of each unknown.
    pub fn parameters<'f>(
        &'f self,
        results: &'f FitResults,
    ) -> impl Iterator<Item = (&'f str, f64)> + 'f {
        let pairs = self.unknowns.iter().zip(&results.z);
        pairs.map(|(unknown, z)| (unknown.name.as_str(), unknown.value(*z)))
    }

    /// What the records can tell of each unknown, before any fit.
    ///
    /// # Errors
    /// As [`Fit::solve`].
    pub fn structure(&self) -> Result<Known, FitError> {
        self.check()?;
        let z = vec![0.0; self.unknowns.len()];
        let linear = self.linear(&z, response::Difference::Forward)?;
        Known::new(&self.unknowns, &z, &linear.information).ok_or(FitError::Undetermined)
    }

    /// Whether the records can be of this system.
    ///
    /// # Errors
    /// The first mistake.
    pub fn check(&self) -> Result<(), FitError> {
        if self.unknowns.is_empty() {
            return Err(FitError::NoUnknown);
        }
        if self.records.is_empty() {
            return Err(FitError::NoRecord);
        }
        for record in &self.records {
            let nominal = vec![0.0; self.unknowns.len()];
            let run = self.run(record, 1, |_| self.variant(&nominal, &record.inputs))?;
            let residuals = run.into_iter().next().expect("one run")?;
            let (deviations, first) = (self.deviations(record), self.first_sample(record));
            if let Err(error) =
                plausible::check(self.system, record, &deviations, first, &residuals)
                && !self.is_rather_a_fault(record, &error)?
            {
                return Err(FitError::Record { name: record.name.clone(), error });
            }
        }
        Ok(())
    }

    /// What a sample of each sensor of a record carries.
    fn deviations(&self, record: &Record) -> Vec<f64> {
        let of = |&sensor: &usize| {
            let least = SOLVER_ERROR * self.system.sensors[sensor].scale;
            Imperfection::of(self.system, sensor).deviation().max(least)
        };
        record.sensors.iter().map(of).collect()
    }

    fn first_sample(&self, record: &Record) -> usize {
        (WARM_UP_S / record.period_s).round() as usize
    }
}
