//! The diagnoser at work beside two toy actuators.

use crate::toy::{self, Fault, Flight, KINDS, Kind, SENSORS};
use proptest::prelude::*;
use servotwin_diagnosis::diagnoser::{
    Alarm, Boundary, DiagnosedSensor, Diagnoser, IndexedFinding, Outcome, Raised, Session,
    StoredSession, Why,
};
use servotwin_diagnosis::features::Quantity;
use servotwin_diagnosis::random::Random;
use servotwin_diagnosis::spread::Spread;
use std::sync::{Arc, OnceLock};

fn session() -> Session {
    Session::new(toy::diagnoser()).unwrap().at_rest()
}

/// Flies for so many samples; the last outcome.
fn fly(session: &mut Session, flight: &mut Flight, fault: Option<Fault>, samples: u64) -> Outcome {
    for _ in 0..samples {
        let (inputs, measured, twin) = flight.next(fault);
        session.push(&inputs, &measured, &twin);
    }
    *session.outcome()
}

/// Flies until something is raised; after how many samples.
fn raise(session: &mut Session, flight: &mut Flight, fault: Fault) -> Option<(u64, Raised)> {
    (1..=1000).find_map(|k| fly(session, flight, Some(fault), 1).raised.map(|raised| (k, raised)))
}

#[test]
fn a_healthy_specimen_raises_nothing() {
    for seed in 0..20 {
        let (mut session, mut flight) = (session(), Flight::new(5000 + seed));
        for k in 0..3000 {
            let outcome = fly(&mut session, &mut flight, None, 1);
            assert_eq!(outcome.raised, None, "seed {seed}, sample {k}");
        }
        let outcome = session.outcome();
        assert_eq!(outcome.finding, IndexedFinding::Healthy, "seed {seed}");
        assert_eq!(outcome.alarm, Alarm::Normal);
        assert_eq!(session.diagnoser().describe(outcome.finding), "healthy");
    }
}

#[test]
fn a_session_begins_as_behind_a_gap_unless_it_begins_at_rest() {
    let mut begun = Session::new(toy::diagnoser()).unwrap();
    let (mut behind_a_gap, mut at_rest) = (session(), session());
    behind_a_gap.restart();
    let mut flight = Flight::new(5000);
    for k in 0..700 {
        let (inputs, measured, twin) = flight.next(None);
        let outcome = *begun.push(&inputs, &measured, &twin);
        assert_eq!(outcome, *behind_a_gap.push(&inputs, &measured, &twin), "sample {k}");
        at_rest.push(&inputs, &measured, &twin);
    }
    let tuning = &begun.diagnoser().tuning;
    let settling = (tuning.settle_s / begun.diagnoser().period_s).round() as u64;
    let settled = [&begun, &at_rest].map(|session| session.outcome().counts.settling);
    assert_eq!(settled, [settling, 0]);
}

#[test]
fn a_change_by_a_command_counts_from_the_next_sample() {
    let (mut session, mut flight) = (session(), Flight::new(5000));
    let before = fly(&mut session, &mut flight, None, 700);
    session.switched_off(0).unwrap();
    for _ in 0..2 {
        let outcome = fly(&mut session, &mut flight, None, 1);
        assert_ne!(outcome.finding, before.finding);
        assert_eq!(outcome.since_sample, 700);
    }
}

#[test]
fn every_fault_raises_its_command_in_its_actuator() {
    for kind in KINDS {
        for actuator in 0..2 {
            let (mut session, mut flight) = (session(), Flight::new(6000 + actuator as u64));
            assert_eq!(fly(&mut session, &mut flight, None, 700).raised, None);
            let fault = Fault { actuator, kind, size: 0.9 };
            let (samples, raised) = raise(&mut session, &mut flight, fault).expect("raised");
            let said = (raised.actuator as usize, raised.action);
            assert_eq!(said, (actuator, kind.action()), "{fault:?}");
            assert!(samples < 400, "{fault:?} after {samples} samples");
            let outcome = fly(&mut session, &mut flight, Some(fault), 300);
            let detail = KINDS.iter().position(|known| *known == kind).unwrap() as u32;
            let (actuator, action) = (actuator as u32, kind.action());
            assert_eq!(outcome.finding, IndexedFinding::Detail { actuator, action, detail });
            assert_eq!(outcome.alarm, Alarm::Raised);
            assert!(outcome.confidence > 0.5 && outcome.excess > 1.0, "{outcome:?}");
            let length = outcome.length.unwrap() as usize;
            let path = session.explain(length).unwrap();
            assert_eq!(path.len(), 3, "actuator, command, detail");
            let sensor = outcome.worst_sensor.unwrap();
            assert_eq!(session.diagnoser().sensors[sensor as usize].actuator, Some(actuator));
        }
    }
}

