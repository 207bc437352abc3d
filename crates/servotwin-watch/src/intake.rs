//! Reads a whole log for `servotwin fit` and `servotwin history`, with the sources, map and rules of `servotwin watch`.
//! Samples are not put onto the period.
//!
//! Rows with the same time form one sample. A sample that arrives slightly late is sorted in. A few samples whose time
//! no others confirm are dropped. All of this is counted. The result is a [`Table`] in SI units.

use super::counts::{Irregularity, WatchCounts};
use super::cut::Cut;
use super::guard::{self, IntakeError, LogPlan};
use super::map::{Map, Trust, guess};
use super::plausibility::coarse_in_words;
use super::sequencer::Stamped;
use super::source::{Address, LogRow, Read, Source, SourceError};
use super::span::LogSpan;
use servotwin::fit::{RecordError, TIME_UNIT, unit_key};
use servotwin::recording::with_suffix;
use servotwin::study::Study;
use servotwin_io::moment;
use servotwin_io::table::{Column, Table, TableError};
use std::path::Path;

/// The column with the times.
const TIME: &str = "time_s";

/// Equal times may differ by this rounding error, relative to the time between them.
const ROUNDING: f64 = 1e-4;

/// A log, read to its end.
#[derive(Debug, Clone, PartialEq)]
pub struct Whole {
    /// `time_s`, then the inputs and sensors that the log or the map supplies, named with units; NaN means missing.
    pub table: Table,
    /// The counts of rows and irregularities.
    pub counts: WatchCounts,
    /// What may be wrong with a map that was made from the names of the columns.
    pub warnings: Vec<String>,
}

/// Reads a span of a log with a map. Without a map, columns are found by their names.
///
/// # Errors
/// The log cannot be read, the map does not fit it, or no row lies in the span.
pub fn read(
    path: &Path,
    map: Option<&Map>,
    span: LogSpan,
    study: &Study,
) -> Result<Whole, IntakeError> {
    let address = Address::File(path.into());
    match map {
        Some(map) => read_mapped(&address, map, span, study, vec![]),
        None => {
            let LogPlan { map, warnings, .. } = guessed(&address, study)?;
            read_mapped(&address, &map, span, study, warnings)
        }
    }
}

/// Opens a source, or a part of it, with the map of its columns.
///
/// # Errors
/// The source cannot be opened, or lacks a column of the map.
pub fn open(address: &Address, map: &Map, span: LogSpan) -> Result<Box<dyn Source>, IntakeError> {
    let source = address.open(map.wanted()).map_err(|error| match map.explain(error) {
        Ok(mistakes) => IntakeError::Map(mistakes),
        Err(error) => IntakeError::Source(error),
    })?;
    Ok(match span.is_whole() {
        true => source,
        false => Box::new(Cut::new(source, address.to_string(), map, span)),
    })
}

fn read_mapped(
    address: &Address,
    map: &Map,
    span: LogSpan,
    study: &Study,
    warnings: Vec<String>,
) -> Result<Whole, IntakeError> {
    let (log, source) = (address.to_string(), open(address, map, span)?);
    if map.wanted().columns.is_empty() {
        guard::require_one_time(&log, &address.columns()?, map)?;
    }
    let counted = source.counted();
    let (samples, counts) = samples(source, map)?;
    if samples.is_empty() && counts.frames > 0 {
        return Err(IntakeError::Refused { log, reason: guard::nothing(map, &counts) });
    }
    let end = |sample: Option<&Stamped>| sample.map_or((0, f64::NAN), |s| (s.place, s.time_s));
    match coarse_in_words(&counts, [end(samples.first()), end(samples.last())], map) {
        Some(reason) => Err(IntakeError::Refused { log, reason }),
        None => Ok(Whole { table: table(&samples, counted, map, study)?, counts, warnings }),
    }
}

/// A map guessed from the column names.
fn guessed(address: &Address, study: &Study) -> Result<LogPlan, IntakeError> {
    let guess = guess(&address.columns()?, study, Trust::Certain);
    if guess.sensors.len() == study.system.sensors.len() {
        return Err(IntakeError::Record(RecordError::no_sensor(&study.system)));
    }
    if !guess.time {
        return Err(IntakeError::Record(RecordError::no_time()));
    }
    guard::mapped(&address.to_string(), &guess, study)
}

