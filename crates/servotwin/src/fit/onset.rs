//! Faults that begin within a record: when they begin, and how strong they are from then on.
//!
//! Until the onset t, the record shows the healthy twin; from then on, it shows the twin with the fault, apart from a
//! transient. The runs that suspects need anyway therefore give a first guess for every moment:
//!
//! (FO1)  r_t = r of the healthy twin before t, r of the fault of intensity x from t on;  F(t, x) by (FF2)
//!
//! From the best t and x, a fit with a fault that begins at t in the simulation gives F of (FS1). The moment is then
//! moved in decreasing steps and fitted again. The fault began within the record if
//!
//! (FO2)  √(2 (F_c − F)/s) > 5
//!
//! F_c is that of the best fit with a fault from the first sample on, and s is the mean square of the residuals, at
//! least 1. The fit must also have s < 2: a fault that leaves more is not the right one. The interval of t contains the
//! moments with F(t) ≤ F + ½ χ²₁(95 %) s, with all other unknowns optimal for each.

use super::intensity::{Diagnosed, HALF_CHI_SQUARE_95, at, mean_square};
use super::linear::dot;
use super::response::Linear;
use super::solve::Minimum;
use super::suspects::{Guess, SCORE_LIMIT};
use super::{Fit, FitError};
use serde::Serialize;

/// The most moments at which a fault may begin in a first guess.
const MOST_MOMENTS: f64 = 100.0;
/// An onset is accepted only if the fit leaves less than this mean square: if both faults compared are wrong, the
/// likelier one gives no reliable time.
const MOST_LEFT: f64 = 2.0;
/// Least time between two moments, s, ...
const LEAST_BETWEEN_S: f64 = 0.5;
/// ... and least time between the last one and the end of the record, s.
const BEHIND_S: f64 = 1.0;
/// Number of moments tried on each side of a guess, within its current reach.
const TO_EACH_SIDE: i32 = 8;
/// Number of times the moment is refined, with decreasing reach.
const ROUNDS: usize = 3;
/// Distances from the best moment that are tried for the interval, in samples.
const BESIDE: [f64; 8] = [0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0];

/// When a fault began within a record.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FoundOnset {
    /// The moment, s after the first sample.
    pub at_s: f64,
    /// The begin of its 95 % interval, s.
    pub low_s: f64,
    /// The end of its 95 % interval, s.
    pub high_s: f64,
    /// Score (FO2) against the best fit with a fault from the first sample on.
    pub score: f64,
}

/// The moments at which a fault may begin, with the healthy twin's residuals before each of them.
pub(super) struct Moments<'l> {
    linear: &'l Linear,
    /// The moments, s.
    times_s: Vec<f64>,
    /// The index of the first residual at each moment.
    places: Vec<usize>,
    healthy: Vec<ResidualSums>,
}

/// |r|² and Jᵀr of the residuals before a moment.
type ResidualSums = (f64, Vec<f64>);

/// The sums before each place; the last entry covers all residuals.
fn sums(linear: &Linear, places: &[usize], residuals: &[f64]) -> Vec<ResidualSums> {
    let (mut square, mut pull, mut begin) = (0.0, vec![0.0; linear.columns.len()], 0);
    let before = |end: usize| {
        let own = &residuals[begin..end];
        square += dot(own, own);
        for (sum, column) in pull.iter_mut().zip(&linear.columns) {
            *sum += dot(&column[begin..end], own);
        }
        begin = end;
        (square, pull.clone())
    };
    places.iter().copied().chain([residuals.len()]).map(before).collect()
}

impl<'l> Moments<'l> {
    /// The candidate moments of a problem's record; `None` with several records, or with a record too short.
    pub(super) fn new(problem: &Fit, linear: &'l Linear) -> Option<Self> {
        let [record] = &problem.records[..] else { return None };
        let first = record.first_sample();
        let first_s = first as f64 * record.period_s;
        let room_s = record.duration_s() - BEHIND_S - first_s;
        let between_s = (room_s / MOST_MOMENTS).max(LEAST_BETWEEN_S);
        let count = (room_s / between_s) as usize;
        let times_s: Vec<f64> =
            (1..=count).map(|k| first_s + k as f64 * between_s).filter(|_| room_s > 0.0).collect();
        let place = |time_s: &f64| {
            let sample = (time_s / record.period_s).ceil() as usize;
            (sample - first) * record.sensors.len()
        };
        let places: Vec<usize> = times_s.iter().map(place).collect();
        let healthy = sums(linear, &places, &linear.residuals);
        (!places.is_empty()).then_some(Self { linear, times_s, places, healthy })
    }

