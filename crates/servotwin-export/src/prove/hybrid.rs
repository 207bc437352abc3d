//! The hybrid twin beside the runtime of the toolkit: inputs from their buses, twin and diagnosis together.

use super::chain::{number_of_alarm, number_of_finding};
use super::library::{Compiled, RunningHybrid};
use super::models::same_bits;
use super::twin::Inputs;
use super::{ProofEvidence, Subject};
use crate::error::ExportError;
use servotwin::flight::runtime::Runtime;
use servotwin_diagnosis::diagnoser::Outcome;
use servotwin_diagnosis::random::Random;

/// Share of samples with a missing or wild input, and with a missing reading.
const BROKEN: f64 = 0.01;

/// Samples after which another sensor is disturbed.
const DISTURBED: u64 = 500;

/// The size of a disturbance, in parts of scale.
const OFFSET: f64 = 0.05;

/// Runs the hybrid twin of the toolkit and those of all builds over so many samples.
pub(super) fn compare(
    subject: &Subject,
    compiled: &[Compiled],
    samples: u64,
    evidence: &mut [ProofEvidence],
) -> Result<(), ExportError> {
    let Subject { study, diagnoser, twin } = subject;
    let runtime = Runtime::new(study, (*diagnoser).clone(), vec![])?;
    let mut runtime = runtime.stepping(twin.settings);
    let mut others = compiled.iter().map(Compiled::hybrid).collect::<Result<Vec<_>, _>>()?;
    let (mut inputs, mut random) = (Inputs::new(twin, 1), Random::new(5));
    let mut expected = vec![0.0; diagnoser.sensors.len()];
    for sample in 0..samples {
        let mut told: Vec<f64> = inputs.next().iter().map(|knot| knot.value).collect();
        let place = random.index(told.len());
        if random.unit() < BROKEN {
            told[place] = if random.unit() < 0.5 { f64::NAN } else { 1e12 };
        }
        let disturbed = (sample / DISTURBED) as usize % expected.len();
        let measured =
            diagnoser.sensors.iter().zip(&expected).enumerate().map(|(place, (sensor, twin))| {
                let offset = if place == disturbed { OFFSET * sensor.scale } else { 0.0 };
                let is_missing = random.unit() < BROKEN / 10.0;
                if is_missing { f64::NAN } else { twin + offset }
            });
        let measured: Vec<f64> = measured.collect();
        let own = runtime.push(&told, &measured).ok().map(said);
        expected.copy_from_slice(runtime.expected());
        for (other, evidence) in others.iter_mut().zip(evidence.iter_mut()) {
            if !is_same(own, &expected, other, &told, &measured) {
                evidence.differ("hybrid twin".into(), format!("sample {sample}"));
                return Ok(());
            }
            evidence.hybrid_samples += 1;
        }
    }
    Ok(())
}

/// What is compared of an outcome.
fn said(outcome: &Outcome) -> ([i64; 3], f64) {
    let (finding, alarm) = (number_of_finding(&outcome.finding), number_of_alarm(outcome.alarm));
    ([finding, alarm, outcome.since_sample as i64], outcome.confidence)
}

/// Whether a hybrid twin of a build has the same outcome and expects the same values for a sample.
fn is_same(
    own: Option<([i64; 3], f64)>,
    expected: &[f64],
    other: &mut RunningHybrid,
    told: &[f64],
    measured: &[f64],
) -> bool {
    let said = other.push(told, measured, expected.len());
    match (own, said) {
        (None, None) => true,
        (Some((integers, confidence)), Some((said, its_confidence, its_expected))) => {
            integers == said
                && confidence.to_bits() == its_confidence.to_bits()
                && same_bits(expected, its_expected)
        }
        _ => false,
    }
}
