//! Frames and events for every viewer, and what is kept of them: the last minute for those that come later, and the
//! whole flight as a session.

use crate::request::Request;
use serde::Serialize;
use serde_json::Value;
use servotwin::live::runtime::RuntimeError;
use servotwin_watch::WatchError;
use servotwin_watch::player::PlayerSignal;
use std::collections::VecDeque;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;
use tokio::sync::broadcast::{self, Receiver, Sender};

/// The number of messages that a viewer may be behind before it loses some: about three seconds.
const BEHIND: usize = 64;
/// The number of frames that a new viewer gets at once: about a minute.
const KEPT_FRAMES: usize = 1200;
/// The number of events that are kept.
const KEPT_EVENTS: usize = 10_000;
/// The number of events and states in a session. An hour has far fewer, unless a viewer sends requests without end.
const MAX_SESSION_TEXTS: usize = 100_000;
/// Time between frames, s.
const FRAME_S: f64 = 0.05;

/// Why a source ended early.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub enum FeedError {
    /// Plant or twin cannot be simulated.
    Simulation(#[from] RuntimeError),
    /// A log or a stream cannot be read.
    Watch(#[from] WatchError),
}

/// What a server shows: a flight or a stream.
pub trait LiveSource: Sync {
    /// Everything that a viewer must know to show frames, and to inject faults.
    fn about(&self) -> Value;

    /// The signals of a frame.
    fn signals(&self) -> Vec<PlayerSignal>;

    /// Fills the feed until `stop` is set.
    ///
    /// # Errors
    /// Plant or twin cannot be simulated, or a stream cannot be read.
    fn run(
        &self,
        feed: &Feed,
        requests: &mpsc::Receiver<Request>,
        stop: &AtomicBool,
    ) -> Result<(), FeedError>;
}

/// A message to viewers.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// Some samples of all signals; see [`Frames`].
    Frame(Arc<[u8]>),
    /// An event, as JSON.
    Event(Arc<str>),
    /// The state of the diagnosis, as JSON.
    State(Arc<str>),
}

/// Samples that wait to be published. A frame is consecutive samples: the number of the first one (u64), how many there
/// are and how many signals each has (u32), then the values (f32), all little-endian.
pub(crate) struct Frames {
    first: u64,
    width: usize,
    period_s: f64,
    values: Vec<f32>,
}

impl Frames {
    /// Before the first sample, with the number of signals and the sampling period, s.
    pub(crate) fn new(width: usize, period_s: f64) -> Self {
        Frames { first: 0, width, period_s, values: vec![] }
    }

    /// The number of samples that wait.
    fn samples(&self) -> usize {
        self.values.len() / self.width.max(1)
    }

    /// The time of the next sample, s.
    pub(crate) fn next_s(&self) -> f64 {
        (self.first + self.samples() as u64) as f64 * self.period_s
    }

    /// Takes the values that `fill` appends for one sample. Returns whether a frame was published.
    pub(crate) fn take(&mut self, feed: &Feed, fill: impl FnOnce(&mut Vec<f32>)) -> bool {
        fill(&mut self.values);
        let is_full = self.samples() as f64 * self.period_s >= FRAME_S - 1e-9;
        if is_full {
            self.publish(feed);
        }
        is_full
    }

    /// Publishes the samples that wait, if there are any.
    pub(crate) fn publish(&mut self, feed: &Feed) {
        if self.samples() > 0 {
            feed.publish(self.frame());
            self.first += self.samples() as u64;
            self.values.clear();
        }
    }

    fn frame(&self) -> Message {
        let mut bytes = Vec::with_capacity(16 + 4 * self.values.len());
        bytes.extend(self.first.to_le_bytes());
        bytes.extend((self.samples() as u32).to_le_bytes());
        bytes.extend((self.width as u32).to_le_bytes());
        bytes.extend(self.values.iter().flat_map(|value| value.to_le_bytes()));
        Message::Frame(bytes.into())
    }

    /// A frame of values that begins with a sample, for tests.
    #[cfg(test)]
    pub(crate) fn frame_of(first: u64, width: usize, values: &[f32]) -> Message {
        Frames { first, width, period_s: 0.01, values: values.to_vec() }.frame()
    }
}

