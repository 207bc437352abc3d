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

use super::intensity::{HALF_CHI_SQUARE_95, at, mean_square};
use super::linear::{Symmetric, dot};
use super::response::Linear;
use super::solve::Minimum;
use super::suspects::{Guess, SCORE_LIMIT};
use super::{Fit, FitError};

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
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundOnset {
    /// The moment, s after the first sample.
    pub at_s: f64,
    /// Its 95 % interval, s.
    pub interval_s: (f64, f64),
    /// Score (FO2) against the best fit with a fault from the first sample on.
    pub score: f64,
}

/// A fit of a fault with an onset.
pub(super) struct Begun {
    /// The fault: (component, fault).
    pub fault: (usize, usize),
    pub at_s: f64,
    pub interval_s: (f64, f64),
    pub minimum: Minimum,
    /// Intensities that explain the record equally well.
    pub alike: Vec<f64>,
}

impl Begun {
    /// The onset with its score (FO2), if it is accepted.
    pub(crate) fn onset(&self, constant: f64) -> Option<FoundOnset> {
        let gain = (constant - self.minimum.cost).max(0.0);
        let left = mean_square(&self.minimum);
        let score = (2.0 * gain / left).sqrt();
        let Begun { at_s, interval_s, .. } = *self;
        (score > SCORE_LIMIT && left < MOST_LEFT).then_some(FoundOnset { at_s, interval_s, score })
    }
}

/// The healthy twin's cost before each candidate moment.
pub(super) struct Moments<'l> {
    linear: &'l Linear,
    curvature: Symmetric,
    /// The candidate onset times, s.
    times_s: Vec<f64>,
    /// The index of the first residual at each moment.
    places: Vec<usize>,
    healthy: Sums,
}

/// Sums over the residuals before each moment; the last entry covers all.
struct Sums {
    squares: Vec<f64>,
    pulls: Vec<Vec<f64>>,
}

impl Sums {
    fn new(linear: &Linear, places: &[usize], residuals: &[f64]) -> Self {
        let (mut squares, mut pulls) = (Vec::new(), Vec::new());
        let (mut square, mut pull) = (0.0, vec![0.0; linear.columns.len()]);
        let mut begin = 0;
        for end in places.iter().copied().chain([residuals.len()]) {
            let own = &residuals[begin..end];
            square += dot(own, own);
            for (sum, column) in pull.iter_mut().zip(&linear.columns) {
                *sum += dot(&column[begin..end], own);
            }
            squares.push(square);
            pulls.push(pull.clone());
            begin = end;
        }
        Self { squares, pulls }
    }
}

impl<'l> Moments<'l> {
    /// The candidate moments of a problem's record; `None` with several records, or with a record too short.
    pub(crate) fn new(problem: &Fit, linear: &'l Linear) -> Option<Self> {
        let [record] = &problem.records[..] else { return None };
        let first = problem.first_sample(record);
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
        let healthy = Sums::new(linear, &places, &linear.residuals);
        let curvature = linear.information.plus_diagonal(&problem.priors());
        (!places.is_empty()).then_some(Self { linear, curvature, times_s, places, healthy })
    }

    /// Time between two moments, s.
    fn between_s(&self) -> f64 {
        self.times_s.windows(2).next().map_or(LEAST_BETWEEN_S, |pair| pair[1] - pair[0])
    }

    /// The lowest cost by (FO1), and its moment, for the residuals of a fault from the first sample on.
    pub(super) fn least(&self, problem: &Fit, residuals: &[f64]) -> Result<(f64, f64), FitError> {
        let faulty = Sums::new(self.linear, &self.places, residuals);
        let last = self.places.len();
        let mut best = (f64::INFINITY, self.times_s[0]);
        for (k, &at_s) in self.times_s.iter().enumerate() {
            let square = self.healthy.squares[k] + faulty.squares[last] - faulty.squares[k];
            let pulls = self.healthy.pulls[k].iter().zip(&faulty.pulls[last]);
            let pulls = pulls.zip(&faulty.pulls[k]);
            let pull: Vec<f64> = pulls.map(|((before, all), own)| before + all - own).collect();
            let (_, gain) = problem.step(&self.curvature, &self.linear.z, &pull)?;
            let cost = 0.5 * square - gain;
            if cost < best.0 {
                best = (cost, at_s);
            }
        }
        Ok(best)
    }

