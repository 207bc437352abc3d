//! `servotwin fit`: estimates the twin's parameters from records of a healthy actuator.

use super::progress::Stages;
use super::{SpanOptions, design, note};
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::{Global, Run, stop};
use servotwin::built_in;
use servotwin::files;
use servotwin::fit::intensity::Diagnosed;
use servotwin::fit::{Fit, FitError, FitRecord, FitResults, FitVerdict, FoundOnset, Unknown};
use servotwin::kind::FileType;
use servotwin::nearest::UnknownName;
use servotwin::study::Study;
use servotwin::system::System;
use servotwin::text::number;
use servotwin::toml_text::TomlError;
use servotwin_view::document::{Document, Table, Value, Verdict, line};
use servotwin_view::row;
use servotwin_watch::intake;
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
    /// A record (.csv, .parquet, .jsonl).
    #[arg(value_name = "LOG", required_unless_present = "design")]
    log: Option<PathBuf>,
    #[command(flatten)]
    fit: FitOptions,
    /// Another record of the same actuator. Repeat the option for several records.
    #[arg(long = "log", value_name = "LOG")]
    more: Vec<PathBuf>,
    /// The parameters to fit, separated by commas: full names or their ends, e.g. null_bias [default: all parameters
    /// with a tolerance].
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
}

/// What is fitted, for `fit` and `history`.
#[derive(clap::Args)]
pub(crate) struct FitOptions {
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
    /// Number of threads [default: all processors; the results do not depend on it].
    #[arg(long, value_parser = super::threads)]
    threads: Option<usize>,
}

/// The default study.
const USUAL: &str = "paper";

impl FitOptions {
    /// Adds the files that are read.
    pub(crate) fn paths(&self, paths: Paths) -> Paths {
        paths.read("SYSTEM", &self.system).read_study(self.study.as_ref()).read("--map", &self.map)
    }

    /// Reads the study, with another system if one is named.
    pub(crate) fn study(&self) -> Result<Study, Failure> {
        let Some(system) = &self.system else {
            return Ok(self.study.as_ref().map_or_else(|| Ok(Study::default()), Study::read)?);
        };
        let (text, name) =
            FileType::Study.read(self.study.as_deref().unwrap_or(Path::new(USUAL)))?;
        match (&self.study, Study::parse_for(&text, &name, System::read(system)?)) {
            (None, Err(TomlError::Mistakes { .. })) => Err(other_system(system)?),
            (_, read) => Ok(read?),
        }
    }

    /// Reads how to read the logs of a study.
    pub(crate) fn logs<'s>(&self, study: &'s Study, global: Global) -> Result<Logs<'s>, Failure> {
        let map = self.map.as_ref().map(|path| Map::read(path, &study.system)).transpose()?;
        Ok(Logs { study, map, span: self.span.read()?, global })
    }

    /// A fit that Ctrl-C stops.
    pub(crate) fn problem<'s>(&self, fit: Fit<'s>, progress: &'s (dyn Fn() + Sync)) -> Fit<'s> {
        let threads = self.threads.unwrap_or(fit.threads).max(1);
        Fit { threads, cancel: Some(stop::flag()), progress, ..fit }
    }
}

/// How logs are read as records.
pub(crate) struct Logs<'s> {
    study: &'s Study,
    map: Option<Map>,
    span: LogSpan,
    global: Global,
}

impl Logs<'_> {
    /// Reads a log as a record with a name. Notes its irregularities, sensors that it lacks, and values that were left
    /// out.
    pub(crate) fn read(&self, path: &Path, name: &str) -> Result<FitRecord, Failure> {
        let whole = intake::read(path, self.map.as_ref(), self.span, self.study);
        let whole = whole.map_err(|error| Failure::of_intake(name, error))?;
        let tell = |text: &str| note(self.global, &format!("{name}: {text}"));
        whole.warnings.iter().for_each(|warning| tell(warning));
        let (counts, met) = (&whole.counts, whole.counts.met_in_words().join("; "));
        if !met.is_empty() {
            let (frames, counted, samples) = (counts.frames, &counts.counted, counts.samples);
            tell(&format!("{frames} {counted}s became {samples} samples: {met}"));
        }
        let record = FitRecord::from_table(name, &whole.table, &self.study.system)
            .map_err(|error| FitError::Record { name: name.into(), error })?;
        let lacking = record.lacking(&self.study.system);
        if !lacking.is_empty() {
            let lacking = lacking.join(", ");
            note(self.global, &format!("{name} has no column for the sensors {lacking}"));
        }
        record.left_out.iter().for_each(|own| tell(&format!("{}: left out", own.sentence)));
        Ok(record)
    }
}

/// Counts runs, and shows them as parts of a usual number.
pub(crate) fn run_counter(stages: &Stages, usual: f64) -> impl Fn() + Sync {
    let runs = AtomicUsize::new(0);
    move || {
        let done = runs.fetch_add(1, Ordering::Relaxed) + 1;
        stages.show(&format!("{done} runs"), (done as f64 / usual).min(0.99));
    }
}

impl Run for Options {
    fn paths(&self) -> Paths {
        let paths = Paths::default().read("LOG", self.log.iter().chain(&self.more));
        self.fit.paths(paths).write("--out", Format::TOML, &self.out)
    }

