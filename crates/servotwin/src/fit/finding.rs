//! Findings: deviations in a record that no tolerance explains.
//!
//! Three signs of a fault do not identify it. The first is the mean square of a sensor's residuals. The second is their
//! largest mean over a second, times the root of its number of samples. The third is a parameter at the bound of its
//! tolerance that would fit better beyond it. [`super::suspects`] compares faults with the residuals.

use super::knowledge::FitKnowledge;
use super::linear::dot;
use super::record::FitRecord;
use super::solve::Minimum;
use super::suspects::{SCORE_LIMIT, Suspect};
use super::{Fit, FitError, FitResults};
use servotwin_io::text::number;

/// Largest sliding mean that is attributed to chance, in its standard deviations.
pub(crate) const MEAN_LIMIT: f64 = 6.0;
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
    /// The shift of the reading as a clause; empty without a shift.
    pub(super) fn shift_in_words(&self, problem: &Fit) -> String {
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

impl Fit<'_> {
    /// Evaluates a minimum: how well the unknowns are known, and what is left.
    pub(super) fn judged(&self, found: Minimum) -> Result<FitResults, FitError> {
        let known = FitKnowledge::new(&self.unknowns, &found.z, &found.linear.information);
        let known = known.ok_or(FitError::Undetermined)?;
        let left = self.left(&found.residuals);
        let mut suspects = self.suspects(&found, &known.covariance)?;
        let mut findings = self.outside(&found, &known);
        let is_suspect = suspects.first().is_some_and(Suspect::is_finding);
        findings.extend(of_what_is_left(&left));
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
        let mut begin = 0;
        for (place, record) in self.records.iter().enumerate() {
            let length = (record.samples() - self.first_sample(record)) * record.sensors.len();
            all.extend(self.left_of(place, record, &residuals[begin..begin + length]));
            begin += length;
        }
        all
    }

    /// Summarizes the residuals of every sensor of one record.
    pub(super) fn left_of(
        &self,
        place: usize,
        record: &FitRecord,
        residuals: &[f64],
    ) -> Vec<SensorFit> {
        let (width, first) = (record.sensors.len(), self.first_sample(record));
        let deviations = self.deviations(record);
        let of = |(column, &sensor): (usize, &usize)| {
            let values: Vec<f64> = residuals.iter().skip(column).step_by(width).copied().collect();
            let mut left = of_sensor(place, sensor, record, first, &values);
            left.shift = shift(&values, left.mean_square).map(|(at, by)| Shift {
                at_s: (first + at) as f64 * record.period_s,
                by: by * deviations[column],
            });
            left
        };
        record.sensors.iter().enumerate().map(of).collect()
    }
}

/// The sensor with the largest scatter and the one with the largest mean, each if it exceeds its limit.
pub(super) fn of_what_is_left(left: &[SensorFit]) -> impl Iterator<Item = FitFinding> {
    let largest = |of: fn(&SensorFit) -> f64| {
        let found = left.iter().filter(|left| of(left) > 1.0);
        found.max_by(|a, b| of(a).total_cmp(&of(b))).cloned()
    };
    let scatter = largest(|left| left.mean_square / left.limit).map(FitFinding::Scatter);
    let mean = largest(|left| left.largest_mean.abs() / MEAN_LIMIT).map(FitFinding::Mean);
    scatter.into_iter().chain(mean)
}

fn of_sensor(
    place: usize,
    sensor: usize,
    record: &FitRecord,
    first: usize,
    values: &[f64],
) -> SensorFit {
    let count = values.len() as f64;
    let mean_square = dot(values, values) / count;
    let limit = (1.0 + EXCESS_LIMIT * (2.0 / count).sqrt()).max(LEAST_SQUARE);
    let window = ((MEAN_S / record.period_s).round() as usize).clamp(1, values.len());
    let root = (window as f64).sqrt();
    let means =
        values.windows(window).step_by((window / 10).max(1)).map(|w| w.iter().sum::<f64>() / root);
    let largest = means.enumerate().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    let (at, largest_mean) = largest.unwrap_or((0, 0.0));
    let sample = first + at * (window / 10).max(1) + window / 2;
    let at_s = sample as f64 * record.period_s;
    SensorFit { record: place, sensor, mean_square, limit, largest_mean, at_s, shift: None }
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
