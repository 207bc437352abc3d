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
    let learned = flights.learned.len();
    let (mut added_nats, mut shutdowns_before) = (0.0, None);
    loop {
        let changed = diagnoser.with_shutdown_allowance(added_nats);
        let flown = fly(study, flights, setting, &changed, workers)?;
        let shutdowns = flown.iter().filter(|flight| flight.shutdowns > 0).count() as u64;
        let before = *shutdowns_before.get_or_insert(shutdowns);
        let largest = flown.iter().map(|flight| flight.shutdown_evidence).fold(0.0, f64::max);
        if largest <= allowed {
            let evidence = HealthyEvidence {
                learned: learned as u64,
                held_out: flown.len() as u64,
                shutdowns_before: before,
                added_nats,
                largest,
            };
            return Ok(Diagnoser { healthy_evidence: Some(evidence), ..changed });
        }
        if added_nats >= most_nats {
            return Err(JobError::UnsafeInHealth {
                setting: setting.name(),
                added_nats,
                largest,
                allowed,
                held_out: flown.len(),
                learned,
                missing: learned.max(HELD_OUT.saturating_sub(learned)),
            });
        }
        added_nats += STEP_NATS;
    }
}

/// The finished flights in the held-out environments, each as long as a healthy flight of the training.
fn fly(
    study: &Study,
    flights: &Flights,
    setting: Setting,
    diagnoser: &Diagnoser,
    workers: Workers,
) -> Result<Vec<HealthyFlight>, JobError> {
    let session = Session::new(Arc::new(diagnoser.clone()))
        .map_err(|error| JobError::Evaluation(error.into()))?;
    let duration_s = flights.learn.healthy_duration_s.unwrap_or(flights.duration_s);
    let mut finished = vec![];
    for (batch, environments) in flights.held_out.chunks(BATCH).enumerate() {
        let first = batch * BATCH;
        let place = (environments, first..first + environments.len());
        let of_seed = (HELD_OUT_SEED, duration_s);
        let (flown, _failed) = healthy::fly(study, place, of_seed, setting, &session, workers)?;
        finished.extend(flown);
    }
    Ok(finished)
}