    fn run(&self, global: Global) -> Result<Document, Failure> {
        let study = self.fit.study()?;
        let logs = self.fit.logs(&study, global)?;
        let read = |path: &PathBuf| logs.read(path, &path.display().to_string());
        let records = self.log.iter().chain(&self.more).map(read).collect::<Result<_, _>>()?;
        stop::heed();
        let stages = Stages::new(global);
        let mut problem = Fit::of_study(&study, records);
        if !self.parameters.is_empty() {
            problem.unknowns = chosen(&self.parameters, &problem.unknowns, &study)?;
        }
        if self.draws {
            problem.unknowns.extend(Unknown::of_draws(&study));
        }
        let usual = 3 * (problem.unknowns.len() + 1) + 20 + problem.suspects.len();
        let progress = run_counter(&stages, (usual * problem.records.len()) as f64);
        let problem = self.fit.problem(problem, &progress);
        if self.design {
            return design::run(&self.limits, &problem, &study);
        }
        if !self.faults.is_empty() {
            let found = problem.diagnose(&chosen_faults(&self.faults, &study.system)?)?;
            stages.end();
            return Ok(intensities(&found));
        }
        let fitted = problem.solve()?;
        let verdict = problem.verdict(&fitted)?;
        stages.end();
        let path = self.out.as_ref().filter(|_| fitted.is_update());
        if let Some(path) = path {
            files::write_text(path, &fitted.system_text(&problem)?)?;
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
    let values = [("state", verdict.state.into()), ("is_update", fitted.is_update().into())];
    let sentence = line(&format!("{}{written}", verdict.sentence), values);
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
    document.list("findings", &fitted.findings);
    document.table("fault", likely_faults(&verdict.fault));
    document.table("parameters", parameters(fitted, problem));
    document.table("sensors", residuals(fitted, problem)).detail();
    let left_out = problem.records.iter().flat_map(|record| &record.left_out);
    document.data("left_out", &left_out.collect::<Vec<_>>());
    document.data("suspects", &fitted.suspects.iter().take(5).collect::<Vec<_>>());
    document.fact("steps", "", Value::of("", &fitted.steps));
    document
}

fn parameters(fitted: &FitResults, problem: &Fit) -> Table {
    let mut table = Table::of(
        "name:parameter | unit: | nominal | value:fitted | standard_error:± 1 σ | tolerance_sigma: | knowledge:_",
    );
    for (k, unknown) in problem.unknowns.iter().enumerate() {
        let per_sigma = unknown.per_sigma(unknown.nominal());
        let others = match unknown.members.len() {
            0 | 1 => String::new(),
            count => format!(" and {} more", count - 1),
        };
        table.push(row![
            Value::of(format!("{}{others}", unknown.name), &unknown.name),
            unknown.unit.symbol(),
            Value::mixed(unknown.nominal(), unknown.unit),
            Value::mixed(unknown.value(fitted.z[k]), unknown.unit),
            Value::difference((fitted.known.error(k) * per_sigma).abs(), unknown.unit, 2),
            Value::of("", &per_sigma.abs()),
            fitted.known.sentence("record", &problem.unknowns, k),
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
    let text = onset.map_or_else(
        || "first sample".to_owned(),
        |FoundOnset { at_s, low_s, high_s, .. }| format!("{at_s:.2} s ({low_s:.2} … {high_s:.2})"),
    );
    Value::of(text, &onset)
}

/// The failure for a system of another study, with the study that it may belong to: the built-in one of its name, or the
/// one that `servotwin init` writes next to the file.
fn other_system(path: &Path) -> Result<Failure, Failure> {
    let system = System::read(path)?.name;
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let beside = path.with_file_name(format!("{stem}_study.toml"));
    let own = match built_in::find(&built_in::STUDIES, &system) {
        Some(_) => system.clone(),
        None if beside.exists() => beside.display().to_string(),
        None => "FILE".into(),
    };
    Ok(Failure::input(format!(
        "tolerances and faults are a study's, and without --study those of '{USUAL}' are taken, to which the system \
         '{system}' does not belong: give --study {own}"
    )))
}

/// Finds the unknowns by their names: full names of their parameters, or ends of them.
fn chosen(names: &[String], all: &[Unknown], study: &Study) -> Result<Vec<Unknown>, Failure> {
    let components = &study.system.network().components;
    let mut found: Vec<Unknown> = Vec::new();
    for name in names {
        let is_named = |&(component, parameter, _): &(usize, usize, f64)| {
            let id = components[component].parameter_name(parameter);
            id == *name || id.ends_with(&format!(".{name}"))
        };
        let own: Vec<&Unknown> =
            all.iter().filter(|unknown| unknown.members.iter().any(is_named)).collect();
        if own.is_empty() {
            let known = all.iter().map(|unknown| unknown.name.clone()).collect();
            return Err(UnknownName { what: "tolerance for", given: name.clone(), known }.into());
        }
        for unknown in own {
            if found.contains(unknown) {
                let twice = format!("'{}' is given twice", unknown.name);
                return Err(Failure::option("--parameters", twice));
            }
            found.push(unknown.clone());
        }
    }
    Ok(found)
}

/// Finds the faults by their names.
pub(crate) fn chosen_faults(
    names: &[String],
    system: &System,
) -> Result<Vec<(usize, usize)>, Failure> {
    Ok(names.iter().map(|id| system.find_fault(id)).collect::<Result<_, _>>()?)
}
