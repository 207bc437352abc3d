//! The conditional band: the largest healthy residual as a function of the operating point, i.e. command, command rate,
//! load, pressures and direction of the spool.
//!
//! (CB1)  |r_i| ≤ q s_i(u),  s_i(u) = s_i0 Π_j m_ij(u_j)
//!
//! s is the root mean square of a sensor's scaled residual. Each covariate u_j contributes a factor for each of its
//! bins; the factors are fitted one after the other, repeatedly, until their product fits. The number q is conformal.
//! Take the n calibration flights' scores max |r_i|/s_i(u) over all sensors and samples, in ascending order; q is the
//! ⌈(n + 1)(1 − share)⌉-th. A healthy flight that is exchangeable with them then leaves the band with a probability of
//! at most `share`, whatever distribution residuals have (Vovk, Gammerman, Shafer, Algorithmic Learning in a Random
//! World, 2005). Flights are exchangeable, samples are not. Every calibration flight has a separate environment and
//! specimen, neither of which was used to learn s. They are drawn as the judged ones are: from the same ranges, over the
//! same duration, and also if they begin without a steady state. Only one judged flight of an environment is independent
//! of all others, so the measured share counts one of each.
//!
//! The share of one calibration is random: its coverage has the distribution Beta(k, n + 1 − k) for the k-th of n scores.
//!
//! [`ConditionalBand::outside`] returns how far a point lies outside the range that learning and calibration flights
//! have covered. Outside, nothing like it was flown.
//!
//! A diagnoser with a conditional band ([`Diagnoser::conditional_band`]) uses it instead of its fixed bands.

mod learn;
mod picture;

pub use learn::{Coverage, Trace, coverage, learn};

use crate::parallel::Workers;
use crate::run::runner::{Runner, batches};
use crate::run::{CampaignError, Observer, Run, plan};
use crate::study::suites::{HARD_NEGATIVES, HEALTHY, JUDGE, LEARN};
use crate::study::{Scenario, Stream, Study, Suite};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::conditional_band::{
    ConditionalBand, Covariate, CovariateSample, CovariateSource,
};
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_diagnosis::error::Error;
use servotwin_diagnosis::features::Quantity;
use std::collections::{BTreeMap, BTreeSet};

/// Most environments that learn and calibrate: beyond them, the traces would take gigabytes.
const MAX_ENVIRONMENTS: usize = 1000;

/// Number of bins of a covariate.
const BINS: usize = 4;

/// Why a band cannot be learned.
#[derive(Debug, thiserror::Error)]
pub enum BandError {
    /// The flights could not be simulated.
    #[error(transparent)]
    Flights(#[from] CampaignError),
    /// There are too few flights for the requested share.
    #[error(
        "{flights} calibration flights are too few for that share of alarms: it takes {needed}, half of the \
         environments that are learned from"
    )]
    TooFew {
        /// Number of calibration flights.
        flights: usize,
        /// Number of required flights.
        needed: usize,
    },
}

/// The covariates of a study's flights, with their names.
fn covariates(study: &Study) -> Vec<(String, CovariateSource)> {
    let sensors = &study.sensors.0[..study.base_sensors()];
    let all = &study.system.network().inputs;
    let command = study.command_input as u32;
    let mut list = vec![
        ("size of the command".into(), CovariateSource::Size { input: command }),
        ("rate of the command".into(), CovariateSource::Rate { input: command }),
    ];
    if let Some(spool) = sensors.iter().position(|sensor| sensor.quantity == Quantity::Spool) {
        list.push(("way of the spool".into(), CovariateSource::Way { sensor: spool as u32 }));
    }
    let others = (0..all.len()).filter(|&input| input != study.command_input);
    list.extend(others.map(|k| (all[k].id.clone(), CovariateSource::Input { input: k as u32 })));
    list
}

/// Records the trace of a flight.
struct Tracing<'c> {
    covariates: &'c [(String, CovariateSource)],
    scales: &'c [f64],
    period_s: f64,
    last: Vec<Option<f64>>,
    trace: Trace,
}

impl Observer for Tracing<'_> {
    fn sample(&mut self, _index: usize, measured: &[f64], twin: &[f64], inputs: &[f64]) {
        let sample = CovariateSample { inputs, twin, scales: self.scales, period_s: self.period_s };
        let point = self.covariates.iter().zip(&mut self.last);
        self.trace.points.extend(point.map(|((_, source), last)| source.value(last, &sample)));
        let scaled = measured.iter().zip(twin).zip(self.scales);
        self.trace.residuals.extend(scaled.map(|((m, t), scale)| (m - t) / scale));
    }
}

