//! Work that takes long: beside the interpreter, with its lock released, heeding Ctrl-C and telling
//! how far it is.

use pyo3::prelude::*;
use servotwin::parallel::Workers;
use std::panic::resume_unwind;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

/// How often Ctrl-C is looked for.
const POLL: Duration = Duration::from_millis(50);

/// What work and interpreter tell each other.
#[derive(Default)]
pub(crate) struct Watch {
    /// Set when the work shall stop.
    pub(crate) cancel: AtomicBool,
    /// What is being done, how much of it is done, and how much there is.
    told: Mutex<Option<(String, usize, usize)>>,
}

impl Watch {
    /// So many threads, or one for each processor, which stop when the work shall.
    pub(crate) fn workers(&self, threads: Option<usize>) -> Workers<'_> {
        let threads = threads.map_or(Workers::all(), |threads| Workers::new(threads.max(1)));
        threads.stopped_by(&self.cancel)
    }

    /// Tells what is being done and how far it is.
    pub(crate) fn tell(&self, what: &str, done: usize, all: usize) {
        let mut told = self.told.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        *told = Some((what.into(), done, all));
    }

    fn take(&self) -> Option<(String, usize, usize)> {
        self.told.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).take()
    }
}

/// Does `work` in a thread of its own. `progress` is called with (what, done, all) meanwhile. What
/// Ctrl-C or `progress` raise stops the work and is raised when it has stopped.
///
/// # Errors
/// What was raised.
///
/// # Panics
/// If the work does.
pub(crate) fn long<T: Send>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(&Watch) -> T + Send,
) -> PyResult<T> {
    let watch = Watch::default();
    let (result, raised) = py.detach(|| {
        thread::scope(|scope| {
            let (ended, end) = channel::<()>();
            let watch = &watch;
            let worker = scope.spawn(move || {
                // Dropped at the end, also while a panic unwinds.
                let _ended = ended;
                work(watch)
            });
            let mut raised = None;
            while end.recv_timeout(POLL) == Err(RecvTimeoutError::Timeout) {
                if raised.is_none()
                    && let Err(error) = Python::attach(|py| look(py, watch, progress))
                {
                    watch.cancel.store(true, Ordering::Relaxed);
                    raised = Some(error);
                }
            }
            (worker.join(), raised)
        })
    });
    let result = result.unwrap_or_else(|panic| resume_unwind(panic));
    match raised {
        Some(error) => Err(error),
        None => look(py, &watch, progress).map(|()| result),
    }
}

fn look(py: Python<'_>, watch: &Watch, progress: Option<&Py<PyAny>>) -> PyResult<()> {
    py.check_signals()?;
    if let (Some(progress), Some((what, done, all))) = (progress, watch.take()) {
        progress.call1(py, (what, done, all))?;
    }
    Ok(())
}
