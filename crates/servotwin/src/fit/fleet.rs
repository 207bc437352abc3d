//! Fits many specimens that flew the same calibration flight, each to its own record.
//!
//! All fits start in the middle of the unknowns' ranges, so J and A = JᵀJ + Q are computed once, around it, and kept. Each
//! turn is a single run per specimen with its own parameters, in lanes. A step that does not lower F is halved: draws are
//! so large that J may be wrong by a factor. After three turns, specimens that differ by tolerances agree with individual
//! fits to a fraction of a standard error (test).

use super::response::{DerivativeScheme, Linear};
use super::solve::SMALL_GAIN;
use super::{Fit, FitError};

/// The most turns for each specimen.
const MOST_TURNS: usize = 24;
/// No smaller share of a step is tried: what is left of F to gain is then less than the errors of J.
const LEAST_SHARE: f64 = 0.1;
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
        let middle: Vec<f64> =
            self.unknowns.iter().map(|unknown| 0.5 * (unknown.range.0 + unknown.range.1)).collect();
        let linear = self.linear(&middle, DerivativeScheme::Central)?;
        let covariance = linear.curvature.inverse().ok_or(FitError::Undetermined)?;
        let errors = (0..self.unknowns.len()).map(|k| covariance.at(k, k).sqrt()).collect();
        let mut all = vec![];
        for measured in measured.chunks(AT_ONCE) {
            let mut fitted = vec![Progress::at(&middle); measured.len()];
            for _ in 0..MOST_TURNS {
                self.turn(&linear, measured, &mut fitted)?;
            }
            all.extend(fitted.into_iter().map(Progress::end));
        }
        let specimen = |z: Vec<f64>| {
            let overrides = self.variant(&z, &[]).overrides;
            Specimen { z, overrides }
        };
        Ok((all.into_iter().map(|z| z.map(specimen)).collect(), errors))
    }

    /// Tries the next point of every specimen that is not at its minimum.
    fn turn(
        &self,
        linear: &Linear,
        measured: &[Vec<f64>],
        all: &mut [Progress],
    ) -> Result<(), FitError> {
        let record = &self.records[0];
        let open: Vec<usize> = (0..all.len()).filter(|&place| !all[place].has_ended).collect();
        let points: Vec<Vec<f64>> = open.iter().map(|&place| self.next(&all[place])).collect();
        let variant = |job: usize| self.variant(&points[job], &record.inputs);
        let twins = self.twins(record, (points.len(), 1.0), variant)?;
        for ((place, z), twin) in open.into_iter().zip(points).zip(twins) {
            let own = &mut all[place];
            let residuals = twin.map(|twin| self.residuals_beside(record, &measured[place], &twin));
            match residuals.map(|residuals| (self.cost(&z, &residuals), linear.pull(&residuals))) {
                Ok((cost, pull)) if cost < own.cost => {
                    let (step, promised) = self.step(linear, &z, &pull, None)?;
                    *own = Progress { z, cost, step, share: 1.0, ..own.clone() };
                    (own.failure, own.has_ended) = (None, promised < SMALL_GAIN);
                }
                // A twin that cannot be simulated at the first point has none to step back to.
                Err(failure) if own.cost.is_infinite() => {
                    (own.failure, own.has_ended) = (Some(failure), true);
                }
                Ok(_) | Err(_) => {
                    own.share *= 0.5;
                    own.has_ended = own.share < LEAST_SHARE;
                }
            }
        }
        Ok(())
    }

    /// The point that a specimen tries next.
    fn next(&self, own: &Progress) -> Vec<f64> {
        let moved = own.z.iter().zip(&own.step).zip(&self.unknowns);
        moved.map(|((z, step), u)| (z + own.share * step).clamp(u.range.0, u.range.1)).collect()
    }
}

/// How far the fit of a specimen is.
#[derive(Clone)]
struct Progress {
    /// The best unknowns so far, and F there.
    z: Vec<f64>,
    cost: f64,
    /// The step from there, and the share of it that is tried.
    step: Vec<f64>,
    share: f64,
    failure: Option<FitError>,
    has_ended: bool,
}

impl Progress {
    /// Before the first run.
    fn at(z: &[f64]) -> Self {
        let step = vec![0.0; z.len()];
        let (cost, share) = (f64::INFINITY, 1.0);
        Progress { z: z.to_vec(), cost, step, share, failure: None, has_ended: false }
    }

    fn end(self) -> Result<Vec<f64>, FitError> {
        self.failure.map_or(Ok(self.z), Err)
    }
}
