//! Runs each sink on its own thread behind a bounded queue, so that no sink delays the diagnosis or another sink.
//!
//! A sink that cannot keep up with a live source loses its own samples, which are counted. The second half of the queue
//! is reserved for notices and changes of the finding, so a sink loses these only after a long stall. If the source can
//! wait (a file), the watch waits for the queue and nothing is lost.
//!
//! After a failure, a sink is reported as failed, and all its later messages count as lost.

use super::{Sample, Sink, SinkError};
use crate::checkpoint::Checkpoint;
use crate::watchdog::{Notice, SinkLoss, WatchEvent};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

/// The most messages that wait for a sink.
const WAITING: usize = 1024;

/// The most waiting messages before samples without a change are dropped.
const WAITING_SAMPLES: usize = WAITING / 2;

/// How long standard output may take at the end for the waiting messages, and again for closing.
const GRACE: Duration = Duration::from_secs(5);

/// The behavior when a sink cannot keep up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Delivery {
    /// The diagnosis waits for the sink; nothing is lost.
    Wait,
    /// The sink loses samples; the diagnosis does not wait.
    Drop,
}

/// How a sink is served.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SinkRules {
    /// The file or stream, for messages.
    pub name: String,
    /// The behavior when it cannot keep up.
    pub delivery: Delivery,
    /// Whether it receives only changes and notices.
    pub only_changes: bool,
    /// The kind of sink.
    pub kind: SinkKind,
}

/// The kinds of sinks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SinkKind {
    /// A file, which must be complete: the end of the watch waits for it.
    File,
    /// Standard output.
    Stream,
    /// A file of checkpoints, which receives nothing else.
    Checkpoint,
    /// A terminal, which shows data that is stored elsewhere: its losses are not counted.
    Terminal,
}

enum Message {
    Sample(Arc<Sample>),
    Notice(Arc<Notice>),
    Save(Arc<Checkpoint>),
    /// Answered once all earlier messages were written.
    Flush(SyncSender<()>),
}

/// State shared by a sink's thread and the diagnosis.
#[derive(Default)]
struct Shared {
    waiting: AtomicUsize,
    lost: AtomicU64,
    /// The watch no longer waits for this queue.
    is_abandoned: AtomicBool,
    /// The watch ended with an error: outputs are not completed.
    is_cancelled: AtomicBool,
    has_failed: AtomicBool,
    /// Why the sink receives nothing any more.
    fault: Mutex<Option<SinkError>>,
}

impl Shared {
    fn lose(&self, count: u64) {
        self.lost.fetch_add(count, Ordering::Relaxed);
    }

    fn fail(&self, fault: SinkError) {
        let mut kept = self.fault.lock().unwrap_or_else(PoisonError::into_inner);
        kept.get_or_insert(fault);
        self.has_failed.store(true, Ordering::Release);
    }

    fn with_fault<T>(&self, read: impl FnOnce(&mut Option<SinkError>) -> T) -> Option<T> {
        let has_failed = self.has_failed.load(Ordering::Acquire);
        has_failed.then(|| read(&mut self.fault.lock().unwrap_or_else(PoisonError::into_inner)))
    }
}

/// A sink behind its queue.
struct SinkThread {
    rules: SinkRules,
    /// `None` after the output has ended.
    queue: Option<SyncSender<Message>>,
    shared: Arc<Shared>,
    /// Disconnects when the thread ends.
    done: Receiver<()>,
    is_failure_told: bool,
}

/// All sinks, each on its own thread.
pub struct SinkThreads {
    /// Whether the watch continues without a failed sink.
    goes_on: bool,
    threads: Vec<SinkThread>,
}

impl SinkThreads {
    /// No sinks yet. A live watch continues without a failed sink; a log can be read again, so there a failure is an
    /// error.
    pub fn new(is_live: bool) -> Self {
        SinkThreads { goes_on: is_live, threads: vec![] }
    }

