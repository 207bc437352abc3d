//! An export, compiled and loaded.

use super::chain::SessionAnswer;
use super::samples::Sample;
use crate::compile::{Workplace, compiled, compilers};
use crate::error::ExportError;
use crate::source_file::SourceFile;
use crate::twin::ExportedReaction;
use libloading::Library;
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
    pub(crate) decided: i32,
    pub(crate) probability: f64,
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
    pub(crate) is_committee: bool,
    pub(crate) length: usize,
}

impl fmt::Display for LibraryPlace {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = if self.is_committee { "boosted trees" } else { "trees" };
        write!(out, "{kind} of window length {}", self.length + 1)
    }
}

/// Declares functions of the C text by their types there. They are loaded together, and are valid as long as the library.
macro_rules! entries {
    ($(#[$note:meta])* $name:ident, $prefix:literal: $($entry:ident($($of:ty),*) $(-> $result:ty)?;)+) => {
        $(#[$note])*
        #[derive(Clone, Copy)]
        struct $name {
            $($entry: unsafe extern "C" fn($($of),*) $(-> $result)?,)+
        }

        impl $name {
            fn load(library: &Library) -> Result<Self, ExportError> {
                // SAFETY: the types are those of the C text.
                unsafe {
                    Ok($name { $($entry: *library.get(concat!($prefix, stringify!($entry)).as_bytes())?,)+ })
                }
            }
        }
    };
}

entries! {
    /// Those of `prove.c`. A place in the trees is: whether it is the committee's, the window length, the stage.
    DiagnosisEntries, "prove_":
    start(*mut u64) -> i32;
    session_size() -> u64;
    leaf(i32, i32, i32, i32, *const f64) -> i32;
    decide(i32, i32, i32, *const f64) -> LibraryAnswer;
    shares(i32, i32, *const f64, *mut f64);
    value(i32, i32, i32, i32) -> f64;
    novelty(i32, i32, *const f64) -> f64;
    diagnose(i32, i32, *const *const f64) -> Diagnosis;
    probabilities(i32, *const *const f64, *mut f64);
    push(*mut u64, *const f64, *const f64, *const f64, *mut i64, *mut f64);
    command(*mut u64, i32, i32);
    row(*const u64, i32, *mut f64);
}

entries! {
    /// Those of `prove_twin.c`.
    TwinEntries, "prove_twin_":
    size() -> u64;
    parameters(*const f64, *mut f64);
    start(*mut u64, *const f64, *const f64) -> i32;
    step(*mut u64, *const f64) -> i32;
    is_exact(*mut u64) -> i32;
    load(*mut u64, *const f64);
    variables(*const u64) -> *const f64;
    gradients(*const u64) -> *const f64;
    point(*mut u64, i32, *const f64, *const f64, *const f64);
}

entries! {
    /// Those of `prove_hybrid.c`.
    HybridEntries, "prove_hybrid_":
    size() -> u64;
    start(*mut u64) -> i32;
    push(*mut u64, *const f64, *const f64, *mut i64, *mut f64) -> *const f64;
    command(*mut u64, i32, i32, i32);
    set(*mut u64, i32, f64) -> i32;
}

/// The files of the entry points.
fn entries(files: &[SourceFile]) -> Vec<SourceFile> {
    let mut entries = vec![SourceFile { name: "prove.c", text: PROVE.into() }];
    if files.iter().any(|file| file.name == "servotwin_twin.c") {
        entries.extend(PROVE_TWIN.map(|(name, text)| SourceFile { name, text: text.into() }));
    }
    entries
}

/// A compiled export. Rows must have as many features as the diagnoser, and places must exist in it: the lists that the C
/// text reads and writes are as long as those of the diagnoser and the program that were exported.
pub(super) struct Compiled {
    library: Library,
    diagnosis: DiagnosisEntries,
    twin: Option<(TwinEntries, HybridEntries)>,
}

/// Memory for a struct of the C text, in whole words, so that any member is aligned.
fn memory(size: unsafe extern "C" fn() -> u64) -> Vec<u64> {
    // SAFETY: the function returns a constant.
    vec![0; unsafe { size() }.div_ceil(8) as usize]
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
        let twin = match entries.len() {
            1 => None,
            _ => Some((TwinEntries::load(&library)?, HybridEntries::load(&library)?)),
        };
        Ok(Compiled { diagnosis: DiagnosisEntries::load(&library)?, library, twin })
    }

    /// Whether a session passes its start test, and a hybrid twin, if there is one.
    pub(crate) fn is_exact(&self) -> bool {
        let mut session = memory(self.diagnosis.session_size);
        // SAFETY: here and below, memory and lists are as long as the library expects.
        let is_exact = unsafe { (self.diagnosis.start)(session.as_mut_ptr()) } == 1;
        is_exact && (self.twin.is_none() || self.hybrid().is_some())
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

    /// The leaf of a tree of a stage for a row.
    pub(crate) fn leaf(&self, at: LibraryPlace, stage: usize, tree: usize, row: &[f64]) -> i32 {
        let (is_committee, length) = (i32::from(at.is_committee), at.length as i32);
        let (stage, tree) = (stage as i32, tree as i32);
        unsafe { (self.diagnosis.leaf)(is_committee, length, stage, tree, row.as_ptr()) }
    }

    /// The answer of a stage.
    pub(crate) fn decide(&self, at: LibraryPlace, stage: usize, row: &[f64]) -> LibraryAnswer {
        let (is_committee, length) = (i32::from(at.is_committee), at.length as i32);
        unsafe { (self.diagnosis.decide)(is_committee, length, stage as i32, row.as_ptr()) }
    }

    /// The probabilities of a committee's stage, one for each of so many classes.
    pub(crate) fn shares(
        &self,
        length: usize,
        stage: usize,
        row: &[f64],
        classes: usize,
    ) -> Vec<f64> {
        let (mut shares, length) = (vec![0.0; classes], length as i32);
        let into = shares.as_mut_ptr();
        unsafe { (self.diagnosis.shares)(length, stage as i32, row.as_ptr(), into) };
        shares
    }

    /// What a leaf of a committee's stage adds to an output.
    pub(crate) fn value(&self, length: usize, stage: usize, (leaf, output): (i32, usize)) -> f64 {
        unsafe { (self.diagnosis.value)(length as i32, stage as i32, leaf, output as i32) }
    }

    /// The novelty of a row for healthy (0) or an action (1 …).
    pub(crate) fn novelty(&self, length: usize, known: usize, row: &[f64]) -> f64 {
        unsafe { (self.diagnosis.novelty)(length as i32, known as i32, row.as_ptr()) }
    }

    /// The answer of a hierarchy to a row seen from each actuator.
    pub(crate) fn diagnose(&self, at: LibraryPlace, views: &[Vec<f64>]) -> Diagnosis {
        let views: Vec<*const f64> = views.iter().map(|view| view.as_ptr()).collect();
        let (is_committee, length) = (i32::from(at.is_committee), at.length as i32);
        unsafe { (self.diagnosis.diagnose)(is_committee, length, views.as_ptr()) }
    }

    /// The probabilities of so many hypotheses.
    pub(crate) fn probabilities(
        &self,
        length: usize,
        views: &[Vec<f64>],
        count: usize,
    ) -> Vec<f64> {
        let views: Vec<*const f64> = views.iter().map(|view| view.as_ptr()).collect();
        let mut into = vec![0.0; count];
        let all = into.as_mut_ptr();
        unsafe { (self.diagnosis.probabilities)(length as i32, views.as_ptr(), all) };
        into
    }

    /// A new session.
    pub(crate) fn session(&self) -> RunningSession<'_> {
        let mut memory = memory(self.diagnosis.session_size);
        unsafe { (self.diagnosis.start)(memory.as_mut_ptr()) };
        RunningSession { library: self, memory }
    }

    /// A twin of this program before its start.
    pub(crate) fn twin(&self, program: &Program) -> Result<RunningTwin<'_>, ExportError> {
        let none = ExportError::Unsupported("the files of the export have no twin");
        let (entries, _) = self.twin.as_ref().ok_or(none)?;
        Ok(RunningTwin {
            memory: memory(entries.size),
            parameters: vec![0.0; program.parameters(&[]).iter().map(Vec::len).sum()],
            pairs: vec![0.0; 2 * program.externals().len()],
            variables_count: program.slots(),
            entries,
        })
    }

    /// A hybrid twin before its first sample; `None` if it fails its start test, or the export has none.
    pub(crate) fn hybrid(&self) -> Option<RunningHybrid<'_>> {
        let (_, entries) = self.twin.as_ref()?;
        let mut memory = memory(entries.size);
        let is_exact = unsafe { (entries.start)(memory.as_mut_ptr()) } == 1;
        is_exact.then_some(RunningHybrid { memory, entries })
    }
}