#[test]
fn an_alarm_recovers_and_is_over_unless_it_switches_off() {
    for kind in KINDS {
        let (mut session, mut flight) = (session(), Flight::new(6100));
        let fault = Fault { actuator: 0, kind, size: 0.9 };
        raise(&mut session, &mut flight, fault).expect("raised");
        let mut seen = vec![];
        for _ in 0..2000 {
            let alarm = fly(&mut session, &mut flight, None, 1).alarm;
            if seen.last() != Some(&alarm) {
                seen.push(alarm);
            }
        }
        let end = session.outcome();
        if kind.action() == 0 {
            assert_eq!(seen, [Alarm::Raised]);
            assert!(end.raised.is_some() && end.finding == IndexedFinding::Healthy);
            session.release(0).unwrap();
            assert_eq!(fly(&mut session, &mut flight, None, 500).raised, None);
        } else {
            assert_eq!(seen[..2], [Alarm::Raised, Alarm::Recovering], "{kind:?}: {seen:?}");
            assert_eq!((end.finding, end.alarm), (IndexedFinding::Healthy, Alarm::Normal));
        }
    }
}

/// Actuator and action of a finding.
fn named(finding: IndexedFinding) -> (Option<u32>, Option<u32>) {
    match finding {
        IndexedFinding::Actuator { actuator } => (Some(actuator), None),
        IndexedFinding::Action { actuator, action }
        | IndexedFinding::Detail { actuator, action, .. } => (Some(actuator), Some(action)),
        _ => (None, None),
    }
}

/// A shutdown was raised, nobody carried it out, and the fault went away: all later faults are reported beside it.
#[test]
fn a_shutdown_stands_and_hides_no_later_fault() {
    let (mut session, mut flight) = (session(), Flight::new(6200));
    let leak = Fault { actuator: 0, kind: Kind::Leak, size: 0.9 };
    let (_, shutdown) = raise(&mut session, &mut flight, leak).unwrap();
    for (kind, actuator) in KINDS.into_iter().flat_map(|kind| [(kind, 0), (kind, 1)]) {
        let between = fly(&mut session, &mut flight, None, 1500);
        assert_eq!((between.finding, between.alarm), (IndexedFinding::Healthy, Alarm::Raised));
        let fault = Fault { actuator, kind, size: 0.9 };
        let found = fly(&mut session, &mut flight, Some(fault), 800);
        // The last actuator is not shut down, but its fault is named.
        let action = (kind.action() != 0 || actuator == 0).then_some(kind.action());
        assert_eq!(named(found.finding), (Some(actuator as u32), action), "{fault:?}");
        let raised = found.raised.unwrap();
        assert_eq!((raised.actuator, raised.action, raised.sample), (0, 0, shutdown.sample));
    }
    fly(&mut session, &mut flight, None, 1500);
    session.reset_alarm();
    assert_eq!((session.outcome().raised, session.stands(0)), (None, None));
    let after = fly(&mut session, &mut flight, None, 100);
    assert_eq!((after.finding, after.alarm), (IndexedFinding::Healthy, Alarm::Normal));
    // A fault that lasts is raised again, and one that was repaired is not raised by samples of before.
    raise(&mut session, &mut flight, leak).unwrap();
    session.reset_alarm();
    let (_, again) = raise(&mut session, &mut flight, leak).unwrap();
    assert!((again.actuator, again.action) == (0, 0) && again.sample > shutdown.sample);
    session.reset_alarm();
    assert!((0..500).all(|_| fly(&mut session, &mut flight, None, 1).raised.is_none()));
}

/// Inputs that are held for some time make no gap longer: the sensors come back while the twin settles.
#[test]
fn a_gap_lasts_equally_long_whether_or_not_inputs_are_held() {
    let judged_after = |held: usize| {
        let (mut session, mut flight) = (session(), Flight::new(6400));
        fly(&mut session, &mut flight, None, 500);
        for k in 0..100 {
            let (inputs, _, twin) = flight.next(None);
            let inputs = if k < held { inputs } else { [f64::NAN; 3] };
            session.push(&inputs, &[f64::NAN; SENSORS], &twin);
        }
        let healthy = IndexedFinding::Healthy;
        (1..1000).find(|_| fly(&mut session, &mut flight, None, 1).finding == healthy).unwrap()
    };
    let after = [0, 5, 10, 50, 100].map(judged_after);
    assert!(after.iter().all(|after| (100..=170).contains(after)), "{after:?}");
}

