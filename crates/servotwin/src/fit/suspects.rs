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
use super::onset::{Begun, FoundOnset, Guess, Moments};
use super::record::{FitRecord, RecordError};
use super::response::{DerivativeScheme, Linear, append, residual};
use super::solve::Minimum;
use super::{Fit, FitError};
use crate::ensemble::{Ensemble, Sink, Variant};
use servotwin_model::program::FaultAt;
use servotwin_model::signal::Piecewise;
use std::fmt;

/// Largest score that is attributed to chance among a hundred suspects, in standard deviations.
pub(crate) const SCORE_LIMIT: f64 = 5.0;
/// The intensity whose effect is compared.
pub(super) const INTENSITY: f64 = 0.2;
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
/// Number of suspects simulated together: their samples are kept in memory.
const AT_ONCE: usize = 8;

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
    /// The score (FF1); `rest` is s, the part of dᵀd that tolerances leave. A fault without an effect of its own gets
    /// score 0.
    pub(super) fn of(name: String, with: f64, square: f64, rest: f64) -> Self {
        if rest <= 1e-6 * square || square == 0.0 {
            return Suspect { name, score: 0.0, intensity: 0.0, onset: None };
        }
        Suspect { name, score: with / rest.sqrt(), intensity: with / rest, onset: None }
    }

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

