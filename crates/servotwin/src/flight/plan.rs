//! Plans the flights: fault, intensity, onset, environment, specimen.

use crate::ensemble::Later;
use crate::signal::random::NormalDeviates;
use crate::study::flights::{Environment, Size};
use crate::study::{Flights, Lot, Study};
use servotwin_model::program::FaultAt;

/// How a fault develops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Onset {
    /// It appears at once.
    Step,
    /// It grows to its intensity within [`DRIFT_S`].
    Drift,
    /// It appears and disappears every [`PULSE_S`].
    Intermittent,
}

impl Onset {
    /// All of them.
    pub const ALL: [Onset; 3] = [Onset::Step, Onset::Drift, Onset::Intermittent];

    /// The name in tables and reports.
    pub fn name(self) -> &'static str {
        match self {
            Onset::Step => "at once",
            Onset::Drift => "drift",
            Onset::Intermittent => "intermittent",
        }
    }
}

/// How long a growing fault takes to reach its intensity, s.
pub const DRIFT_S: f64 = 4.0;
/// Number of steps in which it grows.
const DRIFT_STEPS: u32 = 40;
/// How long an intermittent fault is present, and absent, s.
pub const PULSE_S: f64 = 1.0;

/// The purpose of flights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Training of the diagnosis.
    Learn,
    /// Testing of the diagnosis.
    Judge,
}

impl Purpose {
    /// The lot of specimens and noise, which differs between purposes.
    pub fn lot(self) -> Lot {
        match self {
            Purpose::Learn => Lot::FlightsLearned,
            Purpose::Judge => Lot::FlightsJudged,
        }
    }

    /// The environments for this purpose.
    pub fn environments(self, flights: &Flights) -> &[Environment] {
        match self {
            Purpose::Learn => &flights.learned,
            Purpose::Judge => &flights.judged,
        }
    }

    /// The number of flights for this purpose.
    pub fn size(self, flights: &Flights) -> Size {
        match self {
            Purpose::Learn => flights.learn,
            Purpose::Judge => flights.judge,
        }
    }
}

/// A planned flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannedFlight {
    /// Its number, from which specimen and noise are derived.
    pub number: usize,
    /// The index of its environment.
    pub environment: usize,
    /// The fault as an index in [`Study::faults`]; `None` for a healthy flight.
    pub fault: Option<usize>,
    /// The fault's intensity; 0 for a healthy flight.
    pub intensity: f64,
    /// Onset of the fault, s; infinite for a healthy flight.
    pub onset_s: f64,
    /// How the fault develops.
    pub onset: Onset,
    /// Duration of the flight, s.
    pub duration_s: f64,
}

/// All flights for a purpose: first those with a fault, then the healthy ones. Environments alternate so that no fault
/// meets the same one twice.
pub fn flights(study: &Study, flights: &Flights, purpose: Purpose) -> Vec<PlannedFlight> {
    let size = purpose.size(flights);
    let environments = size.environments;
    let mut list = vec![];
    for repeat in 0..size.repeats {
        for fault in 0..study.faults.len() {
            if purpose == Purpose::Learn && !is_turn(study, fault, repeat) {
                continue;
            }
            let number = list.len();
            list.push(with_fault(
                study,
                flights,
                purpose,
                Slot { number, fault, repeat, environments },
            ));
        }
    }
    let healthy_s = size.healthy_duration_s.unwrap_or(flights.duration_s);
    for specimen in 0..size.healthy * environments {
        list.push(PlannedFlight {
            number: list.len(),
            environment: specimen % environments,
            fault: None,
            intensity: 0.0,
            onset_s: f64::INFINITY,
            onset: Onset::Step,
            duration_s: healthy_s,
        });
    }
    for environment in environments..environments + size.further {
        list.push(PlannedFlight {
            number: list.len(),
            environment,
            fault: None,
            intensity: 0.0,
            onset_s: f64::INFINITY,
            onset: Onset::Step,
            duration_s: size.further_duration_s.unwrap_or(healthy_s),
        });
    }
    list
}

/// If units are alike, every row is also seen from the other units, so training flights alternate between the units.
fn is_turn(study: &Study, fault: usize, repeat: usize) -> bool {
    if !study.has_like_units() {
        return true;
    }
    let intensities = study.intensities.len().max(1);
    let place = fault % (study.faults.len() / study.units.len()).max(1);
    (repeat + place / intensities + place % intensities) % study.units.len()
        == study.faults[fault].unit
}

/// The position of a flight in its plan.
struct Slot {
    number: usize,
    fault: usize,
    repeat: usize,
    environments: usize,
}

fn with_fault(study: &Study, flights: &Flights, purpose: Purpose, slot: Slot) -> PlannedFlight {
    let Slot { number, fault, repeat, environments } = slot;
    let mut random =
        NormalDeviates::new((purpose as u64) << 40 | number as u64 ^ flights.seed << 50);
    let [from, to] = flights.onset_s;
    let onset_s = from + (to - from) * random.unit();
    let of_study = study.faults[fault].at.intensity;
    let training = study.training.as_ref().filter(|_| purpose == Purpose::Learn);
    // Seven has no common divisor with the usual numbers of intensities and environments.
    let environment =
        (7 * fault + 11 * repeat + fault / study.intensities.len().max(1)) % environments;
    PlannedFlight {
        number,
        environment,
        fault: Some(fault),
        intensity: training.map_or(of_study, |t| t.intensity(of_study, repeat + 7 * fault)),
        onset_s,
        onset: match (fault + repeat) % 8 {
            3 => Onset::Drift,
            7 => Onset::Intermittent,
            _ => Onset::Step,
        },
        duration_s: flights.duration_s,
    }
}

impl PlannedFlight {
    /// The course of the fault, in the form of [`crate::ensemble::Variant::later`].
    pub fn later(&self, study: &Study) -> Vec<Later> {
        let Some(fault) = self.fault else { return vec![] };
        let at = |time_s: f64, share: f64| {
            let fault = FaultAt { intensity: self.intensity * share, ..study.faults[fault].at };
            let faults = if share > 0.0 { vec![fault] } else { vec![] };
            Later { time_s, faults, overrides: vec![] }
        };
        match self.onset {
            Onset::Step => vec![at(self.onset_s, 1.0)],
            Onset::Drift => {
                let share = |step: u32| f64::from(step) / f64::from(DRIFT_STEPS);
                let when = |step: u32| self.onset_s + DRIFT_S * share(step - 1);
                (1..=DRIFT_STEPS).map(|step| at(when(step), share(step))).collect()
            }
            Onset::Intermittent => {
                let pulses = ((self.duration_s - self.onset_s) / PULSE_S) as u32;
                let when = |pulse: u32| self.onset_s + PULSE_S * f64::from(pulse);
                let there = |pulse: u32| if pulse.is_multiple_of(2) { 1.0 } else { 0.0 };
                (0..=pulses).map(|pulse| at(when(pulse), there(pulse))).collect()
            }
        }
    }

    /// The fraction of its intensity that the fault has at a time.
    pub fn share(&self, time_s: f64) -> f64 {
        let age = time_s - self.onset_s;
        match self.onset {
            _ if self.fault.is_none() || age < 0.0 => 0.0,
            Onset::Step => 1.0,
            Onset::Drift => (age / DRIFT_S).min(1.0),
            Onset::Intermittent => f64::from(u8::from(((age / PULSE_S) as u64).is_multiple_of(2))),
        }
    }
}
