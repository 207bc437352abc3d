//! The margin of a shutdown, from healthy flights in environments that training did not see.
//!
//! [`HealthyEvidence`] describes the rule. The flights are neither those of the training nor those of any evaluation.

use super::JobError;
use super::healthy::BATCH;
use crate::flight::healthy::{self, HealthyFlight};
use crate::parallel::Workers;
use crate::study::flights::{HELD_OUT, HELD_OUT_SEED};
use crate::study::{Flights, Setting, Study};
use servotwin_diagnosis::diagnoser::{Diagnoser, HealthyEvidence, Session};
use std::sync::Arc;

/// By how much the allowance grows at a time, nats.
const STEP_NATS: f64 = 1.0;

/// Flies a trained diagnoser in the held-out environments of a study, and returns it with the smallest margin of a
/// shutdown that these allow. Without held-out environments it stays as it is.
///
/// # Errors
/// [`JobError::UnsafeInHealth`] if no margin suffices; a twin cannot be simulated.
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
    let changed = |added_nats: f64| diagnoser.with_shutdown_allowance(added_nats);
    let evidence = smallest_margin(flights.learned.len(), (allowed, most_nats), |added_nats| {
        fly(study, flights, setting, changed(added_nats), workers)
    })?;
    if evidence.largest > allowed || evidence.held_out == 0 {
        return Err(JobError::UnsafeInHealth {
            setting: setting.name(),
            allowed,
            missing: evidence.learned.max((HELD_OUT as u64).saturating_sub(evidence.learned)),
            evidence,
        });
    }
    Ok(Diagnoser { healthy_evidence: Some(evidence), ..changed(evidence.added_nats) })
}

/// Lets the allowance grow until no flight has more than the allowed evidence, or the largest allowance is reached.
fn smallest_margin(
    learned: usize,
    (allowed, most_nats): (f64, f64),
    mut fly: impl FnMut(f64) -> Result<(Vec<HealthyFlight>, u64), JobError>,
) -> Result<HealthyEvidence, JobError> {
    let (mut added_nats, mut shutdowns_before) = (0.0, None);
    loop {
        let (flown, failed) = fly(added_nats)?;
        let shutdowns = flown.iter().filter(|flight| flight.shutdowns > 0).count() as u64;
        let shutdowns_before = *shutdowns_before.get_or_insert(shutdowns);
        let largest = flown.iter().map(|flight| flight.shutdown_evidence).fold(0.0, f64::max);
        if largest <= allowed || added_nats >= most_nats {
            let (learned, held_out) = (learned as u64, flown.len() as u64);
            return Ok(HealthyEvidence {
                learned,
                held_out,
                failed,
                shutdowns_before,
                added_nats,
                largest,
            });
        }
        added_nats += STEP_NATS;
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
        let (flown, fallen) =
            healthy::fly(study, place, of_seed, (setting, None), &session, workers)?;
        finished.extend(flown);
        failed += fallen;
    }
    Ok((finished, failed))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Flights whose evidence falls by a quarter of its limit for each nat.
    fn falling(evidence: &[f64]) -> impl FnMut(f64) -> Result<(Vec<HealthyFlight>, u64), JobError> {
        move |added_nats| {
            let flight = |largest: &f64| {
                let shutdown_evidence = (largest - 0.25 * added_nats).max(0.0);
                let shutdowns = u64::from(shutdown_evidence >= 1.0);
                let (environment, alarms, evidence) = (0, shutdowns, shutdown_evidence);
                HealthyFlight { environment, alarms, shutdowns, evidence, shutdown_evidence }
            };
            Ok((evidence.iter().map(flight).collect(), 1))
        }
    }

    #[test]
    fn the_margin_is_the_smallest_that_held_out_flights_allow() {
        let found = |evidence: &[f64]| smallest_margin(24, (0.5, 8.0), falling(evidence)).unwrap();
        let quiet = found(&[0.0, 0.5]);
        assert_eq!((quiet.added_nats, quiet.shutdowns_before, quiet.largest), (0.0, 0, 0.5));
        let loud = found(&[1.25, 0.1, 1.0]);
        assert_eq!((loud.added_nats, loud.shutdowns_before, loud.largest), (3.0, 2, 0.5));
        assert_eq!((loud.learned, loud.held_out, loud.failed), (24, 3, 1));
    }

    #[test]
    fn a_search_for_a_margin_ends_at_the_largest_one() {
        let found = smallest_margin(24, (0.5, 2.0), falling(&[1.5])).unwrap();
        assert_eq!((found.added_nats, found.largest), (2.0, 1.0));
    }
}
