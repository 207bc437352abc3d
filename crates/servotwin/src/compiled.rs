//! Steps that the machine's C compiler has made faster.
//!
//! Where there is a compiler and enough to do, the system's equations and their Jacobian become machine code
//! ([`servotwin_model::kernel_source`]) in a second or two; where there is none the solver walks its lists, which takes
//! half as long again. The bits are the same.
//!
//! The compiler is `$SERVOTWIN_CC`, or else `$CC`, or else `cc`; an empty `$SERVOTWIN_CC` means none.

use libloading::Library;
use servotwin_model::kernel_source;
use servotwin_model::lanes::{self, Level};
use servotwin_model::program::Program;
use servotwin_model::solver::{Functions, Kernels, Method, Settings};
use std::env;
use std::ffi::OsString;
use std::fs;
use std::iter;
use std::path::{Path, PathBuf};
use std::process::{self, Child, Command, Stdio};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

/// Simulated time, s, from which on compiling costs less than it saves.
const WORTH_S: u64 = 60_000;

/// The compiled step of one system.
#[derive(Default)]
pub struct Compiled {
    /// For runs that begin with the lanes of a level, by its place among [`lanes::ALL`].
    loaded: [OnceLock<Option<Loaded>>; lanes::ALL.len()],
    /// What was asked for so far, s of simulated time.
    asked_s: AtomicU64,
}

struct Loaded {
    kernels: Kernels,
    /// Where the functions stand.
    _libraries: Vec<Library>,
}

impl Compiled {
    /// For those who cannot wait until it is worth it.
    pub fn at_once() -> Self {
        Self { asked_s: AtomicU64::new(WORTH_S), ..Self::default() }
    }

    /// As [`Compiled::kernels`], where this many more simulated seconds make it worth it, for the method that they were
    /// made for.
    pub(crate) fn when_worth(
        &self,
        program: &Program,
        method: Method,
        level: Level,
        simulated_s: f64,
    ) -> Option<&Kernels> {
        if method != Settings::campaign().method {
            return None;
        }
        let before_s = self.asked_s.fetch_add(simulated_s as u64, Ordering::Relaxed);
        let is_worth = before_s.saturating_add(simulated_s as u64) >= WORTH_S;
        if is_worth { self.kernels(program, level) } else { None }
    }

    /// The functions for a program, which must always be the same, for runs that begin with the lanes of a level.
    /// `None` without a compiler.
    pub fn kernels(&self, program: &Program, level: Level) -> Option<&Kernels> {
        let place = lanes::ALL.iter().position(|known| *known == level).expect("a level");
        let loaded = self.loaded[place].get_or_init(|| Loaded::new(program, level, &compiler()?));
        loaded.as_ref().map(|loaded| &loaded.kernels)
    }
}

/// The compiler, if one is wanted.
fn compiler() -> Option<OsString> {
    let named = env::var_os("SERVOTWIN_CC").or_else(|| env::var_os("CC"));
    named.or_else(|| Some("cc".into())).filter(|cc| !cc.is_empty())
}

impl Loaded {
    fn new(program: &Program, level: Level, compiler: &OsString) -> Option<Self> {
        let method = Settings::campaign().method;
        let text = kernel_source::write(program, method)?;
        let folder = Folder::new()?;
        let source = folder.0.join("step.c");
        fs::write(&source, text).ok()?;
        let levels = iter::successors(Some(level), |level| level.narrower());
        let compiling: Vec<_> = levels
            .map(|level| (level, folder.0.join(level.name())))
            .map(|(level, library)| (level, compile(compiler, level, &source, &library), library))
            .collect();
        // All of them, so that none goes on when one has failed.
        let compiled: Vec<_> = (compiling.into_iter())
            .map(|(level, child, library)| (level, child.and_then(ended), library))
            .collect();
        let (mut functions, mut libraries) = (Vec::new(), Vec::new());
        for (level, success, library) in compiled {
            success?;
            // SAFETY: a library of straight lines, which does nothing when it is loaded.
            let library = unsafe { Library::new(&library) }.ok()?;
            // SAFETY: the text's functions, compiled for lanes of this level, which is available; the library stays
            // loaded as long as they are there.
            functions.push(unsafe {
                Functions::find(method, level.width(), |name| {
                    let symbol = library.get::<*const ()>(name.as_bytes()).ok()?;
                    symbol.try_as_raw_ptr().map(|address| address.cast_const().cast())
                })
            }?);
            libraries.push(library);
        }
        // SAFETY: made of this program; `Compiled` is that of one system.
        let kernels = unsafe { Kernels::new(method, functions) };
        Some(Self { kernels, _libraries: libraries })
    }
}

/// Starts to compile for the lanes of a level.
fn compile(compiler: &OsString, level: Level, source: &Path, library: &Path) -> Option<Child> {
    let wide: &[&str] = match level.register_width() {
        8 => &["-mavx512f", "-mavx512dq", "-mprefer-vector-width=512"],
        4 => &["-mavx2"],
        _ if Level::Avx2.available() => &["-mavx2"],
        _ => &[],
    };
    Command::new(compiler)
        .args(["-std=gnu99", "-O2", "-ffp-contract=off", "-fno-math-errno"])
        // Without it loads stand long before what they are for, and go to memory again.
        .args(["-fschedule-insns", "-fsched-pressure", "-shared", "-fPIC"])
        .args(wide)
        .arg(format!("-DWIDTH={}", level.register_width()))
        .arg(format!("-DSTRIDE={}", level.width()))
        .arg("-o")
        .args([library, source])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .ok()
}

/// Waits for the end; `None` where it was no good one.
fn ended(mut compiling: Child) -> Option<()> {
    compiling.wait().ok()?.success().then_some(())
}

/// A folder that is removed when it is no longer needed; a loaded library is not.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Option<Self> {
        let name = |number| format!("servotwin-{}-{number}", process::id());
        let mut folders = (0..100).map(|number| env::temp_dir().join(name(number)));
        folders.find(|folder| fs::create_dir(folder).is_ok()).map(Self)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // What is left in a folder for temporary files does no harm.
        let _ = fs::remove_dir_all(&self.0);
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
            assert!(Loaded::new(&program, Level::Portable, &broken.into()).is_none(), "{broken}");
        }
    }

    #[test]
    fn little_work_is_not_worth_it() {
        let compiled = Compiled::default();
        let (program, method) = (System::default().program, Settings::campaign().method);
        assert!(compiled.when_worth(&program, method, Level::Portable, 1.0).is_none());
        assert!(compiled.loaded.iter().all(|loaded| loaded.get().is_none()));
    }
}
