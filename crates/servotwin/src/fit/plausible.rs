//! Checks whether a record can belong to the system: wrong signs and units, exchanged columns, stuck sensors, clocks
//! that disagree. The nominal twin is the reference; differences of a few percent are left to the fit.

use super::record::{FitRecord, LeftOut, RecordError};
use crate::beside::{self, Comparisons};
use crate::recording::with_suffix;
use crate::system::{Sensor, System};
use crate::units;
use servotwin_model::spec::Unit;

/// A sensor moves if it leaves its mean by this many of its deviations.
const MOVES: f64 = 5.0;
/// How long a sensor may hold the same value while the twin moves, s.
const STUCK_S: f64 = 0.5;
/// Smaller delays of sensors are left to the fit, samples.
const LEAST_LAG: f64 = 3.0;
/// The longest lag that is searched, s.
const LONGEST_LAG_S: f64 = 3.0;
/// Length of the windows at the beginning and the end in which the lag is measured, s.
const LAG_WINDOW_S: f64 = 5.0;
/// The largest ratio of two factors for the same unit, as a logarithm.
const ALIKE: f64 = 0.7;
/// The fraction of the squared difference that a shift must remove to count as its cause.
const EXPLAINED: f64 = 0.8;

/// One sensor of a record and the twin's signal.
struct Pair<'r> {
    column: String,
    sensor: usize,
    deviation: f64,
    measured: Vec<f64>,
    twin: Vec<f64>,
    mean_measured: f64,
    mean_twin: f64,
    sd_measured: f64,
    sd_twin: f64,
    record: &'r FitRecord,
}

/// Compares a record with the nominal twin, given the residuals of its samples from `first` on.
///
/// # Errors
/// The first mistake that the record shows.
pub(super) fn check(
    system: &System,
    record: &FitRecord,
    deviations: &[f64],
    first: usize,
    residuals: &[f64],
) -> Result<(), RecordError> {
    let width = record.sensors.len();
    let pairs: Vec<Pair> = (0..width)
        .map(|place| {
            let of = |all: &[f64]| -> Vec<f64> {
                all.iter().skip(place).step_by(width).copied().collect()
            };
            let mut measured = of(&record.measured[first * width..]);
            let residuals = of(residuals);
            let deviation = deviations[place];
            let mut twin: Vec<f64> =
                measured.iter().zip(&residuals).map(|(m, r)| m - r * deviation).collect();
            hold(&mut measured);
            hold(&mut twin);
            let sensor = record.sensors[place];
            let known = &system.sensors[sensor];
            Pair {
                column: with_suffix(&known.id, known.unit),
                sensor,
                deviation,
                mean_measured: mean(&measured),
                mean_twin: mean(&twin),
                sd_measured: sd(&measured),
                sd_twin: sd(&twin),
                measured,
                twin,
                record,
            }
        })
        .collect();
    let beside = compare(&pairs);
    let turned: Vec<bool> = (0..width).map(|sensor| beside.of(sensor).is_turned()).collect();
    mistaken(system, &pairs, &beside, &turned)?;
    for pair in &pairs {
        pair.unit(system)?;
        pair.possible(system, first)?;
    }
    for pair in &pairs {
        pair.stuck(system, first)?;
    }
    let moving: Vec<&Pair> = pairs.iter().filter(|pair| pair.is_moving()).collect();
    let most = |of: fn(&Pair) -> f64| pairs.iter().map(|p| of(p) / p.deviation).fold(0.0, f64::max);
    if most(|p| p.sd_twin) < MOVES || most(|p| p.sd_measured) < MOVES {
        let what = format!("no sensor leaves its mean by {MOVES} times its noise");
        return Err(RecordError::NoMotion { what });
    }
    // Signs come before lags: a signal with the wrong sign also looks late by half a wave.
    if pairs.iter().zip(&turned).any(|(pair, turned)| *turned && pair.is_moving()) {
        signs(&moving)?;
    }
    lag(&moving)
}

