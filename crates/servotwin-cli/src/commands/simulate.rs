//! `servotwin simulate`: one run of a system, healthy or with faults.

use super::progress::is_shown;
use super::{SystemOption, note};
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::render::{Grid, Side, json, number, shown};
use crate::{Global, stop};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};
use servotwin::ensemble::{Ensemble, Sink, Variant};
use servotwin::figure::time_series::TimeSeries;
use servotwin::nearest::UnknownName;
use servotwin::recording::{self, Recorded, with_suffix};
use servotwin::rest::Stopped;
use servotwin::shown::Shown;
use servotwin::signal::{Quantity, Signal, help};
use servotwin::system::System;
use servotwin::table::{self, Column, Table};
use servotwin_model::lanes::{self, Level};
use servotwin_model::program::FaultAt;
use servotwin_model::signal::Piecewise;
use servotwin_model::solver::{self, Control, Method, Settings, Statistics};
use servotwin_model::spec::Unit;
use std::path::PathBuf;
use std::time::Instant;

/// Simulate a system, healthy or with faults, from rest.
#[derive(clap::Args)]
#[command(after_long_help = format!("Signals:\n{}", help()))]
pub struct Options {
    #[command(flatten)]
    system: SystemOption,
    /// The signal of the input 'command', e.g. step:size=10deg,at=0.1s
    /// (--help lists all kinds).
    #[arg(long, value_name = "SIGNAL", allow_hyphen_values = true)]
    command: Option<Signal>,
    /// The signal of the input 'load_factor', e.g. 50%.
    #[arg(long, value_name = "SIGNAL", allow_hyphen_values = true)]
    load: Option<Signal>,
    /// The signal of any input; may be given for several.
    #[arg(long = "input", value_name = "ID=SIGNAL")]
    inputs: Vec<String>,
    /// A fault with its intensity from 0 (healthy) to 1; may be given for several.
    #[arg(long = "fault", value_name = "ID=INTENSITY")]
    faults: Vec<String>,
    /// Another value for a parameter, such as servo_valve.null_bias=2% (a number without a unit is
    /// SI); may be given for several.
    #[arg(long = "set", value_name = "ID=VALUE")]
    parameters: Vec<String>,
    /// Run once for each of N values from A to B of a parameter, or of a fault's intensity.
    #[arg(long, value_name = "ID=A:B:N")]
    sweep: Option<String>,
    /// How long.
    #[arg(long, value_name = "TIME", default_value = "5s", allow_hyphen_values = true)]
    duration: String,
    /// Samples per second of what is recorded.
    #[arg(long, value_name = "FREQUENCY", default_value = "100Hz", allow_hyphen_values = true)]
    rate: String,
    /// What to record, separated by commas: a sensor, an input, a quantity such
    /// as actuator_1.cylinder.position_m, a component for all of its
    /// quantities, or 'all' [default: the driven inputs and the sensors].
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    record: Vec<String>,
    /// Record of sensors what they show: with the noise that they declare, drawn from this seed, and in the steps of their
    /// converters. Nothing that is simulated changes.
    #[arg(long, value_name = "SEED")]
    noise: Option<u64>,
    /// The solver's method.
    #[arg(long, default_value = "rodas4p2", value_parser = methods())]
    method: Method,
    /// Allowed error of a step, relative to the states' scales [default: 1e-5].
    #[arg(long, conflicts_with = "step", allow_hyphen_values = true)]
    tolerance: Option<String>,
    /// A fixed step instead of error control.
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    step: Option<String>,
    /// The instruction set [default: the widest of this processor; the results
    /// do not depend on it].
    #[arg(long, value_parser = levels())]
    lanes: Option<Level>,
    /// Write the recorded values to a .csv or .parquet file.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Draw the recorded values to a .svg or .png file.
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

fn methods() -> impl TypedValueParser<Value = Method> {
    let names = Method::ALL.map(Method::name);
    PossibleValuesParser::new(names).map(|name| {
        let found = Method::ALL.into_iter().find(|method| method.name() == name);
        found.expect("clap admits known names only")
    })
}

fn levels() -> impl TypedValueParser<Value = Level> {
    let available = lanes::ALL.into_iter().filter(|level| level.available());
    PossibleValuesParser::new(available.map(Level::name)).map(|name| {
        let found = lanes::ALL.into_iter().find(|level| level.name() == name);
        found.expect("clap admits known names only")
    })
}

/// What is different from run to run.
struct Sweep {
    /// Its full name.
    id: String,
    unit: Unit,
    target: Target,
    values: Vec<f64>,
}

/// What a sweep changes.
#[derive(Clone, Copy)]
enum Target {
    Parameter(usize, usize),
    Fault(usize, usize),
}

/// What a run has given: one list per quantity, and the solver's work.
type Given = (Vec<Vec<f64>>, Statistics);

/// Everything about a run before it starts.
struct Plan<'s> {
    system: &'s System,
    settings: Settings,
    level: Level,
    duration_s: f64,
    period_s: f64,
    faults: Vec<FaultAt>,
    /// Parameters with other values: component, parameter, value.
    overrides: Vec<(usize, usize, f64)>,
    sweep: Option<Sweep>,
    /// The signal that each input was given, as text.
    signals: Vec<Option<String>>,
    curves: Vec<Piecewise>,
    recorded: Vec<Recorded>,
}

