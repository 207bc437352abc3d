//! An actuator that is measured: a log that is read, or a stream that is watched as it comes.

use crate::feed::{Feed, Frames, LiveSource, RunError};
use crate::request::{Refused, Request};
use crate::session::SavedSession;
use crate::signals::{Beside, ShownSample, Signals};
use crate::state::{Act, KnownOutcome, SourceKind, State, about, event};
use serde_json::{Value, json};
use servotwin::flight::watcher::Watcher;
use servotwin::moment;
use servotwin::observer::{Observation, Observer};
use servotwin::study::Study;
use servotwin_diagnosis::diagnoser::{Alarm, Diagnoser, IndexedFinding};
use servotwin_model::lanes::Level;
use servotwin_watch::counts::WatchCounts;
use servotwin_watch::map::Map;
use servotwin_watch::sink::{self, Sink, SinkError};
use servotwin_watch::source::Source as Rows;
use servotwin_watch::watchdog::{Notice, WatchEvent, WatchdogRules};
use servotwin_watch::{End, Watch};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

/// The longest session of a stream; then the next one begins, s.
const LONGEST_S: f64 = 3600.0;
/// The time after which a stream at its end looks for requests again.
const PAUSED: Duration = Duration::from_millis(20);

/// An actuator that is measured, and how its columns are read.
pub struct Measured<'s> {
    /// A line that names the actuator.
    pub title: String,
    /// The study of its twin.
    pub study: &'s Study,
    /// The diagnosis.
    pub diagnoser: Arc<Diagnoser>,
    /// Which column is which signal.
    pub map: Map,
    /// The range in which the diagnosis accepts each input, SI.
    pub accepted_ranges: Vec<(f64, f64)>,
}

/// What was read of a log.
pub struct Log {
    /// All of it; `None` if it has too many events and states.
    pub session: Option<SavedSession>,
    /// How reading ended.
    pub end: End,
    /// What was counted.
    pub counts: WatchCounts,
}

impl Measured<'_> {
    fn about(&self, kind: SourceKind) -> Value {
        let list = Signals::of_measured(self.study, &self.diagnoser).list;
        about(kind, &self.title, self.study, &self.diagnoser, &list)
    }

    /// Reads a log to its end, or until `stop` is set. `show` gets the time, s, and the share read so far.
    ///
    /// # Errors
    /// The log cannot be read, or the diagnosis does not fit the study.
    pub fn read(
        &self,
        rows: &mut dyn Rows,
        stop: &AtomicBool,
        show: &mut dyn FnMut(f64, Option<f64>),
    ) -> Result<Log, RunError> {
        let feed = Feed::default();
        let (end, counts) = self.watch(rows, &feed, (stop, None), show)?;
        let about = self.about(SourceKind::Log);
        let session = feed.session().map(|messages| SavedSession { about, messages });
        Ok(Log { session, end, counts })
    }

    /// Watches a log or, with rules for its silence, a stream.
    fn watch(
        &self,
        rows: &mut dyn Rows,
        feed: &Feed,
        (stop, silence): (&AtomicBool, Option<WatchdogRules>),
        show: &mut dyn FnMut(f64, Option<f64>),
    ) -> Result<(End, WatchCounts), RunError> {
        let (period_s, system) = (self.diagnoser.period_s, &self.study.system);
        let signals = Signals::of_measured(self.study, &self.diagnoser);
        let mut screen = Screen {
            watcher: Watcher::new(self.study, self.diagnoser.clone())?,
            feed,
            signals: &signals,
            frames: Frames::new(signals.list.len(), period_s),
            known: KnownOutcome::default(),
            told: None,
            actions: vec![],
            longest_s: silence.map_or(f64::INFINITY, |_| LONGEST_S),
        };
        let mut notices = Notices { feed, period_s };
        let mut watch = Watch::new(rows, &self.map, &mut screen, period_s);
        watch.expect(self.study, &self.accepted_ranges);
        if let Some(rules) = silence {
            watch.watchdog(rules);
        }
        watch.sink(&mut notices);
        let end = watch.run(stop, show)?;
        let counts = watch.counts().clone();
        let doubts = watch.plausibility().sentences(system, &self.map, period_s, &counts);
        drop(watch);
        screen.end(doubts);
        Ok((end, counts))
    }
}

