//! Speeds up the solver's steps with the machine's C compiler.
//!
//! With a compiler and enough work, or a live stream to watch, the system's equations and their Jacobian become machine
//! code ([`servotwin_model::c_source`]). This takes some seconds. Without a compiler the solver walks its lists, which
//! takes half as long again. The bits are the same: a trial run compares both, and compiled code with other bits is
//! rejected.
//!
//! The compiler is `$SERVOTWIN_CC`, or else `$CC`, or else `cc`; an empty `$SERVOTWIN_CC` means none. Arguments may
//! follow behind blanks. If nothing can be compiled, [`report_problems`] passes the reason on once.
//!
//! Later runs find compiled steps in the [`cache`]. [`set_policy`] compiles always or never.

pub mod cache;

use crate::leftovers::TemporaryFolder;
use libloading::Library;
use servotwin_model::c_source;
use servotwin_model::lanes::{self, Level};
use servotwin_model::program::{Program, Slot};
use servotwin_model::signal::Piecewise;
use servotwin_model::solver::{
    CompiledStep, CompiledSteps, Job, JobSource, Method, SolverFailure, SolverSettings, Statistics,
    run,
};
use std::env;
use std::error::Error;
use std::fs;
use std::io;
use std::iter;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// Simulated time, s, above which compiling saves more time than it costs.
const WORTH_S: u64 = 60_000;

/// Time limit of a compiler; beyond it the compiler counts as hanging.
const LONGEST: Duration = Duration::from_secs(120);

/// The compiled step of one system.
#[derive(Default)]
pub struct Compiled {
    /// The loaded step for each level, in the order of [`lanes::ALL`].
    loaded: [OnceLock<Option<Loaded>>; lanes::ALL.len()],
    /// Simulated time requested so far, s.
    asked_s: AtomicU64,
    /// Whether compilers should end because their results are no longer needed.
    given_up: AtomicBool,
}

struct Loaded {
    steps: CompiledSteps,
    /// The libraries that hold the functions.
    _libraries: Vec<Library>,
}

impl Compiled {
    /// Compiles at the first request, for users who cannot wait until it pays off.
    pub fn at_once() -> Self {
        Self { asked_s: AtomicU64::new(WORTH_S), ..Self::default() }
    }

    /// As [`Compiled::steps`], if the further simulated seconds make it worthwhile. If the work is cancelled while a
    /// compiler runs, there are no functions from then on.
    pub(crate) fn when_worth(
        &self,
        program: &Program,
        method: Method,
        level: Level,
        simulated_s: f64,
        cancel: Option<&AtomicBool>,
    ) -> Option<&CompiledSteps> {
        let is_worth = self.is_worth(method, simulated_s);
        self.asked_s.fetch_add(simulated_s.ceil() as u64, Ordering::Relaxed);
        if is_worth { self.steps_unless(program, level, cancel) } else { None }
    }

    /// Compiles now what [`Compiled::when_worth`] would compile for this much simulated time.
    pub(crate) fn prepare(
        &self,
        program: &Program,
        method: Method,
        level: Level,
        simulated_s: f64,
        cancel: Option<&AtomicBool>,
    ) {
        if self.is_worth(method, simulated_s) {
            self.steps_unless(program, level, cancel);
        }
    }

    fn is_worth(&self, method: Method, simulated_s: f64) -> bool {
        let asked_s =
            self.asked_s.load(Ordering::Relaxed).saturating_add(simulated_s.ceil() as u64);
        let is_worth = asked_s >= WORTH_S || policy() == Policy::Only;
        method == SolverSettings::of_runs().method && is_worth
    }

    /// The functions if an earlier call has found them; never compiles.
    pub(crate) fn ready(&self, level: Level) -> Option<&CompiledSteps> {
        self.of(level).get()?.as_ref().map(|loaded| &loaded.steps)
    }

