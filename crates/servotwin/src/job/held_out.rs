//! The margin of a shutdown, from healthy flights in environments that training did not see.
//!
//! [`HealthyEvidence`] describes the rule. The flights are neither those of the training nor those of any evaluation.

use super::JobError;
use super::outcomes::watching;
use crate::flight::watched::{self, Flown};
use crate::measure::outcome::RunOutcome;
use crate::parallel::Workers;
use crate::run::part;
use crate::study::suites::{HARD_NEGATIVES, HELD_OUT, LEARN};
use crate::study::{Scenario, Study, Suite};
use servotwin_diagnosis::diagnoser::{Diagnoser, HealthyEvidence, ShutdownMargin};
use std::sync::Arc;

/// By how much an allowance grows at a time, nats.
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
    let taught = [LEARN, HARD_NEGATIVES].into_iter().filter_map(|name| study.suite(name));
    let learned = taught.map(|suite| suite.environments).sum();
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
    Ok(Diagnoser { healthy_evidence, ..diagnoser.with_shutdown_margin(evidence.added) })
}

/// Refuses evidence of which a flight is missing.
fn finished(scenario: Scenario, evidence: &HealthyEvidence) -> Result<(), JobError> {
    let (failed, of) = (evidence.failed, evidence.held_out + evidence.failed);
    let scenario = scenario.name();
    if failed == 0 { Ok(()) } else { Err(JobError::HeldOutFailed { scenario, failed, of }) }
}

/// Lets each allowance grow until no flight has more than the allowed evidence in windows of its kind, or the largest
/// allowance is reached.
fn smallest_margin(
    (learned, scatter): (usize, f64),
    (allowed, most_nats): (f64, f64),
    mut fly: impl FnMut(ShutdownMargin) -> Result<Vec<RunOutcome>, JobError>,
) -> Result<HealthyEvidence, JobError> {
    let (mut added, mut shutdowns_before) = (ShutdownMargin::default(), None);
    loop {
        let outcomes = fly(added)?;
        let finished = || outcomes.iter().filter(|row| row.is_finished);
        let shutdowns = finished().filter(|row| row.early_shutdowns > 0).count() as u64;
        let shutdowns_before = *shutdowns_before.get_or_insert(shutdowns);
        let largest = |of: fn(&RunOutcome) -> f64| finished().map(of).fold(0.0, f64::max);
        let [uncorrected, corrected] =
            [largest(|row| row.shutdown_evidence), largest(|row| row.corrected_shutdown_evidence)];
        let mut has_grown = false;
        let kinds = [
            (uncorrected, &mut added.uncorrected_nats),
            (corrected, &mut added.baseline_corrected_nats),
        ];
        for (largest, nats) in kinds {
            if largest > allowed && *nats < most_nats {
                *nats += STEP_NATS;
                has_grown = true;
            }
        }
        if !has_grown {
            let held_out = finished().count() as u64;
            return Ok(HealthyEvidence {
                learned: learned as u64,
                held_out,
                failed: outcomes.len() as u64 - held_out,
                scatter,
                shutdowns_before,
                added,
                largest: uncorrected.max(corrected),
            });
        }
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

    /// Flights with evidence of uncorrected and of baseline-corrected windows, each of which falls by a quarter of its
    /// limit for each nat.
    fn falling(
        evidence: &[[f64; 2]],
    ) -> impl FnMut(ShutdownMargin) -> Result<Vec<RunOutcome>, JobError> {
        move |margin| {
            let flight = |[uncorrected, corrected]: &[f64; 2]| {
                let fallen = |evidence: f64, nats: f64| (evidence - 0.25 * nats).max(0.0);
                let outcome = RunOutcome {
                    is_finished: true,
                    shutdown_evidence: fallen(*uncorrected, margin.uncorrected_nats),
                    corrected_shutdown_evidence: fallen(*corrected, margin.baseline_corrected_nats),
                    ..RunOutcome::default()
                };
                let early_shutdowns = u64::from(outcome.largest_shutdown_evidence() >= 1.0);
                RunOutcome { early_shutdowns, ..outcome }
            };
            let failed = RunOutcome { shutdown_evidence: 9.0, ..RunOutcome::default() };
            Ok(evidence.iter().map(flight).chain([failed]).collect())
        }
    }

    #[test]
    fn each_margin_is_the_smallest_that_held_out_flights_allow() {
        let found = |evidence| smallest_margin((24, 1.5), (0.5, 8.0), falling(evidence)).unwrap();
        let quiet = found(&[[0.0, 0.0], [0.25, 0.5]]);
        assert_eq!((quiet.added, quiet.shutdowns_before), (ShutdownMargin::default(), 0));
        assert_eq!(quiet.largest, 0.5);
        let loud = found(&[[0.75, 1.25], [0.0, 0.1], [0.0, 1.0]]);
        let added = ShutdownMargin { uncorrected_nats: 1.0, baseline_corrected_nats: 3.0 };
        assert_eq!((loud.added, loud.shutdowns_before, loud.largest), (added, 2, 0.5));
        assert_eq!((loud.learned, loud.held_out, loud.failed), (24, 3, 1));
        let refused = finished(Scenario::Noise, &loud).unwrap_err().to_string();
        assert!(refused.contains("noise: 1 of 4 held-out healthy flights"), "{refused}");
        finished(Scenario::Noise, &HealthyEvidence { failed: 0, ..loud }).unwrap();
    }

    #[test]
    fn a_search_for_a_margin_ends_at_the_largest_one() {
        let evidence = [[1.5, 0.0]];
        let found = smallest_margin((24, 1.5), (0.5, 2.0), falling(&evidence)).unwrap();
        assert_eq!((found.added.uncorrected_nats, found.added.baseline_corrected_nats), (2.0, 0.0));
        assert_eq!(found.largest, 1.0);
    }
}
