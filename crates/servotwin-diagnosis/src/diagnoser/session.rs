//! A running diagnosis: one call for each sample.
//!
//! [`Session::push`] is the whole way from a sample to an action. [`Guard`] decides whether the sample is judged,
//! [`Windows`] gathers it, [`Evidence`] judges the windows that it completes, and [`Alarms`] decides what is raised.

use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::alarm::{AlarmState, Alarms, Basis};
use super::environment::Why;
use super::evidence::{Evidence, LengthState};
use super::guard::{Admission, Guard, GuardState, Received};
use super::outcome::{Alarm, IndexedFinding, Outcome, Places, Raised};
use super::{Diagnoser, LARGEST_COUNT};
use crate::error::{Error, require_sound, same_length};
use crate::hierarchy::Stage;
use crate::residual::Window;
use crate::windows::{self, WindowSample, Windows};

/// The format name at the start of a stored state.
const FORMAT: &str = "servotwin session 1";

/// A stored session, which continues elsewhere bit for bit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoredSession {
    format: String,
    samples: u64,
    guard: GuardState,
    windows: windows::Stored,
    /// One for each window length.
    evidence: Vec<LengthState>,
    alarms: AlarmState,
    outcome: Outcome,
}

/// A running diagnosis of one system.
#[derive(Debug, Clone)]
pub struct Session {
    diagnoser: Arc<Diagnoser>,
    scales: Vec<f64>,
    /// Samples so far.
    samples: u64,
    guard: Guard,
    windows: Windows,
    evidence: Evidence,
    alarms: Alarms,
    outcome: Outcome,
}

impl Session {
    /// A session without samples, beside a twin that begins at rest and an actuator that may be in motion: at first the
    /// twin settles, without judgement, as after a gap. Allocates all its memory.
    ///
    /// # Errors
    /// The errors of [`Diagnoser::check`].
    pub fn new(diagnoser: Arc<Diagnoser>) -> Result<Self, Error> {
        diagnoser.check()?;
        let recover_samples = diagnoser.samples(diagnoser.tuning.recover_s);
        Ok(Session {
            scales: diagnoser.scales(),
            samples: 0,
            guard: Guard::new(&diagnoser),
            windows: diagnoser.windows()?,
            evidence: Evidence::new(&diagnoser)?,
            alarms: Alarms::new(&diagnoser.tuning, diagnoser.names(), recover_samples),
            outcome: Outcome::first(),
            diagnoser,
        })
    }

    /// The same beside a twin that has settled already, such as one whose plant begins at rest too: the first sample is
    /// judged.
    pub fn at_rest(mut self) -> Self {
        self.guard.has_settled();
        self
    }

    /// Takes one sample: inputs, measured values (NaN: missing) and twin values, in SI units and in the diagnoser's
    /// order. Does not allocate and never panics. Lists of a wrong length give an alarm; [`Session::try_push`] rejects
    /// them instead.
    pub fn push(&mut self, inputs: &[f64], measured: &[f64], twin: &[f64]) -> &Outcome {
        self.outcome.sample = self.samples;
        let received = Received { inputs, measured, twin, sample: self.samples };
        let is_masked = |actuator| self.alarms.is_masked(actuator);
        let admission = self.guard.admit(&self.diagnoser, received, is_masked);
        let lost = self.guard.lost();
        if lost < self.outcome.lost {
            // A sensor is back: these windows are without it.
            self.clear_windows();
        }
        self.outcome.lost = lost;
        match admission {
            Admission::Judged => self.judge(inputs, twin),
            Admission::Settling => {
                self.outcome.counts.settling += 1;
                self.report(IndexedFinding::Unjudged, self.standing_alarm());
            }
            Admission::Passed => self.outcome.counts.settling += 1,
            Admission::Unusable(alarm, gap) => self.miss(alarm, gap),
            Admission::Implausible(finding) => self.distrust(finding),
        }
        self.samples += 1;
        &self.outcome
    }

    /// Takes the values that the guard admitted into the windows, the windows into the evidence, and decides by it.
    fn judge(&mut self, inputs: &[f64], twin: &[f64]) {
        let has_new = self.windows.add(&WindowSample {
            measured: &self.guard.measured,
            twin,
            scales: &self.scales,
            stands_in: &self.guard.stands_in,
            is_trusted: self.outcome.alarm == Alarm::Normal,
        });
        if has_new {
            let (alarms, guard) = (&self.alarms, &self.guard);
            let is_masked = |actuator| alarms.is_masked(actuator);
            let taken =
                self.evidence.take(&self.diagnoser, (&self.windows, inputs), guard, is_masked);
            if taken.is_err() {
                self.outcome.counts.errors += 1;
                return self.report(IndexedFinding::Unjudged, Alarm::Error);
            }
        }
        let has_judged = self.evidence.has_judged();
        if has_new && has_judged {
            self.decide();
        } else if !has_judged || matches!(self.outcome.alarm, Alarm::NoData | Alarm::Error) {
            self.report(IndexedFinding::Unjudged, self.standing_alarm());
        }
    }

