//! Writes checkpoints of a live source on a separate thread, so that a slow or full disk never delays the diagnosis.

use super::checkpoint::{Checkpoint, CheckpointError};
use super::watchdog::SinkLoss;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::{self, JoinHandle};

/// A thread that writes successive checkpoints to the same file. It ends at the first failed write.
pub(super) struct CheckpointWriter {
    path: PathBuf,
    /// `None` after the last checkpoint was queued.
    queue: Option<SyncSender<Box<Checkpoint>>>,
    /// `None` after it has ended.
    thread: Option<JoinHandle<Result<(), CheckpointError>>>,
    failure: Option<String>,
    is_failure_told: bool,
    /// Checkpoints skipped because the previous one was still being written.
    skipped: u64,
}

impl CheckpointWriter {
    /// Starts the thread.
    pub(crate) fn new(path: &Path) -> Self {
        let (queue, checkpoints) = sync_channel::<Box<Checkpoint>>(1);
        let (path, target) = (path.to_owned(), path.to_owned());
        let write = move || checkpoints.iter().try_for_each(|one| one.write(&target));
        CheckpointWriter {
            path,
            queue: Some(queue),
            thread: Some(thread::spawn(write)),
            failure: None,
            is_failure_told: false,
            skipped: 0,
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
            // If the thread has ended, it gives the reason below.
            let _ = queue.send(Box::new(checkpoint));
        }
        self.join();
    }

    /// Waits for the end of the thread.
    fn join(&mut self) {
        let Some(thread) = self.thread.take() else { return };
        self.failure = match thread.join() {
            Ok(written) => written.err().map(|error| error.to_string()),
            Err(_) => Some("its thread has ended".into()),
        };
    }

    /// Why checkpoints are no longer written; returned once.
    pub(crate) fn failure(&mut self) -> Option<(String, String)> {
        if self.thread.as_ref().is_some_and(JoinHandle::is_finished) {
            self.join();
        }
        let reason = self.failure.clone().filter(|_| !self.is_failure_told)?;
        self.is_failure_told = true;
        Some((self.path.display().to_string(), reason))
    }

    /// The number of skipped checkpoints, with the reason of a failure.
    pub(crate) fn loss(&self) -> SinkLoss {
        let (sink, failure) = (self.path.display().to_string(), self.failure.clone());
        SinkLoss { sink, lost: self.skipped, failure, is_file: true }
    }
}
