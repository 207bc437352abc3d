//! Fits many specimens that flew the same calibration flight, each to its own record.
//!
//! All fits start at the nominal twin, so J and A = JᵀJ + Q are computed once, around it, and kept. Each turn is a
//! single run per specimen with its own parameters, in lanes. After three turns, specimens that differ by tolerances
//! agree with individual fits to a fraction of a standard error (test); draws as large as those of flights take some
//! more.

use super::linear::Symmetric;
use super::response::{DerivativeScheme, Linear};
use super::{Fit, FitError};

/// Number of turns for each specimen.
const TURNS: usize = 6;
/// Number of runs whose residuals are kept in memory.
const AT_ONCE: usize = 96;

/// The calibration flight and its information about the unknowns.
pub(crate) struct Fleet<'p, 's> {
    problem: &'p Fit<'s>,
    linear: Linear,
    curvature: Symmetric,
}

/// A fitted specimen.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Specimen {
    /// The unknowns, in standard deviations of their tolerances.
    pub z: Vec<f64>,
    /// The parameters in the form of a variant: (component, parameter, value).
    pub overrides: Vec<(usize, usize, f64)>,
}

impl<'p, 's> Fleet<'p, 's> {
    /// Prepares a fleet whose calibration flight is the first record of a problem; the measured values are not used.
    ///
    /// # Errors
    /// The nominal twin cannot be simulated.
    pub(crate) fn new(problem: &'p Fit<'s>) -> Result<Self, FitError> {
        if problem.records.is_empty() {
            return Err(FitError::NoRecord);
        }
        if problem.unknowns.is_empty() {
            return Err(FitError::NoUnknown);
        }
        let linear = problem.linear(&problem.nominal(), DerivativeScheme::Central)?;
        let curvature = linear.information.plus_diagonal(&problem.priors());
        Ok(Self { problem, linear, curvature })
    }

    /// The covariance of the unknowns, common to all specimens; `None` if an unknown is not determined.
    pub(crate) fn covariance(&self) -> Option<Symmetric> {
        self.curvature.inverse()
    }

    /// Fits specimens to their sensor values, which are ordered by sample as in a [`FitRecord`](super::FitRecord). A
    /// specimen whose twin cannot be simulated has an error.
    ///
    /// # Errors
    /// The run was stopped.
    pub(crate) fn fit(
        &self,
        measured: &[Vec<f64>],
    ) -> Result<Vec<Result<Specimen, FitError>>, FitError> {
        let mut all = vec![];
        for measured in measured.chunks(AT_ONCE) {
            let mut fitted = vec![Ok(self.problem.nominal()); measured.len()];
            for _ in 0..TURNS {
                self.turn(measured, &mut fitted)?;
            }
            all.extend(fitted);
        }
        let specimen = |z: Vec<f64>| {
            let overrides = self.problem.variant(&z, &[]).overrides;
            Specimen { z, overrides }
        };
        Ok(all.into_iter().map(|z| z.map(specimen)).collect())
    }

    /// One step of all unknowns of every specimen that can still be simulated.
    fn turn(
        &self,
        measured: &[Vec<f64>],
        all: &mut [Result<Vec<f64>, FitError>],
    ) -> Result<(), FitError> {
        let (problem, record) = (self.problem, &self.problem.records[0]);
        let before: Vec<(usize, Vec<f64>)> =
            all.iter().enumerate().filter_map(|(k, z)| Some((k, z.clone().ok()?))).collect();
        let runs = problem.run_against(
            &problem.ensemble(record),
            record,
            |job| &measured[before[job].0],
            before.len(),
            |job| problem.variant(&before[job].1, &record.inputs),
        )?;
        for ((place, z), residuals) in before.iter().zip(runs) {
            all[*place] = residuals.and_then(|residuals| {
                let pull = self.linear.pull(&residuals);
                let (step, _) = problem.step(&self.curvature, z, &pull)?;
                let moved = z.iter().zip(&step).zip(&problem.unknowns);
                Ok(moved.map(|((z, step), u)| (z + step).clamp(u.range.0, u.range.1)).collect())
            });
        }
        Ok(())
    }
}
