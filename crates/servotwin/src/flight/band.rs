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
/// Rounds in which factors are fitted one after the other.
const ROUNDS: usize = 8;
/// A factor of a bin is 1 unless so many flights say otherwise: samples of one flight are of one specimen.
const DOUBT: f64 = 8.0;
/// A spool that moves less than this part of its scale in a sample stands still.
const STILL: f64 = 1e-3;

/// Something that a band depends on.
#[derive(Clone, Debug, PartialEq)]
pub struct Covariate {
    /// What it is.
    pub name: String,
    /// Where its bins meet, ascending.
    pub edges: Vec<f64>,
    /// The range that was learned from.
    pub range: (f64, f64),
}

/// What the sensors of one flight showed beside its twin.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// The covariates, sample after sample.
    pub points: Vec<f64>,
    /// The scaled residuals, sample after sample.
    pub residuals: Vec<f64>,
}

/// A band.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// What it depends on; empty for a band that is the same everywhere.
    pub covariates: Vec<Covariate>,
    /// s_i0.
    pub base: Vec<f64>,
    /// m: for each sensor and covariate one factor for each bin.
    pub factors: Vec<Vec<Vec<f64>>>,
    /// q.
    pub scale: f64,
    /// The share of healthy flights that may leave it.
    pub share: f64,
    /// n.
    pub calibrated_on: usize,
}

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

impl Field {
    /// A band for some sensors: s from the first traces, q from the others. Without covariates it is the same everywhere.
    ///
    /// # Errors
    /// Too few calibration traces for the share.
    pub fn learn(
        covariates: Vec<Covariate>,
        sensors: usize,
        learning: &[Trace],
        calibration: &[Trace],
        share: f64,
    ) -> Result<Self, BandError> {
        let flights = calibration.len();
        let place = ((flights as f64 + 1.0) * (1.0 - share) - 1e-9).ceil() as usize;
        if place > flights || place == 0 {
            let needed = (1.0 / share - 1e-9).ceil() as usize - 1;
            return Err(BandError::TooFew { flights, needed });
        }
        let factors =
            vec![covariates.iter().map(|c| vec![1.0; c.edges.len() + 1]).collect(); sensors];
        let mut field = Field {
            covariates,
            base: vec![1.0; sensors],
            factors,
            scale: 1.0,
            share,
            calibrated_on: flights,
        };
        for sensor in 0..sensors {
            field.fit(sensor, learning);
        }
        let mut scores: Vec<f64> = calibration.iter().map(|trace| field.score(trace)).collect();
        scores.sort_by(f64::total_cmp);
        field.scale = scores[place - 1];
        Ok(field)
    }

    /// s of a sensor.
    fn fit(&mut self, sensor: usize, learning: &[Trace]) {
        let (width, sensors) = (self.covariates.len(), self.base.len());
        // For each flight the bins of its samples and the squares of their residuals.
        let squares = |trace: &Trace| -> Vec<(Vec<usize>, f64)> {
            let of = |(k, residuals): (usize, &[f64])| {
                let point = trace.points.get(k * width..(k + 1) * width).unwrap_or_default();
                (self.bins(point), residuals[sensor] * residuals[sensor])
            };
            trace.residuals.chunks_exact(sensors).enumerate().map(of).collect()
        };
        let flights: Vec<Vec<(Vec<usize>, f64)>> = learning.iter().map(squares).collect();
        let count = flights.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        let mean = flights.iter().flatten().map(|(_, square)| square).sum::<f64>() / count;
        self.base[sensor] = mean.max(f64::MIN_POSITIVE).sqrt();
        for _ in 0..ROUNDS {
            for covariate in 0..width {
                let bins = self.factors[sensor][covariate].len();
                let (mut found, mut expected) = (vec![DOUBT; bins], vec![DOUBT; bins]);
                for flight in &flights {
                    let (mut own, mut samples) = (vec![0.0; bins], vec![0.0; bins]);
                    for (place, square) in flight {
                        let s = self.at_bins(sensor, place);
                        own[place[covariate]] += square / (s * s);
                        samples[place[covariate]] += 1.0;
                    }
                    for bin in (0..bins).filter(|&bin| samples[bin] > 0.0) {
                        found[bin] += own[bin] / samples[bin];
                        expected[bin] += 1.0;
                    }
                }
                for (bin, factor) in self.factors[sensor][covariate].iter_mut().enumerate() {
                    *factor *= (found[bin] / expected[bin]).sqrt();
                }
            }
        }
    }

    fn bins(&self, point: &[f64]) -> Vec<usize> {
        let bin = |(covariate, value): (&Covariate, &f64)| {
            covariate.edges.iter().take_while(|edge| value >= edge).count()
        };
        self.covariates.iter().zip(point).map(bin).collect()
    }

