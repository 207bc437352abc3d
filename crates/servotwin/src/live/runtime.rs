//! Runs the twin and the diagnosis beside an actuator, one call per sample.

use crate::rest::Stopped;
use crate::signal::bus::Bus;
use crate::study::{Reaction, Study};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::diagnoser::{Diagnoser, Outcome, Session, StoredSession};
use servotwin_diagnosis::error::Error;
use servotwin_model::lanes::Level;
use servotwin_model::program::Slot;
use servotwin_model::solver::{Between, Knot, Snapshot, SolverSettings, Twin};
use std::sync::Arc;

/// Why the twin cannot run.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
pub enum RuntimeError {
    /// The diagnoser does not fit this system, or is invalid.
    #[error("the diagnoser: {0}")]
    Diagnoser(#[from] Error),
    /// The diagnoser reads a sensor that the study does not have.
    #[error("the diagnoser reads sensor '{name}', which the study '{study}' does not have")]
    Sensor { name: String, study: String },
    /// The simulation of the twin failed.
    #[error("the twin cannot be simulated: {} at {:.4} s in {}", .0.cause, .0.time_s, .0.state)]
    Twin(Stopped),
}

/// The complete state of a runtime, for resuming with the same bits.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Checkpoint {
    /// The twin's state; `None` before the first sample.
    pub(crate) twin: Option<Snapshot>,
    /// The state of the diagnosis.
    pub(crate) session: StoredSession,
    /// For each input, the last value and difference on its bus.
    pub(crate) buses: Vec<(Option<f64>, f64)>,
    /// The reactions that stand, with their actuators.
    pub reactions: Vec<(usize, Reaction)>,
}

/// A twin, a diagnosis and the actions so far. [`Runtime::push`] does not allocate after the first sample.
pub struct Runtime<'s> {
    study: &'s Study,
    settings: SolverSettings,
    twin: Twin<'s>,
    is_settled: bool,
    /// Whether the twin uses compiled steps.
    is_compiled: bool,
    session: Session,
    /// The slots of the diagnoser's sensors in the system.
    slots: Vec<Slot>,
    expected: Vec<f64>,
    values: Vec<f64>,
    /// The inputs as the twin received them, with their sources.
    accepted: Vec<Knot>,
    buses: Vec<Bus>,
    /// Parameters that differ from the system's while no reaction stands.
    overrides: Vec<(usize, usize, f64)>,
    /// The reactions that stand, in the order of their actuators. Parameters and sensors that are out follow from them.
    reactions: Vec<(usize, Reaction)>,
}

/// How inputs are interpolated between samples: the command as a cubic; all others hold their value.
pub fn between(study: &Study) -> Vec<Between> {
    let inputs = study.system.network().inputs.len();
    let of = |input| if input == study.command_input { Between::Cubic } else { Between::Hold };
    (0..inputs).map(of).collect()
}

/// The default inputs of a system.
pub fn defaults(study: &Study) -> Vec<Knot> {
    study.system.network().inputs.iter().map(|input| Knot::from(input.default)).collect()
}

/// The slots of sensors in the system's variables, by id.
///
/// # Errors
/// [`RuntimeError::Sensor`].
pub fn slots<'n>(
    study: &Study,
    names: impl Iterator<Item = &'n str>,
) -> Result<Vec<Slot>, RuntimeError> {
    let slot = |name: &str| {
        let sensor = study.system.sensor(name);
        let missing = || RuntimeError::Sensor { name: name.into(), study: study.name.clone() };
        let signal = &sensor.ok_or_else(missing)?.signal;
        Ok(study.system.program.observable(signal).ok_or_else(missing)?.slot)
    };
    names.map(slot).collect()
}

/// The place of a sensor of the study's list among those of a diagnoser; `None` if the diagnosis does not use it.
pub fn place_of(sensor: usize, study: &Study, diagnoser: &Diagnoser) -> Option<usize> {
    let name = &study.sensors.0[sensor].name;
    diagnoser.sensors.iter().position(|known| known.name == *name)
}

impl<'s> Runtime<'s> {
    /// Creates a twin of the study's system with parameter overrides (component, parameter, value), and a diagnosis,
    /// both before the first sample. At first the twin settles, without judgement, as [`Session::new`] says.
    ///
    /// # Errors
    /// The diagnoser does not fit this study.
    pub fn new(
        study: &'s Study,
        diagnoser: Arc<Diagnoser>,
        overrides: Vec<(usize, usize, f64)>,
    ) -> Result<Self, RuntimeError> {
        let program = &study.system.program;
        let slots = slots(study, diagnoser.sensors.iter().map(|sensor| sensor.name.as_str()))?;
        let period_s = diagnoser.period_s;
        let session = Session::new(diagnoser)?;
        let settings = SolverSettings::of_runs();
        let mut twin = Twin::new(program, settings, period_s, between(study));
        twin.load(&program.parameters_with(&overrides, &[]));
        Ok(Runtime {
            study,
            settings,
            twin,
            is_settled: false,
            is_compiled: false,
            session,
            expected: vec![0.0; slots.len()],
            slots,
            values: vec![0.0; program.externals().len()],
            accepted: defaults(study),
            buses: vec![Bus::default(); program.externals().len()],
            overrides,
            reactions: vec![],
        })
    }

