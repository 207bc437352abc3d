//! What a record shows that no tolerance explains.
//!
//! With d the change of the twin's sensors for a fault, in their deviations, r the residuals of the fit,
//! J and A = JᵀJ + Q those of the unknowns:
//!
//! (FF1)  score = dᵀr / √s,  s = dᵀd − (Jᵀd)ᵀ A⁻¹ (Jᵀd)
//!
//! It is a standard normal number for a specimen inside of its tolerances, and the most powerful one
//! against this fault: what parameters could explain counts only as far as their tolerances allow it.
//! dᵀr / s is the intensity that the fault would have.
//!
//! Two more say that something is wrong without saying what: the mean square of a sensor's residuals,
//! and their largest sliding mean over a second, times the root of its number of samples.
//!
//! What a finding looks like is another question, and (FF1) is no answer far from health. So every
//! suspect is then simulated at several intensities around the nominal twin, with residuals r, and judged
//! by what tolerances leave of them:
//!
//! (FF2)  F = ½ |r|² − max_z (zᵀJᵀr − ½ zᵀA z),  every z inside of its tolerance

use super::knowledge::Known;
use super::linear::{Symmetric, dot};
use super::record::Record;
use super::response::{Difference, Linear};
use super::solve::Minimum;
use super::{FitError, Fitted, Problem};
use crate::ensemble::{Ensemble, Sink, Variant};
use servotwin_model::program::FaultAt;
use servotwin_model::signal::Piecewise;
use std::fmt;

/// Largest score, in standard deviations, that chance is believed to make among a hundred suspects.
pub const SCORE_LIMIT: f64 = 5.0;
/// Largest sliding mean, in its standard deviations, that chance is believed to make in a record.
pub const MEAN_LIMIT: f64 = 6.0;
/// Largest excess of a mean square, in its standard deviations.
const EXCESS_LIMIT: f64 = 6.0;
/// A mean square below this is never a finding: declared noise is not known better.
const LEAST_SQUARE: f64 = 1.1;
/// Length of the sliding mean, s.
const MEAN_S: f64 = 1.0;
/// The intensity whose effect is compared.
const INTENSITY: f64 = 0.2;
/// The intensities at which all suspects of a finding are simulated.
const COARSE: [f64; 3] = [0.1, 0.35, 0.8];
/// The intensities at which the likeliest ones are.
const FINE: [f64; 12] = [0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.85, 1.0];
/// How many these are.
const LIKELIEST: usize = 5;
/// So many suspects are simulated together: their samples are kept.
const AT_ONCE: usize = 16;
/// By what share a clock is fast for comparison: less time has passed than it says.
const FAST: f64 = 0.005;
/// A clock that is less off is no finding.
const LEAST_CLOCK: f64 = 0.001;

/// What is left of one sensor in one record.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorFit {
    /// The record.
    pub record: usize,
    /// The sensor, by position in the system's list.
    pub sensor: usize,
    /// The mean square of the residuals: 1 where nothing but the declared noise is left.
    pub mean_square: f64,
    /// The largest that is believed to be chance.
    pub limit: f64,
    /// The largest mean over a second, in its standard deviations.
    pub largest_mean: f64,
    /// When, s.
    pub at_s: f64,
}

/// Something that a finding may be.
#[derive(Clone, Debug, PartialEq)]
pub struct Suspect {
    /// The fault's full name, or `clock`.
    pub name: String,
    /// (FF1); of a finding √(2 ΔF) by (FF2), ΔF what the suspect takes away.
    pub score: f64,
    /// The intensity that it would have; for the clock the share by which it runs fast.
    pub intensity: f64,
}

/// What no tolerance explains.
#[derive(Clone, Debug, PartialEq)]
pub enum Finding {
    /// A parameter would have to leave its tolerance.
    LeavesTolerance {
        /// The unknown.
        unknown: usize,
        /// How far, in standard errors.
        by: f64,
    },
    /// A sensor's residuals are larger than its noise.
    Scatter(SensorFit),
    /// A sensor's residuals have a mean for a second.
    Mean(SensorFit),
    /// A suspect explains what tolerances do not.
    Looks(Suspect),
    /// The steps did not end.
    NotConverged,
}

