//! `servotwin history`: follows wear over the flights of one tail number.

use super::fit::{chosen_faults, read_study, tell};
use super::log_folder::LogFolder;
use super::progress::Stages;
use super::{SpanOptions, note, note_intake};
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::{Global, Run, stop};
use servotwin::fit::history::{Drift, History, HistoryFlight, Log, Track};
use servotwin::fit::repair::Repair;
use servotwin::fit::trend::{Point, Trend};
use servotwin::fit::{Fit, FitError, FitRecord, Knowledge, RecordError};
use servotwin::moment;
use servotwin::shown::number;
use servotwin::study::Study;
use servotwin::table::{self, Column, Table, TableError, Values};
use servotwin_view::document::{Document, Table as Rows, Value, Verdict, line};
use servotwin_view::row;
use servotwin_view::time_series::{Band, Panel, Series, TimeSeries};
use servotwin_watch::guard::IntakeError;
use servotwin_watch::intake;
use servotwin_watch::map::Map;
use servotwin_watch::span::LogSpan;
use std::cmp::Ordering;
use std::path::{Path, PathBuf};
use std::sync::atomic::{self, AtomicUsize};

/// Follow the wear of one tail number: each fault with its trend and the time to a threshold.
///
/// The log of each flight is fitted. The logs of the folder are read in the order of their names, in which numbers
/// count as numbers, or of the dates in them. Each is a record as for `servotwin fit`. Files that are not records,
/// and entries that are not regular files, are reported and skipped. If an intensity falls, the command reports a
/// repair, and the trend starts again from there. If an intensity has reached the threshold, or may reach it within
/// the flights of --within (95 % interval), the command raises an alarm: the exit code is 1.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The folder with the logs (.csv, .parquet, .mcap, .jsonl).
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
    /// The system file [default: the study's system].
    #[arg(value_name = "SYSTEM")]
    system: Option<PathBuf>,
    /// A study file with the tolerances and faults [default: paper].
    #[arg(long, value_name = "STUDY")]
    study: Option<PathBuf>,
    /// A map file that assigns the columns of a log to inputs and sensors with their units, as for `servotwin watch`
    /// (docs/watch.md).
    #[arg(long, value_name = "FILE")]
    map: Option<PathBuf>,
    #[command(flatten)]
    span: SpanOptions,
    /// Track these faults, separated by commas [default: the faults found in the flights with findings].
    #[arg(long, value_name = "IDS", value_delimiter = ',')]
    faults: Vec<String>,
    /// Intensity that no fault may reach.
    #[arg(long, value_name = "INTENSITY", default_value_t = 0.5)]
    threshold: f64,
    /// Raise an alarm if the threshold may be reached within this number of flights.
    #[arg(long, value_name = "FLIGHTS", default_value_t = 20)]
    within: u32,
    /// Write a table with one row for each flight (.csv or .parquet).
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Draw intensities, trends and parameters to a .svg or .png file.
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Number of threads [default: all processors; the results do not depend on it].
    #[arg(long, value_parser = super::threads)]
    threads: Option<usize>,
}

impl Run for Options {
    fn paths(&self) -> Paths {
        Paths::default()
            .read("the log", LogFolder::read(&self.folder).unwrap_or_default().paths)
            .read("SYSTEM", &self.system)
            .read_study(self.study.as_ref())
            .read("--map", &self.map)
            .write("--out", Format::Table, &self.out)
            .write("--plot", Format::Figure, &self.plot)
    }

