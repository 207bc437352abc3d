//! Closed loop, as in the seed paper's figure 2: a plant with a fault, the real-time twin, the diagnosis, and a flight
//! control computer that executes the raised actions.

use super::runtime::{self, Runtime, RuntimeError};
use crate::rest::Stopped;
use crate::run::{SensorChain, SpecimenDraw};
use crate::signal::bus::Bus;
use crate::study::{Reaction, Scenario, Stream, Study};
use crate::system::reservoir::Level;
use servotwin_diagnosis::diagnoser::{Alarm, Diagnoser, IndexedFinding, Raised, Session};
use servotwin_model::program::{FaultAt, Slot};
use servotwin_model::signal::Piecewise;
use servotwin_model::solver::{Knot, SolverSettings, Twin};
use std::sync::Arc;

/// The flight to simulate.
pub struct ClosedLoop<'s> {
    /// The study of the plant and its twin.
    pub study: &'s Study,
    /// One signal per input of the system.
    pub inputs: Vec<Piecewise>,
    /// Onset times of faults, s; empty for a healthy flight.
    pub faults: Vec<(f64, FaultAt)>,
    /// Duration of the flight, s.
    pub duration_s: f64,
    /// The specimen's number; `None` for one without tolerances.
    pub specimen: Option<usize>,
    /// Whether raised actions are executed.
    pub reacts: bool,
}

/// An action of the flight control computer.
#[derive(Clone, Debug, PartialEq)]
pub struct Action {
    /// Time of the action, s.
    pub time_s: f64,
    /// The raised action.
    pub raised: Raised,
    /// The reaction that was executed.
    pub reaction: Reaction,
}

/// A change in the output of the diagnosis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// Time of the change, s.
    pub time_s: f64,
    /// The new finding.
    pub finding: IndexedFinding,
    /// The new state of the alarm.
    pub alarm: Alarm,
    /// The confidence of the finding.
    pub confidence: f64,
}

/// The record of a flight.
#[derive(Clone, Debug, Default)]
pub struct FlightRecord {
    /// Times of the samples, s.
    pub time_s: Vec<f64>,
    /// The requested plant variables, one list per slot.
    pub plant: Vec<Vec<f64>>,
    /// The commanded inputs, one list each.
    pub inputs: Vec<Vec<f64>>,
    /// The sensor values, one list each.
    pub measured: Vec<Vec<f64>>,
    /// The values that the twin expected, one list each.
    pub twin: Vec<Vec<f64>>,
    /// The residuals in parts of scale and spread, one list for each sensor of the diagnoser.
    pub residuals: Vec<Vec<f64>>,
    /// The fluid left in each of the system's reservoirs, m³, one list each.
    pub fluid_m3: Vec<Vec<f64>>,
    /// The changes in the output of the diagnosis.
    pub changes: Vec<Change>,
    /// The executed actions.
    pub actions: Vec<Action>,
}

/// Flies a plan and records the requested plant variables.
///
/// # Errors
/// The diagnoser does not fit the study, or plant or twin cannot be simulated.
pub fn fly(
    plan: &ClosedLoop,
    diagnoser: &Arc<Diagnoser>,
    keep: &[Slot],
) -> Result<FlightRecord, RuntimeError> {
    fly_watched(plan, diagnoser, keep, |_, _| ())
}

/// The same; `watch` takes the index of every sample and the session behind it.
pub(crate) fn fly_watched(
    plan: &ClosedLoop,
    diagnoser: &Arc<Diagnoser>,
    keep: &[Slot],
    mut watch: impl FnMut(u64, &Session),
) -> Result<FlightRecord, RuntimeError> {
    let mut flight = ClosedLoopFlight::new(plan, diagnoser)?;
    let count = |list: usize| vec![Vec::new(); list];
    let sensors = flight.measured.len();
    let mut record = FlightRecord {
        plant: count(keep.len()),
        inputs: count(plan.inputs.len()),
        measured: count(sensors),
        twin: count(sensors),
        residuals: count(sensors),
        fluid_m3: count(flight.reservoirs.len()),
        ..FlightRecord::default()
    };
    let samples = (plan.duration_s / flight.period_s + 1e-6) as usize;
    for index in 0..=samples {
        let change = flight.sample()?;
        watch(index as u64, flight.session());
        record.time_s.push(flight.time_s());
        push(&mut record.plant, keep.iter().map(|&slot| flight.plant(slot)));
        push(&mut record.inputs, flight.inputs.iter().copied());
        push(&mut record.measured, flight.measured.iter().copied());
        push(&mut record.twin, flight.expected().iter().copied());
        push(&mut record.residuals, flight.residuals());
        push(&mut record.fluid_m3, flight.fluid_m3());
        record.changes.extend(change);
        if plan.reacts {
            record.actions.extend(flight.react()?);
        }
    }
    Ok(record)
}