    fn at_bins(&self, sensor: usize, bins: &[usize]) -> f64 {
        let factors = self.factors[sensor].iter().zip(bins);
        factors.fold(self.base[sensor], |s, (factors, &bin)| s * factors[bin])
    }

    /// How large the scaled residual of a sensor may be at a point.
    pub fn half_width(&self, sensor: usize, point: &[f64]) -> f64 {
        self.scale * self.at_bins(sensor, &self.bins(point))
    }

    /// max |r|/s over a trace.
    pub fn score(&self, trace: &Trace) -> f64 {
        let (width, sensors) = (self.covariates.len(), self.base.len());
        let mut most: f64 = 0.0;
        for (k, residuals) in trace.residuals.chunks_exact(sensors).enumerate() {
            let bins = self.bins(trace.points.get(k * width..(k + 1) * width).unwrap_or_default());
            for (sensor, residual) in residuals.iter().enumerate() {
                most = most.max(residual.abs() / self.at_bins(sensor, &bins));
            }
        }
        most
    }

    /// Whether a trace leaves the band.
    pub fn is_left_by(&self, trace: &Trace) -> bool {
        self.score(trace) > self.scale
    }

    /// How far a point lies outside of what was learned from, in parts of the ranges; 0 inside.
    pub fn outside(&self, point: &[f64]) -> f64 {
        let off = |(covariate, value): (&Covariate, &f64)| {
            let (low, high) = covariate.range;
            (low - value).max(value - high).max(0.0) / (high - low).max(f64::MIN_POSITIVE)
        };
        self.covariates.iter().zip(point).map(off).fold(0.0, f64::max)
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

impl Trace {
    /// The same with some of its covariates.
    fn with_covariates(&self, kept: &[usize], width: usize) -> Trace {
        let own = self.points.chunks_exact(width.max(1));
        let points = own.flat_map(|point| kept.iter().map(|&place| point[place])).collect();
        Trace { points, residuals: self.residuals.clone() }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Flights whose residual grows with the size of what is asked, and with their specimen.
    fn flights(count: usize, seed: u64) -> Vec<Trace> {
        let mut random = Random::new(seed);
        let mut flight = |_| {
            let specimen = 1.0 + 0.2 * random.normal().abs();
            let points: Vec<f64> = (0..300).map(|_| random.unit()).collect();
            let residuals =
                points.iter().map(|u| specimen * (0.1 + u) * 0.01 * random.normal()).collect();
            Trace { points, residuals }
        };
        (0..count).map(&mut flight).collect()
    }

    fn axis() -> Vec<Covariate> {
        vec![Covariate { name: "size".into(), edges: vec![0.25, 0.5, 0.75], range: (0.0, 1.0) }]
    }

    fn none(traces: &[Trace]) -> Vec<Trace> {
        traces.iter().map(|trace| trace.with_covariates(&[], 1)).collect()
    }

    #[test]
    fn the_promised_share_leaves_the_band_and_the_field_sees_more() {
        let (learning, judged) = (flights(40, 1), flights(400, 2));
        let (mut left, mut seen, mut seen_fixed) = (0, 0, 0);
        // The promise is of the mean over calibrations: ten of them.
        for round in 0..10 {
            let calibration = flights(39, 100 + round);
            let field = Field::learn(axis(), 1, &learning, &calibration, 0.1).unwrap();
            let fixed =
                Field::learn(vec![], 1, &none(&learning), &none(&calibration), 0.1).unwrap();
            left += judged.iter().filter(|trace| field.is_left_by(trace)).count();
            // A bias that is large for small motions only.
            for trace in &judged {
                let mut faulty = trace.clone();
                faulty.residuals.iter_mut().for_each(|residual| *residual += 0.016);
                seen += usize::from(field.is_left_by(&faulty));
                let faulty = faulty.with_covariates(&[], 1);
                seen_fixed += usize::from(fixed.is_left_by(&faulty));
            }
        }
        let share = left as f64 / 4000.0;
        assert!((0.04..=0.16).contains(&share), "{share}");
        assert!(seen > seen_fixed + 200, "{seen} {seen_fixed}");
    }

    #[test]
    fn a_share_needs_flights_and_validity_ends_with_the_ranges() {
        let learning = flights(5, 1);
        let learn = |count| Field::learn(axis(), 1, &learning, &flights(count, 3), 0.05);
        assert!(matches!(learn(18), Err(BandError::TooFew { flights: 18, needed: 19 })));
        let field = learn(19).unwrap();
        // With 19 flights the band is the largest of their scores: none of them leaves it.
        assert!(flights(19, 3).iter().all(|trace| !field.is_left_by(trace)));
        assert_eq!(field.outside(&[0.5]), 0.0);
        assert!((field.outside(&[1.5]) - 0.5).abs() < 1e-12);
        assert!(field.half_width(0, &[0.9]) > 2.0 * field.half_width(0, &[0.1]));
    }
}
