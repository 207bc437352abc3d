//! The flights of one tail number: each fitted and diagnosed, the intensity of what is at fault tracked from the
//! first flight to the last, and parameters that drift inside of their tolerances.
//!
//! Every flight is first fitted with tolerances only. Where that leaves findings, the likeliest three suspects of the
//! latest such flights are compared by their likelihood ([`super::intensity`]); what remains is tracked: its intensity
//! is estimated beside the tolerances in every flight, also in those in which nobody would have noticed it. A
//! trend ([`super::trend`]) says when a threshold is reached. A repair ([`super::repair`]) ends one wear and begins
//! another: the trend is that of the flights since the last one.

use super::intensity::intensity;
use super::repair::{Repair, repairs};
use super::suspects::SCORE_LIMIT;
use super::trend::{Point, Trend};
use super::{Fit, FitError, FitResults, Knowledge, Record, RecordError};

/// How many of the latest flights with findings say what is tracked.
const LATEST: usize = 5;
/// How many suspects of each are compared.
const COMPARED: usize = 3;
/// What is less probable, on the mean of these flights, is not tracked.
const PROBABLE: f64 = 0.1;
/// A parameter drifts where its rate is so many times its standard error: among a hundred of them chance has none.
const DRIFTS: f64 = 5.0;

/// One flight.
#[derive(Clone, Debug)]
pub struct Flight {
    /// The log.
    pub name: String,
    /// What its fit gave.
    pub fitted: Result<FitResults, FitError>,
}

impl Flight {
    /// Whether nothing was found that tolerances do not explain.
    pub fn is_healthy(&self) -> bool {
        self.fitted.as_ref().is_ok_and(FitResults::is_update)
    }
}

/// A fault that is followed over the flights.
#[derive(Clone, Debug)]
pub struct Track {
    /// Its full name.
    pub name: String,
    /// Its share among those that were compared; 1 where it was asked for.
    pub probability: f64,
    /// Its intensity in each flight that can be used, flights counted from zero.
    pub points: Vec<Point>,
    /// The repairs among them, in the order of time.
    pub repairs: Vec<Repair>,
    /// How it goes on since the last confirmed repair; `None` for too few flights.
    pub trend: Option<Trend>,
}

impl Track {
    /// A track with its repairs and the trend since the last one.
    fn new(name: String, probability: f64, points: Vec<Point>) -> Self {
        let repairs = repairs(&points);
        let confirmed = repairs.iter().rev().find(|one| one.is_confirmed);
        let start = confirmed.map_or(0, |one| one.place);
        // A fall that only the last flight shows may be a bad fit: the wear before it is the safe side.
        let end =
            repairs.last().filter(|one| !one.is_confirmed).map_or(points.len(), |one| one.place);
        let trend = Trend::of(&points[start..end]);
        Track { name, probability, points, repairs, trend }
    }

    /// The last repair that a second flight confirms.
    pub fn last_repair(&self) -> Option<&Repair> {
        self.repairs.iter().rev().find(|one| one.is_confirmed)
    }

    /// The fall that only the last flight shows.
    pub fn unconfirmed(&self) -> Option<&Repair> {
        self.repairs.last().filter(|one| !one.is_confirmed)
    }
}

/// A parameter that changes inside of its tolerance, in standard deviations of that.
#[derive(Clone, Debug)]
pub struct Drift {
    /// Its place among the unknowns.
    pub unknown: usize,
    /// How it goes on.
    pub trend: Trend,
}

/// All flights.
#[derive(Clone, Debug)]
pub struct History {
    /// In their order.
    pub flights: Vec<Flight>,
    /// What is tracked, the likeliest first.
    pub tracks: Vec<Track>,
    /// The parameters that drift.
    pub drifts: Vec<Drift>,
}

/// A fault, and its mean probability among those that were compared.
type Suspected = ((usize, usize), f64);

/// A log's name, and its record if it is one.
pub type Log = (String, Result<Record, RecordError>);

