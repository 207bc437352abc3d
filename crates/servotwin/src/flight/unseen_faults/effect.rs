//! Effects of an unseen fault: changes of the plant, the sensor readings, or the twin's inputs.

use crate::ensemble::Later;
use crate::run::Run;
use crate::signal::bus::sent;
use crate::signal::random::NormalDeviates;
use crate::study::Study;
use crate::study::faults::full_name;
use crate::study::flights::Environment;
use crate::system::imperfection::Imperfection;
use EffectKind::{
    Drift, Fault, Grows, InputTimes, Missing, Noise, Pulses, Swing, Times, TwinFrozen,
    TwinImpossible, TwinLate, TwinMissing, TwinOff, Value, Weather,
};
use serde::Deserialize;
use servotwin_diagnosis::features::Quantity;
use servotwin_model::program::FaultAt;
use servotwin_model::signal::Piecewise;
use std::f64::consts::TAU;

/// What an effect does to what it changes, and what its size is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum EffectKind {
    /// A fault of the catalogue; its intensity.
    Fault,
    /// The same, present and absent for [`PULSE_S`] in turn: shorter than in training.
    Pulses,
    /// The same, growing from nothing within [`GROWTH_S`]: slower than in training.
    Grows,
    /// A parameter has another value.
    Value,
    /// A parameter is multiplied by a factor.
    Times,
    /// A parameter grows at a rate per second.
    Drift,
    /// A parameter oscillates with an amplitude, at [`SWING_HZ`].
    Swing,
    /// A sensor has no reading.
    Missing,
    /// A sensor's noise is multiplied by a factor.
    Noise,
    /// An input is multiplied by a factor, for the plant and the twin.
    InputTimes,
    /// A parameter of the environment has another value during the whole flight, for the plant and the twin.
    Weather,
    /// The twin's input freezes at its value.
    TwinFrozen,
    /// The twin's input is missing.
    TwinMissing,
    /// The twin's input has an impossible value.
    TwinImpossible,
    /// The twin's input is wrong by a fraction.
    TwinOff,
    /// The twin's input arrives late by a time, s.
    TwinLate,
}

/// Frequency of oscillations, Hz.
const SWING_HZ: f64 = 1.5;
/// How long a pulsing fault is present, and absent, s.
const PULSE_S: f64 = 0.25;
/// How long a growing fault takes to reach its intensity, s.
const GROWTH_S: f64 = 8.0;
/// Interval at which continuous changes are updated, s.
const STEP_S: f64 = 0.05;
/// How long an input takes to change, s.
const FALL_S: f64 = 0.5;
/// A value larger than any input can have.
const TOO_LARGE: f64 = 1e9;

/// The actuators that an effect applies to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Who {
    /// The actuator at fault.
    Own,
    /// The next actuator, which is then also at fault.
    Other,
    /// All actuators, none of which is at fault.
    All,
}

/// One effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Effect {
    /// The actuators that it applies to.
    pub(crate) who: Who,
    /// What it does.
    pub(crate) kind: EffectKind,
    /// What it changes: a fault, parameter or input without the actuator's name, or the quantity of a sensor.
    pub(crate) of: &'static str,
    /// Its size.
    pub(crate) size: f64,
}

/// An effect on an actuator, with what it changes.
#[derive(Clone, Copy, Debug)]
struct Change {
    kind: EffectKind,
    size: f64,
    place: Place,
}

#[derive(Clone, Copy, Debug)]
enum Place {
    Fault(FaultAt),
    /// A component and its parameter.
    Parameter(usize, usize),
    Sensor(usize),
    Input(usize),
}

/// All changes of an unseen fault in a flight.
#[derive(Clone, Debug, Default)]
pub(crate) struct Changes {
    list: Vec<Change>,
    /// The actuators at fault.
    pub(crate) at_fault: Vec<usize>,
    /// Healthy actuators whose twin reads a boundary value (a pressure at a port) from a wrong sensor.
    pub(crate) misinformed: Vec<usize>,
}

impl Changes {
    /// Resolves effects on an actuator; `None` if the study lacks one of the names.
    pub(crate) fn new(
        study: &Study,
        actuator: usize,
        effects: impl Iterator<Item = Effect>,
    ) -> Option<Self> {
        let actuators = study.actuators.len();
        let mut changes = Changes::default();
        for effect in effects {
            let of: Vec<usize> = match effect.who {
                Who::Own => vec![actuator],
                Who::Other if actuators > 1 => vec![(actuator + 1) % actuators],
                Who::Other => return None,
                Who::All => (0..actuators).collect(),
            };
            for &actuator in &of {
                changes.list.push(resolved(study, actuator, effect)?);
            }
            match effect.who {
                Who::All => (),
                _ if effect.kind.is_of_twin() => {
                    changes.misinformed.extend(readers(study, actuator, effect.of));
                }
                _ => changes.at_fault.extend(of),
            }
        }
        let Changes { at_fault, misinformed, .. } = &mut changes;
        misinformed.retain(|actuator| !at_fault.contains(actuator));
        Some(changes)
    }

