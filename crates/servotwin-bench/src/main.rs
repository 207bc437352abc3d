//! The solver beside CVODE and diffsol, in one run on one machine.
//!
//! `cargo bench -p servotwin-bench -- [STRIDE] [DURATION_S] [PEER_STRIDE] [PEER_DURATION_S]`
//! (defaults 1, 90, 3, 15): every `STRIDE`-th of the study's 820 faults under
//! its second command at full load; the peers take every `PEER_STRIDE`-th, one
//! after the other on one processor. Errors are the largest of any state over
//! its scale at any sample (100 Hz), against the reference setting. A peer's
//! tolerance is the loosest of a few that gives no larger error than ours on the
//! same variants; variants on which ours is over 1e-2 are named and left out.
//! Seconds are of the processor, so that other work on the machine disturbs
//! little; without those of compilers, which make our equations and CVODE's. Needs `cc` and `libsundials-dev`.

mod cvode;
mod diffsol_bdf;

use servotwin::compiled::Compiled;
use servotwin::ensemble::{Ensemble, Sink, Variant};
use servotwin::study::{FaultCase, Study};
use servotwin_model::lanes::Level;
use servotwin_model::program::{FaultAt, Program, Slot};
use servotwin_model::signal::Piecewise;
use servotwin_model::solver::{SolverSettings, Statistics};
use std::time::Instant;

/// Everything that all solvers are given.
pub(crate) struct Task<'a> {
    /// The aileron.
    pub(crate) program: &'a Program,
    /// Its step in machine code, as runs have it.
    pub(crate) compiled: &'a Compiled,
    /// One per external input; only the command moves.
    pub(crate) inputs: Vec<&'a Piecewise>,
    /// The command's place among them.
    pub(crate) moving: usize,
    /// One fault per variant.
    pub(crate) faults: Vec<FaultAt>,
    /// The states at time zero of each variant.
    pub(crate) starts: Vec<Vec<f64>>,
    /// Length of each run, s.
    pub(crate) duration_s: f64,
    /// Time between samples, s.
    pub(crate) period_s: f64,
}

impl Task<'_> {
    /// Number of samples of each run.
    pub(crate) fn samples(&self) -> usize {
        (self.duration_s / self.period_s).round() as usize + 1
    }

    /// Largest error over scale of each variant.
    fn errors(&self, runs: &[Run], reference: &[Run]) -> Vec<f64> {
        let states = self.program.states();
        let complete = self.samples() * states.len();
        let largest = |(run, exact): (&Run, &Run)| {
            // What is missing is wrong, and so is what is no number.
            if run.len() < complete || exact.len() < complete || run.iter().any(|x| x.is_nan()) {
                return f64::INFINITY;
            }
            let pairs = run.iter().zip(exact).zip(states.iter().cycle());
            pairs.fold(0.0, |worst: f64, ((a, b), s)| worst.max((a - b).abs() / s.scale))
        };
        runs.iter().zip(reference).map(largest).collect()
    }
}

/// The samples of one variant, all states one after the other.
pub(crate) type Run = Vec<f64>;

/// What a solver needed.
pub(crate) struct Work {
    /// The samples of every variant.
    pub(crate) runs: Vec<Run>,
    /// Seconds of the processor for all variants.
    pub(crate) seconds: f64,
    /// Steps of all variants.
    pub(crate) steps: f64,
}

/// Seconds of the processor that this process has used.
pub(crate) fn processor_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").expect("Linux");
    let after_name = text.rsplit(')').next().unwrap_or_default();
    let fields: Vec<f64> =
        after_name.split_whitespace().map(|field| field.parse().unwrap_or(0.0)).collect();
    (fields[11] + fields[12]) / 100.0
}

/// Samples one after the other.
struct Flat(Run);

impl Sink for Flat {
    fn sample(&mut self, _index: usize, values: &[f64]) {
        self.0.extend_from_slice(values);
    }
}