impl Fit<'_> {
    /// The history of some logs in the order in which they were flown; the problem's own records are not used. Without
    /// `faults` what is tracked comes from the findings.
    ///
    /// # Errors
    /// It was stopped, or there is nothing to estimate. What is wrong with a single flight stands there.
    pub fn history(&self, logs: Vec<Log>, faults: &[(usize, usize)]) -> Result<History, FitError> {
        let mut flights = Vec::new();
        for (name, record) in &logs {
            let fitted = match record {
                Ok(record) => unless_stopped(self.of_flight(record).solve())?,
                Err(error) => Err(FitError::Record { name: name.clone(), error: error.clone() }),
            };
            flights.push(Flight { name: name.clone(), fitted });
        }
        let chosen = match faults.is_empty() {
            true => self.suspected(&logs, &flights)?,
            false => faults.iter().map(|&fault| (fault, 1.0)).collect(),
        };
        let mut tracks = Vec::new();
        for (fault, probability) in chosen {
            tracks.push(self.track(&logs, &flights, fault, probability)?);
        }
        // Parts that were replaced have tolerances of their own.
        let since = tracks.iter().filter_map(|track: &Track| Some(track.last_repair()?.at));
        let since = since.fold(0.0, f64::max);
        let drifts = (0..self.unknowns.len()).filter_map(|unknown| drift(&flights, unknown, since));
        Ok(History { tracks, drifts: drifts.collect(), flights })
    }

    /// The same problem for one flight.
    fn of_flight(&self, record: &Record) -> Self {
        Fit {
            unknowns: self.unknowns.clone(),
            records: vec![record.clone()],
            suspects: self.suspects.clone(),
            ..*self
        }
    }

    /// What the latest flights with findings look like, with the mean of their probabilities.
    fn suspected(&self, logs: &[Log], flights: &[Flight]) -> Result<Vec<Suspected>, FitError> {
        let found = |flight: &Flight| flight.fitted.is_ok() && !flight.is_healthy();
        let latest = (0..flights.len()).rev().filter(|&n| found(&flights[n])).take(LATEST);
        let (mut sums, mut of) = (Vec::<Suspected>::new(), 0.0);
        for number in latest {
            let (Ok(record), Ok(fitted)) = (&logs[number].1, &flights[number].fitted) else {
                continue;
            };
            let likely = fitted.suspects.iter().filter(|suspect| suspect.score > SCORE_LIMIT);
            // A clock or a delay is no fault.
            let faults = likely.filter_map(|s| self.system.program.find_fault(&s.name));
            let candidates: Vec<(usize, usize)> = faults.take(COMPARED).collect();
            if candidates.is_empty() {
                continue;
            }
            let own = Fit { suspects: Vec::new(), ..self.of_flight(record) };
            let Ok(compared) = unless_stopped(intensity(&own, &candidates))? else { continue };
            of += 1.0;
            for one in compared {
                match sums.iter_mut().find(|(fault, _)| *fault == one.fault) {
                    Some((_, sum)) => *sum += one.probability,
                    None => sums.push((one.fault, one.probability)),
                }
            }
        }
        sums.sort_by(|a, b| b.1.total_cmp(&a.1));
        let means = sums.into_iter().map(|(fault, sum)| (fault, sum / of));
        Ok(means.filter(|(_, share)| *share >= PROBABLE).take(COMPARED).collect())
    }

    /// The intensity of a fault in every flight that can be used.
    fn track(
        &self,
        logs: &[Log],
        flights: &[Flight],
        fault: (usize, usize),
        probability: f64,
    ) -> Result<Track, FitError> {
        let mut points = Vec::new();
        for (number, (log, flight)) in logs.iter().zip(flights).enumerate() {
            let (Ok(record), Ok(_)) = (&log.1, &flight.fitted) else { continue };
            let own = Fit { suspects: Vec::new(), ..self.of_flight(record) };
            let Ok(found) = unless_stopped(intensity(&own, &[fault]))? else { continue };
            let (level, error) = (found[0].intensity, found[0].error);
            points.push(Point { at: number as f64, level, error });
        }
        Ok(Track::new(self.fault_name(fault), probability, points))
    }
}

/// A flight that cannot be fitted has an error of its own; one that was stopped ends all.
fn unless_stopped<T>(result: Result<T, FitError>) -> Result<Result<T, FitError>, FitError> {
    match result {
        Err(error @ (FitError::Cancelled | FitError::NoUnknown)) => Err(error),
        other => Ok(other),
    }
}

/// Whether a parameter drifts over the flights from one on in which it was updated.
fn drift(flights: &[Flight], unknown: usize, since: f64) -> Option<Drift> {
    let later = flights.iter().enumerate().filter(|(number, _)| *number as f64 >= since);
    let updates = later.filter(|(_, flight)| flight.is_healthy());
    let point = |(number, flight): (usize, &Flight)| {
        let fitted = flight.fitted.as_ref().ok()?;
        let is_seen = fitted.known.each[unknown] == Knowledge::Known;
        let (level, error) = (fitted.z[unknown], fitted.known.error(unknown));
        is_seen.then_some(Point { at: number as f64, level, error })
    };
    let points: Vec<Point> = updates.filter_map(point).collect();
    let trend = Trend::of(&points)?;
    (trend.significance().abs() > DRIFTS).then_some(Drift { unknown, trend })
}
