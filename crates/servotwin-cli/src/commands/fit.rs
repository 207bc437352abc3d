//! `servotwin fit`: estimates the twin's parameters from records of a healthy actuator.

use super::progress::Stages;
use super::{SpanOptions, design, note, read_log};
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::render::{Side, TextTable, json, number, shown};
use crate::{Global, stop};
use serde_json::{Value, json};
use servotwin::built_in;
use servotwin::files;
use servotwin::fit::intensity::{Diagnosed, intensity_and_onset};
use servotwin::fit::unknown::Moved;
use servotwin::fit::{
    Fit, FitError, FitRecord, FitResults, FitVerdict, FoundOnset, LeftOut, Unknown,
};
use servotwin::nearest::UnknownName;
use servotwin::signal::WrittenQuantity;
use servotwin::study::{Study, StudyError, Tolerance};
use servotwin::system::System;
use servotwin_model::spec::Unit;
use servotwin_watch::map::Map;
use servotwin_watch::span::LogSpan;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Estimate an actuator's parameters, within their tolerances, from records of its sensors.
///
/// The twin with these parameters is that of this actuator.
/// A record is a log with a column of times, a column for each sensor, and a column for each input that is not at its
/// default. `servotwin simulate --out` writes such a log, and any file that `servotwin watch` reads will do. A minute
/// with much motion is a good record. The first line of the output is the verdict: healthy, a fault with its intensity
/// and onset, or a record that cannot be explained. A deviation that no tolerance explains is a finding: then nothing
/// is written, and the exit code is 1.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// A record (.csv, .parquet, .mcap, .jsonl).
    #[arg(value_name = "LOG", required_unless_present = "design")]
    log: Option<PathBuf>,
    /// The system file [default: the study's system].
    #[arg(value_name = "SYSTEM")]
    system: Option<PathBuf>,
    /// A study file with the tolerances and faults [default: paper].
    #[arg(long, value_name = "STUDY")]
    study: Option<PathBuf>,
    /// Another record of the same actuator. Repeat the option for several records.
    #[arg(long = "log", value_name = "LOG")]
    more: Vec<PathBuf>,
    /// A map file that assigns the columns of a record to inputs and sensors with their units, as for `servotwin watch`
    /// (docs/watch.md).
    #[arg(long, value_name = "FILE")]
    map: Option<PathBuf>,
    #[command(flatten)]
    span: SpanOptions,
    /// The parameters to fit, separated by commas: full names or their ends, e.g. null_bias. With =SIGMA (a number with
    /// a unit, or a percentage of the value), a parameter needs no tolerance [default: all parameters with a
    /// tolerance].
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    parameters: Vec<String>,
    /// Also estimate what every plant of the study draws on top of its tolerances, `[flights].draws`: for the aileron
    /// the shape of friction, bandwidths of sensors, discharge coefficients and hinge moments.
    #[arg(long, conflicts_with_all = ["parameters", "faults"])]
    draws: bool,
    /// Estimate the intensities of these faults instead, separated by commas, and report which fault it is.
    #[arg(long, value_name = "IDS", value_delimiter = ',', conflicts_with = "out")]
    faults: Vec<String>,
    /// Write a system file with the fitted values.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Find the command that determines the parameters best instead. It is a signal of the catalog within the limits
    /// below.
    #[arg(long, conflicts_with_all = ["log", "more", "faults", "out", "map"])]
    design: bool,
    #[command(flatten)]
    limits: design::AllowedCommand,
    /// Number of threads [default: all processors; the results do not depend on it].
    #[arg(long, value_parser = super::threads)]
    threads: Option<usize>,
}

/// Estimates the number of runs in a fit with this many unknowns and suspects.
fn usual_runs(unknowns: usize, suspects: usize) -> usize {
    3 * (unknowns + 1) + 20 + suspects
}

