//! What is being done, on a terminal; nothing in a pipe.

use crate::{Global, out};
use indicatif::{ProgressBar, ProgressStyle};
use servotwin::sanitize;
use std::io::Write;
use std::time::Duration;

/// The length of the bar.
const PARTS: u64 = 1000;

/// The stages of a long job, one line that changes.
pub struct Stages(ProgressBar);

impl Stages {
    /// Shows nothing if standard error is no terminal.
    pub fn new(global: Global) -> Self {
        if !is_shown(global) {
            return Stages(ProgressBar::hidden());
        }
        let style = ProgressStyle::with_template("{msg} {wide_bar} {eta} left");
        let bar = ProgressBar::new(PARTS).with_style(style.expect("a correct template"));
        bar.enable_steady_tick(Duration::from_millis(200));
        Stages(bar)
    }

    /// What is being done now, and how much of all is done, from 0 to 1.
    pub fn show(&self, what: &str, share: f64) {
        self.0.set_message(sanitize::printable(what).into_owned());
        self.0.set_position((PARTS as f64 * share) as u64);
    }

    /// Takes the line away.
    pub fn end(&self) {
        self.0.finish_and_clear();
    }
}

/// Whether somebody looks at standard error and wants to know.
pub fn is_shown(global: Global) -> bool {
    !global.quiet && out::is_stderr_seen()
}

/// Remarks beside the result, on standard error.
pub struct Notes {
    quiet: bool,
}

impl Notes {
    /// Writes nothing if the user wants it quiet, or the result as JSON.
    pub fn new(global: Global) -> Self {
        Notes { quiet: global.quiet || global.json }
    }

    /// One remark.
    pub fn write(&self, text: &str) {
        if !self.quiet {
            // Nobody is left to tell where standard error is closed.
            let _ = writeln!(out::stderr(), "{text}");
        }
    }
}
