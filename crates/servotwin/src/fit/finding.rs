//! What a solution says: an update, or findings, which are deviations that no tolerance explains; and the verdict in one
//! sentence.
//!
//! Three signs of a fault do not identify it. The first is the mean square of a sensor's residuals. The second is their
//! largest mean over a second, times the root of its number of samples. The third is a parameter at the bound of its
//! tolerance that would fit better beyond it. [`super::suspects`] compares faults with the residuals.

use super::intensity::Diagnosed;
use super::knowledge::FitKnowledge;
use super::linear::dot;
use super::record::FitRecord;
use super::solve::Minimum;
use super::suspects::{Cause, SCORE_LIMIT, Suspect};
use super::{Fit, FitError};

/// Largest sliding mean that is attributed to chance, in its standard deviations.
const MEAN_LIMIT: f64 = 6.0;
/// Largest excess of a mean square that is attributed to chance, in its standard deviations.
const EXCESS_LIMIT: f64 = 6.0;
/// A mean square below this is never a finding: the declared noise is not known more precisely.
const LEAST_SQUARE: f64 = 1.1;
/// Length of the sliding mean, s.
const MEAN_S: f64 = 1.0;
/// A fault explains a record if it removes at least this fraction of the excess over noise that the tolerances leave.
const EXPLAINS: f64 = 0.5;

/// The result of a fit.
#[derive(Clone, Debug)]
pub struct FitResults {
    /// The unknowns, in standard deviations of their tolerances or as intensities.
    pub z: Vec<f64>,
    /// How well each of them is known.
    pub known: FitKnowledge,
    /// The parameters in the form of a variant: (component, parameter, value).
    pub(crate) overrides: Vec<(usize, usize, f64)>,
    /// Half of the sum of squared residuals and squared deviations from the priors (FS1).
    pub(super) cost: f64,
    /// The residuals of each sensor of each record, summarized.
    pub left: Vec<SensorFit>,
    /// Deviations that no tolerance explains, as sentences; if there are any, the parameters are not an update.
    pub findings: Vec<String>,
    /// The suspects of the findings, the likeliest first.
    pub suspects: Vec<Suspect>,
    /// Number of steps taken.
    pub steps: usize,
    /// Whether the first suspect explains more than chance.
    is_suspect: bool,
}

impl FitResults {
    /// Whether the twin may take these parameters.
    pub fn is_update(&self) -> bool {
        self.findings.is_empty()
    }
}

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
}

impl SensorFit {
    /// From the residuals of a sensor after the warm-up.
    fn new((place, record): (usize, &FitRecord), sensor: usize, values: &[f64]) -> Self {
        let count = values.len() as f64;
        let mean_square = dot(values, values) / count;
        let limit = (1.0 + EXCESS_LIMIT * (2.0 / count).sqrt()).max(LEAST_SQUARE);
        let window = ((MEAN_S / record.period_s).round() as usize).clamp(1, values.len());
        let (root, step) = ((window as f64).sqrt(), (window / 10).max(1));
        let means = values.windows(window).step_by(step).map(|w| w.iter().sum::<f64>() / root);
        let largest = means.enumerate().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        let (at, largest_mean) = largest.unwrap_or((0, 0.0));
        let at_s = (record.first_sample() + at * step + window / 2) as f64 * record.period_s;
        SensorFit { record: place, sensor, mean_square, limit, largest_mean, at_s }
    }

    fn is_noise(&self) -> bool {
        self.mean_square <= self.limit && self.largest_mean.abs() <= MEAN_LIMIT
    }
}

/// The verdict of a fit.
#[derive(Clone, Debug)]
pub struct FitVerdict {
    /// `healthy`, `fault`, `times` (the clock or the sensors' times are wrong) or `unexplained`.
    pub state: &'static str,
    /// The verdict as a sentence.
    pub sentence: String,
    /// The fault that explains the records, or comes nearest.
    pub fault: Option<Diagnosed>,
}

/// A fault with its intensity and its onset.
fn in_words(one: &Diagnosed) -> String {
    let Diagnosed { name, intensity, interval: (low, high), .. } = one;
    let from = match one.onset {
        None => "from the first sample on".into(),
        Some(onset) => {
            let (at_s, earliest, latest) = (onset.at_s, onset.low_s, onset.high_s);
            format!("from {at_s:.2} s on (95 %: {earliest:.2} … {latest:.2} s)")
        }
    };
    format!("{name} at intensity {intensity:.3} (95 %: {low:.3} … {high:.3}) {from}")
}

