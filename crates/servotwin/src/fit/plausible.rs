//! Checks whether a record can belong to the system: wrong signs and units, exchanged columns, stuck sensors, clocks
//! that disagree. The nominal twin is the reference; differences of a few percent are left to the fit.

use super::FitError;
use super::record::{FitRecord, LeftOut, RecordError};
use crate::beside::{Comparisons, InputMistake, Panes, SensorColumn};
use crate::recording::with_suffix;
use crate::system::System;

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
/// The fraction of the squared difference that a shift must remove to count as its cause.
const EXPLAINED: f64 = 0.8;

/// One sensor of a record and the twin's signal.
struct Pair<'r> {
    column: String,
    sensor: usize,
    deviation: f64,
    measured: Vec<f64>,
    twin: Vec<f64>,
    sd_measured: f64,
    sd_twin: f64,
    record: &'r FitRecord,
}

/// The sensors of a record beside those of its nominal twin.
pub(super) struct ComparedRecord<'r> {
    pairs: Vec<Pair<'r>>,
    /// Every sensor beside the twin of every sensor.
    beside: Comparisons,
    /// A mistake that begins within the record, and its first sample.
    late: Option<(usize, String)>,
    columns: Vec<SensorColumn<'r>>,
    first: usize,
}

impl<'r> ComparedRecord<'r> {
    /// Compares a record with a twin, given the residuals of its samples from `first` on.
    pub(crate) fn new(
        system: &'r System,
        record: &'r FitRecord,
        deviations: &[f64],
        first: usize,
        residuals: &[f64],
    ) -> Self {
        let width = record.sensors.len();
        let pair = |place: usize| {
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
                sd_measured: sd(&measured),
                sd_twin: sd(&twin),
                measured,
                twin,
                record,
            }
        };
        let pairs: Vec<Pair> = (0..width).map(pair).collect();
        let inputs = system.network().inputs.len();
        let column = |(place, pair): (usize, &Pair)| {
            let si = system.sensors[pair.sensor].unit;
            SensorColumn::new(system, pair.sensor, record.unit(inputs + place, si))
        };
        let columns: Vec<SensorColumn> = pairs.iter().enumerate().map(column).collect();
        let names: Vec<&str> = pairs.iter().map(|pair| &*pair.column).collect();
        let (mut beside, mut panes) = (Comparisons::new(width), Panes::new(width, record.period_s));
        let mut late = None;
        for sample in 0..pairs.first().map_or(0, |pair| pair.measured.len()) {
            let measured: Vec<f64> = pairs.iter().map(|pair| pair.measured[sample]).collect();
            let twin: Vec<f64> = pairs.iter().map(|pair| pair.twin[sample]).collect();
            beside.take(&measured, &twin);
            let pane = panes.take(sample, &measured, &twin);
            let mistake = pane.and_then(|(_, pane)| panes.mistakes(&pane, &columns, &names));
            late = late.or(mistake);
        }
        ComparedRecord { pairs, beside, late, columns, first }
    }

    /// Checks whether the record can belong to the system.
    ///
    /// # Errors
    /// The first mistake that the record shows.
    pub(crate) fn check(&self, system: &System) -> Result<(), RecordError> {
        let Self { pairs, first, .. } = self;
        if let Some((sample, found)) = self.late.as_ref().filter(|(sample, _)| *sample > 0) {
            let from_s = (first + sample) as f64 * self.pairs[0].record.period_s;
            return Err(RecordError::Mistaken(format!("from {from_s:.2} s on, {found}")));
        }
        let found = self.beside.mistakes(&self.columns, &self.names());
        if !found.is_empty() {
            return Err(RecordError::Mistaken(found.join("; ")));
        }
        for pair in pairs {
            pair.possible(system, *first)?;
        }
        for pair in pairs {
            pair.stuck(system, *first)?;
        }
        let moving: Vec<&Pair> = pairs.iter().filter(|pair| pair.is_moving()).collect();
        let most =
            |of: fn(&Pair) -> f64| pairs.iter().map(|p| of(p) / p.deviation).fold(0.0, f64::max);
        if most(|p| p.sd_twin) < MOVES || most(|p| p.sd_measured) < MOVES {
            let what = format!("no sensor leaves its mean by {MOVES} times its noise");
            return Err(RecordError::NoMotion { what });
        }
        lag(&moving)
    }

    /// A mistake of the column of an input; see [`Comparisons::input_mistake`]. `rerun` compares the record with the
    /// mistake undone, or gives nothing if that is impossible.
    ///
    /// # Errors
    /// What `rerun` reports.
    pub(crate) fn input_mistake<E>(
        &self,
        system: &System,
        input: usize,
        rerun: &mut dyn FnMut(&InputMistake) -> Result<Option<Comparisons>, E>,
    ) -> Result<Option<RecordError>, E> {
        let own = &system.network().inputs[input];
        let Some(pair) = self.pairs.first() else { return Ok(None) };
        let (name, unit) = (with_suffix(&own.id, own.unit), pair.record.unit(input, own.unit));
        let found =
            self.beside.input_mistake((&name, unit), &self.columns, &self.names(), rerun)?;
        Ok(found.map(RecordError::Mistaken))
    }

    /// An input that stands still although the actuator does not; see [`Comparisons::still_input`].
    pub(crate) fn still_input(
        &self,
        rerun: &mut dyn FnMut(&InputMistake) -> Result<Option<Comparisons>, FitError>,
    ) -> Result<Option<InputMistake>, FitError> {
        self.beside.still_input(&self.columns, rerun)
    }

    /// The comparisons of all sensors.
    pub(crate) fn into_comparisons(self) -> Comparisons {
        self.beside
    }

    fn names(&self) -> Vec<&str> {
        self.pairs.iter().map(|pair| &*pair.column).collect()
    }
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