    fn decide(&mut self) {
        let Session { diagnoser, guard, evidence, alarms, .. } = self;
        let basis = Basis { diagnoser, guard, evidence };
        let (finding, place) = alarms.decide(basis, self.outcome.sample);
        let alarm = alarms.alarm(evidence.of_any_change() >= diagnoser.tuning.pending_share);
        self.report(finding, alarm);
        let length = &self.evidence.lengths[place];
        self.outcome.confidence = match finding {
            IndexedFinding::Healthy => length.probability(0),
            IndexedFinding::Detected | IndexedFinding::Unknown => 1.0 - length.probability(0),
            IndexedFinding::Actuator { actuator } => {
                length.probability_of_actuator(actuator as usize)
            }
            IndexedFinding::Action { .. } | IndexedFinding::Detail { .. } => {
                self.alarms.state.active.map_or(0.0, |raised| raised.confidence)
            }
            IndexedFinding::Unjudged | IndexedFinding::EnvironmentInvalid { .. } => 0.0,
        };
        self.outcome.length = Some(place as u32);
        if let Some(last) = length.last() {
            self.outcome.worst_sensor = Some(last.worst.0 as u32);
            self.outcome.excess = last.worst.1;
        }
    }

    /// Handles a sample without usable values. A few are only counted; more restart the windows.
    fn miss(&mut self, alarm: Alarm, gap: u64) {
        match alarm {
            Alarm::NoData => self.outcome.counts.missing += 1,
            _ => self.outcome.counts.errors += 1,
        }
        if gap == self.guard.longest_gap() {
            self.clear_windows();
        }
        if gap >= self.guard.longest_gap() {
            self.report(IndexedFinding::Unjudged, alarm);
        }
    }

    /// Handles an implausible input: the twin's values since the error mean nothing.
    fn distrust(&mut self, finding: IndexedFinding) {
        self.outcome.counts.environment += 1;
        if self.outcome.finding != finding {
            self.clear_windows();
        }
        let is_missing =
            matches!(finding, IndexedFinding::EnvironmentInvalid { why: Why::Missing, .. });
        self.report(finding, if is_missing { Alarm::NoData } else { Alarm::Error });
    }

    fn report(&mut self, finding: IndexedFinding, alarm: Alarm) {
        let outcome = &mut self.outcome;
        if (outcome.finding, outcome.alarm) != (finding, alarm) {
            outcome.since_sample = self.samples;
        }
        (outcome.finding, outcome.alarm) = (finding, alarm);
        outcome.raised = self.alarms.raised();
        if matches!(finding, IndexedFinding::Unjudged | IndexedFinding::EnvironmentInvalid { .. }) {
            (outcome.confidence, outcome.length, outcome.worst_sensor) = (0.0, None, None);
            outcome.excess = 0.0;
        }
    }

    /// Takes a sample for which the twin could not be simulated. The next one needs a twin that settles again.
    pub fn push_without_twin(&mut self) -> &Outcome {
        self.outcome.sample = self.samples;
        self.outcome.counts.errors += 1;
        self.restart();
        self.report(IndexedFinding::Unjudged, Alarm::Error);
        self.samples += 1;
        &self.outcome
    }

    /// As [`Session::push`], but rejects lists of a wrong length without counting the sample.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`] with both lengths.
    pub fn try_push(
        &mut self,
        inputs: &[f64],
        measured: &[f64],
        twin: &[f64],
    ) -> Result<&Outcome, Error> {
        let sensors = self.diagnoser.sensors.len();
        same_length("inputs", self.diagnoser.environment.inputs.len(), inputs.len())?;
        same_length("measured values", sensors, measured.len())?;
        same_length("values of the twin", sensors, twin.len())?;
        Ok(self.push(inputs, measured, twin))
    }

    /// The result after the last sample.
    pub fn outcome(&self) -> &Outcome {
        &self.outcome
    }

    /// The shared diagnoser.
    pub fn diagnoser(&self) -> &Arc<Diagnoser> {
        &self.diagnoser
    }

    /// Time from the first sample to the given one, s.
    pub fn time_s(&self, sample: u64) -> f64 {
        sample as f64 * self.diagnoser.period_s
    }

    /// Records that an actuator was switched off. It is no longer judged, and counts as off when another shutdown is
    /// considered. A shutdown that was raised for it [stands](Session::stands).
    ///
    /// # Errors
    /// [`Error::IndexOutOfRange`] for an unknown actuator.
    pub fn switched_off(&mut self, actuator: usize) -> Result<(), Error> {
        self.command(actuator, |alarms| alarms.switch(actuator, true))
    }

