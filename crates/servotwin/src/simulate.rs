//! Simulation of a system by names: signals, faults and parameter values in, a table out.
//!
//! A [`Simulation`] holds what all runs share.
//! A [`VariantSpec`] holds what may differ from run to run.
//! [`Simulation::prepare`] resolves every name once and reports the first mistake; [`PreparedSimulation::run`] simulates.
//!
//! ```
//! use servotwin::simulate::Simulation;
//! use servotwin::system::System;
//!
//! let system = System::default();
//! let results = Simulation::new(&system)
//!     .input("command", "step:size=5deg,at=0.1s")
//!     .fault("actuator_1.leakage_a.leakage", 0.5)
//!     .duration_s(0.5)
//!     .run()?;
//! let table = results.table()?;
//! assert_eq!(table.row_count(), 51);
//! assert!(table.f64("p_a_1_pa")?.iter().all(|pressure_pa| *pressure_pa > 0.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::ensemble::{Ensemble, Later, Sink, Variant, processors};
use crate::nearest::UnknownName;
use crate::recording::{self, Recorded, with_suffix};
use crate::rest::Stopped;
use crate::shown::shown;
use crate::signal::{Signal, SignalError, bus};
use crate::system::System;
use crate::table::{Column, Table, TableError};
use crate::toml_text::{NumberWithUnit, Quantities};
use crate::validity::{ValidityFinding, ValidityMonitor};
use servotwin_model::lanes::Level;
use servotwin_model::program::FaultAt;
use servotwin_model::signal::{CurveError, Piecewise};
use servotwin_model::solver::{self, Control, Method, SolverSettings, Statistics};
use servotwin_model::spec::Unit;
use servotwin_view::time_series::TimeSeries;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Maximum number of recorded values; they take 1.6 GB of memory.
pub(crate) const MAX_VALUES: f64 = 2e8;
/// Maximum duration of a run, s.
const MAX_DURATION_S: f64 = 1e6;
/// Minimum and maximum time between samples, s.
const SAMPLE_PERIODS_S: (f64, f64) = (1e-6, 1e6);
/// Onset of a fault that the initial steady state has, s.
const BEFORE_THE_RUN_S: f64 = -1.0;
/// Maximum number of runs in a sweep.
pub const MAX_SWEEP_RUNS: usize = 1000;

/// A signal that drives an input.
#[derive(Clone, Debug, PartialEq)]
pub enum InputSignal {
    /// A signal as text, such as `step:size=10deg,at=0.1s`.
    Text(String),
    /// A signal that has been parsed.
    Parsed(Signal),
    /// A constant value, SI.
    Constant(f64),
    /// One value per sample, SI; a cubic runs between samples as a bus delivers them.
    Samples(Vec<f64>),
}

impl From<&str> for InputSignal {
    fn from(text: &str) -> Self {
        InputSignal::Text(text.to_owned())
    }
}

impl From<String> for InputSignal {
    fn from(text: String) -> Self {
        InputSignal::Text(text)
    }
}

impl From<Signal> for InputSignal {
    fn from(signal: Signal) -> Self {
        InputSignal::Parsed(signal)
    }
}

impl From<f64> for InputSignal {
    fn from(value: f64) -> Self {
        InputSignal::Constant(value)
    }
}

impl From<Vec<f64>> for InputSignal {
    fn from(samples: Vec<f64>) -> Self {
        InputSignal::Samples(samples)
    }
}

/// The inputs, faults and parameters of one run, by names; numbers are SI.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VariantSpec {
    /// The driven inputs, such as `command`. Other inputs keep their default.
    pub inputs: Vec<(String, InputSignal)>,
    /// Faults, such as `actuator_1.leakage_a.leakage`, with their intensity from 0 (healthy) to 1.
    pub faults: Vec<(String, f64)>,
    /// Parameters, such as `actuator_1.cylinder.area_a_m2`, that differ from the system file.
    pub parameters: Vec<(String, f64)>,
}

