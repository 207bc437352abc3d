//! `servotwin history`: follows wear over the flights of one tail number.

use super::fit::{FitOptions, chosen_faults, run_counter};
use super::log_folder::LogFolder;
use super::note;
use super::progress::Stages;
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::{Global, Run, stop};
use servotwin::fit::history::{Drift, History, HistoryFlight, Log, Track};
use servotwin::fit::repair::Repair;
use servotwin::fit::trend::{Point, Reached, Trend};
use servotwin::fit::{Fit, FitError, RecordError, Unknown};
use servotwin::table::{Column, Table};
use servotwin::text::number;
use servotwin_view::document::{Document, Line, Table as Rows, Value, Verdict, line};
use servotwin_view::row;
use std::cell::RefCell;
use std::path::{Path, PathBuf};

/// Follow the wear of one tail number: each fault with its trend and the time to a threshold.
///
/// The log of each flight is fitted. The logs of the folder are read in the order of their names, in which numbers
/// count as numbers, or of the dates in them. Each is a record as for `servotwin fit`. Files that are not records,
/// and entries that are not regular files, are reported and skipped. If an intensity falls, the command reports a
/// repair, and the trend starts again from there. If an intensity has reached the threshold, or may reach it within
/// the flights of --within (95 % interval), the command raises an alarm: the exit code is 1.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The folder with the logs (.csv, .parquet, .jsonl).
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
    #[command(flatten)]
    fit: FitOptions,
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
    /// The logs in the folder, once they are known.
    #[arg(skip)]
    found: RefCell<Option<LogFolder>>,
}

impl Run for Options {
    fn paths(&self) -> Paths {
        let found = LogFolder::read(&self.folder).ok();
        let logs = found.iter().flat_map(|folder| folder.paths.clone()).collect::<Vec<_>>();
        self.found.replace(found);
        let paths = self.fit.paths(Paths::default().read("the log", logs));
        paths.write("--out", Format::Table, &self.out)
    }

    fn run(&self, global: Global) -> Result<Document, Failure> {
        if !(self.threshold > 0.0 && self.threshold <= 1.0) {
            let range = "above 0, at most 1";
            return Err(Failure::out_of_range("--threshold", self.threshold, range));
        }
        let study = self.fit.study()?;
        let logs = self.fit.logs(&study, global)?;
        // A folder that could not be listed gives its reason now.
        let found = self.found.take().map_or_else(|| LogFolder::read(&self.folder), Ok);
        let folder = found?;
        if let Some(skipped) = folder.sentence() {
            note(global, &skipped);
        }
        stop::heed();
        let stages = Stages::new(global);
        let read = |path: &PathBuf| {
            let name = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into());
            let record = logs.read(path, &name).map_err(|failure| reason(&failure, path, &name));
            (name, record)
        };
        let all = in_order(folder.paths.iter().map(read).collect(), global);
        if let [(name, Err(error)), ..] = &all[..]
            && all.iter().all(|(_, record)| record.is_err())
        {
            let folder = self.folder.display();
            return Err(Failure::input(format!(
                "{folder}: none of its logs can be used; {name}: {error}"
            )));
        }
        let progress = run_counter(&stages, 300.0 * folder.paths.len() as f64);
        let problem = self.fit.problem(Fit::of_study(&study, Vec::new()), &progress);
        let faults = chosen_faults(&self.faults, &study.system)?;
        let history = problem.history(all, &faults)?;
        stages.end();
        if let Some(path) = &self.out {
            as_table(&history, &problem)?.write(path)?;
        }
        let mut document = described(&history, &problem, self);
        let mut skipped = Rows::of("name: | reason:");
        folder.skipped.into_iter().for_each(|(name, why)| skipped.push(row![name, why]));
        document.table("skipped", skipped);
        Ok(document)
    }
}

/// The logs in the order of the dates in them, or else of their names.
fn in_order(mut all: Vec<Log>, global: Global) -> Vec<Log> {
    let usable = || all.iter().filter_map(|(_, record)| record.as_ref().ok());
    let days: Vec<f64> = usable().filter_map(|record| record.begin_s).collect();
    if days.is_sorted() {
        return all;
    }
    if days.len() < usable().count() {
        let text = format!(
            "the flights are in the order of their names, which contradicts the dates in {} of {} logs: name them by \
             their dates (2026-11-21)",
            days.len(),
            all.len()
        );
        note(global, &text);
        return all;
    }
    // Unusable logs come last.
    let day = |(_, record): &Log| record.as_ref().ok().and_then(|own| own.begin_s);
    let day = |log: &Log| day(log).unwrap_or(f64::INFINITY);
    all.sort_by(|one, other| day(one).total_cmp(&day(other)));
    let text =
        "the flights are in the order of the dates in their logs, which is not that of their names";
    note(global, text);
    all
}

