//! The solver of the fit: minimizes the residuals and the unknowns' deviations from their priors.
//!
//! (FS1)  F = ½ |r|² + ½ Σ q_k z_k²,  q_k what is known before
//!
//! (FS2)  (JᵀJ + Q) δ = Jᵀ r − Q z,  every z between its bounds
//!
//! A Gauss–Newton step is tried in several lengths, one per lane, so that the line search costs no time. While a step
//! gains what (FS2) promised, the next one keeps its J. The last steps use a central-difference J.

use super::linear::dot;
use super::response::{DerivativeScheme, Linear, Residuals, RunResiduals};
use super::{Fit, FitError, Unknown};

/// The fractions of a step that are tried together.
const LENGTHS: [f64; 4] = [1.0, 0.5, 0.2, 0.05];
/// A fit has converged when a step would reduce F by less than this: no unknown would move by more than a tenth of its
/// standard error.
pub(super) const SMALL_GAIN: f64 = 0.005;
/// A step that promises less than this is taken without a search: the solver's errors change F by about as much, but
/// the slope of F by far less.
const SURE_GAIN: f64 = 1.0;
/// Most steps with one J.
const MOST_STEPS: usize = 4;
/// Most recomputations of J.
const MOST_TURNS: usize = 6;
/// Below this fraction of the promised gain, the next step needs a new J.
const GOOD_GAIN: f64 = 0.5;
/// A fit is given up if the mean square of the residuals exceeds the noise by this factor, ...
const HOPELESS: f64 = 2.0;
/// ... and a new J reduces F by less than this fraction.
const LEAST_PROGRESS: f64 = 0.05;

/// The result of a fit.
#[derive(Clone, Debug)]
pub(super) struct Minimum {
    /// The linearization used last.
    pub(crate) linear: Linear,
    /// The unknowns at the minimum.
    pub(crate) z: Vec<f64>,
    /// The residuals at `z`.
    pub(crate) residuals: Residuals,
    /// F of (FS1).
    pub(crate) cost: f64,
    /// Whether the last step was below the convergence limit.
    pub(crate) converged: bool,
    /// Steps that were taken.
    pub(crate) steps: usize,
}

impl Fit<'_> {
    pub(super) fn priors(&self) -> Vec<f64> {
        self.unknowns.iter().map(|unknown| unknown.prior).collect()
    }

    /// The objective F (FS1).
    pub(super) fn cost(&self, z: &[f64], residuals: &[f64]) -> f64 {
        let prior: f64 = self.unknowns.iter().zip(z).map(|(u, z)| u.prior * z * z).sum();
        0.5 * dot(residuals, residuals) + 0.5 * prior
    }

    /// The step (FS2) from a point, and the promised reduction of F. An unknown may be held.
    pub(super) fn step(
        &self,
        linear: &Linear,
        z: &[f64],
        pull: &[f64],
        held: Option<usize>,
    ) -> Result<(Vec<f64>, f64), FitError> {
        let pairs = self.unknowns.iter().zip(z).zip(pull);
        let slope: Vec<f64> = pairs.map(|((u, z), pull)| pull - u.prior * z).collect();
        let room = |(k, (u, z)): (usize, (&Unknown, &f64))| match held == Some(k) {
            true => (0.0, 0.0),
            false => (u.range.0 - z, u.range.1 - z),
        };
        let room: Vec<(f64, f64)> = self.unknowns.iter().zip(z).enumerate().map(room).collect();
        let step = linear.curvature.minimum_within(&slope, &room).ok_or(FitError::Undetermined)?;
        let gain = dot(&slope, &step) - 0.5 * dot(&step, &linear.curvature.times(&step));
        Ok((step, gain))
    }

    /// The lowest F that J predicts near a point, where an unknown may be held; infinite for a twin that cannot be
    /// simulated.
    pub(super) fn predicted_cost(
        &self,
        linear: &Linear,
        z: &[f64],
        residuals: &RunResiduals,
        held: Option<usize>,
    ) -> Result<f64, FitError> {
        let Ok(residuals) = residuals else { return Ok(f64::INFINITY) };
        let (_, gain) = self.step(linear, z, &linear.pull(residuals), held)?;
        Ok(self.cost(z, residuals) - gain)
    }

    /// Finds the minimum from a first guess.
    pub(super) fn minimum(&self, start: &[f64]) -> Result<Minimum, FitError> {
        let linear = self.linear(start, DerivativeScheme::Forward)?;
        let mut found = self.steps_around(linear)?;
        for _ in 0..MOST_TURNS {
            let linear = self.linear(&found.z, DerivativeScheme::Central)?;
            let (before, cost) = (found.steps, found.cost);
            let last = self.steps_around(linear)?;
            found = Minimum { steps: before + last.steps, ..last };
            let is_hopeless = dot(&found.residuals, &found.residuals)
                > HOPELESS * found.residuals.len() as f64
                && found.cost > (1.0 - LEAST_PROGRESS) * cost;
            if found.converged || is_hopeless {
                break;
            }
        }
        Ok(found)
    }

    /// Takes steps with a constant J.
    fn steps_around(&self, linear: Linear) -> Result<Minimum, FitError> {
        let mut z = linear.z.clone();
        let mut residuals = linear.residuals.clone();
        let mut cost = self.cost(&z, &residuals);
        let (mut converged, mut steps) = (false, 0);
        for _ in 0..MOST_STEPS {
            let (step, promised) = self.step(&linear, &z, &linear.pull(&residuals), None)?;
            if promised < SMALL_GAIN {
                converged = true;
                break;
            }
            let lengths = if promised < SURE_GAIN { &LENGTHS[..1] } else { &LENGTHS };
            let bar = if promised < SURE_GAIN { f64::INFINITY } else { cost };
            let Some((next, found)) = self.best_of(&z, &step, lengths, bar)? else { break };
            let gain = cost - self.cost(&next, &found);
            (z, residuals, cost) = (next, found, cost - gain);
            steps += 1;
            if promised >= SURE_GAIN && gain < GOOD_GAIN * promised {
                break;
            }
        }
        Ok(Minimum { linear, z, residuals, cost, converged, steps })
    }

    /// The point behind a share of a step, within the ranges.
    pub(super) fn point_behind(&self, z: &[f64], step: &[f64], share: f64) -> Vec<f64> {
        let moved = z.iter().zip(step).map(|(z, step)| z + share * step);
        moved.zip(&self.unknowns).map(|(z, u)| z.clamp(u.range.0, u.range.1)).collect()
    }

    /// The best of several lengths of a step; `None` if none gives F below `bar`.
    fn best_of(
        &self,
        z: &[f64],
        step: &[f64],
        lengths: &[f64],
        bar: f64,
    ) -> Result<Option<(Vec<f64>, Residuals)>, FitError> {
        let points: Vec<Vec<f64>> =
            lengths.iter().map(|length| self.point_behind(z, step, *length)).collect();
        let mut best: Option<(f64, Vec<f64>, Residuals)> = None;
        for (point, found) in points.iter().zip(self.residuals(&points)?) {
            let Ok(residuals) = found else { continue };
            let own = self.cost(point, &residuals);
            if own < best.as_ref().map_or(bar, |(least, ..)| *least) {
                best = Some((own, point.clone(), residuals));
            }
        }
        Ok(best.map(|(_, point, residuals)| (point, residuals)))
    }
}