impl Options {
    /// The files that it reads and writes.
    pub fn paths(&self) -> Paths {
        let inputs = self.inputs.iter();
        let inputs = inputs.filter_map(|text| text.split_once('=')?.1.parse::<Signal>().ok());
        let signals = self.command.iter().chain(&self.load).cloned().chain(inputs);
        let tables = signals.flat_map(|signal| signal.files());
        Paths::default()
            .read("SYSTEM", &self.system.path)
            .read("the table", tables)
            .write("--out", Format::Table, &self.out)
            .write("--plot", Format::Figure, &self.plot)
    }
}

/// The text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let system = options.system.read()?;
    let plan = Plan::new(options, &system)?;
    stop::heed();
    let begin = Instant::now();
    let mut runs = plan.run(global)?;
    let wall_s = begin.elapsed().as_secs_f64();
    if let Some(seed) = options.noise {
        for (run, (values, _)) in runs.iter_mut().enumerate() {
            recording::as_shown(&system, &plan.recorded, values, seed, run);
        }
    }
    if runs.iter().any(|(_, statistics)| statistics.unsettled > 0) {
        note(global, "no rest was found at the inputs of time zero: the run begins on the move");
    }
    let samples = runs[0].0.first().map_or(0, Vec::len);
    let times_s: Vec<f64> = (0..samples).map(|k| k as f64 * plan.period_s).collect();
    if let Some(path) = &options.out {
        table::write(path, &plan.table(&times_s, &runs)?)?;
    }
    if let Some(path) = &options.plot {
        plan.figure(&times_s, &runs).draw().save(path)?;
    }
    if !global.quiet {
        let all_s = plan.duration_s * runs.len() as f64;
        let factor = number(all_s / wall_s, 3);
        eprintln!("{all_s} s in {} s: {factor} times real time", number(wall_s, 3));
    }
    Ok(match global {
        Global { json: true, .. } => json(&plan.json(&runs)),
        Global { quiet: true, .. } => String::new(),
        _ => plan.people(&runs),
    })
}

/// The SI value of an option within `(0, largest]`.
fn positive(
    option: &'static str,
    text: &str,
    unit: Unit,
    largest: f64,
    range: &'static str,
) -> Result<f64, Failure> {
    let value = Quantity::in_unit(text, unit).map_err(|error| Failure::Number { option, error })?;
    if value > 0.0 && value <= largest {
        return Ok(value);
    }
    Err(Failure::OutOfRange { option, given: text.into(), range: range.into() })
}

fn settings(options: &Options) -> Result<Settings, Failure> {
    let control = match (&options.step, &options.tolerance) {
        (Some(text), _) => {
            let step_s =
                positive("--step", text, Unit::Second, 1.0, "greater than 0, at most 1 s")?;
            Control::Fixed { step_s }
        }
        (None, _) if options.method == Method::RungeKutta4 => {
            return Err(Failure::Options(
                "--method rk4 has no error control: give --step, at most 2.8 over the fastest eigenvalue of 'servotwin describe'",
            ));
        }
        (None, text) => {
            let text = text.as_deref().unwrap_or("1e-5");
            let range = "greater than 0, at most 0.1";
            let tolerance = positive("--tolerance", text, Unit::None, 0.1, range)?;
            Control::within(tolerance)
        }
    };
    Ok(Settings { method: options.method, control, land_on_samples: true })
}

/// The two sides of `name=value`.
fn split<'t>(option: &'static str, text: &'t str) -> Result<(&'t str, &'t str), Failure> {
    let sides = text.split_once('=');
    sides.ok_or_else(|| Failure::NoEqualSign { option, given: text.into() })
}

