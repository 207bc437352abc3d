//! Ctrl-C: the first asks the run to stop, the second ends the program. Before a command looks whether it
//! is asked to stop, the first one ends the program.
//!
//! Files are written under another name and renamed when complete, so even an end at once leaves no
//! target half-written.

use crate::failure::Failure;
use crate::out;
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};

static STOP: AtomicBool = AtomicBool::new(false);
/// Whether the command looks at it.
static HEEDED: AtomicBool = AtomicBool::new(false);

/// What is set by Ctrl-C.
pub fn flag() -> &'static AtomicBool {
    &STOP
}

/// Catches Ctrl-C, and what else asks a program to end, from now on. Where the system does not let us, it
/// ends at once, as it does without.
pub fn listen() {
    let _ = ctrlc::set_handler(|| {
        if STOP.swap(true, Ordering::Relaxed) || !HEEDED.load(Ordering::Relaxed) {
            // Nobody is left to tell where standard error is closed.
            let _ = writeln!(out::stderr(), "{}", Failure::Stopped);
            std::process::exit(i32::from(Failure::Stopped.exit_code()));
        }
    });
}

/// Tells that the command looks whether it is asked to stop from now on.
pub fn heed() {
    HEEDED.store(true, Ordering::Relaxed);
}

/// Ends a job between two of its steps, if Ctrl-C was pressed.
pub fn check() -> Result<(), Failure> {
    if STOP.load(Ordering::Relaxed) { Err(Failure::Stopped) } else { Ok(()) }
}
