//! Fits many specimens that flew the same calibration flight, each to its own record.
//!
//! All fits start at the nominal twin, so J and A = JᵀJ + Q are computed once, around it, and kept. Each turn is a
//! single run per specimen with its own parameters, in lanes. After three turns, specimens that differ by tolerances
//! agree with individual fits to a fraction of a standard error (test); draws as large as those of flights take some
//! more.

use super::response::{DerivativeScheme, Linear};
use super::{Fit, FitError};

/// Number of turns for each specimen.
const TURNS: usize = 6;
/// Number of runs whose residuals are kept in memory.
const AT_ONCE: usize = 96;

/// A fitted specimen.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Specimen {
    /// The unknowns, in standard deviations of their tolerances.
    pub(crate) z: Vec<f64>,
    /// The parameters in the form of a variant: (component, parameter, value).
    pub(crate) overrides: Vec<(usize, usize, f64)>,
}

/// The fitted specimens, or why the twin of one cannot be simulated, and the standard error of each unknown, which all
/// have in common.
pub(crate) type Fleet = (Vec<Result<Specimen, FitError>>, Vec<f64>);

impl Fit<'_> {
    /// Fits specimens to their sensor values, which are ordered by sample as in a [`FitRecord`](super::FitRecord). The
    /// calibration flight is the first record; its measured values are not used.
    ///
    /// # Errors
    /// The nominal twin cannot be simulated, an unknown is not determined, or the run was stopped.
    pub(crate) fn fleet(&self, measured: &[Vec<f64>]) -> Result<Fleet, FitError> {
        if self.records.is_empty() {
            return Err(FitError::NoRecord);
        }
        if self.unknowns.is_empty() {
            return Err(FitError::NoUnknown);
        }
        let linear = self.linear(&self.nominal(), DerivativeScheme::Central)?;
        let covariance = linear.curvature.inverse().ok_or(FitError::Undetermined)?;
        let errors = (0..self.unknowns.len()).map(|k| covariance.at(k, k).sqrt()).collect();
        let mut all = vec![];
        for measured in measured.chunks(AT_ONCE) {
            let mut fitted = vec![Ok(self.nominal()); measured.len()];
            for _ in 0..TURNS {
                self.turn(&linear, measured, &mut fitted)?;
            }
            all.extend(fitted);
        }
        let specimen = |z: Vec<f64>| {
            let overrides = self.variant(&z, &[]).overrides;
            Specimen { z, overrides }
        };
        Ok((all.into_iter().map(|z| z.map(specimen)).collect(), errors))
    }

    /// One step of all unknowns of every specimen that can still be simulated.
    fn turn(
        &self,
        linear: &Linear,
        measured: &[Vec<f64>],
        all: &mut [Result<Vec<f64>, FitError>],
    ) -> Result<(), FitError> {
        let record = &self.records[0];
        let before: Vec<(usize, Vec<f64>)> =
            all.iter().enumerate().filter_map(|(k, z)| Some((k, z.clone().ok()?))).collect();
        let variant = |job: usize| self.variant(&before[job].1, &record.inputs);
        let twins = self.twins(record, (before.len(), 1.0), variant)?;
        for ((place, z), twin) in before.iter().zip(twins) {
            all[*place] = twin.and_then(|twin| {
                let residuals = self.residuals_beside(record, &measured[*place], &twin);
                let (step, _) = self.step(linear, z, &linear.pull(&residuals), None)?;
                let moved = z.iter().zip(&step).zip(&self.unknowns);
                Ok(moved.map(|((z, step), u)| (z + step).clamp(u.range.0, u.range.1)).collect())
            });
        }
        Ok(())
    }
}