impl Finding {
    /// The finding as a sentence.
    pub fn sentence(&self, problem: &Problem) -> String {
        let label = |left: &SensorFit| problem.system.sensors[left.sensor].label.as_str();
        match self {
            Finding::LeavesTolerance { unknown, by } => {
                let name = &problem.unknowns[*unknown].name;
                // Many standard errors are no number that says anything.
                let by = if *by < 100.0 {
                    format!(" by {by:.1} standard errors")
                } else {
                    String::new()
                };
                format!("{name} would have to leave its tolerance{by}")
            }
            Finding::Scatter(left) => format!(
                "the residuals of {} are too large: mean square {:.2} of its noise, limit {:.2}",
                label(left),
                left.mean_square,
                left.limit
            ),
            Finding::Mean(left) => format!(
                "the residual of {} has a mean of {:.1} standard deviations around {:.1} s, limit {MEAN_LIMIT}",
                label(left),
                left.largest_mean,
                left.at_s
            ),
            Finding::Looks(suspect) if suspect.name == CLOCK => format!(
                "the clock seems to run {:.2} % {}",
                100.0 * suspect.intensity.abs(),
                if suspect.intensity > 0.0 { "fast" } else { "slow" }
            ),
            Finding::Looks(suspect) => {
                format!(
                    "it looks like {} of intensity {:.2} or so",
                    suspect.name, suspect.intensity
                )
            }
            Finding::NotConverged => "the fit did not come to an end".into(),
        }
    }
}

impl fmt::Display for Suspect {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{} {:.2} (score {:.1})", self.name, self.intensity, self.score)
    }
}

/// The name of the suspect that is no fault.
pub const CLOCK: &str = "clock";