    fn run(&self, global: Global) -> Result<Document, Failure> {
        if !(self.threshold > 0.0 && self.threshold <= 1.0) {
            let range = "above 0, at most 1";
            return Err(Failure::out_of_range("--threshold", self.threshold, range));
        }
        let study = read_study(self.study.as_deref(), self.system.as_deref())?;
        let map = self.map.as_ref().map(|path| Map::read(path, &study.system)).transpose()?;
        let folder = LogFolder::read(&self.folder)?;
        if let Some(skipped) = folder.sentence() {
            note(global, &skipped);
        }
        let span = self.span.read()?;
        stop::heed();
        let stages = Stages::new(global);
        let mut all: Vec<(Option<f64>, Log)> = Vec::new();
        for path in &folder.paths {
            let name = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into());
            let (begin_s, record) = record(path, &name, map.as_ref(), span, &study, global);
            if let Ok(record) = &record {
                tell(&name, record, &study, global);
            }
            all.push((begin_s, (name, record)));
        }
        let all = in_order(all, global);
        if let [(name, Err(error)), ..] = &all[..]
            && all.iter().all(|(_, record)| record.is_err())
        {
            let folder = self.folder.display();
            return Err(Failure::input(format!(
                "{folder}: none of its logs can be used; {name}: {error}"
            )));
        }
        let (runs, usual) = (AtomicUsize::new(0), 300.0 * folder.paths.len() as f64);
        let progress = || {
            let done = runs.fetch_add(1, atomic::Ordering::Relaxed) + 1;
            stages.show(&format!("{done} runs"), (done as f64 / usual).min(0.99));
        };
        let problem = Fit::of_study(&study, Vec::new());
        let problem = Fit {
            threads: self.threads.unwrap_or(problem.threads).max(1),
            cancel: Some(stop::flag()),
            progress: &progress,
            ..problem
        };
        let faults = chosen_faults(&self.faults, &problem)?;
        let history = problem.history(all, &faults)?;
        stages.end();
        if let Some(path) = &self.out {
            table::write(path, &as_table(&history, &problem)?)?;
        }
        if let Some(path) = &self.plot {
            figure(&history, &problem, self.threshold).draw().save(path)?;
        }
        let mut document = described(&history, &problem, self);
        let mut skipped = Rows::of("name: | reason:");
        folder.skipped.into_iter().for_each(|(name, why)| skipped.push(row![name, why]));
        document.table("skipped", skipped);
        Ok(document)
    }
}

/// The logs in the order of the dates in them, of the dates in their names where a log has none, or else of their names.
fn in_order(mut all: Vec<(Option<f64>, Log)>, global: Global) -> Vec<Log> {
    let usable = || all.iter().filter(|(_, (_, record))| record.is_ok());
    let dated = usable().filter(|(begin_s, _)| begin_s.is_some()).count();
    let is_in_names = dated == 0 && usable().all(|(_, (name, _))| date_in(name).is_some());
    let is_dated = dated == usable().count() || is_in_names;
    if is_in_names {
        all.iter_mut().for_each(|(begin_s, (name, _))| *begin_s = date_in(name));
    }
    let days: Vec<f64> = all.iter().filter_map(|(begin_s, _)| *begin_s).collect();
    let is_sorted = days.is_sorted();
    if is_dated && !is_sorted {
        all.sort_by(|(one, _), (other, _)| one.partial_cmp(other).unwrap_or(Ordering::Equal));
        let place = if is_in_names { "names" } else { "logs" };
        let text = format!(
            "the flights are in the order of the dates in their {place}, which is not that of their names"
        );
        note(global, &text);
    } else if !is_sorted {
        let text = format!(
            "the flights are in the order of their names, which contradicts the dates in {dated} of {} logs: name them \
             by their dates (2026-11-21)",
            all.len()
        );
        note(global, &text);
    } else if let Some(name) = all.iter().map(|(_, (name, _))| name).find(|n| is_doubtful(n)) {
        let text = format!(
            "the flights are in the order of their names: whether '{}' begins with the day or the month is not known; \
             name them by their dates (2026-11-21)",
            servotwin::sanitize::text(name)
        );
        note(global, &text);
    }
    all.into_iter().map(|(_, log)| log).collect()
}

/// The parts of a file's name that may be a date.
fn parts_of(name: &str) -> impl Iterator<Item = &str> {
    let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
    stem.split(['_', ' '])
}

/// The date in a file's name, s since 1970.
fn date_in(name: &str) -> Option<f64> {
    parts_of(name).find_map(moment::seconds)
}

