//! Fits many specimens that flew the same calibration flight, each to its own record.
//!
//! All fits start at the nominal twin, so J and A = JᵀJ + Q are computed once, around it, and kept. Each turn is a
//! single run per specimen with its own parameters, in lanes. The products Jᵀr are accumulated sample by sample, and no
//! sample is stored. After three turns, specimens agree with individual fits to a fraction of a standard error (test).
//!
//! [`Fleet::judge`] continues until steps are small, and judges what the last step leaves, to first order, as an
//! individual fit does. A specimen with a fault in its calibration flight has a finding. Suspects are compared by
//! (FF1), with their changes of the nominal twin.

use super::finding::{FitFinding, of_what_is_left};
use super::linear::{Symmetric, dot};
use super::record::FitRecord;
use super::response::{DerivativeScheme, Linear};
use super::suspects::{INTENSITY, SCORE_LIMIT, Suspect};
use super::unknown::Unknown;
use super::{Fit, FitError};
use crate::ensemble::Sink;
use servotwin_model::program::FaultAt;
use std::sync::atomic::Ordering;

/// Number of turns for each specimen.
const TURNS: usize = 3;
/// Most turns where specimens are judged, ...
const MOST_TURNS: usize = 10;
/// ... until a step would lower F by less than this: no unknown moves by more than half of its standard error.
const SMALL_GAIN: f64 = 0.1;

/// The calibration flight and its information about the unknowns.
pub struct Fleet<'p, 's> {
    problem: &'p Fit<'s>,
    record: &'p FitRecord,
    linear: Linear,
    curvature: Symmetric,
    deviations: Vec<f64>,
    shown: Vec<Shown>,
}

/// The effect of a suspect on the residuals.
struct Shown {
    fault: (usize, usize),
    /// The change d of (FF1).
    change: Vec<f64>,
    /// dᵀd; the next field is s of (FF1).
    square: f64,
    rest: f64,
}

/// A fitted specimen.
#[derive(Clone, Debug, PartialEq)]
pub struct Specimen {
    /// The unknowns, in standard deviations of their tolerances.
    pub z: Vec<f64>,
    /// The parameters in the form of a variant: (component, parameter, value).
    pub overrides: Vec<(usize, usize, f64)>,
    /// For each sensor, the mean square of the residuals before the last step; 1 means only noise is left.
    pub mean_squares: Vec<f64>,
    /// How much the last step reduced F.
    pub last_gain: f64,
    /// How far a parameter would move out of its tolerance, in standard errors.
    pub outside: f64,
}

/// A fitted specimen and the findings of its calibration flight.
#[derive(Clone, Debug, PartialEq)]
pub struct Judged {
    /// The fitted specimen.
    pub specimen: Specimen,
    /// Deviations that no tolerance explains.
    pub findings: Vec<FitFinding>,
}

impl Judged {
    /// Whether the twin may take the parameters.
    pub fn is_update(&self) -> bool {
        self.findings.is_empty()
    }
}

impl<'p, 's> Fleet<'p, 's> {
    /// Prepares a fleet whose calibration flight is the first record of a problem; the measured values are not used.
    ///
    /// # Errors
    /// The nominal twin cannot be simulated.
    pub fn new(problem: &'p Fit<'s>) -> Result<Self, FitError> {
        let record = problem.records.first().ok_or(FitError::NoRecord)?;
        if problem.unknowns.is_empty() {
            return Err(FitError::NoUnknown);
        }
        let linear =
            problem.linear(&vec![0.0; problem.unknowns.len()], DerivativeScheme::Central)?;
        let curvature = linear.information.plus_diagonal(&problem.priors());
        let deviations = problem.deviations(record);
        let mut fleet = Self { problem, record, linear, curvature, deviations, shown: vec![] };
        fleet.shown = fleet.shown()?;
        Ok(fleet)
    }

