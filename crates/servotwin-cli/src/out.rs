//! Standard output and standard error, as people read them: the one place where text leaves the program.
//!
//! Names and values of a file may hold what a terminal acts on. It is escaped here, whichever command writes.

use servotwin::sanitize::Printable;
use std::io::{self, IsTerminal, Stderr, Stdout};

/// Standard output.
pub fn stdout() -> Printable<Stdout> {
    Printable::new(io::stdout())
}

/// Standard error.
pub fn stderr() -> Printable<Stderr> {
    Printable::new(io::stderr())
}

/// Whether somebody looks at standard error.
pub fn is_stderr_seen() -> bool {
    io::stderr().is_terminal()
}
