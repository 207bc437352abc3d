//! Replays a recorded flight through the diagnosis; records are those of [`crate::fit`].

use super::runtime::RuntimeError;
use super::watcher::Watcher;
use crate::fit::FitRecord;
use crate::observer::{DiagnosisState, Finding, Observer, Phase};
use crate::study::Study;
use servotwin_diagnosis::diagnoser::Diagnoser;
use std::sync::Arc;

/// The most severe finding in a record.
#[derive(Debug, Clone, PartialEq)]
pub struct ReplaySummary {
    /// The last finding with the highest severity.
    pub finding: Finding,
    /// When this severity was first reached, s.
    pub at_s: f64,
    /// The share of samples outside the range from which the conditional band was learned.
    pub outside: f64,
}

/// The severity of a finding.
fn weight(finding: &Finding) -> u32 {
    match (finding.phase, finding.state) {
        (Phase::Raised | Phase::Recovering, DiagnosisState::Isolated) => 6,
        (Phase::Raised | Phase::Recovering, _) => 5,
        (_, DiagnosisState::Isolated) => 4,
        (_, DiagnosisState::Detected | DiagnosisState::Unknown) => 3,
        (_, DiagnosisState::EnvironmentInvalid) => 2,
        (_, DiagnosisState::Healthy | DiagnosisState::Undecided) => 1,
        (_, DiagnosisState::NoData) => 0,
    }
}

/// Runs a session on a record from beginning to end.
///
/// # Errors
/// The diagnoser does not fit the study, or has another sampling period than the record.
pub fn replay_record(
    study: &Study,
    diagnoser: &Arc<Diagnoser>,
    record: &FitRecord,
) -> Result<ReplaySummary, RuntimeError> {
    let (period_s, needed_s) = (record.period_s, diagnoser.period_s);
    if (period_s - needed_s).abs() > 1e-6 * needed_s {
        return Err(RuntimeError::Period { period_s, needed_s });
    }
    let mut watcher = Watcher::new(study, diagnoser.clone())?;
    let mut measured = vec![f64::NAN; study.system.sensors.len()];
    let mut inputs = vec![0.0; record.inputs.len()];
    let mut told = ReplaySummary { finding: Finding::default(), at_s: 0.0, outside: 0.0 };
    let mut outside = 0_usize;
    for (k, sample) in record.measured.chunks_exact(record.sensors.len()).enumerate() {
        let time_s = k as f64 * period_s;
        for (&sensor, &value) in record.sensors.iter().zip(sample) {
            measured[sensor] = value;
        }
        for (value, signal) in inputs.iter_mut().zip(&record.inputs) {
            *value = signal.value(time_s);
        }
        let finding = watcher.push(time_s, &inputs, &measured).finding;
        let (now, before) = (weight(finding), weight(&told.finding));
        if now > before {
            told.at_s = time_s;
        }
        if now >= before && !finding.says_the_same(&told.finding) {
            told.finding = finding.clone();
        }
        outside += usize::from(watcher.is_outside());
    }
    told.outside = outside as f64 / record.samples().max(1) as f64;
    told.finding.is_outside = outside > 0;
    Ok(told)
}