    /// Compiles the step of one lane beside some work. At the end of the work running compilers end, and none starts
    /// any more.
    pub fn beside<T>(&self, program: &Program, work: impl FnOnce() -> T) -> T {
        thread::scope(|scope| {
            scope.spawn(|| self.steps(program, Level::Single));
            let done = work();
            self.given_up.store(true, Ordering::Relaxed);
            done
        })
    }

    fn of(&self, level: Level) -> &OnceLock<Option<Loaded>> {
        let place = lanes::ALL.iter().position(|known| *known == level);
        &self.loaded[place.expect("a level")]
    }

    /// The functions for a program and a level, with the method of runs. The program must always be the same.
    /// `None` without a compiler.
    pub fn steps(&self, program: &Program, level: Level) -> Option<&CompiledSteps> {
        self.steps_unless(program, level, None)
    }

    fn steps_unless(
        &self,
        program: &Program,
        level: Level,
        cancel: Option<&AtomicBool>,
    ) -> Option<&CompiledSteps> {
        let given_up = &self.given_up;
        let patience = Patience { until: Instant::now() + LONGEST, given_up, cancel };
        let load = || match Loaded::new(program, level, &compiler()?, &patience) {
            Ok(loaded) => Some(loaded),
            Err(problem) => {
                report(&problem?);
                None
            }
        };
        let loaded = self.of(level).get_or_init(load);
        loaded.as_ref().map(|loaded| &loaded.steps)
    }
}

/// When steps are compiled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Policy {
    /// When compiling saves more time than it takes.
    Auto,
    /// Never.
    Never,
    /// Always; a run in which it fails should end.
    Only,
}

static POLICY: OnceLock<Policy> = OnceLock::new();

/// Sets when this process compiles steps, before it simulates anything. Only the first call counts.
pub fn set_policy(policy: Policy) {
    let _ = POLICY.set(policy);
}

fn policy() -> Policy {
    POLICY.get().copied().unwrap_or(Policy::Auto)
}

static REPORT: OnceLock<fn(&CompileProblem)> = OnceLock::new();
static REPORTED: AtomicBool = AtomicBool::new(false);

/// Passes the first problem of this process to a function, from the thread that meets it. Only the first call counts.
pub fn report_problems(report: fn(&CompileProblem)) {
    let _ = REPORT.set(report);
}

fn report(problem: &CompileProblem) {
    if let Some(report) = REPORT.get()
        && !REPORTED.swap(true, Ordering::Relaxed)
    {
        report(problem);
    }
}

/// The compiler, if one is wanted: a program and its first arguments.
fn compiler() -> Option<String> {
    if policy() == Policy::Never {
        return None;
    }
    // An empty CC does not ask for slow steps; an empty SERVOTWIN_CC does.
    let general = || env::var("CC").ok().filter(|named| !named.trim().is_empty());
    let named = env::var("SERVOTWIN_CC").ok().or_else(general);
    Some(named.unwrap_or_else(|| "cc".into())).filter(|named| !named.trim().is_empty())
}

/// Why steps are not compiled, and how to change that.
#[derive(Clone, Debug, thiserror::Error)]
#[error(
    "the solver runs uncompiled, which takes half as long again: {cause}; {remedy}, or set SERVOTWIN_CC to an empty \
     text to accept this"
)]
pub struct CompileProblem {
    cause: String,
    remedy: &'static str,
    /// Whether the compiler ended with an error, so that other flags may help.
    is_failure: bool,
}

impl CompileProblem {
    /// A problem of the compiler; its whole command shows a wrong path with spaces.
    fn of_compiler(compiler: &str, cause: &str) -> Self {
        let cause = format!("the C compiler '{}' {cause}", compiler.trim());
        Self { cause, remedy: "set SERVOTWIN_CC to a C compiler", is_failure: false }
    }

    /// A problem of the folder for temporary files.
    fn of_folder(cause: impl FnOnce(&str) -> String) -> Self {
        let remedy =
            "set TMPDIR to a folder on a file system that is writable and not mounted noexec";
        let cause = cause(&env::temp_dir().display().to_string());
        Self { cause, remedy, is_failure: false }
    }
}