/// Why a simulation cannot start or did not finish.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
pub enum SimulationError {
    /// The system has no such input, fault, parameter or quantity.
    #[error(transparent)]
    UnknownName(#[from] UnknownName),
    /// An input, a fault or a parameter is given twice.
    #[error("'{name}' is given twice")]
    Repeated { name: String },
    /// A signal is invalid, or leaves the range of its input.
    #[error("{input}: {error}")]
    Signal { input: String, error: SignalError },
    /// The samples of an input do not define a curve.
    #[error("{input}: {error}")]
    Samples { input: String, error: CurveError },
    /// A number lies outside its range; both are in SI, with their `unit`.
    #[error("{name} = {} is out of range: allowed are {allowed}", NumberWithUnit(*value, unit.symbol()))]
    OutOfRange { name: String, value: f64, range: (f64, f64), unit: Unit, allowed: String },
    /// The parameters contradict each other.
    #[error("{0}")]
    Impossible(String),
    /// The method needs a fixed step.
    #[error("the method {method} has no error control and needs a fixed step")]
    NoErrorControl { method: &'static str },
    /// More than `MAX_VALUES` values would be recorded.
    #[error(
        "more than 200 million values would be recorded: record fewer quantities, or sample less often"
    )]
    TooManyValues,
    /// The solver could not finish a run.
    #[error("{}{stopped}", of_variant(*variant))]
    Stopped { variant: Option<usize>, stopped: Stopped },
    /// The caller canceled the simulation. There are no results.
    #[error("the simulation was canceled")]
    Canceled,
}

fn of_variant(variant: Option<usize>) -> String {
    variant.map_or_else(String::new, |place| format!("variant {place}: "))
}

/// Progress of a simulation; see [`PreparedSimulation::run`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SimulationProgress {
    /// One more sample of a run is done.
    Sample,
    /// One more run has ended.
    Run,
}

/// A simulation of one system: the settings of all its runs, and their common variant.
#[derive(Clone)]
pub struct Simulation<'s> {
    system: &'s System,
    variant: VariantSpec,
    record: Vec<String>,
    duration_s: f64,
    sample_period_s: f64,
    settings: SolverSettings,
    level: Level,
    threads: usize,
    noise_seed: Option<u64>,
    /// The faults that begin within the run, with their onset, s.
    onsets: Vec<(String, f64)>,
}

impl<'s> Simulation<'s> {
    /// A healthy run of 5 s with 100 samples a second, recording the driven inputs and all sensors.
    pub fn new(system: &'s System) -> Self {
        Simulation {
            system,
            variant: VariantSpec::default(),
            record: vec![],
            duration_s: 5.0,
            sample_period_s: 0.01,
            settings: SolverSettings::of_runs(),
            level: Level::best(),
            threads: processors(),
            noise_seed: None,
            onsets: vec![],
        }
    }

    /// Drives an input with a signal text, a parsed signal, a constant, or samples.
    #[must_use]
    pub fn input(mut self, id: &str, signal: impl Into<InputSignal>) -> Self {
        self.variant.inputs.push((id.to_owned(), signal.into()));
        self
    }

    /// Injects a fault with an intensity from 0 (healthy) to 1.
    #[must_use]
    pub fn fault(mut self, id: &str, intensity: f64) -> Self {
        self.variant.faults.push((id.to_owned(), intensity));
        self
    }

    /// Injects a fault that begins at a time within the run, s; also at 0 the run starts in the steady state without it.
    #[must_use]
    pub fn fault_from(mut self, id: &str, intensity: f64, at_s: f64) -> Self {
        self.onsets.push((id.to_owned(), at_s));
        self.fault(id, intensity)
    }

    /// Gives a parameter another value, SI.
    #[must_use]
    pub fn parameter(mut self, id: &str, value: f64) -> Self {
        self.variant.parameters.push((id.to_owned(), value));
        self
    }

    /// Adds the inputs, faults and parameters of a variant.
    #[must_use]
    pub fn variant(mut self, variant: VariantSpec) -> Self {
        self.variant.inputs.extend(variant.inputs);
        self.variant.faults.extend(variant.faults);
        self.variant.parameters.extend(variant.parameters);
        self
    }