    /// The lowest cost by (FO1), and its moment, for the residuals of a fault from the first sample on.
    pub(super) fn least(&self, problem: &Fit, residuals: &[f64]) -> Result<(f64, f64), FitError> {
        let faulty = sums(self.linear, &self.places, residuals);
        let (all_square, all_pull) = &faulty[self.places.len()];
        let mut best = (f64::INFINITY, self.times_s[0]);
        for (&at_s, (healthy, faulty)) in self.times_s.iter().zip(self.healthy.iter().zip(&faulty))
        {
            let square = healthy.0 + all_square - faulty.0;
            let pulls = healthy.1.iter().zip(all_pull).zip(&faulty.1);
            let pull: Vec<f64> = pulls.map(|((before, all), own)| before + all - own).collect();
            let (_, gain) = problem.step(self.linear, &self.linear.z, &pull, None)?;
            let cost = 0.5 * square - gain;
            if cost < best.0 {
                best = (cost, at_s);
            }
        }
        Ok(best)
    }

    /// The largest error of a guessed moment, s.
    pub(super) fn reach_s(&self) -> f64 {
        let between_s = self.times_s.windows(2).next().map(|pair| pair[1] - pair[0]);
        2.0 * between_s.unwrap_or(LEAST_BETWEEN_S)
    }
}

impl Fit<'_> {
    /// Fits a fault and its onset, from a guess whose moment may be wrong by `reach_s`. The onset is accepted by its score
    /// (FO2) against the cost of a fault from the first sample on.
    pub(super) fn begins(
        &self,
        fault: (usize, usize),
        guess: &Guess,
        mut reach_s: f64,
        constant: f64,
    ) -> Result<Diagnosed, FitError> {
        let mut at_s = guess.at_s.unwrap_or(0.0);
        let mut own = Fit { onset_s: Some(at_s), ..self.with_fault(fault) };
        let mut minimum = own.minimum(&at(&own.nominal(), guess.size))?;
        for _ in 0..ROUNDS {
            let step_s = reach_s / f64::from(TO_EACH_SIDE);
            let others = (-TO_EACH_SIDE..=TO_EACH_SIDE).map(|k| at_s + f64::from(k) * step_s);
            let costs = own.moved(&minimum, others)?;
            let best = costs.iter().min_by(|a, b| a.1.total_cmp(&b.1));
            let Some(&(best_s, _)) = best.filter(|(_, cost)| cost.is_finite()) else { break };
            if best_s != at_s {
                own.onset_s = Some(best_s);
                let again = own.minimum(&minimum.z)?;
                if again.cost < minimum.cost {
                    (minimum, at_s) = (again, best_s);
                }
            }
            reach_s = 2.0 * step_s;
        }
        own.onset_s = Some(at_s);
        let (minimum, alike) = own.least_of_all(&minimum.z)?;
        let (low_s, high_s) = own.moments_alike(&minimum, at_s)?;
        let left = mean_square(&minimum);
        let score = (2.0 * (constant - minimum.cost).max(0.0) / left).sqrt();
        let is_accepted = score > SCORE_LIMIT && left < MOST_LEFT;
        let onset = is_accepted.then_some(FoundOnset { at_s, low_s, high_s, score });
        own.diagnosed(fault, &minimum, &alike, onset)
    }

    /// The earliest and the latest moment that explain the record equally well.
    fn moments_alike(&self, minimum: &Minimum, at_s: f64) -> Result<(f64, f64), FitError> {
        let period_s = self.records[0].period_s;
        let beside = BESIDE.iter().flat_map(|samples| [-samples, *samples]);
        let highest = minimum.cost + HALF_CHI_SQUARE_95 * mean_square(minimum);
        let costs = self.moved(minimum, beside.map(|samples| at_s + samples * period_s))?;
        let alike = costs.iter().filter(|(_, cost)| *cost <= highest).map(|(other, _)| *other);
        // A moment is never known better than to half a sample.
        let ends = (at_s - 0.5 * period_s, at_s + 0.5 * period_s);
        let ends = alike.fold(ends, |(low, high), other| (low.min(other), high.max(other)));
        Ok((ends.0.max(0.0), ends.1.min(self.records[0].duration_s())))
    }

    /// Candidate moments, each with the lowest F: J at the minimum predicts how the unknowns move. Moments outside the
    /// record are left out.
    fn moved(
        &self,
        minimum: &Minimum,
        moments_s: impl Iterator<Item = f64>,
    ) -> Result<Vec<(f64, f64)>, FitError> {
        let inside = 0.0..self.records[0].duration_s();
        let moments_s: Vec<f64> = moments_s.filter(|at_s| inside.contains(at_s)).collect();
        let runs = self.residuals_from(&minimum.z, &moments_s)?;
        let costs = moments_s.iter().zip(&runs).map(|(&at_s, residuals)| {
            Ok((at_s, self.predicted_cost(&minimum.linear, &minimum.z, residuals, None)?))
        });
        costs.collect()
    }
}
