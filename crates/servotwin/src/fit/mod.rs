//! Fits a twin to its actuator: parameters inside their tolerances that explain a record, how well they are known, and
//! what no tolerance explains.
//!
//! - [`unknown`]: what a fit may change, with priors and bounds
//! - `record`, `plausible`: tables of samples, and whether they can belong to this system
//! - `response`: residuals and their derivatives, one unknown per lane
//! - `solve`: the minimum, by Gauss–Newton steps within bounds
//! - `knowledge`: covariance, trade-offs and unknowns that are not seen, as sentences
//! - `finding`: what a solution says: an update or findings, and the verdict in one sentence
//! - `suspects`: the faults that a finding resembles
//! - `fleet`: many specimens with one calibration flight, for campaigns
//! - [`intensity`]: the intensity of a fault, and the comparison of several faults
//! - `onset`: when a fault began, if within the record
//! - [`design`]: which flight determines the unknowns best
//! - [`history`], [`trend`], [`repair`]: the flights of one tail number, the trend of wear, and repairs
//!
//! A fit is a finding or an update, never both: parameters must not absorb the effect of a fault.

pub mod design;
pub(crate) mod finding;
pub(crate) mod fleet;
pub mod history;
pub mod intensity;
pub(crate) mod knowledge;
pub mod linear;
pub(crate) mod onset;
mod plausible;
pub(crate) mod record;
pub mod repair;
mod response;
mod solve;
pub(crate) mod suspects;
#[cfg(test)]
mod tests;
pub mod trend;
pub mod unknown;
mod write;

pub use finding::{FitFinding, FitVerdict, SensorFit};
pub use knowledge::{FitKnowledge, Knowledge};
pub use onset::FoundOnset;
pub use record::{FitRecord, LeftOut, RecordError, TIME_UNIT, unit_key};
pub use suspects::Suspect;
pub use unknown::Unknown;

use crate::beside::InputMistake;
use crate::ensemble::processors;
use crate::study::Study;
use crate::system::System;
use crate::system::imperfection::Imperfection;
use plausible::ComparedRecord;
use servotwin_model::solver::{self, SolverSettings};
use std::sync::atomic::AtomicBool;

/// Samples before this time are not compared: an actuator is rarely at rest when its record begins, s.
const WARM_UP_S: f64 = 1.0;
/// Lower limit of a sensor's deviation, as a fraction of its scale: the solver's error.
const SOLVER_ERROR: f64 = 1e-4;

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
    #[error("the twin of the record stopped at {time_s:.3} s at {state}: {cause}")]
    Run {
        /// Simulation time of the failure, s.
        time_s: f64,
        /// The state with the largest error.
        state: String,
        /// The cause.
        cause: String,
    },
    /// An unknown without a prior is not determined by the records.
    #[error("the records do not determine an unknown of which nothing is known before")]
    Undetermined,
    /// The fit was stopped.
    #[error("stopped")]
    Cancelled,
}

impl FitError {
    fn run(system: &System, failure: solver::SolverFailure) -> Self {
        let state = system.program.states().get(failure.state);
        FitError::Run {
            time_s: failure.time_s,
            state: state.map_or_else(String::new, |state| state.name.clone()),
            cause: failure.cause.to_string(),
        }
    }
}