    /// Records that an actuator is on and judged. A shutdown that stands for it is raised again.
    ///
    /// # Errors
    /// See [`Session::switched_off`].
    pub fn switched_on(&mut self, actuator: usize) -> Result<(), Error> {
        self.command(actuator, |alarms| alarms.switch(actuator, false))
    }

    /// Records that an actuator is on and judged, and withdraws what was raised for it.
    ///
    /// # Errors
    /// See [`Session::switched_off`].
    pub fn release(&mut self, actuator: usize) -> Result<(), Error> {
        self.command(actuator, |alarms| {
            alarms.withdraw(actuator);
            alarms.switch(actuator, false);
        })
    }

    /// Stops or resumes judging an actuator that is on.
    ///
    /// # Errors
    /// See [`Session::switched_off`].
    pub fn inhibit(&mut self, actuator: usize, is_inhibited: bool) -> Result<(), Error> {
        self.command(actuator, |alarms| alarms.inhibit(actuator, is_inhibited))
    }

    /// Changes what is known of an actuator, and starts again.
    fn command(&mut self, index: usize, change: impl FnOnce(&mut Alarms)) -> Result<(), Error> {
        let length = self.diagnoser.names().actuators.len();
        if index >= length {
            return Err(Error::IndexOutOfRange { what: "actuator", index, length });
        }
        change(&mut self.alarms);
        self.restart();
        Ok(())
    }

    /// Takes a sensor out of the diagnosis, or puts it back. While it is out, its residual is not judged, and its value
    /// may be missing.
    ///
    /// # Errors
    /// [`Error::IndexOutOfRange`] for an unknown sensor.
    pub fn take_out(&mut self, sensor: usize, is_out: bool) -> Result<(), Error> {
        let length = self.scales.len();
        let unknown = Error::IndexOutOfRange { what: "sensor", index: sensor, length };
        self.guard.take_out(sensor, is_out).ok_or(unknown)?;
        self.restart();
        Ok(())
    }

    /// Withdraws everything that was raised. Actuators that are off stay off. All is judged anew: a fault that lasts is
    /// raised again, and one that was repaired is not raised by samples of before.
    pub fn reset_alarm(&mut self) {
        self.alarms.withdraw_all();
        self.clear_windows();
        self.report(IndexedFinding::Unjudged, Alarm::Normal);
    }

    /// Starts again with a twin that must settle first. A raised action stays.
    pub fn restart(&mut self) {
        self.clear_windows();
        self.guard.settle();
        self.report(IndexedFinding::Unjudged, self.standing_alarm());
    }

    fn clear_windows(&mut self) {
        self.windows.clear();
        self.evidence.clear();
    }

    /// Clears everything, including actuators that are off. Does not allocate.
    pub fn reset(&mut self) {
        self.guard.reset();
        self.clear_windows();
        self.alarms.clear();
        (self.samples, self.outcome) = (0, Outcome::first());
    }

    /// The shutdown that was raised for an actuator and not withdrawn since, whether or not it was carried out.
    pub fn stands(&self, actuator: usize) -> Option<&Raised> {
        self.alarms.state.stands.get(actuator)?.as_ref()
    }

    /// The alarm of what is raised, whatever is missing or invalid at present; never pending.
    pub fn standing_alarm(&self) -> Alarm {
        self.alarms.alarm(false)
    }

    /// Whether an actuator was switched off.
    pub fn is_off(&self, actuator: usize) -> bool {
        self.alarms.state.is_off.get(actuator).copied().unwrap_or(false)
    }

    /// Whether a sensor has been missing for so long that the diagnosis continues without it.
    pub fn is_lost(&self, sensor: usize) -> bool {
        self.guard.is_lost(sensor)
    }

    /// The newest window of a length.
    ///
    /// # Panics
    /// Here and below, if there is no such length.
    pub fn window(&self, length: usize) -> &Window {
        self.windows.of(length).window()
    }

    /// A residual in parts of the sensor's scale and of its spread at the last sample that was taken, as bands limit it.
    /// Values are in the sensor's SI unit.
    ///
    /// # Panics
    /// There is no such sensor.
    pub fn residual(&self, sensor: usize, measured: f64, twin: f64) -> f64 {
        (measured - twin) / self.scales[sensor] / self.windows.spread(sensor)
    }

    /// Whether a length's window is full, so that it is judged.
    pub fn is_full(&self, length: usize) -> bool {
        self.windows.of(length).is_full()
    }

    /// Whether the last sample completed a new window of a length.
    pub fn has_new_window(&self, length: usize) -> bool {
        self.windows.of(length).has_ended()
    }