/// The values in the bytes of a frame, sample by sample.
pub(crate) fn values_in(frame: &[u8]) -> impl Iterator<Item = f32> {
    let (values, _) = frame[16..].as_chunks::<4>();
    values.iter().map(|value| f32::from_le_bytes(*value))
}

/// The newest sample that viewers were sent, for measuring how late they show it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Newest {
    /// The number of the sample in its flight.
    pub(crate) sample: u64,
    /// When it was published, ms since 1970. It is no part of a session.
    pub(crate) unix_ms: f64,
}

impl Newest {
    fn of(frame: &[u8]) -> Self {
        // The number of the first sample, and how many there are.
        let number = |bytes: &[u8]| bytes.iter().rev().fold(0, |n, &byte| n << 8 | u64::from(byte));
        let sample = (number(&frame[..8]) + number(&frame[8..12])).saturating_sub(1);
        Newest { sample, unix_ms: unix_ms() }
    }
}

/// The time of the clock, ms since 1970.
fn unix_ms() -> f64 {
    let since_1970 = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    since_1970.map_or(f64::NAN, |time| 1e3 * time.as_secs_f64())
}

struct Kept {
    /// The frames, events and states of the present flight.
    session: Vec<Message>,
    session_texts: usize,
    events: VecDeque<Arc<str>>,
    state: Arc<str>,
    newest: Option<Newest>,
}

impl Default for Kept {
    fn default() -> Self {
        Kept {
            session: vec![],
            session_texts: 0,
            events: VecDeque::new(),
            state: Arc::from("null"),
            newest: None,
        }
    }
}

impl Kept {
    fn take(&mut self, message: Message) {
        match &message {
            Message::Frame(bytes) => {
                self.newest = Some(Newest::of(bytes));
                return self.session.push(message);
            }
            Message::Event(event) => {
                self.events.push_back(event.clone());
                if self.events.len() > KEPT_EVENTS {
                    self.events.pop_front();
                }
            }
            Message::State(state) => self.state = state.clone(),
        }
        self.session_texts += 1;
        if self.session_texts <= MAX_SESSION_TEXTS {
            self.session.push(message);
        }
    }
}

/// The feed of a flight.
pub struct Feed {
    sender: Sender<Message>,
    kept: Mutex<Kept>,
}

impl Default for Feed {
    fn default() -> Self {
        Feed { sender: broadcast::channel(BEHIND).0, kept: Mutex::default() }
    }
}

/// What a new viewer gets before it listens.
pub(crate) struct Begin {
    /// The last frames.
    pub(crate) frames: Vec<Arc<[u8]>>,
    /// All events that are kept, as a list in JSON.
    pub(crate) events: String,
    /// The present state of the diagnosis, as JSON.
    pub(crate) state: Arc<str>,
    /// Everything that comes later.
    pub(crate) later: Receiver<Message>,
}

impl Feed {
    fn kept(&self) -> MutexGuard<'_, Kept> {
        // A panic while it was held leaves at most a frame too few.
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Publishes a message.
    pub(crate) fn publish(&self, message: Message) {
        let mut kept = self.kept();
        kept.take(message.clone());
        // Without a viewer nobody receives it, which is no error.
        let _ = self.sender.send(message);
    }

    /// Publishes an event.
    pub(crate) fn event(&self, event: &Value) {
        self.publish(Message::Event(event.to_string().into()));
    }

    /// Publishes the state of the diagnosis if it is new.
    pub(crate) fn state(&self, state: &Value) {
        let state: Arc<str> = state.to_string().into();
        if self.state_now() != state {
            self.publish(Message::State(state));
        }
    }

    /// Forgets the frames and the state of an earlier flight; events stay.
    pub(crate) fn begin_flight(&self) {
        let mut kept = self.kept();
        let events = std::mem::take(&mut kept.events);
        *kept = Kept { events, ..Kept::default() };
    }

    /// What there is, and everything later, without a gap.
    pub(crate) fn begin(&self) -> Begin {
        let kept = self.kept();
        let frame = |message: &Message| match message {
            Message::Frame(bytes) => Some(bytes.clone()),
            _ => None,
        };
        let mut frames: Vec<_> =
            kept.session.iter().rev().filter_map(frame).take(KEPT_FRAMES).collect();
        frames.reverse();
        Begin {
            frames,
            events: json_list(&kept.events),
            state: kept.state.clone(),
            later: self.sender.subscribe(),
        }
    }