/// Flags that some compilers do not know. Without them loads come long before their use and spill to memory again.
const SCHEDULING: &[&str] = &["-fschedule-insns", "-fsched-pressure"];

impl Loaded {
    /// `Err(None)` if the work was given up, or if the program cannot be written as C.
    fn new(
        program: &Program,
        level: Level,
        compiler: &str,
        patience: &Patience,
    ) -> Result<Self, Option<CompileProblem>> {
        let text = c_source::write_step(program, SolverSettings::of_runs().method).ok_or(None)?;
        let levels: Vec<Level> = iter::successors(Some(level), |level| level.narrower()).collect();
        let entry = cache::CacheEntry::new(&text, compiler);
        let cached = || {
            let entry = entry.as_ref()?;
            let libraries = levels.iter().map(|level| load(&entry.find(*level)?).ok());
            Self::checked(program, &levels, libraries.collect::<Option<_>>()?)
        };
        if let Some(loaded) = cached() {
            return Ok(loaded);
        }
        let folder = Folder::new()?;
        let source = folder.source();
        fs::write(&source, text).map_err(|cause| folder_problem(&cause))?;
        let with = |flags| libraries(compiler, flags, &levels, (&source, &folder), patience);
        let libraries = with(SCHEDULING).or_else(|problem| match problem {
            Some(CompileProblem { is_failure: true, .. }) => with(&[]),
            other => Err(other),
        })?;
        let other_numbers = || CompileProblem::of_compiler(compiler, "gives other numbers");
        let loaded = Self::checked(program, &levels, libraries).ok_or_else(other_numbers)?;
        if let Some(entry) = &entry {
            levels.iter().for_each(|level| entry.keep(*level, &folder.library(*level)));
        }
        Ok(loaded)
    }

    /// Accepts the functions of the libraries if they belong to the program and give the bits of the lists.
    fn checked(program: &Program, levels: &[Level], libraries: Vec<Library>) -> Option<Self> {
        let method = SolverSettings::of_runs().method;
        let functions = levels.iter().zip(&libraries).map(|(level, library)| {
            // SAFETY: the functions of our own text, compiled for lanes of this level, which is available; the library
            // stays loaded as long as they exist.
            unsafe {
                CompiledStep::find(method, level.width(), |name| {
                    let symbol = library.get::<*const ()>(name.as_bytes()).ok()?;
                    symbol.try_as_raw_ptr().map(|address| address.cast_const().cast())
                })
            }
        });
        // SAFETY: compiled for this method.
        let steps =
            unsafe { CompiledSteps::new(program, method, functions.collect::<Option<_>>()?) }?;
        let moments = |steps| first_moments(program, levels[0], steps);
        let is_good = moments(Some(&steps)) == moments(None);
        is_good.then_some(Self { steps, _libraries: libraries })
    }
}

fn load(path: &Path) -> Result<Library, libloading::Error> {
    // SAFETY: a library of straight-line code, which does nothing when loaded.
    unsafe { Library::new(path) }
}

/// Compiles the text for the lanes of all levels in parallel, and loads the libraries.
fn libraries(
    compiler: &str,
    flags: &[&str],
    levels: &[Level],
    (source, folder): (&Path, &Folder),
    patience: &Patience,
) -> Result<Vec<Library>, Option<CompileProblem>> {
    if patience.is_over() {
        return Err(patience.problem(compiler));
    }
    let start = |level: &Level| compile(compiler, flags, *level, source, folder);
    let started: Vec<io::Result<Child>> = levels.iter().map(start).collect();
    // Wait for all, so that none keeps running when one has failed.
    let ended: Vec<Result<(), Option<CompileProblem>>> = (started.into_iter().zip(levels))
        .map(|(started, level)| match started {
            Ok(child) => ended(child, compiler, &folder.messages(*level), patience),
            Err(cause) => {
                let cause = format!("does not start: {cause}");
                Err(Some(CompileProblem::of_compiler(compiler, &cause)))
            }
        })
        .collect();
    ended.into_iter().collect::<Result<Vec<()>, _>>()?;
    let load = |level: &Level| {
        load(&folder.library(*level)).map_err(|error| {
            let cause = error.source().map_or_else(|| error.to_string(), ToString::to_string);
            Some(load_problem(&cause))
        })
    };
    levels.iter().map(load).collect()
}

