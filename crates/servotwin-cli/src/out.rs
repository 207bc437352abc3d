//! Standard output and standard error with escaped text. All text leaves the program here.
//!
//! Names and values from a file may contain control sequences for a terminal. They are escaped for every command.

use servotwin::sanitize::Printable;
use std::io::{self, IsTerminal, Stderr, Stdout};

/// Standard output, with control characters escaped.
pub(crate) fn stdout() -> Printable<Stdout> {
    Printable::new(io::stdout())
}

/// Standard error, with control characters escaped.
pub(crate) fn stderr() -> Printable<Stderr> {
    Printable::new(io::stderr())
}

/// The columns of the terminal, if standard output is one.
pub(crate) fn columns() -> Option<u16> {
    terminal_size::terminal_size_of(io::stdout()).map(|(width, _)| width.0)
}

/// Whether standard error is a terminal.
pub(crate) fn is_stderr_seen() -> bool {
    io::stderr().is_terminal()
}
