//! The runtime as an observer of a log or a live stream.

use super::runtime::{self, Checkpoint, Runtime, RuntimeError};
use crate::live::observer::{DiagnosisState, Finding, Observation, Observer, Phase};
use crate::study::{Reaction, Scenario, Study};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::diagnoser::{
    Alarm, Diagnoser, IndexedFinding, Outcome, Raised, ScatterTest,
};
use servotwin_model::program::Slot;
use servotwin_model::solver::SolverSettings;
use std::sync::Arc;

/// Observes an actuator beside its twin. Inputs and sensor values are in the order of the system.
pub struct Watcher<'s> {
    diagnoser: Arc<Diagnoser>,
    runtime: Runtime<'s>,
    /// For each sensor of the diagnoser, its index in the system.
    places: Vec<usize>,
    slots: Vec<Slot>,
    scales: Vec<f64>,
    /// Names of the actuators.
    actuators: Vec<String>,
    /// The reaction that the log shows while an actuator is off, by actuator.
    off: Vec<Reaction>,
    /// Whether the inputs show an actuator off, by actuator.
    is_seen_off: Vec<bool>,
    measured: Vec<f64>,
    twin: Vec<f64>,
    residuals: Vec<f64>,
    /// The windows of healthy-looking stretches, compared with the scatter that the diagnoser was trained for.
    scatter: ScatterTest,
    /// Number of panes since the last window of the comparison.
    panes: u32,
    finding: Finding,
    last: Option<Outcome>,
}

/// The state of a watcher, as it is stored.
#[derive(Serialize, Deserialize)]
struct Stored {
    runtime: Checkpoint,
    is_seen_off: Vec<bool>,
    /// The last finding; `None` if there was none.
    finding: Option<Finding>,
    scatter: ScatterTest,
    panes: u32,
}

impl<'s> Watcher<'s> {
    /// Creates a runtime before its first sample.
    ///
    /// # Errors
    /// The diagnoser does not fit this study.
    pub fn new(study: &'s Study, diagnoser: Arc<Diagnoser>) -> Result<Self, RuntimeError> {
        // It refuses a diagnoser with a sensor that the system does not have.
        let runtime = Runtime::new(study, diagnoser.clone(), vec![])?;
        let sensors = &study.system.sensors;
        let place = |name: &str| sensors.iter().position(|sensor| sensor.id == name);
        let places = diagnoser.sensors.iter().filter_map(|sensor| place(&sensor.name));
        let places: Vec<usize> = places.collect();
        let names = diagnoser.names();
        let off = (0..names.actuators.len()).map(|actuator| {
            let actions = names.actions.iter().map(|c| study.reactions.of(actuator, c, None));
            actions.into_iter().find(|r| r.switches_off && !r.inputs.is_empty()).unwrap_or_default()
        });
        Ok(Watcher {
            runtime,
            slots: runtime::slots(study, sensors.iter().map(|sensor| sensor.id.as_str()))?,
            scales: sensors.iter().map(|sensor| sensor.scale).collect(),
            actuators: study.actuators.clone(),
            is_seen_off: vec![false; names.actuators.len()],
            off: off.collect(),
            measured: vec![f64::NAN; places.len()],
            twin: vec![f64::NAN; sensors.len()],
            residuals: vec![f64::NAN; sensors.len()],
            scatter: ScatterTest::default(),
            panes: 0,
            finding: Finding::default(),
            last: None,
            places,
            diagnoser,
        })
    }

    /// As `Runtime::stepping`.
    pub fn stepping(mut self, settings: SolverSettings) -> Self {
        self.runtime = self.runtime.stepping(settings);
        self
    }

    /// The outcome of the last sample; `None` if there is none, or if the twin could not be simulated.
    pub fn outcome(&self) -> Option<&Outcome> {
        self.last.as_ref()
    }