impl Problem<'_> {
    /// What is known and what is left at a minimum.
    pub(super) fn judged(&self, found: Minimum) -> Result<Fitted, FitError> {
        let known = Known::new(&self.unknowns, &found.z, &found.linear.information);
        let known = known.ok_or(FitError::Undetermined)?;
        let left = self.left(&found.residuals);
        let mut suspects = self.suspects(&found, &known.covariance)?;
        let mut findings = self.outside(&found, &known);
        let is_suspect = suspects.first().is_some_and(is_finding);
        let largest = |of: fn(&SensorFit) -> f64| {
            left.iter()
                .filter(|left| of(left) > 1.0)
                .max_by(|a, b| of(a).total_cmp(&of(b)))
                .cloned()
        };
        findings.extend(largest(|left| left.mean_square / left.limit).map(Finding::Scatter));
        findings.extend(largest(|left| left.largest_mean.abs() / MEAN_LIMIT).map(Finding::Mean));
        let is_any = is_suspect || !findings.is_empty();
        if is_any && suspects.first().is_none_or(|first| first.name != CLOCK) {
            suspects = self.likeliest()?;
        }
        if let Some(first) =
            suspects.first().filter(|first| is_any && first.score.abs() > SCORE_LIMIT)
        {
            findings.insert(0, Finding::Looks(first.clone()));
        }
        if !found.converged {
            findings.push(Finding::NotConverged);
        }
        let overrides = self.variant(&found.z, &[]).overrides;
        let Minimum { z, cost, steps, .. } = found;
        Ok(Fitted { z, known, overrides, cost, left, findings, suspects, steps })
    }

    /// Parameters that stand at a bound and want to leave it.
    fn outside(&self, found: &Minimum, known: &Known) -> Vec<Finding> {
        let pull = found.linear.pull(&found.residuals);
        let mut all = Vec::new();
        for (k, unknown) in self.unknowns.iter().enumerate() {
            let (low, high) = unknown.range;
            let slope = pull[k] - unknown.prior * found.z[k];
            let outwards = if found.z[k] >= high { slope } else { -slope };
            let at_bound = found.z[k] >= high || found.z[k] <= low;
            let by = outwards * known.error(k);
            if at_bound && by > SCORE_LIMIT {
                all.push(Finding::LeavesTolerance { unknown: k, by });
            }
        }
        all
    }

    /// What is left of every sensor.
    fn left(&self, residuals: &[f64]) -> Vec<SensorFit> {
        let mut all = Vec::new();
        let mut begin = 0;
        for (place, record) in self.records.iter().enumerate() {
            let (width, first) = (record.sensors.len(), self.first_sample(record));
            let length = (record.samples() - first) * width;
            let own = &residuals[begin..begin + length];
            begin += length;
            for (column, &sensor) in record.sensors.iter().enumerate() {
                let values: Vec<f64> = own.iter().skip(column).step_by(width).copied().collect();
                all.push(of_sensor(place, sensor, record, first, &values));
            }
        }
        all
    }

    /// Every suspect's score, the largest first.
    fn suspects(&self, found: &Minimum, covariance: &Symmetric) -> Result<Vec<Suspect>, FitError> {
        let base = Base { residuals: &found.residuals, linear: &found.linear };
        let mut sums = vec![Sums::default(); self.suspects.len()];
        let mut clock = Sums::default();
        let mut begin = 0;
        for record in &self.records {
            let variant = |job: usize| {
                let (component, fault) = self.suspects[job];
                let mut variant = self.variant(&found.z, &record.inputs);
                variant.faults.push(FaultAt { component, fault, intensity: INTENSITY });
                variant
            };
            let ensemble = self.ensemble(record);
            let of_faults = self.against(
                record,
                &ensemble,
                base,
                begin,
                INTENSITY,
                self.suspects.len(),
                variant,
            );
            for (sums, own) in sums.iter_mut().zip(of_faults) {
                sums.add(&own);
            }
            let inputs: Vec<Piecewise> = record.inputs.iter().map(shortened).collect();
            let period_s = record.period_s * (1.0 - FAST);
            let duration_s = record.duration_s() * (1.0 - FAST);
            let ensemble =
                Ensemble { sample_period_s: period_s, duration_s, ..self.ensemble(record) };
            let variant = |_| self.variant(&found.z, &inputs);
            for own in self.against(record, &ensemble, base, begin, FAST, 1, variant) {
                clock.add(&own);
            }
            begin += (record.samples() - self.first_sample(record)) * record.sensors.len();
        }
        let faults = self.suspects.iter().zip(&sums);
        let faults = faults.map(|(at, sums)| sums.suspect(self.fault_name(*at), covariance));
        let mut all: Vec<Suspect> = faults.collect();
        all.push(clock.suspect(CLOCK.into(), covariance));
        let strength = |s: &Suspect| if s.name == CLOCK { s.score.abs() } else { s.score };
        all.sort_by(|a, b| strength(b).total_cmp(&strength(a)));
        Ok(all)
    }

    /// What explains the records best, by (FF2).
    fn likeliest(&self) -> Result<Vec<Suspect>, FitError> {
        let nominal = vec![0.0; self.unknowns.len()];
        let linear = self.linear(&nominal, Difference::Forward)?;
        let healthy = self.explained(&linear, &linear.residuals)?;
        let coarse = self.costs(&linear, &(0..self.suspects.len()).collect::<Vec<_>>(), &COARSE)?;
        let mut order: Vec<usize> = (0..coarse.len()).collect();
        order.sort_by(|&a, &b| coarse[a].0.total_cmp(&coarse[b].0));
        order.truncate(LIKELIEST);
        let fine = self.costs(&linear, &order, &FINE)?;
        let suspect = |(&suspect, &(cost, intensity)): (&usize, &(f64, f64))| Suspect {
            name: self.fault_name(self.suspects[suspect]),
            score: (2.0 * (healthy - cost).max(0.0)).sqrt(),
            intensity,
        };
        let mut all: Vec<Suspect> = order.iter().zip(&fine).map(suspect).collect();
        all.sort_by(|a, b| b.score.total_cmp(&a.score));
        Ok(all)
    }

    /// The least (FF2) of each of some suspects, and at which intensity.
    fn costs(
        &self,
        linear: &Linear,
        which: &[usize],
        intensities: &[f64],
    ) -> Result<Vec<(f64, f64)>, FitError> {
        let mut costs = vec![vec![0.0; intensities.len()]; which.len()];
        for (place, suspects) in which.chunks(AT_ONCE).enumerate() {
            let variants = suspects.len() * intensities.len();
            let mut residuals: Vec<Result<Vec<f64>, FitError>> = vec![Ok(Vec::new()); variants];
            for record in &self.records {
                let variant = |job: usize| {
                    let (component, fault) = self.suspects[suspects[job / intensities.len()]];
                    let intensity = intensities[job % intensities.len()];
                    let mut variant = self.variant(&linear.z, &record.inputs);
                    variant.faults.push(FaultAt { component, fault, intensity });
                    variant
                };
                for (all, own) in residuals.iter_mut().zip(self.run(record, variants, variant)?) {
                    match (all.as_mut(), own) {
                        (Ok(all), Ok(own)) => all.extend(own),
                        (Ok(_), Err(error)) => *all = Err(error),
                        (Err(_), _) => {}
                    }
                }
            }
            for (job, residuals) in residuals.into_iter().enumerate() {
                let cost = match residuals {
                    Ok(residuals) => self.explained(linear, &residuals)?,
                    // A twin that cannot be simulated explains nothing.
                    Err(_) => f64::INFINITY,
                };
                costs[place * AT_ONCE + job / intensities.len()][job % intensities.len()] = cost;
            }
        }
        let least = |costs: &Vec<f64>| {
            let pairs = costs.iter().copied().zip(intensities.iter().copied());
            pairs.min_by(|a, b| a.0.total_cmp(&b.0)).expect("an intensity")
        };
        Ok(costs.iter().map(least).collect())
    }

    /// (FF2).
    fn explained(&self, linear: &Linear, residuals: &[f64]) -> Result<f64, FitError> {
        let curvature = linear.information.plus_diagonal(&self.priors());
        let (_, gain) = self.step(&curvature, &linear.z, &linear.pull(residuals))?;
        Ok(0.5 * dot(residuals, residuals) - gain)
    }

    fn fault_name(&self, (component, fault): (usize, usize)) -> String {
        let instance = &self.system.network().components[component];
        format!("{}.{}", instance.id, instance.component.spec().faults[fault].name)
    }

    /// The sums of (FF1) for some variants of a record; of one that cannot be simulated, none.
    #[expect(clippy::too_many_arguments)]
    fn against<'v>(
        &self,
        record: &Record,
        ensemble: &Ensemble,
        base: Base,
        begin: usize,
        step: f64,
        count: usize,
        variant: impl Fn(usize) -> Variant<'v> + Sync,
    ) -> Vec<Sums> {
        let deviations = self.deviations(record);
        let mut all = vec![Sums::default(); count];
        let sink = |_| Against {
            base,
            record,
            deviations: &deviations,
            first: self.first_sample(record),
            place: begin,
            step,
            sums: Sums { along: vec![0.0; base.linear.columns.len()], ..Sums::default() },
        };
        ensemble.run(count, variant, sink, |job, against, outcome| {
            if outcome.is_ok() {
                all[job] = against.sums;
            }
            (self.progress)();
        });
        all
    }
}

