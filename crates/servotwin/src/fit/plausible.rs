//! Checks whether a record can belong to the system: wrong signs and units, exchanged columns, stuck sensors, clocks
//! that disagree. The nominal twin is the reference; differences of a few percent are left to the fit.

use super::record::{FitRecord, RecordError, smooth};
use super::suspects::Cause;
use super::{Fit, FitError};
use crate::beside::{Comparisons, InputMistake, Panes, SensorColumn};
use crate::recording::with_suffix;
use crate::study::Study;
use crate::system::System;
use std::ops::Range;

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

/// The sensors of a record beside those of its nominal twin, from the first compared sample on. Missing values are the
/// last ones.
struct ComparedRecord<'r> {
    record: &'r FitRecord,
    columns: Vec<SensorColumn<'r>>,
    /// The standard deviation of a sample of each sensor.
    deviations: Vec<f64>,
    /// The values of the sensors and of their twins, ordered by sample, then sensor.
    values: [Vec<f64>; 2],
    /// Every sensor beside the twin of every sensor.
    beside: Comparisons,
    /// The first sample of a mistake that begins within the record, and the mistake.
    late: Option<(usize, String)>,
}

impl Fit<'_> {
    /// Checks whether the records can belong to this system.
    ///
    /// # Errors
    /// The first mistake found.
    pub fn check(&self) -> Result<(), FitError> {
        if self.unknowns.is_empty() {
            return Err(FitError::NoUnknown);
        }
        if self.records.is_empty() {
            return Err(FitError::NoRecord);
        }
        for record in &self.records {
            let refused = |error| FitError::Record { name: record.name.clone(), error };
            let compared = self.beside_nominal(record)?;
            if let Some(mistake) = self.input_mistake(record, &compared)? {
                return Err(refused(RecordError(mistake)));
            }
            compared.check().map_err(refused)?;
            if let Some((times, size)) = compared.wrong_times()
                && !self.of_record(record.clone()).is_rather_a_fault(times, size)?
            {
                return Err(refused(RecordError::of_times(times, size, record.period_s)));
            }
        }
        Ok(())
    }

    /// A record beside its nominal twin.
    fn beside_nominal<'r>(&'r self, record: &'r FitRecord) -> Result<ComparedRecord<'r>, FitError> {
        let nominal = |_| self.variant(&self.nominal(), &record.inputs);
        let twin = self.twins(record, (1, 1.0), nominal)?.remove(0)?;
        Ok(ComparedRecord::new(self.system, record, self.deviations(record), &twin))
    }

    /// A mistake of the column of an input that varies, as a sentence.
    fn input_mistake(
        &self,
        record: &FitRecord,
        compared: &ComparedRecord,
    ) -> Result<Option<String>, FitError> {
        for input in record.varying(self.system) {
            let own = &self.system.network().inputs[input];
            let column = (&*with_suffix(&own.id, own.unit), record.unit(input, own.unit));
            let mut rerun = |mistake: &InputMistake| match self
                .beside_nominal(&record.without_mistake(self.system, input, mistake))
            {
                Ok(compared) => Ok(Some(compared.beside)),
                Err(FitError::Cancelled) => Err(FitError::Cancelled),
                Err(_) => Ok(None),
            };
            let found = compared.beside.input_mistake(column, &compared.columns, &mut rerun)?;
            if found.is_some() {
                return Ok(found);
            }
        }
        Ok(None)
    }
}

/// The sensor that an actuator follows while its command stands still: the nominal twin stands still, too, but follows
/// all sensors if this one is its command. `inputs` and `measured` have all inputs and sensors of the system in SI, one
/// sample after the other; NaN is a missing sensor value.
///
/// # Errors
/// The twin of these inputs cannot be simulated.
pub fn still_command(
    study: &Study,
    period_s: f64,
    inputs: &[f64],
    measured: &[f64],
) -> Result<Option<InputMistake>, FitError> {
    let (system, command) = (&study.system, study.command_input);
    let width = system.network().inputs.len();
    let signal = |input: usize| {
        let values: Vec<f64> = inputs.iter().skip(input).step_by(width).copied().collect();
        smooth(period_s, &values)
    };
    let signals: Vec<_> = (0..width).map(signal).collect();
    let sensors = (0..system.sensors.len()).collect();
    let record = FitRecord::logged("", &signals, sensors, period_s, measured.to_vec());
    let fit = Fit::new(system, vec![]);
    let compared = fit.beside_nominal(&record)?;
    compared.beside.still_input(&compared.columns, &mut |mistake| {
        let undone = record.without_mistake(system, command, mistake);
        Ok(fit.beside_nominal(&undone).ok().map(|compared| compared.beside))
    })
}