    /// The twin and the session of the diagnosis.
    pub fn runtime(&self) -> &Runtime<'s> {
        &self.runtime
    }

    /// The same, for what the inputs do not show.
    pub fn runtime_mut(&mut self) -> &mut Runtime<'s> {
        &mut self.runtime
    }

    /// The result of the last sample.
    pub fn observation(&self) -> Observation<'_> {
        Observation { twin: &self.twin, residuals: &self.residuals, finding: &self.finding }
    }

    /// A line if healthy-looking stretches are wider than the scatter that the diagnoser was trained for.
    pub fn wider_than_trained(&self) -> Option<String> {
        let scatter = self.diagnoser.scatter.as_ref().filter(|_| self.scatter.is_wider)?;
        let ScatterTest { windows, wider, .. } = self.scatter;
        let remedy = match scatter.scenario == Scenario::Realistic.name() {
            true => "fit the twin (servotwin fit), or train with larger tolerances",
            false => "fit the twin (servotwin fit), or use the diagnoser of the scenario realistic",
        };
        Some(format!(
            "without an action raised, the residuals of {wider} of {windows} windows exceed the median of the widest of \
             {} training flights: the scatter of the scenario {}, for which the diagnoser was trained, does not \
             explain them; {remedy}",
            scatter.flights, scatter.scenario
        ))
    }

    /// Compares the windows of a healthy-looking stretch, one after the other without a common sample.
    fn compare_scatter(&mut self, outcome: &Outcome) {
        let Some(scatter) = &self.diagnoser.scatter else { return };
        let is_quiet = matches!(outcome.alarm, Alarm::Normal | Alarm::Pending);
        let session = self.runtime.session();
        if !session.has_new_window(0) {
            return;
        }
        self.panes = self.panes.saturating_add(1);
        let length = &self.diagnoser.lengths[0];
        if !is_quiet || !session.is_full(0) || self.panes < length.span.panes {
            return;
        }
        self.panes = 0;
        let window = session.window(0);
        let bands = length.panel.bands.iter().enumerate();
        let excesses = bands.map(|(sensor, band)| window.largest(sensor) / band.half_width);
        self.scatter.take(excesses.fold(0.0, f64::max), scatter);
    }

    /// Detects actuators that the log switches off or on. An input that is missing or out of range switches nothing.
    fn follow(&mut self, inputs: &[f64]) -> Result<(), RuntimeError> {
        for (actuator, reaction) in
            self.off.iter().enumerate().filter(|(_, r)| !r.inputs.is_empty())
        {
            let told = |input: usize| inputs.get(input).copied().unwrap_or(f64::NAN);
            let is_set =
                |&(input, value): &(usize, f64)| self.runtime.believed(input, told(input)) == value;
            // A change of the inputs switches. An actuator that was told to be off stays so, whatever they show.
            match (self.is_seen_off[actuator], reaction.inputs.iter().all(is_set)) {
                (false, true) => self.runtime.follow(actuator, reaction)?,
                (true, false) => self.runtime.release(actuator)?,
                _ => continue,
            }
            self.is_seen_off[actuator] = !self.is_seen_off[actuator];
        }
        Ok(())
    }

    fn take(&mut self, inputs: &[f64], measured: &[f64]) -> Result<(), RuntimeError> {
        for (value, &place) in self.measured.iter_mut().zip(&self.places) {
            *value = measured[place];
        }
        self.follow(inputs)?;
        let outcome = *self.runtime.push(inputs, &self.measured)?;
        for (twin, &slot) in self.twin.iter_mut().zip(&self.slots) {
            *twin = self.runtime.value(slot);
        }
        let pairs = measured.iter().zip(&self.twin).zip(&self.scales);
        for (residual, ((measured, twin), scale)) in self.residuals.iter_mut().zip(pairs) {
            *residual = (measured - twin) / scale;
        }
        for (sensor, &place) in self.places.iter().enumerate() {
            let session = self.runtime.session();
            self.residuals[place] = session.residual(sensor, measured[place], self.twin[place]);
        }
        let said = |o: &Outcome| {
            (o.finding, o.alarm, o.raised.map(|r| (r.actuator, r.action, r.detail)), o.lost)
        };
        if self.last.as_ref().map(said) != Some(said(&outcome)) {
            self.say(&outcome);
        }
        self.finding.be_sure(outcome.confidence);
        self.compare_scatter(&outcome);
        self.last = Some(outcome);
        Ok(())
    }

    fn say(&mut self, outcome: &Outcome) {
        use IndexedFinding as Found;
        let (state, own) = match outcome.finding {
            Found::Unjudged => (DiagnosisState::NoData, None),
            Found::Healthy => (DiagnosisState::Healthy, None),
            Found::Detected => (DiagnosisState::Detected, None),
            Found::Actuator { actuator } => {
                (DiagnosisState::Detected, Some((actuator, None, None)))
            }
            Found::Action { actuator, action } => {
                (DiagnosisState::Isolated, Some((actuator, Some(action), None)))
            }
            Found::Detail { actuator, action, detail } => {
                (DiagnosisState::Isolated, Some((actuator, Some(action), Some(detail))))
            }
            Found::Unknown => (DiagnosisState::Unknown, None),
            Found::EnvironmentInvalid { .. } => (DiagnosisState::EnvironmentInvalid, None),
        };
        // Beside a new fault at an unknown place no actuator is named.
        let is_open = matches!(state, DiagnosisState::Detected | DiagnosisState::Unknown);
        let raised = outcome.raised.or(self.stands().next()).filter(|_| !is_open);
        let words = |raised| self.named(Some(parts(&raised))).action_in_words();
        self.finding = Finding {
            state,
            phase: self.phase(outcome.alarm),
            confidence: outcome.confidence,
            evidence: self.evidence(outcome),
            stands: self.stands().map(words).collect(),
            ..self.named(own.or(raised.as_ref().map(parts)))
        };
    }

    /// The phase of the alarm: neither a gap nor an invalid input takes an action back.
    fn phase(&self, alarm: Alarm) -> Phase {
        match (alarm, self.runtime.session().standing_alarm()) {
            _ if self.stands().next().is_some() => Phase::Raised,
            (Alarm::Pending, _) => Phase::Pending,
            (_, Alarm::Raised) => Phase::Raised,
            (_, Alarm::Recovering) => Phase::Recovering,
            _ => Phase::None,
        }
    }

    /// The shutdowns that were raised and not withdrawn since.
    fn stands(&self) -> impl Iterator<Item = Raised> {
        let session = self.runtime.session();
        (0..self.actuators.len()).filter_map(|actuator| session.stands(actuator).copied())
    }

    /// A finding with the names of an actuator, its action and its fault class, and nothing else.
    fn named(&self, parts: Option<Parts>) -> Finding {
        let Some((actuator, action, detail)) = parts else { return Finding::default() };
        let names = self.diagnoser.names();
        let name = |list: &[String], place: Option<u32>| {
            place.map_or(String::new(), |place| list[place as usize].clone())
        };
        Finding {
            actuator_number: Some(actuator + 1),
            actuator: Some(self.actuators[actuator as usize].clone()),
            action: name(&names.actions, action),
            detail: name(&names.details, detail),
            ..Finding::default()
        }
    }

    /// The reasons of a finding.
    fn evidence(&self, outcome: &Outcome) -> Vec<String> {
        let mut evidence = vec![];
        if let IndexedFinding::EnvironmentInvalid { .. } = outcome.finding {
            evidence.push(self.diagnoser.describe(outcome.finding));
        }
        if let (Some(sensor), Some(length)) = (outcome.worst_sensor, outcome.length) {
            let window_s = self.window_s(length as usize);
            let sensor = &self.diagnoser.sensors[sensor as usize].name;
            let corrected = match self.diagnoser.lengths[length as usize].baseline_corrected {
                Some(_) => ", beyond what it was in health",
                None => "",
            };
            evidence.push(format!(
                "{sensor} is {:.1} times its band away from the twin{corrected}, in the last {window_s} s",
                outcome.excess
            ));
        }
        let session = self.runtime.session();
        let sensors = self.diagnoser.sensors.iter().enumerate();
        let lost: Vec<&str> = sensors
            .filter(|(place, _)| session.is_lost(*place))
            .map(|(_, s)| s.name.as_str())
            .collect();
        if !lost.is_empty() {
            evidence.push(format!("judged without {}: no value comes", lost.join(", ")));
        }
        evidence
    }

    fn window_s(&self, length: usize) -> f64 {
        self.diagnoser.lengths[length].span.samples() as f64 * self.diagnoser.period_s
    }
}