impl Options {
    /// The files that the command reads and writes.
    pub(crate) fn paths(&self) -> Paths {
        Paths::default()
            .read("LOG", self.log.iter().chain(&self.more))
            .read("SYSTEM", &self.system)
            .read_study(self.study.as_ref())
            .read("--map", &self.map)
            .write("--out", Format::TOML, &self.out)
    }
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let study = read_study(options.study.as_deref(), options.system.as_deref())?;
    let map = options.map.as_ref().map(|path| Map::read(path, &study.system)).transpose()?;
    let logs = options.log.iter().chain(&options.more);
    let span = options.span.read()?;
    let read = |path: &PathBuf| read_record(path, map.as_ref(), span, &study, global);
    let records = logs.map(read).collect::<Result<_, _>>()?;
    stop::heed();
    let stages = Stages::new(global);
    let runs = AtomicUsize::new(0);
    let mut problem = Fit::of_study(&study, records);
    if !options.parameters.is_empty() {
        problem.unknowns = chosen(&options.parameters, &problem.unknowns, &study)?;
    }
    if options.draws {
        problem.unknowns.extend(Unknown::of_draws(&study));
    }
    if options.design {
        problem.threads = options.threads.unwrap_or(problem.threads).max(1);
        return design::run(&options.limits, problem, &study, global);
    }
    let usual = usual_runs(problem.unknowns.len(), problem.suspects.len()) * problem.records.len();
    let progress = || {
        let done = runs.fetch_add(1, Ordering::Relaxed) + 1;
        stages.show(&format!("{done} runs"), (done as f64 / usual as f64).min(0.99));
    };
    let problem = Fit {
        threads: options.threads.unwrap_or(problem.threads).max(1),
        cancel: Some(stop::flag()),
        progress: &progress,
        ..problem
    };
    if !options.faults.is_empty() {
        let found = intensities(options, &problem)?;
        stages.end();
        return Ok(match global {
            Global { json: true, .. } => {
                json(&json!(found.iter().map(diagnosed).collect::<Vec<_>>()))
            }
            _ => intensity_text(&found),
        });
    }
    let fitted = problem.solve()?;
    let verdict = problem.verdict(&fitted)?;
    stages.end();
    let text = match global {
        Global { json: true, .. } => json(&as_json(&fitted, &verdict, &problem)),
        Global { quiet: true, .. } => String::new(),
        _ => format!("{}\n\n{}", first_line(&verdict, options), people(&fitted, &problem)),
    };
    if !fitted.is_update() {
        let sentences = fitted.findings.iter().map(|finding| finding.sentence(&problem)).collect();
        return Err(Failure::NoUpdate { output: text, findings: sentences });
    }
    if let Some(path) = &options.out {
        let system = fitted.system_text(&problem)?;
        files::write_atomically(path, |out| out.write_all(system.as_bytes()))?;
    }
    Ok(text)
}

/// The verdict, and what happens to the parameters.
fn first_line(verdict: &FitVerdict, options: &Options) -> String {
    let written = match (verdict, &options.out) {
        (FitVerdict::Healthy, Some(path)) => format!("; parameters updated in {}", path.display()),
        (_, Some(_)) => "; no update, nothing is written".into(),
        (_, None) => String::new(),
    };
    verdict.sentence() + &written
}

/// Reads a study, with another system if one is named.
pub(crate) fn read_study(study: Option<&Path>, system: Option<&Path>) -> Result<Study, Failure> {
    let Some(system) = system else {
        return match study {
            Some(path) => Ok(Study::read(path)?),
            None => Ok(Study::default()),
        };
    };
    match (study, Study::read_with_system(study.unwrap_or(Path::new(USUAL)), system)) {
        (None, Err(StudyError::Mistakes { .. })) => Err(other_system(system)?),
        (_, read) => Ok(read?),
    }
}

/// The default study.
const USUAL: &str = "paper";

/// The failure for a system of another study. It suggests the built-in study of the system's name, or the study that
/// `servotwin init` writes next to the file.
fn other_system(path: &Path) -> Result<Failure, Failure> {
    let system = System::read(path)?.name;
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let beside = path.with_file_name(format!("{stem}_study.toml"));
    let own = match built_in::find(&built_in::STUDIES, &system) {
        Some(_) => Some(system.clone()),
        None => beside.exists().then(|| beside.display().to_string()),
    };
    Ok(Failure::OtherSystem { system, study: USUAL.into(), own })
}

fn read_record(
    path: &Path,
    map: Option<&Map>,
    span: LogSpan,
    study: &Study,
    global: Global,
) -> Result<FitRecord, Failure> {
    let table = read_log(path, map, span, study, global)?;
    let name = path.display().to_string();
    let record = FitRecord::from_table(&name, &table, &study.system)
        .map_err(|error| Failure::Fit(FitError::Record { name: name.clone(), error }))?;
    tell(&name, &record, study, global);
    Ok(record)
}

/// Notes the sensors that a record lacks, and the parts that were left out of it.
pub(crate) fn tell(name: &str, record: &FitRecord, study: &Study, global: Global) {
    let lacking = record.lacking(&study.system);
    if !lacking.is_empty() {
        note(global, &format!("{name} has no column for the sensors {}", lacking.join(", ")));
    }
    for left_out in &record.left_out {
        note(global, &format!("{name}: {left_out}: left out"));
    }
}

