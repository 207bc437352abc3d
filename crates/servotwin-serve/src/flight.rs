//! The flight that viewers watch: in closed loop and in real time, beside a ghost that flies the same without a
//! diagnosis.

use crate::feed::{Feed, FeedError, Frames, LiveSource};
use crate::injection::Injection;
use crate::request::Request;
use crate::signals::{ShownSample, Signals};
use crate::state::{SourceKind, about, named, state};
use serde_json::{Value, json};
use servotwin::live::closed_loop::{ClosedLoop, ClosedLoopFlight};
use servotwin::live::runtime::RuntimeError;
use servotwin::study::Study;
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_model::program::FaultAt;
use servotwin_model::signal::Piecewise;
use servotwin_watch::player::{PlayerSignal, event};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::{Duration, Instant};

/// A flight that is later than this gives up catching up, and reports it.
const TOO_LATE: Duration = Duration::from_millis(500);
/// The time after which a paused flight looks for requests again.
const PAUSED: Duration = Duration::from_millis(20);

/// What flies.
pub struct Live {
    /// The study of plant and twin.
    pub study: Study,
    /// The diagnosis.
    pub diagnoser: Arc<Diagnoser>,
    /// One signal for each input of the system.
    pub inputs: Vec<Piecewise>,
    /// The duration after which a new flight begins, s.
    pub duration_s: f64,
    /// The number of the specimen; `None` for one that equals its twin.
    pub specimen: Option<usize>,
}

/// Whether a flight ended to begin anew, or for good.
#[derive(PartialEq, Eq)]
enum End {
    Restart,
    Stop,
}

impl LiveSource for Live {
    fn about(&self) -> Value {
        about(
            SourceKind::Flight,
            &self.study.system.title,
            &self.study,
            &self.diagnoser,
            &self.signals(),
        )
    }

    fn signals(&self) -> Vec<PlayerSignal> {
        Signals::of_flights(&self.study, &self.diagnoser).list
    }

    /// Flies until `stop` is set, one flight after the other.
    fn run(
        &self,
        feed: &Feed,
        requests: &Receiver<Request>,
        stop: &AtomicBool,
    ) -> Result<(), FeedError> {
        let signals = Signals::of_flights(&self.study, &self.diagnoser);
        loop {
            let scenario = |reacts| ClosedLoop {
                study: &self.study,
                inputs: self.inputs.clone(),
                faults: vec![],
                duration_s: self.duration_s,
                specimen: self.specimen,
                reacts,
            };
            let (with, without) = (scenario(true), scenario(false));
            let mut flown = Flown {
                live: self,
                feed,
                signals: &signals,
                flight: ClosedLoopFlight::new(&with, &self.diagnoser)?,
                ghost: ClosedLoopFlight::new(&without, &self.diagnoser)?,
                injections: vec![],
                acting: vec![],
                actions: vec![],
                frames: Frames::new(signals.list.len(), self.diagnoser.period_s),
                is_paused: false,
            };
            if flown.until_the_end(requests, stop)? == End::Stop {
                return Ok(());
            }
            feed.begin_flight();
        }
    }
}

/// A flight under way.
struct Flown<'f> {
    live: &'f Live,
    feed: &'f Feed,
    signals: &'f Signals,
    flight: ClosedLoopFlight<'f>,
    ghost: ClosedLoopFlight<'f>,
    injections: Vec<Injection>,
    /// The faults as they act on the plant now.
    acting: Vec<FaultAt>,
    actions: Vec<Value>,
    frames: Frames,
    is_paused: bool,
}

