//! What a solution says: an update, or findings, which are deviations that no tolerance explains; and the verdict in one
//! sentence.
//!
//! Three signs of a fault do not identify it. The first is the mean square of a sensor's residuals. The second is their
//! largest mean over a second, times the root of its number of samples. The third is a parameter at the bound of its
//! tolerance that would fit better beyond it. [`super::suspects`] compares faults with the residuals.

use super::intensity::{Diagnosed, intensity, intensity_and_onset};
use super::knowledge::FitKnowledge;
use super::linear::dot;
use super::solve::Minimum;
use super::suspects::{CLOCK, DELAY, SCORE_LIMIT, Suspect};
use super::{Fit, FitError, FitResults, WARM_UP_S};
use servotwin_io::text::number;

/// Largest sliding mean that is attributed to chance, in its standard deviations.
const MEAN_LIMIT: f64 = 6.0;
/// Largest excess of a mean square that is attributed to chance, in its standard deviations.
const EXCESS_LIMIT: f64 = 6.0;
/// A mean square below this is never a finding: the declared noise is not known more precisely.
const LEAST_SQUARE: f64 = 1.1;
/// A shift of a reading is reported from this many standard deviations on, ...
const SHIFT_LIMIT: f64 = 6.0;
/// ... if it explains this fraction of the excess over noise.
const SHIFT_EXPLAINS: f64 = 0.8;
/// Length of the sliding mean, s.
const MEAN_S: f64 = 1.0;
/// A fault explains a record if it removes at least this fraction of the excess over noise that the tolerances leave.
const EXPLAINS: f64 = 0.5;

/// The residuals of one sensor in one record.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorFit {
    /// The index of the record.
    pub record: usize,
    /// The index of the sensor in the system's list.
    pub sensor: usize,
    /// The mean square of the residuals; 1 means only the declared noise is left.
    pub mean_square: f64,
    /// The largest mean square that is attributed to chance.
    pub limit: f64,
    /// The largest mean over a second, in its standard deviations.
    pub largest_mean: f64,
    /// Time of the largest mean, s.
    pub at_s: f64,
    /// The shift of the reading that explains most of the residuals.
    pub shift: Option<Shift>,
}

/// A constant offset of a reading from a moment on: a sensor that was zeroed anew, or slipped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shift {
    /// Time of the shift, s.
    pub at_s: f64,
    /// Increase of the mean from then on, SI.
    pub by: f64,
}

/// A deviation that no tolerance explains.
#[derive(Clone, Debug, PartialEq)]
pub enum FitFinding {
    /// A parameter would fit better outside its tolerance.
    LeavesTolerance {
        /// The index of the unknown.
        unknown: usize,
        /// How far, in standard errors.
        by: f64,
    },
    /// A sensor's residuals scatter more than its noise.
    Scatter(SensorFit),
    /// A sensor's residuals have a nonzero mean for a second.
    Mean(SensorFit),
    /// A suspect explains the residuals where tolerances do not.
    Looks(Suspect),
    /// The solver did not converge.
    NotConverged,
}

impl SensorFit {
    /// From the residuals of a sensor after the warm-up, each of which has a standard deviation (SI).
    fn of(record: usize, sensor: usize, values: &[f64], period_s: f64, deviation: f64) -> Self {
        let first = (WARM_UP_S / period_s).round() as usize;
        let count = values.len() as f64;
        let mean_square = dot(values, values) / count;
        let limit = (1.0 + EXCESS_LIMIT * (2.0 / count).sqrt()).max(LEAST_SQUARE);
        let window = ((MEAN_S / period_s).round() as usize).clamp(1, values.len());
        let (root, step) = ((window as f64).sqrt(), (window / 10).max(1));
        let means = values.windows(window).step_by(step).map(|w| w.iter().sum::<f64>() / root);
        let largest = means.enumerate().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        let (at, largest_mean) = largest.unwrap_or((0, 0.0));
        let at_s = (first + at * step + window / 2) as f64 * period_s;
        let shift = shift(values, mean_square)
            .map(|(at, by)| Shift { at_s: (first + at) as f64 * period_s, by: by * deviation });
        SensorFit { record, sensor, mean_square, limit, largest_mean, at_s, shift }
    }

    fn is_noise(&self) -> bool {
        self.mean_square <= self.limit && self.largest_mean.abs() <= MEAN_LIMIT
    }

    /// The shift of the reading as a clause; empty without a shift.
    fn shift_in_words(&self, problem: &Fit) -> String {
        let Some(Shift { at_s, by }) = self.shift else { return String::new() };
        let sensor = &problem.system.sensors[self.sensor];
        let by = number(sensor.unit.difference_to_shown(by));
        let unit = sensor.unit.shown();
        format!("the reading of {} shifts by {by} {unit} at {at_s:.2} s", sensor.label)
    }
}