fn faults(system: &System, texts: &[String]) -> Result<Vec<FaultAt>, Failure> {
    let mut faults: Vec<FaultAt> = Vec::new();
    for text in texts {
        let new = fault(system, text)?;
        if faults.iter().any(|f| (f.component, f.fault) == (new.component, new.fault)) {
            let name = split("--fault", text)?.0.into();
            return Err(Failure::Repeated { option: "--fault", name });
        }
        faults.push(new);
    }
    Ok(faults)
}

/// A fault from `name=intensity`.
pub fn fault(system: &System, text: &str) -> Result<FaultAt, Failure> {
    let (id, value) = split("--fault", text)?;
    let (component, fault) = system.find_fault(id)?;
    let intensity = Quantity::in_unit(value, Unit::None)
        .map_err(|error| Failure::Number { option: "--fault", error })?;
    if !(0.0..=1.0).contains(&intensity) {
        let range = "an intensity goes from 0 to 1";
        return Err(Failure::OutOfRange {
            option: "--fault",
            given: text.into(),
            range: range.into(),
        });
    }
    Ok(FaultAt { component, fault, intensity })
}

/// The parameters that were given other values.
fn parameters(system: &System, texts: &[String]) -> Result<Vec<(usize, usize, f64)>, Failure> {
    let mut values: Vec<(usize, usize, f64)> = Vec::new();
    for text in texts {
        let (id, value) = split("--set", text)?;
        let (component, parameter) = system.find_parameter(id)?;
        if values.iter().any(|&(c, p, _)| (c, p) == (component, parameter)) {
            return Err(Failure::Repeated { option: "--set", name: id.into() });
        }
        let instance = &system.network().components[component];
        let unit = instance.component.spec().parameters[parameter].unit;
        let value = Quantity::in_unit(value, unit)
            .map_err(|error| Failure::Number { option: "--set", error })?;
        values.push((component, parameter, value));
    }
    possible(system, "--set", &values)?;
    Ok(values)
}

fn possible(
    system: &System,
    option: &'static str,
    values: &[(usize, usize, f64)],
) -> Result<(), Failure> {
    if values.is_empty() {
        return Ok(());
    }
    system.possible_with(values).map_err(|reason| Failure::Parameters { option, reason })
}

/// At most so many runs of a sweep.
const MOST: usize = 1000;

/// A sweep from `name=a:b:n`.
fn sweep(system: &System, text: &str, set: &[(usize, usize, f64)]) -> Result<Sweep, Failure> {
    let (id, range) = split("--sweep", text)?;
    let parameter = system.parameter(id).map(|(c, p)| {
        let spec = system.network().components[c].component.spec();
        (Target::Parameter(c, p), spec.parameters[p].unit)
    });
    let fault = || system.program.find_fault(id).map(|(c, f)| (Target::Fault(c, f), Unit::None));
    let (target, unit) = parameter.or_else(fault).ok_or_else(|| UnknownName {
        what: "parameter or fault",
        given: id.into(),
        known: [system.all_parameters(), system.all_faults()].concat(),
    })?;
    let wrong = |range: &'static str| Failure::OutOfRange {
        option: "--sweep",
        given: text.into(),
        range: range.into(),
    };
    let parts: Vec<&str> = range.split(':').collect();
    let [from, to, count] = parts[..] else {
        return Err(wrong("two values and their number are needed, such as 0:1:5"));
    };
    let value = |text| {
        let number = Quantity::in_unit(text, unit);
        number.map_err(|error| Failure::Number { option: "--sweep", error })
    };
    let (from, to) = (value(from)?, value(to)?);
    let count = count.parse().ok().filter(|n| (2..=MOST).contains(n));
    let count = count.ok_or_else(|| wrong("the number of values goes from 2 to 1000"))?;
    let share = |k: usize| k as f64 / (count - 1) as f64;
    let values: Vec<f64> = (0..count).map(|k| from + (to - from) * share(k)).collect();
    match target {
        Target::Fault(..) if values.iter().any(|v| !(0.0..=1.0).contains(v)) => {
            return Err(wrong("an intensity goes from 0 to 1"));
        }
        Target::Fault(..) => {}
        Target::Parameter(c, p) => {
            if set.iter().any(|&(other, place, _)| (other, place) == (c, p)) {
                return Err(Failure::Repeated { option: "--sweep", name: id.into() });
            }
            for &value in &values {
                possible(system, "--sweep", &[set, &[(c, p, value)]].concat())?;
            }
        }
    }
    Ok(Sweep { id: id.into(), unit, target, values })
}