fn load_problem(cause: &str) -> CompileProblem {
    // The temporary file no longer exists.
    let cause = cause.rsplit_once(".so: ").map_or(cause, |(_, behind)| behind).replace('\n', " ");
    CompileProblem::of_folder(|folder| {
        format!("compiled code in {folder} cannot be loaded: {cause}")
    })
}

fn folder_problem(cause: &io::Error) -> CompileProblem {
    // The path with a random name does not help users.
    let cause = cause.to_string();
    let cause = cause.split(" at path ").next().unwrap_or_default();
    CompileProblem::of_folder(|folder| {
        format!("no temporary file can be written in {folder}: {cause}")
    })
}

/// Starts the compiler for the lanes of a level.
fn compile(
    compiler: &str,
    flags: &[&str],
    level: Level,
    source: &Path,
    folder: &Folder,
) -> io::Result<Child> {
    let wide: &[&str] = match level.register_width() {
        8 => &["-mavx512f", "-mavx512dq", "-mprefer-vector-width=512"],
        4 => &["-mavx2"],
        // Avoids branches for selections.
        _ if Level::Avx2.available() => &["-mavx2"],
        _ => &[],
    };
    let mut words = compiler.split_whitespace();
    let mut command = Command::new(words.next().unwrap_or_default());
    let messages = fs::File::create(folder.messages(level))?;
    // Ctrl-C must reach only this process, which then continues with the lists or ends in order.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    command
        .args(words)
        .args(["-std=gnu99", "-O2", "-fno-fast-math", "-ffp-contract=off", "-fno-math-errno"])
        .args(["-shared", "-fPIC"])
        .args(flags)
        .args(wide)
        .arg(format!("-DWIDTH={}", level.register_width()))
        .arg(format!("-DSTRIDE={}", level.width()))
        .arg("-o")
        .arg(folder.library(level))
        .arg(source)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(messages)
        .spawn()
}

/// Time limit and cancellation of compilers.
struct Patience<'p> {
    until: Instant,
    given_up: &'p AtomicBool,
    cancel: Option<&'p AtomicBool>,
}

impl Patience<'_> {
    fn is_over(&self) -> bool {
        let is_set = |flag: &AtomicBool| flag.load(Ordering::Relaxed);
        is_set(self.given_up) || self.cancel.is_some_and(is_set) || Instant::now() >= self.until
    }

    /// The problem of a compiler that exceeds its time limit; `None` if the work was given up.
    fn problem(&self, compiler: &str) -> Option<CompileProblem> {
        let is_late = Instant::now() >= self.until;
        let cause = || format!("takes over {} s", LONGEST.as_secs());
        is_late.then(|| CompileProblem::of_compiler(compiler, &cause()))
    }
}

/// Waits for the compiler to succeed, and kills it when patience is over.
fn ended(
    mut compiling: Child,
    compiler: &str,
    messages: &Path,
    patience: &Patience,
) -> Result<(), Option<CompileProblem>> {
    let failed = |cause: String| CompileProblem {
        is_failure: true,
        ..CompileProblem::of_compiler(compiler, &format!("fails: {cause}"))
    };
    while !patience.is_over() {
        match compiling.try_wait().map_err(|cause| failed(cause.to_string()))? {
            Some(status) if status.success() => return Ok(()),
            Some(status) => {
                let told = first_error(messages).unwrap_or_else(|| status.to_string());
                return Err(Some(failed(told)));
            }
            None => thread::sleep(Duration::from_millis(5)),
        }
    }
    // A compiler consists of several processes, which share a process group.
    let group = format!("-{}", compiling.id());
    let _ = Command::new("kill").args(["-KILL", "--", &group]).stderr(Stdio::null()).status();
    let _ = compiling.kill();
    let _ = compiling.wait();
    Err(patience.problem(compiler))
}

