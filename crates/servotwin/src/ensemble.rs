//! Simulates variants on all cores: threads × lanes.
//!
//! Every thread fills its lanes from one counter; a free lane takes the next variant. A variant's result depends on
//! nothing else, so it has the same bits for any number of threads and any instruction set. Only the order in which
//! variants finish differs.

use crate::compiled::Compiled;
use crate::system::System;
use servotwin_model::lanes::Level;
use servotwin_model::program::{FaultAt, Program, Slot};
use servotwin_model::signal::Piecewise;
use servotwin_model::solver::{
    Change, CompiledSteps, Job, JobSource, SolverFailure, SolverSettings, Statistics, run, settle,
    settle_counted,
};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Settings for running variants of a program.
pub struct Ensemble<'p> {
    /// The program of the system.
    pub program: &'p Program,
    /// Its compiled step, for large amounts of work.
    pub compiled: Option<&'p Compiled>,
    /// The solver's settings.
    pub settings: SolverSettings,
    /// The lanes of every thread.
    pub level: Level,
    /// Number of threads, at least one.
    pub threads: usize,
    /// The recorded variables, as slots in the variable array.
    pub record: Vec<Slot>,
    /// Duration of every run, s.
    pub duration_s: f64,
    /// Time between samples, s.
    pub sample_period_s: f64,
    /// Stops the work when set; variants that have not ended are dropped.
    pub cancel: Option<&'p AtomicBool>,
}

/// A change at a moment within a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Later {
    /// Time of the change, s.
    pub time_s: f64,
    /// The faults from then on.
    pub faults: Vec<FaultAt>,
    /// Parameters that differ from the variant's: (component, parameter, value).
    pub overrides: Vec<(usize, usize, f64)>,
}

/// One variant: the system with faults and changed parameters, and its inputs.
#[derive(Clone, Default)]
pub struct Variant<'a> {
    /// The faults.
    pub faults: Vec<FaultAt>,
    /// Changes at later moments, in the order of time; each replaces the one before.
    pub later: Vec<Later>,
    /// Parameters that differ from the system's, before faults: (component,
    /// parameter, value).
    pub overrides: Vec<(usize, usize, f64)>,
    /// One signal per external input.
    pub inputs: Vec<&'a Piecewise>,
    /// First guess of the states; `None` for the declared one.
    pub guess: Option<&'a [f64]>,
    /// Duration of the run, s; `None` for the ensemble's.
    pub duration_s: Option<f64>,
}

/// Receives the samples of one variant.
pub trait Sink {
    /// Receives the recorded values at a sample.
    fn sample(&mut self, index: usize, values: &[f64]);
}

impl Sink for Vec<Vec<f64>> {
    /// One vector per recorded slot.
    fn sample(&mut self, _index: usize, values: &[f64]) {
        self.resize_with(values.len(), Vec::new);
        for (column, &value) in self.iter_mut().zip(values) {
            column.push(value);
        }
    }
}

impl Sink for Vec<f64> {
    /// All samples, one after the other.
    fn sample(&mut self, _index: usize, values: &[f64]) {
        self.extend_from_slice(values);
    }
}

/// The number of processors of the machine, used as the default number of threads.
pub fn processors() -> usize {
    std::thread::available_parallelism().map_or(1, |processors| processors.get())
}

impl<'p> Ensemble<'p> {
    /// All processors, the widest lanes, the settings of runs.
    pub fn new(program: &'p Program) -> Self {
        Self {
            program,
            compiled: None,
            settings: SolverSettings::of_runs(),
            level: Level::best(),
            threads: processors(),
            record: Vec::new(),
            duration_s: 1.0,
            sample_period_s: 0.01,
            cancel: None,
        }
    }

    /// As [`Ensemble::new`] for a system's program, which is compiled if that pays off.
    pub(crate) fn of(system: &'p System) -> Self {
        Self { compiled: Some(&system.compiled), ..Self::new(&system.program) }
    }

    /// Number of samples of every run.
    pub fn samples(&self) -> usize {
        // A period that divides the duration must not lose its last sample to rounding.
        (self.duration_s / self.sample_period_s + 1e-6) as usize + 1
    }

