//! An export, compiled and loaded.

use super::chain::SessionAnswer;
use super::samples::Sample;
use crate::compile::{Workplace, compiled, compilers};
use crate::error::ExportError;
use crate::source_file::SourceFile;
use crate::twin::ExportedReaction;
use libloading::{Library, Symbol};
use servotwin_model::program::Program;
use servotwin_model::solver::Knot;
use std::ffi::{CStr, c_char};
use std::fmt;
use std::path::Path;
use std::process::Command;

/// Flags of every build. Warnings are errors: the text must be clean in all compilers.
const FLAGS: &[&str] = &[
    "-std=c99",
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Wconversion",
    "-Wfloat-conversion",
    "-Wdouble-promotion",
    "-Werror",
    "-ffp-contract=off",
];

/// The entry points, which are not part of an export.
const PROVE: &str = include_str!("../../runtime/prove.c");

/// Those of a twin.
const PROVE_TWIN: [(&str, &str); 2] = [
    ("prove_twin.c", include_str!("../../runtime/prove_twin.c")),
    ("prove_hybrid.c", include_str!("../../runtime/prove_hybrid.c")),
];

/// A compiler with its flags.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Build {
    compiler: String,
    flags: Vec<String>,
}

impl Build {
    /// A command with flags, such as `gcc -O2`.
    pub fn new(command: &str) -> Self {
        let mut words = command.split_whitespace().map(String::from);
        Build { compiler: words.next().unwrap_or_default(), flags: words.collect() }
    }

    /// gcc and clang, as far as they are installed, at three levels of optimization each.
    pub fn available() -> Vec<Build> {
        let levels = ["-O0", "-O2", "-O3"];
        compilers()
            .flat_map(|compiler| levels.map(|level| Build::new(&format!("{compiler} {level}"))))
            .collect()
    }

    /// All flags: those of every proof first.
    fn flags(&self) -> impl Iterator<Item = &str> {
        FLAGS.iter().copied().chain(self.flags.iter().map(String::as_str))
    }

    /// The command with all flags.
    pub(crate) fn command(&self) -> String {
        [self.compiler.as_str()].into_iter().chain(self.flags()).collect::<Vec<_>>().join(" ")
    }

    /// The first line of the compiler's version.
    pub(crate) fn version(&self) -> String {
        let output = Command::new(&self.compiler).arg("--version").output();
        let text = output.map(|output| String::from_utf8_lossy(&output.stdout).into_owned());
        text.unwrap_or_default().lines().next().unwrap_or("unknown").into()
    }
}

/// The answer of a stage: `servotwin_answer`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LibraryAnswer {
    pub decided: i32,
    pub probability: f64,
}

/// `servotwin_diagnosis`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Diagnosis {
    pub actuator: i32,
    pub action: i32,
    pub detail: i32,
    pub confidence: f64,
    pub detail_confidence: f64,
}

/// Which hierarchy of which window length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct LibraryPlace {
    pub is_committee: bool,
    pub length: usize,
}

impl fmt::Display for LibraryPlace {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = if self.is_committee { "boosted trees" } else { "trees" };
        write!(out, "{kind} of window length {}", self.length + 1)
    }
}

impl LibraryPlace {
    fn numbers(self) -> (i32, i32) {
        (i32::from(self.is_committee), self.length as i32)
    }
}

/// The entry points of an export.
fn entries(files: &[SourceFile]) -> Vec<SourceFile> {
    let mut entries = vec![SourceFile { name: "prove.c", text: PROVE.into() }];
    if files.iter().any(|file| file.name == "servotwin_twin.c") {
        entries.extend(PROVE_TWIN.map(|(name, text)| SourceFile { name, text: text.into() }));
    }
    entries
}

/// A compiled export. Rows must have as many features as the diagnoser, and places must exist in it.
pub(super) struct Compiled {
    library: Library,
    has_twin: bool,
}

