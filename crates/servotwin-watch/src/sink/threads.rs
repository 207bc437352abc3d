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
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

/// The most messages that wait for a sink.
const WAITING: usize = 1024;

/// The most waiting messages before samples without a change are dropped.
const WAITING_SAMPLES: usize = WAITING / 2;

/// How long standard output may take at the end for the waiting messages, and again for the one that it writes.
const GRACE: Duration = Duration::from_secs(5);

/// How a sink is served.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SinkRules {
    /// The file or stream, for messages.
    pub name: String,
    /// Whether the diagnosis waits for a sink that cannot keep up; otherwise the sink loses samples.
    pub waits: bool,
    /// The kind of sink.
    pub kind: SinkKind,
}

/// The kinds of sinks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SinkKind {
    /// A file of changes and notices, which must be complete: the end of the watch waits for it.
    Changes,
    /// Changes and notices on standard output.
    Stream,
    /// A file of checkpoints, which receives nothing else.
    Checkpoint,
    /// A terminal, which shows every sample: its losses are not counted.
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
    /// Nobody waits for this sink any more: it receives nothing else.
    is_abandoned: AtomicBool,
    /// Why the sink receives nothing any more.
    fault: Mutex<Option<SinkError>>,
}

impl Shared {
    fn lose(&self, count: u64) {
        self.lost.fetch_add(count, Ordering::Relaxed);
    }

    fn fault(&self) -> MutexGuard<'_, Option<SinkError>> {
        self.fault.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn fail(&self, fault: SinkError) {
        self.fault().get_or_insert(fault);
    }

    fn failure(&self) -> Option<String> {
        self.fault().as_ref().map(SinkError::to_string)
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
        let mut faults = self.threads.iter().filter_map(|thread| thread.shared.fault().take());
        faults.next().map_or(Ok(()), Err)
    }
}

impl Drop for SinkThreads {
    /// Without [`SinkThreads::finish`] the messages that wait are lost.
    fn drop(&mut self) {
        for thread in &mut self.threads {
            thread.shared.is_abandoned.store(true, Ordering::Relaxed);
            if thread.queue.take().is_some() {
                // What is being written is written whole.
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
        let sent = match self.rules.waits {
            true => queue.send(message).map_err(|error| TrySendError::Disconnected(error.0)),
            false if waiting >= limit => Err(TrySendError::Full(message)),
            false => queue.try_send(message),
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
        matches!(self.rules.kind, SinkKind::Changes | SinkKind::Checkpoint)
    }

    fn await_end(&self) {
        let has_ended = |patience| {
            use std::sync::mpsc::RecvTimeoutError::Timeout;
            self.done.recv_timeout(patience) != Err(Timeout)
        };
        if self.is_file() || self.rules.waits {
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
        for thread in &self.threads {
            let is_wanted = match thread.rules.kind {
                SinkKind::Terminal => true,
                SinkKind::Changes | SinkKind::Stream => sample.changed,
                SinkKind::Checkpoint => false,
            };
            if is_wanted {
                thread.offer(Message::Sample(sample.clone()), limit);
            }
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
            if thread.rules.waits
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
        let new = self.threads.iter_mut().filter(|thread| !thread.is_failure_told);
        let failure = |thread: &mut SinkThread| {
            let reason = thread.shared.failure()?;
            thread.is_failure_told = true;
            Some((thread.rules.name.clone(), reason))
        };
        new.filter_map(failure).collect()
    }

    fn losses(&self) -> Vec<SinkLoss> {
        let loss = |thread: &SinkThread| SinkLoss {
            sink: thread.rules.name.clone(),
            lost: thread.shared.lost.load(Ordering::Relaxed),
            failure: thread.shared.failure(),
            is_file: thread.is_file(),
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
        let is_abandoned = shared.is_abandoned.load(Ordering::Relaxed);
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
}

fn give(sink: &mut dyn Sink, message: &Message) -> Result<(), SinkError> {
    match message {
        Message::Sample(sample) => sink.sample(sample),
        Message::Notice(notice) => sink.notice(notice),
        Message::Save(checkpoint) => sink.save(checkpoint, false),
        Message::Flush(_) => Ok(()),
    }
}