#[test]
fn a_sample_without_a_twin_counts_and_the_twin_settles_again() {
    let (mut session, mut flight) = (session(), Flight::new(6400));
    fly(&mut session, &mut flight, None, 500);
    let failed = *session.push_without_twin();
    assert_eq!((failed.finding, failed.alarm), (IndexedFinding::Unjudged, Alarm::Error));
    assert_eq!((failed.sample, failed.counts.errors), (500, 1));
    let settling = fly(&mut session, &mut flight, None, 100);
    assert_eq!((settling.finding, settling.counts.settling), (IndexedFinding::Unjudged, 100));
    let after = fly(&mut session, &mut flight, None, 100);
    assert_eq!((after.finding, after.alarm), (IndexedFinding::Healthy, Alarm::Normal));
}

#[test]
fn after_one_actuator_is_off_the_other_is_diagnosed_and_never_switched_off() {
    let (mut session, mut flight) = (session(), Flight::new(6200));
    let leak = |actuator| Fault { actuator, kind: Kind::Leak, size: 0.9 };
    let (_, raised) = raise(&mut session, &mut flight, leak(0)).unwrap();
    assert_eq!((raised.actuator, raised.action), (0, 0));
    session.switched_off(0).unwrap();
    assert!(session.is_off(0) && session.outcome().raised.is_none());
    // What is off shows anything; the other is healthy.
    let outcome = fly(&mut session, &mut flight, Some(leak(0)), 1500);
    assert_eq!((outcome.finding, outcome.raised), (IndexedFinding::Healthy, None));
    // The other one's faults that need it off are named, and no command is raised.
    for _ in 0..1500 {
        let outcome = fly(&mut session, &mut flight, Some(leak(1)), 1);
        assert_eq!(outcome.raised, None);
    }
    assert_eq!(session.outcome().finding, IndexedFinding::Actuator { actuator: 1 });
    assert_eq!(session.outcome().alarm, Alarm::Pending);
    fly(&mut session, &mut flight, None, 1000);
    // What needs less is raised.
    let wear = Fault { actuator: 1, kind: Kind::Wear, size: 0.9 };
    let (_, raised) = raise(&mut session, &mut flight, wear).unwrap();
    assert_eq!((raised.actuator, raised.action), (1, 2));
}

#[test]
fn what_was_never_trained_on_switches_nothing_off() {
    let (mut session, mut flight) = (session(), Flight::new(6300));
    fly(&mut session, &mut flight, None, 500);
    let mut unknown = 0;
    for k in 0..1500_u64 {
        let (inputs, mut measured, twin) = flight.next(None);
        // Everything swings at once.
        for (place, value) in measured[..8].iter_mut().enumerate() {
            *value += 0.5 * (0.3 * k as f64 + place as f64).sin();
        }
        let outcome = session.push(&inputs, &measured, &twin);
        assert_eq!(outcome.raised, None, "sample {k}");
        unknown += u32::from(outcome.finding == IndexedFinding::Unknown);
    }
    assert_eq!(session.outcome().finding, IndexedFinding::Unknown);
    assert!(unknown > 1000, "{unknown}");
}

/// Flies while both chambers of the first actuator lose a pressure; the last outcome, and whether anything was raised.
fn lose(session: &mut Session, lost: f64) -> (Outcome, bool) {
    lose_beside(session, lost, 0.0)
}

/// The same beside a first input that moves at the same time.
fn lose_beside(session: &mut Session, lost: f64, moved: f64) -> (Outcome, bool) {
    let (mut flight, mut random, mut was_raised) = (Flight::new(6350), Random::new(3), false);
    for k in 0..1500 {
        let (mut inputs, mut measured, twin) = flight.next(None);
        inputs[0] += if k >= 500 { moved } else { 0.0 };
        for place in 0..4 {
            let lost = if place >= 2 && k >= 500 { lost } else { 0.0 };
            measured[place] = twin[place] - lost + 0.004 * (random.unit() - 0.5);
        }
        was_raised |= session.push(&inputs, &measured, &twin).raised.is_some();
    }
    (*session.outcome(), was_raised)
}

/// A shift outside of the bands of 0.02 that a transducer's error may be.
const SHIFT: f64 = 0.045;

/// A wrong supply pressure shifts both chambers, and so does a leak.
#[test]
fn a_shutdown_waits_while_a_wrong_boundary_value_explains_everything() {
    let effects = vec![(2, 1e-7), (3, 1e-7)];
    let boundary = Boundary { input: 0, sensor: 2, is_return: false, effects };
    let knowing = Diagnoser { boundaries: vec![boundary], ..(*toy::diagnoser()).clone() };
    let knowing = || Session::new(Arc::new(knowing.clone())).unwrap().at_rest();
    let (outcome, was_raised) = lose(&mut session(), SHIFT);
    assert!(was_raised, "without the boundary a shift looks like a leak: {outcome:?}");
    let (outcome, was_raised) = lose(&mut knowing(), SHIFT);
    let doubtful = IndexedFinding::EnvironmentInvalid { input: 0, why: Why::Doubtful };
    assert_eq!((outcome.finding, outcome.alarm), (doubtful, Alarm::Pending));
    assert!(!was_raised);
    // No transducer errs by twice as much.
    let (outcome, was_raised) = lose(&mut knowing(), 2.0 * SHIFT);
    assert!(was_raised, "{outcome:?}");
    assert_eq!(outcome.raised.map(|raised| (raised.actuator, raised.action)), Some((0, 0)));
}