impl Fit<'_> {
    /// Evaluates a minimum: how well the unknowns are known, and what is left.
    pub(super) fn judged(&self, found: Minimum) -> Result<FitResults, FitError> {
        let known = FitKnowledge::new(&self.unknowns, &found.z, &found.linear);
        let known = known.ok_or(FitError::Undetermined)?;
        let left = self.left(&found.residuals);
        let mut suspects = self.suspects(&found, &known.covariance)?;
        let mut findings = self.outside(&found, &known);
        let mut is_suspect = suspects.first().is_some_and(Suspect::is_finding);
        findings.extend(self.beyond_noise(&left));
        if is_suspect || !findings.is_empty() {
            suspects = self.likeliest()?;
            let first = suspects.first().filter(|first| first.score > SCORE_LIMIT);
            is_suspect = first.is_some();
            findings.splice(0..0, first.map(Suspect::sentence));
        }
        if !found.converged {
            findings.push("the fit did not come to an end".into());
        }
        let overrides = self.variant(&found.z, &[]).overrides;
        let Minimum { z, cost, steps, .. } = found;
        Ok(FitResults { z, known, overrides, cost, left, findings, suspects, steps, is_suspect })
    }

    /// Parameters at a bound that would fit better beyond it, as sentences.
    fn outside(&self, found: &Minimum, known: &FitKnowledge) -> Vec<String> {
        let pull = found.linear.pull(&found.residuals);
        let mut all = Vec::new();
        for (k, unknown) in self.unknowns.iter().enumerate() {
            let (low, high) = unknown.range;
            let slope = pull[k] - unknown.prior * found.z[k];
            let outwards = if found.z[k] >= high { slope } else { -slope };
            let at_bound = found.z[k] >= high || found.z[k] <= low;
            let by = outwards * known.error(k);
            if at_bound && by > SCORE_LIMIT {
                // A large number of standard errors carries no information.
                let by = match by < 100.0 {
                    true => format!(" by {by:.1} standard errors"),
                    false => String::new(),
                };
                all.push(format!("{} would have to leave its tolerance{by}", unknown.name));
            }
        }
        all
    }

    /// The sensor with the largest mean square of residuals, and the one with the largest mean, each if it exceeds its
    /// limit, as sentences.
    fn beyond_noise(&self, left: &[SensorFit]) -> Vec<String> {
        let largest = |share: fn(&SensorFit) -> f64| {
            let found = left.iter().filter(|left| share(left) > 1.0);
            let found = found.max_by(|a, b| share(a).total_cmp(&share(b)))?;
            Some((found, &self.system.sensors[found.sensor].label))
        };
        let scatter = largest(|left| left.mean_square / left.limit).map(|(left, label)| {
            format!(
                "the residuals of {label} are too large: mean square {:.2} of its noise, limit {:.2}",
                left.mean_square, left.limit
            )
        });
        let mean = largest(|left| left.largest_mean.abs() / MEAN_LIMIT).map(|(left, label)| {
            format!(
                "the residual of {label} has a mean of {:.1} standard deviations around {:.1} s, limit {MEAN_LIMIT}",
                left.largest_mean, left.at_s
            )
        });
        scatter.into_iter().chain(mean).collect()
    }

    /// Summarizes the residuals of every sensor.
    pub(super) fn left(&self, residuals: &[f64]) -> Vec<SensorFit> {
        let mut all = Vec::new();
        let mut rest = residuals;
        for (place, record) in self.records.iter().enumerate() {
            let width = record.sensors.len();
            let (own, later) = rest.split_at((record.samples() - record.first_sample()) * width);
            rest = later;
            for (column, &sensor) in record.sensors.iter().enumerate() {
                let values: Vec<f64> = own.iter().skip(column).step_by(width).copied().collect();
                all.push(SensorFit::new((place, record), sensor, &values));
            }
        }
        all
    }

    /// The verdict on a fit of this problem. It may fit a fault in addition to the tolerances.
    ///
    /// # Errors
    /// See [`Fit::solve`].
    pub fn verdict(&self, fitted: &FitResults) -> Result<FitVerdict, FitError> {
        let verdict = |state, sentence: String, fault| FitVerdict { state, sentence, fault };
        if fitted.is_update() {
            let sentence = "healthy: parameters inside of their tolerances explain the record";
            return Ok(verdict("healthy", sentence.into(), None));
        }
        let suspect = fitted.suspects.first().filter(|_| fitted.is_suspect);
        let nearest = match suspect.map(|suspect| (suspect, suspect.cause)) {
            None => None,
            Some((suspect, Cause::Fault(fault))) => {
                let found = match suspect.onset.is_some() {
                    true => self.diagnose(&[fault])?,
                    false => self.intensities(&[fault])?,
                };
                found.into_iter().next()
            }
            Some((times, _)) => {
                return Ok(verdict("times", format!("wrong times: {}", times.sentence()), None));
            }
        };
        if let Some(one) = nearest.as_ref().filter(|one| self.explains(one, fitted)) {
            return Ok(verdict("fault", format!("fault: {}", in_words(one)), nearest));
        }
        let sentence = match &nearest {
            None => {
                "cannot be explained: neither tolerances nor a fault of the study explain the record"
                    .into()
            }
            Some(one) => format!(
                "cannot be explained: the nearest fault, {}, leaves more than half of it",
                in_words(one)
            ),
        };
        Ok(verdict("unexplained", sentence, nearest))
    }

    /// Whether a fault explains most of what the tolerances leave beyond noise, or all of it.
    fn explains(&self, one: &Diagnosed, fitted: &FitResults) -> bool {
        let residuals: usize = self.records.iter().map(|record| record.measured.len()).sum();
        let beyond_noise = |cost: f64| (cost - 0.5 * residuals as f64).max(0.0);
        beyond_noise(one.cost) <= (1.0 - EXPLAINS) * beyond_noise(fitted.cost)
            || one.left.iter().all(SensorFit::is_noise)
    }
}
