//! Windows of what residuals are beyond a reference, beside toy actuators that are far from their twins.

use crate::toy::{self, Fault, Flight, Kind};
use servotwin_diagnosis::baseline::BaselineSettings;
use servotwin_diagnosis::diagnoser::decision::Allowances;
use servotwin_diagnosis::diagnoser::{Diagnoser, Outcome, Session, StoredSession};
use std::sync::Arc;

const SETTLE: u64 = toy::BASELINE.settle_samples as u64;
/// Of the windows beyond the reference.
const CORRECTED: usize = 2;
/// The pressure of chamber A of the first actuator.
const CHAMBER_A: usize = 2;

fn session() -> Session {
    Session::new(Arc::new(toy::with_baseline())).unwrap().at_rest()
}

fn fly(session: &mut Session, flight: &mut Flight, fault: Option<Fault>, samples: u64) -> Outcome {
    for _ in 0..samples {
        let (inputs, measured, twin) = flight.next(fault);
        session.push(&inputs, &measured, &twin);
    }
    *session.outcome()
}

#[test]
fn a_specimen_far_from_its_twin_is_inside_of_its_bands_beyond_the_reference() {
    let (mut session, mut flight) = (session(), Flight::new(1));
    for _ in 0..SETTLE + 600 {
        let (inputs, mut measured, twin) = flight.next(None);
        measured[CHAMBER_A] += 0.1;
        session.push(&inputs, &measured, &twin);
        let is_early = session.outcome().sample < SETTLE;
        assert!(!(is_early && session.is_full(CORRECTED)), "the reference is not there yet");
    }
    let [shown, beyond] = [0, CORRECTED].map(|length| session.window(length).mean(CHAMBER_A));
    assert!(shown > 0.07 && beyond.abs() < 0.002, "{shown} {beyond}");
    let band = session.diagnoser().lengths[CORRECTED].panel.bands[CHAMBER_A].half_width;
    assert!(session.window(0).largest(CHAMBER_A) > band);
    assert!(session.window(CORRECTED).largest(CHAMBER_A) < band);
}

#[test]
fn no_sample_brings_windows_of_both_kinds() {
    let (mut session, mut flight) = (session(), Flight::new(2));
    let mut brought = 0;
    for _ in 0..1000 {
        fly(&mut session, &mut flight, None, 1);
        let new = (0..3).filter(|&length| session.has_new_window(length)).count();
        assert!(new <= 1);
        brought += new;
    }
    assert!(brought > 150, "{brought}");
}

#[test]
fn what_is_suspected_does_not_become_the_reference() {
    let (mut session, mut flight) = (session(), Flight::new(3));
    fly(&mut session, &mut flight, None, 600);
    let fault = Some(Fault { actuator: 1, kind: Kind::Leak, size: 0.9 });
    let raised = fly(&mut session, &mut flight, fault, 400).raised.expect("raised");
    assert_eq!((raised.actuator, raised.action), (1, 0));
    let of = |session: &Session| session.window(CORRECTED).mean(4 + CHAMBER_A);
    let soon = of(&session);
    // Five times what the reference remembers.
    fly(&mut session, &mut flight, fault, 10_000);
    assert!(soon < -0.1 && (of(&session) - soon).abs() < 0.1, "{soon} {}", of(&session));
}

#[test]
fn another_mode_begins_with_another_reference() {
    let (mut session, mut flight) = (session(), Flight::new(4));
    fly(&mut session, &mut flight, None, 600);
    assert!(session.is_full(CORRECTED));
    session.switched_off(1).unwrap();
    fly(&mut session, &mut flight, None, SETTLE + 99);
    assert!(!session.is_full(CORRECTED), "the twin settles first, and then the reference");
    fly(&mut session, &mut flight, None, 100);
    assert!(session.is_full(CORRECTED));
}

#[test]
fn a_sensor_that_goes_silent_is_not_missed_by_its_tolerance() {
    let (mut session, mut flight) = (session(), Flight::new(5));
    fly(&mut session, &mut flight, None, 600);
    for _ in 0..300 {
        let (inputs, mut measured, twin) = flight.next(None);
        measured[CHAMBER_A] = f64::NAN;
        session.push(&inputs, &measured, &twin);
    }
    assert!(session.is_lost(CHAMBER_A) && session.is_full(CORRECTED));
    assert!(session.window(CORRECTED).mean(CHAMBER_A).abs() < 0.01);
}

#[test]
fn a_stored_session_with_a_reference_goes_on_to_the_bit() {
    for stop in [77, SETTLE, 437, 1203] {
        let (mut one, mut flight, mut twin) = (session(), Flight::new(6), Flight::new(6));
        fly(&mut one, &mut flight, None, stop);
        for _ in 0..stop {
            twin.next(None);
        }
        let text = serde_json::to_string(&one.save()).unwrap();
        let stored: StoredSession = serde_json::from_str(&text).unwrap();
        let mut other = session();
        other.restore(&stored).unwrap();
        let fault = Some(Fault { actuator: 0, kind: Kind::Bias, size: 0.7 });
        for k in 0..500 {
            let a = fly(&mut one, &mut flight, fault, 1);
            assert_eq!(a, fly(&mut other, &mut twin, fault, 1), "stored at {stop}, sample {k}");
        }
        assert_eq!(one.save(), other.save());
        let mut plain = Session::new(toy::diagnoser()).unwrap();
        assert!(plain.restore(&stored).is_err(), "it has no reference");
    }
}

#[test]
fn a_reference_and_the_windows_beyond_it_need_each_other() {
    toy::with_baseline().check().unwrap();
    let text = serde_json::to_string(&toy::with_baseline()).unwrap();
    assert_eq!(serde_json::from_str::<Diagnoser>(&text).unwrap(), toy::with_baseline());
    type Break = fn(&mut Diagnoser);
    let breaks: [Break; 5] = [
        |d| d.baseline = None,
        |d| d.lengths.truncate(2),
        |d| d.lengths.rotate_right(1),
        |d| {
            d.lengths[2].baseline_corrected = Some(Allowances { off_nats: -1.0, ..toy::ALLOWANCES })
        },
        |d| d.baseline = Some(BaselineSettings { settle_samples: 0, memory_samples: 10 }),
    ];
    for (place, wrong) in breaks.iter().enumerate() {
        let mut broken = toy::with_baseline();
        wrong(&mut broken);
        assert!(broken.check().is_err(), "break {place}");
    }
}
