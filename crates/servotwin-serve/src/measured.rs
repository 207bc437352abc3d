//! An actuator that is measured: a stream that is watched as it comes.

use crate::feed::{Feed, FeedError, Frames, LiveSource};
use crate::request::{Refused, Request};
use crate::state::{SourceKind, about};
use serde_json::{Value, json};
use servotwin::live::observer::{DiagnosisState, Finding, Phase};
use servotwin::live::watcher::Watcher;
use servotwin::moment;
use servotwin::study::Study;
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_watch::Watch;
use servotwin_watch::guard::accepted_ranges;
use servotwin_watch::map::Map;
use servotwin_watch::player::{PlayerSignal, Screen, event};
use servotwin_watch::sink::{Sample, Scene, Sink, SinkError, Watched};
use servotwin_watch::source::Source as Rows;
use servotwin_watch::watchdog::{Notice, WatchEvent, WatchdogRules};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

/// The longest session of a stream; then the next one begins, s.
const LONGEST_S: f64 = 3600.0;
/// The time after which a stream at its end looks for requests again.
const PAUSED: Duration = Duration::from_millis(20);

/// A stream that is watched as it comes.
pub struct Stream<'s> {
    /// A line that names the actuator.
    pub title: String,
    /// The study of its twin.
    pub study: &'s Study,
    /// The diagnosis.
    pub diagnoser: Arc<Diagnoser>,
    /// Which column is which signal.
    pub map: Map,
    /// What is read; it is open already.
    pub rows: Mutex<Box<dyn Rows>>,
    /// When it counts as silent.
    pub silence: WatchdogRules,
}

impl Stream<'_> {
    fn scene(&self) -> Scene {
        Scene::of_study(&self.title, self.study, &self.diagnoser)
    }

    /// Watches the stream to its end, or until `stop` is set. `show` is called now and then.
    fn watch(
        &self,
        feed: &Feed,
        stop: &AtomicBool,
        show: &mut dyn FnMut(f64, Option<f64>),
    ) -> Result<(), FeedError> {
        let (period_s, system) = (self.diagnoser.period_s, &self.study.system);
        let (scene, width) = (self.scene(), self.signals().len());
        let frames = Frames::new(width, period_s);
        let screen = Viewers { feed, width, period_s, frames, last_s: f64::NAN, actions: vec![] };
        let mut shown = Shown { watched: Watched::new(scene, screen), has_state: false };
        let mut observer = Watcher::new(self.study, self.diagnoser.clone())?;
        // Only a run that panicked leaves it poisoned, and its server has ended.
        let mut rows = self.rows.lock().unwrap_or_else(PoisonError::into_inner);
        let mut watch = Watch::new(&mut **rows, &self.map, &mut observer, period_s);
        watch.expect(self.study, &accepted_ranges(&self.diagnoser, system));
        watch.watchdog(self.silence);
        watch.sink(&mut shown);
        watch.run(stop, show)?;
        let doubts = watch.doubts();
        drop(watch);
        let screen = &mut shown.watched.screen;
        screen.frames.publish(feed);
        for doubt in doubts.into_iter().chain(observer.wider_than_trained()) {
            screen.event(event(screen.now_s(), "doubt", json!({ "why": doubt })));
        }
        screen.event(event(screen.now_s(), "end", json!({})));
        Ok(())
    }
}

impl LiveSource for Stream<'_> {
    fn about(&self) -> Value {
        about(SourceKind::Stream, &self.title, self.study, &self.diagnoser, &self.signals())
    }

    fn signals(&self) -> Vec<PlayerSignal> {
        self.scene().signals
    }

    fn run(
        &self,
        feed: &Feed,
        requests: &Receiver<Request>,
        stop: &AtomicBool,
    ) -> Result<(), FeedError> {
        let system = &self.study.system;
        let refused = || {
            let now_s = feed.now_s(self.diagnoser.period_s);
            event(now_s, "refused", json!({ "why": Refused::Measured.to_string() }))
        };
        let refuse = || requests.try_iter().for_each(|_| feed.event(&refused()));
        let watch = || self.watch(feed, stop, &mut |_, _| refuse());
        system.compiled.beside(&system.program, watch)?;
        // Viewers may read on when the stream has ended.
        while !stop.load(Ordering::Relaxed) {
            refuse();
            thread::sleep(PAUSED);
        }
        Ok(())
    }
}

/// The viewers of a watch. Each session has its own time.
struct Viewers<'f> {
    feed: &'f Feed,
    width: usize,
    period_s: f64,
    frames: Frames,
    /// The time of the last sample, s.
    last_s: f64,
    /// The actions of this session.
    actions: Vec<Value>,
}

impl Screen for Viewers<'_> {
    fn begin(&mut self, time_s: f64) {
        let follows = (time_s - self.last_s - self.period_s).abs() < 0.5 * self.period_s;
        let is_over = self.now_s() >= LONGEST_S;
        if is_over {
            self.frames.publish(self.feed);
            self.frames = Frames::new(self.width, self.period_s);
            self.actions.clear();
            self.feed.begin_flight();
        } else if !follows && self.now_s() > 0.0 {
            // One sample without values: charts draw it as a gap, however long it was.
            self.sample(std::iter::repeat_n(f64::NAN, self.width));
        }
        if is_over || !follows {
            self.event(event(self.now_s(), "begin", json!({ "at": moment::shown(time_s) })));
        }
        self.last_s = time_s;
    }

    fn now_s(&self) -> f64 {
        self.frames.next_s()
    }

    fn event(&mut self, event: Value) {
        self.feed.event(&event);
        if event["kind"] == "action" {
            self.actions.push(event);
        }
    }

    fn sample(&mut self, values: impl IntoIterator<Item = f64>) {
        self.frames.take(self.feed, |out| out.extend(values.into_iter().map(|value| value as f32)));
    }
}

/// Shows a watch to viewers, with the state of its diagnosis.
struct Shown<'f> {
    watched: Watched<Viewers<'f>>,
    has_state: bool,
}

impl Shown<'_> {
    fn state(&self, finding: &Finding, is_silent: bool) {
        let alarm = match (finding.state, finding.phase) {
            (DiagnosisState::NoData | DiagnosisState::EnvironmentInvalid, _) => "error",
            (_, Phase::None) => "normal",
            (_, phase) => phase.words(),
        };
        let Viewers { feed, actions, .. } = &self.watched.screen;
        feed.state(&json!({
            "alarm": alarm, "finding": finding.words(), "actions": actions, "injected": [],
            "is_silent": is_silent,
        }));
    }
}

impl Sink for Shown<'_> {
    fn sample(&mut self, sample: &Arc<Sample>) -> Result<(), SinkError> {
        self.watched.sample(sample)?;
        if sample.changed || !self.has_state {
            self.state(&sample.finding, false);
            self.has_state = true;
        }
        Ok(())
    }

    fn notice(&mut self, notice: &Notice) -> Result<(), SinkError> {
        self.watched.notice(notice)?;
        match notice.event {
            WatchEvent::NoData => self.state(self.watched.last(), true),
            WatchEvent::DataAgain => self.state(self.watched.last(), false),
            _ => {}
        }
        Ok(())
    }
}
