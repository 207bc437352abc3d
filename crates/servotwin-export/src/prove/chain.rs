//! The whole chain, sample by sample: the outcome of a session, its evidence, its probabilities and its features.

use super::ProofEvidence;
use super::library::{Compiled, RunningSession};
use super::samples::{Sample, Samples};
use crate::error::ExportError;
use servotwin_diagnosis::diagnoser::{Alarm, Diagnoser, IndexedFinding, Outcome, Session, Why};
use servotwin_diagnosis::panel::SensorBand;
use servotwin_diagnosis::random::Random;
use std::sync::Arc;

/// The share of samples after which the flight control computer confirms or releases something.
const COMMAND_SHARE: f64 = 2e-4;

/// The same while an action is raised, which would stay for good if it switches off.
const ANSWER_SHARE: f64 = 5e-3;

/// The longest time until a command is taken back, in samples.
const LONGEST_COMMAND: usize = 1000;

/// The outcome of a session, as flat lists: `prove_push` of the C text.
#[derive(Default, PartialEq)]
pub(super) struct SessionAnswer {
    pub(crate) integers: Vec<i64>,
    pub(crate) numbers: Vec<f64>,
}

/// Runs a session and those of all compiled exports side by side. `tell` hears how many samples were compared.
pub(super) fn compare(
    diagnoser: &Arc<Diagnoser>,
    compiled: &[Compiled],
    samples: u64,
    evidence: &mut [ProofEvidence],
    tell: &mut dyn FnMut(u64),
) -> Result<(), ExportError> {
    let mut session = Session::new(diagnoser.clone())?;
    let mut others: Vec<_> = compiled.iter().map(Compiled::session).collect();
    let mut generated = Samples::new(diagnoser, 1);
    let mut commands = Commands::new();
    let mut said = [SessionAnswer::default(), SessionAnswer::default()];
    for k in 0..samples {
        if let Some((command, place)) = commands.next(&session) {
            obey(&mut session, (command, place))?;
            others.iter_mut().for_each(|other| other.command(command as i32, place as i32));
        }
        let before = accused(&session);
        if !compare_sample(&mut session, &mut others, (k, generated.next()), &mut said, evidence) {
            return Ok(());
        }
        let raised = accused(&session).filter(|now| Some(*now) != before);
        for evidence in evidence.iter_mut() {
            evidence.samples += 1;
            if let Some((_, action)) = raised {
                let name = &diagnoser.names().actions[action as usize];
                *evidence.raised.entry(name.clone()).or_default() += 1;
            }
        }
        if k % 100_000 == 0 {
            tell(k);
        }
    }
    Ok(())
}

/// Gives one sample with its number to all sessions; returns whether all say the same.
fn compare_sample(
    session: &mut Session,
    others: &mut [RunningSession],
    (number, sample): (u64, &Sample),
    [right, said]: &mut [SessionAnswer; 2],
    evidence: &mut [ProofEvidence],
) -> bool {
    push(session, sample, right);
    let newest = newest_length(session);
    for (other, evidence) in others.iter_mut().zip(evidence.iter_mut()) {
        other.push(sample, right, said);
        let rows_differ = newest.is_some_and(|length| !has_same_rows(session, length, other));
        if !is_same(right, said) || rows_differ {
            evidence.differ(format!("whole chain, sample {number}"), difference(right, said));
            return false;
        }
    }
    true
}

/// Actuator and action of the raised alarm.
fn accused(session: &Session) -> Option<(u32, u32)> {
    session.outcome().raised.map(|raised| (raised.actuator, raised.action))
}

/// Random commands of the flight control computer, as `prove_command` of the C text numbers them.
struct Commands {
    random: Random,
    /// A command that gives something back, its place, and the samples until then.
    to_undo: Option<(usize, usize, usize)>,
}

impl Commands {
    /// The sequence of every proof.
    pub(crate) fn new() -> Self {
        Commands { random: Random::new(2), to_undo: None }
    }

