//! The trend of a wear over flights: its rate, and when it reaches a threshold.
//!
//! The measurement at flight n is a level x with a known standard error. The level changes at a rate v, and the rate is
//! a random walk:
//!
//! (FT1)  x' = x + v Δ,  v' = v + w,  w of variance q Δ;  y = x + e,  e of variance σ² s
//!
//! With q = 0 this is a straight line. The parameter s, at least 1, scales all errors to the observed scatter. q and s
//! maximize the likelihood of the series, found with a Kalman filter on a grid of q; a random walk replaces the straight
//! line if it gains ½ χ²₁(95 %). The threshold is reached when the mean level passes it; the 95 % interval ends where the
//! ends of the level's band pass it.

use super::intensity::{HALF_CHI_SQUARE_95, NORMAL_95};

/// Prior variance of the first level and rate, relative to their squared range: no prior knowledge.
const VAGUE: f64 = 1e6;
/// The grid of q per flight, in units of (range of the levels over their span)²; zero first.
const WALKS: [f64; 8] = [0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0];
/// The fewest flights that make a trend.
const FEWEST: usize = 4;
/// Predictions extend to this multiple of the history's length.
const HORIZON: f64 = 20.0;

/// One flight's measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// The flight number.
    pub at: f64,
    /// The measured level.
    pub level: f64,
    /// The standard error of the level.
    pub error: f64,
}

/// Level and rate with their covariance after a flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrendState {
    /// The flight number.
    pub(crate) at: f64,
    /// The estimated level.
    pub level: f64,
    /// The rate per flight.
    pub rate: f64,
    /// Variance of the level, covariance, variance of the rate.
    pub variance: [f64; 3],
}

/// The trend of a series up to its last flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trend {
    /// The state after the last flight.
    pub last: TrendState,
    /// The factor s of (FT1), which scales the error variances.
    pub(crate) spread: f64,
    /// q of (FT1), per flight.
    pub(crate) walk: f64,
    /// The prediction horizon, in flights.
    horizon: f64,
}

/// When a threshold is reached, in flights from the last one on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reached {
    /// When the mean passes it; `None` if not within the horizon.
    pub expected: Option<f64>,
    /// The earliest time of the 95 % band.
    pub earliest: Option<f64>,
    /// The latest time of the 95 % band; `None` if the band's lower end does not pass it.
    pub latest: Option<f64>,
}

impl TrendState {
    /// Predicts the state a number of flights later.
    fn after(&self, flights: f64, walk: f64) -> TrendState {
        let [level, both, rate] = self.variance;
        let t = flights;
        TrendState {
            at: self.at + t,
            level: self.level + t * self.rate,
            rate: self.rate,
            variance: [
                level + 2.0 * t * both + t * t * rate + walk * t * t * t / 3.0,
                both + t * rate + walk * t * t / 2.0,
                rate + walk * t,
            ],
        }
    }

    /// Updates the state with a measurement; also returns the innovation and its variance.
    fn measured(&self, level: f64, variance: f64) -> (TrendState, f64, f64) {
        let [own, both, rate] = self.variance;
        let (surprise, expected) = (level - self.level, own + variance);
        let gain = [own / expected, both / expected];
        let state = TrendState {
            at: self.at,
            level: self.level + gain[0] * surprise,
            rate: self.rate + gain[1] * surprise,
            variance: [
                own * variance / expected,
                both * variance / expected,
                rate - gain[1] * both,
            ],
        };
        (state, surprise, expected)
    }
}

impl Trend {
    /// The trend of a series ordered by time; `None` for fewer than four flights, or flights without a time span.
    pub fn of(points: &[Point]) -> Option<Trend> {
        let (first, last) = (points.first()?, points.last()?);
        let span = last.at - first.at;
        if points.len() < FEWEST || span <= 0.0 {
            return None;
        }
        let levels = points.iter().map(|point| point.level);
        let range = levels.clone().fold(f64::MIN, f64::max) - levels.fold(f64::MAX, f64::min);
        let error = points.iter().map(|point| point.error).fold(0.0, f64::max);
        let per_flight = (range.max(error) / span).powi(2) / span;
        let filtered = |part: &f64| filtered(points, part * per_flight, range.max(error), span);
        let mut all = WALKS.iter().map(filtered);
        let line = all.next().expect("the first walk is none");
        let best = all.fold(line, |a, b| if b.0 > a.0 { b } else { a });
        let (_, trend) = if best.0 > line.0 + HALF_CHI_SQUARE_95 { best } else { line };
        Some(Trend { horizon: HORIZON * span, ..trend })
    }

    /// The rate divided by its standard error.
    pub fn significance(&self) -> f64 {
        self.last.rate / self.last.variance[2].sqrt()
    }

    /// When a threshold is reached from below.
    pub fn reaches(&self, threshold: f64) -> Reached {
        let when = |sigmas: f64| {
            let end = |flights: f64| {
                let state = self.last.after(flights, self.walk);
                state.level + sigmas * state.variance[0].sqrt() - threshold
            };
            first_passage(end, self.horizon)
        };
        Reached { expected: when(0.0), earliest: when(NORMAL_95), latest: when(-NORMAL_95) }
    }
}

