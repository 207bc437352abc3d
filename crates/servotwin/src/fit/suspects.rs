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

use super::intensity::Diagnosed;
use super::linear::{Symmetric, dot};
use super::onset::{FoundOnset, Moments};
use super::record::FitRecord;
use super::response::{AT_ONCE, DerivativeScheme, Linear, RunResiduals, append};
use super::solve::Minimum;
use super::{Fit, FitError};
use serde::Serialize;
use servotwin_model::program::FaultAt;
use servotwin_model::signal::Piecewise;
use std::cmp::Ordering;

/// Largest score that is attributed to chance among a hundred suspects, in standard deviations.
pub(super) const SCORE_LIMIT: f64 = 5.0;
/// The intensity whose effect is compared.
const INTENSITY: f64 = 0.2;
/// The fraction by which a clock runs fast in the comparison: less time has passed than it shows.
const FAST: f64 = 0.005;
/// A smaller clock error is not a finding.
const LEAST_CLOCK: f64 = 0.001;
/// The intensities at which all suspects of a finding are simulated.
const COARSE: [f64; 4] = [0.03, 0.12, 0.35, 0.8];
/// The intensities at which the likeliest suspects are simulated.
pub(super) const FINE: [f64; 12] = [0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.85, 1.0];
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

/// A possible cause of a finding.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Suspect {
    /// The fault's full name, `clock` or `delay`.
    pub name: String,
    /// (FF1); for a finding √(2 ΔF) by (FF2), where ΔF is the reduction of F by the suspect.
    pub score: f64,
    /// The estimated intensity; for a clock the fraction by which it is fast, for a delay seconds.
    pub intensity: f64,
    /// When it began, if within the record.
    pub onset: Option<FoundOnset>,
    #[serde(skip)]
    pub(super) cause: Cause,
}

impl Suspect {
    /// Whether the score exceeds chance.
    pub(super) fn is_finding(&self) -> bool {
        match self.cause {
            Cause::Clock => self.strength() > SCORE_LIMIT && self.intensity.abs() > LEAST_CLOCK,
            _ => self.score > SCORE_LIMIT,
        }
    }

    /// The score (FF1); a clock may be fast or slow.
    fn strength(&self) -> f64 {
        if self.cause == Cause::Clock { self.score.abs() } else { self.score }
    }

    /// The suspect as a sentence.
    pub(super) fn sentence(&self) -> String {
        let Self { name, intensity, .. } = self;
        let (size, is_more) = (intensity.abs(), *intensity > 0.0);
        match (self.cause, self.onset) {
            (Cause::Fault(_), None) => {
                format!("it looks like {name} of intensity {intensity:.2} or so")
            }
            (Cause::Fault(_), Some(FoundOnset { at_s, low_s, high_s, .. })) => format!(
                "it looks like {name} of intensity {intensity:.2} from {at_s:.2} s on (95 %: {low_s:.2} … {high_s:.2} s)"
            ),
            (Cause::Delay, _) => {
                let way = if is_more { "late" } else { "early" };
                format!("the sensors seem to come {size:.4} s too {way} for the inputs")
            }
            (Cause::Clock | Cause::Drift, _) => {
                let way = if is_more { "fast" } else { "slow" };
                format!("the clock of the record seems to run {:.1} % {way}", 100.0 * size)
            }
        }
    }
}

/// What may explain a record, of some size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Cause {
    /// A fault of an intensity: (component, fault).
    Fault((usize, usize)),
    /// Sensors that come late, by a number of samples.
    Delay,
    /// A record whose clock runs fast, by a fraction.
    Clock,
    /// Sensors on a clock of their own, on which they become increasingly late, by a fraction.
    Drift,
}

impl Cause {
    /// The fault, if it is one.
    pub(super) fn fault(self) -> Option<(usize, usize)> {
        if let Cause::Fault(fault) = self { Some(fault) } else { None }
    }

    /// The inputs of a record whose times are wrong by a size, and the time that passes per unit of recorded time.
    pub(super) fn retimed(self, record: &FitRecord, size: f64) -> (Vec<Piecewise>, f64) {
        let (delay_s, input_stretch, stretch) = match self {
            Cause::Fault(_) => (0.0, 1.0, 1.0),
            Cause::Delay => (size * record.period_s, 1.0, 1.0),
            Cause::Clock => (0.0, 1.0 - size, 1.0 - size),
            Cause::Drift => (0.0, 1.0 + size, 1.0),
        };
        let s = input_stretch;
        let moved = |signal: &Piecewise| {
            let breaks = signal.breaks_s().iter().map(|time_s| time_s * s + delay_s).collect();
            let piece = |[c0, c1, c2, c3]: &[f64; 4]| [*c0, c1 / s, c2 / (s * s), c3 / (s * s * s)];
            let pieces = signal.pieces().iter().map(piece).collect();
            Piecewise::new(breaks, pieces).expect("breaks still increase")
        };
        (record.inputs.iter().map(moved).collect(), stretch)
    }
}

