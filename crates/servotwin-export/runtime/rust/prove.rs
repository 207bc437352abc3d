//! Entry points for `servotwin prove`, those of `prove.c`. Not part of an export.
//!
//! # Safety
//! Callers pass places that exist, and lists as long as the diagnoser has them.
//!
//! A panic is an answer that no diagnosis gives, so that the proof finds it instead of ending.

use std::panic::{AssertUnwindSafe, catch_unwind};

use servotwin_flight::models::{Hierarchy, MOST_CLASSES, Rule};
use servotwin_flight::sizes::{
    ACTUATORS, BOUNDARIES, FEATURES, HYPOTHESES, INPUTS, LENGTHS, SENSORS,
};
use servotwin_flight::tables;
use servotwin_flight::{Alarm, Finding, Outcome, Session, Why, judge};

type Row = [f64; FEATURES];

#[repr(C)]
pub struct Answer {
    decided: i32,
    probability: f64,
}

#[repr(C)]
pub struct Diagnosis {
    actuator: i32,
    action: i32,
    detail: i32,
    confidence: f64,
    detail_confidence: f64,
}

/// What the work returns; `otherwise` if it panics.
pub(crate) fn guarded<T>(otherwise: T, work: impl FnOnce() -> T) -> T {
    static SILENCE: std::sync::Once = std::sync::Once::new();
    SILENCE.call_once(|| std::panic::set_hook(Box::new(|_| ())));
    catch_unwind(AssertUnwindSafe(work)).unwrap_or(otherwise)
}

fn hierarchy(is_committee: i32, length: i32) -> &'static Hierarchy {
    let length = &tables::LENGTHS[length as usize];
    if is_committee != 0 { length.committee } else { length.trees }
}

/// An index, or -1.
fn place(index: Option<usize>) -> i64 {
    index.map_or(-1, |index| index as i64)
}

unsafe fn rows(length: i32, views: *const *const Row) -> Vec<Row> {
    let count = tables::LENGTHS[length as usize].views;
    (0..count).map(|view| unsafe { **views.add(view) }).collect()
}

