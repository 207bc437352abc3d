//! A running diagnosis: one call for each sample.

use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::alarm::{self, AlarmRules};
use super::boundary::Doubt;
use super::decision::{DecisionLimits, Evidence, Hypotheses};
use super::environment::{self, Guard, Invalid, Why};
use super::outcome::{Alarm, IndexedFinding, Outcome, Places, Raised};
use super::sensor_health::{Patience, SensorHealth};
use super::tuning::Tuning;
use super::window_classifier::{self, WindowClassifier};
use super::{Boundary, Diagnoser, LARGEST_COUNT, Length};
use crate::error::{Error, same_length};
use crate::hierarchy::Stage;
use crate::random::Random;
use crate::residual::Window;
use crate::windows::{self, WindowSample, Windows};

/// The format name at the start of a stored state.
const FORMAT: &str = "servotwin session 1";

/// Upper limit of residuals and twin signals, in parts of scale; larger ones are no measurements.
const PLAUSIBLE: f64 = 1e6;

/// The state of a session beside its windows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Memory {
    /// Samples so far.
    samples: u64,
    /// Remaining samples while the twin settles, which are not judged.
    settling: u64,
    /// Consecutive samples without usable measured values.
    gap: u64,
    /// Whether any window was judged since the windows were last cleared.
    has_judged: bool,
    is_taken_out: Vec<bool>,
    /// Health of each sensor.
    sensor_health: Vec<SensorHealth>,
    alarm: alarm::AlarmMemory,
    /// One for each boundary of the diagnoser.
    doubts: Vec<Doubt>,
    /// Evidence of each window length.
    evidence: Vec<Evidence>,
    /// Only in a stored state; at run time the classifiers hold it.
    judged: Vec<window_classifier::WindowMemory>,
    outcome: Outcome,
}

/// A stored session, which continues elsewhere bit for bit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoredSession {
    format: String,
    memory: Memory,
    environment: environment::InputMemory,
    windows: windows::Stored,
}

/// A running diagnosis of one system.
#[derive(Debug, Clone)]
pub struct Session {
    diagnoser: Arc<Diagnoser>,
    scales: Vec<f64>,
    rules: AlarmRules,
    patience: Patience,
    hypotheses: Hypotheses,
    classifiers: Vec<WindowClassifier>,
    /// The constants for each length, with its allowances.
    tunings: Vec<Tuning>,
    /// The limits of the evidence for each length.
    limits: Vec<DecisionLimits>,
    guard: Guard,
    windows: Windows,
    memory: Memory,
    /// The measured values, with stand-ins for masked and lost sensors.
    measured: Vec<f64>,
    /// The sensors with stand-in values.
    stands_in: Vec<bool>,
    is_masked: Vec<bool>,
}

/// Whether a sample's values can be used.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Usable {
    Yes,
    Missing,
    Wrong,
}

/// The number of doubts in a session: one for each length and boundary, those of a length side by side.
fn doubts_of(diagnoser: &Diagnoser) -> usize {
    diagnoser.lengths.len() * diagnoser.boundaries.len()
}

impl Session {
    /// A session without samples, beside a twin that begins at rest and an actuator that may be in motion: at first the
    /// twin settles, without judgement, as after a gap. Allocates all its memory.
    ///
    /// # Errors
    /// The errors of [`Diagnoser::check`].
    pub fn new(diagnoser: Arc<Diagnoser>) -> Result<Self, Error> {
        diagnoser.check()?;
        let names = diagnoser.names();
        let (hypotheses, actuators) = (Hypotheses::of(names), names.actuators.len());
        let classifier = |length: &Length| WindowClassifier::new(&diagnoser, length);
        let classifiers =
            diagnoser.lengths.iter().map(classifier).collect::<Result<Vec<_>, _>>()?;
        let memory = Memory {
            samples: 0,
            settling: settling_samples(&diagnoser),
            gap: 0,
            has_judged: false,
            is_taken_out: vec![false; diagnoser.sensors.len()],
            sensor_health: vec![SensorHealth::default(); diagnoser.sensors.len()],
            alarm: alarm::AlarmMemory::new(actuators),
            doubts: vec![Doubt::default(); doubts_of(&diagnoser)],
            evidence: vec![Evidence::new(hypotheses); classifiers.len()],
            judged: Vec::new(),
            outcome: Outcome::first(),
        };
        Ok(Session {
            scales: diagnoser.scales(),
            rules: AlarmRules::new(
                &diagnoser.tuning,
                names,
                diagnoser.samples(diagnoser.tuning.recover_s),
            ),
            patience: patience(&diagnoser),
            hypotheses,
            classifiers,
            tunings: diagnoser.lengths.iter().map(|length| diagnoser.tuning_of(length)).collect(),
            limits: diagnoser.lengths.iter().map(|length| diagnoser.limits_of(length)).collect(),
            guard: Guard::new(&diagnoser.environment, diagnoser.period_s),
            windows: diagnoser.windows()?,
            memory,
            measured: vec![0.0; diagnoser.sensors.len()],
            stands_in: vec![false; diagnoser.sensors.len()],
            is_masked: vec![false; actuators],
            diagnoser,
        })
    }

