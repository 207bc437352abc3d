//! The margin of a shutdown, from healthy flights in environments that training did not see.
//!
//! [`HealthyEvidence`] describes the rule. The flights are neither those of the training nor those of any evaluation.

use super::JobError;
use super::healthy::BATCH;
use crate::flight::healthy::{self, Differences, HealthyFlight};
use crate::parallel::Workers;
use crate::study::flights::{HELD_OUT, HELD_OUT_SEED};
use crate::study::{Flights, Setting, Study};
use servotwin_diagnosis::diagnoser::{Diagnoser, HealthyEvidence, Session, ShutdownMargin};
use std::sync::Arc;

/// By how much an allowance grows at a time, nats.
const STEP_NATS: f64 = 1.0;

/// How many times as large as declared the tolerances and draws of held-out specimens are: the factor of safety between
/// the loads that a structure may see and those that it must withstand (CS 25.303).
const SCATTER: f64 = 1.5;

/// Flies a trained diagnoser in the held-out environments of a study, and returns it with the smallest margin of a
/// shutdown that these allow. Without held-out environments it stays as it is.
///
/// # Errors
/// [`JobError::UnsafeInHealth`] if no margin suffices; [`JobError::HeldOutFailed`] if a flight cannot be finished; a twin
/// cannot be simulated.
pub fn with_margin(
    study: &Study,
    flights: &Flights,
    setting: Setting,
    diagnoser: Diagnoser,
    workers: Workers,
) -> Result<Diagnoser, JobError> {
    if flights.held_out.is_empty() {
        return Ok(diagnoser);
    }
    let (allowed, most_nats) = (diagnoser.tuning.pending_share, diagnoser.tuning.clip_nats);
    let is_corrected: Vec<bool> =
        diagnoser.lengths.iter().map(|length| length.baseline_corrected.is_some()).collect();
    let learned = flights.learned.len();
    let evidence = smallest_margin((learned, &is_corrected), (allowed, most_nats), |margin| {
        fly(study, flights, setting, diagnoser.with_shutdown_margin(margin), workers)
    })?;
    finished(setting, &evidence)?;
    if evidence.largest > allowed {
        return Err(JobError::UnsafeInHealth {
            setting: setting.name(),
            allowed,
            missing: evidence.learned.max((HELD_OUT as u64).saturating_sub(evidence.learned)),
            evidence,
        });
    }
    let healthy_evidence = Some(evidence);
    Ok(Diagnoser { healthy_evidence, ..diagnoser.with_shutdown_margin(evidence.added) })
}

/// Refuses evidence of which a flight is missing.
fn finished(setting: Setting, evidence: &HealthyEvidence) -> Result<(), JobError> {
    let (failed, of) = (evidence.failed, evidence.held_out + evidence.failed);
    let setting = setting.name();
    if failed == 0 { Ok(()) } else { Err(JobError::HeldOutFailed { setting, failed, of }) }
}

/// Lets each allowance grow until no flight has more than the allowed evidence in windows of its kind, or the largest
/// allowance is reached. `is_corrected` states for each length of windows whether residuals are baseline-corrected.
fn smallest_margin(
    (learned, is_corrected): (usize, &[bool]),
    (allowed, most_nats): (f64, f64),
    mut fly: impl FnMut(ShutdownMargin) -> Result<(Vec<HealthyFlight>, u64), JobError>,
) -> Result<HealthyEvidence, JobError> {
    let (mut added, mut shutdowns_before) = (ShutdownMargin::default(), None);
    loop {
        let (flown, failed) = fly(added)?;
        let shutdowns = flown.iter().filter(|flight| flight.shutdowns > 0).count() as u64;
        let shutdowns_before = *shutdowns_before.get_or_insert(shutdowns);
        let largest = |corrected: bool| {
            let of_flight =
                flown.iter().flat_map(|f| is_corrected.iter().zip(&f.shutdown_evidence_by_length));
            let of_kind = of_flight.filter(|(is_corrected, _)| **is_corrected == corrected);
            of_kind.map(|(_, evidence)| *evidence).fold(0.0, f64::max)
        };
        let mut has_grown = false;
        let kinds = [
            (largest(false), &mut added.uncorrected_nats),
            (largest(true), &mut added.baseline_corrected_nats),
        ];
        for (largest, nats) in kinds {
            if largest > allowed && *nats < most_nats {
                *nats += STEP_NATS;
                has_grown = true;
            }
        }
        if !has_grown {
            return Ok(HealthyEvidence {
                learned: learned as u64,
                held_out: flown.len() as u64,
                failed,
                scatter: SCATTER,
                shutdowns_before,
                added,
                largest: largest(false).max(largest(true)),
            });
        }
    }
}