/// Whether a file's name has a date whose order of day and month is not known.
fn is_doubtful(name: &str) -> bool {
    parts_of(name).any(|part| moment::refusal(part).is_some())
}

/// The first time of a log, if that is a date, and the log as a record.
type DatedRecord = (Option<f64>, Result<FitRecord, RecordError>);

/// Reads a log as a record. An unreadable table and one without a usable signal both count as unusable, and do not end
/// the history of the others.
fn record(
    path: &Path,
    name: &str,
    map: Option<&Map>,
    span: LogSpan,
    study: &Study,
    global: Global,
) -> DatedRecord {
    let error = match intake::read(path, map, span, study) {
        Ok(whole) => {
            note_intake(&path.display().to_string(), &whole, global);
            let table = whole.table;
            let begin_s = table.f64("time_s").ok().and_then(|times_s| times_s.first().copied());
            let record = FitRecord::from_table(name, &table, &study.system);
            return (begin_s.filter(|begin_s| moment::is_date(*begin_s)), record);
        }
        Err(error) => error,
    };
    let text = match error {
        IntakeError::Record(error) => return (None, Err(error)),
        IntakeError::Refused { reason, .. } => reason,
        IntakeError::Table(TableError::Content { problem, .. }) => problem.to_string(),
        IntakeError::Map(lacking) => lacking.to_string().lines().next().unwrap_or_default().into(),
        error => error.to_string(),
    };
    // The caller names the log.
    let text = text.strip_prefix(&format!("{}: ", path.display())).map_or(text.clone(), Into::into);
    (None, Err(RecordError::Column(text)))
}

/// The alarm sentence of a track, if it may reach its threshold.
fn alarm(track: &Track, options: &Options) -> Option<String> {
    let Some(trend) = &track.trend else {
        // Without a trend, the last level alone may prove that the threshold is reached.
        let last = track.points.last()?;
        let is_reached = last.level - 1.96 * last.error >= options.threshold;
        return is_reached.then(|| format!("{} has reached {}", track.name, options.threshold));
    };
    let reached = trend.reaches(options.threshold);
    let earliest = reached.earliest.filter(|flights| *flights <= f64::from(options.within))?;
    // A wide interval alone is no alarm. The wear must be growing significantly.
    let is_growing = trend.significance() > 3.0 || reached.expected == Some(0.0);
    is_growing.then(|| match reached.expected {
        Some(0.0) => format!("{} has reached {}", track.name, options.threshold),
        _ => format!(
            "{} may reach {} in {} flights",
            track.name,
            options.threshold,
            number(earliest.ceil(), 4)
        ),
    })
}

/// The intensity of a track in a flight, with its standard error.
fn of_flight(track: &Track, flight: usize) -> Option<(f64, f64)> {
    let point = track.points.iter().find(|point| point.at == flight as f64)?;
    Some((point.level, point.error))
}

fn verdict(flight: &HistoryFlight, problem: &Fit) -> String {
    match &flight.fitted {
        // The caller names the log.
        Err(FitError::Record { error, .. }) => format!("{error}"),
        Err(error) => format!("{error}"),
        Ok(fitted) => match fitted.findings.first() {
            None => "healthy".into(),
            Some(finding) => finding.sentence(problem),
        },
    }
}

/// Describes in a clause when a trend reaches a threshold.
fn when(trend: &Trend, threshold: f64) -> String {
    let reached = trend.reaches(threshold);
    let flights = |value: f64| number(value.round(), 4);
    match (reached.expected, reached.earliest, reached.latest) {
        (Some(0.0), ..) => format!("has reached {threshold}"),
        (None, None, _) => "no trend: the threshold is not reached".into(),
        (None, Some(earliest), _) => {
            format!(
                "no trend: {threshold} is not reached before {} flights (95 %)",
                flights(earliest)
            )
        }
        (Some(expected), earliest, latest) => {
            let earliest = flights(earliest.unwrap_or(0.0));
            let interval = match latest {
                Some(latest) => format!("{earliest} … {}", flights(latest)),
                None => format!("{earliest} or more"),
            };
            format!("reaches {threshold} in {} flights (95 %: {interval})", flights(expected))
        }
    }
}

