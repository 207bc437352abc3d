//! Many specimens that flew the same calibration flight, each fitted to its own record.
//!
//! All begin at the nominal twin, so J and A = JᵀJ + Q are found once, around it, and kept. Every turn
//! then is a single run for each specimen, with its own parameters, in lanes: the products Jᵀr are summed
//! up while samples come, and no sample is kept. After three turns specimens are where a fit of their own
//! would have brought them, but for a part of a standard error (test).
//!
//! What the last turn leaves is judged as that of a fit is, and so a specimen that had a fault in its calibration
//! flight has a finding; suspects are compared by (FF1) with their changes of the nominal twin.

use super::finding::{Finding, of_what_is_left};
use super::linear::{Symmetric, dot};
use super::record::Record;
use super::response::{Difference, Linear};
use super::suspects::{INTENSITY, SCORE_LIMIT, Suspect};
use super::unknown::Unknown;
use super::{FitError, Problem};
use crate::ensemble::Sink;
use servotwin_model::program::FaultAt;
use std::sync::atomic::Ordering;

/// Turns for each specimen.
const TURNS: usize = 3;
/// A last step that still lowers F by more has not come to an end.
const MOST_LAST_GAIN: f64 = 1.0;

/// The calibration flight, and what it tells of the unknowns.
pub struct Fleet<'p, 's> {
    problem: &'p Problem<'s>,
    record: &'p Record,
    linear: Linear,
    curvature: Symmetric,
    deviations: Vec<f64>,
    shown: Vec<Shown>,
}

/// What a suspect shows.
struct Shown {
    fault: (usize, usize),
    /// d of (FF1).
    change: Vec<f64>,
    /// dᵀd, and s.
    square: f64,
    rest: f64,
}

/// One specimen.
#[derive(Clone, Debug, PartialEq)]
pub struct Specimen {
    /// The unknowns, in standard deviations of their tolerances.
    pub z: Vec<f64>,
    /// The parameters, as a variant takes them: (component, parameter, value).
    pub overrides: Vec<(usize, usize, f64)>,
    /// For each sensor the mean square of the residuals before the last step: 1 where nothing but noise
    /// is left.
    pub mean_squares: Vec<f64>,
    /// How much the last step still lowered F.
    pub last_gain: f64,
    /// How far, in standard errors, a parameter would like to leave its tolerance.
    pub outside: f64,
    /// What no tolerance explains.
    pub findings: Vec<Finding>,
}

impl Specimen {
    /// Whether its twin may take the parameters.
    pub fn is_update(&self) -> bool {
        self.findings.is_empty()
    }
}

impl<'p, 's> Fleet<'p, 's> {
    /// A fleet whose calibration flight is the first record of a problem; what it measured is not
    /// used.
    ///
    /// # Errors
    /// The nominal twin cannot be simulated.
    pub fn new(problem: &'p Problem<'s>) -> Result<Self, FitError> {
        let record = problem.records.first().ok_or(FitError::NoRecord)?;
        if problem.unknowns.is_empty() {
            return Err(FitError::NoUnknown);
        }
        let linear = problem.linear(&vec![0.0; problem.unknowns.len()], Difference::Central)?;
        let curvature = linear.information.plus_diagonal(&problem.priors());
        let deviations = problem.deviations(record);
        let mut fleet = Self { problem, record, linear, curvature, deviations, shown: vec![] };
        fleet.shown = fleet.shown()?;
        Ok(fleet)
    }

    /// What the problem's suspects show; those with which the twin cannot be simulated are left out.
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

    /// The covariance of the unknowns, the same for all; `None` where one is not determined.
    pub fn covariance(&self) -> Option<Symmetric> {
        self.curvature.inverse()
    }

