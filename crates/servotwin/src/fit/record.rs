//! Records of an actuator: the sensor values and the inputs of a flight.
//!
//! A record is a table with a column for time, one for each sensor, and one for each input that was not at its default.
//! Columns have the names of sensors and inputs, with or without unit suffix, as `servotwin simulate` writes them.
//! Other columns are ignored.
//!
//! An input's column gives values at samples; between samples it is a cubic with the slopes
//!
//! (FI1)  m_k = (s_{k−2} − 8 s_{k−1} + 8 s_{k+1} − s_{k+2})/12h,  |m_k| ≤ 3 min(|d_{k−1}|, |d_k|)
//!
//! where d are the differences to the neighbors divided by h. The limit applies only where m differs from their mean by
//! more than a twentieth of their difference. The interpolation is fourth order for smooth signals and does not
//! overshoot at a step.

use crate::beside::InputMistake;
use crate::moment;
use crate::recording::{self, with_suffix};
use crate::sanitize;
use crate::system::System;
use crate::table::{Table, TableError};
use crate::text::rounded;
use crate::toml_text::{NumberWithUnit, Quantities};
use crate::units::{self, Misread, NamedUnit};
use serde::Serialize;
use servotwin_model::signal::Piecewise;
use servotwin_model::spec::Unit;

/// The metadata key of a table for the log's time unit, s.
pub const TIME_UNIT: &str = "time_unit_s";

/// The metadata key of a table for the unit in which a log gives a column.
pub fn unit_key(column: &str) -> String {
    format!("unit_of_log.{column}")
}

/// The column of times.
const TIME: &str = "time_s";
/// The shortest duration of a record, s.
const LEAST_DURATION_S: f64 = 5.0;
/// The fewest samples of a record.
const LEAST_SAMPLES: usize = 200;
/// The sampling period of most records, s.
const USUAL_PERIOD_S: f64 = 0.01;
/// The largest timing error of a sample, in periods.
const JITTER: f64 = 0.1;
/// The largest fraction of a column that may be left out.
const MOST_LEFT_OUT: f64 = 0.01;
/// A step between samples that differs by more than this many periods is a leap.
const LEAP: f64 = 0.5;
/// The jump of a clock at daylight saving, s.
const DAYLIGHT_SAVING_S: f64 = 3600.0;

/// The sensor values of an actuator and its inputs.
#[derive(Clone, Debug)]
pub struct FitRecord {
    /// The name in messages.
    pub name: String,
    /// The time of the first sample, s since 1970, if the log has dates.
    pub begin_s: Option<f64>,
    /// Time between samples, s.
    pub period_s: f64,
    /// One signal per input of the system.
    pub(crate) inputs: Vec<Piecewise>,
    /// The indices of the sensors in the system's list.
    pub sensors: Vec<usize>,
    /// The sensor values, ordered by sample, then sensor; SI, NaN where missing.
    pub(crate) measured: Vec<f64>,
    /// The units in which the log gives the inputs of the system, followed by the sensors of the record; empty for SI.
    pub(crate) units: Vec<&'static NamedUnit>,
    /// Values that were left out as impossible.
    pub left_out: Vec<LeftOut>,
    /// Values that are impossible, too, but too many to leave out: their column is likely in another unit.
    pub(crate) impossible: Option<LeftOut>,
}

/// Values of a column that its sensor cannot produce; they are treated as missing.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LeftOut {
    /// The name of the column.
    pub column: String,
    /// The number of values.
    pub count: usize,
    /// The place of the first one.
    pub first: String,
    /// The first value, SI.
    pub value: f64,
    /// The values in a sentence, with the range of the sensor.
    #[serde(skip)]
    pub sentence: String,
}

/// Why a table cannot be used as a record.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct RecordError(pub String);

impl RecordError {
    /// There is no column of times.
    pub fn no_time() -> Self {
        RecordError(format!("there is no column '{TIME}' with the time of each sample"))
    }

    /// None of the system's sensors has a column.
    pub fn no_sensor(system: &System) -> Self {
        let known = system.sensors.iter().map(|sensor| with_suffix(&sensor.id, sensor.unit));
        let known = sanitize::list(&known.collect::<Vec<_>>());
        RecordError(format!("no column is a sensor of the system; it has: {known}"))
    }

    /// No input varies, or nothing moves.
    pub(super) fn no_motion(what: &str) -> Self {
        RecordError(format!(
            "the record shows no motion: {what}; parameters show only while the actuator moves"
        ))
    }

    fn too_short(duration_s: f64, samples: usize) -> Self {
        RecordError(format!(
            "the record is too short: {duration_s:.2} s with {samples} samples; at least {LEAST_DURATION_S} s and \
             {LEAST_SAMPLES} samples are needed, 60 s are good"
        ))
    }