/// The signals that were given: (option, input, signal).
fn signals(options: &Options) -> Result<Vec<(String, String, Signal)>, Failure> {
    let named =
        [("--command", "command", &options.command), ("--load", "load_factor", &options.load)];
    let named = named.into_iter().filter_map(|(option, id, signal)| {
        signal.as_ref().map(|signal| Ok((option.to_string(), id.to_string(), signal.clone())))
    });
    let others = options.inputs.iter().map(|text| {
        let (id, signal) = split("--input", text)?;
        let option = format!("--input {id}");
        match signal.parse() {
            Ok(signal) => Ok((option, id.to_string(), signal)),
            Err(error) => Err(Failure::Signal { option, error }),
        }
    });
    named.chain(others).collect()
}

impl<'s> Plan<'s> {
    fn new(options: &Options, system: &'s System) -> Result<Self, Failure> {
        let long = "greater than 0, at most 1e6 s";
        let duration_s = positive("--duration", &options.duration, Unit::Second, 1e6, long)?;
        let fast = "greater than 0, at most 1e6 Hz";
        let rate_hz = positive("--rate", &options.rate, Unit::Hertz, 1e6, fast)?;
        let mut plan = Plan {
            system,
            settings: settings(options)?,
            level: options.lanes.unwrap_or_else(Level::best),
            duration_s,
            period_s: 1.0 / rate_hz,
            faults: faults(system, &options.faults)?,
            overrides: parameters(system, &options.parameters)?,
            sweep: None,
            signals: vec![None; system.network().inputs.len()],
            curves: system.default_inputs(),
            recorded: Vec::new(),
        };
        for (option, id, signal) in signals(options)? {
            plan.drive(option, &id, &signal)?;
        }
        if let Some(text) = &options.sweep {
            let sweep = sweep(system, text, &plan.overrides)?;
            if let Target::Fault(c, f) = sweep.target
                && plan.faults.iter().any(|fault| (fault.component, fault.fault) == (c, f))
            {
                return Err(Failure::Repeated { option: "--sweep", name: sweep.id });
            }
            plan.sweep = Some(sweep);
        }
        let inputs = system.network().inputs.iter().zip(&plan.signals);
        let driven = inputs.filter(|(_, signal)| signal.is_some()).map(|(input, _)| &*input.id);
        plan.recorded = recording::choose(system, &options.record, &driven.collect::<Vec<_>>())?;
        let runs = plan.runs() as f64;
        if plan.recorded.len() as f64 * duration_s * rate_hz * runs > 2e8 {
            return Err(Failure::Options(
                "more than 200 million values would be recorded: choose with --record, or a lower --rate",
            ));
        }
        Ok(plan)
    }

    fn drive(&mut self, option: String, id: &str, signal: &Signal) -> Result<(), Failure> {
        let place = self.system.find_input(id)?;
        if self.signals[place].is_some() {
            return Err(Failure::Repeated { option: "--input", name: id.into() });
        }
        let curve = self.system.driven(place, signal, self.duration_s);
        self.curves[place] = curve.map_err(|error| Failure::Signal { option, error })?;
        self.signals[place] = Some(signal.to_string());
        Ok(())
    }

    fn runs(&self) -> usize {
        self.sweep.as_ref().map_or(1, |sweep| sweep.values.len())
    }