#[test]
fn a_wrong_environment_is_named_and_nothing_is_judged_until_the_twin_has_settled() {
    let wrong = [
        (0, f64::NAN, Why::Missing, Alarm::NoData),
        (1, f64::INFINITY, Why::NotFinite, Alarm::Error),
        (2, 150.0, Why::OutOfRange, Alarm::Error),
        (1, 2.2e7, Why::Contradicts, Alarm::Error),
        (0, 2.1e7, Why::Frozen, Alarm::Error),
    ];
    for (input, value, why, alarm) in wrong {
        let (mut session, mut flight) = (session(), Flight::new(6400));
        fly(&mut session, &mut flight, None, 500);
        for _ in 0..100 {
            let (mut inputs, measured, twin) = flight.next(None);
            inputs[input] = value;
            // What a wrong boundary value does to the residuals is no fault.
            let measured = measured.map(|value| value + 0.3);
            let outcome = session.push(&inputs, &measured, &twin);
            assert_eq!(outcome.raised, None);
        }
        let outcome = *session.outcome();
        let input = if why == Why::Contradicts { 0 } else { input as u32 };
        assert_eq!(outcome.finding, IndexedFinding::EnvironmentInvalid { input, why });
        assert_eq!(outcome.alarm, alarm);
        assert!(outcome.counts.environment >= 79, "{:?}", outcome.counts);
        let before = outcome.counts.settling;
        assert_eq!(
            before,
            if why == Why::Missing { 3 } else { 0 },
            "so long the twin goes on without"
        );
        let outcome = fly(&mut session, &mut flight, None, 100);
        assert_eq!(outcome.finding, IndexedFinding::Unjudged);
        assert_eq!(outcome.counts.settling - before, 100);
        let outcome = fly(&mut session, &mut flight, None, 300);
        assert_eq!((outcome.finding, outcome.raised), (IndexedFinding::Healthy, None));
    }
}

/// In a return line nothing but a leak lowers the pressure beside a reading that stays where it was right.
#[test]
fn a_shutdown_does_not_wait_if_the_return_pressure_falls_and_its_reading_stays() {
    let effects = vec![(2, 1e-7), (3, 1e-7)];
    let boundary = Boundary { input: 0, sensor: 2, is_return: true, effects };
    let knowing = Diagnoser { boundaries: vec![boundary], ..(*toy::diagnoser()).clone() };
    let knowing = || Session::new(Arc::new(knowing.clone())).unwrap().at_rest();
    let (outcome, was_raised) = lose(&mut knowing(), SHIFT);
    assert!(was_raised, "{outcome:?}");
    assert_eq!(outcome.raised.map(|raised| (raised.actuator, raised.action)), Some((0, 0)));
    let (_, was_raised) = lose_beside(&mut knowing(), SHIFT, SHIFT / 1e-7);
    assert!(!was_raised, "the reading went wrong by what the sensors deviate");
}

/// Pushes samples with these sensors at a value, and gives the last outcome.
fn push(
    session: &mut Session,
    flight: &mut Flight,
    fault: Option<Fault>,
    (sensors, value): (&[usize], f64),
    samples: usize,
) -> Outcome {
    for _ in 0..samples {
        let (inputs, mut measured, twin) = flight.next(fault);
        sensors.iter().for_each(|&sensor| measured[sensor] = value);
        session.push(&inputs, &measured, &twin);
    }
    *session.outcome()
}

#[test]
fn a_few_missing_values_are_counted_and_nothing_else_changes() {
    let (mut session, mut flight) = (session(), Flight::new(6500));
    let before = fly(&mut session, &mut flight, None, 500);
    let after = push(&mut session, &mut flight, None, (&[3], f64::NAN), 1);
    assert_eq!((after.finding, after.alarm), (before.finding, before.alarm));
    assert_eq!((after.counts.missing, after.lost), (1, 0));
}