    /// The environment of the plant and of the twin; `None` if unchanged.
    pub(crate) fn environments(
        &self,
        was: &Environment,
        flight: &Run,
        period_s: f64,
    ) -> [Option<Environment>; 2] {
        let one = |is_twin: bool| {
            let (mut environment, mut is_changed) = (was.clone(), false);
            for &Change { kind, size, place } in &self.list {
                match place {
                    Place::Parameter(component, parameter) if kind == Weather => {
                        environment.parameters.push((component, parameter, size));
                    }
                    Place::Input(input) if is_twin || !kind.is_of_twin() => {
                        let signal = &environment.inputs[input];
                        environment.inputs[input] = altered(signal, (kind, size), flight, period_s);
                    }
                    _ => continue,
                }
                is_changed = true;
            }
            is_changed.then_some(environment)
        };
        [false, true].map(one)
    }

    /// Faults and parameter changes from the onset on. `overrides` are those of the variant.
    pub(crate) fn later(
        &self,
        study: &Study,
        flight: &Run,
        overrides: &[(usize, usize, f64)],
    ) -> Vec<Later> {
        let is_of_plant = |change: &&Change| match change.place {
            Place::Fault(_) => true,
            Place::Parameter(..) => change.kind != Weather,
            Place::Sensor(_) | Place::Input(_) => false,
        };
        let own: Vec<&Change> = self.list.iter().filter(is_of_plant).collect();
        let at = |time_s: f64| {
            let age_s = time_s - flight.onset_s;
            let mut later = Later { time_s, ..Later::default() };
            for change in &own {
                match change.place {
                    Place::Fault(fault) => {
                        let intensity = fault.intensity * change.kind.share(age_s);
                        later.faults.push(FaultAt { intensity, ..fault });
                    }
                    Place::Parameter(component, parameter) => {
                        let value = change.moved(study, (component, parameter), age_s, overrides);
                        later.overrides.push((component, parameter, value));
                    }
                    Place::Sensor(_) | Place::Input(_) => (),
                }
            }
            later
        };
        let moments = match () {
            () if own.is_empty() => 0,
            () if own.iter().all(|change| !change.kind.moves()) => 1,
            () => ((flight.duration_s - flight.onset_s) / STEP_S).ceil() as u32,
        };
        (0..moments).map(|k| at(flight.onset_s + STEP_S * f64::from(k))).collect()
    }
}

impl EffectKind {
    fn moves(self) -> bool {
        matches!(self, Drift | Swing | Pulses | Grows)
    }

    /// Whether only the twin reads an input wrong, while the plant is unchanged.
    fn is_of_twin(self) -> bool {
        matches!(self, TwinFrozen | TwinMissing | TwinImpossible | TwinOff | TwinLate)
    }

    /// The share of its intensity that a fault has at an age, s.
    fn share(self, age_s: f64) -> f64 {
        match self {
            // The age is a multiple of the step, up to rounding.
            Pulses => {
                let pulse = ((age_s + 0.5 * STEP_S) / PULSE_S) as u64;
                f64::from(u8::from(pulse.is_multiple_of(2)))
            }
            Grows => (age_s / GROWTH_S).min(1.0),
            _ => 1.0,
        }
    }
}

/// The actuators whose twin reads an input: the one that owns it, or all that share it.
fn readers(study: &Study, actuator: usize, input: &str) -> Vec<usize> {
    let own = full_name(&study.actuators[actuator], input);
    match study.system.network().inputs.iter().any(|known| known.id == own) {
        true => vec![actuator],
        false => (0..study.actuators.len()).collect(),
    }
}

