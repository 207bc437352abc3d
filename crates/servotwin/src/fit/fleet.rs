//! Fits many specimens that flew the same calibration flight, each to its own record.
//!
//! All fits start at the nominal twin, so J and A = JᵀJ + Q are computed once, around it, and kept. Each turn is a
//! single run per specimen with its own parameters, in lanes. The products Jᵀr are accumulated sample by sample, and no
//! sample is stored. After three turns, specimens that differ by tolerances agree with individual fits to a fraction of a
//! standard error (test); draws as large as those of flights take some more.

use super::linear::Symmetric;
use super::record::FitRecord;
use super::response::{DerivativeScheme, Linear};
use super::unknown::Unknown;
use super::{Fit, FitError};
use crate::ensemble::Sink;
use std::sync::atomic::Ordering;

/// Number of turns for each specimen.
const TURNS: usize = 6;

/// The calibration flight and its information about the unknowns.
pub(crate) struct Fleet<'p, 's> {
    problem: &'p Fit<'s>,
    record: &'p FitRecord,
    linear: Linear,
    curvature: Symmetric,
    deviations: Vec<f64>,
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
        let record = problem.records.first().ok_or(FitError::NoRecord)?;
        if problem.unknowns.is_empty() {
            return Err(FitError::NoUnknown);
        }
        let linear =
            problem.linear(&vec![0.0; problem.unknowns.len()], DerivativeScheme::Central)?;
        let curvature = linear.information.plus_diagonal(&problem.priors());
        let deviations = problem.deviations(record);
        Ok(Self { problem, record, linear, curvature, deviations })
    }

    /// The covariance of the unknowns, common to all specimens; `None` if an unknown is not determined.
    pub(crate) fn covariance(&self) -> Option<Symmetric> {
        self.curvature.inverse()
    }

    /// Fits specimens to their sensor values, which are ordered by sample as in a [`FitRecord`]. A specimen whose twin
    /// cannot be simulated has an error.
    ///
    /// # Errors
    /// The run was stopped.
    pub(crate) fn fit(
        &self,
        measured: &[Vec<f64>],
    ) -> Result<Vec<Result<Specimen, FitError>>, FitError> {
        let start = vec![0.0; self.problem.unknowns.len()];
        let mut all = vec![Ok(start); measured.len()];
        for _ in 0..TURNS {
            self.turn(measured, &mut all)?;
        }
        let specimen = |z: Vec<f64>| {
            let overrides = self.problem.variant(&z, &[]).overrides;
            Specimen { z, overrides }
        };
        Ok(all.into_iter().map(|z| z.map(specimen)).collect())
    }

    /// One step of all unknowns.
    fn turn(
        &self,
        measured: &[Vec<f64>],
        all: &mut [Result<Vec<f64>, FitError>],
    ) -> Result<(), FitError> {
        let before: Vec<(usize, Vec<f64>)> =
            all.iter().enumerate().filter_map(|(k, z)| Some((k, z.clone().ok()?))).collect();
        self.problem.ensemble(self.record).run(
            before.len(),
            |job| self.problem.variant(&before[job].1, &self.record.inputs),
            |job| Along::new(self, &measured[before[job].0]),
            |job, along, outcome| {
                let (place, z) = &before[job];
                all[*place] = match outcome {
                    Ok(_) => self.stepped(z, &along.pull),
                    Err(failure) => Err(FitError::run(self.problem.system, failure)),
                };
                (self.problem.progress)();
            },
        );
        let is_cancelled = self.problem.cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed));
        if is_cancelled { Err(FitError::Cancelled) } else { Ok(()) }
    }

    fn stepped(&self, z: &[f64], pull: &[f64]) -> Result<Vec<f64>, FitError> {
        let (step, _) = self.problem.step(&self.curvature, z, pull)?;
        let inside = |((z, step), unknown): ((&f64, &f64), &Unknown)| {
            (z + step).clamp(unknown.range.0, unknown.range.1)
        };
        Ok(z.iter().zip(&step).zip(&self.problem.unknowns).map(inside).collect())
    }
}

/// Accumulates Jᵀr while samples arrive.
struct Along<'f> {
    columns: &'f [Vec<f64>],
    deviations: &'f [f64],
    measured: &'f [f64],
    first: usize,
    place: usize,
    pull: Vec<f64>,
}

impl<'f> Along<'f> {
    fn new(fleet: &'f Fleet, measured: &'f [f64]) -> Self {
        Self {
            columns: &fleet.linear.columns,
            deviations: &fleet.deviations,
            measured,
            first: fleet.problem.first_sample(fleet.record),
            place: 0,
            pull: vec![0.0; fleet.linear.columns.len()],
        }
    }
}

impl Sink for Along<'_> {
    fn sample(&mut self, index: usize, values: &[f64]) {
        if index < self.first {
            return;
        }
        let measured = &self.measured[index * values.len()..][..values.len()];
        for (sensor, (measured, value)) in measured.iter().zip(values).enumerate() {
            let left = (measured - value) / self.deviations[sensor];
            for (pull, column) in self.pull.iter_mut().zip(self.columns) {
                *pull += column[self.place] * left;
            }
            self.place += 1;
        }
    }
}
