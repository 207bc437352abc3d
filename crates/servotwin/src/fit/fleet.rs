//! Fits many specimens that flew the same calibration flight, each to its own record.
//!
//! All fits start in the middle of the unknowns' ranges, so J and A = JᵀJ + Q are computed once, around it, and kept. Each
//! turn is a single run per specimen with its own parameters, in lanes. A step that does not lower F is halved: draws are
//! so large that J may be wrong by a factor. After three turns, specimens that differ by tolerances agree with individual
//! fits to a fraction of a standard error (test).

use super::response::{AT_ONCE, DerivativeScheme, Linear};
use super::solve::SMALL_GAIN;
use super::{Fit, FitError};

/// The most turns for each specimen.
const MOST_TURNS: usize = 24;
/// No smaller share of a step is tried: J then no longer tells where F falls.
const LEAST_SHARE: f64 = 0.1;

/// A fitted specimen.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Specimen {
    /// The unknowns, in standard deviations of their tolerances.
    pub(crate) z: Vec<f64>,
    /// The parameters in the form of a variant: (component, parameter, value).
    pub(crate) overrides: Vec<(usize, usize, f64)>,
}

/// The fitted specimens, and the standard error of each unknown, which all have in common.
pub(crate) type Fleet = (Vec<Specimen>, Vec<f64>);

impl Fit<'_> {
    /// Fits specimens to their sensor values, which are ordered by sample as in a [`FitRecord`](super::FitRecord). The
    /// calibration flight is the first record; its measured values are not used.
    ///
    /// # Errors
    /// The twin in the middle of the ranges cannot be simulated, an unknown is not determined, or the run was stopped.
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
        let record = &self.records[0];
        let twins = self.twins(record, (1, 1.0), |_| self.variant(&middle, &record.inputs))?;
        let twin = twins.into_iter().next().expect("one twin")?;
        let mut all = vec![];
        for measured in measured.chunks(AT_ONCE) {
            let first = |own: &Vec<f64>| self.progress(&linear, middle.clone(), own, &twin);
            let mut fitted = measured.iter().map(first).collect::<Result<Vec<Progress>, _>>()?;
            for _ in 1..MOST_TURNS {
                self.turn(&linear, measured, &mut fitted)?;
            }
            all.extend(fitted.into_iter().map(|own| own.z));
        }
        let specimen = |z: Vec<f64>| {
            let overrides = self.variant(&z, &[]).overrides;
            Specimen { z, overrides }
        };
        Ok((all.into_iter().map(specimen).collect(), errors))
    }

    /// Tries the next point of every specimen that is not at its minimum.
    fn turn(
        &self,
        linear: &Linear,
        measured: &[Vec<f64>],
        all: &mut [Progress],
    ) -> Result<(), FitError> {
        let record = &self.records[0];
        let open: Vec<usize> = (0..all.len()).filter(|&place| all[place].is_open()).collect();
        let next = |own: &Progress| self.point_behind(&own.z, &own.step, own.share);
        let points: Vec<Vec<f64>> = open.iter().map(|&place| next(&all[place])).collect();
        let variant = |job: usize| self.variant(&points[job], &record.inputs);
        let twins = self.twins(record, (points.len(), 1.0), variant)?;
        for ((place, z), twin) in open.into_iter().zip(points).zip(twins) {
            let own = &mut all[place];
            let tried = twin.and_then(|twin| self.progress(linear, z, &measured[place], &twin));
            match tried {
                Ok(tried) if tried.cost < own.cost => *own = tried,
                _ => own.share *= 0.5,
            }
        }
        Ok(())
    }

    /// What a specimen's sensors say at a point, beside its twin there.
    fn progress(
        &self,
        linear: &Linear,
        z: Vec<f64>,
        measured: &[f64],
        twin: &[f64],
    ) -> Result<Progress, FitError> {
        let residuals = self.residuals_beside(&self.records[0], measured, twin);
        let (step, promised) = self.step(linear, &z, &linear.pull(&residuals), None)?;
        let share = if promised < SMALL_GAIN { 0.0 } else { 1.0 };
        Ok(Progress { cost: self.cost(&z, &residuals), z, step, share })
    }
}

/// How far the fit of a specimen is.
struct Progress {
    /// The best unknowns so far, and F there.
    z: Vec<f64>,
    cost: f64,
    /// The step from there, and the share of it that is tried next.
    step: Vec<f64>,
    share: f64,
}

impl Progress {
    fn is_open(&self) -> bool {
        self.share >= LEAST_SHARE
    }
}