    /// The command before the next sample, with its place.
    pub(crate) fn next(&mut self, session: &Session) -> Option<(usize, usize)> {
        if let Some((command, place, left)) = self.to_undo {
            self.to_undo = (left > 0).then_some((command, place, left.saturating_sub(1)));
            return (left == 0).then_some((command, place));
        }
        let accused = accused(session).map(|(actuator, _)| actuator as usize);
        let share = if accused.is_some() { ANSWER_SHARE } else { COMMAND_SHARE };
        if self.random.unit() >= share {
            return None;
        }
        let diagnoser = session.diagnoser();
        let draw = if accused.is_some() { self.random.unit() } else { 1.0 };
        let (command, place) = match accused {
            // Mostly what is raised is withdrawn at once.
            Some(actuator) if draw < 0.8 => {
                return Some((if draw < 0.4 { 1 } else { 7 }, actuator));
            }
            Some(actuator) => (0, actuator),
            None => {
                let command = 2 * self.random.index(3);
                let actuators = diagnoser.names().actuators.len();
                let places = if command < 4 { actuators } else { diagnoser.sensors.len() };
                (command, self.random.index(places))
            }
        };
        let undo = if command == 0 { 6 } else { command + 1 };
        self.to_undo = Some((undo, place, self.random.index(LONGEST_COMMAND)));
        Some((command, place))
    }
}

/// Passes a command to a session.
fn obey(session: &mut Session, (command, place): (usize, usize)) -> Result<(), ExportError> {
    match command {
        0 => session.switched_off(place)?,
        1 => session.release(place)?,
        6 => session.switched_on(place)?,
        7 => session.reset_alarm(),
        2 | 3 => session.inhibit(place, command == 2)?,
        _ => session.take_out(place, command == 4)?,
    }
    Ok(())
}

/// Pushes a sample and writes the whole outcome of the session.
fn push(session: &mut Session, sample: &Sample, said: &mut SessionAnswer) {
    let outcome = *session.push(&sample.inputs, &sample.measured, &sample.twin);
    said.integers.clear();
    said.integers.extend(integers(&outcome));
    said.numbers.clear();
    let [confidence, lead] =
        outcome.raised.map_or([0.0; 2], |raised| [raised.confidence, raised.lead]);
    said.numbers.extend([outcome.confidence, outcome.excess, confidence, lead]);
    let names = session.diagnoser().names();
    let (actuators, actions) = (names.actuators.len(), names.actions.len());
    let hypotheses = || (0..actuators).flat_map(move |u| (0..actions).map(move |a| (u, a)));
    for length in 0..session.diagnoser().lengths.len() {
        said.numbers.push(session.evidence_of_change(length));
        said.numbers.push(session.evidence_of_unknown(length));
        said.numbers.push(session.probability(length, None));
        said.numbers.extend(hypotheses().map(|h| session.probability(length, Some(h))));
        said.numbers.extend(hypotheses().map(|(u, a)| session.evidence(length, u, a)));
        for actuator in 0..actuators {
            let is_full = session.is_full(length);
            said.numbers.push(session.evidence_of_actuator(length, actuator));
            said.numbers.push(if is_full { session.common_mode(length, actuator) } else { 0.0 });
        }
        let boundaries = 0..session.diagnoser().boundaries.len();
        for boundary in boundaries {
            said.numbers.push(session.boundary_evidence_nats(length, boundary));
            said.numbers.extend(session.boundary_numbers(length, boundary));
        }
    }
}

/// An index, or −1.
fn place(index: Option<u32>) -> i64 {
    index.map_or(-1, i64::from)
}