#[test]
fn without_most_sensors_of_an_actuator_there_is_no_data() {
    let (mut session, mut flight) = (session(), Flight::new(6500));
    fly(&mut session, &mut flight, None, 500);
    let most: &[usize] = &[0, 1, 3];
    let missing = push(&mut session, &mut flight, None, (most, f64::NAN), 40);
    assert_eq!((missing.finding, missing.alarm), (IndexedFinding::Unjudged, Alarm::NoData));
    assert_eq!((missing.counts.missing, missing.lost), (40, 3));
    let wrong = push(&mut session, &mut flight, None, (most, 1e30), 40);
    assert_eq!((wrong.finding, wrong.alarm), (IndexedFinding::Unjudged, Alarm::NoData));
    let back = fly(&mut session, &mut flight, None, 300);
    assert_eq!((back.finding, back.lost), (IndexedFinding::Healthy, 0));
    assert!(session.take_out(SENSORS, true).is_err() && session.release(2).is_err());
}

#[test]
fn a_sensor_that_went_silent_does_not_blind_the_others() {
    for value in [f64::NAN, 1e30] {
        let (mut session, mut flight) = (session(), Flight::new(6500));
        let jam = Some(Fault { actuator: 0, kind: Kind::Jam, size: 0.9 });
        fly(&mut session, &mut flight, None, 500);
        let lost = push(&mut session, &mut flight, None, (&[3], value), 500);
        assert_eq!((lost.finding, lost.lost), (IndexedFinding::Healthy, 1));
        assert!(session.is_lost(3) && !session.is_lost(2));
        let samples = lost.counts.missing + lost.counts.errors;
        assert!((1..=10).contains(&samples), "{:?}", lost.counts);
        let found = push(&mut session, &mut flight, jam, (&[3], value), 1000);
        let raised = found.raised.expect("the actuator's other sensors show the jam");
        assert_eq!((raised.actuator, raised.action), (0, Kind::Jam.action()));
    }
}

#[test]
fn without_a_sensor_of_either_actuator_the_right_one_is_accused() {
    for (actuator, is_taken_out) in [(0, false), (1, false), (0, true), (1, true)] {
        let (mut session, mut flight) = (session(), Flight::new(6500));
        let jam = Some(Fault { actuator, kind: Kind::Jam, size: 0.9 });
        session.take_out(3, is_taken_out).unwrap();
        push(&mut session, &mut flight, None, (&[3], f64::NAN), 500);
        let found = push(&mut session, &mut flight, jam, (&[3], f64::NAN), 1000);
        let raised = found.raised.expect("the other sensors show the jam");
        assert_eq!((raised.actuator, raised.action), (actuator as u32, Kind::Jam.action()));
        assert_eq!(found.lost, u32::from(!is_taken_out));
        let path = session.explain(raised.length as usize).unwrap();
        assert_eq!(path.len(), 3, "actuator, action, detail");
        session.take_out(3, false).unwrap();
        let back = fly(&mut session, &mut flight, jam, 1000);
        let raised = back.raised.expect("all sensors show the jam");
        let shown = (raised.actuator as usize, raised.action, back.lost);
        assert_eq!(shown, (actuator, Kind::Jam.action(), 0));
    }
}

#[test]
fn a_sensor_that_is_taken_out_may_be_missing() {
    let (mut session, mut flight) = (session(), Flight::new(6500));
    session.take_out(3, true).unwrap();
    let outcome = push(&mut session, &mut flight, None, (&[3], f64::NAN), 500);
    assert_eq!((outcome.finding, outcome.counts.missing), (IndexedFinding::Healthy, 0));
}

#[test]
fn an_inhibited_actuator_is_not_judged_and_the_other_is() {
    let (mut session, mut flight) = (session(), Flight::new(6600));
    session.inhibit(1, true).unwrap();
    let jam = |actuator| Fault { actuator, kind: Kind::Jam, size: 0.9 };
    let outcome = fly(&mut session, &mut flight, Some(jam(1)), 1500);
    assert_eq!((outcome.finding, outcome.raised), (IndexedFinding::Healthy, None));
    let (_, raised) = raise(&mut session, &mut flight, jam(0)).unwrap();
    assert_eq!((raised.actuator, raised.action), (0, 0));
}

#[test]
fn a_stored_session_goes_on_to_the_bit() {
    let fault = Fault { actuator: 1, kind: Kind::Wear, size: 0.6 };
    for stop in [3, 437, 1203, 1391] {
        let (mut one, mut flight, mut twin) = (session(), Flight::new(6700), Flight::new(6700));
        let at = |k: u64| (k > 1000).then_some(fault);
        for k in 0..stop {
            fly(&mut one, &mut flight, at(k), 1);
            twin.next(at(k));
        }
        let text = serde_json::to_string(&one.save()).unwrap();
        let mut other = session();
        other.restore(&serde_json::from_str::<StoredSession>(&text).unwrap()).unwrap();
        for k in stop..2500 {
            let a = fly(&mut one, &mut flight, at(k), 1);
            assert_eq!(a, fly(&mut other, &mut twin, at(k), 1), "stored at {stop}, sample {k}");
        }
        assert!(one.outcome().raised.is_some());
        assert_eq!(one.save(), other.save());
    }
}