    /// Sets the recorded quantities: a sensor, an input, a quantity such as `actuator_1.cylinder.position_m`, a
    /// component for all of its quantities, or `all`.
    #[must_use]
    pub fn record<N: Into<String>>(mut self, names: impl IntoIterator<Item = N>) -> Self {
        self.record = names.into_iter().map(Into::into).collect();
        self
    }

    /// Sets the duration of every run, s, up to 1e6 s.
    #[must_use]
    pub fn duration_s(mut self, duration_s: f64) -> Self {
        self.duration_s = duration_s;
        self
    }

    /// Sets the time between samples, s, from 1e-6 s to 1e6 s.
    #[must_use]
    pub fn sample_period_s(mut self, period_s: f64) -> Self {
        self.sample_period_s = period_s;
        self
    }

    /// Sets the solver's method; the default is that of runs.
    #[must_use]
    pub fn method(mut self, method: Method) -> Self {
        self.settings.method = method;
        self
    }

    /// Sets the allowed error of a step relative to the states' scales, up to 0.1.
    #[must_use]
    pub fn tolerance(mut self, tolerance: f64) -> Self {
        self.settings.control = Control::within(tolerance);
        self
    }

    /// Sets a fixed step without error control, s, up to 1 s.
    #[must_use]
    pub fn step_s(mut self, step_s: f64) -> Self {
        self.settings.control = Control::Fixed { step_s };
        self
    }

    /// Sets the instruction set; results do not depend on it.
    #[must_use]
    pub fn level(mut self, level: Level) -> Self {
        self.level = level;
        self
    }

    /// Sets the number of threads; results do not depend on it.
    #[must_use]
    pub fn threads(mut self, threads: usize) -> Self {
        self.threads = threads.max(1);
        self
    }

    /// Records sensors with their declared noise, drawn from this seed, and their converter's resolution.
    #[must_use]
    pub fn noise(mut self, seed: u64) -> Self {
        self.noise_seed = Some(seed);
        self
    }

    /// Simulates the variant.
    ///
    /// # Errors
    /// See [`SimulationError`].
    pub fn run(&self) -> Result<SimulationResults<'s>, SimulationError> {
        self.prepare(None)?.run(&|_| {}, None)
    }

    /// Simulates once for each value of a parameter (SI) or of a fault's intensity.
    ///
    /// # Errors
    /// See [`SimulationError`].
    pub fn run_sweep(
        &self,
        id: &str,
        values: &[f64],
    ) -> Result<SimulationResults<'s>, SimulationError> {
        self.prepare(Some(self.sweep(id, values)?))?.run(&|_| {}, None)
    }

    /// Prepares the values of [`Simulation::run_sweep`].
    ///
    /// # Errors
    /// The system has neither a parameter nor a fault of this name.
    pub fn sweep(&self, id: &str, values: &[f64]) -> Result<Sweep, UnknownName> {
        let (is_fault, unit) = sweep_target(self.system, id)?;
        Ok(Sweep { id: id.to_owned(), unit, is_fault, values: values.to_vec() })
    }

    /// Resolves all names and checks all numbers of a single run, or of a sweep.
    ///
    /// # Errors
    /// The first mistake.
    pub fn prepare(&self, sweep: Option<Sweep>) -> Result<PreparedSimulation<'s>, SimulationError> {
        let Some(sweep) = sweep else {
            return self.prepared(&[VariantSpec::default()], None);
        };
        let variants = sweep.values.iter().map(|&value| sweep.variant(value));
        self.prepared(&variants.collect::<Vec<_>>(), Some(sweep))
    }

    /// Resolves all names and checks all numbers of several variants.
    ///
    /// # Errors
    /// The first mistake.
    pub fn prepare_variants(
        &self,
        variants: &[VariantSpec],
    ) -> Result<PreparedSimulation<'s>, SimulationError> {
        self.prepared(variants, None)
    }

    fn prepared(
        &self,
        variants: &[VariantSpec],
        sweep: Option<Sweep>,
    ) -> Result<PreparedSimulation<'s>, SimulationError> {
        self.check_numbers()?;
        let mut resolver = Resolver { simulation: self, curves: BTreeMap::new() };
        let base = resolver.variant(&[&self.variant])?;
        let runs = variants.iter().map(|variant| resolver.variant(&[&self.variant, variant]));
        let runs = runs.collect::<Result<Vec<_>, _>>()?;
        let mut driven: Vec<usize> =
            runs.iter().flat_map(|run| run.driven.iter().copied()).collect();
        driven.sort_unstable();
        driven.dedup();
        let inputs = &self.system.network().inputs;
        let ids: Vec<&str> = driven.iter().map(|&input| inputs[input].id.as_str()).collect();
        let recorded = recording::choose(self.system, &self.record, &ids)?;
        let samples = self.duration_s / self.sample_period_s + 1.0;
        if samples * (recorded.len() * runs.len()) as f64 > MAX_VALUES {
            return Err(SimulationError::TooManyValues);
        }
        Ok(PreparedSimulation { simulation: self.clone(), base, runs, recorded, sweep })
    }

    fn check_numbers(&self) -> Result<(), SimulationError> {
        within("duration_s", self.duration_s, (1e-6, MAX_DURATION_S), Unit::Second)?;
        within("sample_period_s", self.sample_period_s, SAMPLE_PERIODS_S, Unit::Second)?;
        match self.settings.control {
            Control::Fixed { step_s } => within("step_s", step_s, (1e-9, 1.0), Unit::Second),
            Control::Adaptive { .. } if self.settings.method.tableau().is_none() => {
                Err(SimulationError::NoErrorControl { method: self.settings.method.name() })
            }
            Control::Adaptive { tolerance, .. } => {
                within("tolerance", tolerance, (1e-15, 0.1), Unit::None)
            }
        }
    }
}