/// A stream that is watched as it comes.
pub struct Stream<'s> {
    measured: Measured<'s>,
    rows: Mutex<Box<dyn Rows>>,
    silence: WatchdogRules,
}

impl<'s> Stream<'s> {
    /// A stream that is open already, and when it counts as silent.
    pub fn new(measured: Measured<'s>, rows: Box<dyn Rows>, silence: WatchdogRules) -> Self {
        Stream { measured, rows: Mutex::new(rows), silence }
    }
}

impl LiveSource for Stream<'_> {
    fn about(&self) -> Value {
        self.measured.about(SourceKind::Stream)
    }

    fn run(
        &self,
        feed: &Feed,
        requests: &Receiver<Request>,
        stop: &AtomicBool,
    ) -> Result<(), RunError> {
        // Only a run that panicked leaves it poisoned, and its server has ended.
        let mut rows = self.rows.lock().unwrap_or_else(PoisonError::into_inner);
        let system = &self.measured.study.system;
        let refused = || {
            let now_s = feed.now_s(self.measured.diagnoser.period_s);
            event(now_s, "refused", json!({ "why": Refused::Measured.to_string() }))
        };
        let refuse = || requests.try_iter().for_each(|_| feed.event(&refused()));
        thread::scope(|scope| {
            scope.spawn(|| system.compiled.steps(&system.program, Level::Single));
            let silence = Some(self.silence);
            let mut show = |_: f64, _: Option<f64>| refuse();
            let watched = self.measured.watch(&mut **rows, feed, (stop, silence), &mut show);
            system.compiled.give_up();
            watched
        })?;
        // Viewers may read on when the stream has ended.
        while !stop.load(Ordering::Relaxed) {
            refuse();
            thread::sleep(PAUSED);
        }
        Ok(())
    }
}

/// The observer that shows what it observes.
struct Screen<'w, 's> {
    watcher: Watcher<'s>,
    feed: &'w Feed,
    signals: &'w Signals,
    frames: Frames,
    known: KnownOutcome,
    /// Alarm and finding that viewers received; `None` before the first sample.
    told: Option<(Alarm, IndexedFinding)>,
    actions: Vec<Act>,
    longest_s: f64,
}

impl Screen<'_, '_> {
    fn event(&self, kind: &str, about: Value) {
        self.feed.event(&event(self.frames.next_s(), kind, about));
    }

    fn show(&mut self, time_s: f64, inputs: &[f64]) {
        let is_over = self.frames.next_s() >= self.longest_s;
        if is_over {
            self.frames.publish(self.feed);
            self.frames = Frames::new(self.signals.list.len(), self.watcher.period_s());
            self.known = KnownOutcome::default();
            self.feed.begin_flight();
        }
        if is_over || self.told.is_none() {
            self.event("begin", json!({ "at": moment::shown(time_s) }));
        }
        self.tell_finding(time_s);
        self.tell_action(time_s);
        let runtime = self.watcher.runtime();
        let sample = ShownSample {
            inputs,
            measured: self.watcher.measured(),
            expected: runtime.expected(),
            session: runtime.session(),
            raised: self.watcher.outcome().and_then(|outcome| outcome.raised),
            beside: Beside::Twin(runtime),
        };
        let is_sent = self.frames.take(self.feed, |values| self.signals.fill(&sample, values));
        if is_sent && self.known.is_new(self.watcher.outcome()) {
            self.tell_state();
        }
    }

