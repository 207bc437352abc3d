//! The confidence band of the twin as a field over what it is asked: how much a healthy residual may be, at this
//! command and its rate, this load, these pressures, with the spool going this way.
//!
//! (CB1)  |r_i| ≤ q s_i(u),  s_i(u) = s_i0 Π_j m_ij(u_j)
//!
//! s is the root mean square of a sensor's scaled residual, which each covariate u_j multiplies by a factor for each of
//! its bins, found by fitting one after the other until their product explains all. The one number q is conformal: with
//! the n calibration flights' scores max |r_i|/s_i(u), over all sensors and samples, in ascending order, q is the
//! ⌈(n + 1)(1 − share)⌉-th. So a healthy flight that is exchangeable with them leaves the band with a probability of at
//! most `share`, whatever distribution residuals have (Vovk, Gammerman, Shafer, Algorithmic Learning in a Random
//! World, 2005). Exchangeable are flights, not samples: every calibration flight has an environment and a specimen of
//! its own, none of which s was learned from.
//!
//! [`Field::outside`] says how far a point lies outside of all that s was learned from: there nothing is promised.

pub mod field;

pub use field::{Covariate, Field, Trace};

use super::flown::{Flown, Observer};
use super::plan::{self, Flight, Purpose};
use crate::evaluation::parallel::Workers;
use crate::signal::random::Random;
use crate::study::campaign::CampaignError;
use crate::study::{Flights, Setting, Study};
use servotwin_diagnosis::features::Quantity;
use std::borrow::Cow;
use std::fmt;

/// Bins of a covariate.
const BINS: usize = 4;
/// A spool that moves less than this part of its scale in a sample stands still.
const STILL: f64 = 1e-3;

/// Why there is no band.
#[derive(Debug)]
pub enum BandError {
    /// The flights could not be simulated.
    Flights(CampaignError),
    /// Too few flights for the share that is asked for.
    TooFew {
        /// Calibration flights there are.
        flights: usize,
        /// How many are needed.
        needed: usize,
    },
}

impl fmt::Display for BandError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            BandError::Flights(error) => write!(out, "{error}"),
            BandError::TooFew { flights, needed } => write!(
                out,
                "{flights} calibration flights are too few for that share of alarms: it takes {needed}, half of the environments that are learned from"
            ),
        }
    }
}

impl std::error::Error for BandError {}

impl From<CampaignError> for BandError {
    fn from(error: CampaignError) -> Self {
        BandError::Flights(error)
    }
}

/// What the covariates of a study's flights are.
struct Covariates {
    names: Vec<String>,
    command: usize,
    spool: Option<(usize, f64)>,
    /// The other inputs.
    inputs: Vec<usize>,
    period_s: f64,
}

impl Covariates {
    fn new(study: &Study) -> Self {
        let sensors = &study.sensors.0[..study.base_sensors()];
        let spool = sensors.iter().position(|sensor| sensor.quantity == Quantity::Spool);
        let all = &study.system.network().inputs;
        let inputs: Vec<usize> = (0..all.len()).filter(|&k| k != study.command_input).collect();
        let mut names = vec!["size of the command".into(), "rate of the command".into()];
        names.push("way of the spool".into());
        names.extend(inputs.iter().map(|&input| all[input].id.clone()));
        Self {
            names,
            command: study.command_input,
            spool: spool.map(|place| (place, STILL)),
            inputs,
            period_s: study.sample_period_s,
        }
    }
}

/// Keeps the trace of a flight.
struct Tracing<'c> {
    covariates: &'c Covariates,
    scales: &'c [f64],
    command: Option<f64>,
    spool: Option<f64>,
    trace: Trace,
}

impl Observer for Tracing<'_> {
    fn sample(&mut self, _index: usize, measured: &[f64], twin: &[f64], inputs: &[f64]) {
        let Covariates { command, spool, period_s, inputs: others, .. } = self.covariates;
        let now = inputs[*command];
        let rate = (now - self.command.unwrap_or(now)).abs() / period_s;
        let way = spool.map_or(0.0, |(place, still)| {
            let position = twin[place] / self.scales[place];
            let moved = position - self.spool.unwrap_or(position);
            self.spool = Some(position);
            if moved.abs() < still { 0.0 } else { moved.signum() }
        });
        self.command = Some(now);
        self.trace.points.extend([now.abs(), rate, way]);
        self.trace.points.extend(others.iter().map(|&input| inputs[input]));
        let scaled = measured.iter().zip(twin).zip(self.scales);
        self.trace.residuals.extend(scaled.map(|((m, t), scale)| (m - t) / scale));
    }
}

