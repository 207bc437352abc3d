//! Frames and events for every viewer, and the last minute for those that come later.

use serde_json::Value;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::broadcast::{self, Receiver, Sender};

/// The number of messages that a viewer may be behind before it loses some: about three seconds.
const BEHIND: usize = 64;
/// The number of frames that a new viewer gets at once: about a minute.
const KEPT_FRAMES: usize = 1200;
/// The number of events that are kept.
const KEPT_EVENTS: usize = 10_000;

/// A message to viewers.
#[derive(Clone, Debug)]
pub enum Message {
    /// Some samples of all signals; see [`Frame`].
    Frame(Arc<[u8]>),
    /// An event, or the state of the diagnosis, as JSON.
    Text(Arc<str>),
}

/// Consecutive samples: the number of the first one (u64), how many there are and how many signals each has (u32),
/// then the values (f32), all little-endian.
pub struct Frame {
    first: u64,
    width: usize,
    values: Vec<f32>,
}

impl Frame {
    /// An empty frame that begins with a sample.
    pub fn new(first: u64, width: usize) -> Self {
        Frame { first, width, values: vec![] }
    }

    /// The values, to be appended to sample by sample.
    pub fn values(&mut self) -> &mut Vec<f32> {
        &mut self.values
    }

    /// The number of samples.
    pub fn samples(&self) -> usize {
        self.values.len() / self.width.max(1)
    }

    /// The bytes that a viewer gets.
    pub fn bytes(&self) -> Arc<[u8]> {
        let mut bytes = Vec::with_capacity(16 + 4 * self.values.len());
        bytes.extend(self.first.to_le_bytes());
        bytes.extend((self.samples() as u32).to_le_bytes());
        bytes.extend((self.width as u32).to_le_bytes());
        bytes.extend(self.values.iter().flat_map(|value| value.to_le_bytes()));
        bytes.into()
    }
}

#[derive(Default)]
struct Kept {
    frames: VecDeque<Arc<[u8]>>,
    events: VecDeque<Value>,
    state: Value,
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
pub struct Begin {
    /// The last frames.
    pub frames: Vec<Arc<[u8]>>,
    /// All events that are kept.
    pub events: Vec<Value>,
    /// The present state of the diagnosis.
    pub state: Value,
    /// Everything that comes later.
    pub later: Receiver<Message>,
}

impl Feed {
    fn kept(&self) -> MutexGuard<'_, Kept> {
        // A panic while it was held leaves at most a frame too few.
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Publishes a frame.
    pub fn frame(&self, frame: &Frame) {
        let bytes = frame.bytes();
        let mut kept = self.kept();
        kept.frames.push_back(bytes.clone());
        if kept.frames.len() > KEPT_FRAMES {
            kept.frames.pop_front();
        }
        // Without a viewer nobody receives it, which is no error.
        let _ = self.sender.send(Message::Frame(bytes));
    }

    /// Publishes an event.
    pub fn event(&self, event: Value) {
        let mut kept = self.kept();
        let text = serde_json::json!({ "event": event }).to_string();
        kept.events.push_back(event);
        if kept.events.len() > KEPT_EVENTS {
            kept.events.pop_front();
        }
        let _ = self.sender.send(Message::Text(text.into()));
    }

    /// Publishes the state of the diagnosis if it is new.
    pub fn state(&self, state: Value) {
        let mut kept = self.kept();
        if kept.state != state {
            let text = serde_json::json!({ "state": state }).to_string();
            kept.state = state;
            let _ = self.sender.send(Message::Text(text.into()));
        }
    }

    /// Forgets the frames of an earlier flight; events stay.
    pub fn forget_frames(&self) {
        self.kept().frames.clear();
    }

    /// What there is, and everything later, without a gap.
    pub fn begin(&self) -> Begin {
        let kept = self.kept();
        Begin {
            frames: kept.frames.iter().cloned().collect(),
            events: kept.events.iter().cloned().collect(),
            state: kept.state.clone(),
            later: self.sender.subscribe(),
        }
    }

    /// The events that are kept.
    pub fn events(&self) -> Vec<Value> {
        self.kept().events.iter().cloned().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use tokio::sync::broadcast::error::TryRecvError;

    fn frame(first: u64) -> Frame {
        let mut frame = Frame::new(first, 2);
        frame.values().extend([1.0, f32::NAN, 3.0, 4.0]);
        frame
    }

    #[test]
    fn a_frame_says_where_it_begins_and_how_large_it_is() {
        let bytes = frame(7).bytes();
        assert_eq!(bytes[..8], 7u64.to_le_bytes());
        assert_eq!(bytes[8..16], [2, 0, 0, 0, 2, 0, 0, 0]);
        assert_eq!(bytes.len(), 16 + 4 * 4);
    }

    #[test]
    fn a_late_viewer_gets_what_was_and_what_comes_without_a_gap() {
        let feed = Feed::default();
        feed.frame(&frame(0));
        feed.event(json!("before"));
        let mut begin = feed.begin();
        feed.frame(&frame(2));
        assert_eq!((begin.frames.len(), begin.events), (1, vec![json!("before")]));
        assert!(matches!(begin.later.try_recv(), Ok(Message::Frame(bytes)) if bytes[0] == 2));
        assert!(matches!(begin.later.try_recv(), Err(TryRecvError::Empty)));
    }

    #[test]
    fn a_slow_viewer_loses_frames_and_is_told_how_many() {
        let feed = Feed::default();
        let mut begin = feed.begin();
        (0..BEHIND as u64 + 10).for_each(|k| feed.frame(&frame(k)));
        assert!(matches!(begin.later.try_recv(), Err(TryRecvError::Lagged(10))));
        assert_eq!(feed.begin().frames.len(), BEHIND + 10, "the flight lost none");
    }

    #[test]
    fn a_state_is_told_once() {
        let feed = Feed::default();
        let mut begin = feed.begin();
        (0..3).for_each(|_| feed.state(json!({ "alarm": "normal" })));
        assert!(begin.later.try_recv().is_ok());
        assert!(begin.later.try_recv().is_err());
    }
}