    /// The same beside a twin that has settled already, such as one whose plant begins at rest too: the first sample is
    /// judged.
    pub fn at_rest(mut self) -> Self {
        self.memory.settling = 0;
        self
    }

    /// Takes one sample: inputs, measured values (NaN: missing) and twin values, in SI units and in the diagnoser's
    /// order. Does not allocate and never panics. Lists of a wrong length give an alarm; [`Session::try_push`] rejects
    /// them instead.
    pub fn push(&mut self, inputs: &[f64], measured: &[f64], twin: &[f64]) -> &Outcome {
        self.memory.outcome.sample = self.memory.samples;
        let diagnoser = self.diagnoser.clone();
        if let Some(invalid) = self.guard.look(&diagnoser.environment, inputs) {
            self.distrust(invalid);
        } else {
            // The twin settles by its inputs, whether or not all sensors are there.
            let is_settled = self.memory.settling == 0;
            self.memory.settling = self.memory.settling.saturating_sub(1);
            match self.usable(measured, twin) {
                Usable::Yes => self.take(&diagnoser, twin, is_settled),
                Usable::Missing => self.lack(Alarm::NoData),
                Usable::Wrong => self.lack(Alarm::Error),
            }
        }
        self.memory.samples += 1;
        &self.memory.outcome
    }

    /// Takes a sample for which the twin could not be simulated. The next one needs a twin that settles again.
    pub fn push_without_twin(&mut self) -> &Outcome {
        self.memory.outcome.sample = self.memory.samples;
        self.memory.outcome.counts.errors += 1;
        self.restart();
        self.say(IndexedFinding::Unjudged, Alarm::Error);
        self.memory.samples += 1;
        &self.memory.outcome
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
        &self.memory.outcome
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
        self.switch(actuator, true)
    }

    /// Records that an actuator is on and judged. A shutdown that stands for it is raised again.
    ///
    /// # Errors
    /// See [`Session::switched_off`].
    pub fn switched_on(&mut self, actuator: usize) -> Result<(), Error> {
        self.switch(actuator, false)
    }

    fn switch(&mut self, actuator: usize, is_off: bool) -> Result<(), Error> {
        self.check_unit(actuator)?;
        self.memory.alarm.switch(actuator, is_off);
        self.restart();
        Ok(())
    }

    /// Records that an actuator is on and judged, and withdraws what was raised for it.
    ///
    /// # Errors
    /// See [`Session::switched_off`].
    pub fn release(&mut self, actuator: usize) -> Result<(), Error> {
        self.check_unit(actuator)?;
        self.memory.alarm.withdraw(actuator);
        self.switched_on(actuator)
    }

    /// Withdraws everything that was raised. Actuators that are off stay off. All is judged anew: a fault that lasts is
    /// raised again, and one that was repaired is not raised by samples of before.
    pub fn reset_alarm(&mut self) {
        self.memory.alarm.withdraw_all();
        self.clear_windows();
        self.say(IndexedFinding::Unjudged, Alarm::Normal);
    }

    /// The shutdown that was raised for an actuator and not withdrawn since, whether or not it was carried out.
    pub fn stands(&self, actuator: usize) -> Option<&Raised> {
        self.memory.alarm.stands.get(actuator)?.as_ref()
    }

    /// The alarm of what is raised, whatever is missing or invalid at present; never pending.
    pub fn standing_alarm(&self) -> Alarm {
        self.memory.alarm.state(false)
    }

