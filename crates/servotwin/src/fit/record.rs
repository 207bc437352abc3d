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
use crate::moment::{self, Clock};
use crate::recording::{self, with_suffix};
use crate::sanitize;
use crate::system::System;
use crate::table::{Table, TableError};
use crate::toml_text::{NumberWithUnit, Quantities};
use crate::units::{self, Misread, NamedUnit};
use servotwin_model::signal::Piecewise;
use servotwin_model::spec::Unit;
use std::fmt;

/// The metadata key of a table for the log's time unit, s.
pub const TIME_UNIT: &str = "time_unit_s";

/// The metadata key of a table for the unit in which a log gives a column.
pub fn unit_key(column: &str) -> String {
    format!("unit_of_log.{column}")
}

/// The accepted names of a time column.
const TIMES: [&str; 3] = ["time_s", "time", "t"];
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
    /// Time between samples, s.
    pub period_s: f64,
    /// One signal per input of the system.
    pub inputs: Vec<Piecewise>,
    /// The indices of the sensors in the system's list.
    pub sensors: Vec<usize>,
    /// The sensor values, ordered by sample, then sensor; SI, NaN where missing.
    pub measured: Vec<f64>,
    /// The units in which the log gives the inputs of the system, followed by the sensors of the record; empty for SI.
    pub units: Vec<&'static NamedUnit>,
    /// Values that were left out as impossible.
    pub left_out: Vec<LeftOut>,
}

/// Values of a column that its sensor cannot produce; they are treated as missing.
#[derive(Clone, Debug, PartialEq)]
pub struct LeftOut {
    /// The name of the column.
    pub column: String,
    /// The number of values.
    pub count: usize,
    /// The place of the first one.
    pub place: String,
    /// The first value, SI.
    pub value: f64,
    /// The range of the sensor, SI.
    pub range: (f64, f64),
    /// The unit of `value` and `range`.
    pub unit: Unit,
}

impl fmt::Display for LeftOut {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { column, count, place, value, range: (low, high), unit } = self;
        let value = NumberWithUnit(*value, unit.symbol());
        let range = Quantities(in_digits(*low), in_digits(*high), unit.symbol());
        let more = match count {
            1 => String::new(),
            count => format!(" and {} more", count - 1),
        };
        write!(out, "{column} has {value} ({place}{more}), which its sensor cannot show ({range})")
    }
}

/// Rounds to six digits, which removes rounding errors.
fn in_digits(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

/// Why a table cannot be used as a record.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // The fields are what the messages say.
pub enum RecordError {
    /// There is no column of times.
    #[error("there is no column 'time_s' with the time of each sample")]
    NoTime,
    /// A time given as text is not a date.
    #[error(
        "{column} has '{text}' ({place}): {}",
        moment::refusal(.text).unwrap_or("seconds or dates (2026-11-21T08:15:02.5Z) are needed")
    )]
    NoDate { column: String, place: String, text: String },
    /// A column does not contain numbers; the text is the table's error.
    #[error("{0}")]
    Column(String),
    /// None of the system's sensors has a column.
    #[error("no column is a sensor of the system; it has: {}", sanitize::list(.known))]
    NoSensor { known: Vec<String> },
    /// A value is missing or infinite.
    #[error(
        "{column} has no finite value at {place}: cut the record there, or leave the column out"
    )]
    NotFinite { column: String, place: String },
    /// Too many values are outside the sensor's range.
    #[error("{0}: these are too many to leave out")]
    Impossible(LeftOut),
    /// Samples are not evenly spaced.
    #[error(
        "the times jitter: {place} has {time_s} s where {expected_s:.6} s is expected (± {JITTER} periods); if the samples \
         themselves are even, rate_hz = {rate_hz} instead of column below [time] of a map file counts rows"
    )]
    Uneven { place: String, time_s: f64, expected_s: f64, rate_hz: f64 },
    /// One step between samples differs from the others.
    #[error("{}", leap(.place, *.step_s, *.period_s, *.is_dated))]
    Leap { place: String, step_s: f64, period_s: f64, is_dated: bool },
    /// The sampling period is out of range. `likely` is a unit in which it would be in range, and the period in that
    /// unit, s.
    #[error("{}", wrong_period(*.period_s, *.likely))]
    Period { period_s: f64, likely: Option<(&'static str, f64)> },
    /// A column has no value before a row, and is complete from there on.
    #[error(
        "{column} has no value before {place}: --from {behind_s} reads the record from there on"
    )]
    Begins { column: String, place: String, behind_s: f64 },
    /// The record is too short.
    #[error(
        "the record is too short: {duration_s:.2} s with {samples} samples; at least {LEAST_DURATION_S} s and {LEAST_SAMPLES} samples are needed, 60 s are good"
    )]
    TooShort { duration_s: f64, samples: usize },
    /// No input varies, or nothing moves.
    #[error("the record shows no motion: {what}; parameters show only while the actuator moves")]
    NoMotion { what: String },
    /// An input is outside its range.
    #[error("{column} has {value} {}: allowed are {} … {}", .unit.symbol(), .range.0, .range.1)]
    Input { column: String, value: f64, range: (f64, f64), unit: Unit },
    /// Columns are exchanged, in another unit or of another sign, or pressures are not absolute.
    #[error("{0}")]
    Mistaken(String),
    /// A sensor holds the same value although it should move.
    #[error("{column} is stuck: from {from_s:.2} s on it shows {value} {} for {for_s:.2} s, while the twin moves", .unit.symbol())]
    Stuck { column: String, from_s: f64, for_s: f64, value: f64, unit: Unit },
    /// The sensors drift away from the inputs with time.
    #[error("the clocks of inputs and sensors do not agree: the sensors' time runs {:+.2} % off that of the inputs", 100.0 * .share)]
    Clock { share: f64 },
    /// The sensors come too late or too early.
    #[error("the sensors come {} s too {} for the inputs: shift one of them", (.by_s.abs() * 1e4).round() / 1e4, if *.by_s > 0.0 { "late" } else { "early" })]
    Shifted { by_s: f64 },
}