impl Flown<'_> {
    fn until_the_end(
        &mut self,
        requests: &Receiver<Request>,
        stop: &AtomicBool,
    ) -> Result<End, RuntimeError> {
        let period = Duration::from_secs_f64(self.live.diagnoser.period_s);
        self.event("begin", json!({}));
        let mut next = Instant::now();
        while self.flight.time_s() < self.live.duration_s {
            if stop.load(Ordering::Relaxed) {
                return Ok(End::Stop);
            }
            if self.take(requests) == Some(End::Restart) {
                return Ok(End::Restart);
            }
            if self.is_paused {
                std::thread::sleep(PAUSED);
                next = Instant::now();
                continue;
            }
            self.advance()?;
            next += period;
            let now = Instant::now();
            if let Some(late) = now.checked_duration_since(next).filter(|late| *late > TOO_LATE) {
                self.event("late", json!({ "by_s": late.as_secs_f64() }));
                next = now;
            }
            std::thread::sleep(next.saturating_duration_since(now));
        }
        Ok(End::Restart)
    }

    /// Carries out the requests that wait.
    fn take(&mut self, requests: &Receiver<Request>) -> Option<End> {
        loop {
            match requests.try_recv() {
                Ok(Request::Restart(_)) => return Some(End::Restart),
                Ok(Request::Pause(is_paused)) => {
                    self.is_paused = is_paused;
                    self.event(if is_paused { "pause" } else { "go_on" }, json!({}));
                    self.tell_state();
                }
                Ok(Request::Inject(inject)) => {
                    match inject.injection(&self.live.study.system, self.frames.next_s()) {
                        Ok(injection) => self.inject(injection),
                        Err(refused) => {
                            self.event("refused", json!({ "why": refused.to_string() }))
                        }
                    }
                }
                Ok(Request::Remove(name)) => {
                    self.injections.retain(|one| one.name != name);
                    self.event("remove", json!({ "fault": name }));
                    self.tell_state();
                }
                Err(TryRecvError::Empty | TryRecvError::Disconnected) => return None,
            }
        }
    }

    fn inject(&mut self, injection: Injection) {
        let Injection { name, fault, onset, .. } = &injection;
        let about = json!({ "fault": name, "intensity": fault.intensity, "onset": onset });
        self.event("inject", about);
        match self.injections.iter_mut().find(|one| one.name == injection.name) {
            Some(known) => *known = injection,
            None => self.injections.push(injection),
        }
        self.tell_state();
    }

    fn advance(&mut self) -> Result<(), RuntimeError> {
        let time_s = self.frames.next_s();
        let acting: Vec<FaultAt> = self.injections.iter().map(|one| one.at(time_s)).collect();
        if acting != self.acting {
            self.flight.inject(acting.clone());
            self.ghost.inject(acting.clone());
            self.acting = acting;
        }
        let change = self.flight.sample()?;
        self.ghost.sample()?;
        let action = self.flight.react()?;
        if let Some(action) = &action {
            let mut about = named(&self.live.diagnoser, &action.raised);
            about["after_s"] = json!(self.onset_s().map(|onset_s| action.time_s - onset_s));
            let event = event(action.time_s, "action", about);
            self.feed.event(&event);
            self.actions.push(event);
        }
        if let Some(change) = change {
            let finding = self.live.diagnoser.describe(change.finding);
            let about = json!({
                "alarm": change.alarm, "finding": finding, "confidence": change.confidence,
            });
            self.event("finding", about);
        }
        let raised = action.map(|action| action.raised);
        let sample = ShownSample { flight: &self.flight, ghost: &self.ghost, raised };
        if self.frames.take(self.feed, |values| self.signals.fill(&sample, values)) {
            self.tell_state();
        }
        Ok(())
    }

    /// When the first fault was injected that still acts, s.
    fn onset_s(&self) -> Option<f64> {
        self.injections.iter().map(|one| one.since_s).reduce(f64::min)
    }

    fn event(&self, kind: &str, about: Value) {
        self.feed.event(&event(self.flight.time_s(), kind, about));
    }

    fn tell_state(&self) {
        let Flown { flight, actions, injections, is_paused, .. } = self;
        self.feed.state(&state(flight.session(), actions, injections, *is_paused));
    }
}
