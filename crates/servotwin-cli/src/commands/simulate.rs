//! `servotwin simulate`: simulates a system, healthy or with faults.

use super::progress::Stages;
use super::{SystemOption, quantity, remark};
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::{Global, Run, stop};
use servotwin::shown::Shown;
use servotwin::signal::{Signal, help};
use servotwin::simulate::{
    MAX_SWEEP_RUNS, PreparedSimulation, RunResult, Simulation, SimulationError, SimulationProgress,
    SimulationResults, Sweep,
};
use servotwin::system::System;
use servotwin::text::number;
use servotwin::validity::CrossedLimit;
use servotwin_model::program::FaultAt;
use servotwin_model::solver::{Method, Statistics};
use servotwin_model::spec::Unit;
use servotwin_view::document::{Content, Document, Table, Value, Verdict, line};
use servotwin_view::row;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// Simulate a system, healthy or with faults, starting at rest.
#[derive(clap::Args)]
#[command(after_long_help = format!("Signals:\n{}", help()))]
pub(crate) struct Options {
    #[command(flatten)]
    system: SystemOption,
    /// The signal of the input 'command', e.g. step:size=10deg,at=0.1s (--help lists all kinds of signals).
    #[arg(long, value_name = "SIGNAL", allow_hyphen_values = true)]
    command: Option<Signal>,
    /// The signal of the input 'load_factor', e.g. 50%.
    #[arg(long, value_name = "SIGNAL", allow_hyphen_values = true)]
    load: Option<Signal>,
    /// The signal of any input. Repeat the option for several inputs.
    #[arg(long = "input", value_name = "ID=SIGNAL")]
    inputs: Vec<String>,
    /// A fault with its intensity from 0 (healthy) to 1, e.g. leakage_a.leakage=0.3. With @TIME, e.g. =0.3@12s, it
    /// begins at that time. Repeat the option for several faults.
    #[arg(long = "fault", value_name = "ID=INTENSITY[@TIME]")]
    faults: Vec<String>,
    /// Set a parameter, e.g. servo_valve.null_bias=2%. A number without a unit is in SI units. Repeat the option for
    /// several parameters.
    #[arg(long = "set", value_name = "ID=VALUE")]
    parameters: Vec<String>,
    /// Run once for each of N values from A to B of a parameter, or of a fault's intensity.
    #[arg(long, value_name = "ID=A:B:N")]
    sweep: Option<String>,
    /// Duration of the simulation.
    #[arg(long, value_name = "TIME", default_value = "5s", allow_hyphen_values = true)]
    duration: String,
    /// Sampling rate of the recorded values.
    #[arg(long, value_name = "FREQUENCY", default_value = "100Hz", allow_hyphen_values = true)]
    rate: String,
    /// What to record, separated by commas: a sensor, an input, a quantity such as actuator_1.cylinder.position_m, a
    /// component for all of its quantities, or 'all' [default: the driven inputs and the sensors].
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    record: Vec<String>,
    /// Record sensors as they read: with their declared noise, drawn from this seed, and in the steps of their
    /// converters. The simulation does not change.
    #[arg(long, value_name = "SEED")]
    noise: Option<u64>,
    /// The solver's method.
    #[arg(long, default_value = "rodas4p2", value_parser = super::one_of(Method::ALL, Method::name))]
    method: Method,
    /// Error tolerance of a step, relative to the scales of the states [default: 4e-6].
    #[arg(long, conflicts_with = "step", allow_hyphen_values = true)]
    tolerance: Option<String>,
    /// Use this fixed step instead of error control.
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    step: Option<String>,
    /// Write the recorded values to a .csv or .parquet file.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Draw the recorded values to a .svg file.
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

/// A simulation that is ready to start.
struct Plan<'s> {
    system: &'s System,
    method: Method,
    duration_s: f64,
    period_s: f64,
    /// The signal that drives each input, as text.
    signals: Vec<Option<String>>,
    prepared: PreparedSimulation<'s>,
}