/// Every sensor beside the twin of every sensor.
fn compare(pairs: &[Pair]) -> Comparisons {
    let mut beside = Comparisons::new(pairs.len());
    for sample in 0..pairs.first().map_or(0, |pair| pair.measured.len()) {
        let measured: Vec<f64> = pairs.iter().map(|pair| pair.measured[sample]).collect();
        let twin: Vec<f64> = pairs.iter().map(|pair| pair.twin[sample]).collect();
        beside.take(&measured, &twin);
    }
    beside
}

/// Reports exchanged sensors, and pressures that are not absolute. If a position moves against the twin, the command may
/// have the wrong sign, which exchanges the chambers, too.
fn mistaken(
    system: &System,
    pairs: &[Pair],
    beside: &Comparisons,
    turned: &[bool],
) -> Result<(), RecordError> {
    let sensors: Vec<&Sensor> = pairs.iter().map(|pair| &system.sensors[pair.sensor]).collect();
    let name = |sensor: usize| pairs[sensor].column.as_str();
    let is_turned = |sensor: usize| {
        turned[sensor] && sensors[sensor].unit != Unit::Pascal && pairs[sensor].is_moving()
    };
    if !(0..pairs.len()).any(is_turned) {
        let exchanged = beside.exchanged(&sensors);
        let names: Vec<_> = exchanged.into_iter().map(|(a, b)| (name(a), name(b))).collect();
        if !names.is_empty() {
            return Err(RecordError::Mistaken(beside::exchanged_in_words(&names)));
        }
    }
    match beside.without_atmosphere(&sensors) {
        Some((sign, low)) => {
            let names: Vec<&str> = low.into_iter().map(name).collect();
            Err(RecordError::Mistaken(beside::atmosphere_in_words(sign, &names)))
        }
        None => Ok(()),
    }
}

/// Reports sensors that move against the twin.
fn signs(moving: &[&Pair]) -> Result<(), RecordError> {
    let against: Vec<&&Pair> = moving.iter().filter(|pair| pair.correlation() < -0.5).collect();
    let columns = against.iter().map(|pair| pair.column.clone()).collect();
    Err(RecordError::OtherSign { columns, all: against.len() == moving.len() && moving.len() > 1 })
}

/// Reports sensors that are late, or increasingly late. Only sensors whose difference a shift explains are used, the
/// clearest first.
fn lag(moving: &[&Pair]) -> Result<(), RecordError> {
    let mut clearest: Vec<&&Pair> = moving.iter().collect();
    clearest.sort_by(|a, b| b.contrast().total_cmp(&a.contrast()));
    for pair in clearest {
        let samples = pair.measured.len();
        let window = ((LAG_WINDOW_S / pair.record.period_s) as usize).min(samples / 3);
        let (early, late) = (pair.lag(0..window), pair.lag(samples - window..samples));
        let (Some(early), Some(late)) = (early, late) else { continue };
        let drift = (late - early) as f64;
        if drift.abs() >= LEAST_LAG {
            return Err(RecordError::Clock { share: drift / (samples - window) as f64 });
        }
        let by = 0.5 * (early + late) as f64;
        if by.abs() >= LEAST_LAG {
            return Err(RecordError::Shifted { by_s: by * pair.record.period_s });
        }
    }
    Ok(())
}

