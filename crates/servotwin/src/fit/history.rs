//! The flights of one tail number: fits and diagnoses each flight, tracks the intensity of faults from flight to
//! flight, and reports parameters that drift inside their tolerances.
//!
//! Every flight is first fitted with tolerances only. If that leaves findings, the three likeliest suspects of the
//! latest such flights are compared by their likelihood ([`super::intensity`]). The remaining ones are tracked: their
//! intensity is estimated along with the tolerances in every flight, even where it is too small for a finding. A trend
//! ([`super::trend`]) predicts when a threshold is reached. A repair ([`super::repair`]) ends one wear and begins
//! another, so the trend uses the flights since the last repair.

use super::knowledge::Knowledge;
use super::repair::{Repair, repairs};
use super::suspects::SCORE_LIMIT;
use super::trend::{Point, Trend};
use super::{Fit, FitError, FitRecord, FitResults, RecordError};

/// How many of the latest flights with findings select the tracked faults.
const LATEST: usize = 5;
/// How many suspects of each flight are compared.
const COMPARED: usize = 3;
/// Faults below this mean probability over these flights are not tracked.
const PROBABLE: f64 = 0.1;
/// A parameter drifts if its rate exceeds this many standard errors: among a hundred parameters, chance exceeds it in
/// none.
const DRIFTS: f64 = 5.0;

/// One flight of the history.
#[derive(Clone, Debug)]
pub struct HistoryFlight {
    /// The name of the log.
    pub name: String,
    /// The result of its fit.
    pub fitted: Result<FitResults, FitError>,
}

impl HistoryFlight {
    /// Whether the fit has no findings.
    pub fn is_healthy(&self) -> bool {
        self.fitted.as_ref().is_ok_and(FitResults::is_update)
    }
}

/// A fault tracked over the flights.
#[derive(Clone, Debug)]
pub struct Track {
    /// The fault's full name.
    pub name: String,
    /// Its probability among the compared faults; 1 if the user requested it.
    pub probability: f64,
    /// Its intensity in each usable flight; flights count from zero.
    pub points: Vec<Point>,
    /// The repairs in between, in order of time.
    pub repairs: Vec<Repair>,
    /// Its trend since the last confirmed repair; `None` for too few flights.
    pub trend: Option<Trend>,
}

impl Track {
    /// Creates a track with its repairs and the trend since the last one.
    fn new(name: String, probability: f64, points: Vec<Point>) -> Self {
        let repairs = repairs(&points);
        // A drop that only the last flight shows may be a bad fit: continuing the wear before it is the safe side.
        let unconfirmed = repairs.last().filter(|last| !last.is_confirmed).map(|last| last.place);
        let mut track = Track { name, probability, points, repairs, trend: None };
        let start = track.last_repair().map_or(0, |repair| repair.place);
        track.trend = Trend::of(&track.points[start..unconfirmed.unwrap_or(track.points.len())]);
        track
    }

    /// The intensity in a flight.
    pub fn in_flight(&self, flight: usize) -> Option<&Point> {
        self.points.iter().find(|point| point.at == flight as f64)
    }

    /// The last repair that a second flight confirms.
    pub fn last_repair(&self) -> Option<&Repair> {
        self.repairs.iter().rev().find(|one| one.is_confirmed)
    }
}

/// A parameter that changes inside its tolerance, in standard deviations of the tolerance.
#[derive(Clone, Debug)]
pub struct Drift {
    /// The index of the unknown.
    pub unknown: usize,
    /// Its trend over the flights.
    pub trend: Trend,
}

/// The history of one tail number.
#[derive(Clone, Debug)]
pub struct History {
    /// The flights in order.
    pub flights: Vec<HistoryFlight>,
    /// The tracked faults, the likeliest first.
    pub tracks: Vec<Track>,
    /// The drifting parameters.
    pub drifts: Vec<Drift>,
}

/// A fault and its mean probability among the compared faults.
type Suspected = ((usize, usize), f64);

/// The name of a log, with its record or the reason why it has none.
pub type Log = (String, Result<FitRecord, RecordError>);

