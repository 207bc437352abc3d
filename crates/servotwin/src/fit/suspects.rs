//! Suspects of a finding: faults, and records with wrong times.
//!
//! Let d be the change of the twin's sensors due to a fault, in their deviations, r the residuals of the fit, and J and
//! A = JᵀJ + Q those of the unknowns:
//!
//! (FF1)  score = dᵀr / √s,  s = dᵀd − (Jᵀd)ᵀ A⁻¹ (Jᵀd)
//!
//! The score is a standard normal number for a specimen inside its tolerances, and the most powerful test against this
//! fault. Effects that parameters could explain count only as far as their tolerances allow. dᵀr / s is the fault's
//! estimated intensity.
//!
//! (FF1) is linear, so it cannot identify a finding far from the healthy state. Every suspect is therefore simulated at
//! several sizes around the nominal twin, with residuals r, and judged by the residuals that tolerances leave:
//!
//! (FF2)  F = ½ |r|² − max_z (zᵀJᵀr − ½ zᵀA z),  every z inside of its tolerance

use super::linear::{Symmetric, dot};
use super::onset::{Begun, FoundOnset, Moments};
use super::record::{FitRecord, RecordError};
use super::response::{DerivativeScheme, Linear, RunResiduals, append};
use super::solve::Minimum;
use super::{Fit, FitError};
use crate::ensemble::Ensemble;
use servotwin_model::program::FaultAt;
use servotwin_model::signal::Piecewise;
use std::cmp::Ordering;
use std::fmt;

/// Largest score that is attributed to chance among a hundred suspects, in standard deviations.
pub(crate) const SCORE_LIMIT: f64 = 5.0;
/// The intensity whose effect is compared.
const INTENSITY: f64 = 0.2;
/// The fraction by which a clock runs fast in the comparison: less time has passed than it shows.
const FAST: f64 = 0.005;
/// A smaller clock error is not a finding.
const LEAST_CLOCK: f64 = 0.001;
/// The intensities at which all suspects of a finding are simulated.
const COARSE: [f64; 4] = [0.03, 0.12, 0.35, 0.8];
/// The intensities at which the likeliest suspects are simulated.
const FINE: [f64; 12] = [0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.85, 1.0];
/// The number of these suspects.
const LIKELIEST: usize = 5;
/// How many of them are fitted if one may have begun within the record.
const FITTED: usize = 3;
/// The simulated delays of sensors, samples.
const DELAYS: [f64; 6] = [-2.0, -1.0, -0.5, 0.5, 1.0, 2.0];
/// The simulated clock errors, as fractions; positive is fast.
const CLOCKS: [f64; 6] = [-0.02, -0.01, -0.003, 0.003, 0.01, 0.02];
/// The factors around an estimated time error at which it is tried: the estimate is accurate to a sample.
const AROUND: [f64; 9] = [0.8, 0.85, 0.9, 0.95, 1.0, 1.05, 1.1, 1.15, 1.2];
/// A time error explains a record clearly better than a fault if the fault leaves this many times as much.
const CLEARLY: f64 = 2.0;
/// Number of runs whose residuals are kept in memory.
const AT_ONCE: usize = 96;

/// The name of the suspect *fast clock*.
pub(crate) const CLOCK: &str = "clock";
/// The name of the suspect *late sensors*.
pub(crate) const DELAY: &str = "delay";

/// A possible cause of a finding.
#[derive(Clone, Debug, PartialEq)]
pub struct Suspect {
    /// The fault's full name, or `CLOCK` or `DELAY`.
    pub name: String,
    /// (FF1); for a finding √(2 ΔF) by (FF2), where ΔF is the reduction of F by the suspect.
    pub score: f64,
    /// The estimated intensity; for a clock the fraction by which it is fast, for a delay seconds.
    pub intensity: f64,
    /// When it began, if within the record.
    pub onset: Option<FoundOnset>,
}

impl Suspect {
    /// Whether the score exceeds chance.
    pub(super) fn is_finding(&self) -> bool {
        match self.name == CLOCK {
            true => self.score.abs() > SCORE_LIMIT && self.intensity.abs() > LEAST_CLOCK,
            false => self.score > SCORE_LIMIT,
        }
    }