#[test]
fn a_stored_diagnoser_is_the_same_and_a_broken_one_is_refused() {
    let diagnoser = toy::diagnoser();
    let text = serde_json::to_string(&*diagnoser).unwrap();
    let read: Diagnoser = serde_json::from_str(&text).unwrap();
    assert_eq!(read, *diagnoser);
    read.check().unwrap();
    type Break = fn(&mut Diagnoser);
    let breaks: [Break; 12] = [
        |d| d.format = "servotwin diagnoser 9".into(),
        |d| d.period_s = 0.0,
        |d| d.lengths.clear(),
        |d| d.lengths[1].span.pane_samples = 7,
        |d| d.lengths[1].panel.bands[0].sensor = "another".into(),
        |d| d.lengths[1].panel.trees.names.actions[0] = "another".into(),
        |d| d.lengths[0].novelty.classes.truncate(1),
        |d| d.sensors[0].scale = 0.0,
        |d| d.sensors[0].actuator = Some(9),
        |d| d.sensors.truncate(3),
        |d| d.environment.inputs[0].largest = f64::NAN,
        |d| d.tuning.least_on = 7,
    ];
    for (place, wrong) in breaks.iter().enumerate() {
        let mut broken = read.clone();
        wrong(&mut broken);
        assert!(broken.check().is_err(), "break {place}");
        assert!(Session::new(broken.into()).is_err(), "break {place}");
    }
    let mut foreign = serde_json::to_value(session().save()).unwrap();
    foreign["guard"]["sensors"] = serde_json::json!([]);
    let foreign: StoredSession = serde_json::from_value(foreign).unwrap();
    assert!(session().restore(&foreign).is_err());
}

/// Any number, the odd ones often.
fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        Just(f64::NAN),
        Just(f64::INFINITY),
        Just(-0.0),
        Just(f64::MAX),
        any::<u64>().prop_map(f64::from_bits),
        -1.0..1.0_f64,
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn nonsense_raises_nothing_and_never_panics(
        rows in prop::collection::vec(
            (
                prop::collection::vec(any_number(), 0..5),
                prop::collection::vec(any_number(), 0..12),
                prop::collection::vec(any_number(), 0..12),
            ),
            1..200,
        )
    ) {
        let mut session = Session::new(toy::with_baseline().into()).unwrap().at_rest();
        for (inputs, measured, twin) in &rows {
            let outcome = session.push(inputs, measured, twin);
            prop_assert!(outcome.raised.is_none());
            prop_assert!(outcome.confidence.is_finite() && outcome.excess.is_finite());
        }
        // It can still be stored: nothing in it is no number.
        let text = serde_json::to_string(&session.save()).unwrap();
        let stored: StoredSession = serde_json::from_str(&text).unwrap();
        prop_assert_eq!(stored, session.save());
    }

    /// Faults come and go, sensors, inputs and the twin fail, actuators are switched, and the session is stored: a
    /// shutdown stands until it is reset, and never two of them.
    #[test]
    fn a_shutdown_stands_until_it_is_reset(seed in any::<u64>()) {
        let mut random = Random::new(seed);
        let (mut session, mut flight) = (session(), Flight::new(random.next_u64()));
        let mut stands: [Option<u64>; 2] = [None; 2];
        for _ in 0..60 {
            let kind = KINDS[random.index(KINDS.len())];
            let drawn = Fault { actuator: random.index(2), kind, size: random.between(0.5, 1.5) };
            let fault = (random.unit() < 0.6).then_some(drawn);
            let (place, event) = (random.index(2), random.index(12));
            match event {
                0 => session.switched_off(place).unwrap(),
                1 => session.switched_on(place).unwrap(),
                2 => session.inhibit(place, random.unit() < 0.5).unwrap(),
                3 => session.take_out(random.index(SENSORS), random.unit() < 0.5).unwrap(),
                4 => session.restart(),
                5 => {
                    session.push_without_twin();
                }
                6 => {
                    let stored = session.save();
                    session = Session::new(toy::diagnoser()).unwrap();
                    session.restore(&stored).unwrap();
                }
                7 if random.unit() < 0.3 => {
                    session.reset_alarm();
                    stands = [None; 2];
                }
                _ => {}
            }
            for _ in 0..20 + random.index(150) {
                let (mut inputs, mut measured, twin) = flight.next(fault);
                match event {
                    8 => inputs[random.index(3)] = [f64::NAN, 1e30, 0.0][random.index(3)],
                    9 => measured.fill(f64::NAN),
                    10 => measured[random.index(SENSORS)] = f64::INFINITY,
                    _ => {}
                }
                let raised = session.push(&inputs, &measured, &twin).raised;
                let now = [0, 1].map(|actuator| session.stands(actuator).map(|r| r.sample));
                for (before, now) in stands.iter().zip(now) {
                    prop_assert!(before.is_none() || *before == now, "{stands:?} {now:?}");
                }
                stands = now;
                prop_assert!(stands.iter().flatten().count() < 2, "{stands:?}");
                let shutdown = raised.filter(|raised| raised.action == 0);
                prop_assert!(shutdown.is_none_or(|r| stands[r.actuator as usize].is_some()));
            }
        }
    }

    /// Faults of both actuators come, change and go, values are lost, what is raised is carried out
    /// late, or never: at no time have both actuators been told to switch off.
    #[test]
    fn both_actuators_are_never_switched_off(seed in any::<u64>()) {
        let mut random = Random::new(seed);
        let session = Session::new(toy::with_baseline().into());
        let (mut session, mut flight) = (session.unwrap().at_rest(), Flight::new(random.next_u64()));
        let mut told_off = [false; 2];
        let mut faults = [None; 2];
        for _ in 0..40 {
            for (actuator, fault) in faults.iter_mut().enumerate() {
                let kind = KINDS[random.index(KINDS.len())];
                let drawn = Fault { actuator, kind, size: random.between(0.2, 1.5) };
                *fault = (random.unit() < 0.6).then_some(drawn);
            }
            let loses = random.unit() < 0.1;
            let carries_out = random.unit() < 0.4;
            for _ in 0..50 + random.index(200) {
                // Both faults at once: the second one's deviation is added to the first's.
                let (inputs, mut measured, twin) = flight.next(faults[0]);
                if let Some(fault) = faults[1] {
                    measured[4] += 0.1 * fault.size * (1.0 + twin[4]);
                    measured[6] -= 0.2 * fault.size;
                    measured[7] -= 0.2 * fault.size;
                }
                if loses {
                    measured[5] = f64::NAN;
                }
                if let Some(raised) = session.push(&inputs, &measured, &twin).raised {
                    told_off[raised.actuator as usize] |= raised.action == 0;
                }
                prop_assert!(told_off != [true, true]);
            }
            match session.outcome().raised {
                Some(raised) if carries_out && raised.action == 0 => {
                    session.switched_off(raised.actuator as usize).unwrap();
                }
                _ if random.unit() < 0.1 => session.inhibit(0, random.unit() < 0.5).unwrap(),
                _ => {}
            }
        }
    }
}