/// A cause of a certain size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Guess {
    pub(crate) cause: Cause,
    /// F of (FF2), or with an onset of (FO1).
    pub(crate) cost: f64,
    pub(crate) size: f64,
    /// When it begins, s; `None` if it precedes the records.
    pub(crate) at_s: Option<f64>,
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

/// The best guesses of some causes: those without an onset, and those with one, which some causes lack.
type Guesses = [Vec<Guess>; 2];

impl Fit<'_> {
    fn suspect(&self, cause: Cause, score: f64, size: f64) -> Suspect {
        let period_s = self.records.last().map_or(0.0, |record| record.period_s);
        let (name, intensity) = match cause {
            Cause::Fault(fault) => (self.fault_name(fault), size),
            Cause::Delay => ("delay".into(), size * period_s),
            Cause::Clock | Cause::Drift => ("clock".into(), size),
        };
        Suspect { name, score, intensity, onset: None, cause }
    }

    /// The scores (FF1) of all suspects, the largest first. A fault whose twin cannot be simulated, or without an effect
    /// of its own, has the score 0.
    pub(super) fn suspects(
        &self,
        found: &Minimum,
        covariance: &Symmetric,
    ) -> Result<Vec<Suspect>, FitError> {
        let score = |cause: Cause, step: f64, residuals: &RunResiduals| {
            let effects = residuals.iter().flat_map(|own| found.residuals.iter().zip(own));
            let effect: Vec<f64> = effects.map(|(left, own)| (left - own) / step).collect();
            let (with, square) = (dot(&effect, &found.residuals), dot(&effect, &effect));
            let along = found.linear.pull(&effect);
            // The part of the effect that tolerances leave.
            let rest = square - dot(&along, &covariance.times(&along));
            Ok(match rest <= 1e-6 * square || square == 0.0 {
                true => self.suspect(cause, 0.0, 0.0),
                false => self.suspect(cause, with / rest.sqrt(), with / rest),
            })
        };
        let faults = self.suspects.iter().map(|&fault| (Cause::Fault(fault), INTENSITY));
        let jobs: Vec<_> = faults.chain([(Cause::Clock, FAST)]).collect();
        let mut all = self.with_causes(&found.z, &jobs, score)?;
        all.sort_by(|a, b| b.strength().total_cmp(&a.strength()));
        Ok(all)
    }

    /// The suspects that explain the records best by (FF2). A fault that begins within the record comes before all
    /// others.
    pub(super) fn likeliest(&self) -> Result<Vec<Suspect>, FitError> {
        let linear = self.linear(&self.nominal(), DerivativeScheme::Forward)?;
        let healthy =
            self.predicted_cost(&linear, &linear.z, &Ok(linear.residuals.clone()), None)?;
        let score = |cost: f64| (2.0 * (healthy - cost).max(0.0)).sqrt();
        let moments = Moments::new(self, &linear);
        let [constant, begun] = self.likeliest_faults(&linear, moments.as_ref())?;
        let [delay, _] = self.guesses(&linear, None, &[Cause::Delay], &DELAYS)?;
        let [clock, _] = self.guesses(&linear, None, &[Cause::Clock], &CLOCKS)?;
        let guesses = constant.iter().chain(&delay).chain(&clock);
        let mut all: Vec<Suspect> =
            guesses.map(|own| self.suspect(own.cause, score(own.cost), own.size)).collect();
        all.sort_by(|a, b| b.score.total_cmp(&a.score));
        if let Some(begun) = self.begun(&constant, &begun, moments.as_ref())? {
            let cause = Cause::Fault(begun.fault);
            let named = self.suspect(cause, score(begun.cost), begun.intensity);
            all.retain(|other| other.cause != cause);
            all.insert(0, Suspect { onset: begun.onset, ..named });
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
    ) -> Result<Option<Diagnosed>, FitError> {
        let (Some(moments), Some(least)) = (moments, constant.first()) else { return Ok(None) };
        let worth: Vec<&Guess> = begun.iter().filter(|guess| guess.is_worth(least.cost)).collect();
        if worth.is_empty() {
            return Ok(None);
        }
        let mut least = f64::INFINITY;
        for fault in constant.iter().take(FITTED).filter_map(|guess| guess.cause.fault()) {
            least = least.min(self.with_fault(fault).constant()?.0.cost);
        }
        let mut best: Option<Diagnosed> = None;
        for guess in worth {
            let Cause::Fault(fault) = guess.cause else { continue };
            let own = self.begins(fault, guess, moments.reach_s(), least)?;
            if best.as_ref().is_none_or(|best| own.cost < best.cost) {
                best = Some(own);
            }
        }
        Ok(best.filter(|best| best.onset.is_some()))
    }

    /// The likeliest faults, the likeliest first.
    fn likeliest_faults(
        &self,
        linear: &Linear,
        moments: Option<&Moments>,
    ) -> Result<Guesses, FitError> {
        let all: Vec<Cause> = self.suspects.iter().copied().map(Cause::Fault).collect();
        let mut best = self.guesses(linear, moments, &all, &COARSE)?;
        let mut causes = vec![];
        for guesses in &mut best {
            guesses.sort_by(Guess::by_cost);
            guesses.truncate(LIKELIEST);
            let new = guesses.iter().map(|guess| guess.cause).filter(|own| !causes.contains(own));
            causes.extend(new.collect::<Vec<_>>());
        }
        let fine = self.guesses(linear, moments, &causes, &FINE)?;
        for (guesses, fine) in best.iter_mut().zip(fine) {
            for guess in guesses.iter_mut() {
                let better = |own: &&Guess| own.cause == guess.cause && own.cost < guess.cost;
                *guess = fine.iter().find(better).copied().unwrap_or(*guess);
            }
            guesses.sort_by(Guess::by_cost);
        }
        Ok(best)
    }

    /// Whether a fault explains a record with apparently wrong times equally well: a valve with low gain also follows
    /// late. Such a record is fitted and gives a finding. If a time error explains it clearly better, the times are
    /// wrong.
    pub(super) fn is_rather_a_fault(&self, times: Cause, size: f64) -> Result<bool, FitError> {
        let linear = self.linear(&self.nominal(), DerivativeScheme::Forward)?;
        let [faults, _] = self.likeliest_faults(&linear, None)?;
        let fault = faults.first().map_or(f64::INFINITY, |guess| guess.cost);
        let sizes = AROUND.map(|share| share * size);
        let [times, _] = self.guesses(&linear, None, &[times], &sizes)?;
        Ok(fault < CLEARLY * times[0].cost)
    }

    /// The best guesses of each cause, at some sizes; with onsets, if there are moments for them.
    pub(super) fn guesses(
        &self,
        linear: &Linear,
        moments: Option<&Moments>,
        causes: &[Cause],
        sizes: &[f64],
    ) -> Result<Guesses, FitError> {
        let of_cause = |&cause| sizes.iter().map(move |&size| (cause, size));
        let jobs: Vec<_> = causes.iter().flat_map(of_cause).collect();
        let all = self.with_causes(&linear.z, &jobs, |cause, size, residuals| {
            let cost = self.predicted_cost(linear, &linear.z, residuals, None)?;
            let constant = Guess { cause, cost, size, at_s: None };
            let begun = moments.zip(residuals.as_ref().ok()).map(|(moments, residuals)| {
                let (cost, at_s) = moments.least(self, residuals)?;
                Ok(Guess { cost, at_s: Some(at_s), ..constant })
            });
            Ok((constant, begun.transpose()?))
        })?;
        let mut best = [vec![], vec![]];
        for own in all.chunks(sizes.len()) {
            best[0].extend(own.iter().map(|(constant, _)| *constant).min_by(Guess::by_cost));
            best[1].extend(own.iter().filter_map(|(_, begun)| *begun).min_by(Guess::by_cost));
        }
        Ok(best)
    }

    /// What the residuals around a point give with each of some causes of a size.
    fn with_causes<T>(
        &self,
        z: &[f64],
        jobs: &[(Cause, f64)],
        of: impl Fn(Cause, f64, &RunResiduals) -> Result<T, FitError>,
    ) -> Result<Vec<T>, FitError> {
        let mut all = Vec::new();
        // Faults share the lanes of one ensemble; other times are other ensembles.
        let together =
            jobs.chunk_by(|one, next| one.0.fault().is_some() && next.0.fault().is_some());
        for jobs in together.flat_map(|jobs| jobs.chunks(AT_ONCE)) {
            let residuals = match jobs {
                [(cause, size)] if cause.fault().is_none() => vec![self.retimed(z, *cause, *size)?],
                _ => self.residuals_of(jobs.len(), |job, record| {
                    let mut variant = self.variant(z, &record.inputs);
                    if let (Cause::Fault((component, fault)), intensity) = jobs[job] {
                        variant.faults.push(FaultAt { component, fault, intensity });
                    }
                    variant
                })?,
            };
            for ((cause, size), residuals) in jobs.iter().zip(&residuals) {
                all.push(of(*cause, *size, residuals)?);
            }
        }
        Ok(all)
    }

    /// The residuals around a point of records whose times are wrong.
    fn retimed(&self, z: &[f64], cause: Cause, size: f64) -> Result<RunResiduals, FitError> {
        let mut all = Ok(Vec::new());
        for record in &self.records {
            let (inputs, stretch) = cause.retimed(record, size);
            let own = self.residuals_in(record, (1, stretch), |_| self.variant(z, &inputs))?;
            own.into_iter().for_each(|own| append(&mut all, own));
        }
        Ok(all)
    }

    pub(super) fn fault_name(&self, (component, fault): (usize, usize)) -> String {
        self.system.network().components[component].fault_name(fault)
    }
}