    /// Stops or resumes judging an actuator that is on.
    ///
    /// # Errors
    /// See [`Session::switched_off`].
    pub fn inhibit(&mut self, actuator: usize, is_inhibited: bool) -> Result<(), Error> {
        self.check_unit(actuator)?;
        self.memory.alarm.inhibit(actuator, is_inhibited);
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
        *self.memory.is_taken_out.get_mut(sensor).ok_or(unknown)? = is_out;
        self.restart();
        Ok(())
    }

    /// Whether an actuator was switched off.
    pub fn is_off(&self, actuator: usize) -> bool {
        self.memory.alarm.is_off.get(actuator).copied().unwrap_or(false)
    }

    /// Whether a sensor has been missing for so long that the diagnosis continues without it.
    pub fn is_lost(&self, sensor: usize) -> bool {
        self.memory.sensor_health.get(sensor).is_some_and(|sensor_health| sensor_health.is_lost())
    }

    /// The newest window of a length.
    ///
    /// # Panics
    /// Here and below, if there is no such length.
    pub fn window(&self, length: usize) -> &Window {
        self.windows.window(length)
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
        self.windows.is_full(length)
    }

    /// Whether the last sample completed a new window of a length.
    pub fn has_new_window(&self, length: usize) -> bool {
        self.windows.has_ended(length)
    }

    /// The feature rows of a length's last window outside its bands, one for each view.
    pub fn features(&self, length: usize) -> &[Vec<f64>] {
        self.classifiers[length].rows()
    }

    /// The probability of a hypothesis by a length's committee in its last window: an actuator and its action, or
    /// `None` for healthy. 0 before the first window.
    pub fn probability(&self, length: usize, unit_and_action: Option<(usize, usize)>) -> f64 {
        let place = unit_and_action.map_or(0, |(u, c)| self.hypotheses.place(u, c));
        self.classifiers[length].probability(place)
    }

    /// The smallest evidence of a length for an action of an actuator against every other explanation, in parts of the
    /// limit to raise it.
    pub fn evidence(&self, length: usize, actuator: usize, action: usize) -> f64 {
        let claim = self.hypotheses.place(actuator, action);
        self.memory.evidence[length].margin(claim, &self.limits[length])
    }

    /// The evidence of a length for any change, in parts of its limit.
    pub fn evidence_of_change(&self, length: usize) -> f64 {
        self.memory.evidence[length].of_change(&self.limits[length])
    }

    /// The evidence of a length for an unknown change, in parts of its limit.
    pub fn evidence_of_unknown(&self, length: usize) -> f64 {
        self.memory.evidence[length].of_unknown(&self.limits[length])
    }

    /// The smallest evidence of a length for a fault of an actuator, whatever the action, in parts of the limit.
    pub fn evidence_of_actuator(&self, length: usize, actuator: usize) -> f64 {
        self.memory.evidence[length].margin_of_actuator(actuator, &self.limits[length])
    }

    /// The evidence of a length that a deviation is a fault and no wrong reading of a boundary, nats.
    pub fn boundary_evidence_nats(&self, length: usize, boundary: usize) -> f64 {
        let boundaries = &self.diagnoser.boundaries;
        let sensor = &self.diagnoser.sensors[boundaries[boundary].sensor as usize];
        let doubt = &self.memory.doubts[length * boundaries.len() + boundary];
        doubt.evidence_nats(sensor.noise, &self.diagnoser.tuning)
    }

    /// Whether a wrong reading of a boundary explains the present windows of a length.
    pub fn is_boundary_explained(&self, length: usize, boundary: usize) -> bool {
        self.memory.doubts[length * self.diagnoser.boundaries.len() + boundary].is_explained()
    }

    /// The largest share of a deviation that an actuator has in common with another one, in the window of a length.
    pub fn common_mode(&self, length: usize, actuator: usize) -> f64 {
        let bands = &self.diagnoser.lengths[length].panel.bands;
        self.classifiers[length].common_mode(actuator, self.windows.window(length), bands)
    }

    /// The stages that a length's trees passed through for the last window outside its bands, each with its nodes from
    /// root to leaf. Allocates.
    ///
    /// # Errors
    /// As [`crate::hierarchy::Hierarchy::explain`].
    pub fn explain(&self, length: usize) -> Result<Vec<(&Stage, Vec<usize>)>, Error> {
        self.diagnoser.lengths[length].panel.trees.explain(self.classifiers[length].rows())
    }

