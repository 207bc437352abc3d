//! Effects of an unseen fault: changes of the plant, the sensor readings, or the twin's inputs.

use crate::ensemble::Later;
use crate::run::Run;
use crate::signal::bus::sent;
use crate::signal::random::NormalDeviates;
use crate::study::Study;
use crate::study::faults::full_name;
use crate::study::flights::Environment;
use crate::system::imperfection::Imperfection;
use servotwin_diagnosis::features::Quantity;
use servotwin_model::program::FaultAt;
use servotwin_model::signal::Piecewise;
use std::f64::consts::TAU;

/// One effect. Names of parameters, faults and inputs omit the unit's name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Effect {
    /// A fault of the catalogue at an intensity.
    Fault(&'static str, f64),
    /// The same, present and absent for [`PULSE_S`] in turn: shorter than in training.
    Pulses(&'static str, f64),
    /// The same, growing from nothing within [`GROWTH_S`]: slower than in training.
    Grows(&'static str, f64),
    /// Sets a parameter to a value.
    Value(&'static str, f64),
    /// Multiplies a parameter by a factor.
    Times(&'static str, f64),
    /// Lets a parameter grow at a rate per second.
    Drift(&'static str, f64),
    /// Lets a parameter oscillate with an amplitude, at [`SWING_HZ`].
    Swing(&'static str, f64),
    /// A sensor has no reading.
    Missing(Quantity),
    /// Multiplies a sensor's noise by a factor.
    Noise(Quantity, f64),
    /// Multiplies an input by a factor, for the plant and the twin.
    InputTimes(&'static str, f64),
    /// Sets a parameter of the environment during the whole flight, for the plant and the twin.
    Weather(&'static str, f64),
    /// The twin's input freezes at its value.
    ToldFrozen(&'static str),
    /// The twin's input is missing.
    ToldMissing(&'static str),
    /// The twin's input has an impossible value.
    ToldTooLarge(&'static str),
    /// The twin's input is wrong by a fraction.
    ToldOff(&'static str, f64),
    /// The twin's input arrives late by a time, s.
    ToldLate(&'static str, f64),
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

/// The units that an effect applies to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Who {
    /// The unit at fault.
    Own,
    /// The next unit, which is then also at fault.
    Other,
    /// All units, none of which is at fault.
    Whole,
}

/// An effect with the units it applies to.
pub(crate) type On = (Who, Effect);

/// An effect on the unit at fault.
pub(crate) fn own(effect: Effect) -> On {
    (Who::Own, effect)
}

/// An effect on the next unit, which is then also at fault.
pub(crate) fn other(effect: Effect) -> On {
    (Who::Other, effect)
}

/// An effect on all units.
pub(crate) fn whole(effect: Effect) -> On {
    (Who::Whole, effect)
}

/// A change of a reading or an input on its way to the diagnosis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Touch {
    /// The reading is missing.
    Reading(usize),
    /// A reading has additional noise with this standard deviation.
    Noisy(usize, f64),
    /// The input has another value.
    Input(usize, f64),
}

/// An effect on a specific system, with names resolved.
#[derive(Clone, Debug)]
enum Change {
    /// A fault at its largest intensity, with the effect that describes how it develops.
    Fault(FaultAt, Effect),
    /// A parameter, changed depending on its value and the time since the onset.
    Parameter(usize, usize, Effect),
    Touch(Touch),
    /// An input, and whether the change applies to the plant and to the twin.
    Input {
        input: usize,
        effect: Effect,
        in_plant: bool,
        in_twin: bool,
    },
    Weather(usize, usize, f64),
}

/// All changes of an unseen fault in a flight.
#[derive(Clone, Debug, Default)]
pub(crate) struct Changes {
    list: Vec<Change>,
    /// The units at fault.
    pub at_fault: Vec<usize>,
    /// Healthy units whose twin reads a boundary value (a pressure at a port) from a wrong sensor.
    pub misinformed: Vec<usize>,
}

impl Changes {
    /// Resolves effects on a unit; `None` if the study lacks one of the names.
    pub(crate) fn new(study: &Study, unit: usize, effects: &[On]) -> Option<Self> {
        let units = study.units.len();
        let mut changes = Changes::default();
        for &(who, effect) in effects {
            let of: Vec<usize> = match who {
                Who::Own => vec![unit],
                Who::Other if units > 1 => vec![(unit + 1) % units],
                Who::Other => return None,
                Who::Whole => (0..units).collect(),
            };
            for &unit in &of {
                changes.list.extend(resolved(study, unit, effect)?);
            }
            if who == Who::Whole {
                continue;
            }
            match effect.misinforms() {
                Some(input) => changes.misinformed.extend(readers(study, unit, input)),
                None => changes.at_fault.extend(of),
            }
        }
        let Changes { at_fault, misinformed, .. } = &mut changes;
        misinformed.retain(|unit| !at_fault.contains(unit));
        Some(changes)
    }

    /// The changes of readings and inputs on their way to the diagnosis, from the onset on.
    pub(crate) fn touches(&self) -> Vec<Touch> {
        let touch = |change: &Change| match change {
            Change::Touch(touch) => Some(*touch),
            _ => None,
        };
        self.list.iter().filter_map(touch).collect()
    }

    /// The environment of the plant and of the twin; `None` if unchanged.
    pub(crate) fn environments(
        &self,
        was: &Environment,
        flight: &Run,
        period_s: f64,
    ) -> [Option<Environment>; 2] {
        let one = |is_of: &dyn Fn(bool, bool) -> bool| {
            let (mut environment, mut is_changed) = (was.clone(), false);
            for change in &self.list {
                match *change {
                    Change::Weather(component, parameter, value) => {
                        environment.parameters.push((component, parameter, value));
                        is_changed = true;
                    }
                    Change::Input { input, effect, in_plant, in_twin }
                        if is_of(in_plant, in_twin) =>
                    {
                        let signal = &environment.inputs[input];
                        environment.inputs[input] = altered(signal, effect, flight, period_s);
                        is_changed = true;
                    }
                    _ => (),
                }
            }
            is_changed.then_some(environment)
        };
        [one(&|plant, _| plant), one(&|_, twin| twin)]
    }

    /// Faults and parameter changes from the onset on. `overrides` are those of the variant.
    pub(crate) fn later(
        &self,
        study: &Study,
        flight: &Run,
        overrides: &[(usize, usize, f64)],
    ) -> Vec<Later> {
        let is_held = |change: &Change| match change {
            Change::Fault(_, effect) | Change::Parameter(_, _, effect) => !effect.moves(),
            _ => true,
        };
        let is_plant = |c: &&Change| matches!(c, Change::Fault(..) | Change::Parameter(..));
        let own: Vec<&Change> = self.list.iter().filter(is_plant).collect();
        let at = |time_s: f64| {
            let mut later = Later { time_s, ..Later::default() };
            for change in &own {
                match change {
                    Change::Fault(fault, effect) => {
                        let intensity = fault.intensity * effect.share(time_s - flight.onset_s);
                        later.faults.push(FaultAt { intensity, ..*fault });
                    }
                    Change::Parameter(component, parameter, effect) => {
                        let place = (*component, *parameter);
                        let value =
                            moved(study, place, *effect, time_s - flight.onset_s, overrides);
                        later.overrides.push((place.0, place.1, value));
                    }
                    _ => (),
                }
            }
            later
        };
        let moments = match () {
            () if own.is_empty() => 0,
            () if own.iter().all(|change| is_held(change)) => 1,
            () => ((flight.duration_s - flight.onset_s) / STEP_S).ceil() as u32,
        };
        (0..moments).map(|k| at(flight.onset_s + STEP_S * f64::from(k))).collect()
    }
}

impl Effect {
    fn moves(self) -> bool {
        use Effect::{Drift, Grows, Pulses, Swing};
        matches!(self, Drift(..) | Swing(..) | Pulses(..) | Grows(..))
    }

    /// The share of its intensity that a fault has at an age, s.
    fn share(self, age_s: f64) -> f64 {
        match self {
            // The age is a multiple of the step, up to rounding.
            Effect::Pulses(..) => {
                let pulse = ((age_s + 0.5 * STEP_S) / PULSE_S) as u64;
                f64::from(u8::from(pulse.is_multiple_of(2)))
            }
            Effect::Grows(..) => (age_s / GROWTH_S).min(1.0),
            _ => 1.0,
        }
    }

    /// The input that only the twin reads wrong, while the plant is unchanged.
    fn misinforms(self) -> Option<&'static str> {
        match self {
            Effect::ToldFrozen(input)
            | Effect::ToldMissing(input)
            | Effect::ToldTooLarge(input)
            | Effect::ToldOff(input, _)
            | Effect::ToldLate(input, _) => Some(input),
            _ => None,
        }
    }
}

/// The units whose twin reads an input: the one that owns it, or all that share it.
fn readers(study: &Study, unit: usize, input: &str) -> Vec<usize> {
    let own = full_name(&study.units[unit], input);
    match study.system.network().inputs.iter().any(|known| known.id == own) {
        true => vec![unit],
        false => (0..study.units.len()).collect(),
    }
}

/// Resolves an effect on a unit; `None` if a name does not exist.
fn resolved(study: &Study, unit: usize, effect: Effect) -> Option<Vec<Change>> {
    let name = |rest: &str| full_name(&study.units[unit], rest);
    let parameter = |rest: &str| {
        let name = name(rest);
        let (component, parameter) = name.rsplit_once('.')?;
        let components = &study.system.network().components;
        let place = components.iter().position(|known| known.id == component)?;
        Some((place, components[place].component.spec().parameter(parameter)?))
    };
    // An input of the unit, or of the whole system.
    let input = |rest: &str| {
        let find = |name: &str| study.system.network().inputs.iter().position(|i| i.id == name);
        find(&name(rest)).or_else(|| find(rest))
    };
    let told = |rest: &str| {
        let input = input(rest)?;
        Some((input, Change::Input { input, effect, in_plant: false, in_twin: true }))
    };
    Some(match effect {
        Effect::Fault(rest, intensity)
        | Effect::Pulses(rest, intensity)
        | Effect::Grows(rest, intensity) => {
            let (component, fault) = study.system.program.find_fault(&name(rest))?;
            vec![Change::Fault(FaultAt { component, fault, intensity }, effect)]
        }
        Effect::Value(rest, _)
        | Effect::Times(rest, _)
        | Effect::Drift(rest, _)
        | Effect::Swing(rest, _) => {
            let (component, parameter) = parameter(rest)?;
            vec![Change::Parameter(component, parameter, effect)]
        }
        Effect::Weather(rest, value) => {
            let (component, parameter) = parameter(rest)?;
            // Conditions that the liquid does not allow are not flown.
            study.system.allows(component, parameter, value).ok()?;
            vec![Change::Weather(component, parameter, value)]
        }
        Effect::Missing(quantity) => {
            vec![Change::Touch(Touch::Reading(study.sensors.find(quantity, unit)?))]
        }
        Effect::Noise(quantity, times) => {
            let sensor = study.sensors.find(quantity, unit)?;
            let own = Imperfection::of(&study.system, study.measured[sensor]).deviation();
            vec![Change::Touch(Touch::Noisy(sensor, own * (times * times - 1.0).sqrt()))]
        }
        Effect::InputTimes(rest, _) => {
            vec![Change::Input { input: input(rest)?, effect, in_plant: true, in_twin: true }]
        }
        Effect::ToldFrozen(rest) | Effect::ToldOff(rest, _) | Effect::ToldLate(rest, _) => {
            vec![told(rest)?.1]
        }
        // Impossible values are not accepted: the twin keeps the previous value.
        Effect::ToldMissing(rest) => {
            let (input, change) = told(rest)?;
            vec![change, Change::Touch(Touch::Input(input, f64::NAN))]
        }
        Effect::ToldTooLarge(rest) => {
            let (input, change) = told(rest)?;
            vec![change, Change::Touch(Touch::Input(input, TOO_LARGE))]
        }
    })
}

/// An input with the change from the onset on.
fn altered(was: &Piecewise, effect: Effect, flight: &Run, period_s: f64) -> Piecewise {
    let onset_s = (flight.onset_s / period_s).floor() * period_s;
    let value = |time_s: f64| {
        let risen = ((time_s - onset_s) / FALL_S).clamp(0.0, 1.0);
        match effect {
            Effect::InputTimes(_, times) => was.value(time_s) * (1.0 + (times - 1.0) * risen),
            Effect::ToldOff(_, part) => was.value(time_s) * (1.0 + part * risen),
            Effect::ToldLate(_, late_s) => was.value((time_s - late_s).max(0.0)),
            _ => was.value(time_s.min(onset_s)),
        }
    };
    sent(value, period_s, flight.duration_s).expect("a finite signal")
}

/// A changed parameter at a time after the onset, within its range.
fn moved(
    study: &Study,
    (component, parameter): (usize, usize),
    effect: Effect,
    age_s: f64,
    overrides: &[(usize, usize, f64)],
) -> f64 {
    let instance = &study.system.network().components[component];
    let own = overrides.iter().rev().find(|o| (o.0, o.1) == (component, parameter));
    let was = own.map_or(instance.parameters[parameter], |own| own.2);
    let value = match effect {
        Effect::Value(_, value) => value,
        Effect::Times(_, times) => was * times,
        Effect::Drift(_, per_s) => was + per_s * age_s,
        Effect::Swing(_, size) => was + size * (TAU * SWING_HZ * age_s).sin(),
        _ => was,
    };
    let (min, max) = instance.range(parameter);
    value.clamp(min, max)
}

/// Applies changes to readings and inputs before the diagnosis.
pub(crate) struct Touched {
    touches: Vec<Touch>,
    onset: usize,
    random: NormalDeviates,
    /// The readings of the last sample.
    pub measured: Vec<f64>,
    /// The inputs of the last sample.
    pub inputs: Vec<f64>,
}

impl Touched {
    /// Applies the changes from the sample `onset` on.
    pub(crate) fn new(touches: Vec<Touch>, onset: usize, random: NormalDeviates) -> Self {
        Touched { touches, onset, random, measured: vec![], inputs: vec![] }
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
        for touch in &self.touches {
            match *touch {
                Touch::Reading(sensor) => self.measured[sensor] = f64::NAN,
                Touch::Noisy(sensor, sigma) => {
                    self.measured[sensor] += sigma * self.random.normal();
                }
                Touch::Input(input, value) => self.inputs[input] = value,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pulses_alternate_and_growth_ends_at_the_intensity() {
        let pulses = Effect::Pulses("leak", 1.0);
        let shares: Vec<f64> = (0..15).map(|k| pulses.share(STEP_S * f64::from(k))).collect();
        assert_eq!(shares, [[1.0; 5], [0.0; 5], [1.0; 5]].concat());
        let grows = Effect::Grows("leak", 1.0);
        assert_eq!([0.0, 2.0, 8.0, 9.0].map(|age_s| grows.share(age_s)), [0.0, 0.25, 1.0, 1.0]);
        assert_eq!(Effect::Fault("leak", 1.0).share(3.0), 1.0);
    }
}
