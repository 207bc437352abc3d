//! Ctrl-C: the first one asks the run to stop, the second one ends the program. A command that has not called [`heed`]
//! ends at the first one.
//!
//! Files are written under another name and renamed when complete, so even an immediate end leaves no
//! half-written target.

use crate::failure::Failure;
use crate::out;
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};

static STOP: AtomicBool = AtomicBool::new(false);
/// Whether the command polls the flag.
static HEEDED: AtomicBool = AtomicBool::new(false);

/// The flag that Ctrl-C sets.
pub(crate) fn flag() -> &'static AtomicBool {
    &STOP
}

/// Handles Ctrl-C and other termination signals from now on. If the handler cannot be installed, a signal ends
/// the program at once, as usual.
pub(crate) fn listen() {
    let _ = ctrlc::set_handler(|| {
        if STOP.swap(true, Ordering::Relaxed) || !HEEDED.load(Ordering::Relaxed) {
            // If standard error is closed, there is no way to report that.
            let stopped = Failure::stopped();
            let _ = writeln!(out::stderr(), "{}", stopped.message);
            std::process::exit(i32::from(stopped.exit_code));
        }
    });
}

/// Declares that the command polls the flag from now on.
pub(crate) fn heed() {
    HEEDED.store(true, Ordering::Relaxed);
}

/// Ends a job between two of its steps if the flag is set.
pub(crate) fn check() -> Result<(), Failure> {
    if STOP.load(Ordering::Relaxed) { Err(Failure::stopped()) } else { Ok(()) }
}