impl<'r> ComparedRecord<'r> {
    /// Compares a record with the samples of a twin.
    fn new(system: &'r System, record: &'r FitRecord, deviations: Vec<f64>, twin: &[f64]) -> Self {
        let width = record.sensors.len();
        let inputs = system.network().inputs.len();
        let column = |(place, &sensor): (usize, &usize)| {
            let known = &system.sensors[sensor];
            let column = SensorColumn::new(system, sensor, record.unit(inputs + place, known.unit));
            SensorColumn { name: with_suffix(&known.id, known.unit).into(), ..column }
        };
        let columns: Vec<SensorColumn> = record.sensors.iter().enumerate().map(column).collect();
        let compared = |all: &[f64]| all[record.first_sample() * width..].to_vec();
        let (mut measured, twin) = (compared(&record.measured), compared(twin));
        hold(&mut measured, width);
        let (mut beside, mut panes) = (Comparisons::new(width), Panes::new(width, record.period_s));
        let mut late = None;
        for (sample, (own, twin)) in measured.chunks(width).zip(twin.chunks(width)).enumerate() {
            beside.take(own, twin);
            let pane = panes.take(sample, own, twin);
            late = late.or(pane.and_then(|(_, pane)| panes.mistakes(&pane, &columns)));
        }
        ComparedRecord { record, columns, deviations, values: [measured, twin], beside, late }
    }

    /// The values of a sensor and of its twin.
    fn of(&self, sensor: usize) -> [Vec<f64>; 2] {
        let width = self.columns.len();
        self.values.each_ref().map(|all| all.iter().skip(sensor).step_by(width).copied().collect())
    }

    /// The time of a compared sample, s.
    fn time_s(&self, sample: usize) -> f64 {
        (self.record.first_sample() + sample) as f64 * self.record.period_s
    }

    /// Checks whether the record can belong to the system.
    ///
    /// # Errors
    /// The first mistake that the record shows.
    fn check(&self) -> Result<(), RecordError> {
        if let Some((sample, found)) = self.late.as_ref().filter(|(sample, _)| *sample > 0) {
            return Err(RecordError(format!("from {:.2} s on, {found}", self.time_s(*sample))));
        }
        let found = self.beside.mistakes(&self.columns);
        if !found.is_empty() {
            return Err(RecordError(found.join("; ")));
        }
        if let Some(values) = &self.record.impossible {
            return Err(RecordError::impossible(values));
        }
        (0..self.columns.len()).try_for_each(|sensor| self.check_motion(sensor))?;
        let all = || (0..self.columns.len()).map(|sensor| self.spreads(sensor));
        match all().any(|own| own[0] >= MOVES) && all().any(|own| own[1] >= MOVES) {
            true => Ok(()),
            false => Err(RecordError::no_motion(&format!(
                "no sensor leaves its mean by {MOVES} times its noise"
            ))),
        }
    }

    /// How far a sensor and its twin leave their means, in deviations.
    fn spreads(&self, sensor: usize) -> [f64; 2] {
        let (own, deviation) = (self.beside.of(sensor), self.deviations[sensor]);
        [&own.own, &own.twin].map(|values| values.variance().sqrt() / deviation)
    }