/// An actuator, its action and its fault class, as indices.
type Parts = (u32, Option<u32>, Option<u32>);

fn parts(raised: &Raised) -> Parts {
    (raised.actuator, Some(raised.action), raised.detail)
}

impl Observer for Watcher<'_> {
    fn push(&mut self, _time_s: f64, inputs: &[f64], measured: &[f64]) -> Observation<'_> {
        if let Err(error) = self.take(inputs, measured) {
            self.twin.fill(f64::NAN);
            self.residuals.fill(f64::NAN);
            let outcome = *self.runtime.session().outcome();
            self.say(&outcome);
            self.finding = Finding { evidence: vec![error.to_string()], ..self.finding.clone() };
            self.last = None;
        }
        self.observation()
    }

    fn restart(&mut self) {
        self.runtime.restart();
        self.panes = 0;
        self.last = None;
    }

    fn reset_alarm(&mut self) {
        self.runtime.reset_alarm();
        self.last = None;
    }

    fn save(&self) -> String {
        let stored = Stored {
            runtime: self.runtime.save(),
            is_seen_off: self.is_seen_off.clone(),
            finding: self.last.map(|_| self.finding.clone()),
            scatter: self.scatter,
            panes: self.panes,
        };
        serde_json::to_string(&stored).expect("numbers and names are always JSON")
    }

    fn restore(&mut self, saved: &str) -> Result<(), String> {
        let stored: Stored = serde_json::from_str(saved).map_err(|error| error.to_string())?;
        if stored.is_seen_off.len() != self.off.len() {
            return Err("it is of another number of actuators".into());
        }
        if !stored.scatter.is_possible() {
            return Err("its windows are counted wrongly".into());
        }
        if stored.finding.as_ref().is_some_and(|finding| !finding.is_text()) {
            return Err("its words are no text".into());
        }
        // A state that does not fit leaves this one as it was.
        let mut runtime = self.runtime.anew().map_err(|error| error.to_string())?;
        runtime.restore(&stored.runtime).map_err(|error| error.to_string())?;
        self.runtime = runtime;
        self.is_seen_off = stored.is_seen_off;
        (self.scatter, self.panes) = (stored.scatter, stored.panes);
        self.last = stored.finding.as_ref().map(|_| *self.runtime.session().outcome());
        self.finding = stored.finding.unwrap_or_default();
        Ok(())
    }
}
