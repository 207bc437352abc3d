//! The failure of the function against simulated flights and closed forms.

use servotwin_diagnosis::random::Random;
use servotwin_safety::function_rate::flight::{FlightModel, LaneOnsets};
use servotwin_safety::tree::numbers::ExposureHours;

fn model(lanes: &[LaneOnsets]) -> FlightModel {
    FlightModel { lanes: lanes.to_vec(), keeps_last: true, hours: HOURS }
}

const HOURS: ExposureHours =
    ExposureHours { flight_h: 2.0, repair_h: 0.0, check_h: 100.0, test_h: None };

fn assert_close(found: f64, wanted: f64, relative: f64) {
    assert!((found / wanted - 1.0).abs() < relative, "{found} instead of {wanted}");
}

#[test]
fn with_perfect_detection_both_lanes_must_fail_in_a_flight() {
    for rate in [1e-9, 1e-3, 0.7, 300.0] {
        let lane = LaneOnsets { contained: rate, ..Default::default() };
        let found = model(&[lane, lane]).function_failure();
        let one = -(-2.0 * rate).exp_m1();
        assert_close(found.failed, one * one, 1e-7);
    }
}

#[test]
fn a_test_on_the_ground_ends_what_it_finds_and_nothing_else() {
    let tested = |passed: f64| {
        let lane = LaneOnsets { hidden: 2e-3, passed: passed * 2e-3, ..Default::default() };
        let hours = ExposureHours { test_h: Some(10.0), ..HOURS };
        FlightModel { hours, ..model(&[lane, lane]) }.function_failure().failed
    };
    let lane = LaneOnsets { hidden: 2e-3, ..Default::default() };
    let checked = |check_h: f64| {
        let hours = ExposureHours { check_h, ..HOURS };
        FlightModel { hours, ..model(&[lane, lane]) }.function_failure().failed
    };
    // A test that passes everything is none, and one that finds everything is a check.
    assert_close(tested(1.0), checked(100.0), 1e-12);
    assert_close(tested(0.0), checked(10.0), 1e-12);
    assert!(
        checked(10.0) < tested(0.3) && tested(0.3) < tested(0.6) && tested(0.6) < checked(100.0)
    );
}

#[test]
fn without_detection_a_fault_fails_every_flight_until_the_check() {
    let lane = LaneOnsets { hidden: 2e-3, ..Default::default() };
    let found = model(&[lane, lane]).function_failure();
    // The mean over flights k of the probability that a fault began since the check or in the flight.
    let steps = 100_000;
    let since = |k: usize| 2.0 + 98.0 * (k as f64 + 0.5) / f64::from(steps);
    let mean: f64 = (0..steps as usize).map(|k| -(-4e-3 * since(k)).exp_m1()).sum();
    assert_close(found.failed, mean / f64::from(steps), 1e-8);
    assert_eq!(found.failed, found.uncontained);
    // What begins in a flight is the other part.
    let before: f64 = (0..steps as usize).map(|k| -(-4e-3 * (since(k) - 2.0)).exp_m1()).sum();
    assert_close(found.failed - 2.0 * found.begins_per_h, before / f64::from(steps), 1e-8);
    assert_close(model(&[lane]).function_failure().failed, found.failed / 2.0, 0.1);
}

#[test]
fn a_series_continues_the_mean_share() {
    // `hidden` faults between two checks: the model has a series for few of them, and a closed form for more.
    let failed = |hidden: f64| {
        let lane = LaneOnsets { hidden: hidden / 98.0, ..Default::default() };
        model(&[lane]).function_failure().failed
    };
    assert_close(failed(0.999_999e-4), failed(1.000_001e-4), 3e-6);
    let (before, now) = (1.0 - (1.0 - (-2.0_f64).exp()) / 2.0, -(-4.0_f64 / 98.0).exp_m1());
    assert_close(failed(2.0), before + (1.0 - before) * now, 1e-12);
}

/// A flight as it happens, event by event: whether the function fails, and whether a fault acts. A fault or shutdown
/// comes at its own moment.
fn fly(model: &FlightModel, random: &mut Random) -> [f64; 2] {
    let exponential = |random: &mut Random, rate: f64| -(1.0 - random.unit()).ln() / rate;
    let of = |holds: bool| f64::from(u8::from(holds));
    let since_check = (model.hours.check_h - model.hours.flight_h) * random.unit();
    let hidden = model.lanes.iter().map(|lane| exponential(random, lane.hidden));
    if hidden.collect::<Vec<_>>().into_iter().any(|moment| moment < since_check) {
        return [1.0, 1.0];
    }
    let mut events = vec![];
    for (lane, own) in model.lanes.iter().enumerate() {
        for (kind, rate) in
            [own.contained, own.reported + own.hidden, own.needless].iter().enumerate()
        {
            events.push((exponential(random, *rate), lane, kind));
        }
    }
    events.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut on = vec![true; model.lanes.len()];
    for (_, lane, kind) in events.into_iter().take_while(|event| event.0 < model.hours.flight_h) {
        let is_last = on.iter().filter(|on| **on).count() == 1;
        let stays_on = kind == 1 || (is_last && model.keeps_last && kind == 0);
        if !on[lane] || (kind == 2 && is_last && model.keeps_last) {
            continue;
        }
        if stays_on || is_last {
            return [1.0, of(stays_on)];
        }
        on[lane] = false;
    }
    [0.0, 0.0]
}

#[test]
fn an_independent_simulation_of_flights_agrees() {
    let first =
        LaneOnsets { contained: 0.08, reported: 0.01, hidden: 0.002, passed: 0.0, needless: 0.1 };
    let second =
        LaneOnsets { contained: 0.15, reported: 0.02, hidden: 0.001, passed: 0.0, needless: 0.03 };
    let mut random = Random::new(6);
    for (lanes, keeps_last) in
        [(vec![first, second], true), (vec![first, second], false), (vec![second], false)]
    {
        let model = FlightModel { keeps_last, ..model(&lanes) };
        let flights = 400_000;
        let (mut failed, mut uncontained) = (0.0, 0.0);
        for _ in 0..flights {
            let flight = fly(&model, &mut random);
            failed += flight[0];
            uncontained += flight[1];
        }
        let found = model.function_failure();
        for (count, share) in [(failed, found.failed), (uncontained, found.uncontained)] {
            let deviation = (share * (1.0 - share) / f64::from(flights)).sqrt();
            let seen = count / f64::from(flights);
            assert!((seen - share).abs() < 4.0 * deviation, "{seen} instead of {share}");
        }
    }
}

#[test]
fn a_lane_that_waits_for_its_repair_leaves_the_other_alone() {
    let lane = LaneOnsets { contained: 1e-4, ..Default::default() };
    let hours = ExposureHours { repair_h: 50.0, ..HOURS };
    let waiting = FlightModel { hours, ..model(&[lane, lane]) };
    let waits = -(-2e-4_f64 * 50.0).exp_m1();
    let one = -(-2e-4_f64).exp_m1();
    let wanted = (1.0 - waits) * one * one + waits * one;
    assert_close(waiting.function_failure().failed, wanted, 1e-7);
}