impl Compiled {
    /// Compiles the files, into the folder `kept` or a temporary one, and loads them.
    pub(crate) fn new(
        files: &[SourceFile],
        build: &Build,
        kept: Option<&Path>,
    ) -> Result<Self, ExportError> {
        const LIBRARY: &str = "export.so";
        let entries = entries(files);
        let sources = files.iter().chain(&entries);
        let names: Vec<_> = compiled(sources.clone()).filter(|name| *name != "main.c").collect();
        let workplace = Workplace::new(sources, kept)?;
        let run = |arguments: &[&str]| {
            let arguments = build.flags().chain(arguments.iter().copied());
            workplace.run(&build.compiler, &build.command(), arguments)
        };
        let objects: Vec<String> = names.iter().map(|name| format!("{name}.o")).collect();
        for (name, object) in names.iter().zip(&objects) {
            run(&["-fPIC", "-c", "-o", object, name])?;
        }
        let objects = objects.iter().map(String::as_str);
        let linked: Vec<&str> =
            ["-shared", "-o", LIBRARY].into_iter().chain(objects).chain(["-lm"]).collect();
        run(&linked)?;
        // SAFETY: the code runs nothing when it is loaded. On Linux the file may go once it is mapped.
        let library = unsafe { Library::new(workplace.path(LIBRARY)) }?;
        Ok(Compiled { library, has_twin: entries.len() > 1 })
    }

    /// Memory for a struct of the C text, in whole words, so that any member is aligned.
    fn memory(&self, size: &[u8]) -> Result<Vec<u64>, ExportError> {
        // SAFETY: see below.
        let size = unsafe { self.library.get::<unsafe extern "C" fn() -> u64>(size) }?;
        Ok(vec![0; unsafe { size() }.div_ceil(8) as usize])
    }

    /// Whether a session passes its start test, and a hybrid twin, if there is one.
    pub(crate) fn is_exact(&self) -> Result<bool, ExportError> {
        type Function = unsafe extern "C" fn(*mut u64) -> i32;
        // SAFETY: here and below, the types are those of the C text.
        let function = unsafe { self.library.get::<Function>(b"prove_start") }?;
        let mut memory = self.memory(b"prove_session_size")?;
        let is_exact = unsafe { function(memory.as_mut_ptr()) } == 1;
        Ok(is_exact && (!self.has_twin || self.hybrid()?.is_some()))
    }

    /// An array of so many strings.
    pub(crate) fn names(&self, list: &str, count: usize) -> Result<Vec<String>, ExportError> {
        // SAFETY: the array has as many strings as the diagnoser that was exported.
        unsafe {
            let first = *self.library.get::<*const *const c_char>(list.as_bytes())?;
            let name = |place| CStr::from_ptr(*first.add(place)).to_string_lossy().into_owned();
            Ok((0..count).map(name).collect())
        }
    }

    pub(crate) fn leaf(
        &self,
        at: LibraryPlace,
        stage: usize,
        tree: usize,
        row: &[f64],
    ) -> Result<i32, ExportError> {
        type Function = unsafe extern "C" fn(i32, i32, i32, i32, *const f64) -> i32;
        let function = unsafe { self.library.get::<Function>(b"prove_leaf") }?;
        let (is_committee, length) = at.numbers();
        Ok(unsafe { function(is_committee, length, stage as i32, tree as i32, row.as_ptr()) })
    }

    pub(crate) fn decide(
        &self,
        at: LibraryPlace,
        stage: usize,
        row: &[f64],
    ) -> Result<LibraryAnswer, ExportError> {
        type Function = unsafe extern "C" fn(i32, i32, i32, *const f64) -> LibraryAnswer;
        let function = unsafe { self.library.get::<Function>(b"prove_decide") }?;
        let (is_committee, length) = at.numbers();
        Ok(unsafe { function(is_committee, length, stage as i32, row.as_ptr()) })
    }

    /// The probabilities of a committee's stage, one for each class.
    pub(crate) fn shares(
        &self,
        length: usize,
        stage: usize,
        row: &[f64],
        shares: &mut [f64],
    ) -> Result<(), ExportError> {
        type Function = unsafe extern "C" fn(i32, i32, *const f64, *mut f64);
        let function = unsafe { self.library.get::<Function>(b"prove_shares") }?;
        unsafe { function(length as i32, stage as i32, row.as_ptr(), shares.as_mut_ptr()) };
        Ok(())
    }

    /// What a leaf of a committee's stage adds to an output.
    pub(crate) fn value(
        &self,
        length: usize,
        stage: usize,
        (leaf, output): (i32, usize),
    ) -> Result<f64, ExportError> {
        type Function = unsafe extern "C" fn(i32, i32, i32, i32) -> f64;
        let function = unsafe { self.library.get::<Function>(b"prove_value") }?;
        Ok(unsafe { function(length as i32, stage as i32, leaf, output as i32) })
    }