    /// A run of the sweep, or the only one.
    fn variant(&self, run: usize) -> Variant<'_> {
        let mut variant = Variant {
            faults: self.faults.clone(),
            overrides: self.overrides.clone(),
            inputs: self.curves.iter().collect(),
            ..Variant::default()
        };
        if let Some(sweep) = &self.sweep {
            let value = sweep.values[run];
            match sweep.target {
                Target::Parameter(c, p) => variant.overrides.push((c, p, value)),
                Target::Fault(component, fault) => {
                    variant.faults.push(FaultAt { component, fault, intensity: value });
                }
            }
        }
        variant
    }

    /// Runs: the recorded values of each run, one list per quantity.
    fn run(&self, global: Global) -> Result<Vec<Given>, Failure> {
        let ensemble = Ensemble {
            settings: self.settings,
            level: self.level,
            record: self.recorded.iter().map(|one| one.slot).collect(),
            duration_s: self.duration_s,
            sample_period_s: self.period_s,
            cancel: Some(stop::flag()),
            ..Ensemble::of(self.system)
        };
        let bar = progress(ensemble.samples() * self.runs(), global);
        let values =
            || Recorder { values: vec![Vec::new(); self.recorded.len()], bar: bar.clone() };
        let mut results: Vec<Option<Result<Given, solver::Failure>>> = Vec::new();
        results.resize_with(self.runs(), || None);
        ensemble.run(
            self.runs(),
            |run| self.variant(run),
            |_| values(),
            |run, recorder, outcome| {
                results[run] = Some(outcome.map(|statistics| (recorder.values, statistics)));
            },
        );
        bar.finish_and_clear();
        // A run that was stopped gives no result at all.
        let results: Option<Vec<_>> = results.into_iter().collect();
        let results = results.ok_or(Failure::Stopped)?.into_iter();
        let named = |failure| Failure::Run(Stopped::new(self.system, failure));
        results.map(|result| result.map_err(named)).collect()
    }

    /// All runs below each other, with the value of the sweep as the first column.
    fn table(&self, times_s: &[f64], runs: &[Given]) -> Result<Table, Failure> {
        let below =
            |place: usize| runs.iter().flat_map(|run| run.0[place].iter().copied()).collect();
        let values = (0..self.recorded.len()).map(below).collect();
        let times = times_s.repeat(runs.len());
        let table = recording::table(self.system, &self.recorded, times, values)?;
        let Some(sweep) = &self.sweep else { return Ok(table) };
        let of_run = sweep.values.iter().flat_map(|&value| times_s.iter().map(move |_| value));
        let (name, unit) = (with_suffix(&sweep.id, sweep.unit), sweep.unit.symbol());
        let first = Column::new(&name, unit, of_run.collect::<Vec<f64>>());
        let columns = [first].into_iter().chain(table.columns().iter().cloned()).collect();
        let mut whole = Table::from_columns(columns)?;
        whole.metadata = table.metadata;
        Ok(whole)
    }

    /// One panel per unit, in the order they appear.
    fn figure(&self, times_s: &[f64], runs: &[Given]) -> TimeSeries<'static> {
        let (mut recorded, mut values) = (vec![], vec![]);
        for (place, one) in self.recorded.iter().enumerate() {
            for (run, given) in runs.iter().enumerate() {
                let label = match &self.sweep {
                    Some(sweep) => format!("{} at {}", one.label, sweep.shown(run)),
                    None => one.label.clone(),
                };
                recorded.push(Recorded { label, ..one.clone() });
                values.push(given.0[place].as_slice());
            }
        }
        recording::figure(&self.system.title, &recorded, times_s, &values)
    }

    /// The inputs that were driven: (place, text of the signal, rms).
    fn driven(&self) -> impl Iterator<Item = (usize, &str, f64)> {
        self.signals.iter().enumerate().filter_map(|(place, signal)| {
            let rms = self.curves[place].mean_square(0.0, self.duration_s).sqrt();
            signal.as_ref().map(|signal| (place, signal.as_str(), rms))
        })
    }

    fn fault_id(&self, fault: &FaultAt) -> String {
        let instance = &self.system.network().components[fault.component];
        format!("{}.{}", instance.id, instance.component.spec().faults[fault.fault].name)
    }

    fn json(&self, runs: &[Given]) -> Value {
        let inputs = self.driven().map(|(place, signal, rms)| {
            let input = &self.system.network().inputs[place];
            json!({ "id": input.id, "signal": signal, "unit": input.unit.symbol(), "rms": rms })
        });
        let faults = self
            .faults
            .iter()
            .map(|fault| json!({ "id": self.fault_id(fault), "intensity": fault.intensity }));
        let set = self.overrides.iter().map(|&(component, parameter, value)| {
            let (id, unit) = self.parameter(component, parameter);
            json!({ "id": id, "unit": unit.symbol(), "value": value })
        });
        let mut whole = json!({
            "system": self.system.name,
            "duration_s": self.duration_s,
            "sample_period_s": self.period_s,
            "samples": runs[0].0.first().map_or(0, Vec::len),
            "inputs": inputs.collect::<Vec<_>>(),
            "faults": faults.collect::<Vec<_>>(),
            "set": set.collect::<Vec<_>>(),
            "method": self.settings.method.name(),
        });
        match &self.sweep {
            None => self.add_run(&mut whole, &runs[0]),
            Some(sweep) => {
                let runs = sweep.values.iter().zip(runs).map(|(value, given)| {
                    let mut run = json!({ "value": value });
                    self.add_run(&mut run, given);
                    run
                });
                let runs: Vec<Value> = runs.collect();
                let (id, unit) = (&sweep.id, sweep.unit.symbol());
                whole["sweep"] = json!({ "id": id, "unit": unit, "runs": runs });
            }
        }
        whole
    }

    /// What one run has given.
    fn add_run(&self, to: &mut Value, (values, statistics): &Given) {
        let recorded = self.recorded.iter().zip(values).map(|(one, values)| {
            let Summary { start, least, most, end } = Summary::of(values);
            json!({
                "name": one.name, "unit": one.unit.symbol(),
                "start": start, "min": least, "max": most, "end": end,
            })
        });
        to["recorded"] = recorded.collect();
        to["steps"] = json!(statistics.steps);
        to["rejected"] = json!(statistics.rejected);
        to["evaluations"] = json!(statistics.evaluations);
        to["jacobians"] = json!(statistics.jacobians);
        to["starts_at_rest"] = json!(statistics.unsettled == 0);
    }

    /// The full name of a parameter, and its unit.
    fn parameter(&self, component: usize, parameter: usize) -> (String, Unit) {
        let instance = &self.system.network().components[component];
        let declared = &instance.component.spec().parameters[parameter];
        (format!("{}.{}", instance.id, declared.name), declared.unit)
    }

    fn people(&self, runs: &[Given]) -> String {
        let mut text = format!("{}\n", self.system.title);
        for (place, signal, rms) in self.driven() {
            let input = &self.system.network().inputs[place];
            text += &format!("{}: {signal}, rms {}\n", input.id, shown(rms, input.unit));
        }
        for &(component, parameter, value) in &self.overrides {
            let (id, unit) = self.parameter(component, parameter);
            text += &format!("{id} = {}\n", shown(value, unit));
        }
        for fault in &self.faults {
            text += &format!("fault {} at {}\n", self.fault_id(fault), fault.intensity);
        }
        if let Some(sweep) = &self.sweep {
            text += &format!("for each value of {}:\n", sweep.id);
        }
        let mut heads = vec![
            ("quantity", Side::Left),
            ("start", Side::Right),
            ("least", Side::Right),
            ("most", Side::Right),
            ("end", Side::Right),
            ("unit", Side::Left),
        ];
        if self.sweep.is_some() {
            heads.insert(1, ("at", Side::Right));
        }
        let mut grid = Grid::new(&heads);
        for (place, one) in self.recorded.iter().enumerate() {
            for (run, (values, _)) in runs.iter().enumerate() {
                let Summary { start, least, most, end } = Summary::of(&values[place]);
                let read = Shown::of(one.unit, least.abs().max(most.abs()));
                let cells = [start, least, most, end].map(|si| number(read.value(si), 5));
                let at = self.sweep.as_ref().map(|sweep| sweep.shown(run));
                let row = [one.label.clone()].into_iter().chain(at).chain(cells);
                grid.push(row.chain([read.symbol().to_string()]).collect());
            }
        }
        text += &grid.text();
        let sum = |of: &dyn Fn(&Statistics) -> u64| runs.iter().map(|run| of(&run.1)).sum::<u64>();
        let (steps, rejected) = (sum(&|s| s.steps), sum(&|s| s.rejected));
        let jacobians = sum(&|s| s.jacobians);
        text + &format!("{steps} steps, {rejected} rejected, {jacobians} Jacobians\n")
    }
}

impl Sweep {
    /// The value of a run, for people.
    fn shown(&self, run: usize) -> String {
        shown(self.values[run], self.unit)
    }
}

/// A recorded quantity in four numbers.
struct Summary {
    start: f64,
    least: f64,
    most: f64,
    end: f64,
}

impl Summary {
    fn of(values: &[f64]) -> Self {
        Self {
            start: values.first().copied().unwrap_or(f64::NAN),
            least: values.iter().copied().fold(f64::INFINITY, f64::min),
            most: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            end: values.last().copied().unwrap_or(f64::NAN),
        }
    }
}

/// Takes the samples and shows how far the run is.
struct Recorder {
    values: Vec<Vec<f64>>,
    bar: ProgressBar,
}

impl Sink for Recorder {
    fn sample(&mut self, index: usize, values: &[f64]) {
        self.values.sample(index, values);
        self.bar.inc(1);
    }
}

/// A bar on a terminal, nothing elsewhere.
fn progress(samples: usize, global: Global) -> ProgressBar {
    if !is_shown(global) {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{bar:40} {percent:>3} %  {eta} left");
    ProgressBar::new(samples as u64).with_style(style.expect("a valid template"))
}