/// Why a log cannot be used, without its name: it does not end the history of the others.
fn reason(failure: &Failure, path: &Path, name: &str) -> RecordError {
    let text = failure.message.lines().next().unwrap_or_default();
    let text = text.strip_prefix("error: ").unwrap_or(text);
    let of_log = |log: &str| text.strip_prefix(&format!("{log}: "));
    let text = of_log(name).or_else(|| of_log(&path.display().to_string())).unwrap_or(text);
    RecordError(text.into())
}

/// The alarm sentence of a track, if it may reach its threshold.
fn alarm(track: &Track, options: &Options) -> Option<String> {
    let (name, threshold) = (&track.name, options.threshold);
    let has_reached = || format!("{name} has reached {threshold}");
    let Some(trend) = &track.trend else {
        // Without a trend, the last level alone may prove that the threshold is reached.
        let last = track.points.last()?;
        return (last.level - 1.96 * last.error >= threshold).then(has_reached);
    };
    let reached = trend.reaches(threshold);
    let earliest = reached.earliest.filter(|flights| *flights <= f64::from(options.within))?;
    if reached.expected == Some(0.0) {
        return Some(has_reached());
    }
    // A wide interval alone is no alarm. The wear must be growing significantly.
    let flights = number(earliest.ceil(), 4);
    (trend.significance() > 3.0)
        .then(|| format!("{name} may reach {threshold} in {flights} flights"))
}