    /// The same before the first sample.
    pub(super) fn anew(&self) -> Result<Self, RuntimeError> {
        let anew =
            Runtime::new(self.study, self.session.diagnoser().clone(), self.overrides.clone());
        Ok(anew?.stepping(self.settings))
    }

    /// The same beside an actuator that begins at rest too: the first sample is judged.
    pub fn at_rest(mut self) -> Self {
        self.session = self.session.at_rest();
        self
    }

    /// Simulates the twin with other steps than those of training. Call it before the first sample.
    pub(crate) fn stepping(mut self, settings: SolverSettings) -> Self {
        let program = &self.study.system.program;
        let period_s = self.session.diagnoser().period_s;
        self.settings = settings;
        self.twin = Twin::new(program, settings, period_s, between(self.study));
        self.load();
        self
    }

    /// The parameters of the twin: those of the reactions that stand before its own.
    fn parameters(&self) -> Vec<Vec<f64>> {
        let reactions = self.reactions.iter().flat_map(|(_, reaction)| &reaction.parameters);
        let all: Vec<_> = self.overrides.iter().chain(reactions).copied().collect();
        self.study.system.program.parameters_with(&all, &[])
    }

    fn load(&mut self) {
        self.twin.load(&self.parameters());
    }

    /// Takes one sample: the inputs of the system and the sensor values (NaN means missing), SI, in the order of the
    /// system and of the diagnoser. If an input is not a number or out of range, the twin keeps the previous value (a
    /// missing command goes on with its slope), and the outcome reports what lasts.
    ///
    /// # Errors
    /// [`RuntimeError::Twin`]: the sample counts as one without data, what is raised stands, and the next sample restarts
    /// the twin, which settles again. A sample of the wrong length is rejected.
    pub fn push(&mut self, inputs: &[f64], measured: &[f64]) -> Result<&Outcome, RuntimeError> {
        let wrong = |what, expected, found| Error::LengthMismatch { what, expected, found };
        if inputs.len() != self.values.len() {
            return Err(wrong("inputs", self.values.len(), inputs.len()).into());
        }
        if measured.len() != self.slots.len() {
            return Err(wrong("measured values", self.slots.len(), measured.len()).into());
        }
        self.take_compiled();
        self.believe(inputs);
        let inputs = &self.accepted;
        let stepped = if self.is_settled {
            self.twin.step(inputs)
        } else {
            let guess = self.study.system.program.first_guess(&self.parameters());
            self.twin.settle(inputs, &guess)
        };
        self.is_settled = stepped.is_ok();
        if let Err(failure) = stepped {
            self.session.push_without_twin();
            return Err(RuntimeError::Twin(Stopped::new(&self.study.system, failure)));
        }
        for (value, &slot) in self.expected.iter_mut().zip(&self.slots) {
            *value = self.twin.value(slot);
        }
        Ok(self.session.push(&self.values, measured, &self.expected))
    }

    /// Switches to the compiled step once it is available, without waiting for the compiler.
    fn take_compiled(&mut self) {
        if self.is_compiled {
            return;
        }
        if let Some(steps) = self.study.system.compiled.ready(Level::Single) {
            self.is_compiled = self.twin.use_compiled(steps);
        }
    }

    fn believe(&mut self, inputs: &[f64]) {
        let period_s = self.session.diagnoser().period_s;
        for (place, &told) in inputs.iter().enumerate() {
            self.values[place] = told;
            // The command of a twin that stood still meanwhile would jump when the next one comes.
            let goes_on = told.is_nan() && place == self.study.command_input;
            let Knot { value, slope_per_s } = self.accepted[place];
            let next = if goes_on { value + slope_per_s * period_s } else { told };
            let value = self.believed(place, next);
            self.accepted[place] = self.buses[place].next(value, period_s);
        }
    }

    /// The value of an input that the twin takes: the previous one instead of one that is no number or out of range.
    pub(super) fn believed(&self, input: usize, told: f64) -> f64 {
        let known = self.session.diagnoser().environment.inputs.get(input);
        let fits = known.is_none_or(|i| (i.least..=i.largest).contains(&told));
        if told.is_finite() && fits { told } else { self.accepted[input].value }
    }

    /// Whether the twin already uses compiled steps.
    pub fn is_compiled(&self) -> bool {
        self.is_compiled
    }

    /// The sensor values that the twin expects at the last sample.
    pub fn expected(&self) -> &[f64] {
        &self.expected
    }

    /// A variable of the twin at the last sample.
    pub(crate) fn value(&self, slot: Slot) -> f64 {
        self.twin.value(slot)
    }