/// A session of a compiled export.
pub(super) struct RunningSession<'c> {
    library: &'c Compiled,
    memory: Vec<u64>,
}

impl RunningSession<'_> {
    /// Pushes a sample; `said` gets lists as long as those of `like`.
    pub(crate) fn push(&mut self, sample: &Sample, like: &SessionAnswer, said: &mut SessionAnswer) {
        said.integers.resize(like.integers.len(), 0);
        said.numbers.resize(like.numbers.len(), 0.0);
        let (integers, numbers) = (said.integers.as_mut_ptr(), said.numbers.as_mut_ptr());
        let memory = self.memory.as_mut_ptr();
        let [inputs, measured, twin] =
            [&sample.inputs, &sample.measured, &sample.twin].map(|values| values.as_ptr());
        let push = self.library.diagnosis.push;
        unsafe { push(memory, inputs, measured, twin, integers, numbers) }
    }

    /// Passes a command of the flight control computer on.
    pub(crate) fn command(&mut self, command: i32, place: i32) {
        unsafe { (self.library.diagnosis.command)(self.memory.as_mut_ptr(), command, place) }
    }

    /// The features of the last window outside its bands in a view.
    pub(crate) fn row(&self, view: usize, features: usize) -> Vec<f64> {
        let mut row = vec![0.0; features];
        let (memory, into) = (self.memory.as_ptr(), row.as_mut_ptr());
        unsafe { (self.library.diagnosis.row)(memory, view as i32, into) };
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
    entries: &'c TwinEntries,
    memory: Vec<u64>,
    parameters: Vec<f64>,
    pairs: Vec<f64>,
    variables_count: usize,
}

