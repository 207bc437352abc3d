//! The conditional band: the allowed healthy residual as a function of command, command rate, load, pressures and spool
//! direction.
//!
//! (CB1)  |r_i| ≤ q s_i(u),  s_i(u) = s_i0 Π_j m_ij(u_j)
//!
//! s_i0 is the root mean square of a sensor's scaled residual. Each covariate u_j multiplies it by one factor per bin;
//! the factors are fitted in turn. The number q is conformal. Each of n calibration flights has the score max
//! |r_i|/s_i(u) over all sensors and samples. q is the ⌈(n + 1)(1 − share)⌉-th of these scores in ascending order. A
//! healthy flight that is exchangeable with them therefore leaves the band with a probability of at most `share`, for
//! any distribution of residuals (Vovk, Gammerman, Shafer, Algorithmic Learning in a Random World, 2005). Flights are
//! exchangeable, samples are not: every calibration flight has its own environment and specimen, and s was not learned
//! from them.
//!
//! [`ConditionalBand::outside`] returns how far a point lies outside the training range of s. There the guarantee does
//! not hold.
//!
//! A diagnoser with a conditional band ([`Diagnoser::conditional_band`]) uses it instead of its fixed bands.

mod learn;
mod picture;

pub use learn::{Trace, learn, share_of_calibration};

use super::campaign::{FlightCampaign, Observer};
use super::plan::{self, Flight, Purpose};
use crate::campaign::CampaignError;
use crate::parallel::Workers;
use crate::signal::random::Random;
use crate::study::{Flights, Setting, Study};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::conditional_band::{ConditionalBand, Covariate, Sample, Source};
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_diagnosis::error::Error;
use servotwin_diagnosis::features::Quantity;
use servotwin_model::solver::Statistics;
use std::borrow::Cow;

/// Number of bins of a covariate.
const BINS: usize = 4;

/// Why a band cannot be learned.
#[derive(Debug, thiserror::Error)]
pub enum BandError {
    /// The flights could not be simulated.
    #[error(transparent)]
    Flights(#[from] CampaignError),
    /// Too few calibration flights for the requested share.
    #[error(
        "{flights} calibration flights are too few for that share of alarms: it takes {needed}, half of the \
         environments that are learned from"
    )]
    TooFew {
        /// Number of calibration flights.
        flights: usize,
        /// Number of flights needed.
        needed: usize,
    },
}

/// The candidate covariates of a study's flights, with their names.
fn covariates(study: &Study) -> Vec<(String, Source)> {
    let sensors = &study.sensors.0[..study.base_sensors()];
    let all = &study.system.network().inputs;
    let command = study.command_input as u32;
    let mut list = vec![
        ("size of the command".into(), Source::Size { input: command }),
        ("rate of the command".into(), Source::Rate { input: command }),
    ];
    if let Some(spool) = sensors.iter().position(|sensor| sensor.quantity == Quantity::Spool) {
        list.push(("way of the spool".into(), Source::Way { sensor: spool as u32 }));
    }
    let others = (0..all.len()).filter(|&input| input != study.command_input);
    list.extend(others.map(|k| (all[k].id.clone(), Source::Input { input: k as u32 })));
    list
}

/// Records the trace of a flight.
struct Tracing<'c> {
    covariates: &'c [(String, Source)],
    scales: &'c [f64],
    period_s: f64,
    last: Vec<Option<f64>>,
    trace: Trace,
}

impl Observer for Tracing<'_> {
    fn sample(&mut self, _index: usize, measured: &[f64], twin: &[f64], inputs: &[f64]) {
        let sample = Sample { inputs, twin, scales: self.scales, period_s: self.period_s };
        let point = self.covariates.iter().zip(&mut self.last);
        self.trace.points.extend(point.map(|((_, source), last)| source.value(last, &sample)));
        let scaled = measured.iter().zip(twin).zip(self.scales);
        self.trace.residuals.extend(scaled.map(|((m, t), scale)| (m - t) / scale));
    }
}

/// A conditional band with its evaluation; stored as JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BandMerit {
    /// The scenario in which it was learned.
    pub setting: String,
    /// The sensors, in the order of the band.
    pub sensors: Vec<String>,
    /// Duration of the flights, s.
    pub duration_s: f64,
    /// The conditional band.
    pub field: ConditionalBand,
    /// A constant band with the same guarantee.
    pub fixed: ConditionalBand,
    /// Number of healthy judged flights.
    pub healthy: usize,
    /// How many of them leave the conditional band and the fixed band.
    pub left: [usize; 2],
    /// How many of them reach points outside the training range.
    pub outside: usize,
    /// Number of judged flights with a fault.
    pub faults: usize,
    /// How many of the faulty flights leave the conditional band and the fixed band.
    pub detected: [usize; 2],
}