    /// Too many values are outside of the sensor's range.
    pub(super) fn impossible(values: &LeftOut) -> Self {
        RecordError(format!("{}: these are too many to leave out", values.sentence))
    }
}

impl From<TableError> for RecordError {
    fn from(error: TableError) -> Self {
        RecordError(error.to_string())
    }
}

impl FitRecord {
    /// A record as a logger stores it: the sampled inputs, and `measured`.
    pub(crate) fn logged(
        name: &str,
        inputs: &[Piecewise],
        sensors: Vec<usize>,
        period_s: f64,
        measured: Vec<f64>,
    ) -> Self {
        let samples = measured.len() / sensors.len().max(1);
        let sampled = |signal: &Piecewise| -> Vec<f64> {
            (0..samples).map(|k| signal.value(k as f64 * period_s)).collect()
        };
        let inputs = inputs.iter().map(|signal| smooth(period_s, &sampled(signal))).collect();
        Self::of_samples(name, period_s, inputs, sensors, measured)
    }

    /// A record in SI of which nothing was left out.
    pub(super) fn of_samples(
        name: &str,
        period_s: f64,
        inputs: Vec<Piecewise>,
        sensors: Vec<usize>,
        measured: Vec<f64>,
    ) -> Self {
        FitRecord {
            name: name.into(),
            begin_s: None,
            period_s,
            inputs,
            sensors,
            measured,
            units: vec![],
            left_out: vec![],
            impossible: None,
        }
    }

    /// Reads a record from a table.
    ///
    /// # Errors
    /// The first problem that makes the table unusable.
    pub fn from_table(name: &str, table: &Table, system: &System) -> Result<Self, RecordError> {
        let (samples, period_s, begin_s) = times(table)?;
        let (mut sensors, mut columns) = (vec![], vec![]);
        let (mut left_out, mut impossible) = (vec![], None);
        for (place, sensor) in system.sensors.iter().enumerate() {
            let Some(column) = recording::column(table, &sensor.id, sensor.unit) else { continue };
            let mut values = finite(table, column)?;
            let range = system.readable(place);
            if let Some(found) = outside(table, column, &values, range, sensor.unit) {
                match found.count {
                    most if 2 * most > values.len() => impossible = impossible.or(Some(found)),
                    many if many as f64 > MOST_LEFT_OUT * values.len() as f64 => {
                        return Err(RecordError::impossible(&found));
                    }
                    _ => {
                        let is_impossible =
                            |value: &&mut f64| !(range.0..=range.1).contains(*value);
                        values.iter_mut().filter(is_impossible).for_each(|value| *value = f64::NAN);
                        left_out.push(found);
                    }
                }
            }
            sensors.push(place);
            columns.push(values);
        }
        if sensors.is_empty() {
            return Err(RecordError::no_sensor(system));
        }
        let read = sensors.iter().map(|&s| (&system.sensors[s].id, system.sensors[s].unit));
        let read = system.network().inputs.iter().map(|input| (&input.id, input.unit)).chain(read);
        let units = read.map(|(id, unit)| log_unit(table, &with_suffix(id, unit), unit)).collect();
        let row = |row: usize| columns.iter().map(move |column| column[row]);
        let measured = (0..samples).flat_map(row).collect();
        let inputs = inputs(table, system, period_s)?;
        let record = Self::of_samples(name, period_s, inputs, sensors, measured);
        let duration_s = record.duration_s();
        match duration_s < LEAST_DURATION_S {
            true => Err(RecordError::too_short(duration_s, samples)),
            false => Ok(Self { begin_s, units, left_out, impossible, ..record }),
        }
    }

    /// The sensors of the system that the record lacks, as column names.
    pub fn lacking(&self, system: &System) -> Vec<String> {
        let all = system.sensors.iter().enumerate();
        let lacking = all.filter(|(sensor, _)| !self.sensors.contains(sensor));
        lacking.map(|(_, sensor)| with_suffix(&sensor.id, sensor.unit)).collect()
    }