    /// The novelty of a row for healthy (0) or an action (1 …).
    pub(crate) fn novelty(
        &self,
        length: usize,
        known: usize,
        row: &[f64],
    ) -> Result<f64, ExportError> {
        type Function = unsafe extern "C" fn(i32, i32, *const f64) -> f64;
        let function = unsafe { self.library.get::<Function>(b"prove_novelty") }?;
        Ok(unsafe { function(length as i32, known as i32, row.as_ptr()) })
    }

    pub(crate) fn diagnose(
        &self,
        at: LibraryPlace,
        views: &[Vec<f64>],
    ) -> Result<Diagnosis, ExportError> {
        type Function = unsafe extern "C" fn(i32, i32, *const *const f64) -> Diagnosis;
        let function = unsafe { self.library.get::<Function>(b"prove_diagnose") }?;
        let (is_committee, length) = at.numbers();
        let views: Vec<*const f64> = views.iter().map(|view| view.as_ptr()).collect();
        Ok(unsafe { function(is_committee, length, views.as_ptr()) })
    }

    /// The probabilities of all hypotheses.
    pub(crate) fn probabilities(
        &self,
        length: usize,
        views: &[Vec<f64>],
        into: &mut [f64],
    ) -> Result<(), ExportError> {
        type Function = unsafe extern "C" fn(i32, *const *const f64, *mut f64);
        let function = unsafe { self.library.get::<Function>(b"prove_probabilities") }?;
        let views: Vec<*const f64> = views.iter().map(|view| view.as_ptr()).collect();
        unsafe { function(length as i32, views.as_ptr(), into.as_mut_ptr()) };
        Ok(())
    }
}

/// A session of a compiled export.
pub(super) struct RunningSession<'c> {
    memory: Vec<u64>,
    push: Symbol<
        'c,
        unsafe extern "C" fn(*mut u64, *const f64, *const f64, *const f64, *mut i64, *mut f64),
    >,
    command: Symbol<'c, unsafe extern "C" fn(*mut u64, i32, i32)>,
    row: Symbol<'c, unsafe extern "C" fn(*const u64, i32, *mut f64)>,
}

impl Compiled {
    /// A new session.
    pub(crate) fn session(&self) -> Result<RunningSession<'_>, ExportError> {
        // SAFETY: the types are those of the C text; the memory is as large as the library states.
        unsafe {
            let start: Symbol<unsafe extern "C" fn(*mut u64) -> i32> =
                self.library.get(b"prove_start")?;
            let mut memory = self.memory(b"prove_session_size")?;
            start(memory.as_mut_ptr());
            Ok(RunningSession {
                memory,
                push: self.library.get(b"prove_push")?,
                command: self.library.get(b"prove_command")?,
                row: self.library.get(b"prove_row")?,
            })
        }
    }
}

impl RunningSession<'_> {
    /// Pushes a sample; `said` gets lists as long as those of `like`.
    pub(crate) fn push(&mut self, sample: &Sample, like: &SessionAnswer, said: &mut SessionAnswer) {
        said.integers.resize(like.integers.len(), 0);
        said.numbers.resize(like.numbers.len(), 0.0);
        let (integers, numbers) = (said.integers.as_mut_ptr(), said.numbers.as_mut_ptr());
        let Sample { inputs, measured, twin } = sample;
        // SAFETY: the lists are as long as those of the diagnoser that was exported.
        unsafe {
            (self.push)(
                self.memory.as_mut_ptr(),
                inputs.as_ptr(),
                measured.as_ptr(),
                twin.as_ptr(),
                integers,
                numbers,
            )
        }
    }

    /// Passes a command of the flight control computer on.
    pub(crate) fn command(&mut self, command: i32, place: i32) {
        // SAFETY: the place exists in the diagnoser.
        unsafe { (self.command)(self.memory.as_mut_ptr(), command, place) }
    }

    /// The features of the last window outside its bands in a view.
    pub(crate) fn row(&self, view: usize, features: usize) -> Vec<f64> {
        let mut row = vec![0.0; features];
        // SAFETY: the row has this many numbers.
        unsafe { (self.row)(self.memory.as_ptr(), view as i32, row.as_mut_ptr()) };
        row
    }
}