impl RunningTwin<'_> {
    /// Whether it passes its start test.
    pub(crate) fn is_exact(&mut self) -> bool {
        unsafe { (self.entries.is_exact)(self.memory.as_mut_ptr()) == 1 }
    }

    /// Starts with faults of these intensities; returns whether it is well, here and below.
    pub(crate) fn start(&mut self, intensities: &[f64], inputs: &[Knot]) -> bool {
        self.take(intensities, inputs);
        let (memory, parameters) = (self.memory.as_mut_ptr(), self.parameters.as_ptr());
        unsafe { (self.entries.start)(memory, parameters, self.pairs.as_ptr()) == 1 }
    }

    /// Steps to the next sample.
    pub(crate) fn step(&mut self, inputs: &[Knot]) -> bool {
        self.take_inputs(inputs);
        unsafe { (self.entries.step)(self.memory.as_mut_ptr(), self.pairs.as_ptr()) == 1 }
    }

    /// The same, with other faults from the next sample on.
    pub(crate) fn step_with(&mut self, intensities: &[f64], inputs: &[Knot]) -> bool {
        self.take(intensities, inputs);
        unsafe { (self.entries.load)(self.memory.as_mut_ptr(), self.parameters.as_ptr()) };
        self.step(inputs)
    }

    /// All variables at the current sample.
    pub(crate) fn variables(&self) -> &[f64] {
        unsafe {
            let first = (self.entries.variables)(self.memory.as_ptr());
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
        unsafe {
            (self.entries.point)(memory, of.number(), parameters, given.as_ptr(), slopes.as_ptr())
        }
    }

    /// The gradients of the last evaluation with them, in the layout of the program.
    pub(crate) fn gradients(&self, count: usize) -> &[f64] {
        unsafe { std::slice::from_raw_parts((self.entries.gradients)(self.memory.as_ptr()), count) }
    }

    fn take_faults(&mut self, intensities: &[f64]) {
        unsafe { (self.entries.parameters)(intensities.as_ptr(), self.parameters.as_mut_ptr()) }
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
    entries: &'c HybridEntries,
    memory: Vec<u64>,
}

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
            let expected =
                (self.entries.push)(memory, inputs.as_ptr(), measured.as_ptr(), into.0, into.1);
            (!expected.is_null())
                .then(|| (integers, confidence, std::slice::from_raw_parts(expected, sensors)))
        }
    }

    /// Follows a reaction, which is found by what was raised.
    pub(crate) fn follow(&mut self, known: &ExportedReaction) {
        let numbers = [Some(known.actuator), Some(known.action), known.detail];
        let numbers = numbers.map(|number| number.map_or(-1, |number| number as i32));
        let [actuator, action, detail] = numbers;
        unsafe { (self.entries.command)(self.memory.as_mut_ptr(), actuator, action, detail) }
    }

    /// Undoes the reactions of an actuator.
    pub(crate) fn release(&mut self, actuator: usize) {
        unsafe { (self.entries.command)(self.memory.as_mut_ptr(), actuator as i32, -1, -1) }
    }

    /// Sets a parameter of the twin, and returns whether it could be set.
    pub(crate) fn set(&mut self, parameter: i32, value: f64) -> bool {
        unsafe { (self.entries.set)(self.memory.as_mut_ptr(), parameter, value) == 1 }
    }
}