impl Run for Options {
    fn paths(&self) -> Paths {
        let inputs = self.inputs.iter();
        let inputs = inputs.filter_map(|text| text.split_once('=')?.1.parse::<Signal>().ok());
        let signals = self.command.iter().chain(&self.load).cloned().chain(inputs);
        let tables = signals.flat_map(|signal| signal.files());
        Paths::default()
            .read("SYSTEM", &self.system.path)
            .read("the table", tables)
            .write("--out", Format::Table, &self.out)
            .write("--plot", Format::SVG, &self.plot)
    }

    fn run(&self, global: Global) -> Result<Document, Failure> {
        let system = self.system.read()?;
        let plan = Plan::new(self, &system)?;
        stop::heed();
        let begin = Instant::now();
        let all = plan.prepared.samples() * plan.prepared.runs.len();
        let (stages, done) = (Stages::new(global), AtomicUsize::new(0));
        let count = |progress| {
            if progress == SimulationProgress::Sample {
                stages.count("simulating", done.fetch_add(1, Ordering::Relaxed) + 1, all);
            }
        };
        let results = plan.prepared.run(&count, Some(stop::flag()));
        let results = results.map_err(|error| self.failure(error))?;
        stages.end();
        let wall_s = begin.elapsed().as_secs_f64();
        if let Some(path) = &self.out {
            results.table()?.write(path)?;
        }
        if let Some(path) = &self.plot {
            results.figure().draw().save(path)?;
        }
        let all_s = plan.duration_s * results.runs.len() as f64;
        let factor = number(all_s / wall_s, 3);
        let speed = format!("{all_s} s in {} s: {factor} times real time", number(wall_s, 3));
        remark(global, &speed);
        Ok(plan.document(&results))
    }
}

/// Adds caveats about the results.
fn caveats(document: &mut Document, results: &SimulationResults) {
    if !results.runs.iter().all(RunResult::starts_at_steady_state) {
        let is_measured = results.runs.iter().any(RunResult::has_limit_cycle);
        let why = if is_measured { ", a limit cycle was measured" } else { "" };
        document.note(format!(
            "no rest was found at the inputs of time zero{why}: the run begins on the move"
        ));
    }
    let mut table = Table::of("run: | name: | first_s: | duration_s: | extreme: | limit:");
    for (place, run) in results.runs.iter().enumerate() {
        let which = match results.runs.len() {
            1 => String::new(),
            _ => format!("run {}: ", place + 1),
        };
        for finding in &run.outside_validity {
            document.note(format!("{which}{finding}"));
            let limit = match finding.limit {
                CrossedLimit::Vapor => "vapor",
                CrossedLimit::High => "high",
                CrossedLimit::Travel => "travel",
            };
            let name = &finding.name;
            let [first_s, duration_s, extreme] =
                [finding.first_s, finding.duration_s, finding.extreme]
                    .map(|own| Value::of("", &own));
            table.push(row![place + 1, name, first_s, duration_s, extreme, limit]);
        }
    }
    document.table("outside_validity", table);
}

/// Applies the method and the step size from the options.
fn stepped<'s>(options: &Options, simulation: Simulation<'s>) -> Result<Simulation<'s>, Failure> {
    let simulation = simulation.method(options.method);
    Ok(match (&options.step, &options.tolerance) {
        (Some(text), _) => {
            let range = "greater than 0, at most 1 s";
            simulation.step_s(quantity(
                "--step",
                text,
                Unit::Second,
                f64::MIN_POSITIVE..=1.0,
                range,
            )?)
        }
        (None, _) if options.method == Method::RungeKutta4 => {
            return Err(Failure::usage(
                "--method rk4 has no error control: give --step, at most 2.8 over the fastest eigenvalue of 'servotwin describe'",
            ));
        }
        (None, None) => simulation,
        (None, Some(text)) => {
            let range = "greater than 0, at most 0.1";
            simulation.tolerance(quantity(
                "--tolerance",
                text,
                Unit::None,
                f64::MIN_POSITIVE..=0.1,
                range,
            )?)
        }
    })
}