    /// Adds a sink and starts its thread.
    pub fn add(&mut self, rules: SinkRules, sink: Box<dyn Sink + Send>) {
        let (queue, messages) = sync_channel(WAITING);
        let (ended, done) = sync_channel(0);
        let shared = Arc::new(Shared::default());
        let thread_shared = shared.clone();
        thread::spawn(move || {
            serve(sink, &messages, &thread_shared);
            drop(ended);
        });
        let queue = Some(queue);
        self.threads.push(SinkThread { rules, queue, shared, done, is_failure_told: false });
    }

    /// Ends all outputs, and returns the losses of each. It waits for files; standard output gets a few seconds.
    ///
    /// # Errors
    /// A sink failed, and the watch does not continue without it.
    pub fn finish(&mut self) -> Result<Vec<SinkLoss>, SinkError> {
        for thread in &mut self.threads {
            thread.queue = None;
        }
        self.threads.iter().for_each(SinkThread::await_end);
        self.check()?;
        Ok(self.losses())
    }

    /// The error of a failed sink, unless the watch continues without it.
    fn check(&mut self) -> Result<(), SinkError> {
        if self.goes_on {
            return Ok(());
        }
        let error = |fault: &mut Option<SinkError>| fault.take().map_or(Ok(()), Err);
        self.threads.iter().try_for_each(|thread| thread.shared.with_fault(error).unwrap_or(Ok(())))
    }
}

impl Drop for SinkThreads {
    /// Without [`SinkThreads::finish`] no output is completed: files that appear on completion do not appear.
    fn drop(&mut self) {
        for thread in &mut self.threads {
            thread.shared.is_cancelled.store(true, Ordering::Relaxed);
            if thread.queue.take().is_some() {
                // The thread removes its incomplete output.
                let _ = thread.done.recv_timeout(GRACE);
            }
        }
    }
}

impl SinkThread {
    /// Queues a message for the sink, or counts it as lost where `limit` messages wait already.
    fn offer(&self, message: Message, limit: usize) {
        let Some(queue) = &self.queue else { return };
        let shared = &self.shared;
        let waiting = shared.waiting.fetch_add(1, Ordering::Relaxed);
        let sent = match self.rules.delivery {
            Delivery::Wait => {
                queue.send(message).map_err(|error| TrySendError::Disconnected(error.0))
            }
            Delivery::Drop if waiting >= limit => Err(TrySendError::Full(message)),
            Delivery::Drop => queue.try_send(message),
        };
        if let Err(error) = sent {
            shared.waiting.fetch_sub(1, Ordering::Relaxed);
            shared.lose(1);
            if let TrySendError::Disconnected(_) = error {
                shared.fail(SinkError::Thread);
            }
        }
    }

    /// Whether it must be complete in the end.
    fn is_file(&self) -> bool {
        matches!(self.rules.kind, SinkKind::File | SinkKind::Checkpoint)
    }

    fn await_end(&self) {
        let has_ended = |patience| {
            use std::sync::mpsc::RecvTimeoutError::Timeout;
            self.done.recv_timeout(patience) != Err(Timeout)
        };
        if self.is_file() || self.rules.delivery == Delivery::Wait {
            let _ = self.done.recv();
            return;
        }
        if has_ended(GRACE) {
            return;
        }
        self.shared.is_abandoned.store(true, Ordering::Relaxed);
        if !has_ended(GRACE) {
            self.shared.lose(self.shared.waiting.load(Ordering::Relaxed) as u64);
            self.shared.fail(SinkError::Stuck);
        }
    }
}

impl Sink for SinkThreads {
    fn sample(&mut self, sample: &Arc<Sample>) -> Result<(), SinkError> {
        let limit = if sample.changed { WAITING } else { WAITING_SAMPLES };
        let wants = |thread: &&SinkThread| sample.changed || !thread.rules.only_changes;
        for thread in self.threads.iter().filter(shows).filter(wants) {
            thread.offer(Message::Sample(sample.clone()), limit);
        }
        self.check()
    }

