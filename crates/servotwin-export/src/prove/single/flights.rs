//! Flights with and without a fault: does single precision raise the same action at the same sample?
//!
//! The faults of the study take turns, and so do its operating cases; every fifth flight has no fault. The actions are
//! raised and not executed, so that both diagnoses see the same flight.

use super::decisions::{Decision, Raised, Tracker};
use super::{Beside, SingleEvidence};
use crate::error::ExportError;
use crate::prove::ProofEvidence;
use crate::prove::library::Compiled;
use crate::prove::samples::Sample;
use serde::Serialize;
use servotwin::flight::closed_loop::{ClosedLoopFlight, Scenario};
use servotwin::study::Study;
use servotwin_diagnosis::diagnoser::Diagnoser;
use std::sync::Arc;

/// Of so many flights one is healthy.
const HEALTHY: u64 = 5;

/// The onset of a fault after the baseline is known, s: at least, and how much later at most.
const ONSET_S: [f64; 2] = [2.0, 1.0];

/// The duration of a flight after the onset of its fault, s.
const AFTER_ONSET_S: f64 = 12.0;

/// What single precision raised differently in flights.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct FlightDecisions {
    /// All flights.
    pub flights: u64,
    /// Those with a fault.
    pub with_fault: u64,
    /// Samples of all flights.
    pub samples: u64,
    /// Flights in which the trained diagnosis raises an action.
    pub raised: u64,
    /// Flights with the same raised actions at the same samples, or none in both.
    pub same: u64,
    /// Flights with the same raised actions, one of them at another sample.
    pub shifted: u64,
    /// By how many samples at most.
    pub largest_shift: u64,
    /// Flights in which single precision shuts down a healthy actuator and training does not.
    pub healthy_shut_down: u64,
    /// Flights in which training shuts down the faulty actuator and single precision does not.
    pub missed_shutdowns: u64,
    /// Flights without a fault in which single precision raises an action and training does not.
    pub false_alarms: u64,
    /// Flights with other differences of the raised actions.
    pub other_actions: u64,
    /// Samples with another finding, alarm or raised action.
    pub differing_samples: u64,
}

/// The raised actions of a flight, each with its sample.
type Course = Vec<(u64, Raised)>;

/// Flies so many flights with all builds beside the trained diagnosis. `tell` hears how many so far.
pub(super) fn compare(
    study: &Study,
    diagnoser: &Arc<Diagnoser>,
    compiled: &[Compiled],
    flights: u64,
    (all, single): (&mut [ProofEvidence], &mut SingleEvidence),
    tell: &mut dyn FnMut(u64),
) -> Result<(), ExportError> {
    let mut counts = FlightDecisions::default();
    let switches_off = diagnoser.tuning.switches_off(diagnoser.names());
    for number in 0..flights {
        tell(number);
        let (scenario, faulty) = plan(study, diagnoser, number, flights);
        let mut flight = ClosedLoopFlight::new(&scenario, diagnoser)?;
        let mut beside = Beside::new(diagnoser, compiled)?;
        let mut tracker = Tracker::new(diagnoser);
        let mut courses = <[Course; 2]>::default();
        for k in 0..(scenario.duration_s / diagnoser.period_s) as u64 {
            flight.sample()?;
            let sample = Sample {
                inputs: flight.inputs().to_vec(),
                measured: flight.measured().to_vec(),
                twin: flight.expected().to_vec(),
            };
            let name = || format!("flight {number}, sample {k}");
            let Some((trained, said)) = beside.push(name, &sample, all) else { return Ok(()) };
            for (course, said) in courses.iter_mut().zip([trained, said]) {
                let raised = Decision::of(said).raised();
                if course.last().is_none_or(|(_, last)| *last != raised) {
                    course.push((k, raised));
                }
            }
            // Raised actions stay; the samples of a flight are too few to hide anything.
            tracker.compare(k, trained, said);
        }
        counts.flights += 1;
        counts.with_fault += u64::from(faulty.is_some());
        counts.samples += tracker.counts.samples;
        counts.differing_samples += tracker.counts.differing_samples;
        count(&mut counts, &switches_off, faulty, &courses);
        single.rows += &tracker.rows(&format!("flight {number}"));
    }
    single.flights = Some(counts);
    Ok(())
}

/// The flight with a number, and its faulty actuator.
fn plan<'s>(
    study: &'s Study,
    diagnoser: &Diagnoser,
    number: u64,
    flights: u64,
) -> (Scenario<'s>, Option<i64>) {
    let is_healthy = number % HEALTHY == HEALTHY - 1 || study.faults.is_empty();
    let place = (number * study.faults.len() as u64 / flights.max(1)) as usize;
    let baseline = diagnoser.baseline.map_or(0, |settings| settings.settle_samples);
    let known_s = diagnoser.tuning.settle_s + f64::from(baseline) * diagnoser.period_s;
    let onset_s = known_s + ONSET_S[0] + ONSET_S[1] * (number * 37 % 100) as f64 / 100.0;
    let fault = study.faults.get(place).filter(|_| !is_healthy);
    let actuator = |unit: &String| diagnoser.names().actuators.iter().position(|own| own == unit);
    let scenario = Scenario {
        study,
        inputs: study.cases[number as usize % study.cases.len()].inputs.clone(),
        faults: fault.map(|fault| (onset_s, fault.at)).into_iter().collect(),
        duration_s: onset_s + AFTER_ONSET_S,
        specimen: diagnoser.baseline.map(|_| number as usize),
        reacts: false,
    };
    let faulty = fault.and_then(|fault| actuator(&study.units[fault.unit]));
    (scenario, faulty.map(|actuator| actuator as i64))
}

/// Counts a flight by its raised actions.
fn count(
    counts: &mut FlightDecisions,
    switches_off: &[bool],
    faulty: Option<i64>,
    [trained, single]: &[Course; 2],
) {
    let actions = |course: &Course| course.iter().map(|(_, raised)| *raised).collect::<Vec<_>>();
    counts.raised += u64::from(trained.iter().any(|(_, raised)| raised.is_some()));
    if actions(trained) == actions(single) {
        let shifts = trained.iter().zip(single).map(|((own, _), (other, _))| own.abs_diff(*other));
        let largest = shifts.max().unwrap_or(0);
        *(if largest == 0 { &mut counts.same } else { &mut counts.shifted }) += 1;
        counts.largest_shift = counts.largest_shift.max(largest);
        return;
    }
    let shut_down = |course: &Course, is_faulty: bool| {
        course.iter().filter_map(|(_, raised)| *raised).any(|(actuator, action)| {
            switches_off[action as usize] && (Some(actuator) == faulty) == is_faulty
        })
    };
    let raises = |course: &Course| course.iter().any(|(_, raised)| raised.is_some());
    *(if shut_down(single, false) && !shut_down(trained, false) {
        &mut counts.healthy_shut_down
    } else if shut_down(trained, true) && !shut_down(single, true) {
        &mut counts.missed_shutdowns
    } else if faulty.is_none() && raises(single) && !raises(trained) {
        &mut counts.false_alarms
    } else {
        &mut counts.other_actions
    }) += 1;
}