/// Splits `name=value`.
fn split<'t>(option: &'static str, text: &'t str) -> Result<(&'t str, &'t str), Failure> {
    let sides = text.split_once('=');
    sides.ok_or_else(|| Failure::usage(format!("{option} needs NAME=VALUE, not '{text}'")))
}

/// Parses `name=intensity`.
fn intensity(text: &str) -> Result<(String, f64), Failure> {
    let (id, value) = split("--fault", text)?;
    Ok((id.to_owned(), quantity("--fault", value, Unit::None, .., "")?))
}

/// Splits `name=intensity@time` into `name=intensity` and the time, s.
pub(crate) fn onset(text: &str, duration_s: f64) -> Result<(&str, Option<f64>), Failure> {
    let Some((fault, at)) = text.rsplit_once('@') else { return Ok((text, None)) };
    let words = format!("a fault begins within the run, from 0 to {duration_s} s");
    let at_s = quantity("--fault", at, Unit::Second, 0.0..duration_s, &words)?;
    Ok((fault, Some(at_s)))
}

/// Parses a fault from `name=intensity`.
pub(crate) fn fault(system: &System, text: &str) -> Result<FaultAt, Failure> {
    let (id, intensity) = intensity(text)?;
    let (component, fault) = system.find_fault(&id)?;
    if !(0.0..=1.0).contains(&intensity) {
        return Err(Failure::out_of_range("--fault", text, "an intensity goes from 0 to 1"));
    }
    Ok(FaultAt { component, fault, intensity })
}

/// Parses `name=value` of a parameter into its id and SI value.
fn parameter(system: &System, text: &str) -> Result<(String, f64), Failure> {
    let (id, value) = split("--set", text)?;
    let (component, parameter) = system.find_parameter(id)?;
    let unit = system.network().components[component].component.parameters[parameter].unit;
    Ok((id.to_owned(), quantity("--set", value, unit, .., "")?))
}

/// Parses a sweep from `name=from:to:count`.
fn sweep(simulation: &Simulation, text: &str) -> Result<Sweep, Failure> {
    let (id, range) = split("--sweep", text)?;
    let unit = simulation.sweep(id, &[])?.unit;
    let wrong = |range: &'static str| Failure::out_of_range("--sweep", text, range);
    let parts: Vec<&str> = range.split(':').collect();
    let [from, to, count] = parts[..] else {
        return Err(wrong("two values and their number are needed, such as 0:1:5"));
    };
    let end = |text| quantity("--sweep", text, unit, .., "");
    let (from, to) = (end(from)?, end(to)?);
    let count = count.parse().ok().filter(|n| (2..=MAX_SWEEP_RUNS).contains(n));
    let count = count.ok_or_else(|| wrong("the number of values goes from 2 to 1000"))?;
    let share = |k: usize| k as f64 / (count - 1) as f64;
    let values: Vec<f64> = (0..count).map(|k| from + (to - from) * share(k)).collect();
    Ok(simulation.sweep(id, &values)?)
}

/// The driven inputs with their signals.
fn signals(options: &Options) -> Result<Vec<(String, Signal)>, Failure> {
    let named = [("command", &options.command), ("load_factor", &options.load)];
    let named = named.into_iter().filter_map(|(id, signal)| {
        signal.as_ref().map(|signal| Ok((id.to_string(), signal.clone())))
    });
    let others = options.inputs.iter().map(|text| {
        let (id, signal) = split("--input", text)?;
        let option = format!("--input {id}");
        match signal.parse() {
            Ok(signal) => Ok((id.to_string(), signal)),
            Err(error) => Err(Failure::signal(option, &error)),
        }
    });
    named.chain(others).collect()
}