    /// The suspect as a sentence.
    pub(crate) fn sentence(&self) -> String {
        let Self { name, intensity, .. } = self;
        let (size, is_more) = (intensity.abs(), *intensity > 0.0);
        match name.as_str() {
            CLOCK => {
                let way = if is_more { "fast" } else { "slow" };
                format!("the clock of the record seems to run {:.1} % {way}", 100.0 * size)
            }
            DELAY => {
                let way = if is_more { "late" } else { "early" };
                format!("the sensors seem to come {size:.4} s too {way} for the inputs")
            }
            _ => match self.onset {
                None => format!("it looks like {name} of intensity {intensity:.2} or so"),
                Some(FoundOnset { at_s, interval_s: (low, high), .. }) => format!(
                    "it looks like {name} of intensity {intensity:.2} from {at_s:.2} s on (95 %: {low:.2} … {high:.2} s)"
                ),
            },
        }
    }
}

impl fmt::Display for Suspect {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{} {:.2} (score {:.1})", self.name, self.intensity, self.score)
    }
}

/// A fault that may explain the records.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Guess {
    /// The fault: (component, fault).
    pub fault: (usize, usize),
    /// F of (FF2), or with an onset of (FO1).
    pub cost: f64,
    pub intensity: f64,
    /// When it begins, s; `None` if it precedes the records.
    pub at_s: Option<f64>,
}

impl Guess {
    /// Whether a fault with an onset is worth a fit, given the cost of one without.
    pub(super) fn is_worth(&self, constant: f64) -> bool {
        constant - self.cost > 0.5 * SCORE_LIMIT * SCORE_LIMIT
    }

    fn by_cost(&self, other: &Self) -> Ordering {
        self.cost.total_cmp(&other.cost)
    }
}

/// The best guess of a fault without an onset, and the best one with an onset.
type Guesses = (Guess, Option<Guess>);