/// What a band is worth.
#[derive(Clone, Debug)]
pub struct BandMerit {
    /// The field.
    pub field: Field,
    /// The band with the same promise that is the same everywhere.
    pub fixed: Field,
    /// Healthy flights that were neither learned from nor calibrated with.
    pub healthy: usize,
    /// How many of them leave the field, and the fixed band.
    pub left: [usize; 2],
    /// How many of them were flown at points outside of what was learned from.
    pub outside: usize,
    /// Flights with a fault, and how many of them leave the field, and the fixed band.
    pub faults: usize,
    /// See `faults`.
    pub detected: [usize; 2],
}

/// Learns a field and a fixed band in the flights of a study, and judges both in others. All flights count for as long as
/// those with a fault.
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
    let covariates = &Covariates::new(study);
    let flying = Flying { study, flights, setting, workers, covariates };
    let mut learned: Vec<(Flight, Trace)> = Vec::new();
    let healthy = |flight: &Flight| flight.fault.is_none();
    flying.each(Purpose::Learn, healthy, |flight, trace| learned.push((*flight, trace)))?;
    learned.sort_by_key(|(flight, _)| flight.number);
    // Half of the environments, drawn, teach s; of each of the others the first flight calibrates. Commands take turns
    // from environment to environment, and every second one would always be of the same kinds.
    let teaches = drawn_half(flights.learned.len(), flights.seed);
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
    let (axes, kept) = binned(&covariates.names, &learning);
    let sensors = study.base_sensors();
    let width = covariates.names.len();
    let slim = |traces: &[Trace]| -> Vec<Trace> {
        traces.iter().map(|trace| trace.with_covariates(&kept, width)).collect()
    };
    let (learning, calibration) = (slim(&learning), slim(&calibration));
    let field = Field::learn(axes, sensors, &learning, &calibration, share)?;
    let none = |traces: &[Trace]| -> Vec<Trace> {
        traces.iter().map(|trace| trace.with_covariates(&[], kept.len())).collect()
    };
    let fixed = Field::learn(vec![], sensors, &none(&learning), &none(&calibration), share)?;
    let mut merit = BandMerit {
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

/// Which of some things are in the half that is drawn.
fn drawn_half(count: usize, seed: u64) -> Vec<bool> {
    let mut random = Random::new(seed);
    let keys: Vec<f64> = (0..count).map(|_| random.unit()).collect();
    let before = |own: f64| keys.iter().filter(|key| **key < own).count();
    keys.iter().map(|&own| 2 * before(own) < count).collect()
}

impl BandMerit {
    fn count(&mut self, is_healthy: bool, trace: &Trace) {
        let left = [self.field.is_left_by(trace), self.fixed.is_left_by(trace)];
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

/// The covariates that vary, with bins of as many samples each, and their places.
fn binned(names: &[String], learning: &[Trace]) -> (Vec<Covariate>, Vec<usize>) {
    let (mut list, mut kept) = (Vec::new(), Vec::new());
    for (place, name) in names.iter().enumerate() {
        let all = learning.iter().flat_map(|t| t.points.iter().skip(place).step_by(names.len()));
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
        list.push(Covariate { name: name.clone(), edges, range: (low, high) });
        kept.push(place);
    }
    (list, kept)
}

/// What is flown.
struct Flying<'f> {
    study: &'f Study,
    flights: &'f Flights,
    setting: Setting,
    workers: Workers<'f>,
    covariates: &'f Covariates,
}

impl Flying<'_> {
    /// The traces of some flights of a purpose, one after the other as they end; those that fail are left out.
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
        let flown = Flown::planned(study, environments, plan, lot, setting, workers)?;
        let all = 0..flown.plan.len();
        let which: Vec<usize> = all.filter(|&n| wanted(&flown.plan[n])).collect();
        let scales: Vec<f64> = study.scales();
        let observer = |_: &Flight| Tracing {
            covariates,
            scales: &scales,
            command: None,
            spool: None,
            trace: Trace::default(),
        };
        flown.fly(&which, observer, |flight, tracing, outcome| {
            if outcome.is_ok() {
                done(flight, tracing.trace);
            }
        });
        match workers.is_cancelled() {
            true => Err(CampaignError::Cancelled),
            false => Ok(()),
        }
    }
}