fn is_finding(suspect: &Suspect) -> bool {
    match suspect.name == CLOCK {
        true => suspect.score.abs() > SCORE_LIMIT && suspect.intensity.abs() > LEAST_CLOCK,
        false => suspect.score > SCORE_LIMIT,
    }
}

/// The signal whose record a fast clock has made longer.
fn shortened(signal: &Piecewise) -> Piecewise {
    let factor = 1.0 - FAST;
    let breaks = signal.breaks_s().iter().map(|b| b * factor).collect();
    let slower = |[c0, c1, c2, c3]: &[f64; 4]| {
        [*c0, c1 / factor, c2 / (factor * factor), c3 / (factor * factor * factor)]
    };
    Piecewise::new(breaks, signal.pieces().iter().map(slower).collect())
        .expect("breaks still increase")
}

fn of_sensor(
    place: usize,
    sensor: usize,
    record: &Record,
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
    SensorFit { record: place, sensor, mean_square, limit, largest_mean, at_s }
}

/// What suspects are compared with.
#[derive(Clone, Copy)]
struct Base<'f> {
    residuals: &'f [f64],
    linear: &'f Linear,
}

/// The sums of (FF1).
#[derive(Clone, Debug, Default)]
struct Sums {
    /// dᵀr.
    with: f64,
    /// dᵀd.
    square: f64,
    /// Jᵀd.
    along: Vec<f64>,
}

impl Sums {
    fn add(&mut self, other: &Sums) {
        self.with += other.with;
        self.square += other.square;
        self.along.resize(other.along.len(), 0.0);
        self.along.iter_mut().zip(&other.along).for_each(|(own, other)| *own += other);
    }

    fn suspect(&self, name: String, covariance: &Symmetric) -> Suspect {
        let known = if self.along.is_empty() {
            0.0
        } else {
            dot(&self.along, &covariance.times(&self.along))
        };
        // A fault that shows nothing, or nothing of its own, cannot be suspected.
        let rest = self.square - known;
        if rest <= 1e-6 * self.square || self.square == 0.0 {
            return Suspect { name, score: 0.0, intensity: 0.0 };
        }
        Suspect { name, score: self.with / rest.sqrt(), intensity: self.with / rest }
    }
}

/// Sums (FF1) up while samples come.
struct Against<'f> {
    base: Base<'f>,
    record: &'f Record,
    deviations: &'f [f64],
    first: usize,
    /// Where the next residual stands.
    place: usize,
    step: f64,
    sums: Sums,
}

impl Sink for Against<'_> {
    fn sample(&mut self, index: usize, values: &[f64]) {
        if index < self.first || index >= self.record.samples() {
            return;
        }
        let measured = &self.record.measured[index * values.len()..][..values.len()];
        for ((m, v), deviation) in measured.iter().zip(values).zip(self.deviations) {
            let left = self.base.residuals[self.place];
            let d = (left - (m - v) / deviation) / self.step;
            self.sums.with += d * left;
            self.sums.square += d * d;
            for (sum, column) in self.sums.along.iter_mut().zip(&self.base.linear.columns) {
                *sum += d * column[self.place];
            }
            self.place += 1;
        }
    }
}
