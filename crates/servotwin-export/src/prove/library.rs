//! An export, compiled and loaded.

use super::chain::Said;
use super::samples::Sample;
use crate::c::CFile;
use crate::error::ExportError;
use libloading::{Library, Symbol};
use std::fs;
use std::path::Path;
use std::process::Command;

/// Flags of every build. Warnings are errors: the text must be clean in all compilers.
const FLAGS: &[&str] =
    &["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror", "-ffp-contract=off"];

/// The entry points, which are not part of an export.
const PROVE: &str = include_str!("../../runtime/prove.c");

/// How the text is compiled.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Build {
    /// The compiler's command.
    pub compiler: String,
    /// Its level of optimization, `-O0` …
    pub level: &'static str,
}

impl Build {
    /// gcc and clang, as far as they are installed, at three levels of optimization each.
    pub fn available() -> Vec<Build> {
        let starts = |compiler: &&str| {
            let run = Command::new(compiler).arg("--version").output();
            run.is_ok_and(|output| output.status.success())
        };
        let compilers = ["gcc", "clang"].into_iter().filter(|compiler| starts(compiler));
        let levels = ["-O0", "-O2", "-O3"];
        compilers
            .flat_map(|compiler| levels.map(|level| Build { compiler: compiler.into(), level }))
            .collect()
    }

    /// The command with its flags.
    pub fn command(&self) -> String {
        format!("{} {} {}", self.compiler, FLAGS.join(" "), self.level)
    }

    /// The first line of the compiler's version.
    pub fn version(&self) -> String {
        let output = Command::new(&self.compiler).arg("--version").output();
        let text = output.map(|output| String::from_utf8_lossy(&output.stdout).into_owned());
        text.unwrap_or_default().lines().next().unwrap_or("unknown").into()
    }
}

/// The answer of a stage: `servotwin_answer`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Answer {
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
pub(super) struct Place {
    pub is_committee: bool,
    pub length: usize,
}

impl Place {
    fn numbers(self) -> (i32, i32) {
        (i32::from(self.is_committee), self.length as i32)
    }
}

/// A compiled export. Rows must have as many features as the diagnoser, and places must exist in it.
pub(super) struct Compiled {
    library: Library,
}

impl Compiled {
    /// Compiles the files into a temporary folder and loads them.
    pub fn new(files: &[CFile], build: &Build) -> Result<Self, ExportError> {
        let folder = tempfile::tempdir().map_err(|cause| problem(&std::env::temp_dir(), cause))?;
        let path = |name: &str| folder.path().join(name);
        let prove = [("prove.c", PROVE)];
        for (name, text) in files.iter().map(|file| (file.name, &*file.text)).chain(prove) {
            fs::write(path(name), text).map_err(|cause| problem(&path(name), cause))?;
        }
        let sources = files.iter().map(|file| file.name).chain(["prove.c"]);
        let mut command = Command::new(&build.compiler);
        command.current_dir(folder.path()).args(FLAGS).arg(build.level);
        command.args(["-shared", "-fPIC", "-o", "export.so"]);
        command.args(sources.filter(|name| name.ends_with(".c") && *name != "main.c")).arg("-lm");
        let output = command.output().map_err(|cause| {
            let compiler = build.compiler.clone();
            ExportError::NoCompiler { compiler, cause }
        })?;
        if !output.status.success() {
            let all = String::from_utf8_lossy(&output.stderr);
            let messages = all.lines().take(10).collect::<Vec<_>>().join("\n");
            return Err(ExportError::Refused { compiler: build.command(), messages });
        }
        // SAFETY: the code runs nothing when it is loaded. On Linux the file may go once it is mapped.
        Ok(Compiled { library: unsafe { Library::new(path("export.so")) }? })
    }

    pub fn rounds_twice(&self) -> Result<bool, ExportError> {
        type Function = unsafe extern "C" fn() -> i32;
        // SAFETY: here and below, the types are those of the C text.
        let function = unsafe { self.library.get::<Function>(b"servotwin_rounds_twice") }?;
        Ok(unsafe { function() } == 1)
    }

    pub fn leaf(
        &self,
        at: Place,
        stage: usize,
        tree: usize,
        row: &[f64],
    ) -> Result<i32, ExportError> {
        type Function = unsafe extern "C" fn(i32, i32, i32, i32, *const f64) -> i32;
        let function = unsafe { self.library.get::<Function>(b"prove_leaf") }?;
        let (is_committee, length) = at.numbers();
        Ok(unsafe { function(is_committee, length, stage as i32, tree as i32, row.as_ptr()) })
    }

    pub fn decide(&self, at: Place, stage: usize, row: &[f64]) -> Result<Answer, ExportError> {
        type Function = unsafe extern "C" fn(i32, i32, i32, *const f64) -> Answer;
        let function = unsafe { self.library.get::<Function>(b"prove_decide") }?;
        let (is_committee, length) = at.numbers();
        Ok(unsafe { function(is_committee, length, stage as i32, row.as_ptr()) })
    }

    /// The probabilities of a committee's stage, one for each class.
    pub fn shares(
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

    pub fn diagnose(&self, at: Place, views: &[Vec<f64>]) -> Result<Diagnosis, ExportError> {
        type Function = unsafe extern "C" fn(i32, i32, *const *const f64) -> Diagnosis;
        let function = unsafe { self.library.get::<Function>(b"prove_diagnose") }?;
        let (is_committee, length) = at.numbers();
        let views: Vec<*const f64> = views.iter().map(|view| view.as_ptr()).collect();
        Ok(unsafe { function(is_committee, length, views.as_ptr()) })
    }

    /// The probabilities of all hypotheses.
    pub fn probabilities(
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
    /// Whole words, so that any member is aligned.
    memory: Vec<u64>,
    push: Symbol<
        'c,
        unsafe extern "C" fn(*mut u64, *const f64, *const f64, *const f64, *mut i64, *mut f64),
    >,
    command: Symbol<'c, unsafe extern "C" fn(*mut u64, i32, i32)>,
    row: Symbol<'c, unsafe extern "C" fn(*const u64, i32) -> *const f64>,
}

impl Compiled {
    /// A new session.
    pub fn session(&self) -> Result<RunningSession<'_>, ExportError> {
        // SAFETY: the types are those of the C text; the memory is as large as the library says.
        unsafe {
            let size: Symbol<unsafe extern "C" fn() -> u64> =
                self.library.get(b"prove_session_size")?;
            let start: Symbol<unsafe extern "C" fn(*mut u64) -> i32> =
                self.library.get(b"prove_start")?;
            let mut memory = vec![0; size().div_ceil(8) as usize];
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
    pub fn push(&mut self, sample: &Sample, like: &Said, said: &mut Said) {
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
    pub fn command(&mut self, command: i32, place: i32) {
        // SAFETY: the place exists in the diagnoser.
        unsafe { (self.command)(self.memory.as_mut_ptr(), command, place) }
    }

    /// The features of the last window outside its bands in a view.
    pub fn row(&self, view: usize, features: usize) -> &[f64] {
        // SAFETY: the row lies in the memory of the session and has this many numbers.
        unsafe {
            std::slice::from_raw_parts((self.row)(self.memory.as_ptr(), view as i32), features)
        }
    }
}

fn problem(path: &Path, cause: std::io::Error) -> ExportError {
    ExportError::File { path: path.into(), cause }
}