impl Fit<'_> {
    /// The history of logs in the order in which they were flown. The problem's own records are not used. If `faults`
    /// is empty, the findings select the tracked faults.
    ///
    /// # Errors
    /// The run was stopped, or there is nothing to estimate. Errors of a single flight are stored with that flight.
    pub fn history(&self, logs: Vec<Log>, faults: &[(usize, usize)]) -> Result<History, FitError> {
        let (mut flights, mut usable) = (Vec::new(), Vec::new());
        for (number, (name, record)) in logs.into_iter().enumerate() {
            let fitted = match record {
                Ok(record) => {
                    let own = self.of_record(record);
                    let fitted = unless_stopped(own.solve())?;
                    usable.extend(fitted.is_ok().then_some((number, own)));
                    fitted
                }
                Err(error) => Err(FitError::Record { name: name.clone(), error }),
            };
            flights.push(HistoryFlight { name, fitted });
        }
        let chosen = match faults.is_empty() {
            true => self.suspected(&usable, &flights)?,
            false => faults.iter().map(|&fault| (fault, 1.0)).collect(),
        };
        let mut tracks = Vec::new();
        for (fault, probability) in chosen {
            let mut points = Vec::new();
            for (number, own) in &usable {
                let Ok(found) = unless_stopped(own.intensities(&[fault]))? else { continue };
                let (level, error) = (found[0].intensity, found[0].error);
                points.push(Point { at: *number as f64, level, error });
            }
            tracks.push(Track::new(self.fault_name(fault), probability, points));
        }
        // Replaced parts have their own tolerances, so drifts start after the repair.
        let since = tracks.iter().filter_map(|track: &Track| Some(track.last_repair()?.at));
        let since = since.fold(0.0, f64::max);
        let drifts = (0..self.unknowns.len()).filter_map(|unknown| drift(&flights, unknown, since));
        Ok(History { tracks, drifts: drifts.collect(), flights })
    }

    /// The suspects of the latest flights with findings, with their mean probabilities.
    fn suspected(
        &self,
        usable: &[(usize, Fit)],
        flights: &[HistoryFlight],
    ) -> Result<Vec<Suspected>, FitError> {
        let latest = usable.iter().rev().filter(|(number, _)| !flights[*number].is_healthy());
        let (mut sums, mut of) = (Vec::<Suspected>::new(), 0.0);
        for (number, own) in latest.take(LATEST) {
            let Ok(fitted) = &flights[*number].fitted else { continue };
            let likely = fitted.suspects.iter().filter(|suspect| suspect.score > SCORE_LIMIT);
            // A clock error or a delay is not a fault.
            let faults = likely.filter_map(|suspect| suspect.cause.fault());
            let candidates: Vec<(usize, usize)> = faults.take(COMPARED).collect();
            if candidates.is_empty() {
                continue;
            }
            let Ok(compared) = unless_stopped(own.intensities(&candidates))? else { continue };
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
}

/// Keeps the error of a single flight; a stop ends the whole history.
fn unless_stopped<T>(result: Result<T, FitError>) -> Result<Result<T, FitError>, FitError> {
    match result {
        Err(error @ (FitError::Cancelled | FitError::NoUnknown)) => Err(error),
        other => Ok(other),
    }
}

/// The drift of a parameter over its updates from flight `since` on, if any.
fn drift(flights: &[HistoryFlight], unknown: usize, since: f64) -> Option<Drift> {
    let later = flights.iter().enumerate().filter(|(number, _)| *number as f64 >= since);
    let updates = later.filter(|(_, flight)| flight.is_healthy());
    let point = |(number, flight): (usize, &HistoryFlight)| {
        let fitted = flight.fitted.as_ref().ok()?;
        let is_seen = fitted.known.each[unknown] == Knowledge::Known;
        let (level, error) = (fitted.z[unknown], fitted.known.error(unknown));
        is_seen.then_some(Point { at: number as f64, level, error })
    };
    let points: Vec<Point> = updates.filter_map(point).collect();
    let trend = Trend::of(&points)?;
    (trend.significance().abs() > DRIFTS).then_some(Drift { unknown, trend })
}
