//! The hybrid twin beside that of `servotwin watch`: inputs from their buses, twin and diagnosis together.

use super::chain::{number_of_alarm, number_of_finding};
use super::library::{Compiled, RunningHybrid};
use super::models::same_bits;
use super::twin::Inputs;
use super::{ProofEvidence, Subject};
use crate::error::ExportError;
use servotwin::live::observer::Observer;
use servotwin::live::watcher::Watcher;
use servotwin::study::Reaction;
use servotwin_diagnosis::diagnoser::Outcome;
use servotwin_diagnosis::random::Random;

/// Share of samples with a missing or wild input, and with a missing reading or one that no sensor has.
const BROKEN: f64 = 0.01;

/// Samples after which another sensor is disturbed.
const DISTURBED: u64 = 500;

/// The size of a disturbance, in parts of scale.
const OFFSET: f64 = 0.05;

/// Random samples for the hybrid twins.
struct Samples<'s> {
    subject: &'s Subject<'s>,
    inputs: Inputs<'s>,
    random: Random,
    inputs_told: Vec<f64>,
    measured: Vec<f64>,
}

impl<'s> Samples<'s> {
    fn new(subject: &'s Subject) -> Self {
        let (inputs, random) = (Inputs::new(subject.twin, 1), Random::new(5));
        Samples { subject, inputs, random, inputs_told: vec![], measured: vec![] }
    }

    /// The sample with this number, near what is expected of the sensors. In the first one all inputs are missing.
    fn next(&mut self, number: u64, expected: &[f64], off: Option<&Reaction>) {
        let Samples { subject, random, .. } = self;
        let value = |value: f64| if number == 0 { f64::NAN } else { value };
        self.inputs_told = self.inputs.next().iter().map(|knot| value(knot.value)).collect();
        let place = random.index(self.inputs_told.len());
        if random.unit() < BROKEN {
            let wild = [f64::NAN, f64::INFINITY, 1e12];
            self.inputs_told[place] = wild[random.index(wild.len())];
        }
        for &(input, value) in off.into_iter().flat_map(|reaction| &reaction.inputs) {
            self.inputs_told[input] = value;
        }
        let disturbed = (number / DISTURBED) as usize % expected.len();
        let sensors = subject.diagnoser.sensors.iter().zip(expected).enumerate();
        let measured = sensors.map(|(place, (sensor, twin))| {
            let offset = if place == disturbed { OFFSET * sensor.scale } else { 0.0 };
            match random.unit() {
                share if share < BROKEN / 10.0 => f64::NAN,
                share if share < BROKEN / 5.0 => 1e4 * sensor.scale,
                _ => twin + offset,
            }
        });
        self.measured = measured.collect();
    }

    /// Makes values missing that are not possible, as `servotwin watch` does.
    fn leave_out_impossible(&mut self) {
        let values = self.inputs_told.iter_mut().chain(&mut self.measured);
        for (value, &(low, high)) in values.zip(&self.subject.twin.possible) {
            if *value < low || *value > high {
                *value = f64::NAN;
            }
        }
    }
}

/// Runs the hybrid twin of the toolkit and those of all builds over so many samples. Every other turn a reaction stands: its
/// inputs show it, or the flight control computer says it. In the end a parameter changes.
pub(super) fn compare(
    subject: &Subject,
    compiled: &[Compiled],
    samples: u64,
    evidence: &mut [ProofEvidence],
) -> Result<(), ExportError> {
    let Subject { study, diagnoser, twin } = subject;
    let Some(mut others) = started(compiled, evidence) else { return Ok(()) };
    let mut watcher = Watcher::new(study, (*diagnoser).clone())?.stepping(twin.settings);
    let place = |id: &str| diagnoser.sensors.iter().position(|sensor| sensor.name == id);
    let places: Vec<_> = study.system.sensors.iter().map(|sensor| place(&sensor.id)).collect();
    let mut generated = Samples::new(subject);
    let mut expected = vec![0.0; diagnoser.sensors.len()];
    let turn = (samples / (2 * twin.reactions.len() as u64 + 3)).max(1);
    for sample in 0..samples {
        let number = (sample / turn) as usize;
        let reaction =
            |turn: usize| (turn % 2 == 1).then(|| twin.reactions.get(turn / 2)).flatten();
        let (now, before) = (reaction(number), number.checked_sub(1).and_then(reaction));
        if sample % turn == 0 {
            if let Some(known) = before.filter(|known| !known.is_seen()) {
                watcher.runtime_mut().release(known.actuator)?;
                others.iter_mut().for_each(|other| other.release(known.actuator));
            }
            if let Some(known) = now.filter(|known| !known.is_seen()) {
                watcher.runtime_mut().follow(known.actuator, &known.reaction)?;
                others.iter_mut().for_each(|other| other.follow(known));
            }
            if number == 2 * twin.reactions.len() + 2 {
                change_parameter(subject, &mut watcher, &mut others, evidence)?;
            }
        }
        let shown = now.filter(|known| known.is_seen()).map(|known| &known.reaction);
        generated.next(sample, &expected, shown);
        let (told, measured) = (generated.inputs_told.clone(), generated.measured.clone());
        generated.leave_out_impossible();
        let of_system: Vec<f64> =
            places.iter().map(|at| at.map_or(f64::NAN, |at| generated.measured[at])).collect();
        watcher.push(sample as f64 * twin.period_s, &generated.inputs_told, &of_system);
        let own = watcher.outcome().map(said);
        expected.copy_from_slice(watcher.runtime().expected());
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

/// The started hybrid twins of all builds; `None` if one fails its start test.
fn started<'c>(
    compiled: &'c [Compiled],
    evidence: &mut [ProofEvidence],
) -> Option<Vec<RunningHybrid<'c>>> {
    let mut all = Vec::new();
    for (compiled, evidence) in compiled.iter().zip(evidence) {
        match compiled.hybrid() {
            Some(hybrid) => all.push(hybrid),
            None => evidence.differ("start test".into(), "the twin computes otherwise".into()),
        }
    }
    (all.len() == compiled.len()).then_some(all)
}

/// Changes the first parameter that is not zero; no index beyond the list and no NaN is taken.
fn change_parameter(
    subject: &Subject,
    watcher: &mut Watcher,
    others: &mut [RunningHybrid],
    evidence: &mut [ProofEvidence],
) -> Result<(), ExportError> {
    let values = subject.twin.program.parameters(&[]);
    let all = values.iter().enumerate();
    let all = all.flat_map(|(c, own)| own.iter().enumerate().map(move |(p, v)| (c, p, 1.001 * v)));
    let mut all = all.enumerate();
    let Some((place, changed)) = all.find(|(_, (_, _, value))| *value != 0.0) else {
        return Ok(());
    };
    let parameters = vec![changed];
    watcher.runtime_mut().follow(0, &Reaction { parameters, ..Reaction::default() })?;
    for (other, evidence) in others.iter_mut().zip(evidence) {
        let place = place as i32;
        let is_wrong = other.set(-1, changed.2) || other.set(place, f64::NAN);
        if is_wrong || !other.set(place, changed.2) {
            evidence.differ("hybrid twin".into(), "a parameter is set".into());
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