    /// The feature rows of a length's last window outside its bands, one for each view.
    pub fn features(&self, length: usize) -> &[Vec<f64>] {
        self.evidence.lengths[length].rows().1
    }

    /// The probability of a hypothesis by a length's committee in its last window: an actuator and its action, or
    /// `None` for healthy. 0 before the first window.
    pub fn probability(&self, length: usize, fault: Option<(usize, usize)>) -> f64 {
        let hypothesis =
            fault.map_or(0, |(actuator, action)| self.alarms.hypotheses.place(actuator, action));
        self.evidence.lengths[length].probability(hypothesis)
    }

    /// The smallest evidence of a length for an action of an actuator against every other explanation, in parts of the
    /// limit to raise it.
    pub fn evidence(&self, length: usize, actuator: usize, action: usize) -> f64 {
        self.evidence.lengths[length].margin(self.alarms.hypotheses.place(actuator, action))
    }

    /// The evidence of a length for any change, in parts of its limit.
    pub fn evidence_of_change(&self, length: usize) -> f64 {
        self.evidence.lengths[length].of_change()
    }

    /// The evidence of a length for an unknown change, in parts of its limit.
    pub fn evidence_of_unknown(&self, length: usize) -> f64 {
        self.evidence.lengths[length].of_unknown()
    }

    /// The smallest evidence of a length for a fault of an actuator, whatever the action, in parts of the limit.
    pub fn evidence_of_actuator(&self, length: usize, actuator: usize) -> f64 {
        self.evidence.lengths[length].margin_of_actuator(actuator)
    }

    /// The evidence of a length that a deviation is a fault and no wrong reading of a boundary, nats.
    pub fn boundary_evidence_nats(&self, length: usize, boundary: usize) -> f64 {
        let sensor = self.diagnoser.boundaries[boundary].sensor as usize;
        let doubt = self.evidence.lengths[length].doubt(boundary);
        doubt.evidence_nats(self.diagnoser.sensors[sensor].noise, &self.diagnoser.tuning)
    }

    /// What the windows of a length say of a boundary: whether a wrong reading explains them; whether the sensor next to it
    /// has fallen beside a reading that stayed (0 or 1 each); by how much it fell beyond its reading, in parts of scale; the
    /// evidence that the other sensors of the actuator share the fall, nats; and the true value of a wrong reading, SI.
    pub fn boundary_numbers(&self, length: usize, boundary: usize) -> [f64; 5] {
        self.evidence.lengths[length].doubt(boundary).numbers()
    }

    /// The largest share of a deviation that an actuator has in common with another one, in the window of a length.
    pub fn common_mode(&self, length: usize, actuator: usize) -> f64 {
        let bands = &self.diagnoser.lengths[length].panel.bands;
        self.evidence.lengths[length].common_mode(actuator, self.windows.of(length).window(), bands)
    }

    /// The stages that a length's trees passed through for the last window outside its bands, each with its nodes from
    /// root to leaf. Allocates.
    ///
    /// # Errors
    /// As [`crate::hierarchy::Hierarchy::explain`].
    pub fn explain(&self, length: usize) -> Result<Vec<(&Stage, Vec<usize>)>, Error> {
        self.diagnoser.lengths[length].panel.trees.explain(self.evidence.lengths[length].rows())
    }

    /// Returns the complete state for storing.
    pub fn save(&self) -> StoredSession {
        StoredSession {
            format: FORMAT.into(),
            samples: self.samples,
            guard: self.guard.state.clone(),
            windows: self.windows.store(),
            evidence: self.evidence.save(),
            alarms: self.alarms.state.clone(),
            outcome: self.outcome,
        }
    }

    /// Restores the state of a session of the same diagnoser; later results match to the bit. Features and paths are
    /// available again after the next windows.
    ///
    /// # Errors
    /// [`Error::CorruptModel`] or [`Error::LengthMismatch`] for a state of another diagnoser, which also resets the
    /// session.
    pub fn restore(&mut self, state: &StoredSession) -> Result<(), Error> {
        let restored = self.try_restore(state);
        if restored.is_err() {
            self.reset();
        }
        restored
    }

    fn try_restore(&mut self, state: &StoredSession) -> Result<(), Error> {
        let StoredSession { format, samples, guard, windows, evidence, alarms, outcome } = state;
        let places = Places::of(&self.diagnoser);
        require_sound(format == FORMAT, "the state is no session's")?;
        let is_possible = *samples <= LARGEST_COUNT && outcome.fits(&places, *samples);
        require_sound(is_possible, "the stored outcome is another diagnoser's")?;
        self.guard.restore(guard)?;
        self.windows.restore(windows)?;
        self.evidence.restore(evidence, &places)?;
        self.alarms.restore(alarms, &places, *samples)?;
        (self.samples, self.outcome) = (*samples, *outcome);
        Ok(())
    }
}