    /// The unit in which the log gives an input of the system, or behind those a sensor of the record.
    pub(super) fn unit(&self, channel: usize, si: Unit) -> &'static NamedUnit {
        self.units.get(channel).copied().unwrap_or_else(|| NamedUnit::of_si(si))
    }

    /// The inputs with a unit that vary.
    pub(super) fn varying(&self, system: &System) -> Vec<usize> {
        let inputs = system.network().inputs.iter().zip(&self.inputs).enumerate();
        let varies = inputs
            .filter(|(_, (input, signal))| input.unit != Unit::None && signal.pieces().len() > 1);
        varies.map(|(input, _)| input).collect()
    }

    /// The record with a mistake of the column of an input undone.
    pub(super) fn without_mistake(
        &self,
        system: &System,
        input: usize,
        mistake: &InputMistake,
    ) -> Self {
        let (mut record, inputs) = (self.clone(), &system.network().inputs);
        let own = self.unit(input, inputs[input].unit);
        let sampled = |k: usize| self.inputs[input].value(k as f64 * self.period_s);
        let values: Vec<f64> = match mistake {
            InputMistake::Unit(misread) => {
                (0..self.samples()).map(|k| sampled(k) * misread.factor()).collect()
            }
            &InputMistake::Still { sensor, factor, lead_s } => {
                let flown = self.measured.iter().skip(sensor).step_by(self.sensors.len());
                let held = |last: &mut f64, value: &f64| {
                    *last = if value.is_nan() { *last } else { factor * value };
                    Some(*last)
                };
                let values: Vec<f64> = flown.scan(0.0, held).collect();
                let at = |k: usize| values[k.min(values.len() - 1)];
                let rate = |k: usize| (at(k + 2) - at(k.saturating_sub(2))) / (4.0 * self.period_s);
                (0..values.len()).map(|k| at(k) + lead_s * rate(k)).collect()
            }
            &InputMistake::Exchanged(place) => {
                let si = system.sensors[self.sensors[place]].unit;
                let other = self.unit(inputs.len() + place, si);
                let mut values = vec![];
                for (k, row) in record.measured.chunks_exact_mut(self.sensors.len()).enumerate() {
                    let value = std::mem::replace(&mut row[place], sampled(k) * other.si / own.si);
                    let last = values.last().copied().unwrap_or(0.0);
                    values.push(if value.is_nan() { last } else { value * own.si / other.si });
                }
                values
            }
        };
        record.inputs[input] = smooth(self.period_s, &values);
        record
    }

    /// Number of samples.
    pub(super) fn samples(&self) -> usize {
        self.measured.len() / self.sensors.len().max(1)
    }

    /// Time from the first sample to the last, s.
    pub fn duration_s(&self) -> f64 {
        self.samples().saturating_sub(1) as f64 * self.period_s
    }
}

/// The unit in which a log gives a column of a table, in SI otherwise.
fn log_unit(table: &Table, column: &str, si: Unit) -> &'static NamedUnit {
    let given = table.metadata.get(&unit_key(column)).and_then(|symbol| units::exactly(symbol));
    given.unwrap_or_else(|| NamedUnit::of_si(si))
}

fn finite(table: &Table, column: &str) -> Result<Vec<f64>, RecordError> {
    let values = table.f64(column)?;
    let Some(row) = values.iter().position(|value| !value.is_finite()) else {
        return Ok(values.into_owned());
    };
    let place = |row| table.origin().place(row);
    let first = values.iter().position(|value| value.is_finite());
    let begins = first.filter(|&first| values[first..].iter().all(|value| value.is_finite()));
    Err(RecordError(match (begins, table.f64(TIME)) {
        (Some(first), Ok(times_s)) if row == 0 => {
            let behind_s = ((times_s[first] - times_s[0]) * 1e6).round() / 1e6;
            let place = place(first);
            format!(
                "{column} has no value before {place}: --from {behind_s} reads the record from there on"
            )
        }
        _ => {
            let place = place(row);
            format!(
                "{column} has no finite value at {place}: cut the record there, or leave the column out"
            )
        }
    }))
}

/// Values that a sensor cannot produce: a flipped bit, a loose plug, or another unit.
fn outside(
    table: &Table,
    column: &str,
    values: &[f64],
    range: (f64, f64),
    unit: Unit,
) -> Option<LeftOut> {
    let is_outside = |row: &usize| !(range.0..=range.1).contains(&values[*row]);
    let rows: Vec<usize> = (0..values.len()).filter(is_outside).collect();
    let (count, row) = (rows.len(), *rows.first()?);
    let (first, value, symbol) = (table.origin().place(row), values[row], unit.symbol());
    let more = if count == 1 { String::new() } else { format!(" and {} more", count - 1) };
    let sentence = format!(
        "{column} has {} ({first}{more}), which its sensor cannot show ({})",
        NumberWithUnit(value, symbol),
        Quantities(rounded(range.0, 6), rounded(range.1, 6), symbol)
    );
    Some(LeftOut { column: column.into(), count, first, value, sentence })
}

