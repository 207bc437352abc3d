//! The flight that viewers watch: in closed loop and in real time, beside a ghost that flies the same without a
//! diagnosis.

use crate::feed::{Feed, Frame, Source};
use crate::injection::Injection;
use crate::request::{Refused, Request};
use crate::signals::Signals;
use serde_json::{Value, json};
use servotwin::flight::closed_loop::{Action, Flight, Scenario};
use servotwin::flight::runtime::RuntimeError;
use servotwin::study::Study;
use servotwin_diagnosis::classifiers::Model;
use servotwin_diagnosis::diagnoser::{Counts, Diagnoser, Outcome};
use servotwin_diagnosis::hierarchy::Stage;
use servotwin_model::program::FaultAt;
use servotwin_model::signal::Piecewise;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::{Duration, Instant};

/// A flight that is later than this gives up catching up, and says so.
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

impl Source for Live {
    fn about(&self) -> Value {
        let system = &self.study.system;
        let faults = system.fault_list();
        let components = system.network().components.iter().map(|instance| {
            let own = faults.iter().filter(|fault| fault.component == instance.id);
            let own = own.map(|fault| json!({ "id": fault.id, "summary": fault.summary }));
            let spec = instance.component.spec();
            json!({
                "id": instance.id, "kind": spec.kind, "summary": spec.summary,
                "faults": own.collect::<Vec<_>>(),
            })
        });
        json!({
            "title": system.title,
            "period_s": self.diagnoser.period_s,
            "actuators": self.diagnoser.names().actuators,
            "signals": Signals::of(&self.study, &self.diagnoser).list,
            "components": components.collect::<Vec<_>>(),
            "version": env!("CARGO_PKG_VERSION"),
        })
    }

