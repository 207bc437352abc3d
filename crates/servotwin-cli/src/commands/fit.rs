//! `servotwin fit`: estimates the twin's parameters from records of a healthy actuator.

use super::progress::Stages;
use super::{POSITIVE, SpanOptions, design, note, quantity, read_log};
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::{Global, Run, stop};
use servotwin::built_in;
use servotwin::files;
use servotwin::fit::intensity::{Diagnosed, intensity_and_onset};
use servotwin::fit::unknown::Moved;
use servotwin::fit::{
    Fit, FitError, FitRecord, FitResults, FitVerdict, FoundOnset, LeftOut, Unknown,
};
use servotwin::kind::FileType;
use servotwin::nearest::UnknownName;
use servotwin::shown::number;
use servotwin::study::{Study, Tolerance};
use servotwin::system::System;
use servotwin::toml_text::TomlError;
use servotwin_model::spec::Unit;
use servotwin_view::document::{Document, Table, Value, Verdict, line};
use servotwin_view::row;
use servotwin_watch::map::Map;
use servotwin_watch::span::LogSpan;
use std::collections::BTreeMap;
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

impl Run for Options {
    fn paths(&self) -> Paths {
        Paths::default()
            .read("LOG", self.log.iter().chain(&self.more))
            .read("SYSTEM", &self.system)
            .read_study(self.study.as_ref())
            .read("--map", &self.map)
            .write("--out", Format::TOML, &self.out)
    }

    fn run(&self, global: Global) -> Result<Document, Failure> {
        let study = read_study(self.study.as_deref(), self.system.as_deref())?;
        let map = self.map.as_ref().map(|path| Map::read(path, &study.system)).transpose()?;
        let logs = self.log.iter().chain(&self.more);
        let span = self.span.read()?;
        let read = |path: &PathBuf| read_record(path, map.as_ref(), span, &study, global);
        let records = logs.map(read).collect::<Result<_, _>>()?;
        stop::heed();
        let stages = Stages::new(global);
        let runs = AtomicUsize::new(0);
        let mut problem = Fit::of_study(&study, records);
        if !self.parameters.is_empty() {
            problem.unknowns = chosen(&self.parameters, &problem.unknowns, &study)?;
        }
        if self.draws {
            problem.unknowns.extend(Unknown::of_draws(&study));
        }
        let usual =
            usual_runs(problem.unknowns.len(), problem.suspects.len()) * problem.records.len();
        let progress = || {
            let done = runs.fetch_add(1, Ordering::Relaxed) + 1;
            stages.show(&format!("{done} runs"), (done as f64 / usual as f64).min(0.99));
        };
        let problem = Fit {
            threads: self.threads.unwrap_or(problem.threads).max(1),
            cancel: Some(stop::flag()),
            progress: &progress,
            ..problem
        };
        if self.design {
            return design::run(&self.limits, &problem, &study);
        }
        if !self.faults.is_empty() {
            let faults = chosen_faults(&self.faults, &problem)?;
            let found = intensity_and_onset(&problem, &faults)?;
            stages.end();
            return Ok(intensities(&found));
        }
        let fitted = problem.solve()?;
        let verdict = problem.verdict(&fitted)?;
        stages.end();
        let path = self.out.as_ref().filter(|_| fitted.is_update());
        if let Some(path) = path {
            let system = fitted.system_text(&problem)?;
            files::write_atomically(path, |out| out.write_all(system.as_bytes()))?;
        }
        Ok(described(&fitted, &verdict, &problem, self))
    }
}