    /// The largest error of a guessed moment, s.
    pub(crate) fn reach_s(&self) -> f64 {
        2.0 * self.between_s()
    }
}

/// A problem whose last unknown is the intensity of a fault.
impl Fit<'_> {
    /// The same problem with a fault that begins at a given time.
    fn with_onset(&self, at_s: f64) -> Self {
        Fit { onset_s: Some(at_s), ..self.clone() }
    }

    /// Fits a fault and its onset, from a guess whose moment may be wrong by `reach_s`.
    pub(super) fn begins(&self, guess: &Guess, mut reach_s: f64) -> Result<Begun, FitError> {
        let mut at_s = guess.at_s.unwrap_or(0.0);
        let mut minimum = self.with_onset(at_s).minimum(&at(&self.nominal(), guess.intensity))?;
        for _ in 0..ROUNDS {
            let step_s = reach_s / f64::from(TO_EACH_SIDE);
            let others = (-TO_EACH_SIDE..=TO_EACH_SIDE).map(|k| at_s + f64::from(k) * step_s);
            let costs = self.moved(&minimum, &others.collect::<Vec<_>>())?;
            let best = costs.iter().min_by(|a, b| a.1.total_cmp(&b.1));
            let Some(&(best_s, _)) = best.filter(|(_, cost)| cost.is_finite()) else { break };
            if best_s != at_s {
                let again = self.with_onset(best_s).minimum(&minimum.z)?;
                if again.cost < minimum.cost {
                    (minimum, at_s) = (again, best_s);
                }
            }
            reach_s = 2.0 * step_s;
        }
        let own = self.with_onset(at_s);
        let (minimum, alike) = own.least_of_all(&minimum.z)?;
        let interval_s = self.moments_alike(&minimum, at_s)?;
        Ok(Begun { fault: guess.fault, at_s, interval_s, minimum, alike })
    }

    /// The earliest and the latest moment that explain the record equally well.
    fn moments_alike(&self, minimum: &Minimum, at_s: f64) -> Result<(f64, f64), FitError> {
        let period_s = self.records[0].period_s;
        let beside = BESIDE.iter().flat_map(|samples| [-samples, *samples]);
        let others: Vec<f64> = beside.map(|samples| at_s + samples * period_s).collect();
        let highest = minimum.cost + HALF_CHI_SQUARE_95 * mean_square(minimum);
        let costs = self.moved(minimum, &others)?;
        let alike = costs.iter().filter(|(_, cost)| *cost <= highest).map(|(other, _)| *other);
        // A moment is never known better than to half a sample.
        let ends = (at_s - 0.5 * period_s, at_s + 0.5 * period_s);
        let ends = alike.fold(ends, |(low, high), other| (low.min(other), high.max(other)));
        let last_s = self.records[0].duration_s();
        Ok((ends.0.max(0.0), ends.1.min(last_s)))
    }

    /// Candidate moments, each with the lowest F: J at the minimum predicts how the unknowns move. Moments outside the
    /// record are left out.
    fn moved(&self, minimum: &Minimum, moments_s: &[f64]) -> Result<Vec<(f64, f64)>, FitError> {
        let record = &self.records[0];
        let inside = 0.0..record.duration_s();
        let moments: Vec<f64> =
            moments_s.iter().copied().filter(|at_s| inside.contains(at_s)).collect();
        let variant =
            |job: usize| self.variant_from(&minimum.z, &record.inputs, Some(moments[job]));
        let runs = self.run(record, moments.len(), variant)?;
        let costs = moments.iter().zip(&runs).map(|(&at_s, residuals)| {
            let room = self.room(&minimum.z);
            Ok((at_s, self.cost_within(minimum, &minimum.z, residuals, &room)?))
        });
        costs.collect()
    }
}