fn push(columns: &mut [Vec<f64>], values: impl Iterator<Item = f64>) {
    columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
}

/// A flight that is advanced sample by sample.
pub struct ClosedLoopFlight<'f> {
    plan: &'f ClosedLoop<'f>,
    period_s: f64,
    /// The number of samples so far.
    samples: usize,
    plant: Twin<'f>,
    /// Faults that were injected by hand, beside those of the plan.
    injected: Vec<FaultAt>,
    /// The plant's parameters that differ from the system's.
    overrides: Vec<(usize, usize, f64)>,
    /// The number of faults that have begun.
    begun: usize,
    slots: Vec<Slot>,
    sensors: SensorChain,
    runtime: Runtime<'f>,
    /// The inputs at the current sample, as received from their buses.
    inputs: Vec<f64>,
    buses: Vec<Bus>,
    knots: Vec<Knot>,
    reservoirs: Vec<Level>,
    /// Inputs overridden by the flight control computer.
    set: Vec<(usize, f64)>,
    measured: Vec<f64>,
    last: Option<(IndexedFinding, Alarm)>,
    done: Option<u64>,
}

impl<'f> ClosedLoopFlight<'f> {
    /// A flight before its first sample.
    ///
    /// # Errors
    /// The diagnoser does not fit the study.
    pub fn new(plan: &'f ClosedLoop<'f>, diagnoser: &Arc<Diagnoser>) -> Result<Self, RuntimeError> {
        let ClosedLoop { study, specimen, .. } = *plan;
        let period_s = diagnoser.period_s;
        let names = diagnoser.sensors.iter().map(|sensor| sensor.name.as_str());
        let slots = runtime::slots(study, names)?;
        let seed = study.seed_of("closed_loop", specimen.unwrap_or(0));
        let draw = SpecimenDraw { study, scenario: Scenario::Realistic, seed };
        let overrides = specimen.map_or(vec![], |_| draw.parameters(1.0));
        let noise = seed.stream(Stream::Sensors);
        let program = &study.system.program;
        let mut plant =
            Twin::new(program, SolverSettings::of_runs(), period_s, runtime::between(study));
        plant.load(&program.parameters_with(&overrides, &[]));
        Ok(ClosedLoopFlight {
            plan,
            period_s,
            samples: 0,
            plant,
            injected: vec![],
            overrides,
            begun: 0,
            measured: vec![0.0; slots.len()],
            sensors: SensorChain::new(study, slots.len(), Some(noise)),
            slots,
            runtime: Runtime::new(study, diagnoser.clone(), vec![])?.at_rest(),
            inputs: vec![0.0; plan.inputs.len()],
            buses: vec![Bus::default(); plan.inputs.len()],
            knots: runtime::defaults(study),
            reservoirs: study
                .system
                .reservoirs
                .iter()
                .map(|r| Level::full(&study.system, r))
                .collect(),
            set: vec![],
            last: None,
            done: None,
        })
    }

    /// The time of the last sample, s.
    pub fn time_s(&self) -> f64 {
        self.samples.saturating_sub(1) as f64 * self.period_s
    }

    /// A variable of the plant at the last sample.
    pub fn plant(&self, slot: Slot) -> f64 {
        self.plant.value(slot)
    }

    /// The inputs at the last sample, SI.
    pub fn inputs(&self) -> &[f64] {
        &self.inputs
    }

    /// The sensor values at the last sample, SI.
    pub fn measured(&self) -> &[f64] {
        &self.measured
    }

    /// The sensor values that the twin expected at the last sample, SI.
    pub fn expected(&self) -> &[f64] {
        self.runtime.expected()
    }

    /// The residuals at the last sample, as [`Session::residual`].
    pub(crate) fn residuals(&self) -> impl Iterator<Item = f64> {
        let pairs = self.measured.iter().zip(self.expected()).enumerate();
        pairs.map(|(sensor, (&value, &twin))| self.session().residual(sensor, value, twin))
    }