/// Finds the unknowns by their names.
fn chosen(names: &[String], all: &[Unknown], study: &Study) -> Result<Vec<Unknown>, Failure> {
    let components = &study.system.network().components;
    let full = |(component, parameter): (usize, usize)| {
        let instance = &components[component];
        format!("{}.{}", instance.id, instance.component.spec().parameters[parameter].name)
    };
    let matches = |id: &str, name: &str| id == name || id.ends_with(&format!(".{name}"));
    let mut found: Vec<Unknown> = Vec::new();
    for name in names {
        let own: Vec<Unknown> = match name.split_once('=') {
            None => {
                let members = |unknown: &&Unknown| match &unknown.moved {
                    Moved::Parameters { members, .. } => {
                        members.iter().any(|&(c, p, _)| matches(&full((c, p)), name))
                    }
                    Moved::Fault(..) => false,
                };
                all.iter().filter(members).cloned().collect()
            }
            Some((name, sigma)) => {
                let every = components.iter().enumerate().flat_map(|(c, instance)| {
                    (0..instance.component.spec().parameters.len()).map(move |p| (c, p))
                });
                let own = every.filter(|&place| matches(&full(place), name));
                own.map(|place| of_parameter(place, sigma, study)).collect::<Result<_, _>>()?
            }
        };
        if own.is_empty() {
            let (given, known) = (name.clone(), all.iter().map(|unknown| unknown.name.clone()));
            let what = "tolerance for (give =SIGMA for another parameter)";
            return Err(UnknownName { what, given, known: known.collect() }.into());
        }
        for unknown in own {
            if found.iter().any(|other| other.name == unknown.name) {
                let option = "--parameters";
                return Err(Failure::Repeated { option, name: unknown.name });
            }
            found.push(unknown);
        }
    }
    Ok(found)
}

fn of_parameter(place: (usize, usize), sigma: &str, study: &Study) -> Result<Unknown, Failure> {
    let instance = &study.system.network().components[place.0];
    let unit = instance.component.spec().parameters[place.1].unit;
    let relative = sigma.trim_end().ends_with('%') && unit != Unit::None;
    let read = WrittenQuantity::in_unit(sigma, if relative { Unit::None } else { unit });
    let value = read.map_err(|error| Failure::Number { option: "--parameters", error })?;
    if !(value > 0.0 && value.is_finite()) {
        let (option, range) = ("--parameters", "a standard deviation is greater than 0");
        return Err(Failure::OutOfRange { option, given: sigma.into(), range: range.into() });
    }
    let tolerance = Tolerance { parameters: vec![place], sigma: value, absolute: !relative };
    Ok(Unknown::tolerance(&study.system, &tolerance))
}

/// Finds the faults by their names.
pub(crate) fn chosen_faults(
    names: &[String],
    problem: &Fit,
) -> Result<Vec<(usize, usize)>, Failure> {
    let of = |id: &String| problem.system.find_fault(id);
    Ok(names.iter().map(of).collect::<Result<_, _>>()?)
}

fn intensities(options: &Options, problem: &Fit) -> Result<Vec<Diagnosed>, Failure> {
    Ok(intensity_and_onset(problem, &chosen_faults(&options.faults, problem)?)?)
}

fn diagnosed(one: &Diagnosed) -> Value {
    json!({
        "fault": one.name,
        "intensity": one.intensity,
        "interval_95": [one.interval.0, one.interval.1],
        "log_likelihood": one.log_likelihood,
        "probability": one.probability,
        "onset": one.onset.map(onset),
    })
}

fn onset(onset: FoundOnset) -> Value {
    let (low, high) = onset.interval_s;
    json!({ "at_s": onset.at_s, "interval_95_s": [low, high], "score": onset.score })
}

fn intensity_text(found: &[Diagnosed]) -> String {
    let heads = [
        ("fault", Side::Left),
        ("intensity", Side::Right),
        ("95 %", Side::Left),
        ("from", Side::Left),
        ("probability", Side::Right),
    ];
    let mut grid = TextTable::new(&heads);
    for one in found {
        grid.push(vec![
            one.name.clone(),
            number(one.intensity, 3),
            format!("{} … {}", number(one.interval.0, 3), number(one.interval.1, 3)),
            one.onset.map_or("first sample".into(), |onset| {
                let (low, high) = onset.interval_s;
                format!("{:.2} s ({low:.2} … {high:.2})", onset.at_s)
            }),
            format!("{:.1} %", 100.0 * one.probability),
        ]);
    }
    grid.text()
}