    /// Publishes the finding of the last sample if it is new.
    fn tell_finding(&mut self, time_s: f64) {
        let outcome = self.watcher.outcome();
        let told =
            outcome.map_or((Alarm::Error, IndexedFinding::Unjudged), |o| (o.alarm, o.finding));
        if self.told == Some(told) {
            return;
        }
        let words = match outcome {
            Some(outcome) => self.diagnoser().describe(outcome.finding),
            None => self.watcher.observation().finding.evidence.join("; "),
        };
        let confidence = outcome.map(|outcome| outcome.confidence);
        let at = moment::shown(time_s);
        let about =
            json!({ "alarm": told.0, "finding": words, "confidence": confidence, "at": at });
        self.event("finding", about);
        self.told = Some(told);
    }

    /// Publishes the action of the last sample if it is new.
    fn tell_action(&mut self, time_s: f64) {
        let Some(raised) = self.watcher.outcome().and_then(|outcome| outcome.raised) else {
            return;
        };
        let said = |act: &Act| (act.raised.actuator, act.raised.action, act.raised.detail);
        let act = Act { time_s: self.frames.next_s(), raised };
        if self.actions.last().map(said) == Some(said(&act)) {
            return;
        }
        let mut about = act.named(self.diagnoser());
        about["at"] = json!(moment::shown(time_s));
        self.event("action", about);
        self.actions.push(act);
    }

    fn diagnoser(&self) -> &Diagnoser {
        self.watcher.runtime().session().diagnoser()
    }

    fn tell_state(&self) {
        let state = State {
            session: self.watcher.runtime().session(),
            is_judged: self.watcher.outcome().is_some(),
            actions: &self.actions,
            injections: &[],
            is_paused: false,
        };
        self.feed.state(&state.json());
    }

    /// Publishes what is left, and what speaks against the log or its map.
    fn end(mut self, doubts: Vec<String>) {
        self.frames.publish(self.feed);
        for doubt in doubts.into_iter().chain(self.watcher.wider_than_trained()) {
            self.event("doubt", json!({ "why": doubt }));
        }
        self.event("end", json!({}));
        self.tell_state();
    }
}

impl Observer for Screen<'_, '_> {
    fn push(&mut self, time_s: f64, inputs: &[f64], measured: &[f64]) -> Observation<'_> {
        self.watcher.push(time_s, inputs, measured);
        self.show(time_s, inputs);
        self.watcher.observation()
    }

    fn restart(&mut self) {
        self.watcher.restart();
        // One sample without values: charts draw it as a gap, however long it was.
        let width = self.signals.list.len();
        self.frames.take(self.feed, |values| values.extend(std::iter::repeat_n(f32::NAN, width)));
        self.told = None;
    }

    fn reset_alarm(&mut self) {
        self.watcher.reset_alarm();
    }

    fn save(&self) -> Vec<u8> {
        self.watcher.save()
    }

    fn restore(&mut self, saved: &[u8]) -> Result<(), String> {
        self.watcher.restore(saved)
    }
}

/// Shows what a watch reports besides the diagnosis: silence, lost connections.
struct Notices<'w> {
    feed: &'w Feed,
    period_s: f64,
}

impl Sink for Notices<'_> {
    fn sample(&mut self, _sample: &Arc<sink::Sample>) -> Result<(), SinkError> {
        Ok(())
    }

    fn notice(&mut self, notice: &Notice) -> Result<(), SinkError> {
        if let Some(words) = notice.words() {
            let about = json!({ "why": words, "at": notice.wall_time });
            self.feed.event(&event(self.feed.now_s(self.period_s), "notice", about));
        }
        match notice.event {
            WatchEvent::NoData => self.be_silent(true),
            WatchEvent::DataAgain => self.be_silent(false),
            _ => {}
        }
        Ok(())
    }
}

impl Notices<'_> {
    /// Marks in the state whether the stream is silent. The next state removes the mark.
    fn be_silent(&self, is_silent: bool) {
        let state: Result<Value, _> = serde_json::from_str(&self.feed.state_now());
        if let Ok(Value::Object(mut state)) = state {
            state.insert("is_silent".into(), is_silent.into());
            self.feed.state(&Value::Object(state));
        }
    }
}