/// The number of samples, their period, s, and the date of the first one, if it has one, s.
fn times(table: &Table) -> Result<(usize, f64, Option<f64>), RecordError> {
    let time = recording::column(table, "time", Unit::Second).ok_or_else(RecordError::no_time)?;
    let mut times_s = finite(table, time)?;
    let begin_s = times_s.first().copied().unwrap_or(0.0);
    let is_dated = moment::is_date(begin_s);
    // Seconds since 1970 are unreadable in messages, so they become relative to the first.
    times_s.iter_mut().filter(|_| is_dated).for_each(|time_s| *time_s -= begin_s);
    let samples = times_s.len();
    if samples < LEAST_SAMPLES {
        let duration_s = times_s.last().unwrap_or(&0.0) - times_s.first().unwrap_or(&0.0);
        return Err(RecordError::too_short(duration_s, samples));
    }
    let period_s = (times_s[samples - 1] - times_s[0]) / (samples - 1) as f64;
    // A period written with few digits is meant exactly.
    let whole_s = (period_s * 1e6).round() / 1e6;
    let is_whole = (whole_s - period_s).abs() * (samples as f64) < 0.01 * period_s;
    let period_s = if is_whole { whole_s } else { period_s };
    check_steps(table, &times_s, is_dated)?;
    for (row, &time_s) in times_s.iter().enumerate() {
        let expected_s = times_s[0] + row as f64 * period_s;
        if (time_s - expected_s).abs() > JITTER * period_s {
            let (place, rate_hz) = (table.origin().place(row), rounded(1.0 / period_s, 3));
            return Err(RecordError(format!(
                "the times jitter: {place} has {time_s} s where {expected_s:.6} s is expected (± {JITTER} periods); if \
                 the samples themselves are even, rate_hz = {rate_hz} instead of column below [time] of a map file \
                 counts rows"
            )));
        }
    }
    Ok((samples, period_s, is_dated.then_some(begin_s)))
}

/// Checks the usual step between samples, and that no step differs from the others, unless the times jitter.
fn check_steps(table: &Table, times_s: &[f64], is_dated: bool) -> Result<(), RecordError> {
    let steps: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut sorted = steps.clone();
    sorted.sort_by(f64::total_cmp);
    let usual_s = sorted[sorted.len() / 2];
    if !moment::is_period(usual_s) && usual_s > 0.0 {
        let unit_s = table.metadata.get(TIME_UNIT).and_then(|text| text.parse::<f64>().ok());
        let step = usual_s / unit_s.unwrap_or(1.0);
        let likely = moment::likely_unit(step, USUAL_PERIOD_S, units::of_times());
        let likely = likely.map_or(String::new(), |(unit, step_s)| {
            format!(
                "; the times are likely in {unit}, in which samples are {step_s} s apart: a map file gives them another \
                 unit"
            )
        });
        let ((least, most), usual_s) = (moment::PERIODS_S, rounded(usual_s, 3));
        return Err(RecordError(format!(
            "{usual_s} s between samples: allowed are {least} … {most} s{likely}"
        )));
    }
    // Short steps make up for the long ones where times jitter; behind missing samples there are none.
    let count = |is_of: &dyn Fn(f64) -> bool| steps.iter().filter(|step| is_of(**step)).count();
    let short = count(&|step| (0.0..(1.0 - LEAP) * usual_s).contains(&step));
    let long = count(&|step| step > (1.0 + LEAP) * usual_s);
    if short > 0 && 2 * short >= long && count(&|step| step < 0.0) == 0 {
        return Ok(());
    }
    match steps.iter().position(|step| (step - usual_s).abs() > LEAP * usual_s) {
        Some(row) => Err(leap(&table.origin().place(row + 1), steps[row], usual_s, is_dated)),
        None => Ok(()),
    }
}

/// A step between two samples that differs from the others, with its likely cause.
fn leap(place: &str, step_s: f64, usual_s: f64, is_dated: bool) -> RecordError {
    let decimals = (-rounded(usual_s, 3).log10()).ceil().clamp(0.0, 6.0) as usize;
    let set_s = (step_s - usual_s).abs();
    let missing = (step_s / usual_s).round() - 1.0;
    let is_summer = is_dated && (set_s - DAYLIGHT_SAVING_S).abs() < LEAP * usual_s.max(1.0);
    let (cause, them) = match step_s {
        _ if is_summer => (
            "likely the clock was set for daylight saving: log dates with their offset (02:00:00+01:00) or in UTC, or "
                .into(),
            "it",
        ),
        back if back <= 0.0 => ("the clock was set back: ".into(), "it"),
        _ if (1.0..1e6).contains(&missing) => (format!("{missing} samples are missing: "), "them"),
        _ => (String::new(), "it"),
    };
    let usual_s = rounded(usual_s, 3);
    RecordError(format!(
        "samples are not even: the step to {place} is {step_s:.decimals$} s, the others are {usual_s} s; {cause}read the \
         part before or behind {them} with --to or --from"
    ))
}

