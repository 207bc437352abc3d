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

use super::linear::dot;
use super::onset::FoundOnset;
use super::solve::Minimum;
use super::unknown::Unknown;
use super::{Fit, FitError, FitResults};

/// 95 % of a normal distribution lie within this many deviations.
const NORMAL_95: f64 = 1.96;
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
    pub fault: (usize, usize),
    /// The fault's full name.
    pub name: String,
    /// The estimated intensity, 0 to 1.
    pub intensity: f64,
    /// Its standard error. If another intensity explains the record equally well, the error is as large as if that
    /// intensity were an end of the interval.
    pub error: f64,
    /// The 95 % interval.
    pub interval: (f64, f64),
    /// Log-likelihood of the record (FN1).
    pub log_likelihood: f64,
    /// Its probability among the candidates.
    pub probability: f64,
    /// When it began, if within the record.
    pub onset: Option<FoundOnset>,
    /// The whole fit; the fault's intensity is the last unknown.
    pub fitted: FitResults,
}

/// Estimates the intensity of every candidate, assumed present from the first sample on; the likeliest comes first.
///
/// # Errors
/// See [`Fit::solve`]; or the twin cannot be simulated with a candidate.
pub(crate) fn intensity(
    problem: &Fit,
    candidates: &[(usize, usize)],
) -> Result<Vec<Diagnosed>, FitError> {
    let each = candidates.iter().map(|&fault| of_candidate(problem, fault));
    Ok(compared(each.collect::<Result<Vec<_>, _>>()?))
}

/// Like `intensity`, but also estimates when each fault began, if within the record (`super::onset`). Its intensity
/// then applies from this moment on.
///
/// # Errors
/// See `intensity`.
pub fn intensity_and_onset(
    problem: &Fit,
    candidates: &[(usize, usize)],
) -> Result<Vec<Diagnosed>, FitError> {
    let constant = candidates.iter().map(|&fault| of_candidate(problem, fault));
    let mut all = constant.collect::<Result<Vec<_>, _>>()?;
    for (one, guess) in all.iter_mut().zip(problem.onset_guesses(candidates)?) {
        let Some((guess, reach_s)) = guess.filter(|(g, _)| g.is_worth(one.fitted.cost)) else {
            continue;
        };
        let own = problem.with_fault(one.fault);
        let begun = own.begins(&guess, reach_s)?;
        if let Some(onset) = begun.onset(one.fitted.cost) {
            *one = diagnosed(&own, one.fault, begun.minimum, &begun.alike, Some(onset))?;
        }
    }
    Ok(compared(all))
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

fn of_candidate(problem: &Fit, fault: (usize, usize)) -> Result<Diagnosed, FitError> {
    let own = problem.with_fault(fault);
    let (minimum, alike) = own.constant()?;
    diagnosed(&own, fault, minimum, &alike, None)
}

/// Evaluates a fit whose last unknown is the intensity of a fault.
fn diagnosed(
    own: &Fit,
    fault: (usize, usize),
    minimum: Minimum,
    alike: &[f64],
    onset: Option<FoundOnset>,
) -> Result<Diagnosed, FitError> {
    let last = own.unknowns.len() - 1;
    let curvature = minimum.linear.information.plus_diagonal(&own.priors());
    let volume: f64 = curvature.eigen().iter().map(|(value, _)| value.max(1e-12).ln()).sum();
    let excess = mean_square(&minimum).sqrt();
    let fitted = own.judged(minimum)?;
    let (z, error) = (fitted.z[last], (fitted.known.error(last) * excess).max(LEAST_ERROR));
    let low = alike.iter().copied().fold(z - NORMAL_95 * error, f64::min).clamp(0.0, 1.0);
    let high = alike.iter().copied().fold(z + NORMAL_95 * error, f64::max).clamp(0.0, 1.0);
    let farthest = alike.iter().map(|other| (other - z).abs()).fold(0.0, f64::max);
    Ok(Diagnosed {
        fault,
        name: own.unknowns[last].name.clone(),
        intensity: z,
        error: error.max(farthest / NORMAL_95),
        interval: (low, high),
        log_likelihood: -fitted.cost - 0.5 * volume,
        probability: 0.0,
        onset,
        fitted,
    })
}

impl<'s> Fit<'s> {
    /// The problem with the intensity of a fault as its last unknown, and without suspects.
    pub(super) fn with_fault(&self, (component, fault): (usize, usize)) -> Fit<'s> {
        let unknown = Unknown::fault(self.system, component, fault);
        let mut own = Fit { suspects: Vec::new(), ..self.clone() };
        own.unknowns.push(unknown);
        own
    }
}

/// A fit whose last unknown is the intensity of a fault.
impl Fit<'_> {
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
            let mut room = self.room(&point);
            room[point.len() - 1] = (0.0, 0.0);
            Ok((intensity, self.cost_within(minimum, &point, residuals, &room)?))
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