fn ours(task: &Task, settings: SolverSettings) -> (Work, Statistics) {
    let mut ensemble = Ensemble::new(task.program);
    ensemble.compiled = Some(task.compiled);
    ensemble.settings = settings;
    ensemble.duration_s = task.duration_s;
    ensemble.sample_period_s = task.period_s;
    ensemble.record = (0..task.program.states().len() as Slot).collect();
    let mut runs = vec![Run::new(); task.faults.len()];
    let mut total = Statistics::default();
    let states = task.program.states().len();
    let begin = processor_seconds();
    let variant = |job: usize| Variant {
        faults: vec![task.faults[job]],
        inputs: task.inputs.clone(),
        guess: Some(&task.starts[job]),
        ..Variant::default()
    };
    ensemble.run(
        task.faults.len(),
        variant,
        |_| Flat(Run::with_capacity(task.samples() * states)),
        |job, samples, outcome| {
            match outcome {
                Ok(statistics) => total += statistics,
                Err(failure) => println!("  variant {job} failed: {failure:?}"),
            }
            runs[job] = samples.0;
        },
    );
    let seconds = processor_seconds() - begin;
    (Work { runs, seconds, steps: total.steps as f64 }, total)
}

/// The argument in a place; cargo adds `--bench` of its own.
fn argument(place: usize, default: f64) -> f64 {
    let mut given = std::env::args().skip(1).filter(|text| text != "--bench");
    given.nth(place).map_or(default, |text| text.parse().expect("a number"))
}

fn largest(errors: &[f64]) -> f64 {
    errors.iter().copied().fold(0.0, f64::max)
}

/// What all tasks share.
struct Setup<'a> {
    study: &'a Study,
    compiled: &'a Compiled,
    inputs: Vec<&'a Piecewise>,
    moving: usize,
}

impl<'a> Setup<'a> {
    fn task(&self, faults: &[&FaultCase], duration_s: f64) -> Task<'a> {
        let program = &self.study.system.program;
        let ensemble = Ensemble::new(program);
        let settled = |fault: &&FaultCase| {
            let inputs = self.inputs.clone();
            let variant = Variant { faults: vec![fault.at], inputs, ..Variant::default() };
            ensemble.settle(&variant).expect("a start").0
        };
        Task {
            program,
            compiled: self.compiled,
            inputs: self.inputs.clone(),
            moving: self.moving,
            faults: faults.iter().map(|fault| fault.at).collect(),
            starts: faults.iter().map(settled).collect(),
            duration_s,
            period_s: 0.01,
        }
    }
}

/// Variants whose samples are in memory at once, where all are measured.
const AT_ONCE: usize = 41;

/// Ours on the variants of a task, against the reference.
struct Judged {
    exact: Vec<Run>,
    errors: Vec<f64>,
    seconds: f64,
    statistics: Statistics,
}

fn judge(task: &Task) -> Judged {
    let (exact, _) = ours(task, SolverSettings::reference());
    let (work, statistics) = ours(task, SolverSettings::of_runs());
    let errors = task.errors(&work.runs, &exact.runs);
    Judged { exact: exact.runs, errors, seconds: work.seconds, statistics }
}

/// Ours on many variants: seconds, errors, statistics.
fn measure(setup: &Setup, faults: &[&FaultCase], duration_s: f64) -> (f64, Vec<f64>, Statistics) {
    let (mut seconds, mut errors, mut total) = (0.0, Vec::new(), Statistics::default());
    for some in faults.chunks(AT_ONCE) {
        let judged = judge(&setup.task(some, duration_s));
        seconds += judged.seconds;
        errors.extend(judged.errors);
        total += judged.statistics;
    }
    (seconds, errors, total)
}

/// The largest error over scale with which variants are compared.
const COMPARABLE: f64 = 1e-2;

/// The task for all solvers, its reference, and our largest error. Without the
/// variants whose paths part (the ringing valve): no tolerance makes two solvers
/// agree on them, so any would do.
fn comparable<'a>(
    setup: &Setup<'a>,
    faults: &[&FaultCase],
    duration_s: f64,
) -> (Task<'a>, Vec<Run>, f64) {
    let mut task = setup.task(faults, duration_s);
    let Judged { mut exact, mut errors, .. } = judge(&task);
    for (fault, error) in faults.iter().zip(&errors).filter(|(_, error)| **error > COMPARABLE) {
        println!("not compared: {} {}, error {error:.1e}", fault.id, fault.at.intensity);
    }
    let keep: Vec<bool> = errors.iter().map(|&error| error <= COMPARABLE).collect();
    retain(&mut task.faults, &keep);
    retain(&mut task.starts, &keep);
    retain(&mut exact, &keep);
    retain(&mut errors, &keep);
    (task, exact, largest(&errors))
}

fn retain<T>(list: &mut Vec<T>, keep: &[bool]) {
    let mut keep = keep.iter();
    list.retain(|_| *keep.next().expect("one for each"));
}