fn sentence(track: &Track, threshold: f64) -> String {
    let Some(trend) = &track.trend else {
        let since = if track.last_repair().is_some() { " since the repair" } else { "" };
        return format!("{}: too few flights{since} for a trend", track.name);
    };
    let last = trend.last();
    format!(
        "{} ({:.0} %): {} ± {}, {} a flight; {}",
        track.name,
        100.0 * track.probability,
        number(last.level, 3),
        number(1.96 * last.variance[0].sqrt(), 2),
        number(last.rate, 2),
        when(trend, threshold)
    )
}

/// Describes a drop in intensity in a sentence.
fn repaired(repair: &Repair, track: &Track, history: &History) -> String {
    let place = repair.at as usize;
    let log = history.flights.get(place).map_or("", |flight| &flight.name);
    let (name, fall) = (&track.name, number(repair.fall, 2));
    match repair.is_confirmed {
        true => format!(
            "{name}: repaired before flight {place} ({log}): the intensity falls by {fall}, and a new trend begins"
        ),
        false => format!(
            "{name}: flight {place} ({log}) is lower by {fall}: a repair or a bad flight; the next flight decides, and the trend leaves this one out"
        ),
    }
}

fn described(history: &History, problem: &Fit, options: &Options) -> Document {
    let alarms: Vec<String> =
        history.tracks.iter().filter_map(|track| alarm(track, options)).collect();
    let (threshold, within) = (options.threshold, options.within);
    let verdict = match (alarms.is_empty(), history.tracks.is_empty()) {
        (false, _) => Verdict::act(format!("alarm: {}", alarms.join("; "))),
        (true, true) if history.drifts.is_empty() => {
            Verdict::good("nothing to track: no flight has a finding that looks like a fault")
        }
        (true, _) => {
            Verdict::good(format!("no fault may reach {threshold} within {within} flights"))
        }
    };
    let mut document = Document::new("history", verdict);
    document.fact("threshold", "", Value::of("", &threshold));
    document.fact("alarms", "", Value::list(alarms));
    for track in &history.tracks {
        for repair in &track.repairs {
            document.text(repaired(repair, track, history));
        }
        document.text(sentence(track, threshold));
    }
    drifts(history, problem, &mut document);
    document.table("flights", flights(history, problem));
    tracks(history, threshold, &mut document);
    document
}

/// The flights with the intensities of every track.
fn flights(history: &History, problem: &Fit) -> Rows {
    let mut table = Rows::of("flight | log | is_usable: | is_healthy: | verdict:_");
    for track in &history.tracks {
        table.column(format!("intensity:{}", track.name), format!("{} ± 95 %", track.name));
    }
    for (place, flight) in history.flights.iter().enumerate() {
        let mut row = row![
            place,
            &flight.name,
            flight.fitted.is_ok(),
            flight.is_healthy(),
            verdict(flight, problem)
        ];
        row.extend(history.tracks.iter().map(|track| match of_flight(track, place) {
            Some((level, error)) => {
                let text = format!("{} ± {}", number(level, 3), number(1.96 * error, 2));
                Value::number(level, text)
            }
            None => Value { text: String::new(), ..Value::missing() },
        }));
        table.push(row);
    }
    table
}

/// The drifts of parameters inside of their tolerances.
fn drifts(history: &History, problem: &Fit, document: &mut Document) {
    let lines = history.drifts.iter().map(|Drift { unknown, trend, .. }| {
        let last = trend.last();
        line(
            "{parameter} drifts inside of its tolerance: {per_100_flights} standard deviations of it in a hundred \
             flights, now {sigmas}",
            [
                ("parameter", (&problem.unknowns[*unknown].name).into()),
                ("per_100_flights", Value::digits(100.0 * last.rate, 2)),
                ("sigmas", Value::digits(last.level, 2)),
            ],
        )
    });
    document.list("drifts", lines.collect::<Vec<_>>());
}