/// An evaluation at a point.
#[derive(Clone, Copy, Debug)]
pub(super) enum PointOf {
    All,
    Gradients,
    Motion,
    /// A tick of the clock with this number.
    Tick(usize),
}

impl PointOf {
    /// Its number in `prove_twin_point`.
    fn number(self) -> i32 {
        match self {
            PointOf::All => 0,
            PointOf::Gradients => 1,
            PointOf::Motion => 2,
            PointOf::Tick(clock) => 3 + clock as i32,
        }
    }
}

/// A twin of a compiled export.
pub(super) struct RunningTwin<'c> {
    memory: Vec<u64>,
    parameters: Vec<f64>,
    pairs: Vec<f64>,
    variables_count: usize,
    parameters_of: Symbol<'c, unsafe extern "C" fn(*const f64, *mut f64)>,
    start: Symbol<'c, unsafe extern "C" fn(*mut u64, *const f64, *const f64) -> i32>,
    step: Symbol<'c, unsafe extern "C" fn(*mut u64, *const f64) -> i32>,
    is_exact: Symbol<'c, unsafe extern "C" fn(*mut u64) -> i32>,
    load: Symbol<'c, unsafe extern "C" fn(*mut u64, *const f64)>,
    variables: Symbol<'c, unsafe extern "C" fn(*const u64) -> *const f64>,
    gradients: Symbol<'c, unsafe extern "C" fn(*const u64) -> *const f64>,
    point: Symbol<'c, unsafe extern "C" fn(*mut u64, i32, *const f64, *const f64, *const f64)>,
}

impl Compiled {
    /// A twin of this program before its start.
    pub(crate) fn twin(&self, program: &Program) -> Result<RunningTwin<'_>, ExportError> {
        // SAFETY: the types are those of the C text; the memory is as large as the library states.
        unsafe {
            Ok(RunningTwin {
                memory: self.memory(b"prove_twin_size")?,
                parameters: vec![0.0; program.parameters(&[]).iter().map(Vec::len).sum()],
                pairs: vec![0.0; 2 * program.externals().len()],
                variables_count: program.slots(),
                parameters_of: self.library.get(b"prove_twin_parameters")?,
                start: self.library.get(b"prove_twin_start")?,
                step: self.library.get(b"prove_twin_step")?,
                is_exact: self.library.get(b"prove_twin_is_exact")?,
                load: self.library.get(b"prove_twin_load")?,
                variables: self.library.get(b"prove_twin_variables")?,
                gradients: self.library.get(b"prove_twin_gradients")?,
                point: self.library.get(b"prove_twin_point")?,
            })
        }
    }
}

// SAFETY of all calls: the lists are as long as those of the program that was exported.
impl RunningTwin<'_> {
    /// Whether it passes its start test.
    pub(crate) fn is_exact(&mut self) -> bool {
        unsafe { (self.is_exact)(self.memory.as_mut_ptr()) == 1 }
    }

    /// Starts with faults of these intensities; returns whether it is well, here and below.
    pub(crate) fn start(&mut self, intensities: &[f64], inputs: &[Knot]) -> bool {
        self.take(intensities, inputs);
        let (memory, parameters) = (self.memory.as_mut_ptr(), self.parameters.as_ptr());
        unsafe { (self.start)(memory, parameters, self.pairs.as_ptr()) == 1 }
    }

    /// Steps to the next sample.
    pub(crate) fn step(&mut self, inputs: &[Knot]) -> bool {
        self.take_inputs(inputs);
        unsafe { (self.step)(self.memory.as_mut_ptr(), self.pairs.as_ptr()) == 1 }
    }

    /// The same, with other faults from the next sample on.
    pub(crate) fn step_with(&mut self, intensities: &[f64], inputs: &[Knot]) -> bool {
        self.take(intensities, inputs);
        unsafe { (self.load)(self.memory.as_mut_ptr(), self.parameters.as_ptr()) };
        self.step(inputs)
    }

    /// All variables at the current sample.
    pub(crate) fn variables(&self) -> &[f64] {
        unsafe {
            let first = (self.variables)(self.memory.as_ptr());
            std::slice::from_raw_parts(first, self.variables_count)
        }
    }

    /// Evaluates at a point, with faults of these intensities.
    pub(crate) fn point(
        &mut self,
        of: PointOf,
        intensities: &[f64],
        given: &[f64],
        slopes: &[f64],
    ) {
        self.take_faults(intensities);
        let (memory, parameters) = (self.memory.as_mut_ptr(), self.parameters.as_ptr());
        unsafe { (self.point)(memory, of.number(), parameters, given.as_ptr(), slopes.as_ptr()) }
    }

    /// The gradients of the last evaluation with them, in the layout of the program.
    pub(crate) fn gradients(&self, count: usize) -> &[f64] {
        unsafe { std::slice::from_raw_parts((self.gradients)(self.memory.as_ptr()), count) }
    }

    fn take_faults(&mut self, intensities: &[f64]) {
        unsafe { (self.parameters_of)(intensities.as_ptr(), self.parameters.as_mut_ptr()) }
    }

    fn take(&mut self, intensities: &[f64], inputs: &[Knot]) {
        self.take_faults(intensities);
        self.take_inputs(inputs);
    }

    fn take_inputs(&mut self, inputs: &[Knot]) {
        for (pair, knot) in self.pairs.chunks_exact_mut(2).zip(inputs) {
            pair.copy_from_slice(&[knot.value, knot.slope_per_s]);
        }
    }
}