/// Sensors of three actuators and their surface.
const OF_THREE: usize = toy::sensors_of(3);

fn of_three() -> Arc<Diagnoser> {
    static TRAINED: OnceLock<Arc<Diagnoser>> = OnceLock::new();
    TRAINED.get_or_init(|| toy::train::<OF_THREE>(3)).clone()
}

/// Three actuators, in any of which faults come and go; what is raised is carried out or not: the last one
/// that is on is never told to switch off, and one after the other two are.
#[test]
fn the_last_of_three_actuators_is_never_switched_off() {
    let diagnoser = of_three();
    let mut most_off = 0;
    for seed in 0..30 {
        let mut random = Random::new(seed);
        let mut session = Session::new(diagnoser.clone()).unwrap().at_rest();
        let mut flight = Flight::<OF_THREE>::of(random.next_u64());
        let mut told_off = [false; 3];
        for _ in 0..20 {
            let (actuator, kind) = (random.index(3), KINDS[random.index(KINDS.len())]);
            let fault = Fault { actuator, kind, size: random.between(0.5, 1.5) };
            let fault = (random.unit() < 0.8).then_some(fault);
            for _ in 0..100 + random.index(200) {
                let (inputs, measured, twin) = flight.next(fault);
                if let Some(raised) = session.push(&inputs, &measured, &twin).raised {
                    told_off[raised.actuator as usize] |= raised.action == 0;
                }
                assert!(told_off != [true; 3], "seed {seed}");
            }
            match session.outcome().raised {
                Some(raised) if random.unit() < 0.7 && raised.action == 0 => {
                    session.switched_off(raised.actuator as usize).unwrap();
                }
                _ => {}
            }
        }
        most_off = most_off.max(told_off.iter().filter(|told| **told).count());
    }
    assert_eq!(most_off, 2);
}