impl Options {
    /// The option that gave the name of an input, a fault or a parameter.
    fn option_of(&self, name: &str) -> String {
        let gives = |texts: &[String]| {
            texts.iter().any(|text| text.split_once('=').is_some_and(|(id, _)| id == name))
        };
        let is_swept = |text: &String| text.starts_with(&format!("{name}="));
        match name {
            "command" if self.command.is_some() => "--command".into(),
            "load_factor" if self.load.is_some() => "--load".into(),
            _ if self.sweep.as_ref().is_some_and(is_swept) => "--sweep".into(),
            _ if gives(&self.faults) => "--fault".into(),
            _ if gives(&self.parameters) => "--set".into(),
            _ => format!("--input {name}"),
        }
    }

    fn failure(&self, error: SimulationError) -> Failure {
        match error {
            SimulationError::UnknownName(error) => error.into(),
            SimulationError::Signal { input, error } => {
                Failure::signal(self.option_of(&input), &error)
            }
            SimulationError::Stopped { stopped, .. } => Failure::work(stopped),
            SimulationError::Canceled => Failure::stopped(),
            error => {
                let name = match &error {
                    SimulationError::Repeated { name }
                    | SimulationError::Samples { input: name, .. }
                    | SimulationError::OutOfRange { name, .. } => Some(name.as_str()),
                    _ => None,
                };
                match name {
                    Some(name) => Failure::option(self.option_of(name), error),
                    None => Failure::usage(error),
                }
            }
        }
    }
}

impl<'s> Plan<'s> {
    fn new(options: &Options, system: &'s System) -> Result<Self, Failure> {
        let long = "greater than 0, at most 1e6 s";
        let duration_s =
            quantity("--duration", &options.duration, Unit::Second, f64::MIN_POSITIVE..=1e6, long)?;
        let fast = "greater than 0, at most 1e6 Hz";
        let rate_hz =
            quantity("--rate", &options.rate, Unit::Hertz, f64::MIN_POSITIVE..=1e6, fast)?;
        let period_s = 1.0 / rate_hz;
        let mut simulation = Simulation::new(system)
            .duration_s(duration_s)
            .sample_period_s(period_s)
            .record(options.record.iter().cloned());
        simulation = stepped(options, simulation)?;
        if let Some(seed) = options.noise {
            simulation = simulation.noise(seed);
        }
        for text in &options.faults {
            let (text, at_s) = onset(text, duration_s)?;
            let (id, intensity) = intensity(text)?;
            simulation = match at_s {
                Some(at_s) => simulation.fault_from(&id, intensity, at_s),
                None => simulation.fault(&id, intensity),
            };
        }
        for text in &options.parameters {
            let (id, value) = parameter(system, text)?;
            simulation = simulation.parameter(&id, value);
        }
        let mut signals = vec![None; system.network().inputs.len()];
        for (id, signal) in self::signals(options)? {
            signals[system.find_input(&id)?] = Some(signal.to_string());
            simulation = simulation.input(&id, signal);
        }
        let sweep = options.sweep.as_ref().map(|text| sweep(&simulation, text)).transpose()?;
        let prepared = simulation.prepare(sweep).map_err(|error| options.failure(error))?;
        Ok(Plan { system, method: options.method, duration_s, period_s, signals, prepared })
    }

    /// The driven inputs, as index, text of the signal, and rms.
    fn driven(&self) -> impl Iterator<Item = (usize, &str, f64)> {
        self.signals.iter().enumerate().filter_map(|(place, signal)| {
            let rms = self.prepared.base.curves[place].mean_square(0.0, self.duration_s).sqrt();
            signal.as_ref().map(|signal| (place, signal.as_str(), rms))
        })
    }

    fn fault_id(&self, fault: &FaultAt) -> String {
        self.system.network().components[fault.component].fault_name(fault.fault)
    }

    /// The full name of a parameter, and its unit.
    fn parameter(&self, component: usize, parameter: usize) -> (String, Unit) {
        let instance = &self.system.network().components[component];
        (instance.parameter_name(parameter), instance.component.parameters[parameter].unit)
    }