fn wrong_period(period_s: f64, likely: Option<(&str, f64)>) -> String {
    let (least, most) = moment::PERIODS_S;
    let period_s = moment::rounded(period_s);
    let likely = likely.map_or(String::new(), |(unit, step_s)| {
        format!(
            "; the times are likely in {unit}, in which samples are {step_s} s apart: a map file gives them another unit"
        )
    });
    format!("{period_s} s between samples: allowed are {least} … {most} s{likely}")
}

/// Describes a step between two samples, with its likely cause.
fn leap(place: &str, step_s: f64, period_s: f64, is_dated: bool) -> String {
    let decimals = (-moment::rounded(period_s).log10()).ceil().clamp(0.0, 6.0) as usize;
    let set_s = (step_s - period_s).abs();
    let missing = (step_s / period_s).round() - 1.0;
    let likely = if is_dated && (set_s - DAYLIGHT_SAVING_S).abs() < LEAP * period_s.max(1.0) {
        "likely the clock was set for daylight saving: log dates with their offset (02:00:00+01:00) or in UTC, \
         or read the part before or behind it with --to or --from"
            .to_owned()
    } else if step_s <= 0.0 {
        "the clock was set back: read the part before or behind it with --to or --from".to_owned()
    } else if (1.0..1e6).contains(&missing) {
        format!(
            "{missing} samples are missing: read the part before or behind them with --to or --from"
        )
    } else {
        "read the part before or behind it with --to or --from".to_owned()
    };
    let period_s = moment::rounded(period_s);
    format!(
        "samples are not even: the step to {place} is {step_s:.decimals$} s, the others are {period_s} s; {likely}"
    )
}

impl RecordError {
    /// The error for a table without a column of the system's sensors.
    pub fn no_sensor(system: &System) -> Self {
        let known =
            system.sensors.iter().map(|sensor| with_suffix(&sensor.id, sensor.unit)).collect();
        RecordError::NoSensor { known }
    }
}

impl From<TableError> for RecordError {
    fn from(error: TableError) -> Self {
        RecordError::Column(error.to_string())
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
        let (units, left_out) = (vec![], vec![]);
        FitRecord { name: name.into(), period_s, inputs, sensors, measured, units, left_out }
    }