    /// The effects of the problem's suspects; those whose twin cannot be simulated are left out.
    fn shown(&self) -> Result<Vec<Shown>, FitError> {
        let Some(covariance) = self.covariance() else { return Ok(vec![]) };
        let (suspects, nominal) = (&self.problem.suspects, &self.linear.z);
        let variant = |job: usize| {
            let (component, fault) = suspects[job];
            let mut variant = self.problem.variant(nominal, &self.record.inputs);
            variant.faults.push(FaultAt { component, fault, intensity: INTENSITY });
            variant
        };
        let found = self.problem.run(self.record, suspects.len(), variant)?;
        let shown = |(&fault, found): (&(usize, usize), Result<Vec<f64>, FitError>)| {
            let pairs = self.linear.residuals.iter().zip(found.ok()?);
            let change: Vec<f64> =
                pairs.map(|(before, after)| (before - after) / INTENSITY).collect();
            let along = self.linear.pull(&change);
            let square = dot(&change, &change);
            let rest = square - dot(&along, &covariance.times(&along));
            Some(Shown { fault, change, square, rest })
        };
        Ok(suspects.iter().zip(found).filter_map(shown).collect())
    }

    /// The covariance of the unknowns, common to all specimens; `None` if an unknown is not determined.
    pub fn covariance(&self) -> Option<Symmetric> {
        self.curvature.inverse()
    }

    /// Fits specimens to their sensor values, which are ordered by sample as in a [`FitRecord`]. A specimen whose twin
    /// cannot be simulated has an error.
    ///
    /// # Errors
    /// The run was stopped.
    pub fn fit(&self, measured: &[Vec<f64>]) -> Result<Vec<Result<Specimen, FitError>>, FitError> {
        let found = self.turns(measured, TURNS, false)?;
        Ok(found.into_iter().map(|one| one.map(|one| one.specimen)).collect())
    }

    /// Fits specimens until steps are small, and reports what no tolerance explains.
    ///
    /// # Errors
    /// See [`Fleet::fit`].
    pub fn judge(&self, measured: &[Vec<f64>]) -> Result<Vec<Result<Judged, FitError>>, FitError> {
        self.turns(measured, MOST_TURNS, true)
    }

    fn turns(
        &self,
        measured: &[Vec<f64>],
        most: usize,
        is_judged: bool,
    ) -> Result<Vec<Result<Judged, FitError>>, FitError> {
        let specimen = Specimen {
            z: vec![0.0; self.problem.unknowns.len()],
            overrides: Vec::new(),
            mean_squares: Vec::new(),
            last_gain: f64::INFINITY,
            outside: 0.0,
        };
        let start = Judged { specimen, findings: Vec::new() };
        let mut all: Vec<Result<Judged, FitError>> = vec![Ok(start); measured.len()];
        let covariance = self.covariance().ok_or(FitError::Undetermined)?;
        let size = self.problem.unknowns.len();
        let errors: Vec<f64> = (0..size).map(|k| covariance.at(k, k).sqrt()).collect();
        for turn in 1..=most {
            let goes_on = |one: &Judged| turn <= TURNS || one.specimen.last_gain > SMALL_GAIN;
            let going: Vec<usize> =
                (0..all.len()).filter(|&k| all[k].as_ref().is_ok_and(goes_on)).collect();
            self.turn(measured, &mut all, &going, &errors, is_judged && turn >= TURNS)?;
        }
        for Judged { specimen, findings } in all.iter_mut().flatten() {
            specimen.overrides = self.problem.variant(&specimen.z, &[]).overrides;
            let has_ended = specimen.last_gain <= SMALL_GAIN;
            findings.extend((is_judged && !has_ended).then_some(FitFinding::NotConverged));
        }
        Ok(all)
    }