#[test]
fn every_fault_of_three_actuators_raises_its_command_in_its_actuator() {
    let diagnoser = of_three();
    for (kind, actuator) in
        KINDS.into_iter().flat_map(|kind| (0..3).map(move |actuator| (kind, actuator)))
    {
        let mut session = Session::new(diagnoser.clone()).unwrap().at_rest();
        let mut flight = Flight::<OF_THREE>::of(6000 + actuator as u64);
        let fault = Fault { actuator, kind, size: 0.9 };
        let mut push = |session: &mut Session, fault| {
            let (inputs, measured, twin) = flight.next(fault);
            session.push(&inputs, &measured, &twin).raised
        };
        for _ in 0..700 {
            assert_eq!(push(&mut session, None), None);
        }
        let raised = (0..400).find_map(|_| push(&mut session, Some(fault)));
        let raised = raised.map(|raised| (raised.actuator as usize, raised.action));
        assert_eq!(raised, Some((actuator, kind.action())), "{fault:?}");
    }
}

/// The toy's diagnoser whose spreads grow with the spool of each sensor's actuator.
fn with_growth(growth: f64) -> Diagnoser {
    let mut diagnoser = (*toy::diagnoser()).clone();
    let sensors = diagnoser.sensors.clone();
    for sensor in &mut diagnoser.sensors {
        let is_spool = |other: &DiagnosedSensor| {
            other.actuator == sensor.actuator && other.quantity == Quantity::Spool
        };
        let spool = sensors.iter().position(is_spool);
        sensor.spread = spool.map(|spool| Spread { spool: spool as u32, growth });
    }
    diagnoser
}

#[test]
fn a_spread_that_does_not_grow_says_the_same_and_one_that_grows_hides_what_departs_in_motion() {
    let fault = Fault { actuator: 1, kind: Kind::Bias, size: 0.9 };
    let [mut plain, mut same, mut wide] = [session(), with(0.0), with(1e3)];
    let mut flights = [Flight::new(6300), Flight::new(6300), Flight::new(6300)];
    for k in 0..1200 {
        let fault = (k >= 600).then_some(fault);
        let expected = fly(&mut plain, &mut flights[0], fault, 1);
        let found = fly(&mut same, &mut flights[1], fault, 1);
        assert_eq!((found.finding, found.raised), (expected.finding, expected.raised), "{k}");
        assert_eq!(fly(&mut wide, &mut flights[2], fault, 1).raised, None);
    }
    assert!(plain.outcome().raised.is_some());
    assert_eq!(wide.outcome().finding, IndexedFinding::Healthy);
}

fn with(growth: f64) -> Session {
    Session::new(Arc::new(with_growth(growth))).unwrap().at_rest()
}

#[test]
fn a_spread_is_checked_and_a_residual_is_told_in_parts_of_it() {
    let mut diagnoser = with_growth(10.0);
    let place = diagnoser.sensors.iter().position(|sensor| sensor.spread.is_some()).unwrap();
    let mut session = Session::new(Arc::new(diagnoser.clone())).unwrap().at_rest();
    let (inputs, measured, mut twin) = Flight::new(6400).next(None);
    twin[diagnoser.sensors[place].spread.unwrap().spool as usize] = -0.9;
    session.push(&inputs, &measured, &twin);
    assert_eq!(session.residual(place, 3.0, 1.0), 0.2);
    diagnoser.sensors[place].spread = Some(Spread { spool: 99, growth: 1.0 });
    assert!(Session::new(Arc::new(diagnoser)).is_err());
}

#[test]
fn a_sample_of_other_lengths_is_refused_with_both_numbers_and_not_counted() {
    let mut session = session();
    let sensors = session.diagnoser().sensors.len();
    let inputs = vec![0.0; session.diagnoser().environment.inputs.len()];
    let values = vec![0.0; sensors];
    let refused = session.try_push(&inputs, &values[1..], &values).unwrap_err();
    assert_eq!(
        refused.to_string(),
        format!("measured values: expected {sensors}, found {}", sensors - 1)
    );
    assert!(session.try_push(&inputs, &values, &[]).is_err());
    assert!(session.try_push(&[0.0; 99], &values, &values).is_err());
    assert_eq!(session.try_push(&inputs, &values, &values).unwrap().sample, 0);
}

#[test]
fn a_diagnoser_with_a_missing_or_an_unknown_constant_is_refused() {
    let file = serde_json::to_value(&*toy::diagnoser()).unwrap();
    let is_read = |change: &dyn Fn(&mut serde_json::Map<String, serde_json::Value>)| {
        let mut file = file.clone();
        change(file["tuning"].as_object_mut().unwrap());
        serde_json::from_value::<Diagnoser>(file).is_ok()
    };
    assert!(is_read(&|_| {}));
    assert!(!is_read(&|tuning| drop(tuning.remove("evidence_cap"))));
    assert!(!is_read(&|tuning| drop(tuning.insert("clipp_nats".into(), 3.0.into()))));
}