    /// The fluid left in each of the system's reservoirs, m³.
    pub fn fluid_m3(&self) -> impl Iterator<Item = f64> {
        self.reservoirs.iter().map(Level::fluid_m3)
    }

    /// The session of the diagnosis.
    pub fn session(&self) -> &Session {
        self.runtime.session()
    }

    /// Lets these faults act from the next sample on, beside those of the plan and instead of those injected
    /// before.
    pub fn inject(&mut self, faults: Vec<FaultAt>) {
        self.injected = faults;
        self.load(self.samples as f64 * self.period_s);
    }

    /// Advances by one sample; returns a change in the output of the diagnosis.
    ///
    /// # Errors
    /// Plant or twin cannot be simulated.
    pub fn sample(&mut self) -> Result<Option<Change>, RuntimeError> {
        let time_s = self.samples as f64 * self.period_s;
        for (value, signal) in self.inputs.iter_mut().zip(&self.plan.inputs) {
            *value = signal.value(time_s);
        }
        for &(input, value) in &self.set {
            self.inputs[input] = value;
        }
        self.reservoirs.iter().for_each(|level| level.limit(&mut self.inputs));
        let sent = self.inputs.iter().zip(&mut self.buses);
        for (knot, (&value, bus)) in self.knots.iter_mut().zip(sent) {
            *knot = bus.next(value, self.period_s);
        }
        self.step_plant(time_s)?;
        self.samples += 1;
        let plant = &self.plant;
        self.reservoirs.iter_mut().for_each(|l| l.take(self.period_s, |slot| plant.value(slot)));
        for (measured, &slot) in self.measured.iter_mut().zip(&self.slots) {
            *measured = self.plant.value(slot);
        }
        self.sensors.measure(&mut self.measured);
        let outcome = self.runtime.push(&self.inputs, &self.measured)?;
        let said = (outcome.finding, outcome.alarm);
        let (finding, alarm) = said;
        let change = Change { time_s, finding, alarm, confidence: outcome.confidence };
        let is_new = self.last.replace(said) != Some(said);
        Ok(is_new.then_some(change))
    }

    fn step_plant(&mut self, time_s: f64) -> Result<(), RuntimeError> {
        let program = self.plant.program();
        let begun = self.plan.faults.iter().filter(|(onset_s, _)| time_s >= *onset_s).count();
        if begun > self.begun {
            self.begun = begun;
            self.load(time_s);
        }
        let stepped = if self.samples == 0 {
            let parameters = program.parameters_with(&self.overrides, &[]);
            self.plant.settle(&self.knots, &program.first_guess(&parameters))
        } else {
            self.plant.step(&self.knots)
        };
        let system = &self.plan.study.system;
        stepped.map_err(|failure| RuntimeError::Twin(Stopped::new(system, failure)))
    }

    fn load(&mut self, time_s: f64) {
        let begun = self.plan.faults.iter().filter(|(onset_s, _)| time_s >= *onset_s);
        let faults: Vec<FaultAt> =
            begun.map(|(_, fault)| *fault).chain(self.injected.iter().copied()).collect();
        let program = self.plant.program();
        self.plant.load(&program.parameters_with(&self.overrides, &faults));
    }

    /// Executes a newly raised action, effective from the next sample.
    ///
    /// # Errors
    /// The reaction names an actuator or a sensor that the diagnoser does not have.
    pub fn react(&mut self) -> Result<Option<Action>, RuntimeError> {
        let raised = self.runtime.session().outcome().raised;
        let Some(raised) = raised.filter(|raised| self.done != Some(raised.sample)) else {
            return Ok(None);
        };
        self.done = Some(raised.sample);
        let names = self.runtime.session().diagnoser().names();
        let detail = raised.detail.map(|detail| names.details[detail as usize].as_str());
        let action = &names.actions[raised.action as usize];
        let actuator = &names.actuators[raised.actuator as usize];
        let study = self.plan.study;
        let place = study.actuators.iter().position(|known| known == actuator).unwrap_or(0);
        let reaction = study.reactions.of(place, action, detail);
        self.set.extend(reaction.inputs.iter().copied());
        self.overrides.extend(reaction.parameters.iter().copied());
        let time_s = self.time_s();
        self.load(time_s);
        self.runtime.follow(raised.actuator as usize, &reaction)?;
        Ok(Some(Action { time_s, raised, reaction }))
    }
}
