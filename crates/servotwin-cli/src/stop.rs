//! Ctrl-C: the first asks the run to stop, the second ends the program.
//!
//! Files are written under another name and renamed when complete, so even the
//! second leaves no target half-written.

use crate::failure::Failure;
use std::sync::atomic::{AtomicBool, Ordering};

static STOP: AtomicBool = AtomicBool::new(false);

/// What is set by Ctrl-C, once [`listen`] was called.
pub fn flag() -> &'static AtomicBool {
    &STOP
}

/// Catches Ctrl-C from now on. Where the system does not let us, Ctrl-C ends
/// the program at once, as it does without.
pub fn listen() {
    let _ = ctrlc::set_handler(|| {
        if STOP.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    });
}

/// Ends a job between two of its steps, if Ctrl-C was pressed.
pub fn check() -> Result<(), Failure> {
    if STOP.load(Ordering::Relaxed) { Err(Failure::Stopped) } else { Ok(()) }
}