    /// Flies until `stop` is set, one flight after the other.
    fn run(
        &self,
        feed: &Feed,
        requests: &Receiver<Request>,
        stop: &AtomicBool,
    ) -> Result<(), RuntimeError> {
        let signals = Signals::of(&self.study, &self.diagnoser);
        loop {
            let scenario = |reacts| Scenario {
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
                flight: Flight::new(&with, &self.diagnoser)?,
                ghost: Flight::new(&without, &self.diagnoser)?,
                injections: vec![],
                acting: vec![],
                actions: vec![],
                frame: Frame::new(0, signals.list.len()),
                sample: 0,
                shown: None,
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
    flight: Flight<'f>,
    ghost: Flight<'f>,
    injections: Vec<Injection>,
    /// The faults as they act on the plant now.
    acting: Vec<FaultAt>,
    actions: Vec<Action>,
    frame: Frame,
    sample: u64,
    /// The outcome that viewers know.
    shown: Option<Outcome>,
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
                    let time_s = self.sample as f64 * self.live.diagnoser.period_s;
                    match inject.injection(&self.live.study.system, time_s) {
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
                Ok(Request::Speed(_) | Request::Jump(_)) => {
                    self.event("refused", json!({ "why": Refused::NotAReplay.to_string() }));
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
        let time_s = self.sample as f64 * self.live.diagnoser.period_s;
        let acting: Vec<FaultAt> = self.injections.iter().map(|one| one.at(time_s)).collect();
        if acting != self.acting {
            self.flight.inject(acting.clone());
            self.ghost.inject(acting.clone());
            self.acting = acting;
        }
        let change = self.flight.sample()?;
        self.ghost.sample()?;
        if let Some(action) = self.flight.react()? {
            self.tell_action(&action);
            self.actions.push(action);
        }
        if let Some(change) = change {
            let finding = self.live.diagnoser.describe(change.finding);
            let about = json!({
                "alarm": change.alarm, "finding": finding, "confidence": change.confidence,
            });
            self.event("finding", about);
        }
        self.signals.fill(&self.flight, &self.ghost, self.frame.values());
        self.sample += 1;
        if self.frame.is_full(self.live.diagnoser.period_s) {
            self.feed.frame(&self.frame);
            self.frame = Frame::new(self.sample, self.signals.list.len());
            self.tell_new_outcome();
        }
        Ok(())
    }

    /// When the first fault was injected that still acts, s.
    fn onset_s(&self) -> Option<f64> {
        self.injections.iter().map(|one| one.since_s).reduce(f64::min)
    }

    fn tell_action(&self, action: &Action) {
        let (actuator, command, detail) = self.named(action);
        let after_s = self.onset_s().map(|onset_s| action.time_s - onset_s);
        let about = json!({
            "actuator": actuator, "command": command, "detail": detail, "after_s": after_s,
        });
        self.event("action", about);
    }

    fn named(&self, action: &Action) -> (&str, &str, Option<&str>) {
        let (names, raised) = (self.live.diagnoser.names(), &action.raised);
        let detail = raised.detail.map(|detail| names.details[detail as usize].as_str());
        let actuator = &names.actuators[raised.actuator as usize];
        (actuator, &names.actions[raised.action as usize], detail)
    }

    fn event(&self, kind: &str, about: Value) {
        let mut event = json!({ "time_s": self.flight.time_s(), "kind": kind });
        if let (Some(event), Value::Object(about)) = (event.as_object_mut(), about) {
            event.extend(about);
        }
        self.feed.event(&event);
    }

    /// Publishes the state if the outcome changed in more than its sample number and its counts: most frames lie within
    /// a window, and the path through the trees is long.
    fn tell_new_outcome(&mut self) {
        let outcome = self.flight.session().outcome();
        let shown = Some(Outcome { sample: 0, counts: Counts::default(), ..*outcome });
        if self.shown != shown {
            self.shown = shown;
            self.tell_state();
        }
    }

    fn tell_state(&self) {
        let outcome = self.flight.session().outcome();
        let sensors = &self.live.diagnoser.sensors;
        let injected = self.injections.iter().map(|Injection { name, fault, onset, since_s }| {
            json!({
                "fault": name, "intensity": fault.intensity, "onset": onset, "since_s": since_s,
            })
        });
        let actions = self.actions.iter().map(|action| {
            let (actuator, command, detail) = self.named(action);
            json!({
                "time_s": action.time_s, "actuator": actuator, "command": command, "detail": detail,
            })
        });
        // Confidence moves with every window: what a viewer reads needs no more than a percent.
        let confidence = (100.0 * outcome.confidence).round() / 100.0;
        self.feed.state(&json!({
            "alarm": outcome.alarm,
            "finding": self.live.diagnoser.describe(outcome.finding),
            "confidence": confidence,
            "worst_sensor": outcome.worst_sensor.map(|s| &sensors[s as usize].name),
            "injected": injected.collect::<Vec<_>>(),
            "actions": actions.collect::<Vec<_>>(),
            "path": self.path(),
            "is_paused": self.is_paused,
        }));
    }

    /// The stages that the trees passed through in the window that decided, each with its decisions from root to leaf.
    fn path(&self) -> Value {
        let session = self.flight.session();
        let Some(length) = session.outcome().length else { return Value::Null };
        let Ok(stages) = session.explain(length as usize) else { return Value::Null };
        let rows = session.features(length as usize);
        let features = &self.live.diagnoser.names().features;
        let stages = stages.into_iter().map(|(stage, nodes)| {
            // Actuators share stages, each with its own view; the view of the path is the one that leads along it.
            let row = rows.iter().find(|row| stage.path(row) == nodes);
            json!({ "stage": stage.id, "steps": steps(stage, &nodes, row, features) })
        });
        stages.collect()
    }
}

/// The decisions of a stage along a path.
fn steps(stage: &Stage, nodes: &[usize], row: Option<&Vec<f64>>, features: &[String]) -> Value {
    let (Model::Cart(tree), Some(row)) = (&stage.model, row) else { return json!([]) };
    let splits = nodes.iter().filter_map(|&node| tree.split(node));
    let step = |(column, threshold): (usize, f64)| {
        let place = stage.columns[column] as usize;
        json!({ "feature": features[place], "value": row[place], "threshold": threshold })
    };
    splits.map(step).collect()
}