    /// Reads a record from a table.
    ///
    /// # Errors
    /// The first problem that makes the table unusable.
    pub fn from_table(name: &str, table: &Table, system: &System) -> Result<Self, RecordError> {
        let (times_s, period_s) = times(table)?;
        let sensors: Vec<usize> = (0..system.sensors.len())
            .filter(|&s| {
                recording::column(table, &system.sensors[s].id, system.sensors[s].unit).is_some()
            })
            .collect();
        if sensors.is_empty() {
            return Err(RecordError::no_sensor(system));
        }
        let mut left_out = Vec::new();
        let shown = |&s: &usize| {
            let sensor = &system.sensors[s];
            let name =
                recording::column(table, &sensor.id, sensor.unit).expect("it was found before");
            let mut values = finite(table, name)?;
            left_out.extend(leave_out(table, name, &mut values, system.readable(s), sensor.unit)?);
            Ok(values)
        };
        let columns = sensors.iter().map(shown).collect::<Result<Vec<_>, RecordError>>()?;
        let network = system.network();
        let read = sensors.iter().map(|&s| (&system.sensors[s].id, system.sensors[s].unit));
        let read = network.inputs.iter().map(|input| (&input.id, input.unit)).chain(read);
        let units = read.map(|(id, unit)| log_unit(table, &with_suffix(id, unit), unit)).collect();
        let rows = 0..times_s.len();
        let measured = rows.flat_map(|row| columns.iter().map(move |column| column[row])).collect();
        let record = Self {
            name: name.into(),
            period_s,
            inputs: inputs(table, system, period_s)?,
            sensors,
            measured,
            units,
            left_out,
        };
        let duration_s = record.duration_s();
        if duration_s < LEAST_DURATION_S || record.samples() < LEAST_SAMPLES {
            return Err(RecordError::TooShort { duration_s, samples: record.samples() });
        }
        Ok(record)
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
        let varies = inputs.filter(|(_, (input, signal))| {
            let begin = signal.value(0.0);
            let mut later = (1..self.samples()).map(|k| signal.value(k as f64 * self.period_s));
            input.unit != Unit::None && later.any(|value| value != begin)
        });
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
    pub(crate) fn samples(&self) -> usize {
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

fn finite(table: &Table, name: &str) -> Result<Vec<f64>, RecordError> {
    let values = table.f64(name)?;
    let Some(row) = values.iter().position(|value| !value.is_finite()) else {
        return Ok(values.into_owned());
    };
    let (column, place) = (name.to_owned(), |row| table.origin().place(row));
    let first = values.iter().position(|value| value.is_finite());
    let begins = first.filter(|&first| values[first..].iter().all(|value| value.is_finite()));
    let times_s = table.f64(TIMES[0]);
    Err(match (begins, times_s) {
        (Some(first), Ok(times_s)) if row == 0 => {
            let behind_s = ((times_s[first] - times_s[0]) * 1e6).round() / 1e6;
            RecordError::Begins { column, place: place(first), behind_s }
        }
        _ => RecordError::NotFinite { column, place: place(row) },
    })
}

/// Drops values that a sensor cannot produce, if they are few: a flipped bit, a loose plug. If most are out of range,
/// the column is in another unit, which is reported later.
fn leave_out(
    table: &Table,
    column: &str,
    values: &mut [f64],
    range: (f64, f64),
    unit: Unit,
) -> Result<Option<LeftOut>, RecordError> {
    let cannot = |value: &f64| !(range.0..=range.1).contains(value);
    let rows: Vec<usize> = (0..values.len()).filter(|&row| cannot(&values[row])).collect();
    let Some(&first) = rows.first() else { return Ok(None) };
    if 2 * rows.len() > values.len() {
        return Ok(None);
    }
    let (column, place, value) = (column.into(), table.origin().place(first), values[first]);
    let left_out = LeftOut { column, count: rows.len(), place, value, range, unit };
    if rows.len() as f64 > MOST_LEFT_OUT * values.len() as f64 {
        return Err(RecordError::Impossible(left_out));
    }
    rows.into_iter().for_each(|row| values[row] = f64::NAN);
    Ok(Some(left_out))
}

/// The times, and the sampling period.
fn times(table: &Table) -> Result<(Vec<f64>, f64), RecordError> {
    let name = TIMES.into_iter().find(|name| table.names().any(|known| known == *name));
    let times_s = seconds(table, name.ok_or(RecordError::NoTime)?)?;
    let samples = times_s.len();
    if samples < LEAST_SAMPLES {
        let duration_s = times_s.last().unwrap_or(&0.0) - times_s.first().unwrap_or(&0.0);
        return Err(RecordError::TooShort { duration_s, samples });
    }
    let period_s = (times_s[samples - 1] - times_s[0]) / (samples - 1) as f64;
    // A period written with few digits is meant exactly.
    let rounded = (period_s * 1e6).round() / 1e6;
    let period_s = if (rounded - period_s).abs() * (samples as f64) < 0.01 * period_s {
        rounded
    } else {
        period_s
    };
    let step_s = usual_step(&times_s);
    if !moment::is_period(step_s) && step_s > 0.0 {
        let period_s = step_s;
        let unit_s = table.metadata.get(TIME_UNIT).and_then(|text| text.parse::<f64>().ok());
        let likely = moment::likely_unit(
            period_s / unit_s.unwrap_or(1.0),
            USUAL_PERIOD_S,
            units::of_times(),
        );
        return Err(RecordError::Period { period_s, likely });
    }
    if let Some(leap) = find_leap(table, &times_s) {
        return Err(leap);
    }
    for (row, &time_s) in times_s.iter().enumerate() {
        let expected_s = times_s[0] + row as f64 * period_s;
        if (time_s - expected_s).abs() > JITTER * period_s {
            return Err(RecordError::Uneven {
                place: table.origin().place(row),
                time_s,
                expected_s,
                rate_hz: moment::rounded(1.0 / period_s),
            });
        }
    }
    Ok((times_s, period_s))
}

/// The median of the steps between samples, s.
fn usual_step(times_s: &[f64]) -> f64 {
    let mut steps: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps[steps.len() / 2]
}

/// The first step between samples that differs from the others, unless the times jitter.
fn find_leap(table: &Table, times_s: &[f64]) -> Option<RecordError> {
    let steps: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let period_s = usual_step(times_s);
    // Short steps make up for the long ones where times jitter; behind missing samples there are none.
    let count = |is_of: &dyn Fn(f64) -> bool| steps.iter().filter(|step| is_of(**step)).count();
    let short = count(&|step| (0.0..(1.0 - LEAP) * period_s).contains(&step));
    let long = count(&|step| step > (1.0 + LEAP) * period_s);
    if short > 0 && 2 * short >= long && count(&|step| step < 0.0) == 0 {
        return None;
    }
    let row = steps.iter().position(|step| (step - period_s).abs() > LEAP * period_s)?;
    let name = TIMES.into_iter().find(|name| table.names().any(|known| known == *name))?;
    let is_dated =
        table.f64(name).map_or(true, |own| own.first().is_some_and(|&s| moment::is_date(s)));
    let place = table.origin().place(row + 1);
    Some(RecordError::Leap { place, step_s: steps[row], period_s, is_dated })
}

/// Times in seconds; dates relative to the first.
fn seconds(table: &Table, name: &str) -> Result<Vec<f64>, RecordError> {
    let Ok(texts) = table.text(name) else {
        let times_s = finite(table, name)?;
        // Seconds since 1970 are unreadable in messages, so they become relative to the first.
        let begin_s = times_s.first().copied().filter(|begin_s| *begin_s > moment::CALENDAR_S);
        return Ok(times_s.iter().map(|time_s| time_s - begin_s.unwrap_or(0.0)).collect());
    };
    let mut clock = Clock::default();
    let read = |(row, text): (usize, &String)| {
        clock.read(text).ok_or_else(|| RecordError::NoDate {
            column: name.into(),
            place: table.origin().place(row),
            text: text.clone(),
        })
    };
    let times_s: Vec<f64> = texts.iter().enumerate().map(read).collect::<Result<_, _>>()?;
    let begin_s = times_s.first().copied().unwrap_or(0.0);
    Ok(times_s.into_iter().map(|time_s| time_s - begin_s).collect())
}

/// The inputs: from their columns, otherwise at their defaults.
fn inputs(table: &Table, system: &System, period_s: f64) -> Result<Vec<Piecewise>, RecordError> {
    let mut varies = false;
    let network = system.network();
    let mut signals = Vec::new();
    for (place, input) in network.inputs.iter().enumerate() {
        let Some(name) = recording::column(table, &input.id, input.unit) else {
            signals.push(Piecewise::constant(input.default).expect("a default is finite"));
            continue;
        };
        let values = finite(table, name)?;
        let declared = log_unit(table, name, input.unit);
        check_input(name, &values, declared, input.default, network.input_range(place))?;
        varies |= values.iter().any(|value| *value != values[0]);
        signals.push(smooth(period_s, &values));
    }
    if !varies {
        let names: Vec<String> =
            network.inputs.iter().map(|i| with_suffix(&i.id, i.unit)).collect();
        let what = format!("no input varies (columns {})", names.join(", "));
        return Err(RecordError::NoMotion { what });
    }
    Ok(signals)
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
    if let Some(misread) = misread {
        let ((seems, remedy), symbol) = (misread.in_words(declared), unit.symbol());
        let largest = moment::rounded(largest);
        let reason = format!("{column} seems {seems}: it reaches {largest} {symbol}; {remedy}");
        return Err(RecordError::Mistaken(reason));
    }
    match values.iter().find(is_outside) {
        Some(&value) => Err(RecordError::Input { column: column.into(), value, range, unit }),
        None => Ok(()),
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
