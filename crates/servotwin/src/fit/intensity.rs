//! Estimates the intensity of a fault as one more unknown beside the tolerances, with an interval, and compares several
//! candidates by their likelihood.
//!
//! (FN1)  ln p(record | fault) ≈ −F − ½ ln det A + const
//!
//! F and A belong to the fit with this fault: how well it explains the record, and how much it had to be tuned. The
//! candidates' probabilities sum to one; the case that none of them is right is not included.
//!
//! (FN2)  F(x) ≤ F + ½ χ²₁(95 %)
//!
//! (FN2) holds for all intensities x that explain the record equally well, with the other unknowns optimal for each x.
//! If residuals exceed the noise, ½ χ² is multiplied by their mean square. The interval follows from the standard
//! error, and is widened by (FN2): at the end of a sensor's range, all larger gains look the same.

use super::finding::SensorFit;
use super::linear::dot;
use super::onset::{FoundOnset, Moments};
use super::response::DerivativeScheme;
use super::solve::Minimum;
use super::suspects::{Cause, FINE, Guess};
use super::unknown::Unknown;
use super::{Fit, FitError};

/// 95 % of a normal distribution lie within this many deviations.
pub(super) const NORMAL_95: f64 = 1.96;
/// Half of the 95 % quantile of χ² with one degree of freedom.
pub(super) const HALF_CHI_SQUARE_95: f64 = 1.92;
/// Lower limit of an intensity's standard error: the solver's error.
const LEAST_ERROR: f64 = 1e-4;
/// Number of evenly spaced intensities, up to 1, at which (FN2) is evaluated.
const PROFILE: usize = 24;
/// A fit restarts where another intensity reduces F by more than this ...
const HOLLOW: f64 = 1.0;
/// ... at most this many times.
const MOST_ANEW: usize = 2;
/// Candidate start values of a fit; the likeliest becomes the first guess.
const FIRST_GUESSES: [f64; 8] = [0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9];

/// The estimate of a fault from a record.
#[derive(Clone, Debug)]
pub struct Diagnosed {
    /// The fault: (component, fault).
    pub(super) fault: (usize, usize),
    /// The fault's full name.
    pub name: String,
    /// The estimated intensity, 0 to 1.
    pub intensity: f64,
    /// Its standard error. If another intensity explains the record equally well, the error is as large as if that
    /// intensity were an end of the interval.
    pub(super) error: f64,
    /// The 95 % interval.
    pub interval: (f64, f64),
    /// Log-likelihood of the record (FN1).
    pub log_likelihood: f64,
    /// Its probability among the candidates.
    pub probability: f64,
    /// When it began, if within the record.
    pub onset: Option<FoundOnset>,
    /// F of the fit with this fault.
    pub(super) cost: f64,
    /// The residuals of this fit.
    pub(super) left: Vec<SensorFit>,
}

impl<'s> Fit<'s> {
    /// Estimates the intensity of every candidate, and when it began, if within the record; the likeliest comes first.
    /// Its intensity then applies from this moment on.
    ///
    /// # Errors
    /// See [`Fit::solve`]; or the twin cannot be simulated with a candidate.
    pub fn diagnose(&self, candidates: &[(usize, usize)]) -> Result<Vec<Diagnosed>, FitError> {
        let mut all = self.intensities(candidates)?;
        let linear = self.linear(&self.nominal(), DerivativeScheme::Forward)?;
        let Some(moments) = Moments::new(self, &linear) else { return Ok(all) };
        let causes: Vec<Cause> = candidates.iter().copied().map(Cause::Fault).collect();
        let [_, begun] = self.guesses(&linear, Some(&moments), &causes, &FINE)?;
        for one in &mut all {
            let is_worth =
                |guess: &&Guess| guess.cause == Cause::Fault(one.fault) && guess.is_worth(one.cost);
            let Some(guess) = begun.iter().find(is_worth) else { continue };
            let begun = self.begins(one.fault, guess, moments.reach_s(), one.cost)?;
            if begun.onset.is_some() {
                *one = begun;
            }
        }
        Ok(compared(all))
    }

    /// Estimates the intensity of every candidate, assumed present from the first sample on; the likeliest comes first.
    pub(super) fn intensities(
        &self,
        candidates: &[(usize, usize)],
    ) -> Result<Vec<Diagnosed>, FitError> {
        let of_candidate = |&fault: &(usize, usize)| {
            let own = self.with_fault(fault);
            let (minimum, alike) = own.constant()?;
            own.diagnosed(fault, &minimum, &alike, None)
        };
        Ok(compared(candidates.iter().map(of_candidate).collect::<Result<_, FitError>>()?))
    }

    /// The problem with the intensity of a fault as its last unknown, and without suspects.
    pub(super) fn with_fault(&self, (component, fault): (usize, usize)) -> Fit<'s> {
        let mut own = Fit { suspects: Vec::new(), ..self.clone() };
        own.unknowns.push(Unknown::fault(self.system, component, fault));
        own
    }
}