    fn notice(&mut self, notice: &Notice) -> Result<(), SinkError> {
        let shared = Arc::new(notice.clone());
        let is_beat = matches!(notice.event, WatchEvent::Heartbeat { .. });
        let limit = if is_beat { WAITING_SAMPLES } else { WAITING };
        for thread in self.threads.iter().filter(shows) {
            thread.offer(Message::Notice(shared.clone()), limit);
        }
        self.check()
    }

    /// A checkpoint is left out while one is being written and another one waits.
    fn save(&mut self, checkpoint: &Arc<Checkpoint>, is_last: bool) -> Result<(), SinkError> {
        for thread in self.threads.iter().filter(|thread| !shows(thread)) {
            thread.offer(Message::Save(checkpoint.clone()), if is_last { WAITING } else { 2 });
        }
        self.check()
    }

    /// Flushes the sinks whose delivery waits.
    fn flush(&mut self) -> Result<(), SinkError> {
        for thread in &self.threads {
            if thread.rules.delivery == Delivery::Wait
                && let Some(queue) = &thread.queue
            {
                let (answer, answered) = sync_channel(1);
                thread.shared.waiting.fetch_add(1, Ordering::Relaxed);
                if queue.send(Message::Flush(answer)).is_ok() {
                    let _ = answered.recv();
                }
            }
        }
        self.check()
    }

    fn failures(&mut self) -> Vec<(String, String)> {
        let mut failed = vec![];
        for thread in self.threads.iter_mut().filter(|thread| !thread.is_failure_told) {
            let words = |fault: &mut Option<SinkError>| fault.as_ref().map(SinkError::to_string);
            if let Some(Some(reason)) = thread.shared.with_fault(words) {
                thread.is_failure_told = true;
                failed.push((thread.rules.name.clone(), reason));
            }
        }
        failed
    }

    fn losses(&self) -> Vec<SinkLoss> {
        let loss = |thread: &SinkThread| {
            let words = |fault: &mut Option<SinkError>| fault.as_ref().map(SinkError::to_string);
            let (sink, is_file) = (thread.rules.name.clone(), thread.is_file());
            let lost = thread.shared.lost.load(Ordering::Relaxed);
            SinkLoss { sink, lost, failure: thread.shared.with_fault(words).flatten(), is_file }
        };
        let counted = |thread: &&SinkThread| thread.rules.kind != SinkKind::Terminal;
        self.threads.iter().filter(counted).map(loss).collect()
    }
}

/// Whether a sink receives samples and notices.
fn shows(thread: &&SinkThread) -> bool {
    thread.rules.kind != SinkKind::Checkpoint
}

/// Passes messages to a sink until the queue is closed.
fn serve(sink: Box<dyn Sink + Send>, messages: &Receiver<Message>, shared: &Shared) {
    let mut sink = Some(sink);
    for message in messages {
        let is_abandoned = shared.is_abandoned.load(Ordering::Relaxed)
            || shared.is_cancelled.load(Ordering::Relaxed);
        let given = match sink.as_mut().filter(|_| !is_abandoned) {
            Some(sink) => give(&mut **sink, &message),
            None => {
                shared.lose(u64::from(!matches!(message, Message::Flush(_))));
                Ok(())
            }
        };
        if let Err(error) = given {
            sink = None;
            shared.lose(1);
            shared.fail(error);
        }
        shared.waiting.fetch_sub(1, Ordering::Relaxed);
        if let Message::Flush(answer) = message {
            let _ = answer.send(());
        }
    }
    let ended = sink.filter(|_| !shared.is_cancelled.load(Ordering::Relaxed)).map(Sink::close);
    if let Some(Err(error)) = ended {
        shared.fail(error);
    }
}

fn give(sink: &mut dyn Sink, message: &Message) -> Result<(), SinkError> {
    match message {
        Message::Sample(sample) => sink.sample(sample),
        Message::Notice(notice) => sink.notice(notice),
        Message::Save(checkpoint) => sink.save(checkpoint, false),
        Message::Flush(_) => sink.flush(),
    }
}