    fn document(&self, results: &SimulationResults) -> Document {
        let system = self.system;
        let values = [
            ("samples", results.times_s.len().into()),
            ("duration", Value::seconds(self.duration_s, 5)),
        ];
        let text = format!("{}: {{samples}} samples of {{duration}}", system.title);
        let mut document = Document::new("simulate", Verdict::neutral(line(&text, values)));
        document.fact("system", "", system.name.as_str());
        document.fact("samples", "", results.times_s.len());
        document.fact("duration", "", Value::seconds(self.duration_s, 5));
        document.fact("sample_period", "", Value::seconds(self.period_s, 5));
        document.fact("method", "", self.method.name());
        self.settings(&mut document);
        document.table("recorded", recorded(results));
        let mut sum = Statistics::default();
        results.runs.iter().for_each(|run| sum += run.statistics);
        let Statistics { steps, rejected, jacobians, evaluations, .. } = sum;
        let steps = line(
            "{steps} steps, {rejected} rejected, {jacobians} Jacobians",
            [
                ("steps", steps.into()),
                ("rejected", rejected.into()),
                ("jacobians", jacobians.into()),
                ("evaluations", evaluations.into()),
            ],
        );
        document.push("solver", Content::Text(steps));
        caveats(&mut document, results);
        let runs = &results.runs;
        document.fact("starts_at_rest", "", runs.iter().all(RunResult::starts_at_steady_state));
        document.fact("limit_cycle_measured", "", runs.iter().any(RunResult::has_limit_cycle));
        document
    }

    /// What the user chose: inputs, parameters and faults.
    fn settings(&self, document: &mut Document) {
        let mut inputs = Table::of("id:input | signal | unit: | rms");
        for (place, signal, rms) in self.driven() {
            let input = &self.system.network().inputs[place];
            let rms = Value::mixed(rms, input.unit);
            inputs.push(row![&input.id, signal, input.unit.symbol(), rms]);
        }
        document.table("inputs", inputs);
        let mut set = Table::of("id:parameter | unit: | value");
        for &(component, parameter, value) in &self.prepared.base.parameters {
            let (id, unit) = self.parameter(component, parameter);
            set.push(row![id, unit.symbol(), Value::mixed(value, unit)]);
        }
        document.table("set", set);
        let mut faults = Table::of("id:fault | intensity | from");
        let base = &self.prepared.base;
        for (fault, at_s) in base.faults.iter().zip(&base.onsets_s) {
            let intensity = Value::number(fault.intensity, fault.intensity.to_string());
            faults.push(row![self.fault_id(fault), intensity, Value::seconds(at_s.max(0.0), 5)]);
        }
        document.table("faults", faults);
    }
}

/// The recorded quantities of all runs: initial, smallest, largest and final value.
fn recorded(results: &SimulationResults) -> Table {
    let mut table = Table::of("name: | :quantity | unit:");
    if let Some(sweep) = &results.sweep {
        table.column("value", sweep.id.clone());
    }
    for (id, heading) in [("start", "start"), ("min", "least"), ("max", "most"), ("end", "end")] {
        table.column(id, heading);
    }
    for (place, one) in results.recorded.iter().enumerate() {
        for (run, result) in results.runs.iter().enumerate() {
            let [start, least, most, end] = extremes(&result.values[place]);
            let read = Shown::of(one.unit, least.abs().max(most.abs()));
            let mut row = row![&one.name, &one.label, one.unit.symbol()];
            let at = results.sweep.as_ref();
            row.extend(at.map(|sweep| Value::number(sweep.values[run], sweep.label(run))));
            row.extend([start, least, most, end].map(|si| {
                let text = format!("{} {}", number(read.value(si), 5), read.symbol());
                Value::number(si, text.trim_end())
            }));
            table.push(row);
        }
    }
    table
}

/// The initial, smallest, largest and final value of a recorded quantity.
fn extremes(values: &[f64]) -> [f64; 4] {
    [
        values.first().copied().unwrap_or(f64::NAN),
        values.iter().copied().fold(f64::INFINITY, f64::min),
        values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        values.last().copied().unwrap_or(f64::NAN),
    ]
}