    /// Fits specimens: what the sensors of each showed, sample after sample, as in a [`Record`]. A
    /// specimen whose twin cannot be simulated has an error.
    ///
    /// # Errors
    /// It was stopped.
    pub fn fit(&self, measured: &[Vec<f64>]) -> Result<Vec<Result<Specimen, FitError>>, FitError> {
        let unknowns = &self.problem.unknowns;
        let start = Specimen {
            z: vec![0.0; unknowns.len()],
            overrides: Vec::new(),
            mean_squares: Vec::new(),
            last_gain: 0.0,
            outside: 0.0,
            findings: Vec::new(),
        };
        let mut all: Vec<Result<Specimen, FitError>> = vec![Ok(start); measured.len()];
        let errors: Vec<f64> = match self.covariance() {
            Some(covariance) => (0..unknowns.len()).map(|k| covariance.at(k, k).sqrt()).collect(),
            None => return Err(FitError::Undetermined),
        };
        for turn in 1..=TURNS {
            self.turn(measured, &mut all, &errors, turn == TURNS)?;
        }
        for specimen in all.iter_mut().flatten() {
            specimen.overrides = self.problem.variant(&specimen.z, &[]).overrides;
        }
        Ok(all)
    }

    fn turn(
        &self,
        measured: &[Vec<f64>],
        all: &mut [Result<Specimen, FitError>],
        errors: &[f64],
        is_last: bool,
    ) -> Result<(), FitError> {
        let before: Vec<Vec<f64>> =
            all.iter().map(|one| one.as_ref().map_or(Vec::new(), |one| one.z.clone())).collect();
        let going: Vec<usize> = (0..all.len()).filter(|&k| all[k].is_ok()).collect();
        let mut ended = Vec::with_capacity(going.len());
        self.problem.ensemble(self.record).run(
            going.len(),
            |job| self.problem.variant(&before[going[job]], &self.record.inputs),
            |job| Along::new(self, &measured[going[job]], is_last),
            |job, mut along, outcome| {
                // Residuals are many: they are judged before the next specimen's come.
                let residuals = along.residuals.take().filter(|_| outcome.is_ok());
                let findings = residuals.map_or(vec![], |residuals| self.findings(&residuals));
                ended.push((going[job], along, findings, outcome));
                (self.problem.progress)();
            },
        );
        if self.problem.cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed)) {
            return Err(FitError::Cancelled);
        }
        for (place, along, findings, outcome) in ended {
            all[place] = match outcome {
                Ok(_) => self.stepped(&before[place], &along, findings, errors),
                Err(failure) => Err(FitError::run(self.problem.system, failure)),
            };
        }
        Ok(())
    }

    /// What residuals show beside parameters that leave their tolerances.
    fn findings(&self, residuals: &[f64]) -> Vec<Finding> {
        let suspect = |shown: &Shown| {
            let with = dot(&shown.change, residuals);
            let name = self.problem.fault_name(shown.fault);
            Suspect::of(name, with, shown.square, shown.rest)
        };
        let likeliest = self.shown.iter().map(suspect).max_by(|a, b| a.score.total_cmp(&b.score));
        let looks = likeliest.filter(Suspect::is_finding).map(Finding::Looks);
        let left = self.problem.left_of(0, self.record, residuals);
        looks.into_iter().chain(of_what_is_left(&left)).collect()
    }

    fn stepped(
        &self,
        z: &[f64],
        along: &Along,
        mut findings: Vec<Finding>,
        errors: &[f64],
    ) -> Result<Specimen, FitError> {
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
        let outside = (0..next.len()).map(outwards).fold(0.0, f64::max);
        if along.is_last {
            let leaving = (0..next.len()).filter(|&k| outwards(k) > SCORE_LIMIT);
            findings.extend(
                leaving.map(|unknown| Finding::LeavesTolerance { unknown, by: outwards(unknown) }),
            );
            findings.extend((last_gain > MOST_LAST_GAIN).then_some(Finding::NotConverged));
        }
        let mean_squares = along.squares.iter().map(|sum| sum / along.samples as f64).collect();
        Ok(Specimen { z: next, overrides: vec![], mean_squares, last_gain, outside, findings })
    }
}

/// Sums Jᵀr up while samples come.
struct Along<'f> {
    columns: &'f [Vec<f64>],
    deviations: &'f [f64],
    measured: &'f [f64],
    first: usize,
    place: usize,
    samples: usize,
    pull: Vec<f64>,
    squares: Vec<f64>,
    is_last: bool,
    /// Kept in the last turn.
    residuals: Option<Vec<f64>>,
}

impl<'f> Along<'f> {
    fn new(fleet: &'f Fleet, measured: &'f [f64], is_last: bool) -> Self {
        Self {
            is_last,
            residuals: is_last.then(|| Vec::with_capacity(fleet.linear.residuals.len())),
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