/// The first line with an error in a compiler's messages, or else the first line.
fn first_error(messages: &Path) -> Option<String> {
    const LONGEST_LINE: usize = 200;
    let text = String::from_utf8_lossy(&fs::read(messages).ok()?).into_owned();
    let lines = || text.lines().map(str::trim).filter(|line| !line.is_empty());
    let line = lines().find(|line| line.contains("error")).or_else(|| lines().next())?;
    let line: String = line.chars().filter(|c| !c.is_control()).take(LONGEST_LINE).collect();
    Some(line)
}

/// A slow ramp from an input's default.
fn swing(default: f64) -> [f64; 4] {
    [default, 0.1 * default + 1e-3, 0.0, 0.0]
}

/// One piece for each input, made from the input's default.
fn trial_inputs(program: &Program, piece: fn(f64) -> [f64; 4]) -> Vec<Piecewise> {
    let inputs = program.network().inputs.iter();
    inputs
        .map(|input| Piecewise::new(vec![0.0], vec![piece(input.default)]).expect("one piece"))
        .collect()
}

/// A run of the healthy system from its steady state.
fn trial_job<'i>(
    program: &Program,
    number: usize,
    inputs: &'i [Piecewise],
    duration_s: f64,
) -> Job<'i> {
    let parameters = program.parameters(&[]);
    Job {
        number,
        constants: program.block_constants(&parameters),
        stand_ins: program.stand_in_values(&parameters),
        inputs: inputs.iter().collect(),
        start: program.first_guess(&parameters),
        settle: true,
        duration_s,
        sample_period_s: 0.01,
        changes: Vec::new(),
    }
}

/// Offsets of the initial states from the first guess, in units of their scale: operating point, beyond the upper end
/// stop, and below vapor pressure beyond the lower one.
const OFFSETS: [f64; 3] = [0.0, 1.5, -1.5];

/// The bits of short runs from several initial states, at the declared inputs and at zero inputs. Zero inputs close
/// valves and open a bypass.
fn first_moments(program: &Program, level: Level, steps: Option<&CompiledSteps>) -> Vec<Moment> {
    const DURATION_S: f64 = 0.05;
    let inputs = [trial_inputs(program, swing), trial_inputs(program, |_| [0.0; 4])];
    let job = |number: usize| {
        // Different durations, so that the last runs continue in fewer lanes.
        let duration_s = DURATION_S * (1 + number % 2) as f64;
        let mut job = trial_job(program, number, &inputs[number % inputs.len()], duration_s);
        let offset = OFFSETS[number % OFFSETS.len()];
        for (y, state) in job.start.iter_mut().zip(program.states()) {
            *y += offset * state.scale;
        }
        job.settle = number.is_multiple_of(OFFSETS.len());
        job
    };
    let count = level.width().max(inputs.len() * OFFSETS.len());
    let mut moments =
        Moments { waiting: (0..count).map(job).collect(), of_jobs: vec![Moment::default(); count] };
    let record: Vec<Slot> = program.observables().iter().map(|o| o.slot).collect();
    run(program, steps, SolverSettings::of_runs(), &record, level, &mut moments);
    moments.of_jobs
}

/// The result of one variant.
#[derive(Clone, Default, PartialEq)]
struct Moment {
    /// The bits of all samples.
    samples: Vec<u64>,
    outcome: Option<Result<Statistics, SolverFailure>>,
}

/// Hands out the waiting jobs and records their results.
struct Moments<'a> {
    waiting: Vec<Job<'a>>,
    of_jobs: Vec<Moment>,
}

impl<'a> JobSource<'a> for Moments<'a> {
    fn next(&mut self) -> Option<Job<'a>> {
        self.waiting.pop()
    }

    fn sample(&mut self, job: usize, _index: usize, values: &[f64]) {
        self.of_jobs[job].samples.extend(values.iter().map(|value| value.to_bits()));
    }

    fn finish(&mut self, job: usize, outcome: Result<Statistics, SolverFailure>) {
        self.of_jobs[job].outcome = Some(outcome);
    }
}