impl Fit<'_> {
    /// The scores of all suspects, the largest first.
    pub(super) fn suspects(
        &self,
        found: &Minimum,
        covariance: &Symmetric,
    ) -> Result<Vec<Suspect>, FitError> {
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
            let Retimed { inputs, stretch, .. } = on_fast_clock(record, FAST);
            let ensemble = Ensemble {
                sample_period_s: record.period_s * stretch,
                duration_s: record.duration_s() * stretch,
                ..self.ensemble(record)
            };
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

    /// The suspects that explain the records best by (FF2). A fault that begins within the record comes before all
    /// others.
    pub(super) fn likeliest(&self) -> Result<Vec<Suspect>, FitError> {
        let nominal = vec![0.0; self.unknowns.len()];
        let linear = self.linear(&nominal, DerivativeScheme::Forward)?;
        let healthy = self.explained(&linear, &linear.residuals)?;
        let suspect = |name: String, (cost, intensity): (f64, f64)| {
            let score = (2.0 * (healthy - cost).max(0.0)).sqrt();
            Suspect { name, score, intensity, onset: None }
        };
        let moments = Moments::new(self, &linear);
        let faults = self.likeliest_faults(&linear, moments.as_ref())?;
        let begun = self.begun(&faults, moments.as_ref(), healthy)?;
        let faults = faults.constant.into_iter();
        let mut all: Vec<Suspect> =
            faults.map(|(at, least)| suspect(self.fault_name(at), least)).collect();
        all.push(suspect(DELAY.into(), self.retimed(&linear, &DELAYS, delayed)?));
        all.push(suspect(CLOCK.into(), self.retimed(&linear, &CLOCKS, on_fast_clock)?));
        all.sort_by(|a, b| b.score.total_cmp(&a.score));
        if let Some(begun) = begun {
            all.retain(|other| other.name != begun.name);
            all.insert(0, begun);
        }
        Ok(all)
    }

    /// The fault that began within the record, if it explains the record better than any fault present from the first
    /// sample on.
    fn begun(
        &self,
        faults: &LikelyFaults,
        moments: Option<&Moments>,
        healthy: f64,
    ) -> Result<Option<Suspect>, FitError> {
        let (Some(moments), Some(&(_, (least, _)))) = (moments, faults.constant.first()) else {
            return Ok(None);
        };
        let worth: Vec<_> =
            faults.begun.iter().filter(|(_, guess)| guess.is_worth(least)).collect();
        if worth.is_empty() {
            return Ok(None);
        }
        let mut constant = f64::INFINITY;
        for &(fault, _) in faults.constant.iter().take(FITTED) {
            constant = constant.min(self.with_fault(fault).constant()?.0.cost);
        }
        let mut best: Option<((usize, usize), Begun)> = None;
        for &&(fault, guess) in &worth {
            let own = self.with_fault(fault).begins(guess, moments.reach_s())?;
            if best.as_ref().is_none_or(|(_, best)| own.minimum.cost < best.minimum.cost) {
                best = Some((fault, own));
            }
        }
        let suspect = |(fault, begun): ((usize, usize), Begun)| {
            let onset = begun.onset(constant)?;
            let intensity = *begun.minimum.z.last().expect("the fault is an unknown");
            let score = (2.0 * (healthy - begun.minimum.cost).max(0.0)).sqrt();
            let name = self.fault_name(fault);
            Some(Suspect { name, score, intensity, onset: Some(onset) })
        };
        Ok(best.and_then(suspect))
    }

    /// For each fault, a first guess of its onset and the guess's error, s; `None` unless there is a single record.
    pub(super) fn onset_guesses(
        &self,
        faults: &[(usize, usize)],
    ) -> Result<Vec<Option<(Guess, f64)>>, FitError> {
        let own = Fit {
            unknowns: self.unknowns.clone(),
            records: self.records.clone(),
            suspects: faults.to_vec(),
            ..*self
        };
        let linear = own.linear(&vec![0.0; own.unknowns.len()], DerivativeScheme::Forward)?;
        let Some(moments) = Moments::new(&own, &linear) else {
            return Ok(vec![None; faults.len()]);
        };
        let every: Vec<usize> = (0..faults.len()).collect();
        let costs = own.costs(&linear, Some(&moments), &every, &FINE)?;
        Ok(costs.iter().map(|one| Some((one.begun?, moments.reach_s()))).collect())
    }

    /// The faults with the lowest (FF2), with cost and intensity, and those with the lowest (FO1).
    fn likeliest_faults(
        &self,
        linear: &Linear,
        moments: Option<&Moments>,
    ) -> Result<LikelyFaults, FitError> {
        let every: Vec<usize> = (0..self.suspects.len()).collect();
        let coarse = self.costs(linear, moments, &every, &COARSE)?;
        let first = |of: &dyn Fn(&Costs) -> f64| {
            let mut order = every.clone();
            order.sort_by(|&a, &b| of(&coarse[a]).total_cmp(&of(&coarse[b])));
            order.truncate(LIKELIEST);
            order
        };
        let begun = |costs: &Costs| costs.begun.map_or(f64::INFINITY, |guess| guess.cost);
        let constant = first(&|costs| costs.constant.0);
        let of_begun = if moments.is_some() { first(&begun) } else { Vec::new() };
        let further = of_begun.iter().filter(|k| !constant.contains(k));
        let fine_of: Vec<usize> = constant.iter().chain(further).copied().collect();
        let fine = self.costs(linear, moments, &fine_of, &FINE)?;
        let fine = |k: usize| {
            let place = fine_of.iter().position(|&other| other == k).expect("it was simulated");
            &fine[place]
        };
        let least = |&k: &usize| {
            let (fine, coarse) = (fine(k).constant, coarse[k].constant);
            (self.suspects[k], if fine.0 < coarse.0 { fine } else { coarse })
        };
        let guess = |&k: &usize| {
            let both = [fine(k).begun, coarse[k].begun].into_iter().flatten();
            Some((self.suspects[k], both.min_by(|a, b| a.cost.total_cmp(&b.cost))?))
        };
        let mut begun: Vec<_> = of_begun.iter().filter_map(guess).collect();
        begun.sort_by(|a, b| a.1.cost.total_cmp(&b.1.cost));
        let mut constant: Vec<Likely> = constant.iter().map(least).collect();
        constant.sort_by(|a, b| a.1.0.total_cmp(&b.1.0));
        Ok(LikelyFaults { constant, begun })
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
        let (records, unknowns) = (vec![record.clone()], self.unknowns.clone());
        let own = Fit { records, unknowns, suspects: self.suspects.clone(), ..*self };
        let linear = own.linear(&vec![0.0; own.unknowns.len()], DerivativeScheme::Forward)?;
        let faults = own.likeliest_faults(&linear, None)?.constant;
        let fault = faults.iter().map(|(_, least)| least.0).fold(f64::INFINITY, f64::min);
        let (times, _) = own.retimed(&linear, &AROUND.map(|share| share * size), change)?;
        Ok(fault < CLEARLY * times)
    }

    /// The lowest (FF2) and (FO1) of each suspect, with their intensities.
    fn costs(
        &self,
        linear: &Linear,
        moments: Option<&Moments>,
        which: &[usize],
        intensities: &[f64],
    ) -> Result<Vec<Costs>, FitError> {
        let mut all = Vec::new();
        for suspects in which.chunks(AT_ONCE) {
            let count = suspects.len() * intensities.len();
            let mut residuals = vec![Ok(Vec::new()); count];
            for record in &self.records {
                let variant = |job: usize| {
                    let (component, fault) = self.suspects[suspects[job / intensities.len()]];
                    let intensity = intensities[job % intensities.len()];
                    let mut variant = self.variant(&linear.z, &record.inputs);
                    variant.faults.push(FaultAt { component, fault, intensity });
                    variant
                };
                append(&mut residuals, self.run(record, count, variant)?);
            }
            for residuals in residuals.chunks(intensities.len()) {
                all.push(self.costs_of(linear, moments, residuals, intensities)?);
            }
        }
        Ok(all)
    }

    /// The lowest (FF2) and (FO1) of one suspect.
    fn costs_of(
        &self,
        linear: &Linear,
        moments: Option<&Moments>,
        residuals: &[Result<Vec<f64>, FitError>],
        intensities: &[f64],
    ) -> Result<Costs, FitError> {
        let costs = residuals.iter().map(|own| self.cost_of(linear, own));
        let constant = least(&costs.collect::<Result<Vec<_>, _>>()?, intensities);
        let mut begun: Option<Guess> = None;
        for (residuals, &intensity) in residuals.iter().zip(intensities) {
            let (Some(moments), Ok(residuals)) = (moments, residuals) else { continue };
            let guess = moments.least(self, residuals, intensity)?;
            if begun.is_none_or(|best| guess.cost < best.cost) {
                begun = Some(guess);
            }
        }
        Ok(Costs { constant, begun })
    }

    /// The lowest (FF2) of records whose times are changed by one of the sizes, with that size.
    fn retimed(
        &self,
        linear: &Linear,
        sizes: &[f64],
        change: fn(&FitRecord, f64) -> Retimed,
    ) -> Result<(f64, f64), FitError> {
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
                own.extend(
                    self.run_in(&ensemble, record, 1, |_| self.variant(&linear.z, &inputs))?,
                );
            }
            append(&mut residuals, own);
        }
        let costs = residuals.iter().map(|own| self.cost_of(linear, own));
        Ok(least(&costs.collect::<Result<Vec<_>, _>>()?, &in_units))
    }

    /// The cost (FF2) that the tolerances leave.
    fn explained(&self, linear: &Linear, residuals: &[f64]) -> Result<f64, FitError> {
        let curvature = linear.information.plus_diagonal(&self.priors());
        let (_, gain) = self.step(&curvature, &linear.z, &linear.pull(residuals))?;
        Ok(0.5 * dot(residuals, residuals) - gain)
    }

    /// The cost (FF2); infinite for a twin that cannot be simulated.
    fn cost_of(
        &self,
        linear: &Linear,
        residuals: &Result<Vec<f64>, FitError>,
    ) -> Result<f64, FitError> {
        residuals.as_ref().map_or(Ok(f64::INFINITY), |residuals| self.explained(linear, residuals))
    }

    pub(super) fn fault_name(&self, (component, fault): (usize, usize)) -> String {
        let instance = &self.system.network().components[component];
        format!("{}.{}", instance.id, instance.component.spec().faults[fault].name)
    }

    /// The sums of (FF1) for several variants of a record; variants that cannot be simulated contribute nothing.
    #[expect(clippy::too_many_arguments)]
    fn against<'v>(
        &self,
        record: &FitRecord,
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