    /// Clears everything, including actuators that are off. Does not allocate.
    pub fn reset(&mut self) {
        self.memory.alarm.clear();
        self.memory.is_taken_out.fill(false);
        self.memory.sensor_health.fill(SensorHealth::default());
        self.clear_windows();
        self.guard.memory.clear();
        (self.memory.samples, self.memory.gap) = (0, 0);
        self.memory.settling = settling_samples(&self.diagnoser);
        self.memory.outcome = Outcome::first();
    }

    /// Returns the complete state for storing.
    pub fn save(&self) -> StoredSession {
        let judged = self.classifiers.iter().map(|classifier| classifier.memory.clone()).collect();
        StoredSession {
            format: FORMAT.into(),
            memory: Memory { judged, ..self.memory.clone() },
            environment: self.guard.memory.clone(),
            windows: self.windows.store(),
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
        let StoredSession { format, memory, environment, windows } = state;
        let places = Places::of(&self.diagnoser);
        let fits = format == FORMAT
            && memory.evidence.len() == self.classifiers.len()
            && memory.evidence.iter().all(|evidence| evidence.fits(self.hypotheses))
            && memory.judged.len() == self.classifiers.len()
            && memory
                .judged
                .iter()
                .zip(&self.classifiers)
                .all(|(judged, own)| own.fits(judged, &places))
            && memory.is_taken_out.len() == self.scales.len()
            && memory.alarm.fits(&places, memory.samples)
            && self.guard.fits(environment);
        if !fits {
            return Err(Error::CorruptModel { broken: "the state is another diagnoser's" });
        }
        if !self.is_possible(memory, &places) {
            let broken = "a number of the state is none that a diagnosis can have";
            return Err(Error::CorruptModel { broken });
        }
        self.windows.restore(windows)?;
        self.memory = memory.clone();
        self.guard.memory = environment.clone();
        for (classifier, judged) in
            self.classifiers.iter_mut().zip(core::mem::take(&mut self.memory.judged))
        {
            classifier.memory = judged;
        }
        Ok(())
    }

    /// Whether a session can have written these stored numbers.
    fn is_possible(&self, memory: &Memory, places: &Places) -> bool {
        let settling = settling_samples(&self.diagnoser);
        [memory.samples, memory.gap].iter().all(|count| *count <= LARGEST_COUNT)
            && memory.settling <= settling
            && memory.sensor_health.len() == self.scales.len()
            && memory.sensor_health.iter().all(|sensor_health| sensor_health.fits(self.patience))
            && memory.doubts.len() == doubts_of(&self.diagnoser)
            && memory.doubts.iter().all(Doubt::fits)
            && memory.outcome.fits(places, memory.samples)
    }

    fn check_unit(&self, index: usize) -> Result<(), Error> {
        let length = self.is_masked.len();
        let known = index < length;
        if known { Ok(()) } else { Err(Error::IndexOutOfRange { what: "actuator", index, length }) }
    }

    /// Starts again with a twin that must settle first. A raised action stays.
    pub fn restart(&mut self) {
        self.clear_windows();
        self.memory.settling = settling_samples(&self.diagnoser);
        self.say(IndexedFinding::Unjudged, self.standing_alarm());
    }

    fn clear_windows(&mut self) {
        self.windows.clear();
        self.memory.evidence.iter_mut().for_each(Evidence::clear);
        self.memory.doubts.iter_mut().for_each(Doubt::clear);
        self.classifiers.iter_mut().for_each(WindowClassifier::forget);
        self.memory.has_judged = false;
    }

    /// Handles an implausible input: the twin's values since the error mean nothing.
    fn distrust(&mut self, Invalid { input, why }: Invalid) {
        self.memory.outcome.counts.environment += 1;
        let finding = IndexedFinding::EnvironmentInvalid { input, why };
        if self.memory.outcome.finding != finding || self.memory.has_judged {
            self.restart();
        }
        self.memory.settling = settling_samples(&self.diagnoser);
        self.say(finding, if why == Why::Missing { Alarm::NoData } else { Alarm::Error });
    }

    /// Checks the values and copies them. Masked and lost sensors get a stand-in value: the twin's, with the noise of a
    /// healthy sensor.
    fn usable(&mut self, measured: &[f64], twin: &[f64]) -> Usable {
        let sensors = &self.diagnoser.sensors;
        if measured.len() != sensors.len() || twin.len() != sensors.len() {
            return Usable::Wrong;
        }
        let mut usable = Usable::Yes;
        for (place, sensor) in sensors.iter().enumerate() {
            let (value, expected) = (measured[place], twin[place]);
            let of = |value: f64| match value {
                value if value.is_nan() => Usable::Missing,
                value if ((value - expected) / sensor.scale).abs() > PLAUSIBLE => Usable::Wrong,
                _ => Usable::Yes,
            };
            let is_sound = (expected / sensor.scale).abs() <= PLAUSIBLE;
            let of_unit = |actuator: u32| self.memory.alarm.is_masked(actuator as usize);
            let is_masked = self.memory.is_taken_out[place] || sensor.actuator.is_some_and(of_unit);
            let sensor_health = &mut self.memory.sensor_health[place];
            if is_masked {
                *sensor_health = SensorHealth::default();
            } else if is_sound {
                sensor_health.notice(of(value) == Usable::Yes, self.patience);
            }
            self.stands_in[place] = is_masked || sensor_health.is_lost();
            let value = if self.stands_in[place] {
                let mut random = Random::stream(place as u64, self.memory.samples + 1);
                let noise = if sensor.is_noisy { sensor.noise } else { 0.0 };
                expected + sensor.scale * noise * normal(&mut random)
            } else {
                value
            };
            usable = match usable {
                _ if !is_sound => Usable::Wrong,
                Usable::Yes => of(value),
                same => same,
            };
            self.measured[place] = value;
        }
        self.count_lost();
        let is_blind = self.memory.outcome.lost > 0 && self.is_blind();
        if usable == Usable::Yes && is_blind { Usable::Missing } else { usable }
    }

    /// Counts the lost sensors. When one comes back, the windows recorded without it are cleared.
    fn count_lost(&mut self) {
        let lost = self
            .memory
            .sensor_health
            .iter()
            .filter(|sensor_health| sensor_health.is_lost())
            .count() as u32;
        if lost < self.memory.outcome.lost {
            self.clear_windows();
        }
        self.memory.outcome.lost = lost;
    }

    /// Whether an actuator may be accused: all other judged actuators have all their sensors. A stand-in value always
    /// looks healthy, so a fault of an actuator without a sensor would look like a fault of its neighbor.
    fn is_comparable(&self, actuator: usize) -> bool {
        let is_out = self.memory.is_taken_out.iter().zip(&self.memory.sensor_health);
        let mut sensors = self.diagnoser.sensors.iter().zip(is_out);
        sensors.all(|(sensor, (is_taken_out, sensor_health))| {
            let is_masked = |actuator: u32| self.memory.alarm.is_masked(actuator as usize);
            let is_elsewhere =
                sensor.actuator != Some(actuator as u32) && !sensor.actuator.is_some_and(is_masked);
            !(is_elsewhere && (*is_taken_out || sensor_health.is_lost()))
        })
    }

    /// Whether too many of an actuator's sensors, or of all sensors, are lost: the rest does not suffice.
    fn is_blind(&self) -> bool {
        let most_lost = |actuator: Option<u32>| {
            let sensors = self.diagnoser.sensors.iter().zip(&self.memory.sensor_health);
            let own =
                sensors.filter(|(sensor, _)| actuator.is_none() || sensor.actuator == actuator);
            let (count, lost) = own.fold((0, 0), |(count, lost), (_, sensor_health)| {
                (count + 1, lost + u32::from(sensor_health.is_lost()))
            });
            f64::from(lost) > self.diagnoser.tuning.most_lost * f64::from(count)
        };
        most_lost(None)
            || (0..self.is_masked.len()).any(|actuator| most_lost(Some(actuator as u32)))
    }

    /// Handles a sample without usable values. A few are only counted; more restart the windows.
    fn lack(&mut self, alarm: Alarm) {
        let counts = &mut self.memory.outcome.counts;
        match alarm {
            Alarm::NoData => counts.missing += 1,
            _ => counts.errors += 1,
        }
        self.memory.gap += 1;
        let limit = self.patience.until_lost;
        if self.memory.gap < limit {
            return;
        }
        if self.memory.has_judged || self.memory.gap == limit {
            self.clear_windows();
        }
        self.say(IndexedFinding::Unjudged, alarm);
    }

    /// Handles a usable sample.
    fn take(&mut self, diagnoser: &Diagnoser, twin: &[f64], is_settled: bool) {
        self.memory.gap = 0;
        let is_lacking = matches!(self.memory.outcome.alarm, Alarm::NoData | Alarm::Error);
        if !is_settled {
            self.memory.outcome.counts.settling += 1;
            self.say(IndexedFinding::Unjudged, self.standing_alarm());
            return;
        }
        let has_new = self.windows.add(&WindowSample {
            measured: &self.measured,
            twin,
            scales: &self.scales,
            stands_in: &self.stands_in,
            is_trusted: self.memory.outcome.alarm == Alarm::Normal,
        });
        if has_new && self.classify_windows(diagnoser).is_err() {
            self.memory.outcome.counts.errors += 1;
            self.say(IndexedFinding::Unjudged, Alarm::Error);
        } else if has_new && self.memory.has_judged {
            self.decide(diagnoser);
        } else if is_lacking || !self.memory.has_judged {
            self.say(IndexedFinding::Unjudged, self.standing_alarm());
        }
    }

    /// Judges the new window of every length whose window is full.
    fn classify_windows(&mut self, diagnoser: &Diagnoser) -> Result<(), Error> {
        let alarm = &self.memory.alarm;
        for (actuator, is_masked) in self.is_masked.iter_mut().enumerate() {
            *is_masked = alarm.is_masked(actuator);
        }
        for (place, classifier) in self.classifiers.iter_mut().enumerate() {
            if !self.windows.has_ended(place) || !self.windows.is_full(place) {
                continue;
            }
            let window = self.windows.window(place);
            let share = self.windows.share_of_newest(place);
            let length = &diagnoser.lengths[place];
            let said = classifier.classify(length, window, &self.is_masked, &self.stands_in)?;
            let evidence = &mut self.memory.evidence[place];
            evidence.take(said, share, &self.tunings[place], &self.limits[place]);
            self.memory.has_judged = true;
        }
        self.update_doubts(diagnoser);
        Ok(())
    }

    /// Takes the new windows: every length has bands of its own, so each has its own doubts.
    fn update_doubts(&mut self, diagnoser: &Diagnoser) {
        let boundaries = &diagnoser.boundaries;
        for (place, length) in diagnoser.lengths.iter().enumerate() {
            if !self.windows.has_ended(place) || !self.windows.is_full(place) {
                continue;
            }
            let window = self.windows.window(place);
            let of_window =
                (length.span.panes, self.windows.share_of_newest(place), diagnoser.period_s);
            let doubts = self.memory.doubts.iter_mut().skip(place * boundaries.len());
            for (doubt, boundary) in doubts.zip(boundaries) {
                doubt.take(boundary, window, &length.panel.bands, &diagnoser.tuning, of_window);
            }
        }
    }

    /// The input whose wrong reading explains all that an actuator shows in the windows of some length, while nothing
    /// speaks for a fault.
    fn doubtful(&self, diagnoser: &Diagnoser, actuator: usize) -> Option<u32> {
        let of_actuator = |boundary: &&Boundary| {
            diagnoser.sensors[boundary.sensor as usize].actuator == Some(actuator as u32)
        };
        let noise = |boundary: &Boundary| diagnoser.sensors[boundary.sensor as usize].noise;
        let boundaries = diagnoser.boundaries.iter().cycle();
        let mut pairs = boundaries.zip(&self.memory.doubts);
        let found = pairs.find(|(boundary, doubt)| {
            of_actuator(boundary)
                && doubt.is_explained()
                && doubt.remains(noise(boundary), &diagnoser.tuning)
        });
        found.map(|(boundary, _)| boundary.input)
    }

    /// Raises, holds or drops an action, and updates the finding.
    fn decide(&mut self, diagnoser: &Diagnoser) {
        let sample = self.memory.outcome.sample;
        let withheld = self.withheld(diagnoser);
        let candidate = self.candidate(diagnoser);
        let is_raised = candidate.is_some_and(|(length, claim)| {
            let raised = self.raised(length, claim, diagnoser.tuning.least_detail_confidence);
            self.memory.alarm.raise(&self.rules, raised)
        });
        if !is_raised {
            let share = diagnoser.tuning.pending_share;
            let has_evidence = self.memory.alarm.hypothesis(&self.rules).is_some_and(|claim| {
                self.lengths().any(|length| self.margin(length, claim) >= share)
            });
            self.memory.alarm.hold(&self.rules, has_evidence, sample);
        }
        let found = match withheld {
            Some(input) if self.memory.alarm.active.is_none() => {
                (IndexedFinding::EnvironmentInvalid { input, why: Why::Doubtful }, 0)
            }
            _ => self.found(),
        };
        let is_pending = self.lengths().any(|length| {
            let evidence = &self.memory.evidence[length];
            let limits = &self.limits[length];
            let most = evidence.of_change(limits).max(evidence.of_unknown(limits));
            most >= diagnoser.tuning.pending_share
        });
        self.tell(found, is_pending);
    }

    /// The input that a shutdown waits for: a wrong reading of it would explain all that its actuator shows.
    fn doubtful_shutdown(&self, diagnoser: &Diagnoser, claim: usize) -> Option<u32> {
        let (actuator, action) = self.hypotheses.split(claim)?;
        match self.rules.switches_off(action as u32) {
            true => self.doubtful(diagnoser, actuator),
            false => None,
        }
    }

    /// The doubtful input of a shutdown for which there would be enough evidence.
    fn withheld(&self, diagnoser: &Diagnoser) -> Option<u32> {
        let is_claimed =
            |claim: &usize| self.lengths().any(|length| self.margin(length, *claim) >= 1.0);
        let mut claims = (1..self.hypotheses.count()).filter(is_claimed);
        claims.find_map(|claim| self.doubtful_shutdown(diagnoser, claim))
    }

    fn raised(&self, length: usize, claim: usize, least_detail_confidence: f64) -> Raised {
        let (actuator, action) = self.hypotheses.split(claim).unwrap_or_default();
        Raised {
            actuator: actuator as u32,
            action: action as u32,
            detail: self.classifiers[length].detail(least_detail_confidence),
            sample: self.memory.outcome.sample,
            length: length as u32,
            confidence: self.classifiers[length].probability(claim),
        }
    }

    fn lengths(&self) -> core::ops::Range<usize> {
        0..self.classifiers.len()
    }

    fn margin(&self, length: usize, claim: usize) -> f64 {
        self.memory.evidence[length].margin(claim, &self.limits[length])
    }

    /// The hypothesis that a new window raises, and its length: the longest window first, then the largest margin.
    fn candidate(&self, diagnoser: &Diagnoser) -> Option<(usize, usize)> {
        let mut best: Option<(u64, f64, usize, usize)> = None;
        for length in self.lengths().filter(|&length| self.windows.has_ended(length)) {
            for claim in 1..self.hypotheses.count() {
                let margin = self.margin(length, claim);
                if margin < 1.0 || !self.may_raise(diagnoser, length, claim) {
                    continue;
                }
                let samples = self.windows.window(length).count();
                let is_better = best.is_none_or(|(s, m, _, _)| (samples, margin) > (s, m));
                if is_better {
                    best = Some((samples, margin, length, claim));
                }
            }
        }
        best.map(|(_, _, length, claim)| (length, claim))
    }

    fn may_raise(&self, diagnoser: &Diagnoser, length: usize, claim: usize) -> bool {
        let evidence = &self.memory.evidence[length];
        let classifier = &self.classifiers[length];
        let least = diagnoser.lengths[length].panel.least_confidence;
        let accused = self.hypotheses.split(claim).map(|(actuator, _)| actuator);
        self.memory.alarm.allows(&self.rules, claim)
            && accused.is_none_or(|actuator| self.is_comparable(actuator))
            && classifier.agrees_on(claim, least)
            && evidence.of_unknown(&self.limits[length]) < 1.0
            && !self.is_contradicted(length, claim)
            && self.doubtful_shutdown(diagnoser, claim).is_none()
    }

    /// Whether another length claims another actuator, or a longer one another action.
    fn is_contradicted(&self, length: usize, claim: usize) -> bool {
        let own = self.hypotheses.split(claim).map(|(actuator, _)| actuator);
        let samples = |length: usize| self.windows.window(length).count();
        let contradicts = |other: usize, hypothesis: usize| {
            let elsewhere = self.hypotheses.split(hypothesis).map(|(actuator, _)| actuator) != own;
            (elsewhere || samples(other) > samples(length)) && self.margin(other, hypothesis) >= 1.0
        };
        let others = self.lengths().filter(|&other| other != length);
        let mut pairs = others.flat_map(|other| {
            (1..self.hypotheses.count()).map(move |hypothesis| (other, hypothesis))
        });
        pairs.any(|(other, hypothesis)| hypothesis != claim && contradicts(other, hypothesis))
    }

    /// The current finding, and the length that found it.
    fn found(&self) -> (IndexedFinding, usize) {
        if let Some(raised) = self.memory.alarm.active {
            let (actuator, action) = (raised.actuator, raised.action);
            let finding = match raised.detail {
                Some(detail) => IndexedFinding::Detail { actuator, action, detail },
                None => IndexedFinding::Action { actuator, action },
            };
            return (finding, raised.length as usize);
        }
        let over = |of: &dyn Fn(usize) -> f64| self.lengths().find(|&length| of(length) >= 1.0);
        let evidence = |length: usize| (&self.memory.evidence[length], &self.limits[length]);
        if let Some(length) = over(&|length| {
            let (evidence, limits) = evidence(length);
            evidence.of_unknown(limits)
        }) {
            return (IndexedFinding::Unknown, length);
        }
        if let Some(found) = self.found_actuator() {
            return found;
        }
        let changed = over(&|length| {
            let (evidence, limits) = evidence(length);
            evidence.of_change(limits)
        });
        let first = self.lengths().find(|&length| self.classifiers[length].last().is_some());
        match changed {
            Some(length) => (IndexedFinding::Detected, length),
            None => (IndexedFinding::Healthy, first.unwrap_or(0)),
        }
    }

    /// The actuator that at least one length is sure of, unless two lengths disagree.
    fn found_actuator(&self) -> Option<(IndexedFinding, usize)> {
        let mut found: Option<(usize, usize)> = None;
        for length in self.lengths() {
            for actuator in
                (0..self.hypotheses.actuators).filter(|&actuator| self.is_comparable(actuator))
            {
                let evidence = &self.memory.evidence[length];
                if evidence.margin_of_actuator(actuator, &self.limits[length]) < 1.0 {
                    continue;
                }
                if found.is_some_and(|(known, _)| known != actuator) {
                    return None;
                }
                found = found.or(Some((actuator, length)));
            }
        }
        found.map(|(actuator, length)| {
            (IndexedFinding::Actuator { actuator: actuator as u32 }, length)
        })
    }

    fn tell(&mut self, (finding, length): (IndexedFinding, usize), is_pending: bool) {
        self.say(finding, self.memory.alarm.state(is_pending));
        let classifier = &self.classifiers[length];
        let outcome = &mut self.memory.outcome;
        outcome.confidence = match finding {
            IndexedFinding::Healthy => classifier.probability(0),
            IndexedFinding::Detected | IndexedFinding::Unknown => 1.0 - classifier.probability(0),
            IndexedFinding::Actuator { actuator } => {
                classifier.probability_of_actuator(actuator as usize)
            }
            IndexedFinding::Action { .. } | IndexedFinding::Detail { .. } => {
                self.memory.alarm.active.map_or(0.0, |raised| raised.confidence)
            }
            IndexedFinding::Unjudged | IndexedFinding::EnvironmentInvalid { .. } => 0.0,
        };
        outcome.length = Some(length as u32);
        if let Some(last) = classifier.last() {
            outcome.worst_sensor = Some(last.worst.0 as u32);
            outcome.excess = last.worst.1;
        }
    }

    fn say(&mut self, finding: IndexedFinding, alarm: Alarm) {
        let outcome = &mut self.memory.outcome;
        if (outcome.finding, outcome.alarm) != (finding, alarm) {
            outcome.since_sample = self.memory.samples;
        }
        (outcome.finding, outcome.alarm) = (finding, alarm);
        outcome.raised = self.memory.alarm.raised();
        if matches!(finding, IndexedFinding::Unjudged | IndexedFinding::EnvironmentInvalid { .. }) {
            (outcome.confidence, outcome.length, outcome.worst_sensor) = (0.0, None, None);
            outcome.excess = 0.0;
        }
    }
}

/// Number of samples that are not judged after a start or a restart.
fn settling_samples(diagnoser: &Diagnoser) -> u64 {
    diagnoser.samples(diagnoser.tuning.settle_s)
}

fn patience(diagnoser: &Diagnoser) -> Patience {
    let samples = |time_s: f64| diagnoser.samples(time_s).max(1);
    let tuning = &diagnoser.tuning;
    Patience { until_lost: samples(tuning.no_data_after_s), until_back: samples(tuning.settle_s) }
}

/// A deviate of mean 0 and variance 1, from twelve uniform ones.
fn normal(random: &mut Random) -> f64 {
    (0..12).map(|_| random.unit()).sum::<f64>() - 6.0
}