/// A private folder, removed when no longer needed; loaded code stays in memory.
struct Folder(TemporaryFolder);

impl Folder {
    fn new() -> Result<Self, CompileProblem> {
        TemporaryFolder::new().map(Self).map_err(|cause| folder_problem(&cause))
    }

    fn source(&self) -> PathBuf {
        self.0.path().join("step.c")
    }

    fn library(&self, level: Level) -> PathBuf {
        self.0.path().join(format!("{}.so", level.name()))
    }

    /// The output of the compiler.
    fn messages(&self, level: Level) -> PathBuf {
        self.0.path().join(format!("{}.txt", level.name()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::system::System;

    #[test]
    fn without_a_compiler_or_with_a_broken_one_there_is_none() {
        let program = System::default().program;
        for broken in ["/no/such/compiler", "false", "true"] {
            let given_up = AtomicBool::new(false);
            let patience =
                Patience { until: Instant::now() + LONGEST, given_up: &given_up, cancel: None };
            let problem = Loaded::new(&program, Level::Portable, broken, &patience).err().flatten();
            let told = problem.map(|problem| problem.to_string()).unwrap_or_default();
            assert!(told.contains("set SERVOTWIN_CC") && told.lines().count() == 1, "{told}");
        }
    }

    #[test]
    fn the_check_of_a_compiled_step_meets_end_stops_cavitation_and_bypass() {
        let program = System::default().program;
        let place = |name: &str| {
            let is_it = |o: &servotwin_model::program::Observable| o.name == name;
            program.observables().iter().position(is_it).expect(name)
        };
        let moments = first_moments(&program, Level::Portable, None);
        let values = |name: &str| -> Vec<f64> {
            let (place, count) = (place(name), program.observables().len());
            let samples = moments.iter().flat_map(|moment| moment.samples.chunks(count));
            samples.map(|sample| f64::from_bits(sample[place])).collect()
        };
        let reaches = |name: &str, is_met: fn(f64) -> bool| values(name).into_iter().any(is_met);
        assert!(moments.iter().all(|moment| !moment.samples.is_empty()));
        assert!(reaches("actuator_1.cylinder.position_m", |x_m| x_m > 23.5e-3), "upper end stop");
        assert!(reaches("actuator_1.cylinder.position_m", |x_m| x_m < -23.5e-3), "lower end stop");
        assert!(reaches("actuator_1.cylinder.pressure_a_pa", |p_pa| p_pa < 1e3), "vapor pressure");
    }

    #[test]
    fn a_folder_from_which_nothing_is_loaded_is_named_with_the_remedy() {
        let cause = "/tmp/x/avx2.so: failed to map segment from shared object";
        let told = load_problem(cause).to_string();
        assert!(told.contains(" cannot be loaded: failed to map segment"), "{told}");
        assert!(told.contains("set TMPDIR"), "{told}");
    }

    #[test]
    fn nobody_waits_for_one_that_hangs() {
        let program = System::default().program;
        let given_up = AtomicBool::new(false);
        for (until, is_given_up) in [(Duration::from_millis(50), false), (LONGEST, true)] {
            given_up.store(is_given_up, Ordering::Relaxed);
            let patience =
                Patience { until: Instant::now() + until, given_up: &given_up, cancel: None };
            // The shell ignores the flags that follow.
            let hanging = "sh -c cat</dev/zero>/dev/null";
            let problem = Loaded::new(&program, Level::Portable, hanging, &patience).err();
            assert_eq!(problem.map(|told| told.is_some()), Some(!is_given_up));
        }
    }

    #[test]
    fn little_work_is_not_worth_it() {
        let compiled = Compiled::default();
        let (program, method) = (System::default().program, SolverSettings::of_runs().method);
        assert!(compiled.when_worth(&program, method, Level::Portable, 1.0, None).is_none());
        assert!(compiled.loaded.iter().all(|loaded| loaded.get().is_none()));
    }
}