/// A fit: what it found, and what happens to the parameters.
fn described(
    fitted: &FitResults,
    verdict: &FitVerdict,
    problem: &Fit,
    options: &Options,
) -> Document {
    let written = match (fitted.is_update(), &options.out) {
        (true, Some(path)) => format!("; parameters updated in {}", path.display()),
        (false, Some(_)) => "; no update, nothing is written".into(),
        (_, None) => String::new(),
    };
    let values = [("state", verdict.name().into()), ("is_update", fitted.is_update().into())];
    let sentence = line(&(verdict.sentence() + &written), values);
    let mut document = Document::new(
        "fit",
        match fitted.is_update() {
            true => Verdict::good(sentence),
            false => Verdict::act(sentence),
        },
    );
    document.fact("system", "system", &problem.system.title);
    let mut records = Table::of("name:record | duration | sensors");
    for record in &problem.records {
        let duration = Value::seconds(record.duration_s(), 4);
        records.push(row![&record.name, duration, record.sensors.len()]);
    }
    document.table("records", records);
    let sentences = fitted.findings.iter().map(|finding| finding.sentence(problem));
    document.list("findings", sentences);
    document.table("fault", likely_faults(verdict.fault()));
    document.table("parameters", parameters(fitted, problem));
    let unseen = fitted.known.directions.iter().filter(|own| own.information < 1.0).count();
    document.text(line(
        "In {unseen} of {all} directions the record adds less than the tolerances already give.",
        [("unseen", unseen.into()), ("all", problem.unknowns.len().into())],
    ));
    document.table("sensors", residuals(fitted, problem)).detail();
    evidence(fitted, problem, &mut document);
    document
}

/// What programs read beside the tables: left out samples, and how the parameters are known together.
fn evidence(fitted: &FitResults, problem: &Fit, document: &mut Document) {
    let mut left_out = Table::of("column: | count: | first: | value:");
    for LeftOut { column, count, place, value, .. } in
        problem.records.iter().flat_map(|record| &record.left_out)
    {
        left_out.push([
            column.into(),
            Value::of("", count),
            Value::of("", place),
            Value::of("", value),
        ]);
    }
    document.table("left_out", left_out);
    let size = problem.unknowns.len();
    let correlations: Vec<Vec<f64>> =
        (0..size).map(|i| (0..size).map(|j| fitted.known.correlation(i, j)).collect()).collect();
    document.data("correlations", &correlations);
    let mut directions = Table::of("information: | weights:");
    for own in &fitted.known.directions {
        directions.push([Value::of("", &own.information), Value::of("", &own.weights)]);
    }
    document.table("directions", directions);
    let mut suspects = Table::of("name: | score: | intensity: | onset:");
    for own in fitted.suspects.iter().take(5) {
        let onset = onset(own.onset);
        let (score, intensity) = (Value::of("", &own.score), Value::of("", &own.intensity));
        suspects.push([Value::from(&own.name), score, intensity, onset]);
    }
    document.table("suspects", suspects);
    document.fact("steps", "", Value::of("", &fitted.steps));
}

fn parameters(fitted: &FitResults, problem: &Fit) -> Table {
    let mut table = Table::of(
        "name:parameter | unit: | nominal | value:fitted | standard_error:± 1 σ | tolerance_sigma: | knowledge:_",
    );
    for (k, unknown) in problem.unknowns.iter().enumerate() {
        let per_sigma = unknown.per_sigma(unknown.nominal());
        let others = match &unknown.moved {
            Moved::Parameters { members, .. } if members.len() > 1 => {
                format!(" and {} more", members.len() - 1)
            }
            _ => String::new(),
        };
        table.push(row![
            Value::of(format!("{}{others}", unknown.name), &unknown.name),
            unknown.unit.symbol(),
            Value::mixed(unknown.nominal(), unknown.unit),
            Value::mixed(unknown.value(fitted.z[k]), unknown.unit),
            Value::difference((fitted.known.error(k) * per_sigma).abs(), unknown.unit, 2),
            Value::of("", &per_sigma.abs()),
            fitted.known.sentence(&problem.unknowns, k),
        ]);
    }
    table
}