fn as_json(fitted: &FitResults, verdict: &FitVerdict, problem: &Fit) -> Value {
    let parameters = problem.unknowns.iter().enumerate().map(|(k, unknown)| {
        let per_sigma = unknown.per_sigma(unknown.nominal());
        json!({
            "name": unknown.name,
            "unit": unknown.unit.symbol(),
            "nominal": unknown.nominal(),
            "value": unknown.value(fitted.z[k]),
            "standard_error": (fitted.known.error(k) * per_sigma).abs(),
            "tolerance_sigma": per_sigma.abs(),
            "knowledge": fitted.known.sentence(&problem.unknowns, k),
        })
    });
    let size = problem.unknowns.len();
    let correlations: Vec<Vec<f64>> =
        (0..size).map(|i| (0..size).map(|j| fitted.known.correlation(i, j)).collect()).collect();
    let sensors = fitted.left.iter().map(|left| {
        json!({
            "record": problem.records[left.record].name,
            "sensor": problem.system.sensors[left.sensor].id,
            "mean_square": left.mean_square,
            "limit": left.limit,
            "largest_mean": left.largest_mean,
            "largest_mean_at_s": left.at_s,
        })
    });
    let directions = fitted.known.directions.iter();
    let directions =
        directions.map(|d| json!({ "information": d.information, "weights": d.weights }));
    let suspects = fitted.suspects.iter().take(5);
    let suspects =
        suspects.map(|s| json!({ "name": s.name, "score": s.score, "intensity": s.intensity, "onset": s.onset.map(onset) }));
    json!({
        "system": problem.system.name,
        "records": problem.records.iter().map(|r| &r.name).collect::<Vec<_>>(),
        "left_out": problem.records.iter().flat_map(|r| &r.left_out).map(left_out).collect::<Vec<_>>(),
        "is_update": fitted.is_update(),
        "verdict": verdict.name(),
        "sentence": verdict.sentence(),
        "fault": verdict.fault().map(diagnosed),
        "findings": fitted.findings.iter().map(|f| f.sentence(problem)).collect::<Vec<_>>(),
        "parameters": parameters.collect::<Vec<_>>(),
        "correlations": correlations,
        "directions": directions.collect::<Vec<_>>(),
        "sensors": sensors.collect::<Vec<_>>(),
        "suspects": suspects.collect::<Vec<_>>(),
        "steps": fitted.steps,
    })
}

fn left_out(one: &LeftOut) -> Value {
    let LeftOut { column, count, place, value, .. } = one;
    json!({ "column": column, "count": count, "first": place, "value": value })
}

fn people(fitted: &FitResults, problem: &Fit) -> String {
    let mut text = format!("{}\n", problem.system.title);
    for record in &problem.records {
        let (name, duration) = (&record.name, number(record.duration_s(), 4));
        text += &format!("{name}: {duration} s, {} sensors\n\n", record.sensors.len());
    }
    let mut grid = TextTable::new(&[
        ("parameter", Side::Left),
        ("nominal", Side::Right),
        ("fitted", Side::Right),
        ("± 1 σ", Side::Right),
        ("", Side::Left),
    ]);
    for (k, unknown) in problem.unknowns.iter().enumerate() {
        let per_sigma = unknown.per_sigma(unknown.nominal());
        let others = match &unknown.moved {
            Moved::Parameters { members, .. } if members.len() > 1 => {
                format!(" and {} more", members.len() - 1)
            }
            _ => String::new(),
        };
        let error = (fitted.known.error(k) * per_sigma).abs();
        grid.push(vec![
            unknown.name.clone() + &others,
            shown(unknown.nominal(), unknown.unit),
            shown(unknown.value(fitted.z[k]), unknown.unit),
            number(unknown.unit.difference_to_shown(error), 2),
            fitted.known.sentence(&problem.unknowns, k),
        ]);
    }
    text += &grid.text();
    let unseen = fitted.known.directions.iter().filter(|direction| direction.information < 1.0);
    text += &format!(
        "\nIn {} of {} directions the record adds less than the tolerances already give.\n\n",
        unseen.count(),
        problem.unknowns.len()
    );
    let mut grid = TextTable::new(&[
        ("residual of", Side::Left),
        ("mean square / noise", Side::Right),
        ("limit", Side::Right),
        ("largest mean / σ", Side::Right),
        ("at", Side::Right),
    ]);
    for left in &fitted.left {
        grid.push(vec![
            problem.system.sensors[left.sensor].label.clone(),
            number(left.mean_square, 3),
            number(left.limit, 3),
            number(left.largest_mean, 2),
            format!("{} s", number(left.at_s, 3)),
        ]);
    }
    text + &grid.text()
}
