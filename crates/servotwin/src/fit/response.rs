//! Simulates the sensors of a twin for given unknowns, and their derivatives.
//!
//! (FR1)  r = (measured − twin)/σ, σ the deviation that a sample of the sensor carries
//!
//! (FR2)  J_k = (r(z) − r(z + h e_k))/h, in the end (r(z − h e_k) − r(z + h e_k))/2h
//!
//! Each lane moves one unknown, so that all differences take little longer than one run. A step ends on every sample,
//! so all lanes make nearly the same steps. The solver's errors are then nearly equal and cancel in the difference.

use super::linear::{Symmetric, dot};
use super::record::FitRecord;
use super::unknown::Unknown;
use super::{Fit, FitError};
use crate::ensemble::{Ensemble, Later, Sink, Variant};
use servotwin_model::signal::Piecewise;
use std::sync::atomic::Ordering;

/// How derivatives are approximated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DerivativeScheme {
    /// One-sided difference.
    Forward,
    /// Two-sided difference.
    Central,
}

/// Residuals (FR1), ordered by record, sample and sensor.
pub(crate) type Residuals = Vec<f64>;
/// The residuals of a variant, or why it could not be simulated.
pub(crate) type RunResiduals = Result<Residuals, FitError>;

/// The residuals and their derivatives at a point.
#[derive(Clone, Debug)]
pub(crate) struct Linear {
    /// The unknowns at the point.
    pub z: Vec<f64>,
    /// The residuals at `z`.
    pub residuals: Residuals,
    /// For each unknown, the derivative of the twin's sensors, in their deviations (FR2).
    pub columns: Vec<Vec<f64>>,
    /// JᵀJ: the information of the records about the unknowns.
    pub information: Symmetric,
}

impl Linear {
    fn new(z: Vec<f64>, residuals: Residuals, columns: Vec<Vec<f64>>) -> Self {
        let information = Symmetric::new(columns.len(), |i, j| dot(&columns[i], &columns[j]));
        Self { z, residuals, columns, information }
    }

    /// Computes Jᵀ r.
    pub(crate) fn pull(&self, residuals: &[f64]) -> Vec<f64> {
        self.columns.iter().map(|column| dot(column, residuals)).collect()
    }
}

/// A residual (FR1); zero for a missing value.
pub(super) fn residual(measured: f64, twin: f64, deviation: f64) -> f64 {
    if measured.is_nan() { 0.0 } else { (measured - twin) / deviation }
}

/// Collects the residuals of a run.
struct Compare<'r> {
    measured: &'r [f64],
    deviations: &'r [f64],
    first: usize,
    residuals: Residuals,
}

impl Sink for Compare<'_> {
    fn sample(&mut self, index: usize, values: &[f64]) {
        if index < self.first || index * values.len() >= self.measured.len() {
            return;
        }
        let measured = &self.measured[index * values.len()..][..values.len()];
        let of = |((m, v), d): ((&f64, &f64), &f64)| residual(*m, *v, *d);
        self.residuals.extend(measured.iter().zip(values).zip(self.deviations).map(of));
    }
}