/// Resolves an effect on an actuator; `None` if a name does not exist.
fn resolved(study: &Study, actuator: usize, effect: Effect) -> Option<Change> {
    let Effect { kind, of, mut size, .. } = effect;
    let name = full_name(&study.actuators[actuator], of);
    let place = match kind {
        Fault | Pulses | Grows => {
            let (component, fault) = study.system.program.find_fault(&name)?;
            Place::Fault(FaultAt { component, fault, intensity: size })
        }
        Value | Times | Drift | Swing | Weather => {
            let (component, parameter) = study.system.parameter(&name)?;
            if kind == Weather {
                // Conditions that the liquid does not allow are not flown.
                study.system.allows(component, parameter, size).ok()?;
            }
            Place::Parameter(component, parameter)
        }
        Missing | Noise => {
            let (quantity, _) = Quantity::ALL.into_iter().find(|(_, own)| *own == of)?;
            let sensor = study.sensors.find(quantity, actuator)?;
            if kind == Noise {
                // What must be added to the sensor's own noise.
                let own = Imperfection::of(&study.system, study.measured[sensor]).deviation();
                size = own * (size * size - 1.0).sqrt();
            }
            Place::Sensor(sensor)
        }
        // An input of the actuator, or of the whole system.
        InputTimes | TwinFrozen | TwinMissing | TwinImpossible | TwinOff | TwinLate => {
            let find = |name: &str| study.system.find_input(name).ok();
            Place::Input(find(&name).or_else(|| find(of))?)
        }
    };
    Some(Change { kind, size, place })
}

/// An input with the change from the onset on. An impossible or missing value is not accepted: the twin keeps the last one.
fn altered(
    was: &Piecewise,
    (kind, size): (EffectKind, f64),
    flight: &Run,
    period_s: f64,
) -> Piecewise {
    let onset_s = (flight.onset_s / period_s).floor() * period_s;
    let value = |time_s: f64| {
        let risen = ((time_s - onset_s) / FALL_S).clamp(0.0, 1.0);
        match kind {
            InputTimes => was.value(time_s) * (1.0 + (size - 1.0) * risen),
            TwinOff => was.value(time_s) * (1.0 + size * risen),
            TwinLate => was.value((time_s - size).max(0.0)),
            _ => was.value(time_s.min(onset_s)),
        }
    };
    sent(value, period_s, flight.duration_s).expect("a finite signal")
}

impl Change {
    /// A changed parameter at a time after the onset, within its range.
    fn moved(
        &self,
        study: &Study,
        (component, parameter): (usize, usize),
        age_s: f64,
        overrides: &[(usize, usize, f64)],
    ) -> f64 {
        let instance = &study.system.network().components[component];
        let own = overrides.iter().rev().find(|o| (o.0, o.1) == (component, parameter));
        let was = own.map_or(instance.parameters[parameter], |own| own.2);
        let value = match self.kind {
            Value => self.size,
            Times => was * self.size,
            Drift => was + self.size * age_s,
            Swing => was + self.size * (TAU * SWING_HZ * age_s).sin(),
            _ => was,
        };
        let (min, max) = instance.range(parameter);
        value.clamp(min, max)
    }
}

/// Applies changes to readings and inputs before the diagnosis.
pub(crate) struct Touched {
    changes: Vec<Change>,
    onset: usize,
    random: NormalDeviates,
    /// The readings of the last sample.
    pub(crate) measured: Vec<f64>,
    /// The inputs of the last sample.
    pub(crate) inputs: Vec<f64>,
}

impl Touched {
    /// Applies the changes from the sample `onset` on.
    pub(crate) fn new(changes: &Changes, onset: usize, random: NormalDeviates) -> Self {
        let changes = changes.list.clone();
        Touched { changes, onset, random, measured: vec![], inputs: vec![] }
    }

    /// Takes a sample and applies the changes.
    pub(crate) fn take(&mut self, index: usize, measured: &[f64], inputs: &[f64]) {
        self.measured.clear();
        self.measured.extend_from_slice(measured);
        self.inputs.clear();
        self.inputs.extend_from_slice(inputs);
        if index < self.onset {
            return;
        }
        for &Change { kind, size, place } in &self.changes {
            match (place, kind) {
                (Place::Sensor(sensor), Missing) => self.measured[sensor] = f64::NAN,
                (Place::Sensor(sensor), _) => self.measured[sensor] += size * self.random.normal(),
                (Place::Input(input), TwinMissing) => self.inputs[input] = f64::NAN,
                (Place::Input(input), TwinImpossible) => self.inputs[input] = TOO_LARGE,
                _ => (),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pulses_alternate_and_growth_ends_at_the_intensity() {
        let shares: Vec<f64> = (0..15).map(|k| Pulses.share(STEP_S * f64::from(k))).collect();
        assert_eq!(shares, [[1.0; 5], [0.0; 5], [1.0; 5]].concat());
        assert_eq!([0.0, 2.0, 8.0, 9.0].map(|age_s| Grows.share(age_s)), [0.0, 0.25, 1.0, 1.0]);
        assert_eq!(Fault.share(3.0), 1.0);
    }
}