    /// The session of the diagnosis.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// Follows a reaction of the flight control computer to an actuator: from the next sample on, the twin has the
    /// parameters of the reaction. Its inputs come with the samples.
    ///
    /// # Errors
    /// The actuator does not exist.
    pub fn follow(&mut self, actuator: usize, reaction: &Reaction) -> Result<(), RuntimeError> {
        if reaction.switches_off {
            self.session.switched_off(actuator)?;
        }
        reaction.takes_out.iter().try_for_each(|&sensor| self.take_out(sensor, true))?;
        let stands = (actuator, reaction.clone());
        if !self.reactions.contains(&stands) {
            self.reactions.push(stands);
            self.reactions.sort_by_key(|(actuator, _)| *actuator);
        }
        self.load();
        Ok(())
    }

    /// Undoes the reactions to an actuator, which is on and judged again. A shutdown that was raised for it stands.
    ///
    /// # Errors
    /// The actuator does not exist.
    pub fn release(&mut self, actuator: usize) -> Result<(), RuntimeError> {
        self.session.switched_on(actuator)?;
        let (undone, stand): (Vec<_>, Vec<_>) =
            std::mem::take(&mut self.reactions).into_iter().partition(|(of, _)| *of == actuator);
        self.reactions = stand;
        for sensor in undone.iter().flat_map(|(_, reaction)| &reaction.takes_out) {
            let is_out = self.reactions.iter().any(|(_, stands)| stands.takes_out.contains(sensor));
            self.take_out(*sensor, is_out)?;
        }
        self.load();
        Ok(())
    }

    fn take_out(&mut self, sensor: usize, is_out: bool) -> Result<(), RuntimeError> {
        if let Some(place) = place_of(sensor, self.study, self.session.diagnoser()) {
            self.session.take_out(place, is_out)?;
        }
        Ok(())
    }

    /// Withdraws everything that was raised. All is judged anew, also a fault that lasts.
    pub(crate) fn reset_alarm(&mut self) {
        self.session.reset_alarm();
    }

    /// Restarts twin and diagnosis, because later samples are unrelated to earlier ones. Actuators that are off stay off.
    pub(crate) fn restart(&mut self) {
        self.is_settled = false;
        self.buses.fill(Bus::default());
        self.session.restart();
    }

    /// Whether the system has the actuator, the parameters and the sensors of a reaction.
    fn is_possible(&self, actuator: usize, reaction: &Reaction) -> bool {
        let parameters = self.parameters();
        let has = |&(component, parameter, value): &(usize, usize, f64)| {
            let own = parameters.get(component).map_or(0, Vec::len);
            parameter < own && value.is_finite()
        };
        actuator < self.session.diagnoser().names().actuators.len()
            && reaction.parameters.iter().all(has)
            && reaction.takes_out.iter().all(|&sensor| sensor < self.study.sensors.0.len())
    }

    /// The complete state.
    pub fn save(&self) -> Checkpoint {
        let twin = self.is_settled.then(|| {
            let mut snapshot = Snapshot::default();
            self.twin.save(&mut snapshot);
            snapshot
        });
        let buses = self.buses.iter().map(Bus::memory).collect();
        let reactions = self.reactions.clone();
        Checkpoint { twin, session: self.session.save(), buses, reactions }
    }

    /// Resumes from the state of a runtime with the same study and diagnoser.
    ///
    /// # Errors
    /// The state does not fit. The runtime must not be used then.
    pub(crate) fn restore(&mut self, checkpoint: &Checkpoint) -> Result<(), RuntimeError> {
        if checkpoint.buses.len() != self.buses.len() {
            return Err(Error::CorruptModel { broken: "the checkpoint has other inputs" }.into());
        }
        let mut memories = checkpoint.buses.iter();
        let is_finite = |&(last, slope): &(Option<f64>, f64)| {
            last.is_none_or(f64::is_finite) && slope.is_finite()
        };
        if !memories.all(is_finite) {
            return Err(
                Error::CorruptModel { broken: "an input of the checkpoint is no number" }.into()
            );
        }
        self.session.restore(&checkpoint.session)?;
        let switches_off = |actuator: usize| {
            let mut reactions = checkpoint.reactions.iter();
            reactions.any(|(of, reaction)| *of == actuator && reaction.switches_off)
        };
        if !checkpoint
            .reactions
            .iter()
            .all(|(actuator, reaction)| self.is_possible(*actuator, reaction))
        {
            let broken = "a reaction of the checkpoint is none of the system";
            return Err(Error::CorruptModel { broken }.into());
        }
        let actuators = 0..self.session.diagnoser().names().actuators.len();
        if actuators
            .into_iter()
            .any(|actuator| switches_off(actuator) != self.session.is_off(actuator))
        {
            let broken = "the checkpoint contradicts itself about what is off";
            return Err(Error::CorruptModel { broken }.into());
        }
        self.reactions.clone_from(&checkpoint.reactions);
        self.load();
        let buses = self.buses.iter_mut().zip(&mut self.accepted).zip(&checkpoint.buses);
        for ((bus, accepted), &memory) in buses {
            *bus = Bus::from_memory(memory);
            accepted.value = memory.0.unwrap_or(accepted.value);
        }
        self.is_settled = false;
        if let Some(snapshot) = &checkpoint.twin {
            let wrong = |broken| Error::CorruptModel { broken };
            self.twin.restore(snapshot).map_err(wrong)?;
            self.is_settled = true;
        }
        Ok(())
    }
}
