//! What is being done, on a terminal; nothing in a pipe.

use crate::Global;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::{IsTerminal, stderr};
use std::time::Duration;

/// The stages of a long job, one line that changes.
pub struct Stages(ProgressBar);

impl Stages {
    /// Shows nothing if standard error is no terminal.
    pub fn new(global: Global) -> Self {
        if !is_shown(global) {
            return Stages(ProgressBar::hidden());
        }
        let style = ProgressStyle::with_template("{spinner} {elapsed} {msg}");
        let bar = ProgressBar::new_spinner().with_style(style.expect("a correct template"));
        bar.enable_steady_tick(Duration::from_millis(200));
        Stages(bar)
    }

    /// What is being done now.
    pub fn show(&self, what: &str) {
        self.0.set_message(what.to_string());
    }

    /// Takes the line away.
    pub fn end(&self) {
        self.0.finish_and_clear();
    }
}

/// Whether somebody looks at standard error and wants to know.
pub fn is_shown(global: Global) -> bool {
    !global.quiet && stderr().is_terminal()
}