/// The result of a fit.
#[derive(Clone, Debug)]
pub struct FitResults {
    /// The unknowns, in standard deviations of their tolerances or as intensities.
    pub z: Vec<f64>,
    /// How well each of them is known.
    pub known: FitKnowledge,
    /// The parameters in the form of a variant: (component, parameter, value).
    pub overrides: Vec<(usize, usize, f64)>,
    /// Half of the sum of squared residuals and squared deviations from the priors (FS1).
    pub cost: f64,
    /// The residuals of each sensor of each record, summarized.
    pub left: Vec<SensorFit>,
    /// Deviations that no tolerance explains; if there are any, the parameters are not an update.
    pub findings: Vec<FitFinding>,
    /// The suspects of the findings, the likeliest first.
    pub suspects: Vec<Suspect>,
    /// Number of steps taken.
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
            solver: SolverSettings::campaign(),
            threads: processors(),
            cancel: None,
            progress: &silent,
        }
    }

    /// Fits the unknowns to the records.
    ///
    /// # Errors
    /// A record cannot belong to this system, or a twin cannot be simulated.
    pub fn solve(&self) -> Result<FitResults, FitError> {
        self.check()?;
        let found = self.minimum(&self.nominal())?;
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

    /// Checks whether the records can belong to this system.
    ///
    /// # Errors
    /// The first mistake found.
    pub fn check(&self) -> Result<(), FitError> {
        if self.unknowns.is_empty() {
            return Err(FitError::NoUnknown);
        }
        if self.records.is_empty() {
            return Err(FitError::NoRecord);
        }
        for record in &self.records {
            let compared = self.beside_nominal(record)?;
            let mistake = self.input_mistake(record, &compared)?;
            if let Err(error) = mistake.map_or_else(|| compared.check(self.system), Err)
                && !self.is_rather_a_fault(record, &error)?
            {
                return Err(FitError::Record { name: record.name.clone(), error });
            }
        }
        Ok(())
    }

    /// A record beside its nominal twin.
    fn beside_nominal<'r>(&'r self, record: &'r FitRecord) -> Result<ComparedRecord<'r>, FitError> {
        let run = self.run(record, 1, |_| self.variant(&self.nominal(), &record.inputs))?;
        let residuals = run.into_iter().next().expect("one run")?;
        let (deviations, first) = (self.deviations(record), self.first_sample(record));
        Ok(ComparedRecord::new(self.system, record, &deviations, first, &residuals))
    }

    /// A mistake of the column of an input that varies.
    fn input_mistake(
        &self,
        record: &FitRecord,
        compared: &ComparedRecord,
    ) -> Result<Option<RecordError>, FitError> {
        for input in record.varying(self.system) {
            let mut rerun = |mistake: &InputMistake| {
                let undone = record.without_mistake(self.system, input, mistake);
                match self.beside_nominal(&undone) {
                    Ok(compared) => Ok(Some(compared.into_comparisons())),
                    Err(FitError::Cancelled) => Err(FitError::Cancelled),
                    Err(_) => Ok(None),
                }
            };
            if let Some(found) = compared.input_mistake(self.system, input, &mut rerun)? {
                return Ok(Some(found));
            }
        }
        Ok(None)
    }

    /// The standard deviation of a sample of each sensor of a record.
    fn deviations(&self, record: &FitRecord) -> Vec<f64> {
        let of = |&sensor: &usize| {
            let least = SOLVER_ERROR * self.system.sensors[sensor].scale;
            Imperfection::of(self.system, sensor).deviation().max(least)
        };
        record.sensors.iter().map(of).collect()
    }

    fn first_sample(&self, record: &FitRecord) -> usize {
        (WARM_UP_S / record.period_s).round() as usize
    }
}

/// The sensor that an actuator follows while its command stands still: the nominal twin stands still, too, but follows
/// all sensors if this one is its command. `inputs` and `measured` have all inputs and sensors of the system in SI, one
/// sample after the other; NaN is a missing sensor value.
///
/// # Errors
/// The twin of these inputs cannot be simulated.
pub fn still_command(
    study: &Study,
    period_s: f64,
    inputs: &[f64],
    measured: &[f64],
) -> Result<Option<InputMistake>, FitError> {
    let (system, command) = (&study.system, study.command_input);
    let width = system.network().inputs.len();
    let signal = |input: usize| {
        let values: Vec<f64> = inputs.iter().skip(input).step_by(width).copied().collect();
        record::smooth(period_s, &values)
    };
    let signals: Vec<_> = (0..width).map(signal).collect();
    let sensors = (0..system.sensors.len()).collect();
    let record = FitRecord::logged("", &signals, sensors, period_s, measured.to_vec());
    let fit = Fit::new(system, vec![]);
    fit.beside_nominal(&record)?.still_input(&mut |mistake| {
        let undone = record.without_mistake(system, command, mistake);
        Ok(fit.beside_nominal(&undone).ok().map(ComparedRecord::into_comparisons))
    })
}