/// The integers of an outcome, in the order of `write_outcome` in the C text.
fn integers(outcome: &Outcome) -> [i64; 18] {
    let none = -1;
    let kind = number_of_finding(&outcome.finding);
    let (actuator, action, detail, input, why) = match outcome.finding {
        IndexedFinding::Unjudged
        | IndexedFinding::Healthy
        | IndexedFinding::Detected
        | IndexedFinding::Unknown => (none, none, none, none, 0),
        IndexedFinding::Actuator { actuator } => (i64::from(actuator), none, none, none, 0),
        IndexedFinding::Action { actuator, action } => {
            (i64::from(actuator), i64::from(action), none, none, 0)
        }
        IndexedFinding::Detail { actuator, action, detail } => {
            (i64::from(actuator), i64::from(action), i64::from(detail), none, 0)
        }
        IndexedFinding::EnvironmentInvalid { input, why } => {
            (none, none, none, i64::from(input), number_of_reason(why))
        }
    };
    let alarm = number_of_alarm(outcome.alarm);
    let raised = outcome.raised.map_or([0; 6], |raised| {
        let (sample, length) = (raised.sample as i64, i64::from(raised.length));
        [
            1,
            i64::from(raised.actuator),
            i64::from(raised.action),
            place(raised.detail),
            sample,
            length,
        ]
    });
    let [is_raised, its_actuator, its_action, its_detail, its_sample, its_length] = raised;
    [
        outcome.sample as i64,
        outcome.since_sample as i64,
        kind,
        actuator,
        action,
        detail,
        input,
        why,
        alarm,
        is_raised,
        its_actuator,
        its_action,
        its_detail,
        its_sample,
        its_length,
        place(outcome.length),
        place(outcome.worst_sensor),
        i64::from(outcome.lost),
    ]
}

/// `servotwin_finding` of the C text.
pub(super) fn number_of_finding(finding: &IndexedFinding) -> i64 {
    match finding {
        IndexedFinding::Unjudged => 0,
        IndexedFinding::Healthy => 1,
        IndexedFinding::Detected => 2,
        IndexedFinding::Actuator { .. } => 3,
        IndexedFinding::Action { .. } => 4,
        IndexedFinding::Detail { .. } => 5,
        IndexedFinding::Unknown => 6,
        IndexedFinding::EnvironmentInvalid { .. } => 7,
    }
}

/// `servotwin_alarm` of the C text.
pub(super) fn number_of_alarm(alarm: Alarm) -> i64 {
    match alarm {
        Alarm::Normal => 0,
        Alarm::Pending => 1,
        Alarm::Raised => 2,
        Alarm::Recovering => 3,
        Alarm::NoData => 4,
        Alarm::Error => 5,
    }
}

fn number_of_reason(why: Why) -> i64 {
    match why {
        Why::Missing => 0,
        Why::NotFinite => 1,
        Why::OutOfRange => 2,
        Why::Frozen => 3,
        Why::Contradicts => 4,
        Why::Doubtful => 5,
    }
}

/// The length whose features were computed last, if the last sample did.
fn newest_length(session: &Session) -> Option<usize> {
    (0..session.diagnoser().lengths.len()).rfind(|&length| is_judged(session, length))
}

/// Whether the last sample completed a full window of this length that lies outside its bands.
fn is_judged(session: &Session, length: usize) -> bool {
    let bands = &session.diagnoser().lengths[length].panel.bands;
    let window = session.window(length);
    let is_outside =
        |(place, band): (usize, &SensorBand)| window.largest(place) > band.half_width.max(1e-12);
    session.has_new_window(length)
        && session.is_full(length)
        && bands.iter().enumerate().any(is_outside)
}

fn has_same_rows(session: &Session, length: usize, other: &RunningSession) -> bool {
    let mut rows = session.features(length).iter().enumerate();
    rows.all(|(view, row)| super::models::same_bits(row, &other.row(view, row.len())))
}

fn is_same(a: &SessionAnswer, b: &SessionAnswer) -> bool {
    a.integers == b.integers && super::models::same_bits(&a.numbers, &b.numbers)
}

/// The first difference in words.
fn difference(right: &SessionAnswer, said: &SessionAnswer) -> String {
    let integer = right.integers.iter().zip(&said.integers).position(|(a, b)| a != b);
    let mut numbers = right.numbers.iter().zip(&said.numbers);
    let number = numbers.position(|(a, b)| a.to_bits() != b.to_bits());
    match (integer, number) {
        (Some(i), _) => format!("integer {i} is {}, not {}", said.integers[i], right.integers[i]),
        (None, Some(i)) => format!("number {i} is {}, not {}", said.numbers[i], right.numbers[i]),
        (None, None) => "the features differ".into(),
    }
}