/// The tracks and repairs for programs.
fn tracks(history: &History, threshold: f64, document: &mut Document) {
    let mut table = Rows::of(
        "fault: | probability: | flights: | intensities: | errors: | level: | level_error: | rate_per_flight: | rate_error: | flights_to_threshold: | earliest_flights: | latest_flights:",
    );
    let mut repairs = Rows::of("fault: | flight: | log: | fall: | is_confirmed:");
    for track in &history.tracks {
        let each = |of: fn(&Point) -> f64| {
            Value::of("", &track.points.iter().map(of).collect::<Vec<f64>>())
        };
        let mut row = vec![
            (&track.name).into(),
            Value::of("", &track.probability),
            each(|point| point.at),
            each(|point| point.level),
            each(|point| point.error),
        ];
        let values = track.trend.as_ref().map(|trend| {
            let (last, reached) = (trend.last(), trend.reaches(threshold));
            let [level, rate] = [0, 2].map(|place| Some(last.variance[place].sqrt()));
            let reached = [reached.expected, reached.earliest, reached.latest];
            let trend = [Some(last.level), level, Some(last.rate), rate];
            trend.into_iter().chain(reached).collect()
        });
        let values: Vec<Option<f64>> = values.unwrap_or_else(|| vec![None; 7]);
        row.extend(values.iter().map(|value| Value::of("", value)));
        table.push(row);
        for repair in &track.repairs {
            let log = history.flights.get(repair.at as usize).map(|flight| flight.name.as_str());
            let (at, fall) = (Value::of("", &repair.at), Value::of("", &repair.fall));
            repairs.push(row![&track.name, at, log, fall, repair.is_confirmed]);
        }
    }
    document.table("tracks", table);
    document.table("repairs", repairs);
}

fn as_table(history: &History, problem: &Fit) -> Result<Table, Failure> {
    let count = history.flights.len();
    let texts = |of: &dyn Fn(&HistoryFlight) -> String| {
        Values::Text(history.flights.iter().map(of).collect())
    };
    let mut columns = vec![
        Column::new("flight", "", Values::Unsigned((0..count as u32).collect())),
        Column::new("log", "", texts(&|flight| flight.name.clone())),
        Column::new("verdict", "", texts(&|flight| verdict(flight, problem))),
    ];
    let mut push = |name: String, of: &dyn Fn(usize) -> Option<f64>| {
        let values = (0..count).map(|flight| of(flight).unwrap_or(f64::NAN)).collect();
        columns.push(Column::new(name, "", Values::Float(values)));
    };
    for track in &history.tracks {
        let name = &track.name;
        push(format!("intensity:{name}"), &|flight| of_flight(track, flight).map(|p| p.0));
        push(format!("error:{name}"), &|flight| of_flight(track, flight).map(|p| p.1));
    }
    for (k, unknown) in problem.unknowns.iter().enumerate() {
        let fitted = |flight: usize| history.flights[flight].fitted.as_ref().ok();
        push(format!("sigmas:{}", unknown.name), &|flight| fitted(flight).map(|f| f.z[k]));
        push(format!("error_sigmas:{}", unknown.name), &|flight| {
            fitted(flight).map(|f| f.known.error(k))
        });
    }
    Ok(Table::from_columns(columns)?)
}

/// The maximum number of parameters drawn.
const DRAWN: usize = 6;

fn figure(history: &History, problem: &Fit, threshold: f64) -> TimeSeries<'static> {
    let mut figure = TimeSeries::new(problem.system.title.clone(), "flight");
    figure.panel_height = 180.0;
    for track in &history.tracks {
        figure = figure.with(panel(track, history.flights.len(), threshold));
    }
    let mut parameters = Panel::new("parameters, in standard deviations of their tolerances", "σ");
    for unknown in drawn(history, problem) {
        let updates = history.flights.iter().enumerate().filter(|(_, f)| f.is_healthy());
        let points =
            updates.filter_map(|(n, f)| Some((n as f64, f.fitted.as_ref().ok()?.z[unknown])));
        let (x, y): (Vec<f64>, Vec<f64>) = points.unzip();
        let name = problem.unknowns[unknown].name.clone();
        parameters = parameters.with(Series::new(name, x, y).marked());
    }
    // A single flight shows no history of the parameters.
    match parameters.series.iter().all(|series| series.x.len() < 2) {
        true => figure,
        false => figure.with(parameters.with_band(Band::constant("tolerance", -3.0, 3.0))),
    }
}