/// Reads all samples, ordered by time.
fn samples(
    mut source: Box<dyn Source>,
    map: &Map,
) -> Result<(Vec<Stamped>, WatchCounts), SourceError> {
    let mut counts = WatchCounts::new(source.counted(), map.width());
    let (mut samples, mut row, mut rows) = (vec![], LogRow::default(), 0);
    loop {
        match source.read(&mut row)? {
            Read::Row => {
                let sample = map.sample(&row, rows);
                if row.bad > 0 {
                    let detail = row.bad_in_words(map.wanted());
                    counts.note_with(Irregularity::BadValue, row.place, &detail);
                }
                match sample.time_s.is_finite() {
                    true => put(&mut samples, sample, map, &mut counts),
                    false => counts.note(Irregularity::NoTime, row.place),
                }
            }
            Read::Flawed(flaw) => counts.note_flaw(row.place, &flaw),
            Read::Nothing | Read::Pause | Read::Dropped(_) => continue,
            Read::End => break,
        }
        (rows, counts.frames) = (rows + 1, counts.frames + 1);
    }
    let samples = confirmed(samples, map, &mut counts);
    counts.samples = samples.len() as u64;
    Ok((samples, counts))
}

/// Appends a sample; a slightly late one is sorted in.
fn put(samples: &mut Vec<Stamped>, sample: Stamped, map: &Map, counts: &mut WatchCounts) {
    let newest_s = samples.last().map_or(f64::NEG_INFINITY, |last: &Stamped| last.time_s);
    let is_late = sample.time_s < newest_s && newest_s - sample.time_s <= map.rules.wait_s;
    let behind = match is_late {
        true => samples.iter().rposition(|other| other.time_s <= sample.time_s),
        false => samples.len().checked_sub(1),
    };
    if let Some(place) = behind
        && samples[place].time_s == sample.time_s
    {
        let kind = samples[place].kind_of_other(&sample);
        if !samples[place].fill_from(&sample) {
            counts.note(kind, sample.place);
        }
        return;
    }
    if is_late {
        counts.note(Irregularity::Reordered, sample.place);
        samples.insert(behind.map_or(0, |place| place + 1), sample);
    } else {
        samples.push(sample);
    }
}

/// Drops groups of samples between two leaps in time that are too small to confirm their times, as a watch does.
fn confirmed(samples: Vec<Stamped>, map: &Map, counts: &mut WatchCounts) -> Vec<Stamped> {
    let is_leap = |pair: [&Stamped; 2]| {
        let step_s = pair[1].time_s - pair[0].time_s;
        !(0.0..=map.rules.longest_gap_s).contains(&step_s)
    };
    let groups: Vec<&[Stamped]> = samples.chunk_by(|one, other| !is_leap([one, other])).collect();
    let is_confirmed = |group: &&[Stamped]| group.len() >= map.rules.witnesses;
    if groups.len() < 2 || !groups.iter().any(is_confirmed) {
        return samples;
    }
    for sample in groups.iter().filter(|group| !is_confirmed(group)).flat_map(|group| *group) {
        counts.note_with(Irregularity::Outlier, sample.place, &moment::shown(sample.time_s));
    }
    groups.into_iter().filter(is_confirmed).flatten().cloned().collect()
}

/// The samples as a table of the log's columns, including held values and constants.
fn table(
    samples: &[Stamped],
    counted: &'static str,
    map: &Map,
    study: &Study,
) -> Result<Table, TableError> {
    let times_s: Vec<f64> = samples.iter().map(|sample| sample.time_s).collect();
    let network = study.system.network();
    let inputs = network.inputs.iter().map(|input| input.unit);
    let dimensions = inputs.chain(study.system.sensors.iter().map(|sensor| sensor.unit));
    let mut units = vec![];
    let mut columns = vec![Column::new(TIME, "s", times_s.clone())];
    for (channel, unit) in dimensions.enumerate() {
        let values = match (map.is_column(channel), map.constant(channel)) {
            (true, _) => {
                let of = |sample: &Stamped| sample.values[channel];
                let mut values: Vec<f64> = samples.iter().map(of).collect();
                hold(&mut values, &times_s, map.hold_s(channel));
                values
            }
            (false, Some(value)) if !map.is_default(channel) => vec![value; samples.len()],
            (false, _) => continue,
        };
        let name = with_suffix(map.id(channel), unit);
        units.push((unit_key(&name), map.unit(channel).symbol));
        columns.push(Column::new(name, unit.symbol(), values));
    }
    let unit_s = map.time_column().map_or(1.0, |(_, unit_s)| unit_s);
    let table = Table::from_columns(columns)?.with_metadata(TIME_UNIT, unit_s.to_string());
    let table = units.into_iter().fold(table, |table, (key, unit)| table.with_metadata(key, unit));
    Ok(table.with_places(counted, samples.iter().map(|sample| sample.place)))
}

/// Replaces missing values by the last value, for at most `hold_s` seconds.
fn hold(values: &mut [f64], times_s: &[f64], hold_s: f64) {
    let mut last: Option<(f64, f64)> = None;
    for (value, &time_s) in values.iter_mut().zip(times_s) {
        if !value.is_nan() {
            last = Some((time_s, *value));
        } else if let Some((at_s, held)) = last
            && time_s - at_s <= hold_s * (1.0 + ROUNDING)
        {
            *value = held;
        }
    }
}