/// A conditional band with its performance; stored as JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BandMerit {
    /// The scenario in which it was learned.
    pub scenario: String,
    /// The sensors, in the order of the band.
    pub sensors: Vec<String>,
    /// Duration of the flights, s.
    pub duration_s: f64,
    /// The conditional band.
    pub field: ConditionalBand,
    /// A constant band with the same guarantee.
    pub fixed: ConditionalBand,
    /// Number of healthy flights used for neither learning nor calibration.
    pub healthy: usize,
    /// How many of these leave the conditional band, and the constant band.
    pub left: [usize; 2],
    /// How many of these reach points outside the learned range.
    pub outside: usize,
    /// Number of flights with a fault.
    pub faults: usize,
    /// How many of these leave the conditional band, and the constant band.
    pub detected: [usize; 2],
    /// The first healthy flight of each judged environment.
    pub independent: IndependentFlights,
}

/// Healthy judged flights with an environment and a specimen of their own, which are exchangeable with the calibration
/// flights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IndependentFlights {
    /// Number of flights.
    pub flights: usize,
    /// How many leave the conditional band, and the constant band.
    pub left: [usize; 2],
    /// How many reach points outside the learned range.
    pub outside: usize,
}

/// Learns a conditional and a constant band in the flights of a study, and tests both in others. All flights are
/// evaluated for the duration of those with a fault.
///
/// # Errors
/// The flights cannot be simulated, or there are too few.
pub fn measure(
    (study, is_full): (&Study, bool),
    scenario: Scenario,
    share: f64,
    more_judged: usize,
    workers: Workers,
) -> Result<BandMerit, BandError> {
    let covariates = &covariates(study);
    let duration_s = study.flights.as_ref().map_or(0.0, |flights| flights.duration_s);
    let flying = Flying { study, duration_s, scenario, workers, covariates };
    let (learning, calibration) = flying.learning_and_calibration(is_full)?;
    let (axes, kept) = binned(covariates, &learning, &calibration);
    let sensors = study.base_sensors();
    let width = covariates.len();
    let slim = |traces: &[Trace]| -> Vec<Trace> {
        traces.iter().map(|trace| trace.with_covariates(&kept, width)).collect()
    };
    let (learning, calibration) = (slim(&learning), slim(&calibration));
    let field = learn(axes, sensors, &learning, &calibration, share)?;
    let none = |traces: &[Trace]| -> Vec<Trace> {
        traces.iter().map(|trace| trace.with_covariates(&[], kept.len())).collect()
    };
    let fixed = learn(vec![], sensors, &none(&learning), &none(&calibration), share)?;
    let mut merit = BandMerit {
        scenario: scenario.name().into(),
        sensors: study.sensors.0[..sensors].iter().map(|sensor| sensor.name.clone()).collect(),
        duration_s,
        field,
        fixed,
        healthy: 0,
        left: [0; 2],
        outside: 0,
        faults: 0,
        detected: [0; 2],
        independent: IndependentFlights::default(),
    };
    for (name, environments) in [(JUDGE, None), (HEALTHY, Some(more_judged))] {
        let Some(suite) = study.suite(name, is_full) else { continue };
        let suite = suite.clone().with_environments(environments.unwrap_or(suite.environments));
        let first = first_healthy(&plan::runs(study, &suite, &(0..suite.environments)));
        flying.each(&suite, &|_| true, &mut |run, trace, _| {
            let is_first = first.contains(&run.number);
            merit.count(run.fault.is_none(), is_first, &trace.with_covariates(&kept, width));
        })?;
    }
    Ok(merit)
}

/// The number of the first healthy run of each environment.
fn first_healthy(runs: &[Run]) -> BTreeSet<usize> {
    let mut first = BTreeMap::new();
    for run in runs.iter().filter(|run| run.fault.is_none()) {
        first.entry(run.environment).or_insert(run.number);
    }
    first.into_values().collect()
}

/// Draws a random half of the environments of a suite.
fn drawn_half(suite: &Suite, count: usize) -> Vec<bool> {
    let key = |number| suite.seed_of_environment(number).choices(Stream::Pool).next_u64();
    let keys: Vec<u64> = (0..count).map(key).collect();
    let before = |own: u64| keys.iter().filter(|key| **key < own).count();
    keys.iter().map(|&own| 2 * before(own) < count).collect()
}

impl BandMerit {
    /// The diagnoser with the conditional band instead of its fixed bands.
    ///
    /// # Errors
    /// The band has other sensors or inputs.
    pub fn put_into(&self, mut diagnoser: Diagnoser) -> Result<Diagnoser, Error> {
        let watched = diagnoser.sensors.iter().take(diagnoser.watched());
        if !watched.map(|sensor| &sensor.name).eq(&self.sensors) {
            return Err(Error::CorruptModel { broken: "the field is of other sensors" });
        }
        diagnoser.conditional_band = Some(self.field.clone());
        diagnoser.check()?;
        Ok(diagnoser)
    }

    fn count(&mut self, is_healthy: bool, is_independent: bool, trace: &Trace) {
        let left = [trace.leaves(&self.field), trace.leaves(&self.fixed)];
        let (all, counted) = match is_healthy {
            true => (&mut self.healthy, &mut self.left),
            false => (&mut self.faults, &mut self.detected),
        };
        *all += 1;
        counted.iter_mut().zip(left).for_each(|(count, left)| *count += usize::from(left));
        if !is_healthy {
            return;
        }
        let mut points = trace.points.chunks_exact(self.field.covariates.len().max(1));
        let is_outside = points.any(|point| self.field.outside(point) > 0.0);
        self.outside += usize::from(is_outside);
        if is_independent {
            let own = &mut self.independent;
            own.flights += 1;
            own.left.iter_mut().zip(left).for_each(|(count, left)| *count += usize::from(left));
            own.outside += usize::from(is_outside);
        }
    }
}