/// The finished flights in the held-out environments, each as long as a healthy flight of the training, and how many
/// failed.
fn fly(
    study: &Study,
    flights: &Flights,
    setting: Setting,
    diagnoser: Diagnoser,
    workers: Workers,
) -> Result<(Vec<HealthyFlight>, u64), JobError> {
    let session =
        Session::new(Arc::new(diagnoser)).map_err(|error| JobError::Evaluation(error.into()))?;
    let duration_s = flights.learn.healthy_duration_s.unwrap_or(flights.duration_s);
    let (mut finished, mut failed) = (vec![], 0);
    for (batch, environments) in flights.held_out.chunks(BATCH).enumerate() {
        let first = batch * BATCH;
        let place = (environments, first..first + environments.len());
        let of_seed = (HELD_OUT_SEED, duration_s);
        let plants = (setting, Differences::Scattered(SCATTER));
        let (flown, fallen) = healthy::fly(study, place, of_seed, plants, &session, workers)?;
        finished.extend(flown);
        failed += fallen;
    }
    Ok((finished, failed))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Flights with evidence of uncorrected and of baseline-corrected windows, each of which falls by a quarter of its
    /// limit for each nat.
    fn falling(
        evidence: &[[f64; 2]],
    ) -> impl FnMut(ShutdownMargin) -> Result<(Vec<HealthyFlight>, u64), JobError> {
        move |margin| {
            let flight = |[uncorrected, corrected]: &[f64; 2]| {
                let fallen = |evidence: f64, nats: f64| (evidence - 0.25 * nats).max(0.0);
                let by_length = vec![
                    fallen(*uncorrected, margin.uncorrected_nats),
                    fallen(*corrected, margin.baseline_corrected_nats),
                ];
                let largest = by_length[0].max(by_length[1]);
                let shutdowns = u64::from(largest >= 1.0);
                HealthyFlight {
                    environment: 0,
                    alarms: shutdowns,
                    shutdowns,
                    evidence: largest,
                    shutdown_evidence: largest,
                    shutdown_evidence_by_length: by_length,
                }
            };
            Ok((evidence.iter().map(flight).collect(), 1))
        }
    }

    #[test]
    fn each_margin_is_the_smallest_that_held_out_flights_allow() {
        let kinds = (24, &[false, true][..]);
        let found = |evidence| smallest_margin(kinds, (0.5, 8.0), falling(evidence)).unwrap();
        let quiet = found(&[[0.0, 0.0], [0.25, 0.5]]);
        assert_eq!((quiet.added, quiet.shutdowns_before), (ShutdownMargin::default(), 0));
        assert_eq!(quiet.largest, 0.5);
        let loud = found(&[[0.75, 1.25], [0.0, 0.1], [0.0, 1.0]]);
        let added = ShutdownMargin { uncorrected_nats: 1.0, baseline_corrected_nats: 3.0 };
        assert_eq!((loud.added, loud.shutdowns_before, loud.largest), (added, 2, 0.5));
        assert_eq!((loud.learned, loud.held_out, loud.failed), (24, 3, 1));
        let refused = finished(Setting::Noise, &loud).unwrap_err().to_string();
        assert!(refused.contains("noise: 1 of 4 held-out healthy flights"), "{refused}");
        finished(Setting::Noise, &HealthyEvidence { failed: 0, ..loud }).unwrap();
    }

    #[test]
    fn a_search_for_a_margin_ends_at_the_largest_one() {
        let evidence = [[1.5, 0.0]];
        let found = smallest_margin((24, &[false, true]), (0.5, 2.0), falling(&evidence)).unwrap();
        assert_eq!((found.added.uncorrected_nats, found.added.baseline_corrected_nats), (2.0, 0.0));
        assert_eq!(found.largest, 1.0);
    }
}