fn within(name: &str, value: f64, range: (f64, f64), unit: Unit) -> Result<(), SimulationError> {
    if (range.0..=range.1).contains(&value) {
        return Ok(());
    }
    let allowed = Quantities(range.0, range.1, unit.symbol()).to_string();
    Err(SimulationError::OutOfRange { name: name.to_owned(), value, range, unit, allowed })
}

/// Whether a name is a fault's, and the unit of its values.
fn sweep_target(system: &System, id: &str) -> Result<(bool, Unit), UnknownName> {
    if let Some((component, parameter)) = system.parameter(id) {
        let spec = system.network().components[component].component;
        return Ok((false, spec.parameters[parameter].unit));
    }
    match system.program.find_fault(id) {
        Some(_) => Ok((true, Unit::None)),
        None => Err(UnknownName {
            what: "parameter or fault",
            given: id.into(),
            known: [system.all_parameters(), system.all_faults()].concat(),
        }),
    }
}

/// A parameter, or a fault's intensity, with another value in every run.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// Name of the parameter or fault.
    pub id: String,
    /// The unit of the values; intensities have none.
    pub unit: Unit,
    /// Whether the values are intensities.
    is_fault: bool,
    /// One value per run, SI.
    pub values: Vec<f64>,
}

impl Sweep {
    fn variant(&self, value: f64) -> VariantSpec {
        let pair = vec![(self.id.clone(), value)];
        match self.is_fault {
            true => VariantSpec { faults: pair, ..VariantSpec::default() },
            false => VariantSpec { parameters: pair, ..VariantSpec::default() },
        }
    }

    /// The value of a run with its display unit.
    pub fn label(&self, run: usize) -> String {
        shown(self.values[run], self.unit)
    }
}

/// Resolves names to indices. Variants with the same signal text share its curve.
struct Resolver<'r, 's> {
    simulation: &'r Simulation<'s>,
    curves: BTreeMap<(usize, String), Arc<Piecewise>>,
}

