//! Guards of a log, shared by all clients: what is refused before a log is watched, and what is said of it afterwards.
//!
//! [`plan`] maps the columns of a log by their names, [`require`] checks a map that a person wrote, [`trial`] reads the
//! first minute beside the twin, and [`unjudged`] explains a log in which nothing was judged.

use super::counts::{Irregularity, WatchCounts};
use super::map::{Guess, Map, Trust, guess, other_raster};
use super::plausibility::{Plausibility, columns};
use super::source::{LogColumn, Source, SourceError};
use super::{End, Observer, Watch, WatchError};
use servotwin::beside::InputMistake;
use servotwin::fit::RecordError;
use servotwin::study::Study;
use servotwin::system::System;
use servotwin::toml_text::TomlError;
use servotwin::units;
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_io::table::TableError;
use servotwin_io::text::rounded;
use servotwin_io::{moment, sanitize};
use std::sync::atomic::{AtomicBool, Ordering};

/// How much of a log is tried before it is judged, s.
const TRIAL_S: f64 = 60.0;
/// So often while nothing moves.
const TRIALS: usize = 30;

/// Why a log cannot be read.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
pub enum IntakeError {
    /// It cannot be read, or the requested span is empty.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// The map does not fit it.
    #[error(transparent)]
    Map(TomlError),
    /// An input and a sensor of the system have the same name.
    #[error(transparent)]
    Table(#[from] TableError),
    /// Without a map: the log has no time, or no sensor of the system.
    #[error(transparent)]
    Record(RecordError),
    /// The columns cannot be read as one log, or contradict the map.
    #[error("{log}: {reason}")]
    Refused { log: String, reason: String },
}

/// A log's map, and what a person should know of it.
pub struct LogPlan {
    /// The map.
    pub map: Map,
    /// What may be wrong with it.
    pub warnings: Vec<String>,
    /// What the log lacks.
    pub notes: Vec<String>,
}

/// Maps the columns of a log whose names identify them. `is_study_named` states whether a person named the study.
///
/// # Errors
/// No column is a sensor, the command is missing, a unit is not known, or the columns have different times.
pub fn plan(
    log: &str,
    columns: &[LogColumn],
    study: &Study,
    is_study_named: bool,
) -> Result<LogPlan, IntakeError> {
    let guess = guess(columns, study, Trust::Certain);
    if guess.sensors.len() == study.system.sensors.len() {
        return Err(foreign(log, columns, study, is_study_named));
    }
    let plan = mapped(log, &guess, study)?;
    require(log, columns, &plan.map, study)?;
    Ok(plan)
}

/// The map of a guess.
///
/// # Errors
/// Its times count rows at a rate that nobody knows, or a unit is not known.
pub(crate) fn mapped(log: &str, guess: &Guess, study: &Study) -> Result<LogPlan, IntakeError> {
    if let Some(name) = &guess.counter {
        return Err(refused(
            log,
            format!(
                "'{}' counts rows or milliseconds and has no unit: below [time] of a map file, which --make-map writes, \
                 rate_hz = {} instead of column counts rows, and unit = \"ms\" reads milliseconds",
                sanitize::text(name),
                rounded(1.0 / study.sample_period_s, 3)
            ),
        ));
    }
    let map = Map::parse(&guess.text, "the columns as they were found", &study.system);
    let (warnings, notes) = guess.remarks();
    Ok(LogPlan { map: map.map_err(IntakeError::Map)?, warnings, notes })
}

/// Checks that a map has the study's command, and that its columns have one time. Without the command, the twin would
/// stand still beside a moving actuator, and the diagnosis would report false faults.
///
/// # Errors
/// The command is missing, or the columns have different times.
pub fn require(
    log: &str,
    columns: &[LogColumn],
    map: &Map,
    study: &Study,
) -> Result<(), IntakeError> {
    require_one_time(log, columns, map)?;
    let command = study.command_input;
    if !map.is_default(command) {
        return Ok(());
    }
    let is_unused = |name: &&str| !map.wanted().names.iter().any(|wanted| wanted == name);
    let unused: Vec<&str> = columns.iter().map(|c| c.name.as_str()).filter(is_unused).collect();
    let unused = match (columns.is_empty(), unused.is_empty()) {
        (true, _) => String::new(),
        (_, true) => ", and no column is left that may be it".into(),
        _ => format!("; columns that nothing was found for: {}", sanitize::list(&unused)),
    };
    let input = &study.system.network().inputs[command];
    let (id, unit) = (&input.id, units::word(input.unit));
    Err(refused(
        log,
        format!(
            "no column is the input '{id}', which the study '{}' commands, and without it the twin stands still{unused}; \
             name its column in a map file (--make-map writes one) below [inputs], {id} = {{ column = \"…\", unit = \"{unit}\" }}, \
             or say that it is the same always, {id} = {{ value = {:?}, unit = \"{unit}\" }}",
            study.name, input.default
        ),
    ))
}

/// Checks that the columns of a map have one time.
///
/// # Errors
/// A column stands behind another time than that of the map.
pub(crate) fn require_one_time(
    log: &str,
    columns: &[LogColumn],
    map: &Map,
) -> Result<(), IntakeError> {
    let name = map.time_column().map(|(name, _)| name);
    let time = columns.iter().position(|column| name == Some(&column.name));
    let is_used = |column: usize| map.wanted().names.contains(&columns[column].name);
    match time.and_then(|time| other_raster(columns, time, &is_used)) {
        Some(reason) => Err(refused(log, reason)),
        None => Ok(()),
    }
}

fn refused(log: &str, reason: String) -> IntakeError {
    IntakeError::Refused { log: log.to_owned(), reason }
}

/// The error for a log without any sensor of the study.
pub fn foreign(
    log: &str,
    columns: &[LogColumn],
    study: &Study,
    is_study_named: bool,
) -> IntakeError {
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    let names = sanitize::list(&names);
    let (name, system) = (&study.name, &study.system.name);
    let what = match is_study_named {
        true => "--study names another, --make-map writes a map to be filled in",
        false => "it is taken where --study names none",
    };
    let reason = format!(
        "no column is a sensor of the study '{name}' of the system '{system}': {what}; the columns are {names}"
    );
    refused(log, reason)
}

/// A log, and who observes it.
pub type Opened<'o> = (Box<dyn Source + 'o>, Box<dyn Observer + 'o>);

/// Opens a log with a map, and makes a new observer for it.
pub(crate) type Open<'o, E> = dyn FnMut(&Map) -> Result<Opened<'o>, E> + 'o;

/// The result of a trial.
pub struct Trial {
    /// What contradicts the map, as sentences.
    pub contradictions: Vec<String>,
    /// The offset of the log's clock from UTC, s, if its dates have one.
    pub zone_s: Option<f64>,
}

/// Reads the first minute of a log with motion beside the twin. If the twin does not follow, it is tried whether it does with the
/// command in another unit, or exchanged with a sensor.
///
/// # Errors
/// The source cannot be read.
pub fn trial<E: From<WatchError>>(
    open: &mut Open<E>,
    map: &Map,
    study: &Study,
    period_s: f64,
) -> Result<Trial, E> {
    let system = &study.system;
    let (mut source, mut observer) = open(map)?;
    let (evidence, counts) = first_motion(&mut *source, map, &mut *observer, study, period_s)?;
    let zone_s = source.zone_s();
    if let Some(pace) = evidence.other_time_unit(period_s) {
        return Ok(Trial { contradictions: vec![pace], zone_s });
    }
    let mut rerun = |mistake: &InputMistake| {
        let Some(map) = map.without_mistake(study.command_input, mistake) else { return Ok(None) };
        let (mut source, mut observer) = open(&map)?;
        let (evidence, _) = first_motion(&mut *source, &map, &mut *observer, study, period_s)?;
        Ok::<_, E>(Some(evidence.beside))
    };
    let command = (map.id(study.command_input), map.unit(study.command_input));
    let mistake = evidence.beside.input_mistake(command, &columns(system, map), &mut rerun)?;
    let contradictions = match mistake {
        Some(mistake) => vec![mistake],
        None => evidence.contradictions(system, map, &counts),
    };
    Ok(Trial { contradictions, zone_s })
}

/// Reads minutes until something moves.
fn first_motion(
    source: &mut dyn Source,
    map: &Map,
    observer: &mut dyn Observer,
    study: &Study,
    period_s: f64,
) -> Result<(Plausibility, WatchCounts), WatchError> {
    let mut watch = Watch::new(source, map, observer, period_s);
    for _ in 0..TRIALS {
        let (stop, mut calls) = (AtomicBool::new(false), 0.0);
        let end = watch.run(&stop, &mut |_, _| {
            // A watch of a log shows each thousand samples.
            calls += 1000.0;
            stop.store(calls * period_s > TRIAL_S, Ordering::Relaxed);
        })?;
        let evidence = &watch.plausibility;
        if end == End::Complete
            || evidence.beside.has_motion(&columns(&study.system, map))
            || evidence.other_time_unit(period_s).is_some()
        {
            break;
        }
    }
    Ok((watch.plausibility.clone(), watch.counts().clone()))
}

/// The range of each input of the system that the diagnoser accepts.
pub fn accepted_ranges(diagnoser: &Diagnoser, system: &System) -> Vec<(f64, f64)> {
    let known = |id: &str| diagnoser.environment.inputs.iter().find(|input| input.name == id);
    let inputs = system.network().inputs.iter().map(|input| known(&input.id));
    let all = (f64::NEG_INFINITY, f64::INFINITY);
    inputs.map(|input| input.map_or(all, |input| (input.least, input.largest))).collect()
}

/// The sensors that a diagnoser reads.
pub fn needed<'s>(diagnoser: &Diagnoser, system: &'s System) -> Vec<&'s str> {
    let read = |id: &String| diagnoser.sensors.iter().any(|sensor| sensor.name == *id);
    let sensors = system.sensors.iter().filter(|sensor| read(&sensor.id));
    sensors.map(|sensor| sensor.id.as_str()).collect()
}