/// The parameters that drift, or else those that the first healthy flight determines.
fn drawn(history: &History, problem: &Fit) -> Vec<usize> {
    let drifting: Vec<usize> = history.drifts.iter().map(|drift| drift.unknown).collect();
    if !drifting.is_empty() {
        return drifting.into_iter().take(DRAWN).collect();
    }
    let first = history.flights.iter().find(|flight| flight.is_healthy());
    let Some(Ok(fitted)) = first.map(|flight| &flight.fitted) else { return Vec::new() };
    let known = |k: &usize| fitted.known.each[*k] == Knowledge::Known;
    (0..problem.unknowns.len()).filter(known).take(DRAWN).collect()
}

/// Draws the intensities, the trend after each flight, and its extrapolation.
fn panel(track: &Track, flights: usize, threshold: f64) -> Panel<'static> {
    let measured = |of: fn(&Point) -> f64| -> Vec<f64> { track.points.iter().map(of).collect() };
    let mut panel = Panel::new(track.name.clone(), "intensity");
    panel = panel.with(Series::new("fitted", measured(|p| p.at), measured(|p| p.level)).marked());
    let last_flight = flights.saturating_sub(1) as f64;
    let mut end = last_flight;
    if let Some(trend) = &track.trend {
        let reached = trend.reaches(threshold);
        // The reported crossing is always in view.
        let far = (3.0 * last_flight).max(1.1 * reached.expected.unwrap_or(0.0));
        let latest = reached.latest.or(reached.expected).unwrap_or(0.3 * last_flight);
        end = last_flight + latest.max(0.1 * last_flight).min(far);
        let ahead: Vec<f64> =
            (0..=60).map(|k| f64::from(k) / 60.0 * (end - trend.last().at)).collect();
        let times: Vec<f64> = ahead.iter().map(|flights| trend.last().at + flights).collect();
        let (mean, errors): (Vec<f64>, Vec<f64>) =
            ahead.iter().map(|flights| trend.ahead(*flights)).unzip();
        let edge = |sign: f64| -> Vec<f64> {
            mean.iter().zip(&errors).map(|(mean, error)| mean + sign * 1.96 * error).collect()
        };
        panel = panel.with_band(Band {
            name: "95 % of the trend".into(),
            x: times.clone().into(),
            low: edge(-1.0).into(),
            high: edge(1.0).into(),
        });
        panel = panel.with(Series::new("trend", times, mean.clone()));
    }
    panel.with(Series::new("threshold", vec![0.0, end], vec![threshold, threshold]))
}

#[cfg(test)]
mod tests {
    use super::{date_in, is_doubtful, when};
    use servotwin::fit::trend::{Point, Trend};

    #[test]
    fn a_wear_that_does_not_grow_is_no_trend() {
        let flight = |n: u32| Point { at: n.into(), level: 0.4 - 0.01 * f64::from(n), error: 1e-4 };
        let falling: Vec<Point> = (0..10).map(flight).collect();
        let sentence = when(&Trend::of(&falling).unwrap(), 0.5);
        assert_eq!(sentence, "no trend: the threshold is not reached");
    }

    #[test]
    fn dates_in_names_order_flights_and_doubtful_ones_are_told() {
        let names = ["26.10.2026.csv", "flight_1-Nov-2026.csv", "2026-11-21_rig.csv"];
        let days = names.map(|name| date_in(name).expect(name));
        assert!(days.is_sorted(), "{days:?}");
        assert!(date_in("flight_10.csv").is_none() && !is_doubtful("flight_10.csv"));
        assert!(is_doubtful("10-11-2026.csv") && is_doubtful("rig_10-11-2026.csv"));
    }
}
