//! The verdict of a fit in one sentence: healthy, a fault, wrong times, or unexplained.

use super::finding::MEAN_LIMIT;
use super::intensity::{Diagnosed, intensity, intensity_and_onset};
use super::suspects::{CLOCK, DELAY};
use super::{Fit, FitError, FitFinding, FitResults, SensorFit, Suspect};

/// A fault explains a record if it removes at least this fraction of the excess over noise that the tolerances leave.
const EXPLAINS: f64 = 0.5;

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
        Ok(match left <= (1.0 - EXPLAINS) * beyond_noise(fitted.cost) || is_noise(&one) {
            true => FitVerdict::Fault(one),
            false => unexplained(Some(one)),
        })
    }
}

impl Fit<'_> {
    /// The shift of the sensor with the largest mean, as a clause. Empty if other sensors also show more than noise,
    /// because then the actuator moved as well.
    fn shift(&self, fitted: &FitResults) -> String {
        let mean = fitted.findings.iter().find_map(|finding| match finding {
            FitFinding::Mean(left) => Some(left),
            _ => None,
        });
        let Some(mean) = mean else { return String::new() };
        let others = fitted.left.iter().filter(|left| left.sensor != mean.sensor);
        let is_noise = |left: &SensorFit| {
            left.mean_square <= left.limit && left.largest_mean.abs() <= MEAN_LIMIT
        };
        match others.into_iter().all(is_noise) {
            true => mean.shift_in_words(self),
            false => String::new(),
        }
    }
}

/// Whether a fit with the fault leaves only noise.
fn is_noise(one: &Diagnosed) -> bool {
    let is_left =
        |finding: &FitFinding| matches!(finding, FitFinding::Scatter(_) | FitFinding::Mean(_));
    !one.fitted.findings.iter().any(is_left)
}