/// The first zero of a function that starts negative: a search on a grid, then bisection.
fn first_passage(end: impl Fn(f64) -> f64, horizon: f64) -> Option<f64> {
    const STEPS: usize = 4000;
    if end(0.0) >= 0.0 {
        return Some(0.0);
    }
    let at = |step: usize| horizon * (step as f64 / STEPS as f64).powi(2);
    let step = (1..=STEPS).find(|&step| end(at(step)) >= 0.0)?;
    let (mut before, mut after) = (at(step - 1), at(step));
    for _ in 0..50 {
        let middle = 0.5 * (before + after);
        if end(middle) >= 0.0 { after = middle } else { before = middle }
    }
    Some(after)
}

/// Runs the filter with one value of q, and returns the likelihood of the series. All variances are in units of s and are
/// scaled afterwards.
fn filtered(points: &[Point], walk: f64, range: f64, span: f64) -> (f64, Trend) {
    let first = points[0];
    let mut state = TrendState {
        at: first.at,
        level: first.level,
        rate: 0.0,
        variance: [VAGUE * range * range, 0.0, VAGUE * (range / span).powi(2)],
    };
    let (mut squares, mut logarithms, mut counted) = (0.0, 0.0, 0.0);
    for (number, point) in points.iter().enumerate() {
        let expected = state.after(point.at - state.at, walk);
        let (next, surprise, variance) = expected.measured(point.level, point.error.powi(2));
        // The first two flights determine the initial level and rate; they carry no information about the fit.
        if number >= 2 {
            squares += surprise * surprise / variance;
            logarithms += variance.ln();
            counted += 1.0;
        }
        state = next;
    }
    let spread = f64::max(squares / counted, 1.0);
    state.variance = state.variance.map(|variance| variance * spread);
    let likelihood = -0.5 * (logarithms + counted * spread.ln() + squares / spread);
    (likelihood, Trend { last: state, spread, walk: walk * spread, horizon: 0.0 })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::signal::random::NormalDeviates;

    /// Flights 0, 1, 2 … with a given level and normal errors.
    pub(crate) fn series(
        count: usize,
        seed: u64,
        error: f64,
        level: impl Fn(f64) -> f64,
    ) -> Vec<Point> {
        let mut random = NormalDeviates::new(seed);
        let point = |n: usize| {
            let at = n as f64;
            Point { at, level: level(at) + error * random.normal(), error }
        };
        (0..count).map(point).collect()
    }

    #[test]
    fn a_line_is_a_line_of_least_squares() {
        let points = series(40, 1, 0.02, |n| 0.1 + 0.003 * n);
        let trend = Trend::of(&points).unwrap();
        let n = points.len() as f64;
        let mean = |of: &dyn Fn(&Point) -> f64| points.iter().map(of).sum::<f64>() / n;
        let (x, y) = (mean(&|p| p.at), mean(&|p| p.level));
        let slope = mean(&|p| (p.at - x) * (p.level - y)) / mean(&|p| (p.at - x).powi(2));
        assert_eq!(trend.walk, 0.0);
        assert!((trend.last.rate / slope - 1.0).abs() < 1e-3, "{} {slope}", trend.last.rate);
        let error = 0.02 / (n * mean(&|p| (p.at - x).powi(2))).sqrt();
        let own = trend.last.variance[2].sqrt() / trend.spread.sqrt();
        assert!((own / error - 1.0).abs() < 1e-3, "{own} {error}");
    }

    #[test]
    fn the_band_of_the_time_to_a_threshold_holds_the_truth_in_95_percent() {
        let (mut inside, mut near) = (0, 0);
        for seed in 0..300 {
            let points = series(60, seed, 0.02, |n| 0.004 * n);
            let reached = Trend::of(&points).unwrap().reaches(0.5);
            let truth = 125.0 - 59.0;
            let latest = reached.latest.unwrap_or(f64::INFINITY);
            inside += usize::from((reached.earliest.unwrap()..=latest).contains(&truth));
            near += usize::from((reached.expected.unwrap() - truth).abs() < 0.2 * truth);
        }
        // Three standard deviations of 300 draws with 95 % are 3.8 %.
        assert!((274..=297).contains(&inside), "{inside}");
        assert!(near > 295, "{near}");
    }

    #[test]
    fn a_wear_that_grows_faster_is_followed() {
        let points = series(120, 5, 0.004, |n| 0.5 * (n / 200.0).powi(3));
        let trend = Trend::of(&points).unwrap();
        assert!(trend.walk > 0.0);
        let slope = 0.5 * 3.0 * 119.0_f64.powi(2) / 200.0_f64.powi(3);
        assert!((trend.last.rate / slope - 1.0).abs() < 0.2, "{} {slope}", trend.last.rate);
    }

    #[test]
    fn what_does_not_grow_reaches_nothing() {
        let points = series(50, 2, 0.02, |_| 0.1);
        let trend = Trend::of(&points).unwrap();
        assert!(trend.significance().abs() < 4.0);
        assert_eq!(trend.reaches(0.05).expected, Some(0.0));
        let falling = Trend::of(&series(50, 3, 0.01, |n| 0.4 - 0.002 * n)).unwrap();
        assert_eq!(falling.reaches(0.5), Reached { expected: None, earliest: None, latest: None });
        assert!(Trend::of(&points[..3]).is_none());
    }

    #[test]
    fn errors_that_are_too_small_are_found_out() {
        let mut points = series(80, 7, 0.03, |n| 0.002 * n);
        points.iter_mut().for_each(|point| point.error = 0.01);
        let trend = Trend::of(&points).unwrap();
        assert!(trend.spread > 4.0 || trend.walk > 0.0, "{}", trend.spread);
    }
}