    /// The events that are kept, as a list in JSON.
    pub(crate) fn events(&self) -> String {
        json_list(&self.kept().events)
    }

    /// The present state of the diagnosis, as JSON.
    pub(crate) fn state_now(&self) -> Arc<str> {
        self.kept().state.clone()
    }

    /// The time of the flight that viewers have seen, with a sampling period in s.
    pub(crate) fn now_s(&self, period_s: f64) -> f64 {
        self.newest().map_or(0.0, |newest| (newest.sample + 1) as f64 * period_s)
    }

    /// The newest sample; `None` before the first frame of a flight.
    pub(crate) fn newest(&self) -> Option<Newest> {
        self.kept().newest
    }

    /// Frames, events and states of the present flight; `None` if there were more events and states than a session
    /// holds.
    pub(crate) fn session(&self) -> Option<Vec<Message>> {
        let kept = self.kept();
        (kept.session_texts <= MAX_SESSION_TEXTS).then(|| kept.session.clone())
    }
}

fn json_list(items: &VecDeque<Arc<str>>) -> String {
    let items: Vec<&str> = items.iter().map(|item| &**item).collect();
    format!("[{}]", items.join(","))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use tokio::sync::broadcast::error::TryRecvError;

    fn frame(first: u64) -> Message {
        Frames::frame_of(first, 2, &[1.0, f32::NAN, 3.0, 4.0])
    }

    #[test]
    fn a_frame_says_where_it_begins_and_how_large_it_is() {
        let Message::Frame(bytes) = frame(7) else { panic!("it is a frame") };
        assert_eq!(bytes[..8], 7u64.to_le_bytes());
        assert_eq!(bytes[8..16], [2, 0, 0, 0, 2, 0, 0, 0]);
        assert_eq!(bytes.len(), 16 + 4 * 4);
    }

    #[test]
    fn a_late_viewer_gets_what_was_and_what_comes_without_a_gap() {
        let feed = Feed::default();
        feed.publish(frame(0));
        feed.event(&json!("before"));
        let mut begin = feed.begin();
        feed.publish(frame(2));
        assert_eq!((begin.frames.len(), begin.events), (1, "[\"before\"]".into()));
        assert!(matches!(begin.later.try_recv(), Ok(Message::Frame(bytes)) if bytes[0] == 2));
        assert!(matches!(begin.later.try_recv(), Err(TryRecvError::Empty)));
    }

    #[test]
    fn a_slow_viewer_loses_frames_and_is_told_how_many() {
        let feed = Feed::default();
        let mut begin = feed.begin();
        (0..BEHIND as u64 + 10).for_each(|k| feed.publish(frame(k)));
        assert!(matches!(begin.later.try_recv(), Err(TryRecvError::Lagged(10))));
        assert_eq!(feed.begin().frames.len(), BEHIND + 10, "the flight lost none");
    }

    #[test]
    fn the_newest_sample_is_the_last_one_of_the_last_frame() {
        let feed = Feed::default();
        assert_eq!(feed.newest(), None);
        [0, 2].into_iter().for_each(|first| feed.publish(frame(first)));
        assert!(feed.newest().is_some_and(|newest| newest.sample == 3 && newest.unix_ms > 1.7e12));
        feed.begin_flight();
        assert_eq!(feed.newest(), None);
    }

    #[test]
    fn a_state_is_told_once() {
        let feed = Feed::default();
        let mut begin = feed.begin();
        (0..3).for_each(|_| feed.state(&json!({ "alarm": "normal" })));
        assert!(begin.later.try_recv().is_ok());
        assert!(begin.later.try_recv().is_err());
    }

    #[test]
    fn a_session_with_too_many_events_is_not_saved_in_part() {
        let feed = Feed::default();
        (0..MAX_SESSION_TEXTS).for_each(|k| feed.event(&json!(k)));
        assert_eq!(feed.session().map(|messages| messages.len()), Some(MAX_SESSION_TEXTS));
        feed.event(&json!("one more"));
        assert_eq!(feed.session(), None);
        feed.begin_flight();
        assert_eq!(feed.session(), Some(vec![]));
    }
}