impl Resolver<'_, '_> {
    fn variant(&mut self, parts: &[&VariantSpec]) -> Result<PreparedRun, SimulationError> {
        let system = self.simulation.system;
        let mut run = PreparedRun {
            faults: vec![],
            onsets_s: vec![],
            parameters: vec![],
            curves: system.default_inputs().into_iter().map(Arc::new).collect(),
            driven: vec![],
        };
        for part in parts {
            for (id, intensity) in &part.faults {
                let onset = self.simulation.onsets.iter().find(|(known, _)| known == id);
                if let Some((_, at_s)) = onset {
                    within(id, *at_s, (0.0, self.simulation.duration_s), Unit::Second)?;
                }
                run.add_fault(system, id, *intensity)?;
                run.onsets_s.push(onset.map_or(BEFORE_THE_RUN_S, |(_, at_s)| *at_s));
            }
            for (id, value) in &part.parameters {
                run.add_parameter(system, id, *value)?;
            }
            for (id, signal) in &part.inputs {
                let input = system.find_input(id)?;
                if run.driven.contains(&input) {
                    return Err(SimulationError::Repeated { name: id.clone() });
                }
                run.curves[input] = self.curve(input, signal)?;
                run.driven.push(input);
            }
        }
        if !run.parameters.is_empty() {
            system.possible_with(&run.parameters).map_err(SimulationError::Impossible)?;
        }
        Ok(run)
    }

    fn curve(
        &mut self,
        input: usize,
        signal: &InputSignal,
    ) -> Result<Arc<Piecewise>, SimulationError> {
        let system = self.simulation.system;
        let id = || system.network().inputs[input].id.clone();
        let bad_samples = |error| SimulationError::Samples { input: id(), error };
        let bad_signal = |error| SimulationError::Signal { input: id(), error };
        let duration_s = self.simulation.duration_s;
        let build = |signal: &Signal| {
            system.driven(input, signal, duration_s).map(Arc::new).map_err(bad_signal)
        };
        let admit = |curve: Result<Piecewise, CurveError>| {
            let curve = system.admitted(input, curve.map_err(bad_samples)?, duration_s);
            curve.map(Arc::new).map_err(bad_signal)
        };
        Ok(match signal {
            InputSignal::Constant(value) => admit(Piecewise::constant(*value))?,
            InputSignal::Samples(values) => {
                admit(bus::curve(values, self.simulation.sample_period_s))?
            }
            InputSignal::Parsed(signal) => build(signal)?,
            InputSignal::Text(text) => {
                let key = (input, text.clone());
                if let Some(known) = self.curves.get(&key) {
                    return Ok(known.clone());
                }
                let signal: Signal = text.parse().map_err(bad_signal)?;
                let curve = build(&signal)?;
                self.curves.insert(key, curve.clone());
                curve
            }
        })
    }
}

/// A run with resolved names.
#[derive(Clone, Debug)]
pub struct PreparedRun {
    /// The faults with their intensities.
    pub faults: Vec<FaultAt>,
    /// Onset of each fault, s; below 0 the run starts in the steady state with the fault.
    pub onsets_s: Vec<f64>,
    /// Parameters that differ from the system's: (component, parameter, SI value).
    pub parameters: Vec<(usize, usize, f64)>,
    /// One curve per input of the system.
    pub curves: Vec<Arc<Piecewise>>,
    /// The inputs that a signal drives.
    pub(crate) driven: Vec<usize>,
}

impl PreparedRun {
    fn add_fault(
        &mut self,
        system: &System,
        id: &str,
        intensity: f64,
    ) -> Result<(), SimulationError> {
        let (component, fault) = system.find_fault(id)?;
        if self.faults.iter().any(|known| (known.component, known.fault) == (component, fault)) {
            return Err(SimulationError::Repeated { name: id.to_owned() });
        }
        within(id, intensity, (0.0, 1.0), Unit::None)?;
        self.faults.push(FaultAt { component, fault, intensity });
        Ok(())
    }

    fn add_parameter(
        &mut self,
        system: &System,
        id: &str,
        value: f64,
    ) -> Result<(), SimulationError> {
        let (component, parameter) = system.find_parameter(id)?;
        if self.parameters.iter().any(|known| (known.0, known.1) == (component, parameter)) {
            return Err(SimulationError::Repeated { name: id.to_owned() });
        }
        let instance = &system.network().components[component];
        system.allows(component, parameter, value).map_err(|allowed| {
            let unit = instance.component.parameters[parameter].unit;
            let (name, range) = (id.to_owned(), instance.range(parameter));
            SimulationError::OutOfRange { name, value, range, unit, allowed }
        })?;
        self.parameters.push((component, parameter, value));
        Ok(())
    }