/// What is left of each sensor.
fn residuals(fitted: &FitResults, problem: &Fit) -> Table {
    let mut table = Table::of(
        "record: | sensor: | :residual of | mean_square:mean square / noise | limit | largest_mean:largest mean / σ | largest_mean_at:at",
    );
    for left in &fitted.left {
        let sensor = &problem.system.sensors[left.sensor];
        table.push(row![
            &problem.records[left.record].name,
            &sensor.id,
            &sensor.label,
            Value::digits(left.mean_square, 3),
            Value::digits(left.limit, 3),
            Value::digits(left.largest_mean, 2),
            Value::seconds(left.at_s, 3),
        ]);
    }
    table
}

/// How probable each of some faults is, and how intense.
fn intensities(found: &[Diagnosed]) -> Document {
    let likely = found.iter().max_by(|a, b| a.probability.total_cmp(&b.probability));
    let verdict = likely.map_or_else(String::new, |one| {
        format!("most probable is {}, {:.1} %", one.name, 100.0 * one.probability)
    });
    let mut document = Document::listing("fit", verdict);
    document.table("faults", likely_faults(found));
    document
}

fn likely_faults<'f>(found: impl IntoIterator<Item = &'f Diagnosed>) -> Table {
    let mut table = Table::of(
        "fault | intensity | interval_95:95 % | onset:from | log_likelihood: | probability",
    );
    for one in found {
        let (low, high) = one.interval;
        let interval = format!("{} … {}", number(low, 3), number(high, 3));
        table.push(row![
            &one.name,
            Value::digits(one.intensity, 3),
            Value::of(interval, &[low, high]),
            onset(one.onset),
            Value::of("", &one.log_likelihood),
            Value::percent(one.probability, 1),
        ]);
    }
    table
}

/// When a fault began; a log that begins with it has no onset.
fn onset(onset: Option<FoundOnset>) -> Value {
    let Some(FoundOnset { at_s, interval_s: (low, high), score }) = onset else {
        return Value::of("first sample", &None::<f64>);
    };
    let text = format!("{at_s:.2} s ({low:.2} … {high:.2})");
    Value::of(
        text,
        &BTreeMap::from([("at_s", at_s), ("low_s", low), ("high_s", high), ("score", score)]),
    )
}

/// Reads a study, with another system if one is named.
pub(crate) fn read_study(study: Option<&Path>, system: Option<&Path>) -> Result<Study, Failure> {
    let Some(system) = system else {
        return match study {
            Some(path) => Ok(Study::read(path)?),
            None => Ok(Study::default()),
        };
    };
    let (text, name) = FileType::Study.read(study.unwrap_or(Path::new(USUAL)))?;
    match (study, Study::parse_for(&text, &name, System::read(system)?)) {
        (None, Err(TomlError::Mistakes { .. })) => Err(other_system(system)?),
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
    Ok(Failure::input(format!(
        "tolerances and faults are a study's, and without --study those of '{USUAL}' are taken, to which the system \
         '{system}' does not belong: give --study {}",
        own.as_deref().unwrap_or("FILE")
    )))
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
        .map_err(|error| FitError::Record { name: name.clone(), error })?;
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
        format!("{}.{}", instance.id, instance.component.parameters[parameter].name)
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
                    (0..instance.component.parameters.len()).map(move |p| (c, p))
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
                let twice = format!("'{}' is given twice", unknown.name);
                return Err(Failure::option("--parameters", twice));
            }
            found.push(unknown);
        }
    }
    Ok(found)
}

fn of_parameter(place: (usize, usize), sigma: &str, study: &Study) -> Result<Unknown, Failure> {
    let instance = &study.system.network().components[place.0];
    let unit = instance.component.parameters[place.1].unit;
    let relative = sigma.trim_end().ends_with('%') && unit != Unit::None;
    let unit = if relative { Unit::None } else { unit };
    let words = "a standard deviation is greater than 0";
    let value = quantity("--parameters", sigma, unit, POSITIVE, words)?;
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