/// Reports channels without a value in some of the samples.
pub fn lost_in_words(map: &Map, counts: &WatchCounts) -> Option<String> {
    lost(map, counts, &|_| true).map(|lost| format!("samples without a value: {lost}"))
}

/// Why a log gave no sample.
pub fn nothing(map: &Map, counts: &WatchCounts) -> String {
    let timeless = counts.of(Irregularity::NoTime);
    match counts.frames {
        0 => "nothing stands below the names of its columns".to_owned(),
        frames if timeless.count == frames => {
            let text = timeless.detail.trim_matches('\'');
            let is_time = moment::seconds(text).is_some() && !map.wanted().dates;
            let remedy = match (timeless.detail.contains("': "), is_time) {
                (true, _) => "",
                (_, true) => {
                    "; unit = \"date\" below [time] in a map file reads it, and --make-map writes it"
                }
                (_, false) => {
                    "; write times as numbers, 08:15:02.5 or 2026-11-21T08:15:02.5; or rate_hz with the rate of the log \
                     instead of column below [time] of a map file counts rows"
                }
            };
            format!("no row has a time ({}){remedy}", counts.place(timeless))
        }
        _ => {
            let met = counts.met().map(|(kind, tally)| {
                format!("{} in {}, first {}", kind.words().1, tally.count, counts.place(tally))
            });
            format!("no row is a sample: {}", met.collect::<Vec<_>>().join("; "))
        }
    }
}

