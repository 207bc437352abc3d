//! A watch as signals and events, for a page or for viewers.

use super::{Sample, Scene, Sink, SinkError};
use crate::player::{Screen, event};
use crate::watchdog::Notice;
use serde_json::{Value, json};
use servotwin::live::observer::{Finding, Phase};
use servotwin_io::moment;
use std::sync::Arc;

/// Shows command, inputs, residuals, measurements beside the twin, and findings on a screen.
#[derive(Debug)]
pub struct Watched<S> {
    scene: Scene,
    /// Where they are shown.
    pub screen: S,
    last: Finding,
}

impl<S: Screen> Watched<S> {
    /// Before the first sample of a scene.
    pub fn new(scene: Scene, screen: S) -> Self {
        Watched { scene, screen, last: Finding::default() }
    }

    /// The last finding.
    pub fn last(&self) -> &Finding {
        &self.last
    }

    fn event(&mut self, kind: &str, about: Value) {
        self.screen.event(event(self.screen.now_s(), kind, about));
    }

    /// Shows a finding, and the action that it raises.
    fn change(&mut self, time_s: f64, finding: &Finding) {
        let at = moment::shown(time_s);
        let last = std::mem::replace(&mut self.last, finding.clone());
        let action = |of: &Finding| {
            let is_raised = of.phase == Phase::Raised && !of.action.is_empty();
            let actuator = || of.actuator.clone().unwrap_or_default();
            is_raised.then(|| (actuator(), of.action.clone(), of.detail.clone()))
        };
        let raised = action(finding).filter(|raised| action(&last).as_ref() != Some(raised));
        if let Some((actuator, action, detail)) = raised {
            let about =
                json!({ "at": at, "actuator": actuator, "action": action, "detail": detail });
            self.event("action", about);
        }
        let Finding { state, confidence, evidence, .. } = finding;
        let about = json!({
            "at": at, "state": state, "finding": finding.words(), "confidence": confidence,
            "evidence": evidence,
        });
        self.event("finding", about);
    }
}

impl<S: Screen> Sink for Watched<S> {
    fn sample(&mut self, sample: &Arc<Sample>) -> Result<(), SinkError> {
        self.screen.begin(sample.time_s);
        if sample.changed {
            self.change(sample.time_s, &sample.finding);
        }
        self.screen.sample(self.scene.values(sample));
        Ok(())
    }

    fn notice(&mut self, notice: &Notice) -> Result<(), SinkError> {
        if let Some(why) = notice.words() {
            let at = notice.time_s.map(|time_s| format!("after {time_s:.2} s"));
            self.event(
                "notice",
                json!({ "at": at.as_ref().unwrap_or(&notice.wall_time), "why": why }),
            );
        }
        Ok(())
    }
}