impl Fit<'_> {
    /// The scores (FF1) of all suspects, the largest first. A fault whose twin cannot be simulated, or without an effect
    /// of its own, has the score 0.
    pub(super) fn suspects(
        &self,
        found: &Minimum,
        covariance: &Symmetric,
    ) -> Result<Vec<Suspect>, FitError> {
        let score = |name: String, step: f64, residuals: &RunResiduals| {
            let effects = residuals.iter().flat_map(|own| found.residuals.iter().zip(own));
            let effect: Vec<f64> = effects.map(|(left, own)| (left - own) / step).collect();
            let (with, square) = (dot(&effect, &found.residuals), dot(&effect, &effect));
            let along = found.linear.pull(&effect);
            // The part of the effect that tolerances leave.
            let rest = square - dot(&along, &covariance.times(&along));
            let (score, intensity) = match rest <= 1e-6 * square || square == 0.0 {
                true => (0.0, 0.0),
                false => (with / rest.sqrt(), with / rest),
            };
            Suspect { name, score, intensity, onset: None }
        };
        let jobs: Vec<_> = self.suspects.iter().map(|&fault| (fault, INTENSITY)).collect();
        let mut all = self.with_faults(&found.z, &jobs, |&(fault, _), residuals| {
            Ok(score(self.fault_name(fault), INTENSITY, residuals))
        })?;
        let (clock, _) = self.retimed(&found.z, &[FAST], on_fast_clock)?;
        all.push(score(CLOCK.into(), FAST, &clock[0]));
        let strength = |s: &Suspect| if s.name == CLOCK { s.score.abs() } else { s.score };
        all.sort_by(|a, b| strength(b).total_cmp(&strength(a)));
        Ok(all)
    }

    /// The suspects that explain the records best by (FF2). A fault that begins within the record comes before all
    /// others.
    pub(super) fn likeliest(&self) -> Result<Vec<Suspect>, FitError> {
        let linear = self.linear(&self.nominal(), DerivativeScheme::Forward)?;
        let healthy = self.explained(&linear, &linear.residuals)?;
        let suspect = |name: String, cost: f64, intensity: f64| {
            let score = (2.0 * (healthy - cost).max(0.0)).sqrt();
            Suspect { name, score, intensity, onset: None }
        };
        let moments = Moments::new(self, &linear);
        let [constant, begun] = self.likeliest_faults(&linear, moments.as_ref())?;
        let of_guess =
            |guess: &Guess| suspect(self.fault_name(guess.fault), guess.cost, guess.intensity);
        let mut all: Vec<Suspect> = constant.iter().map(of_guess).collect();
        let (cost, delay_s) = self.best_times(&linear, &DELAYS, delayed)?;
        all.push(suspect(DELAY.into(), cost, delay_s));
        let (cost, fast) = self.best_times(&linear, &CLOCKS, on_fast_clock)?;
        all.push(suspect(CLOCK.into(), cost, fast));
        all.sort_by(|a, b| b.score.total_cmp(&a.score));
        if let Some((begun, onset)) = self.begun(&constant, &begun, moments.as_ref())? {
            let intensity = *begun.minimum.z.last().expect("the fault is an unknown");
            let named = suspect(self.fault_name(begun.fault), begun.minimum.cost, intensity);
            all.retain(|other| other.name != named.name);
            all.insert(0, Suspect { onset: Some(onset), ..named });
        }
        Ok(all)
    }

    /// The fault that began within the record, if it explains the record better than any fault present from the first
    /// sample on.
    fn begun(
        &self,
        constant: &[Guess],
        begun: &[Guess],
        moments: Option<&Moments>,
    ) -> Result<Option<(Begun, FoundOnset)>, FitError> {
        let (Some(moments), Some(least)) = (moments, constant.first()) else { return Ok(None) };
        let worth: Vec<&Guess> = begun.iter().filter(|guess| guess.is_worth(least.cost)).collect();
        if worth.is_empty() {
            return Ok(None);
        }
        let mut least = f64::INFINITY;
        for guess in constant.iter().take(FITTED) {
            least = least.min(self.with_fault(guess.fault).constant()?.0.cost);
        }
        let mut best: Option<Begun> = None;
        for guess in worth {
            let own = self.with_fault(guess.fault).begins(guess, moments.reach_s())?;
            if best.as_ref().is_none_or(|best| own.minimum.cost < best.minimum.cost) {
                best = Some(own);
            }
        }
        let onset = best.as_ref().and_then(|begun| begun.onset(least));
        Ok(best.zip(onset))
    }

    /// For each fault, a first guess of its onset and the guess's error, s; `None` unless there is a single record.
    pub(super) fn onset_guesses(
        &self,
        faults: &[(usize, usize)],
    ) -> Result<Vec<Option<(Guess, f64)>>, FitError> {
        let linear = self.linear(&self.nominal(), DerivativeScheme::Forward)?;
        let Some(moments) = Moments::new(self, &linear) else {
            return Ok(vec![None; faults.len()]);
        };
        let guesses = self.guesses(&linear, Some(&moments), faults, &FINE)?;
        Ok(guesses.iter().map(|(_, begun)| Some(((*begun)?, moments.reach_s()))).collect())
    }

    /// The likeliest faults, the likeliest first: those present from the first sample on, and those that begin within
    /// the record.
    fn likeliest_faults(
        &self,
        linear: &Linear,
        moments: Option<&Moments>,
    ) -> Result<[Vec<Guess>; 2], FitError> {
        let coarse = self.guesses(linear, moments, &self.suspects, &COARSE)?;
        let mut best: [Vec<Guess>; 2] = [
            coarse.iter().map(|(constant, _)| *constant).collect(),
            coarse.iter().filter_map(|(_, begun)| *begun).collect(),
        ];
        let mut faults = vec![];
        for guesses in &mut best {
            guesses.sort_by(Guess::by_cost);
            guesses.truncate(LIKELIEST);
            let new = guesses.iter().map(|guess| guess.fault).filter(|own| !faults.contains(own));
            faults.extend(new.collect::<Vec<_>>());
        }
        let fine = self.guesses(linear, moments, &faults, &FINE)?;
        let fine: [Vec<Guess>; 2] = [
            fine.iter().map(|(constant, _)| *constant).collect(),
            fine.iter().filter_map(|(_, begun)| *begun).collect(),
        ];
        for (guesses, fine) in best.iter_mut().zip(fine) {
            for guess in guesses.iter_mut() {
                let better = |own: &&Guess| own.fault == guess.fault && own.cost < guess.cost;
                *guess = fine.iter().find(better).copied().unwrap_or(*guess);
            }
            guesses.sort_by(Guess::by_cost);
        }
        Ok(best)
    }

    /// Whether a fault explains a record with apparently wrong times equally well: a valve with low gain also follows
    /// late. Such a record is fitted and gives a finding. If a time error explains it clearly better, the times are
    /// wrong.
    pub(super) fn is_rather_a_fault(
        &self,
        record: &FitRecord,
        error: &RecordError,
    ) -> Result<bool, FitError> {
        let (size, change): (f64, fn(&FitRecord, f64) -> Retimed) = match error {
            RecordError::Shifted { by_s } => (by_s / record.period_s, delayed),
            RecordError::Clock { share } => (*share, drifting),
            _ => return Ok(false),
        };
        let own = Fit { records: vec![record.clone()], ..self.clone() };
        let linear = own.linear(&own.nominal(), DerivativeScheme::Forward)?;
        let [faults, _] = own.likeliest_faults(&linear, None)?;
        let fault = faults.first().map_or(f64::INFINITY, |guess| guess.cost);
        let (times, _) = own.best_times(&linear, &AROUND.map(|share| share * size), change)?;
        Ok(fault < CLEARLY * times)
    }

    /// The best guesses of each fault, at some intensities.
    fn guesses(
        &self,
        linear: &Linear,
        moments: Option<&Moments>,
        faults: &[(usize, usize)],
        intensities: &[f64],
    ) -> Result<Vec<Guesses>, FitError> {
        let of_fault = |&fault| intensities.iter().map(move |&intensity| (fault, intensity));
        let jobs: Vec<_> = faults.iter().flat_map(of_fault).collect();
        let all = self.with_faults(&linear.z, &jobs, |&(fault, intensity), residuals| {
            let cost = self.cost_of(linear, residuals)?;
            let constant = Guess { fault, cost, intensity, at_s: None };
            let begun = moments.zip(residuals.as_ref().ok()).map(|(moments, residuals)| {
                let (cost, at_s) = moments.least(self, residuals)?;
                Ok(Guess { cost, at_s: Some(at_s), ..constant })
            });
            Ok((constant, begun.transpose()?))
        })?;
        let best = |own: &[Guesses]| {
            let constant = own.iter().map(|(constant, _)| *constant).min_by(Guess::by_cost);
            let begun = own.iter().filter_map(|(_, begun)| *begun).min_by(Guess::by_cost);
            (constant.expect("an intensity"), begun)
        };
        Ok(all.chunks(intensities.len()).map(best).collect())
    }

    /// What the residuals around a point give with each of some faults at an intensity.
    fn with_faults<T>(
        &self,
        z: &[f64],
        jobs: &[((usize, usize), f64)],
        of: impl Fn(&((usize, usize), f64), &RunResiduals) -> Result<T, FitError>,
    ) -> Result<Vec<T>, FitError> {
        let mut all = Vec::new();
        for jobs in jobs.chunks(AT_ONCE) {
            let residuals = self.residuals_of(jobs.len(), |job, record| {
                let ((component, fault), intensity) = jobs[job];
                let mut variant = self.variant(z, &record.inputs);
                variant.faults.push(FaultAt { component, fault, intensity });
                variant
            })?;
            for (job, residuals) in jobs.iter().zip(&residuals) {
                all.push(of(job, residuals)?);
            }
        }
        Ok(all)
    }

    /// The residuals around a point of records whose times are changed by each of some sizes, with these in the unit of
    /// [`Suspect::intensity`].
    fn retimed(
        &self,
        z: &[f64],
        sizes: &[f64],
        change: fn(&FitRecord, f64) -> Retimed,
    ) -> Result<(Vec<RunResiduals>, Vec<f64>), FitError> {
        let mut residuals = vec![Ok(Vec::new()); sizes.len()];
        let mut in_units = sizes.to_vec();
        for record in &self.records {
            let mut own = Vec::new();
            for (size, shown) in sizes.iter().zip(&mut in_units) {
                let Retimed { inputs, stretch, size } = change(record, *size);
                *shown = size;
                let ensemble = self.ensemble(record);
                let ensemble = Ensemble {
                    sample_period_s: ensemble.sample_period_s * stretch,
                    duration_s: ensemble.duration_s * stretch,
                    ..ensemble
                };
                own.extend(self.run_in(&ensemble, record, 1, |_| self.variant(z, &inputs))?);
            }
            append(&mut residuals, own);
        }
        Ok((residuals, in_units))
    }

    /// The lowest (FF2) of records whose times are changed by one of the sizes, with that size.
    fn best_times(
        &self,
        linear: &Linear,
        sizes: &[f64],
        change: fn(&FitRecord, f64) -> Retimed,
    ) -> Result<(f64, f64), FitError> {
        let (residuals, in_units) = self.retimed(&linear.z, sizes, change)?;
        let mut best = (f64::INFINITY, in_units[0]);
        for (residuals, size) in residuals.iter().zip(in_units) {
            let cost = self.cost_of(linear, residuals)?;
            if cost < best.0 {
                best = (cost, size);
            }
        }
        Ok(best)
    }

    /// The cost (FF2) that the tolerances leave.
    fn explained(&self, linear: &Linear, residuals: &[f64]) -> Result<f64, FitError> {
        let curvature = linear.information.plus_diagonal(&self.priors());
        let (_, gain) = self.step(&curvature, &linear.z, &linear.pull(residuals))?;
        Ok(0.5 * dot(residuals, residuals) - gain)
    }

    /// The cost (FF2); infinite for a twin that cannot be simulated.
    fn cost_of(&self, linear: &Linear, residuals: &RunResiduals) -> Result<f64, FitError> {
        residuals.as_ref().map_or(Ok(f64::INFINITY), |residuals| self.explained(linear, residuals))
    }

    pub(super) fn fault_name(&self, (component, fault): (usize, usize)) -> String {
        let instance = &self.system.network().components[component];
        format!("{}.{}", instance.id, instance.component.faults[fault].name)
    }
}

