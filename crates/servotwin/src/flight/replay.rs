//! Replays a record, as [`crate::fit`] reads it, through the diagnosis.

use super::runtime::RuntimeError;
use super::watcher::Watcher;
use crate::fit::Record;
use crate::observer::{Finding, Observer, Phase, State};
use crate::study::Study;
use servotwin_diagnosis::diagnoser::Diagnoser;
use std::sync::Arc;

/// The most significant finding of a record.
#[derive(Debug, Clone, PartialEq)]
pub struct ReplaySummary {
    /// The finding.
    pub finding: Finding,
    /// First time at which a finding of this weight occurred, s.
    pub at_s: f64,
    /// Share of the samples outside the training range of the conditional band.
    pub outside: f64,
}

/// Rank of a finding by significance.
fn weight(finding: &Finding) -> u32 {
    match (finding.phase, finding.state) {
        (Phase::Raised | Phase::Recovering, _) => 5,
        (_, State::Isolated) => 4,
        (_, State::Detected | State::Unknown) => 3,
        (_, State::EnvironmentInvalid) => 2,
        (_, State::Healthy | State::Undecided) => 1,
        (_, State::NoData) => 0,
    }
}

/// Runs the diagnosis over a whole record.
///
/// # Errors
/// The diagnoser does not match the study, or its sample period differs from the record's.
pub fn replay_record(
    study: &Study,
    diagnoser: &Arc<Diagnoser>,
    record: &Record,
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