/// The covariates that vary, with bins of equal sample counts in the learning flights, and their indices. Their ranges
/// are those of learning and calibration flights together.
fn binned(
    all: &[(String, CovariateSource)],
    learning: &[Trace],
    calibration: &[Trace],
) -> (Vec<Covariate>, Vec<usize>) {
    let (mut list, mut kept) = (Vec::new(), Vec::new());
    let width = all.len();
    for (place, &(ref name, source)) in all.iter().enumerate() {
        let of = |t: &'_ Trace| t.points.iter().skip(place).step_by(width).copied().collect();
        let mut values: Vec<f64> = learning.iter().flat_map(|t| -> Vec<f64> { of(t) }).collect();
        values.sort_by(f64::total_cmp);
        let (Some(&low), Some(&high)) = (values.first(), values.last()) else { continue };
        if low == high {
            continue;
        }
        let at = |part: usize| values[part * (values.len() - 1) / BINS];
        let mut edges: Vec<f64> = (1..BINS).map(at).filter(|edge| *edge > low).collect();
        edges.dedup();
        if values.iter().all(|value| [-1.0, 0.0, 1.0].contains(value)) {
            edges = vec![-0.5, 0.5];
        }
        let more = calibration.iter().flat_map(|t| -> Vec<f64> { of(t) });
        let range = more.fold((low, high), |(low, high), value| (low.min(value), high.max(value)));
        list.push(Covariate { name: name.clone(), source, edges, range });
        kept.push(place);
    }
    (list, kept)
}

/// The parameters of the flights to simulate.
struct Flying<'f> {
    study: &'f Study,
    duration_s: f64,
    scenario: Scenario,
    workers: Workers<'f>,
    covariates: &'f [(String, CovariateSource)],
}

impl Flying<'_> {
    /// The traces of two halves of the environments that training flies: all healthy flights of one half, and the first of
    /// each environment of the other. Halves are drawn, because commands alternate between environments: every second one
    /// would always have the same kinds of command.
    fn learning_and_calibration(
        &self,
        is_full: bool,
    ) -> Result<(Vec<Trace>, Vec<Trace>), CampaignError> {
        let (mut learning, mut calibration) = (vec![], vec![]);
        let mut left = MAX_ENVIRONMENTS;
        for name in [LEARN, HARD_NEGATIVES] {
            let Some(suite) = self.study.suite(name, is_full) else { continue };
            let count = suite.environments.min(left);
            left -= count;
            let teaches = drawn_half(suite, count);
            let first = first_healthy(&plan::runs(self.study, suite, &(0..count)));
            let is_chosen = |run: &Run| {
                let is_known = run.fault.is_none() && run.environment < count;
                is_known && (teaches[run.environment] || first.contains(&run.number))
            };
            let mut flown: Vec<(Run, Trace)> = vec![];
            self.each(suite, &is_chosen, &mut |run, trace, began_on_the_move| {
                // Calibration flights are what judged ones are, so they may begin on the move.
                if !(teaches[run.environment] && began_on_the_move) {
                    flown.push((*run, trace));
                }
            })?;
            flown.sort_by_key(|(run, _)| run.number);
            for (run, trace) in flown {
                let half = if teaches[run.environment] { &mut learning } else { &mut calibration };
                half.push(trace);
            }
        }
        Ok((learning, calibration))
    }

    /// Passes the traces of chosen runs to `done` as they end, each with whether it began without a steady state. Failed
    /// runs are left out.
    fn each(
        &self,
        suite: &Suite,
        is_chosen: &dyn Fn(&Run) -> bool,
        done: &mut (dyn FnMut(&Run, Trace, bool) + Send),
    ) -> Result<(), CampaignError> {
        let Flying { study, duration_s, scenario, workers, covariates } = *self;
        let scales: Vec<f64> = study.scales();
        let observer = |_: &Run| Tracing {
            covariates,
            scales: &scales,
            period_s: study.sample_period_s,
            last: vec![None; covariates.len()],
            trace: Trace::default(),
        };
        for environments in batches(study, suite, 0) {
            let mut runs = plan::runs(study, suite, &environments);
            runs.retain(is_chosen);
            for run in &mut runs {
                run.duration_s = run.duration_s.min(duration_s);
            }
            let chosen = (environments, runs);
            let flown = Runner::of_runs(study, suite, (scenario, None), chosen, workers)?;
            flown.fly(observer, |run, tracing, outcome| {
                if let Ok(work) = outcome {
                    done(run, tracing.trace, flown.is_on_the_move(run, work));
                }
            });
            if workers.is_cancelled() {
                return Err(CampaignError::Cancelled);
            }
        }
        Ok(())
    }
}