impl<'s> Fit<'s> {
    /// The ensemble that runs a record's variants.
    pub(super) fn ensemble(&self, record: &FitRecord) -> Ensemble<'s> {
        Ensemble {
            settings: self.solver,
            threads: self.threads,
            cancel: self.cancel,
            record: self.system.sensor_slots(&record.sensors),
            duration_s: record.duration_s(),
            sample_period_s: record.period_s,
            ..Ensemble::of(self.system)
        }
    }

    /// The unknowns of the nominal twin.
    pub(super) fn nominal(&self) -> Vec<f64> {
        vec![0.0; self.unknowns.len()]
    }

    /// A variant with given unknowns.
    pub(crate) fn variant<'v>(&self, z: &[f64], inputs: &'v [Piecewise]) -> Variant<'v> {
        self.variant_from(z, inputs, self.onset_s)
    }

    /// A variant with given unknowns, whose faults begin at `onset_s`.
    pub(super) fn variant_from<'v>(
        &self,
        z: &[f64],
        inputs: &'v [Piecewise],
        onset_s: Option<f64>,
    ) -> Variant<'v> {
        let mut variant = Variant { inputs: inputs.iter().collect(), ..Variant::default() };
        for (unknown, &z) in self.unknowns.iter().zip(z) {
            unknown.apply(z, &mut variant.overrides, &mut variant.faults);
        }
        if let Some(time_s) = onset_s {
            let faults = std::mem::take(&mut variant.faults);
            variant.later.push(Later { time_s, faults, ..Later::default() });
        }
        variant
    }

    /// The residuals at several points; an error where the solver failed.
    pub(super) fn residuals(&self, points: &[Vec<f64>]) -> Result<Vec<RunResiduals>, FitError> {
        self.residuals_of(points.len(), |job, record| self.variant(&points[job], &record.inputs))
    }

    /// The residuals of several variants in all records.
    pub(super) fn residuals_of<'r>(
        &'r self,
        count: usize,
        variant: impl Fn(usize, &'r FitRecord) -> Variant<'r> + Sync,
    ) -> Result<Vec<RunResiduals>, FitError> {
        let mut all: Vec<RunResiduals> = vec![Ok(Vec::new()); count];
        for record in &self.records {
            append(&mut all, self.run(record, count, |job| variant(job, record))?);
        }
        Ok(all)
    }

    /// The residuals of several variants of one record.
    pub(super) fn run<'v>(
        &self,
        record: &FitRecord,
        count: usize,
        variant: impl Fn(usize) -> Variant<'v> + Sync,
    ) -> Result<Vec<RunResiduals>, FitError> {
        self.run_in(&self.ensemble(record), record, count, variant)
    }

    /// The same in another ensemble than the record's.
    pub(super) fn run_in<'v>(
        &self,
        ensemble: &Ensemble,
        record: &FitRecord,
        count: usize,
        variant: impl Fn(usize) -> Variant<'v> + Sync,
    ) -> Result<Vec<RunResiduals>, FitError> {
        self.run_against(ensemble, record, |_| &record.measured, count, variant)
    }

    /// The same for variants that have measured values of their own.
    pub(super) fn run_against<'v, 'm>(
        &self,
        ensemble: &Ensemble,
        record: &FitRecord,
        measured: impl Fn(usize) -> &'m [f64] + Sync,
        count: usize,
        variant: impl Fn(usize) -> Variant<'v> + Sync,
    ) -> Result<Vec<RunResiduals>, FitError> {
        let deviations = self.deviations(record);
        let first = self.first_sample(record);
        let mut found: Vec<Option<RunResiduals>> = vec![None; count];
        let sink = |job| Compare {
            measured: measured(job),
            deviations: &deviations,
            first,
            residuals: Vec::with_capacity(record.measured.len()),
        };
        ensemble.run(count, variant, sink, |job, compare, outcome| {
            found[job] = Some(match outcome {
                Ok(_) => Ok(compare.residuals),
                Err(failure) => Err(FitError::run(self.system, failure)),
            });
            (self.progress)();
        });
        if self.cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed)) {
            return Err(FitError::Cancelled);
        }
        Ok(found.into_iter().map(|one| one.expect("every variant ends")).collect())
    }

    /// The residuals and derivatives at a point.
    pub(super) fn linear(
        &self,
        z: &[f64],
        difference: DerivativeScheme,
    ) -> Result<Linear, FitError> {
        let mut points = vec![z.to_vec()];
        let mut moves = Vec::new();
        for (k, unknown) in self.unknowns.iter().enumerate() {
            let ends = ends(unknown, z[k], difference);
            for end in ends {
                let mut point = z.to_vec();
                point[k] = end;
                points.push(point);
            }
            moves.push(ends[1] - ends[0]);
        }
        let mut found = self.residuals(&points)?.into_iter();
        let base = found.next().expect("the point itself")?;
        let mut columns = Vec::new();
        for moved in moves {
            let mut end = || found.next().expect("two ends for each unknown");
            let (low, high) = (end()?, end()?);
            columns.push(low.iter().zip(&high).map(|(low, high)| (low - high) / moved).collect());
        }
        Ok(Linear::new(z.to_vec(), base, columns))
    }
}

/// Appends the residuals of another record; a failed simulation stays failed.
pub(super) fn append(all: &mut [RunResiduals], more: Vec<RunResiduals>) {
    for (all, own) in all.iter_mut().zip(more) {
        match (all.as_mut(), own) {
            (Ok(all), Ok(own)) => all.extend(own),
            (Ok(_), Err(error)) => *all = Err(error),
            (Err(_), _) => {}
        }
    }
}

/// The two ends of a difference, inside the range.
fn ends(unknown: &Unknown, z: f64, difference: DerivativeScheme) -> [f64; 2] {
    let (low, high) = unknown.range;
    let h = unknown.step;
    match difference {
        DerivativeScheme::Central => [(z - h).max(low), (z + h).min(high)],
        DerivativeScheme::Forward if z + h <= high => [z, z + h],
        DerivativeScheme::Forward => [z - h, z],
    }
}