#[unsafe(no_mangle)]
pub extern "C" fn servotwin_rounds_twice() -> i32 {
    i32::from(servotwin_flight::rounds_twice())
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn prove_leaf(
    is_committee: i32,
    length: i32,
    stage: i32,
    tree: i32,
    row: *const Row,
) -> i32 {
    let stage = &hierarchy(is_committee, length).stages[stage as usize];
    guarded(i32::MIN, || stage.branches.leaf(tree as usize, unsafe { &*row }) as i32)
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn prove_decide(
    is_committee: i32,
    length: i32,
    stage: i32,
    row: *const Row,
) -> Answer {
    let stage = &hierarchy(is_committee, length).stages[stage as usize];
    guarded(Answer { decided: i32::MIN, probability: f64::NAN }, || {
        let answer = stage.decide(unsafe { &*row });
        Answer { decided: place(answer.decided) as i32, probability: answer.probability }
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn prove_shares(length: i32, stage: i32, row: *const Row, shares: *mut f64) {
    let stage = &hierarchy(1, length).stages[stage as usize];
    unsafe { *shares = f64::NAN };
    guarded((), || {
        let mut memory = [0.0; MOST_CLASSES];
        let own = stage.shares(unsafe { &*row }, &mut memory);
        unsafe { std::slice::from_raw_parts_mut(shares, own.len()) }.copy_from_slice(own);
    });
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn prove_diagnose(
    is_committee: i32,
    length: i32,
    views: *const *const Row,
) -> Diagnosis {
    let none = f64::NAN;
    let panicked = Diagnosis {
        actuator: i32::MIN,
        action: 0,
        detail: 0,
        confidence: none,
        detail_confidence: none,
    };
    guarded(panicked, || {
        let found = hierarchy(is_committee, length).diagnose(&unsafe { rows(length, views) });
        Diagnosis {
            actuator: place(found.actuator) as i32,
            action: place(found.action) as i32,
            detail: place(found.detail) as i32,
            confidence: found.confidence,
            detail_confidence: found.detail_confidence,
        }
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn prove_probabilities(
    length: i32,
    views: *const *const Row,
    into: *mut [f64; HYPOTHESES],
) {
    let panicked = [f64::NAN; HYPOTHESES];
    let all = || hierarchy(1, length).probabilities(&unsafe { rows(length, views) });
    unsafe { *into = guarded(panicked, all) };
}

#[unsafe(no_mangle)]
pub extern "C" fn prove_value(length: i32, stage: i32, leaf: i32, output: i32) -> f64 {
    match hierarchy(1, length).stages[stage as usize].rule {
        Rule::Boosted(boosted) => {
            boosted.values[leaf as usize * boosted.output_classes.len() + output as usize]
        }
        Rule::Cart(_) => f64::NAN,
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn prove_novelty(length: i32, known: i32, row: *const Row) -> f64 {
    let known = &tables::LENGTHS[length as usize].known[known as usize];
    guarded(f64::NAN, || judge::novelty(known, unsafe { &*row }))
}

#[unsafe(no_mangle)]
pub extern "C" fn prove_session_size() -> u64 {
    size_of::<Session>() as u64
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn prove_start(session: *mut Session) -> i32 {
    unsafe { session.write(Session::new()) };
    servotwin_rounds_twice()
}

/// Number, actuator, action, detail, input and reason of a finding.
fn finding(finding: Finding) -> [i64; 6] {
    let of = |index: usize| index as i64;
    match finding {
        Finding::Unjudged => [0, -1, -1, -1, -1, 0],
        Finding::Healthy => [1, -1, -1, -1, -1, 0],
        Finding::Detected => [2, -1, -1, -1, -1, 0],
        Finding::Actuator { actuator } => [3, of(actuator), -1, -1, -1, 0],
        Finding::Action { actuator, action } => [4, of(actuator), of(action), -1, -1, 0],
        Finding::Detail { actuator, action, detail } => {
            [5, of(actuator), of(action), of(detail), -1, 0]
        }
        Finding::Unknown => [6, -1, -1, -1, -1, 0],
        Finding::EnvironmentInvalid { input, why } => {
            let why = match why {
                Why::Missing => 0,
                Why::NotFinite => 1,
                Why::OutOfRange => 2,
                Why::Frozen => 3,
                Why::Contradicts => 4,
                Why::Doubtful => 5,
            };
            [7, -1, -1, -1, of(input), why]
        }
    }
}

fn alarm(alarm: Alarm) -> i64 {
    match alarm {
        Alarm::Normal => 0,
        Alarm::Pending => 1,
        Alarm::Raised => 2,
        Alarm::Recovering => 3,
        Alarm::NoData => 4,
        Alarm::Error => 5,
    }
}

fn integers(outcome: &Outcome) -> Vec<i64> {
    let raised = outcome.raised.map_or([0; 6], |raised| {
        let [actuator, action, length] =
            [raised.actuator, raised.action, raised.length].map(|i| i as i64);
        [1, actuator, action, place(raised.detail), raised.sample as i64, length]
    });
    let mut all = vec![outcome.sample as i64, outcome.since_sample as i64];
    all.extend(finding(outcome.finding));
    all.push(alarm(outcome.alarm));
    all.extend(raised);
    all.extend([place(outcome.length), place(outcome.worst_sensor), outcome.lost as i64]);
    all
}

/// Evidence, probabilities and doubts of a window length.
fn numbers_of(session: &Session, place: usize) -> Vec<f64> {
    let (length, evidence) = (&tables::LENGTHS[place], session.evidence(place));
    let ring = session.ring(place);
    let mut all = vec![evidence.of_change(length), evidence.of_unknown(length)];
    all.extend(session.probabilities(place));
    all.extend((1..HYPOTHESES).map(|claim| evidence.margin(length, claim)));
    for actuator in 0..ACTUATORS {
        all.push(evidence.margin_of_actuator(length, actuator));
        all.push(match ring.is_full(&length.span) {
            true => judge::common_mode(actuator, &ring.window, length),
            false => 0.0,
        });
    }
    for boundary in 0..BOUNDARIES {
        let doubt = session.doubt(place, boundary);
        all.push(doubt.evidence(&tables::BOUNDARIES[boundary]));
        all.push(if doubt.explained > 0 { 1.0 } else { 0.0 });
    }
    all
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn prove_push(
    session: *mut Session,
    inputs: *const [f64; INPUTS],
    measured: *const [f64; SENSORS],
    twin: *const [f64; SENSORS],
    integers_out: *mut i64,
    numbers_out: *mut f64,
) {
    let session = unsafe { &mut *session };
    let (integers, numbers) = guarded((vec![i64::MIN], vec![]), || {
        let outcome = *unsafe { session.push(&*inputs, &*measured, &*twin) };
        let confidence = outcome.raised.map_or(0.0, |raised| raised.confidence);
        let mut numbers = vec![outcome.confidence, outcome.worst, confidence];
        numbers.extend((0..LENGTHS).flat_map(|length| numbers_of(session, length)));
        (integers(&outcome), numbers)
    });
    unsafe {
        integers_out.copy_from_nonoverlapping(integers.as_ptr(), integers.len());
        numbers_out.copy_from_nonoverlapping(numbers.as_ptr(), numbers.len());
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn prove_row(session: *const Session, view: i32, into: *mut Row) {
    unsafe { *into = (&*session).rows()[view as usize] };
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn prove_command(session: *mut Session, command: i32, place: i32) {
    let (session, place) = (unsafe { &mut *session }, place as usize);
    // A session that panicked goes on differently than the diagnosis, or panics again at the next sample.
    guarded((), || match command {
        0 => session.switched_off(place),
        1 => session.release(place),
        2 | 3 => session.inhibit(place, command == 2),
        _ => session.take_out(place, command == 4),
    });
}
