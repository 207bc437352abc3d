//! A sequence through twin and diagnosis together, for the decisions of the hybrid twin.

use super::{Entry, Sequence, Step, table};
use crate::error::ExportError;
use crate::prove::hybrid::{is_same, said};
use crate::prove::library::Compiled;
use crate::prove::samples::Sample;
use crate::prove::twin::Inputs;
use crate::prove::{ProofEvidence, Subject};
use servotwin::flight::runtime::Runtime;
use servotwin_diagnosis::random::Random;

/// The samples of the sequence.
const SAMPLES: usize = 300;

/// Samples after which an input is wrong, in turn too low, too high, and missing.
const WRONG: usize = 20;

/// A sequence in which every input is wrong now and then.
pub(super) fn sequence(subject: &Subject) -> Result<Sequence, ExportError> {
    let Subject { diagnoser, twin, .. } = subject;
    let (mut inputs, mut random) = (Inputs::new(twin, 1), Random::new(7));
    let steps = (0..SAMPLES).map(|sample| {
        let mut told: Vec<f64> = inputs.next().iter().map(|knot| knot.value).collect();
        if sample % WRONG == WRONG - 1 && !told.is_empty() {
            let wrong = [-1e12, 1e12, f64::NAN, f64::INFINITY];
            let place = random.index(told.len());
            told[place] = wrong[sample / WRONG % wrong.len()];
        }
        let sensors = diagnoser.sensors.len();
        // The twin's values stand here once the sequence was run.
        let (measured, twin) = (vec![f64::NAN; sensors], vec![0.0; sensors]);
        Step { command: None, sample: Sample { inputs: told, measured, twin } }
    });
    Ok(Sequence { entry: Entry::Hybrid, steps: steps.collect(), outcomes: Vec::new() })
}

/// Runs it in the toolkit and in all builds. Writes the twin's values into the steps; measured values are those of the twin
/// one sample before.
pub(super) fn run(
    sequence: &mut Sequence,
    subject: &Subject,
    compiled: &[Compiled],
    evidence: &mut [ProofEvidence],
    note: &mut dyn FnMut(usize) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    let Subject { study, diagnoser, twin } = subject;
    let runtime = Runtime::new(study, (*diagnoser).clone(), vec![])?;
    let mut runtime = runtime.stepping(twin.settings);
    let mut others = compiled.iter().map(Compiled::hybrid).collect::<Result<Vec<_>, _>>()?;
    sequence.outcomes.clear();
    let mut before = vec![f64::NAN; diagnoser.sensors.len()];
    for (number, Step { sample, .. }) in sequence.steps.iter_mut().enumerate() {
        sample.measured.copy_from_slice(&before);
        let outcome = runtime.push(&sample.inputs, &sample.measured).ok().copied();
        sample.twin.copy_from_slice(runtime.expected());
        before.copy_from_slice(&sample.twin);
        let own = outcome.as_ref().map(said);
        for (other, evidence) in others.iter_mut().zip(evidence.iter_mut()) {
            if !is_same(own, &sample.twin, other, &sample.inputs, &sample.measured) {
                evidence.differ("vectors, hybrid twin".into(), format!("sample {number}"));
                return Ok(());
            }
        }
        note(number)?;
        sequence.outcomes.push(outcome.as_ref().map(table::outcome));
    }
    Ok(())
}