/// A peer at the loosest tolerance that is as exact as ours. Ours runs before and
/// after each of its runs: a machine that others share changes its speed within
/// minutes, and with it whatever was measured at another time.
fn peer(
    name: &str,
    task: &Task,
    reference: &[Run],
    wanted: f64,
    solve: impl Fn(&Task, f64) -> Work,
) {
    let our_seconds = || ours(task, SolverSettings::of_runs()).0.seconds;
    let mut before = our_seconds();
    for tolerance in [1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 3e-7, 1e-7, 5e-8, 2e-8, 1e-8] {
        let work = solve(task, tolerance);
        let after = our_seconds();
        let error = largest(&task.errors(&work.runs, reference));
        let steps = work.steps / task.faults.len() as f64 / task.duration_s;
        println!(
            "  {name} {tolerance:.0e}: largest error {error:.1e}, {steps:.0} steps/s, {:.2} s, \
             ours {before:.2} s before and {after:.2} s after, {}",
            work.seconds,
            ratio(work.seconds, (before + after) / 2.0)
        );
        before = after;
        if error <= wanted {
            return;
        }
    }
    println!("  {name}: no tolerance was as exact");
}

/// How many times ours, if ours differs from nothing.
fn ratio(seconds: f64, our_seconds: f64) -> String {
    if our_seconds < 0.1 {
        return "too short to compare".into();
    }
    format!("{:.1} x ours", seconds / our_seconds)
}

fn report(
    faults: &[&FaultCase],
    duration_s: f64,
    (seconds, errors, total): (f64, Vec<f64>, Statistics),
) {
    let count = faults.len() as f64;
    println!("runs {:?}", SolverSettings::of_runs());
    println!("  {seconds:.2} s, {:.2} ms per simulated second", 1e3 * seconds / count / duration_s);
    println!("  {total:?}");
    let mut order: Vec<usize> = (0..errors.len()).collect();
    order.sort_by(|&a, &b| errors[b].total_cmp(&errors[a]));
    let over = errors.iter().filter(|&&e| e > 1e-4).count();
    println!(
        "  largest error over scale {:.1e}, median {:.1e}; over 1e-4 in {over} of {}",
        errors[order[0]],
        errors[order[order.len() / 2]],
        errors.len()
    );
    for &place in order.iter().take(over.clamp(3, 60)) {
        println!("  {:.1e} {} {}", errors[place], faults[place].id, faults[place].at.intensity);
    }
}

fn main() {
    let (stride, duration_s) = (argument(0, 1.0) as usize, argument(1, 90.0));
    let (peer_stride, peer_duration_s) = (argument(2, 3.0) as usize, argument(3, 15.0));
    let study = Study::default();
    let case = study.cases.iter().find(|case| case.name == "S2/100").expect("a case of the study");
    let inputs = study.system.network().inputs.iter();
    let moving = inputs.clone().position(|input| input.id == "command").expect("a command");
    let compiled = Compiled::at_once();
    let begin = Instant::now();
    let steps = match compiled.steps(&study.system.program, Level::best()) {
        Some(_) => format!("steps compiled in {:.1} s", begin.elapsed().as_secs_f64()),
        None => "steps walk lists (no C compiler)".into(),
    };
    let inputs = case.inputs.iter().collect();
    let setup = Setup { study: &study, compiled: &compiled, inputs, moving };
    let every = |stride: usize| study.faults.iter().step_by(stride).collect::<Vec<_>>();
    let (many, few) = (every(stride), every(peer_stride));
    println!(
        "{} of {} faults, {duration_s} s of white noise each, {} states, lanes {}, {steps}",
        many.len(),
        study.faults.len(),
        study.system.program.states().len(),
        Level::best().name(),
    );
    report(&many, duration_s, measure(&setup, &many, duration_s));
    let (task, exact, wanted) = comparable(&setup, &few, peer_duration_s);
    println!(
        "peers on {} variants of {peer_duration_s} s, where our largest error is {wanted:.1e}",
        task.faults.len(),
    );
    let equations = cvode::Equations::compile(&study.system.program);
    let solve = |task: &Task, tolerance| equations.solve(task, tolerance);
    peer("CVODE BDF", &task, &exact, wanted, solve);
    peer("diffsol BDF", &task, &exact, wanted, diffsol_bdf::solve);
}
