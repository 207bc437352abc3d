//! The margin of a shutdown, from healthy flights in environments that training did not see.
//!
//! [`HealthyEvidence`] describes the rule. The flights are neither those of the training nor those of any evaluation.

use super::JobError;
use super::outcomes::watching;
use crate::flight::watched::{self, Flown};
use crate::measure::outcome::RunOutcome;
use crate::parallel::Workers;
use crate::run::part;
use crate::study::suites::HELD_OUT;
use crate::study::{Scenario, Study, Suite};
use servotwin_diagnosis::diagnoser::{Diagnoser, HealthyEvidence};
use std::sync::Arc;

/// By how much the allowance grows at a time, nats.
const STEP_NATS: f64 = 1.0;

/// Flies a trained diagnoser in the held-out environments of a study, and returns it with the smallest margin of a
/// shutdown that these allow. Without held-out environments it stays as it is.
///
/// # Errors
/// [`JobError::UnsafeInHealth`] if no margin suffices; [`JobError::HeldOutFailed`] if a flight cannot be finished; a twin
/// cannot be simulated.
pub(crate) fn with_margin(
    study: &Study,
    scenario: Scenario,
    diagnoser: Diagnoser,
    workers: Workers,
) -> Result<Diagnoser, JobError> {
    let suite = study.suite(HELD_OUT).filter(|suite| suite.environments > 0);
    let Some(suite) = suite else { return Ok(diagnoser) };
    let (allowed, most_nats) = (diagnoser.tuning.pending_share, diagnoser.tuning.clip_nats);
    let learned = study.training_suites().map(|suite| suite.environments).sum();
    let evidence = smallest_margin((learned, suite.scatter), (allowed, most_nats), |margin| {
        fly(study, suite, scenario, diagnoser.with_shutdown_margin(margin), workers)
    })?;
    finished(scenario, &evidence)?;
    if evidence.largest > allowed {
        return Err(JobError::UnsafeInHealth {
            scenario: scenario.name(),
            allowed,
            missing: evidence
                .learned
                .max((suite.environments as u64).saturating_sub(evidence.learned)),
            evidence,
        });
    }
    let healthy_evidence = Some(evidence);
    Ok(Diagnoser { healthy_evidence, ..diagnoser.with_shutdown_margin(evidence.added_nats) })
}

/// Refuses evidence of which a flight is missing.
fn finished(scenario: Scenario, evidence: &HealthyEvidence) -> Result<(), JobError> {
    let (failed, of) = (evidence.failed, evidence.held_out + evidence.failed);
    let scenario = scenario.name();
    if failed == 0 { Ok(()) } else { Err(JobError::HeldOutFailed { scenario, failed, of }) }
}

/// Lets the allowance grow until no flight has more than the allowed evidence, or the largest allowance is reached.
fn smallest_margin(
    (learned, scatter): (usize, f64),
    (allowed, most_nats): (f64, f64),
    mut fly: impl FnMut(f64) -> Result<Vec<RunOutcome>, JobError>,
) -> Result<HealthyEvidence, JobError> {
    let (mut added_nats, mut shutdowns_before) = (0.0, None);
    loop {
        let outcomes = fly(added_nats)?;
        let finished = || outcomes.iter().filter(|row| row.is_finished);
        let shutdowns = finished().filter(|row| row.early_shutdowns > 0).count() as u64;
        let shutdowns_before = *shutdowns_before.get_or_insert(shutdowns);
        let largest = finished().map(|row| row.shutdown_evidence).fold(0.0, f64::max);
        if largest <= allowed || added_nats >= most_nats {
            let held_out = finished().count() as u64;
            return Ok(HealthyEvidence {
                learned: learned as u64,
                held_out,
                failed: outcomes.len() as u64 - held_out,
                scatter,
                shutdowns_before,
                added_nats,
                largest,
            });
        }
        added_nats += STEP_NATS;
    }
}

fn fly(
    study: &Study,
    suite: &Suite,
    scenario: Scenario,
    diagnoser: Diagnoser,
    workers: Workers,
) -> Result<Vec<RunOutcome>, JobError> {
    let watching = watching(suite, &Arc::new(diagnoser))?;
    let (place, parts) = ((study, suite, scenario), watched::parts(study, suite));
    let mut outcomes = vec![];
    for round in part::rounds(place, &parts, &(0..parts.len()).collect()) {
        let numbers: Vec<usize> = round.iter().flat_map(|&part| parts[part].clone()).collect();
        let mut ended = |_, flown: Flown| outcomes.extend(flown.outcomes);
        watched::fly(place, &watching, &numbers, workers, &mut ended)?;
    }
    Ok(outcomes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Flights with evidence that falls by a quarter of its limit for each nat, and one that failed.
    fn falling(evidence: &[f64]) -> impl FnMut(f64) -> Result<Vec<RunOutcome>, JobError> {
        move |added_nats| {
            let flight = |evidence: &f64| {
                let shutdown_evidence = (evidence - 0.25 * added_nats).max(0.0);
                let early_shutdowns = u64::from(shutdown_evidence >= 1.0);
                let is_finished = true;
                RunOutcome { is_finished, shutdown_evidence, early_shutdowns, ..Default::default() }
            };
            let failed = RunOutcome { shutdown_evidence: 9.0, ..RunOutcome::default() };
            Ok(evidence.iter().map(flight).chain([failed]).collect())
        }
    }

    #[test]
    fn the_margin_is_the_smallest_that_held_out_flights_allow() {
        let found = |evidence| smallest_margin((24, 1.5), (0.5, 8.0), falling(evidence)).unwrap();
        let quiet = found(&[0.25, 0.5]);
        assert_eq!((quiet.added_nats, quiet.shutdowns_before, quiet.largest), (0.0, 0, 0.5));
        let loud = found(&[0.75, 1.25, 1.0]);
        assert_eq!((loud.added_nats, loud.shutdowns_before, loud.largest), (3.0, 2, 0.5));
        assert_eq!((loud.learned, loud.held_out, loud.failed), (24, 3, 1));
        let refused = finished(Scenario::Noise, &loud).unwrap_err().to_string();
        assert!(refused.contains("noise: 1 of 4 held-out healthy flights"), "{refused}");
        finished(Scenario::Noise, &HealthyEvidence { failed: 0, ..loud }).unwrap();
    }

    #[test]
    fn a_search_for_a_margin_ends_at_the_largest_one() {
        let found = smallest_margin((24, 1.5), (0.5, 2.0), falling(&[1.5])).unwrap();
        assert_eq!((found.added_nats, found.largest), (2.0, 1.0));
    }
}