/// Warns of a diagnoser of records, which gathers no evidence.
pub fn of_records(diagnoser: &Diagnoser) -> Option<String> {
    let record_s = diagnoser.record_s()?;
    Some(format!(
        "this diagnoser judges each record of {record_s} s alone and gathers no evidence over time: do not use it in \
         operation"
    ))
}

/// Why nothing was judged in a log: the doubts, missing sensors, or else gaps.
pub fn unjudged(
    mut doubts: Vec<String>,
    map: &Map,
    diagnoser: &Diagnoser,
    system: &System,
    counts: &WatchCounts,
) -> String {
    let needed = needed(diagnoser, system);
    let without: Vec<&str> = map.unmeasured().filter(|id| needed.contains(id)).collect();
    if !without.is_empty() {
        doubts.push(format!("the log has no {}", without.join(", ")));
    }
    if doubts.is_empty() {
        let shortest = diagnoser.lengths.iter().map(|length| length.span.samples()).min();
        let shortest_s = shortest.map_or(0.0, |samples| samples as f64 * diagnoser.period_s);
        doubts.push(gaps(map, &needed, counts, shortest_s));
        let most = counts.met().max_by_key(|(_, tally)| tally.count);
        doubts.extend(most.map(|(kind, tally)| {
            let (what, place) = (kind.words().1, counts.place(tally));
            format!(
                "{what} in {} of {} {}s, first {place}",
                tally.count, counts.frames, counts.counted
            )
        }));
    }
    doubts.join("; ")
}

/// Explains why no sample was judged in a log that has all columns, the right units and a sufficient rate.
fn gaps(map: &Map, needed: &[&str], counts: &WatchCounts, shortest_s: f64) -> String {
    let samples = counts.samples;
    let is_needed = |channel: usize| channel >= map.inputs() && needed.contains(&map.id(channel));
    match lost(map, counts, &is_needed) {
        Some(lost) => format!("of {samples} samples are without a value: {lost}"),
        None => {
            format!("of {samples} samples no {shortest_s} s without a gap, the shortest window")
        }
    }
}

/// The channels without a value in some of the samples, and in how many.
fn lost(map: &Map, counts: &WatchCounts, is_meant: &dyn Fn(usize) -> bool) -> Option<String> {
    let lost = counts.missing.iter().enumerate();
    let lost = lost.filter(|(channel, count)| **count > 0 && is_meant(*channel));
    let lost: Vec<String> =
        lost.map(|(channel, count)| format!("{} in {count}", map.id(channel))).collect();
    (!lost.is_empty()).then(|| lost.join(", "))
}
