//! An export, compiled and loaded.

use crate::c::CFile;
use crate::error::ExportError;
use libloading::Library;
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
        command.args(sources.filter(|name| name.ends_with(".c") && *name != "main.c"));
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

fn problem(path: &Path, cause: std::io::Error) -> ExportError {
    ExportError::File { path: path.into(), cause }
}