    /// Runs the variants `0 .. count`. `variant` and `sink` create each of them in its thread. `done` is called when
    /// one has ended, one call at a time, in no particular order.
    pub fn run<'a, S: Sink + Send>(
        &self,
        count: usize,
        variant: impl Fn(usize) -> Variant<'a> + Sync,
        sink: impl Fn(usize) -> S + Sync,
        done: impl FnMut(usize, S, Result<Statistics, SolverFailure>) + Send,
    ) {
        let next = AtomicUsize::new(0);
        let done = Mutex::new(done);
        let threads = self.threads.clamp(1, count.max(1));
        let compiled_steps = self.compiled_steps(count);
        std::thread::scope(|scope| {
            for _ in 0..threads {
                scope.spawn(|| {
                    let mut worker = Worker {
                        ensemble: self,
                        next: &next,
                        count,
                        variant: &variant,
                        sink: &sink,
                        done: &done,
                        open: Vec::new(),
                    };
                    run(
                        self.program,
                        compiled_steps,
                        self.settings,
                        &self.record,
                        self.level,
                        &mut worker,
                    );
                });
            }
        });
    }

    /// Compiles in advance if this many variants justify it, and waits for the compilers unless [`Ensemble::cancel`] is
    /// set. Use it before a run with another cancel flag.
    pub(crate) fn prepare(&self, count: usize) {
        if let Some(compiled) = self.compiled {
            let (method, simulated_s) = (self.settings.method, count as f64 * self.duration_s);
            compiled.prepare(self.program, method, self.level, simulated_s, self.cancel);
        }
    }

    /// The compiled step, if this many variants justify it.
    fn compiled_steps(&self, count: usize) -> Option<&'p CompiledSteps> {
        let (method, simulated_s) = (self.settings.method, count as f64 * self.duration_s);
        self.compiled?.when_worth(self.program, method, self.level, simulated_s, self.cancel)
    }

    /// Runs one variant to its end and returns its samples, one vector per recorded slot. It ignores `cancel`.
    ///
    /// # Errors
    /// The solver could not continue.
    pub fn run_one(&self, variant: &Variant) -> Result<(Vec<Vec<f64>>, Statistics), SolverFailure> {
        let mut result = None;
        Ensemble { cancel: None, record: self.record.clone(), ..*self }.run(
            1,
            |_| variant.clone(),
            |_| vec![Vec::new(); self.record.len()],
            |_, samples, outcome| result = Some(outcome.map(|statistics| (samples, statistics))),
        );
        result.expect("one variant ends once")
    }

    /// The steady state of a variant at its initial inputs, with the solver's statistics, which show whether it was
    /// found.
    ///
    /// # Errors
    /// The search met numbers that are not finite.
    pub fn settle(&self, variant: &Variant) -> Result<(Vec<f64>, Statistics), SolverFailure> {
        settle_counted(self.program, self.job(0, variant))
    }

    fn job<'a>(&self, number: usize, variant: &Variant<'a>) -> Job<'a> {
        let parameters = self.program.parameters_with(&variant.overrides, &variant.faults);
        let start = match variant.guess {
            Some(guess) => guess.to_vec(),
            None => self.program.first_guess(&parameters),
        };
        let constants = self.program.block_constants(&parameters);
        let stand_ins = self.program.stand_in_values(&parameters);
        let explicit = self.settings.method.tableau().is_none();
        let mut job = Job {
            number,
            constants,
            stand_ins,
            inputs: variant.inputs.clone(),
            start,
            settle: true,
            duration_s: variant.duration_s.unwrap_or(self.duration_s),
            sample_period_s: self.sample_period_s,
            changes: variant.later.iter().map(|later| self.change(variant, later)).collect(),
        };
        if explicit {
            // The search for a steady state needs an implicit method.
            let rest = settle(self.program, job.clone());
            job.settle = false;
            job.start = rest.unwrap_or(job.start);
        }
        job
    }

    fn change(&self, variant: &Variant, later: &Later) -> Change {
        let overrides = [variant.overrides.as_slice(), &later.overrides].concat();
        let parameters = self.program.parameters_with(&overrides, &later.faults);
        Change {
            time_s: later.time_s,
            constants: self.program.block_constants(&parameters),
            stand_ins: self.program.stand_in_values(&parameters),
        }
    }
}

struct Worker<'w, 'p, V, K, S, D> {
    ensemble: &'w Ensemble<'p>,
    next: &'w AtomicUsize,
    count: usize,
    variant: &'w V,
    sink: &'w K,
    done: &'w Mutex<D>,
    /// Variants currently in a lane.
    open: Vec<(usize, S)>,
}

impl<'a, V, K, S, D> JobSource<'a> for Worker<'_, '_, V, K, S, D>
where
    V: Fn(usize) -> Variant<'a>,
    K: Fn(usize) -> S,
    S: Sink,
    D: FnMut(usize, S, Result<Statistics, SolverFailure>),
{
    fn next(&mut self) -> Option<Job<'a>> {
        if self.cancelled() {
            return None;
        }
        let job = self.next.fetch_add(1, Ordering::Relaxed);
        if job >= self.count {
            return None;
        }
        self.open.push((job, (self.sink)(job)));
        Some(self.ensemble.job(job, &(self.variant)(job)))
    }

    fn sample(&mut self, job: usize, index: usize, values: &[f64]) {
        let (_, sink) = self.open.iter_mut().find(|(open, _)| *open == job).expect("an open job");
        sink.sample(index, values);
    }

    fn finish(&mut self, job: usize, outcome: Result<Statistics, SolverFailure>) {
        let place = self.open.iter().position(|(open, _)| *open == job).expect("an open job");
        let (_, sink) = self.open.swap_remove(place);
        let mut done = self.done.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        done(job, sink, outcome);
    }

    fn cancelled(&self) -> bool {
        self.ensemble.cancel.is_some_and(|c| c.load(Ordering::Relaxed))
    }
}
