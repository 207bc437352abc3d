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
use crate::ensemble::{Ensemble, Later, Variant};
use crate::rest::Stopped;
use crate::system::imperfection::Imperfection;
use servotwin_model::signal::Piecewise;
use std::sync::atomic::Ordering;

/// Samples before this time are not compared: an actuator is rarely at rest when its record begins, s.
const WARM_UP_S: f64 = 1.0;
/// Number of runs whose residuals are kept in memory.
pub(super) const AT_ONCE: usize = 96;
/// Lower limit of a sensor's deviation, as a fraction of its scale: the solver's error.
const SOLVER_ERROR: f64 = 1e-4;

/// How derivatives are approximated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DerivativeScheme {
    /// One-sided difference.
    Forward,
    /// Two-sided difference.
    Central,
}

/// Residuals (FR1), ordered by record, sample and sensor.
pub(super) type Residuals = Vec<f64>;
/// The residuals of a variant, or why it could not be simulated.
pub(super) type RunResiduals = Result<Residuals, FitError>;

/// The residuals and their derivatives at a point.
#[derive(Clone, Debug)]
pub(super) struct Linear {
    /// The unknowns at the point.
    pub(crate) z: Vec<f64>,
    /// The residuals at `z`.
    pub(crate) residuals: Residuals,
    /// For each unknown, the derivative of the twin's sensors, in their deviations (FR2).
    pub(crate) columns: Vec<Vec<f64>>,
    /// JᵀJ + Q: what the records show of the unknowns, and what is known before.
    pub(crate) curvature: Symmetric,
}

impl Linear {
    /// Computes Jᵀ r.
    pub(super) fn pull(&self, residuals: &[f64]) -> Vec<f64> {
        self.columns.iter().map(|column| dot(column, residuals)).collect()
    }
}

impl FitRecord {
    /// The first sample that is compared.
    pub(super) fn first_sample(&self) -> usize {
        (WARM_UP_S / self.period_s).round() as usize
    }
}