/// Adds the probability of each; the likeliest comes first.
fn compared(mut all: Vec<Diagnosed>) -> Vec<Diagnosed> {
    let most = all.iter().map(|one| one.log_likelihood).fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = all.iter().map(|one| (one.log_likelihood - most).exp()).sum();
    for one in &mut all {
        one.probability = (one.log_likelihood - most).exp() / sum;
    }
    all.sort_by(|a, b| b.log_likelihood.total_cmp(&a.log_likelihood));
    all
}

/// A fit whose last unknown is the intensity of a fault.
impl Fit<'_> {
    /// Evaluates a minimum.
    pub(super) fn diagnosed(
        &self,
        fault: (usize, usize),
        minimum: &Minimum,
        alike: &[f64],
        onset: Option<FoundOnset>,
    ) -> Result<Diagnosed, FitError> {
        let last = self.unknowns.len() - 1;
        let curvature = &minimum.linear.curvature;
        let volume: f64 = curvature.eigenvalues().iter().map(|value| value.max(1e-12).ln()).sum();
        let variance = curvature.inverse().ok_or(FitError::Undetermined)?.at(last, last);
        let intensity = minimum.z[last];
        let error = (variance.sqrt() * mean_square(minimum).sqrt()).max(LEAST_ERROR);
        let end = |sign: f64| intensity + sign * NORMAL_95 * error;
        let low = alike.iter().copied().fold(end(-1.0), f64::min).clamp(0.0, 1.0);
        let high = alike.iter().copied().fold(end(1.0), f64::max).clamp(0.0, 1.0);
        let farthest = alike.iter().map(|other| (other - intensity).abs()).fold(0.0, f64::max);
        Ok(Diagnosed {
            fault,
            name: self.fault_name(fault),
            intensity,
            error: error.max(farthest / NORMAL_95),
            interval: (low, high),
            log_likelihood: -minimum.cost - 0.5 * volume,
            probability: 0.0,
            onset,
            cost: minimum.cost,
            left: self.left(&minimum.residuals),
        })
    }

    /// The minimum with the fault present from the first sample on, and the intensities of (FN2).
    pub(super) fn constant(&self) -> Result<(Minimum, Vec<f64>), FitError> {
        let points: Vec<Vec<f64>> = FIRST_GUESSES.iter().map(|&x| at(&self.nominal(), x)).collect();
        let found = self.residuals(&points)?;
        let mut first = (f64::INFINITY, points[0].clone());
        for (point, found) in points.into_iter().zip(found) {
            let cost = found.map_or(f64::INFINITY, |residuals| self.cost(&point, &residuals));
            if cost < first.0 {
                first = (cost, point);
            }
        }
        self.least_of_all(&first.1)
    }

    /// The minimum from a first guess, restarted if another intensity gives a deeper one, and the intensities of (FN2).
    pub(super) fn least_of_all(&self, start: &[f64]) -> Result<(Minimum, Vec<f64>), FitError> {
        let mut minimum = self.minimum(start)?;
        let mut profile = self.profile(&minimum)?;
        for _ in 0..MOST_ANEW {
            let deepest = profile.iter().min_by(|a, b| a.1.total_cmp(&b.1));
            let Some(&(intensity, _)) = deepest.filter(|(_, cost)| *cost < minimum.cost - HOLLOW)
            else {
                break;
            };
            let again = self.minimum(&at(&minimum.z, intensity))?;
            if again.cost >= minimum.cost {
                break;
            }
            minimum = again;
            profile = self.profile(&minimum)?;
        }
        let highest = minimum.cost + HALF_CHI_SQUARE_95 * mean_square(&minimum);
        profile.retain(|(_, cost)| *cost <= highest);
        Ok((minimum, profile.into_iter().map(|(intensity, _)| intensity).collect()))
    }

    /// Evenly spaced intensities, each with the lowest F: J at the minimum predicts how the other unknowns move.
    fn profile(&self, minimum: &Minimum) -> Result<Vec<(f64, f64)>, FitError> {
        let intensities: Vec<f64> = (1..=PROFILE).map(|k| k as f64 / PROFILE as f64).collect();
        let points: Vec<Vec<f64>> = intensities.iter().map(|&x| at(&minimum.z, x)).collect();
        let residuals = self.residuals(&points)?;
        let costs = intensities.into_iter().zip(points).zip(&residuals);
        let costs = costs.map(|((intensity, point), residuals)| {
            let held = Some(point.len() - 1);
            Ok((intensity, self.predicted_cost(&minimum.linear, &point, residuals, held)?))
        });
        costs.collect()
    }
}

/// The mean square of a fit's residuals relative to the noise, at least 1. Residuals that the fault does not explain
/// make its intensity less certain.
pub(super) fn mean_square(minimum: &Minimum) -> f64 {
    let residuals = &minimum.residuals;
    (dot(residuals, residuals) / residuals.len().max(1) as f64).max(1.0)
}

/// The same point with another intensity.
pub(super) fn at(z: &[f64], intensity: f64) -> Vec<f64> {
    let others = &z[..z.len() - 1];
    others.iter().copied().chain([intensity]).collect()
}