    fn turn(
        &self,
        measured: &[Vec<f64>],
        all: &mut [Result<Judged, FitError>],
        going: &[usize],
        errors: &[f64],
        is_judged: bool,
    ) -> Result<(), FitError> {
        let before: Vec<Vec<f64>> = going
            .iter()
            .map(|&k| all[k].as_ref().map_or(vec![], |one| one.specimen.z.clone()))
            .collect();
        let mut ended = Vec::with_capacity(going.len());
        self.problem.ensemble(self.record).run(
            going.len(),
            |job| self.problem.variant(&before[job], &self.record.inputs),
            |job| Along::new(self, &measured[going[job]], is_judged),
            |job, along, outcome| {
                // Residuals need much memory: they are evaluated before those of the next specimen arrive.
                let stepped = match outcome {
                    Ok(_) => self.stepped(&before[job], along, errors),
                    Err(failure) => Err(FitError::run(self.problem.system, failure)),
                };
                ended.push((going[job], stepped));
                (self.problem.progress)();
            },
        );
        if self.problem.cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed)) {
            return Err(FitError::Cancelled);
        }
        for (place, stepped) in ended {
            all[place] = stepped;
        }
        Ok(())
    }

    fn stepped(&self, z: &[f64], along: Along, errors: &[f64]) -> Result<Judged, FitError> {
        let (step, last_gain) = self.problem.step(&self.curvature, z, &along.pull)?;
        let inside = |((z, step), unknown): ((&f64, &f64), &Unknown)| {
            (z + step).clamp(unknown.range.0, unknown.range.1)
        };
        let next: Vec<f64> = z.iter().zip(&step).zip(&self.problem.unknowns).map(inside).collect();
        let moved = self.curvature.times(&step);
        let outwards = |k: usize| {
            let unknown = &self.problem.unknowns[k];
            let slope = along.pull[k] - unknown.prior * z[k] - moved[k];
            let by = if next[k] >= unknown.range.1 { slope } else { -slope };
            let at_bound = next[k] >= unknown.range.1 || next[k] <= unknown.range.0;
            if at_bound { by * errors[k] } else { 0.0 }
        };
        let by: Vec<f64> = (0..next.len()).map(outwards).collect();
        let outside = by.iter().copied().fold(0.0, f64::max);
        let mean_squares = along.squares.iter().map(|sum| sum / along.samples as f64).collect();
        let mut findings = Vec::new();
        if let Some(residuals) = along.residuals {
            findings = self.findings(&step, residuals);
            let leaving = by.into_iter().enumerate().filter(|(_, by)| *by > SCORE_LIMIT);
            findings
                .extend(leaving.map(|(unknown, by)| FitFinding::LeavesTolerance { unknown, by }));
        }
        let specimen = Specimen { z: next, overrides: vec![], mean_squares, last_gain, outside };
        Ok(Judged { specimen, findings })
    }

    /// The findings in the residuals after the last step.
    fn findings(&self, step: &[f64], mut residuals: Vec<f64>) -> Vec<FitFinding> {
        for (column, step) in self.linear.columns.iter().zip(step) {
            residuals.iter_mut().zip(column).for_each(|(left, column)| *left -= step * column);
        }
        let suspect = |shown: &Shown| {
            let with = dot(&shown.change, &residuals);
            let name = self.problem.fault_name(shown.fault);
            Suspect::of(name, with, shown.square, shown.rest)
        };
        let likeliest = self.shown.iter().map(suspect).max_by(|a, b| a.score.total_cmp(&b.score));
        let looks = likeliest.filter(Suspect::is_finding).map(FitFinding::Looks);
        let left = self.problem.left_of(0, self.record, &residuals);
        looks.into_iter().chain(of_what_is_left(&left)).collect()
    }
}

/// Accumulates Jᵀr while samples arrive.
struct Along<'f> {
    columns: &'f [Vec<f64>],
    deviations: &'f [f64],
    measured: &'f [f64],
    first: usize,
    place: usize,
    samples: usize,
    pull: Vec<f64>,
    squares: Vec<f64>,
    /// Stored only where specimens are judged.
    residuals: Option<Vec<f64>>,
}

impl<'f> Along<'f> {
    fn new(fleet: &'f Fleet, measured: &'f [f64], is_judged: bool) -> Self {
        Self {
            residuals: is_judged.then(|| Vec::with_capacity(fleet.linear.residuals.len())),
            columns: &fleet.linear.columns,
            deviations: &fleet.deviations,
            measured,
            first: fleet.problem.first_sample(fleet.record),
            place: 0,
            samples: 0,
            pull: vec![0.0; fleet.linear.columns.len()],
            squares: vec![0.0; fleet.deviations.len()],
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
            self.squares[sensor] += left * left;
            if let Some(residuals) = &mut self.residuals {
                residuals.push(left);
            }
            for (pull, column) in self.pull.iter_mut().zip(self.columns) {
                *pull += column[self.place] * left;
            }
            self.place += 1;
        }
        self.samples += 1;
    }
}