    fn variant(&self) -> Variant<'_> {
        let with_onset = || self.faults.iter().copied().zip(self.onsets_s.iter().copied());
        let begun_by = |time_s: f64| -> Vec<FaultAt> {
            with_onset().filter(|(_, at_s)| *at_s <= time_s).map(|(fault, _)| fault).collect()
        };
        let mut times_s: Vec<f64> = self.onsets_s.iter().copied().filter(|t| *t >= 0.0).collect();
        times_s.sort_by(f64::total_cmp);
        times_s.dedup();
        let later = |time_s: f64| Later { time_s, faults: begun_by(time_s), ..Later::default() };
        Variant {
            faults: begun_by(BEFORE_THE_RUN_S),
            later: times_s.into_iter().map(later).collect(),
            overrides: self.parameters.clone(),
            inputs: self.curves.iter().map(Arc::as_ref).collect(),
            ..Variant::default()
        }
    }
}

/// A simulation with checked names and numbers.
pub struct PreparedSimulation<'s> {
    simulation: Simulation<'s>,
    /// The variant that all runs share.
    pub base: PreparedRun,
    /// The runs, in their order.
    pub runs: Vec<PreparedRun>,
    /// The quantities that every run records.
    pub(crate) recorded: Vec<Recorded>,
    /// The swept quantity, if there is one.
    pub(crate) sweep: Option<Sweep>,
}

impl<'s> PreparedSimulation<'s> {
    /// The solver's settings.
    pub fn settings(&self) -> SolverSettings {
        self.simulation.settings
    }

    /// Number of samples in each run.
    pub fn samples(&self) -> usize {
        self.ensemble(None).samples()
    }

    fn ensemble<'p>(&'p self, cancel: Option<&'p AtomicBool>) -> Ensemble<'p> {
        Ensemble {
            settings: self.simulation.settings,
            level: self.simulation.level,
            threads: self.simulation.threads,
            record: self.recorded.iter().map(|one| one.slot).collect(),
            duration_s: self.simulation.duration_s,
            sample_period_s: self.simulation.sample_period_s,
            cancel,
            ..Ensemble::of(self.simulation.system)
        }
    }

    /// Simulates all runs on all threads. `progress` is called from several threads. A set `cancel` ends the work.
    ///
    /// # Errors
    /// The first run that the solver could not finish, or [`SimulationError::Canceled`].
    pub fn run(
        &self,
        progress: &(dyn Fn(SimulationProgress) + Sync),
        cancel: Option<&AtomicBool>,
    ) -> Result<SimulationResults<'s>, SimulationError> {
        let mut ensemble = self.ensemble(cancel);
        let period_s = ensemble.sample_period_s;
        let monitor = |overrides: &[(usize, usize, f64)]| {
            ValidityMonitor::new(self.simulation.system, period_s, overrides)
        };
        ensemble.record.extend(monitor(&[]).slots());
        let times_s = recording::times_s(&ensemble);
        let mut results: Vec<Option<Result<RunResult, solver::SolverFailure>>> = vec![];
        results.resize_with(self.runs.len(), || None);
        ensemble.run(
            self.runs.len(),
            |run| self.runs[run].variant(),
            |run| Recorder {
                values: vec![Vec::new(); self.recorded.len()],
                monitor: monitor(&self.runs[run].parameters),
                progress,
            },
            |run, recorder, outcome| {
                let outside_validity = recorder.monitor.findings();
                let values = recorder.values;
                let result = |statistics| RunResult { values, statistics, outside_validity };
                results[run] = Some(outcome.map(result));
                progress(SimulationProgress::Run);
            },
        );
        // A canceled simulation has no results at all.
        let results: Option<Vec<_>> = results.into_iter().collect();
        let results = results.ok_or(SimulationError::Canceled)?;
        let is_single = results.len() == 1;
        let system = self.simulation.system;
        let named = |(place, result): (usize, Result<RunResult, solver::SolverFailure>)| {
            result.map_err(|failure| SimulationError::Stopped {
                variant: (!is_single).then_some(place),
                stopped: Stopped::new(system, failure),
            })
        };
        let mut runs = results.into_iter().enumerate().map(named).collect::<Result<Vec<_>, _>>()?;
        if let Some(seed) = self.simulation.noise_seed {
            for (place, run) in runs.iter_mut().enumerate() {
                recording::as_shown(system, &self.recorded, &mut run.values, seed, place);
            }
        }
        let (recorded, sweep) = (self.recorded.clone(), self.sweep.clone());
        Ok(SimulationResults { system, recorded, times_s, runs, sweep })
    }
}