/// Learns a conditional band and a fixed band from the training flights, and evaluates both on the judged flights. All
/// flights are cut to the duration of the flights with a fault.
///
/// # Errors
/// The flights cannot be simulated, or are too few.
pub fn measure(
    study: &Study,
    flights: &Flights,
    setting: Setting,
    share: f64,
    workers: Workers,
) -> Result<BandMerit, BandError> {
    let covariates = &covariates(study);
    let flying = Flying { study, flights, setting, workers, covariates };
    let mut learned: Vec<(Flight, Trace)> = Vec::new();
    let usual = flights.learn.environments;
    let healthy = |flight: &Flight| flight.fault.is_none() && flight.environment < usual;
    flying.each(Purpose::Learn, healthy, |flight, trace| learned.push((*flight, trace)))?;
    learned.sort_by_key(|(flight, _)| flight.number);
    // A random half of the environments trains s; the first flight in each other environment calibrates. The half is
    // random because kinds of commands alternate between environments.
    let teaches = drawn_half(usual, flights.seed);
    let mut seen = Vec::new();
    let (mut learning, mut calibration) = (Vec::new(), Vec::new());
    for (flight, trace) in learned {
        if teaches[flight.environment] {
            learning.push(trace);
        } else if !seen.contains(&flight.environment) {
            seen.push(flight.environment);
            calibration.push(trace);
        }
    }
    let (axes, kept) = binned(covariates, &learning);
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
        setting: setting.name().into(),
        sensors: study.sensors.0[..sensors].iter().map(|sensor| sensor.name.clone()).collect(),
        duration_s: flights.duration_s,
        field,
        fixed,
        healthy: 0,
        left: [0; 2],
        outside: 0,
        faults: 0,
        detected: [0; 2],
    };
    flying.each(
        Purpose::Judge,
        |_| true,
        |flight, trace| {
            merit.count(flight.fault.is_none(), &trace.with_covariates(&kept, width));
        },
    )?;
    Ok(merit)
}

/// Selects a random half of `count` items.
fn drawn_half(count: usize, seed: u64) -> Vec<bool> {
    let mut random = Random::new(seed);
    let keys: Vec<f64> = (0..count).map(|_| random.unit()).collect();
    let before = |own: f64| keys.iter().filter(|key| **key < own).count();
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

    fn count(&mut self, is_healthy: bool, trace: &Trace) {
        let left = [trace.leaves(&self.field), trace.leaves(&self.fixed)];
        let (all, counted) = match is_healthy {
            true => (&mut self.healthy, &mut self.left),
            false => (&mut self.faults, &mut self.detected),
        };
        *all += 1;
        counted.iter_mut().zip(left).for_each(|(count, left)| *count += usize::from(left));
        if is_healthy {
            let mut points = trace.points.chunks_exact(self.field.covariates.len().max(1));
            self.outside += usize::from(points.any(|point| self.field.outside(point) > 0.0));
        }
    }
}

/// The covariates that vary, with bins of about equal sample counts, and their indices.
fn binned(all: &[(String, Source)], learning: &[Trace]) -> (Vec<Covariate>, Vec<usize>) {
    let (mut list, mut kept) = (Vec::new(), Vec::new());
    let width = all.len();
    for (place, &(ref name, source)) in all.iter().enumerate() {
        let all = learning.iter().flat_map(|t| t.points.iter().skip(place).step_by(width));
        let mut values: Vec<f64> = all.copied().collect();
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
        list.push(Covariate { name: name.clone(), source, edges, range: (low, high) });
        kept.push(place);
    }
    (list, kept)
}

/// The flights to simulate.
struct Flying<'f> {
    study: &'f Study,
    flights: &'f Flights,
    setting: Setting,
    workers: Workers<'f>,
    covariates: &'f [(String, Source)],
}

impl Flying<'_> {
    /// Passes the trace of each selected flight to `done` as the flight ends; failed flights are left out.
    fn each(
        &self,
        purpose: Purpose,
        wanted: impl Fn(&Flight) -> bool,
        mut done: impl FnMut(&Flight, Trace) + Send,
    ) -> Result<(), CampaignError> {
        let Flying { study, flights, setting, workers, covariates } = *self;
        let environments = Cow::Borrowed(purpose.environments(flights));
        let mut plan = plan::flights(study, flights, purpose);
        for flight in &mut plan {
            flight.duration_s = flight.duration_s.min(flights.duration_s);
        }
        let lot = (purpose, flights.seed);
        let flown = FlightCampaign::planned(study, environments, plan, lot, setting, workers)?;
        let all = 0..flown.plan.len();
        let which: Vec<usize> = all.filter(|&n| wanted(&flown.plan[n])).collect();
        let scales: Vec<f64> = study.scales();
        let observer = |_: &Flight| Tracing {
            covariates,
            scales: &scales,
            period_s: study.sample_period_s,
            last: vec![None; covariates.len()],
            trace: Trace::default(),
        };
        flown.fly(&which, observer, |flight, tracing, outcome| {
            // Flights that began without a steady state are judged, but not used for training.
            let teaches = |work: &Statistics| !flown.is_on_the_move(flight, work);
            if outcome.is_ok_and(|work| purpose != Purpose::Learn || teaches(&work)) {
                done(flight, tracing.trace);
            }
        });
        match workers.is_cancelled() {
            true => Err(CampaignError::Cancelled),
            false => Ok(()),
        }
    }
}
