//! Writes checkpoints of a live source on a separate thread, so that a slow or full disk never delays the diagnosis.

use super::checkpoint::Checkpoint;
use super::watchdog::SinkLoss;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};

/// A thread that writes successive checkpoints to the same file. It stops after the first failed write.
pub(super) struct CheckpointWriter {
    path: PathBuf,
    /// `None` after the last checkpoint was queued.
    queue: Option<SyncSender<Box<Checkpoint>>>,
    failure: Arc<Mutex<Option<String>>>,
    is_failure_told: bool,
    /// Checkpoints skipped because the previous one was still being written.
    skipped: u64,
    thread: Option<JoinHandle<()>>,
}

impl CheckpointWriter {
    /// Starts the thread.
    pub(crate) fn new(path: &Path) -> Self {
        let (queue, checkpoints) = sync_channel(1);
        let failure = Arc::new(Mutex::new(None));
        let (target, thread_shared) = (path.to_owned(), failure.clone());
        let thread = thread::spawn(move || write_all(&target, &checkpoints, &thread_shared));
        CheckpointWriter {
            path: path.into(),
            queue: Some(queue),
            failure,
            is_failure_told: false,
            skipped: 0,
            thread: Some(thread),
        }
    }

    /// Queues a checkpoint, unless one is already waiting.
    pub(crate) fn offer(&mut self, checkpoint: Checkpoint) {
        let is_taken = match &self.queue {
            Some(queue) => queue.try_send(Box::new(checkpoint)).is_ok(),
            None => false,
        };
        self.skipped += u64::from(!is_taken);
    }

    /// Writes the last checkpoint, and waits until it is written.
    pub(crate) fn finish(&mut self, checkpoint: Checkpoint) {
        if let Some(queue) = self.queue.take() {
            // If the thread has ended, it has already recorded the reason.
            let _ = queue.send(Box::new(checkpoint));
        }
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }

    /// Why checkpoints are no longer written; returned once.
    pub(crate) fn failure(&mut self) -> Option<(String, String)> {
        let reason = self.reason().filter(|_| !self.is_failure_told)?;
        self.is_failure_told = true;
        Some((self.path.display().to_string(), reason))
    }

    /// The number of skipped checkpoints, with the reason of a failure.
    pub(crate) fn loss(&self) -> SinkLoss {
        let sink = self.path.display().to_string();
        SinkLoss { sink, lost: self.skipped, failure: self.reason(), is_file: true }
    }

    fn reason(&self) -> Option<String> {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

fn write_all(
    path: &Path,
    checkpoints: &Receiver<Box<Checkpoint>>,
    failure: &Mutex<Option<String>>,
) {
    for checkpoint in checkpoints {
        if let Err(error) = checkpoint.write(path) {
            let mut kept = failure.lock().unwrap_or_else(PoisonError::into_inner);
            *kept = Some(error.to_string());
            return;
        }
    }
}