impl FitFinding {
    /// The finding as a sentence.
    pub fn sentence(&self, problem: &Fit) -> String {
        let label = |left: &SensorFit| problem.system.sensors[left.sensor].label.as_str();
        match self {
            FitFinding::LeavesTolerance { unknown, by } => {
                let name = &problem.unknowns[*unknown].name;
                // A large number of standard errors carries no information.
                let by = if *by < 100.0 {
                    format!(" by {by:.1} standard errors")
                } else {
                    String::new()
                };
                format!("{name} would have to leave its tolerance{by}")
            }
            FitFinding::Scatter(left) => format!(
                "the residuals of {} are too large: mean square {:.2} of its noise, limit {:.2}",
                label(left),
                left.mean_square,
                left.limit
            ),
            FitFinding::Mean(left) if left.shift.is_some() => left.shift_in_words(problem),
            FitFinding::Mean(left) => format!(
                "the residual of {} has a mean of {:.1} standard deviations around {:.1} s, limit {MEAN_LIMIT}",
                label(left),
                left.largest_mean,
                left.at_s
            ),
            FitFinding::Looks(suspect) => suspect.sentence(),
            FitFinding::NotConverged => "the fit did not come to an end".into(),
        }
    }
}

/// The verdict of a fit.
#[derive(Clone, Debug)]
pub enum FitVerdict {
    /// Parameters inside their tolerances explain the records.
    Healthy,
    /// A fault explains them.
    Fault(Box<Diagnosed>),
    /// The clock or the sensors' times are wrong.
    Times(Suspect),
    /// No fault and no time error explains them.
    Unexplained {
        /// The fault that comes nearest, if any.
        nearest: Option<Box<Diagnosed>>,
        /// A shift of a reading as a clause; empty without a shift.
        shift: String,
    },
}

impl FitVerdict {
    /// Its name for programs: `healthy`, `fault`, `times` or `unexplained`.
    pub fn name(&self) -> &'static str {
        match self {
            FitVerdict::Healthy => "healthy",
            FitVerdict::Fault(_) => "fault",
            FitVerdict::Times(_) => "times",
            FitVerdict::Unexplained { .. } => "unexplained",
        }
    }

    /// The fault that explains the records, or comes nearest.
    pub fn fault(&self) -> Option<&Diagnosed> {
        match self {
            FitVerdict::Fault(one) => Some(one),
            FitVerdict::Unexplained { nearest, .. } => nearest.as_deref(),
            FitVerdict::Healthy | FitVerdict::Times(_) => None,
        }
    }

    /// The verdict as a sentence.
    pub fn sentence(&self) -> String {
        match self {
            FitVerdict::Healthy => {
                "healthy: parameters inside of their tolerances explain the record".into()
            }
            FitVerdict::Fault(one) => format!("fault: {}", in_words(one)),
            FitVerdict::Times(suspect) => format!("wrong times: {}", suspect.sentence()),
            FitVerdict::Unexplained { shift, .. } if !shift.is_empty() => {
                format!("cannot be explained by a fault: {shift}, and nothing else follows it")
            }
            FitVerdict::Unexplained { nearest: None, .. } => {
                "cannot be explained: neither tolerances nor a fault of the study explain the record"
                    .into()
            }
            FitVerdict::Unexplained { nearest: Some(one), .. } => format!(
                "cannot be explained: the nearest fault, {}, leaves more than half of it",
                in_words(one)
            ),
        }
    }
}

/// A fault with its intensity and its onset.
fn in_words(one: &Diagnosed) -> String {
    let Diagnosed { name, intensity, interval: (low, high), .. } = one;
    let from = match one.onset {
        None => "from the first sample on".into(),
        Some(onset) => {
            let (earliest, latest) = onset.interval_s;
            format!("from {:.2} s on (95 %: {earliest:.2} … {latest:.2} s)", onset.at_s)
        }
    };
    format!("{name} at intensity {intensity:.3} (95 %: {low:.3} … {high:.3}) {from}")
}