/// What a flight is, in words.
fn verdict(flight: &HistoryFlight) -> String {
    match &flight.fitted {
        // The caller names the log.
        Err(FitError::Record { error, .. }) => error.to_string(),
        Err(error) => error.to_string(),
        Ok(fitted) => fitted.findings.first().cloned().unwrap_or_else(|| "healthy".into()),
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

/// A track, in words and with all its numbers.
fn tracked(track: &Track, threshold: f64) -> Line {
    let each =
        |of: fn(&Point) -> f64| Value::of("", &track.points.iter().map(of).collect::<Vec<f64>>());
    let trend = track.trend.as_ref();
    let text = match trend {
        Some(trend) => format!(
            "{{fault}} ({{probability}}): {{level}} ± {{level_error}}, {{rate_per_flight}} a flight; {}",
            when(trend, threshold)
        ),
        None if track.last_repair().is_some() => {
            "{fault}: too few flights since the repair for a trend".into()
        }
        None => "{fault}: too few flights for a trend".into(),
    };
    let shown = |value: Option<f64>, factor: f64, digits: usize| match value {
        Some(value) => Value::number(value, number(factor * value, digits)),
        None => Value::missing(),
    };
    let error = |place: usize| trend.map(|trend| trend.last.variance[place].sqrt());
    let reached = trend.map(|trend| trend.reaches(threshold));
    let flights = |of: fn(Reached) -> Option<f64>| Value::of("", &reached.and_then(of));
    let values = [
        ("fault", (&track.name).into()),
        ("probability", Value::percent(track.probability, 0)),
        ("flights", each(|point| point.at)),
        ("intensities", each(|point| point.level)),
        ("errors", each(|point| point.error)),
        ("level", shown(trend.map(|trend| trend.last.level), 1.0, 3)),
        ("level_error", shown(error(0), 1.96, 2)),
        ("rate_per_flight", shown(trend.map(|trend| trend.last.rate), 1.0, 2)),
        ("rate_error", Value::of("", &error(2))),
        ("flights_to_threshold", flights(|reached| reached.expected)),
        ("earliest_flights", flights(|reached| reached.earliest)),
        ("latest_flights", flights(|reached| reached.latest)),
    ];
    line(&text, values)
}

/// A drop in intensity.
fn repaired(repair: &Repair, track: &Track, history: &History) -> Line {
    let text = match repair.is_confirmed {
        true => {
            "{fault}: repaired before flight {flight} ({log}): the intensity falls by {fall}, and a new trend begins"
        }
        false => {
            "{fault}: flight {flight} ({log}) is lower by {fall}: a repair or a bad flight; the next flight decides, \
             and the trend leaves this one out"
        }
    };
    let log = history.flights.get(repair.at as usize).map_or("", |flight| &flight.name);
    let values = [
        ("fault", (&track.name).into()),
        ("flight", Value::number(repair.at, repair.at.to_string())),
        ("log", log.into()),
        ("fall", Value::digits(repair.fall, 2)),
        ("is_confirmed", repair.is_confirmed.into()),
    ];
    line(text, values)
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
    let repairs = history
        .tracks
        .iter()
        .flat_map(|track| track.repairs.iter().map(move |repair| repaired(repair, track, history)));
    document.list("repairs", repairs);
    document.list("tracks", history.tracks.iter().map(|track| tracked(track, threshold)));
    let drifts = history.drifts.iter().map(|drift| drifting(drift, problem));
    document.list("drifts", drifts);
    document.table("flights", flights(history));
    document
}

/// The drift of a parameter inside of its tolerance.
fn drifting(Drift { unknown, trend }: &Drift, problem: &Fit) -> Line {
    let last = trend.last;
    line(
        "{parameter} drifts inside of its tolerance: {per_100_flights} standard deviations of it in a hundred flights, \
         now {sigmas}",
        [
            ("parameter", (&problem.unknowns[*unknown].name).into()),
            ("per_100_flights", Value::digits(100.0 * last.rate, 2)),
            ("sigmas", Value::digits(last.level, 2)),
        ],
    )
}

/// The flights with the intensities of every track.
fn flights(history: &History) -> Rows {
    let mut table = Rows::of("flight | log | is_usable: | is_healthy: | verdict:_");
    for track in &history.tracks {
        table.column(format!("intensity:{}", track.name), format!("{} ± 95 %", track.name));
    }
    for (place, flight) in history.flights.iter().enumerate() {
        let (is_usable, is_healthy) = (flight.fitted.is_ok(), flight.is_healthy());
        let mut row = row![place, &flight.name, is_usable, is_healthy, verdict(flight)];
        row.extend(history.tracks.iter().map(|track| match track.in_flight(place) {
            Some(&Point { level, error, .. }) => {
                let text = format!("{} ± {}", number(level, 3), number(1.96 * error, 2));
                Value::number(level, text)
            }
            None => Value { text: String::new(), ..Value::missing() },
        }));
        table.push(row);
    }
    table
}

/// One row for each flight, with the intensities and the parameters.
fn as_table(history: &History, problem: &Fit) -> Result<Table, Failure> {
    let flights = &history.flights;
    let mut columns = vec![
        Column::of("flight", "", 0..flights.len() as u32, |flight| flight),
        Column::of("log", "", flights, |flight| flight.name.clone()),
        Column::of("verdict", "", flights, verdict),
    ];
    let mut push = |name: String, of: &dyn Fn(usize) -> Option<f64>| {
        let value = |flight| of(flight).unwrap_or(f64::NAN);
        columns.push(Column::of(name, "", 0..flights.len(), value));
    };
    for track in &history.tracks {
        let name = &track.name;
        push(format!("intensity:{name}"), &|flight| Some(track.in_flight(flight)?.level));
        push(format!("error:{name}"), &|flight| Some(track.in_flight(flight)?.error));
    }
    for (k, Unknown { name, .. }) in problem.unknowns.iter().enumerate() {
        let fitted = |flight: usize| flights[flight].fitted.as_ref().ok();
        push(format!("sigmas:{name}"), &|flight| Some(fitted(flight)?.z[k]));
        push(format!("error_sigmas:{name}"), &|flight| Some(fitted(flight)?.known.error(k)));
    }
    Ok(Table::from_columns(columns)?)
}

#[cfg(test)]
mod tests {
    use super::when;
    use servotwin::fit::trend::{Point, Trend};

    #[test]
    fn a_wear_that_does_not_grow_is_no_trend() {
        let flight = |n: u32| Point { at: n.into(), level: 0.4 - 0.01 * f64::from(n), error: 1e-4 };
        let falling: Vec<Point> = (0..10).map(flight).collect();
        let sentence = when(&Trend::of(&falling).unwrap(), 0.5);
        assert_eq!(sentence, "no trend: the threshold is not reached");
    }
}