/// Keeps the samples of one run and reports each.
struct Recorder<'r> {
    values: Vec<Vec<f64>>,
    monitor: ValidityMonitor,
    progress: &'r (dyn Fn(SimulationProgress) + Sync),
}

impl Sink for Recorder<'_> {
    fn sample(&mut self, index: usize, values: &[f64]) {
        let (recorded, pressures) = values.split_at(self.values.len());
        self.values.sample(index, recorded);
        self.monitor.sample(index, pressures);
        (self.progress)(SimulationProgress::Sample);
    }
}

/// The recorded values of one run.
#[derive(Clone, Debug, PartialEq)]
pub struct RunResult {
    /// One list per recorded quantity with one value per sample, SI.
    pub values: Vec<Vec<f64>>,
    /// Statistics of the solver.
    pub statistics: Statistics,
    /// The pressures and pistons that left the range of validity, recorded or not.
    pub outside_validity: Vec<ValidityFinding>,
}

impl RunResult {
    /// Whether no steady state was found because the system is in a limit cycle.
    pub fn has_limit_cycle(&self) -> bool {
        self.statistics.limit_cycles > 0
    }

    /// Whether the run began in the steady state of its initial inputs.
    pub fn starts_at_steady_state(&self) -> bool {
        self.statistics.unsettled == 0
    }
}

/// The recorded values of all runs.
pub struct SimulationResults<'s> {
    system: &'s System,
    /// The recorded quantities.
    pub recorded: Vec<Recorded>,
    /// The times of the samples, s.
    pub times_s: Vec<f64>,
    /// The runs, in their order.
    pub runs: Vec<RunResult>,
    /// The swept quantity, if there was one.
    pub sweep: Option<Sweep>,
}

impl SimulationResults<'_> {
    /// All runs, one below the other; the swept value, if any, is the first column.
    ///
    /// # Errors
    /// Two recorded quantities have the same name.
    pub fn table(&self) -> Result<Table, TableError> {
        let below = |place: usize| {
            let runs = self.runs.iter().flat_map(|run| run.values[place].iter().copied());
            runs.collect()
        };
        let values = (0..self.recorded.len()).map(below).collect();
        let times_s = self.times_s.repeat(self.runs.len());
        let table = recording::table(self.system, &self.recorded, times_s, values)?;
        let Some(sweep) = &self.sweep else { return Ok(table) };
        let samples = self.times_s.len();
        let swept = sweep.values.iter().flat_map(|&value| std::iter::repeat_n(value, samples));
        let (name, unit) = (with_suffix(&sweep.id, sweep.unit), sweep.unit.symbol());
        let first = Column::new(&name, unit, swept.collect::<Vec<f64>>());
        let columns = [first].into_iter().chain(table.columns().iter().cloned()).collect();
        let mut whole = Table::from_columns(columns)?;
        whole.metadata = table.metadata;
        Ok(whole)
    }

    /// The table of one run.
    ///
    /// # Errors
    /// Two recorded quantities have the same name.
    pub fn table_of_run(&self, run: usize) -> Result<Table, TableError> {
        let values = self.runs[run].values.clone();
        recording::table(self.system, &self.recorded, self.times_s.clone(), values)
    }

    /// A figure with one panel per unit and size of values.
    pub fn figure(&self) -> TimeSeries<'static> {
        let (mut recorded, mut values) = (vec![], vec![]);
        for (place, one) in self.recorded.iter().enumerate() {
            for (run, result) in self.runs.iter().enumerate() {
                let label = match &self.sweep {
                    Some(sweep) => format!("{} at {}", one.label, sweep.label(run)),
                    None => one.label.clone(),
                };
                recorded.push(Recorded { label, ..one.clone() });
                values.push(result.values[place].as_slice());
            }
        }
        recording::figure(&self.system.title, &recorded, &self.times_s, &values)
    }
}