/// The inputs: from their columns, otherwise at their defaults.
fn inputs(table: &Table, system: &System, period_s: f64) -> Result<Vec<Piecewise>, RecordError> {
    let network = system.network();
    let mut signals = system.default_inputs();
    for (place, (input, signal)) in network.inputs.iter().zip(&mut signals).enumerate() {
        let Some(name) = recording::column(table, &input.id, input.unit) else { continue };
        let values = finite(table, name)?;
        let declared = log_unit(table, name, input.unit);
        check_input(name, &values, declared, input.default, network.input_range(place))?;
        *signal = smooth(period_s, &values);
    }
    if signals.iter().any(|signal| signal.pieces().len() > 1) {
        return Ok(signals);
    }
    let names: Vec<String> = network.inputs.iter().map(|i| with_suffix(&i.id, i.unit)).collect();
    Err(RecordError::no_motion(&format!("no input varies (columns {})", names.join(", "))))
}

fn check_input(
    column: &str,
    values: &[f64],
    declared: &'static NamedUnit,
    default: f64,
    range: (f64, f64),
) -> Result<(), RecordError> {
    let unit = declared.unit;
    let largest = values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    // A boundary value is never far from its default.
    let is_far = unit == Unit::Pascal && !(0.1..10.0).contains(&(largest / default.abs()));
    let is_outside = |value: &&f64| !(range.0..=range.1).contains(*value);
    let misread = match (is_far, values.iter().any(|value| is_outside(&value))) {
        (true, _) => units::misread(declared, largest / default.abs()),
        (false, true) => units::within(declared, largest, range)
            .map(|unit| Misread { actual: vec![unit], read_as: declared }),
        (false, false) => None,
    };
    let symbol = unit.symbol();
    if let Some(misread) = misread {
        let ((seems, remedy), largest) = (misread.in_words(declared), rounded(largest, 3));
        return Err(RecordError(format!(
            "{column} seems {seems}: it reaches {largest} {symbol}; {remedy}"
        )));
    }
    let (low, high) = range;
    match values.iter().find(is_outside) {
        None => Ok(()),
        Some(value) => {
            Err(RecordError(format!("{column} has {value} {symbol}: allowed are {low} … {high}")))
        }
    }
}

/// An interpolated signal through samples (FI1).
pub(super) fn smooth(period_s: f64, values: &[f64]) -> Piecewise {
    if values.iter().all(|value| *value == values[0]) {
        return Piecewise::constant(values[0]).expect("finite");
    }
    let at = |k: isize| values[k.clamp(0, values.len() as isize - 1) as usize];
    let slope = |k: isize| {
        let whole = (at(k - 2) - 8.0 * at(k - 1) + 8.0 * at(k + 1) - at(k + 2)) / (12.0 * period_s);
        let (before, after) = ((at(k) - at(k - 1)) / period_s, (at(k + 1) - at(k)) / period_s);
        let is_smooth = (whole - 0.5 * (before + after)).abs() <= 0.05 * (after - before).abs();
        let most = if before * after >= 0.0 { 3.0 * before.abs().min(after.abs()) } else { 0.0 };
        if is_smooth { whole } else { whole.clamp(-most, most) }
    };
    let times_s: Vec<f64> = (0..values.len()).map(|k| k as f64 * period_s).collect();
    let slopes: Vec<f64> = (0..values.len() as isize).map(slope).collect();
    Piecewise::hermite(&times_s, values, &slopes).expect("times increase, values are finite")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smooth_signal_comes_back_from_its_samples() {
        let f = |t: f64| 0.1 * (2.0 * std::f64::consts::PI * 1.5 * t).sin();
        let values: Vec<f64> = (0..500).map(|k| f(0.01 * f64::from(k))).collect();
        let signal = smooth(0.01, &values);
        for k in 200..3000 {
            let t = 0.0015 * f64::from(k);
            assert!((signal.value(t) - f(t)).abs() < 2e-6, "{t}: {}", signal.value(t) - f(t));
        }
    }

    #[test]
    fn a_step_does_not_overshoot() {
        let values: Vec<f64> = (0..100).map(|k| if k < 50 { 0.0 } else { 1.0 }).collect();
        let signal = smooth(0.01, &values);
        for k in 0..1000 {
            assert!((0.0..=1.0).contains(&signal.value(0.001 * f64::from(k))));
        }
    }
}
