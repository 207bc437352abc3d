//! Progress on a terminal; a pipe gets none.

use crate::{Global, out};
use indicatif::{ProgressBar, ProgressStyle};
use servotwin::sanitize;
use std::io::Write;
use std::time::Duration;

/// The resolution of the progress bar.
const PARTS: u64 = 1000;

/// The progress of a long job in one line.
pub struct Stages(ProgressBar);

impl Stages {
    /// Starts the line, which stays hidden unless standard error is a terminal and `--quiet` is not set.
    pub fn new(global: Global) -> Self {
        if !is_shown(global) {
            return Stages(ProgressBar::hidden());
        }
        let style = ProgressStyle::with_template("{msg} {wide_bar} {eta} left");
        let bar = ProgressBar::new(PARTS).with_style(style.expect("a correct template"));
        bar.enable_steady_tick(Duration::from_millis(200));
        Stages(bar)
    }

    /// Shows the current task, and the share of all work that is done, from 0 to 1.
    pub fn show(&self, what: &str, share: f64) {
        self.0.set_message(sanitize::printable(what).into_owned());
        self.0.set_position((PARTS as f64 * share) as u64);
    }

    /// Removes the line.
    pub fn end(&self) {
        self.0.finish_and_clear();
    }
}

/// Whether progress is shown: standard error is a terminal, and `--quiet` is not set.
pub fn is_shown(global: Global) -> bool {
    !global.quiet && out::is_stderr_seen()
}

/// Remarks next to the result, on standard error.
pub struct Notes {
    quiet: bool,
}

impl Notes {
    /// Writes remarks unless `--quiet` or `--json` is set.
    pub fn new(global: Global) -> Self {
        Notes { quiet: global.quiet || global.json }
    }

    /// Writes one remark.
    pub fn write(&self, text: &str) {
        if !self.quiet {
            // If standard error is closed, there is no way to report that.
            let _ = writeln!(out::stderr(), "{text}");
        }
    }
}