/// A hybrid twin of a compiled export.
pub(super) struct RunningHybrid<'c> {
    memory: Vec<u64>,
    push: Symbol<
        'c,
        unsafe extern "C" fn(*mut u64, *const f64, *const f64, *mut i64, *mut f64) -> *const f64,
    >,
    command: Symbol<'c, unsafe extern "C" fn(*mut u64, i32, i32, i32)>,
    set: Symbol<'c, unsafe extern "C" fn(*mut u64, i32, f64) -> i32>,
}

impl Compiled {
    /// A hybrid twin before its first sample; `None` if it fails its start test.
    pub(crate) fn hybrid(&self) -> Result<Option<RunningHybrid<'_>>, ExportError> {
        // SAFETY: the types are those of the C text; the memory is as large as the library states.
        unsafe {
            let start: Symbol<unsafe extern "C" fn(*mut u64) -> i32> =
                self.library.get(b"prove_hybrid_start")?;
            let mut memory = self.memory(b"prove_hybrid_size")?;
            if start(memory.as_mut_ptr()) != 1 {
                return Ok(None);
            }
            Ok(Some(RunningHybrid {
                memory,
                push: self.library.get(b"prove_hybrid_push")?,
                command: self.library.get(b"prove_hybrid_command")?,
                set: self.library.get(b"prove_hybrid_set")?,
            }))
        }
    }
}

// SAFETY of all calls: the lists are as long as those of the diagnoser that was exported; the values lie in the memory.
impl RunningHybrid<'_> {
    /// Takes a sample. Returns finding, alarm and since when, the confidence, and what the twin expects of its sensors;
    /// `None` if the twin cannot be simulated.
    pub(crate) fn push(
        &mut self,
        inputs: &[f64],
        measured: &[f64],
        sensors: usize,
    ) -> Option<([i64; 3], f64, &[f64])> {
        let (mut integers, mut confidence) = ([0; 3], 0.0);
        let memory = self.memory.as_mut_ptr();
        let into = (integers.as_mut_ptr(), &raw mut confidence);
        unsafe {
            let expected = (self.push)(memory, inputs.as_ptr(), measured.as_ptr(), into.0, into.1);
            (!expected.is_null())
                .then(|| (integers, confidence, std::slice::from_raw_parts(expected, sensors)))
        }
    }

    /// Follows a reaction, which is found by what was raised.
    pub(crate) fn follow(&mut self, known: &ExportedReaction) {
        let numbers = [Some(known.actuator), Some(known.action), known.detail];
        let numbers = numbers.map(|number| number.map_or(-1, |number| number as i32));
        let [actuator, action, detail] = numbers;
        unsafe { (self.command)(self.memory.as_mut_ptr(), actuator, action, detail) }
    }

    /// Undoes the reactions of an actuator.
    pub(crate) fn release(&mut self, actuator: usize) {
        unsafe { (self.command)(self.memory.as_mut_ptr(), actuator as i32, -1, -1) }
    }

    /// Sets a parameter of the twin, and returns whether it could be set.
    pub(crate) fn set(&mut self, parameter: i32, value: f64) -> bool {
        unsafe { (self.set)(self.memory.as_mut_ptr(), parameter, value) == 1 }
    }
}