impl Fit<'_> {
    /// Evaluates a minimum: how well the unknowns are known, and what is left.
    pub(super) fn judged(&self, found: Minimum) -> Result<FitResults, FitError> {
        let known = FitKnowledge::new(&self.unknowns, &found.z, &found.linear.information);
        let known = known.ok_or(FitError::Undetermined)?;
        let left = self.left(&found.residuals);
        let mut suspects = self.suspects(&found, &known.covariance)?;
        let mut findings = self.outside(&found, &known);
        let is_suspect = suspects.first().is_some_and(Suspect::is_finding);
        // The sensor with the largest scatter and the one with the largest mean, each if it exceeds its limit.
        let largest = |of: fn(&SensorFit) -> f64| {
            let found = left.iter().filter(|left| of(left) > 1.0);
            found.max_by(|a, b| of(a).total_cmp(&of(b))).cloned()
        };
        let scatter = largest(|left| left.mean_square / left.limit);
        findings.extend(scatter.map(FitFinding::Scatter));
        let mean = largest(|left| left.largest_mean.abs() / MEAN_LIMIT);
        findings.extend(mean.map(FitFinding::Mean));
        if is_suspect || !findings.is_empty() {
            suspects = self.likeliest()?;
            let first = suspects.first().filter(|first| first.score > SCORE_LIMIT);
            findings.splice(0..0, first.cloned().map(FitFinding::Looks));
        }
        if !found.converged {
            findings.push(FitFinding::NotConverged);
        }
        let overrides = self.variant(&found.z, &[]).overrides;
        let Minimum { z, cost, steps, .. } = found;
        Ok(FitResults { z, known, overrides, cost, left, findings, suspects, steps })
    }

    /// Parameters at a bound that would fit better beyond it.
    fn outside(&self, found: &Minimum, known: &FitKnowledge) -> Vec<FitFinding> {
        let pull = found.linear.pull(&found.residuals);
        let mut all = Vec::new();
        for (k, unknown) in self.unknowns.iter().enumerate() {
            let (low, high) = unknown.range;
            let slope = pull[k] - unknown.prior * found.z[k];
            let outwards = if found.z[k] >= high { slope } else { -slope };
            let at_bound = found.z[k] >= high || found.z[k] <= low;
            let by = outwards * known.error(k);
            if at_bound && by > SCORE_LIMIT {
                all.push(FitFinding::LeavesTolerance { unknown: k, by });
            }
        }
        all
    }

    /// Summarizes the residuals of every sensor.
    fn left(&self, residuals: &[f64]) -> Vec<SensorFit> {
        let mut all = Vec::new();
        let mut rest = residuals;
        for (place, record) in self.records.iter().enumerate() {
            let (width, deviations) = (record.sensors.len(), self.deviations(record));
            let samples = record.samples() - self.first_sample(record);
            let (own, later) = rest.split_at(samples * width);
            rest = later;
            for (column, (&sensor, deviation)) in record.sensors.iter().zip(deviations).enumerate()
            {
                let values: Vec<f64> = own.iter().skip(column).step_by(width).copied().collect();
                all.push(SensorFit::of(place, sensor, &values, record.period_s, deviation));
            }
        }
        all
    }

    /// The verdict on a fit of this problem. It may fit a fault in addition to the tolerances.
    ///
    /// # Errors
    /// See [`Fit::solve`].
    pub fn verdict(&self, fitted: &FitResults) -> Result<FitVerdict, FitError> {
        if fitted.is_update() {
            return Ok(FitVerdict::Healthy);
        }
        let unexplained = |nearest| FitVerdict::Unexplained { nearest, shift: self.shift(fitted) };
        let Some(FitFinding::Looks(suspect)) = fitted.findings.first() else {
            return Ok(unexplained(None));
        };
        if [CLOCK, DELAY].contains(&suspect.name.as_str()) {
            return Ok(FitVerdict::Times(suspect.clone()));
        }
        let Some(fault) = self.system.program.find_fault(&suspect.name) else {
            return Ok(unexplained(None));
        };
        let estimate = if suspect.onset.is_some() { intensity_and_onset } else { intensity };
        let one = Box::new(estimate(self, &[fault])?.remove(0));
        let residuals: usize = self.records.iter().map(|record| record.measured.len()).sum();
        let beyond_noise = |cost: f64| (cost - 0.5 * residuals as f64).max(0.0);
        let left = beyond_noise(one.fitted.cost);
        let is_noise = one.fitted.left.iter().all(SensorFit::is_noise);
        Ok(match left <= (1.0 - EXPLAINS) * beyond_noise(fitted.cost) || is_noise {
            true => FitVerdict::Fault(one),
            false => unexplained(Some(one)),
        })
    }

    /// The shift of the sensor with the largest mean, as a clause. Empty if other sensors also show more than noise,
    /// because then the actuator moved as well.
    fn shift(&self, fitted: &FitResults) -> String {
        let mean = fitted.findings.iter().find_map(|finding| match finding {
            FitFinding::Mean(left) => Some(left),
            _ => None,
        });
        let Some(mean) = mean else { return String::new() };
        let mut others = fitted.left.iter().filter(|left| left.sensor != mean.sensor);
        match others.all(SensorFit::is_noise) {
            true => mean.shift_in_words(self),
            false => String::new(),
        }
    }
}

/// The index from which the mean is shifted, and by how much, if that explains most of the excess over noise.
fn shift(values: &[f64], mean_square: f64) -> Option<(usize, f64)> {
    let count = values.len() as f64;
    let sum: f64 = values.iter().sum();
    let (mut before, mut best) = (0.0, (0, 0.0, 0.0));
    for (place, value) in values.iter().enumerate().take(values.len().saturating_sub(1)) {
        before += value;
        let n = place as f64 + 1.0;
        let by = (sum - before) / (count - n) - before / n;
        let taken = n * (count - n) / count * by * by;
        if taken > best.2 {
            best = (place + 1, by, taken);
        }
    }
    let (place, by, taken) = best;
    let whole = sum * sum / count;
    let beyond_noise = (mean_square - 1.0) * count - whole;
    let is_clear = taken > SHIFT_LIMIT * SHIFT_LIMIT && taken > SHIFT_EXPLAINS * beyond_noise;
    is_clear.then_some((place, by))
}