/// A record with changed times.
struct Retimed {
    inputs: Vec<Piecewise>,
    /// The time that passes per unit of recorded time.
    stretch: f64,
    /// The size in the unit of [`Suspect::intensity`].
    size: f64,
}

/// Delays the sensors by a number of samples.
fn delayed(record: &FitRecord, samples: f64) -> Retimed {
    let by_s = samples * record.period_s;
    let later = |signal: &Piecewise| {
        let breaks = signal.breaks_s().iter().map(|b| b + by_s).collect();
        Piecewise::new(breaks, signal.pieces().to_vec()).expect("breaks still increase")
    };
    Retimed { inputs: record.inputs.iter().map(later).collect(), stretch: 1.0, size: by_s }
}

/// Simulates a record whose clock runs fast by a fraction.
fn on_fast_clock(record: &FitRecord, share: f64) -> Retimed {
    let stretch = 1.0 - share;
    Retimed { inputs: stretched(record, stretch), stretch, size: share }
}

/// Simulates sensors on a separate clock, on which they become increasingly late.
fn drifting(record: &FitRecord, share: f64) -> Retimed {
    Retimed { inputs: stretched(record, 1.0 + share), stretch: 1.0, size: share }
}

/// The inputs of a record with stretched times.
fn stretched(record: &FitRecord, stretch: f64) -> Vec<Piecewise> {
    let slower = |signal: &Piecewise| {
        let breaks = signal.breaks_s().iter().map(|b| b * stretch).collect();
        let piece = |[c0, c1, c2, c3]: &[f64; 4]| {
            [*c0, c1 / stretch, c2 / (stretch * stretch), c3 / (stretch * stretch * stretch)]
        };
        let pieces = signal.pieces().iter().map(piece).collect();
        Piecewise::new(breaks, pieces).expect("breaks still increase")
    };
    record.inputs.iter().map(slower).collect()
}