impl Fit<'_> {
    /// The standard deviation of a sample of each sensor of a record.
    pub(super) fn deviations(&self, record: &FitRecord) -> Vec<f64> {
        let deviation = |&sensor: &usize| {
            let least = SOLVER_ERROR * self.system.sensors[sensor].scale;
            Imperfection::of(self.system, sensor).deviation().max(least)
        };
        record.sensors.iter().map(deviation).collect()
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
    fn variant_from<'v>(
        &self,
        z: &[f64],
        inputs: &'v [Piecewise],
        onset_s: Option<f64>,
    ) -> Variant<'v> {
        let mut variant = Variant { inputs: inputs.iter().collect(), ..Variant::default() };
        for (unknown, &z) in self.unknowns.iter().zip(z) {
            unknown.apply(z, &mut variant);
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

    /// The residuals at a point, with faults that begin at each of some moments, s.
    pub(super) fn residuals_from(
        &self,
        z: &[f64],
        onsets_s: &[f64],
    ) -> Result<Vec<RunResiduals>, FitError> {
        self.residuals_of(onsets_s.len(), |job, record| {
            self.variant_from(z, &record.inputs, Some(onsets_s[job]))
        })
    }

    /// The residuals of several variants in all records.
    pub(super) fn residuals_of<'r>(
        &'r self,
        count: usize,
        variant: impl Fn(usize, &'r FitRecord) -> Variant<'r> + Sync,
    ) -> Result<Vec<RunResiduals>, FitError> {
        let mut all: Vec<RunResiduals> = vec![Ok(Vec::new()); count];
        for record in &self.records {
            let own = self.residuals_in(record, (count, 1.0), |job| variant(job, record))?;
            all.iter_mut().zip(own).for_each(|(all, own)| append(all, own));
        }
        Ok(all)
    }

    /// The residuals of a number of variants in one record, while `stretch` times the recorded time passes.
    pub(super) fn residuals_in<'v>(
        &self,
        record: &FitRecord,
        (count, stretch): (usize, f64),
        variant: impl Fn(usize) -> Variant<'v> + Sync,
    ) -> Result<Vec<RunResiduals>, FitError> {
        let twins = self.twins(record, (count, stretch), variant)?.into_iter();
        let residuals = |twin: Vec<f64>| self.residuals_beside(record, &record.measured, &twin);
        Ok(twins.map(|twin| twin.map(residuals)).collect())
    }

    /// The residuals (FR1) of measured values in a record beside a twin; those of missing values are zero.
    pub(super) fn residuals_beside(
        &self,
        record: &FitRecord,
        measured: &[f64],
        twin: &[f64],
    ) -> Residuals {
        let residual = |((measured, twin), deviation): ((&f64, &f64), &f64)| {
            if measured.is_nan() { 0.0 } else { (measured - twin) / deviation }
        };
        let pairs = measured.iter().zip(twin).skip(record.first_sample() * record.sensors.len());
        pairs.zip(self.deviations(record).iter().cycle()).map(residual).collect()
    }

    /// The sensors of a number of variants at the samples of a record, ordered as in the record.
    pub(super) fn twins<'v>(
        &self,
        record: &FitRecord,
        (count, stretch): (usize, f64),
        variant: impl Fn(usize) -> Variant<'v> + Sync,
    ) -> Result<Vec<Result<Vec<f64>, FitError>>, FitError> {
        let ensemble = Ensemble {
            settings: self.solver,
            threads: self.threads,
            cancel: self.cancel,
            record: self.system.sensor_slots(&record.sensors),
            duration_s: record.duration_s() * stretch,
            sample_period_s: record.period_s * stretch,
            ..Ensemble::of(self.system)
        };
        let mut found = vec![None; count];
        let sink = |_| Vec::with_capacity(record.measured.len());
        ensemble.run(count, variant, sink, |job, twin, outcome| {
            let stopped = |failure| FitError::Run(Stopped::new(self.system, failure));
            found[job] = Some(outcome.map(|_| twin).map_err(stopped));
            (self.progress)();
        });
        if self.cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed)) {
            return Err(FitError::Cancelled);
        }
        Ok(found.into_iter().map(|run| run.expect("every variant ends")).collect())
    }

    /// The residuals and derivatives at a point.
    pub(super) fn linear(
        &self,
        z: &[f64],
        difference: DerivativeScheme,
    ) -> Result<Linear, FitError> {
        let ends: Vec<[f64; 2]> =
            self.unknowns.iter().zip(z).map(|(u, &z)| ends(u, z, difference)).collect();
        let moved = |(k, ends): (usize, &[f64; 2])| {
            ends.map(|end| {
                let mut point = z.to_vec();
                point[k] = end;
                point
            })
        };
        let moved = ends.iter().enumerate().flat_map(moved);
        let points: Vec<Vec<f64>> = [z.to_vec()].into_iter().chain(moved).collect();
        let mut found = self.residuals(&points)?.into_iter();
        let residuals = found.next().expect("the point itself")?;
        let mut columns: Vec<Vec<f64>> = Vec::new();
        for [low, high] in ends {
            let mut end = || found.next().expect("two ends for each unknown");
            let pairs = end()?.into_iter().zip(end()?);
            columns
                .push(pairs.map(|(at_low, at_high)| (at_low - at_high) / (high - low)).collect());
        }
        let information = Symmetric::new(columns.len(), |i, j| dot(&columns[i], &columns[j]));
        let curvature = information.plus_diagonal(&self.priors());
        Ok(Linear { z: z.to_vec(), residuals, columns, curvature })
    }
}

/// Appends the residuals of another record; a failed simulation stays failed.
pub(super) fn append(all: &mut RunResiduals, own: RunResiduals) {
    match (all.as_mut(), own) {
        (Ok(all), Ok(own)) => all.extend(own),
        (Ok(_), Err(error)) => *all = Err(error),
        (Err(_), _) => {}
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