/// The lowest cost, and its intensity.
fn least(costs: &[f64], intensities: &[f64]) -> (f64, f64) {
    let pairs = costs.iter().copied().zip(intensities.iter().copied());
    pairs.min_by(|a, b| a.0.total_cmp(&b.0)).expect("an intensity")
}

/// A fault with its lowest (FF2) and the intensity there.
type Likely = ((usize, usize), (f64, f64));

/// The lowest (FF2) of a suspect with its intensity, and its lowest (FO1).
struct Costs {
    constant: (f64, f64),
    begun: Option<Guess>,
}

/// The likeliest faults, the likeliest first.
struct LikelyFaults {
    /// Faults present from the first sample on.
    constant: Vec<Likely>,
    /// Faults that begin within the record.
    begun: Vec<((usize, usize), Guess)>,
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

/// The fit that suspects are compared with.
#[derive(Clone, Copy)]
struct Base<'f> {
    residuals: &'f [f64],
    linear: &'f Linear,
}

/// The sums of (FF1) for one suspect.
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
        Suspect::of(name, self.with, self.square, self.square - known)
    }
}

/// Accumulates (FF1) while samples arrive.
struct Against<'f> {
    base: Base<'f>,
    record: &'f FitRecord,
    deviations: &'f [f64],
    first: usize,
    /// The index of the next residual.
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
            let d = (left - residual(*m, *v, *deviation)) / self.step;
            self.sums.with += d * left;
            self.sums.square += d * d;
            for (sum, column) in self.sums.along.iter_mut().zip(&self.base.linear.columns) {
                *sum += d * column[self.place];
            }
            self.place += 1;
        }
    }
}
