//! Progress: a bar on a terminal, and for the longest jobs a line for each stage in a pipe.

use super::workers;
use crate::failure::Failure;
use crate::{Global, out, stop};
use indicatif::{ProgressBar, ProgressStyle};
use servotwin::job::Crew;
use servotwin::sanitize;
use std::io::Write;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// The resolution of the progress bar.
const PARTS: u64 = 1000;

/// The progress of a long job in one line.
pub(crate) struct Stages {
    bar: ProgressBar,
    /// The stage that was written last, where every stage gets a line.
    written: Option<Mutex<String>>,
}

impl Stages {
    /// Starts the line, which stays hidden unless standard error is a terminal and `--quiet` is not set.
    pub(crate) fn new(global: Global) -> Self {
        if !is_shown(global) {
            return Stages { bar: ProgressBar::hidden(), written: None };
        }
        let style = ProgressStyle::with_template("{msg} {wide_bar} {eta} left");
        let bar = ProgressBar::new(PARTS).with_style(style.expect("a correct template"));
        bar.enable_steady_tick(Duration::from_millis(200));
        Stages { bar, written: None }
    }

    /// As [`Stages::new`]; where no bar is shown, every stage gets a line on standard error, unless `--quiet` or
    /// `--json` is set.
    pub(crate) fn in_lines(global: Global) -> Self {
        let has_lines = !is_shown(global) && !global.quiet && !global.json;
        Stages { written: has_lines.then(Mutex::default), ..Stages::new(global) }
    }

    /// Shows the current task, and the share of all work that is done, from 0 to 1.
    pub(crate) fn show(&self, what: &str, share: f64) {
        if let Some(written) = &self.written {
            let mut written = written.lock().unwrap_or_else(PoisonError::into_inner);
            if *written != what {
                // If standard error is closed, there is no way to report that.
                let _ = writeln!(out::stderr(), "{what} …");
                what.clone_into(&mut written);
            }
        }
        self.bar.set_message(sanitize::printable(what).into_owned());
        self.bar.set_position((PARTS as f64 * share) as u64);
    }

    /// As [`Stages::show`] after one of many small tasks, most of which change nothing on the screen.
    pub(crate) fn count(&self, what: &str, done: usize, all: usize) {
        let part = |done: usize| done * PARTS as usize / all.max(1);
        if part(done) > part(done - 1) {
            self.show(what, done as f64 / all as f64);
        }
    }

    /// Removes the line.
    pub(crate) fn end(&self) {
        self.bar.finish_and_clear();
    }
}

/// Runs work with threads and its progress on a terminal. Ctrl-C stops it.
pub(crate) fn with_crew<T, E>(
    threads: Option<usize>,
    global: Global,
    work: impl FnOnce(&Crew) -> Result<T, E>,
) -> Result<T, Failure>
where
    Failure: From<E>,
{
    let stages = Stages::in_lines(global);
    let crew =
        Crew { workers: workers(threads), progress: &|what, share| stages.show(what, share) };
    let done = work(&crew);
    stages.end();
    stop::check()?;
    Ok(done?)
}

/// Whether progress is shown: standard error is a terminal, and `--quiet` is not set.
pub(crate) fn is_shown(global: Global) -> bool {
    !global.quiet && out::is_stderr_seen()
}