impl Pair<'_> {
    fn contrast(&self) -> f64 {
        self.sd_twin / self.deviation
    }

    fn correlation(&self) -> f64 {
        let products = self.measured.iter().zip(&self.twin);
        let sum: f64 = products.map(|(m, t)| (m - self.mean_measured) * (t - self.mean_twin)).sum();
        sum / (self.measured.len() as f64 * self.sd_measured * self.sd_twin).max(f64::MIN_POSITIVE)
    }

    fn is_moving(&self) -> bool {
        self.sd_twin > MOVES * self.deviation
    }

    /// Reports values that the sensor cannot produce.
    fn possible(&self, system: &System, first: usize) -> Result<(), RecordError> {
        let range = system.readable(self.sensor);
        let cannot = |value: &f64| !(range.0..=range.1).contains(value);
        let Some(sample) = self.measured.iter().position(cannot) else { return Ok(()) };
        Err(RecordError::Impossible(LeftOut {
            column: self.column.clone(),
            count: self.measured.iter().filter(|value| cannot(value)).count(),
            place: format!("sample {}", first + sample + 1),
            value: self.measured[sample],
            range,
            unit: system.sensors[self.sensor].unit,
        }))
    }

    /// Reports another unit than the sensor's: all values, and their variation, have the same factor.
    fn unit(&self, system: &System) -> Result<(), RecordError> {
        let rms = |values: &[f64]| mean(&values.iter().map(|v| v * v).collect::<Vec<_>>()).sqrt();
        let (measured, twin) = (rms(&self.measured), rms(&self.twin));
        // Values near zero do not reveal the unit.
        if twin < MOVES * self.deviation {
            return Ok(());
        }
        let unit = system.sensors[self.sensor].unit;
        let moves_alike = |factor: f64| {
            !self.is_moving() || (self.sd_measured / self.sd_twin / factor).ln().abs() < ALIKE
        };
        match units::other(unit, measured / twin).filter(|(factor, _)| moves_alike(*factor)) {
            Some((factor, looks_like)) => Err(RecordError::OtherUnit {
                column: self.column.clone(),
                unit,
                factor,
                looks_like,
            }),
            None => Ok(()),
        }
    }

    fn stuck(&self, system: &System, first: usize) -> Result<(), RecordError> {
        let mut begin = 0;
        for end in 1..=self.measured.len() {
            if end < self.measured.len() && self.measured[end] == self.measured[begin] {
                continue;
            }
            let for_s = (end - begin) as f64 * self.record.period_s;
            let twin = &self.twin[begin..end];
            let (low, high) = twin
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
            if for_s >= STUCK_S && high - low > 2.0 * MOVES * self.deviation {
                return Err(RecordError::Stuck {
                    column: self.column.clone(),
                    from_s: (first + begin) as f64 * self.record.period_s,
                    for_s,
                    value: self.measured[begin],
                    unit: system.sensors[self.sensor].unit,
                });
            }
            begin = end;
        }
        Ok(())
    }

    /// How many samples the sensor lags the twin in a range; `None` if no shift explains the difference.
    fn lag(&self, samples: std::ops::Range<usize>) -> Option<isize> {
        let longest =
            ((LONGEST_LAG_S / self.record.period_s) as isize).min(samples.len() as isize / 2);
        let difference = |lag: isize| -> f64 {
            let inside = samples.clone().filter_map(|k| {
                let other = k.checked_add_signed(-lag).filter(|other| *other < self.twin.len())?;
                Some(self.measured[k] - self.twin[other])
            });
            let (count, sum, square) =
                inside.fold((0.0, 0.0, 0.0), |(n, s, q), d| (n + 1.0, s + d, q + d * d));
            square / f64::max(count, 1.0) - (sum / f64::max(count, 1.0)).powi(2)
        };
        let at_zero = difference(0);
        let best = (-longest..=longest).map(|lag| (difference(lag), lag));
        let (least, lag) = best.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let noise = self.deviation * self.deviation;
        // A small difference needs no shift.
        match at_zero < 4.0 * noise || lag == 0 {
            true => Some(0),
            false => (least - noise < (1.0 - EXPLAINED) * (at_zero - noise)).then_some(lag),
        }
    }
}

/// Replaces missing values by the last value, or by the first one at the beginning.
fn hold(values: &mut [f64]) {
    let mut last = values.iter().copied().find(|value| !value.is_nan()).unwrap_or(0.0);
    for value in values {
        if value.is_nan() {
            *value = last;
        }
        last = *value;
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn sd(values: &[f64]) -> f64 {
    let mean = mean(values);
    (values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / values.len().max(1) as f64)
        .sqrt()
}