    /// Checks that a sensor does not hold the same value while its twin moves.
    fn check_motion(&self, sensor: usize) -> Result<(), RecordError> {
        let ([measured, twin], deviation) = (self.of(sensor), self.deviations[sensor]);
        let mut begin = 0;
        for same in measured.chunk_by(|value, next| value == next) {
            let (from_s, for_s) = (self.time_s(begin), same.len() as f64 * self.record.period_s);
            let (low, high) = twin[begin..begin + same.len()]
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
            if for_s >= STUCK_S && high - low > 2.0 * MOVES * deviation {
                let SensorColumn { name, sensor, .. } = &self.columns[sensor];
                let (value, unit) = (same[0], sensor.unit.symbol());
                return Err(RecordError(format!(
                    "{name} is stuck: from {from_s:.2} s on it shows {value} {unit} for {for_s:.2} s, while the twin moves"
                )));
            }
            begin += same.len();
        }
        Ok(())
    }

    /// Whether sensors are late, or increasingly late, and by how much. Only sensors whose difference a shift explains
    /// are used, the clearest first.
    fn wrong_times(&self) -> Option<(Cause, f64)> {
        let mut moving: Vec<(f64, usize)> =
            (0..self.columns.len()).map(|sensor| (self.spreads(sensor)[1], sensor)).collect();
        moving.retain(|(spread, _)| *spread > MOVES);
        moving.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (_, sensor) in moving {
            let samples = self.values[0].len() / self.columns.len();
            let window = ((LAG_WINDOW_S / self.record.period_s) as usize).min(samples / 3);
            let lags = [0..window, samples - window..samples].map(|part| self.lag(sensor, part));
            let [Some(early), Some(late)] = lags else { continue };
            let (drift, by) = ((late - early) as f64, 0.5 * (early + late) as f64);
            if drift.abs() >= LEAST_LAG {
                return Some((Cause::Drift, drift / (samples - window) as f64));
            }
            if by.abs() >= LEAST_LAG {
                return Some((Cause::Delay, by));
            }
        }
        None
    }

    /// How many samples a sensor lags its twin in a part of the record; `None` if no shift explains the difference.
    fn lag(&self, sensor: usize, part: Range<usize>) -> Option<isize> {
        let ([measured, twin], deviation) = (self.of(sensor), self.deviations[sensor]);
        let longest = (LONGEST_LAG_S / self.record.period_s) as isize;
        let longest = longest.min(part.len() as isize / 2);
        let difference = |lag: isize| -> f64 {
            let inside = part.clone().filter_map(|k| {
                let other = k.checked_add_signed(-lag).filter(|other| *other < twin.len())?;
                Some(measured[k] - twin[other])
            });
            let (count, sum, square) =
                inside.fold((0.0, 0.0, 0.0), |(n, s, q), d| (n + 1.0, s + d, q + d * d));
            square / f64::max(count, 1.0) - (sum / f64::max(count, 1.0)).powi(2)
        };
        let at_zero = difference(0);
        let best = (-longest..=longest).map(|lag| (difference(lag), lag));
        let (least, lag) = best.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let noise = deviation * deviation;
        // A small difference needs no shift.
        match at_zero < 4.0 * noise || lag == 0 {
            true => Some(0),
            false => (least - noise < (1.0 - EXPLAINED) * (at_zero - noise)).then_some(lag),
        }
    }
}

impl RecordError {
    /// The times of the sensors are wrong.
    fn of_times(times: Cause, size: f64, period_s: f64) -> Self {
        RecordError(match times {
            Cause::Drift => format!(
                "the clocks of inputs and sensors do not agree: the sensors' time runs {:+.2} % off that of the inputs",
                100.0 * size
            ),
            _ => format!(
                "the sensors come {} s too {} for the inputs: shift one of them",
                ((size * period_s).abs() * 1e4).round() / 1e4,
                if size > 0.0 { "late" } else { "early" }
            ),
        })
    }
}

/// Replaces missing values of columns by the last value, or by the first one at the beginning.
fn hold(values: &mut [f64], width: usize) {
    for k in 0..values.len() {
        if values[k].is_nan() {
            let first = || values[k..].iter().step_by(width).copied().find(|value| !value.is_nan());
            values[k] = if k < width { first().unwrap_or(0.0) } else { values[k - width] };
        }
    }
}
