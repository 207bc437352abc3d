//! The fault trees of studies: their numbers, cut sets, documents and figures.

use super::brute_force;
use servotwin::measure::outcome::{FirstAction, RunOutcome, Word};
use servotwin::study::Study;
use servotwin_safety::counts::JudgedFlights;
use servotwin_safety::interval::CountedValue;
use servotwin_safety::rates::{FailureRate, FailureRates, rated_faults};
use servotwin_safety::tree::decision_diagram::DecisionDiagram;
use servotwin_safety::tree::lanes::{LaneTrees, lane_trees};
use servotwin_safety::tree::numbers::{BandEnd, ExposureHours, evaluate, event_probabilities};
use servotwin_safety::tree::structure::TreeInput;
use servotwin_safety::tree::{drawing, exchange};

const HEAD: &str = include_str!("../../../servotwin/tests/tiny.toml");
const HOURS: ExposureHours =
    ExposureHours { flight_h: 2.0, repair_h: 10.0, check_h: 100.0, test_h: None };

fn study(classes: &str) -> Study {
    let reactions = "[reactions]\nshut_down = { switches_off = true }\n";
    Study::parse(&format!("{HEAD}{classes}{reactions}"), "tiny.toml").unwrap()
}

fn class(detail: &str, action: &str, fault: &str) -> String {
    format!("[[classes]]\ndetail = \"{detail}\"\naction = \"{action}\"\nfaults = [\"{fault}\"]\n")
}

/// Flights with so many isolated of so many flown, with the other counts beside them.
fn flights(
    actions: &[(&str, usize, usize, usize, usize)],
    shutdowns: u64,
    hours: f64,
) -> JudgedFlights {
    let mut faults = vec![];
    for &(action, flown, isolated, other, wrong) in actions {
        faults.extend((0..flown).map(|place| RunOutcome {
            action: action.into(),
            intensity: 1.0,
            onset_s: Some(0.0),
            visible_s: Some(0.1),
            first: match place {
                _ if place < isolated => FirstAction::Right,
                _ if place < isolated + other => FirstAction::OtherAction,
                _ => FirstAction::OtherActuator,
            },
            shutdown_healthy: place < wrong,
            ..RunOutcome::default()
        }));
    }
    JudgedFlights { title: "noise".into(), faults, healthy: (hours, shutdowns), passed: None }
}

fn rates(list: &[(&str, f64)]) -> FailureRates {
    let rate = |&(fault, per_h): &(&str, f64)| FailureRate {
        fault: fault.into(),
        per_h,
        source: "a test".into(),
        line: 2,
    };
    FailureRates { path: "rates.csv".into(), list: list.iter().map(rate).collect() }
}

const VALVE: &str = "servo_valve.bias_positive";

fn two_lanes() -> LaneTrees {
    let study = study(&class("valve", "shut_down", VALVE));
    // Coarse numbers, so that every kind of event matters.
    let flights = flights(&[("shut_down", 20, 15, 2, 3)], 1, 30.0);
    lane_trees(&study, &flights, &rates(&[(VALVE, 0.01)])).unwrap()
}

#[test]
fn the_trees_of_two_lanes_are_those_of_brute_force() {
    let trees = two_lanes();
    assert_eq!(trees.tree.events.len(), 14);
    for end in BandEnd::ALL {
        let of_events = event_probabilities(&trees, &HOURS, end);
        for top in &trees.tree.tops {
            let input = TreeInput::Gate(top.gate);
            let exact = brute_force::probability(&trees.tree, input, &of_events);
            let own = DecisionDiagram::new(&trees.tree, input).probability(&of_events);
            assert!(
                (own - exact).abs() < 1e-12,
                "{}: {own} {exact}",
                trees.tree.gates[top.gate].id
            );
        }
    }
    let both = TreeInput::Gate(trees.tree.tops[1].gate);
    let sets = DecisionDiagram::new(&trees.tree, both).cut_sets();
    let of_events = event_probabilities(&trees, &HOURS, BandEnd::Point);
    let mut own: Vec<_> =
        sets.most_probable(&of_events, usize::MAX).into_iter().map(|s| s.1).collect();
    own.sort();
    assert_eq!(own, brute_force::cut_sets(&trees.tree, both));
}

#[test]
fn both_lanes_are_lost_by_the_sets_that_an_engineer_names() {
    let trees = two_lanes();
    let tops = evaluate(&trees, &HOURS);
    let ids: Vec<&str> = tops.iter().map(|top| top.id.as_str()).collect();
    assert_eq!(ids, ["loss_of_one_lane", "loss_of_both_lanes", "undetected_degradation"]);
    let has = |events: &[&str]| {
        tops[1].cut_sets.iter().any(|set| {
            set.events.len() == events.len()
                && events.iter().all(|e| set.events.iter().any(|own| own == e))
        })
    };
    let (one, two) =
        ("actuator_1-servo_valve-bias_positive", "actuator_2-servo_valve-bias_positive");
    assert!(has(&[&format!("{one}-begins"), &format!("{two}-begins")]));
    // One fault and a wrong answer to it.
    let wrong = "actuator_1-shut_down-shuts_down-actuator_2";
    assert!(has(&[&format!("{one}-begins"), wrong]));
    // A fault hidden in one lane, and one that begins in the other.
    assert!(has(&[
        &format!("{one}-begins"),
        &format!("{two}-hidden"),
        "actuator_2-shut_down-missed"
    ]));
    assert!(has(&[&format!("{one}-begins"), "actuator_2-false_shutdown-waits"]));
    // The alarm never shuts down the last lane: two false alarms are not enough.
    let alarms = ["actuator_1-false_shutdown-begins", "actuator_2-false_shutdown-begins"];
    assert!(
        !tops[1].cut_sets.iter().any(|set| set.events.iter().all(|e| alarms.contains(&e.as_str())))
    );
}

#[test]
fn one_lane_by_hand() {
    let trees = two_lanes();
    let tops = evaluate(&trees, &HOURS);
    let q = 1.0 - (-0.01_f64 * 2.0).exp();
    // One shutdown in 30 h of two lanes.
    let a = 1.0 - (-2.0_f64 / 60.0).exp();
    let expected = 1.0 - (1.0 - q).powi(2) * (1.0 - a).powi(2);
    assert!((tops[0].probability.point - expected).abs() < 1e-14);
    let per_hour = tops[0].per_flight_hour.unwrap();
    assert!((per_hour.point - tops[0].mean_probability.point / 2.0).abs() < 1e-18);
    // Undetected: a fault begins now or is hidden, and is missed in 5 of 20 flights.
    let present = 1.0 - (1.0 - q) * (-0.01_f64 * 100.0).exp();
    let expected = 1.0 - (1.0 - 0.25 * present).powi(2);
    assert!((tops[2].probability.point - expected).abs() < 1e-14);
    // A fault that is there since before the flight has no rate of beginning.
    assert!(tops[2].per_flight_hour.is_none() && tops[1].per_flight_hour.is_some());
}

#[test]
fn bands_hold_the_estimate_and_shrink_with_more_flights() {
    let study = study(&class("valve", "shut_down", VALVE));
    let width = |times: usize| {
        let classes = [("shut_down", 20 * times, 15 * times, 2 * times, times)];
        let flights = flights(&classes, times as u64, 30.0 * times as f64);
        let trees = lane_trees(&study, &flights, &rates(&[(VALVE, 0.01)])).unwrap();
        let top = &evaluate(&trees, &HOURS)[1];
        let band = top.probability;
        assert!(band.low < band.point && band.point < band.high, "{band:?}");
        assert!(top.mean_probability.point < band.point, "nothing is hidden in the first flight");
        band.high / band.low
    };
    assert!(width(100) < 0.3 * width(1), "{} {}", width(100), width(1));
}

#[test]
fn a_test_on_the_ground_ends_what_it_finds_and_nothing_else() {
    let study = study(&class("valve", "shut_down", VALVE));
    let flights = flights(&[("shut_down", 200, 150, 20, 1)], 1, 300.0);
    let mut flights = flights;
    // Ten faults are hidden in flight; the others have another name and are not tested.
    flights.faults.iter_mut().for_each(|row| row.event = "another fault".into());
    for hidden in &mut flights.faults[150..160] {
        hidden.event = VALVE.into();
        hidden.first = FirstAction::None;
    }
    let undetected = |found: usize, hours: ExposureHours| {
        let test = |place| RunOutcome {
            event: VALVE.into(),
            intensity: 1.0,
            onset_s: Some(0.0),
            is_finished: true,
            word: if place < found { Word::Actuator } else { Word::Healthy },
            ..RunOutcome::default()
        };
        let tests: Vec<RunOutcome> = (0..10).map(test).collect();
        let flights = match hours.test_h {
            Some(_) => flights.clone().with_tests(&tests),
            None => flights.clone(),
        };
        let trees = lane_trees(&study, &flights, &rates(&[(VALVE, 0.01)])).unwrap();
        let top = evaluate(&trees, &hours).pop().unwrap();
        assert_eq!(top.id, "undetected_degradation");
        [top.probability.point, top.mean_probability.point]
    };
    let tested = |found| undetected(found, ExposureHours { test_h: Some(10.0), ..HOURS });
    let checked = |check_h| undetected(0, ExposureHours { check_h, ..HOURS });
    // A test that finds everything is a check; one that finds nothing is none, but for faults that count twice.
    let (every, half, none) = (tested(10), tested(5), tested(0));
    for end in 0..2 {
        assert!((every[end] / checked(10.0)[end] - 1.0).abs() < 0.02, "{every:?}");
        assert!(every[end] < half[end] && half[end] < none[end]);
        assert!(
            none[end] >= checked(100.0)[end] && none[end] < 1.1 * checked(100.0)[end],
            "{none:?}"
        );
    }
}

#[test]
fn the_only_lane_of_a_machine_has_no_tree_for_both() {
    let study = Study::parse(servotwin::built_in::STUDIES[2].1, "press_axis").unwrap();
    let list: Vec<(&str, f64)> =
        rated_faults(&study).map(|fault| (fault.id.as_str(), 1e-6)).collect();
    let flights = flights(&[("stop", 64, 60, 1, 0), ("maintenance", 40, 38, 1, 0)], 0, 2.0);
    let trees = lane_trees(&study, &flights, &rates(&list)).unwrap();
    let tops = evaluate(&trees, &HOURS);
    let ids: Vec<&str> = tops.iter().map(|top| top.id.as_str()).collect();
    assert_eq!(ids, ["loss_of_one_lane", "undetected_degradation"]);
    assert!(trees.notes[0].contains("one actuator"), "{:?}", trees.notes);
    // A false alarm alone stops a machine with one lane, even if none was counted.
    assert!(
        tops[0].probability.high > 0.5 && tops[0].probability.point < 1e-3,
        "{:?}",
        tops[0].probability
    );
}

#[test]
fn the_trees_of_the_aileron_are_read_on_two_screens() {
    let study = Study::default();
    let list: Vec<(&str, f64)> =
        rated_faults(&study).map(|fault| (fault.id.as_str(), 1e-7)).collect();
    let classes: Vec<(String, usize, usize, usize, usize)> =
        study.actions().into_iter().map(|action| (action, 300, 240, 3, 0)).collect();
    let classes: Vec<_> =
        classes.iter().map(|(action, a, b, c, d)| (action.as_str(), *a, *b, *c, *d)).collect();
    let trees = lane_trees(&study, &flights(&classes, 0, 3.6), &rates(&list)).unwrap();
    for top in &trees.tree.tops {
        let figure = drawing::draw(&trees, &HOURS, top.gate);
        let id = &trees.tree.gates[top.gate].id;
        assert!(figure.height < 2000.0, "{id} is {} px tall", figure.height);
        assert!(!figure.svg.contains("P = 0<"), "{id}");
        if let Ok(folder) = std::env::var("SERVOTWIN_TREES") {
            std::fs::write(format!("{folder}/{id}.svg"), &figure.svg).unwrap();
        }
    }
}

#[test]
fn a_fault_without_a_rate_and_a_study_without_a_shutdown_are_refused() {
    let classes = class("valve", "shut_down", VALVE)
        + &class("sensor", "change_mode", "sensor_ram.bias_positive");
    let flights = flights(&[], 0, 1.0);
    let error = lane_trees(&study(&classes), &flights, &rates(&[(VALVE, 0.01)])).unwrap_err();
    let error = error.to_string();
    assert!(
        error.starts_with(
            "rates.csv: 2 faults of the tree have no rate: actuator_1.sensor_ram.bias_positive"
        ),
        "{error}"
    );
    let text = format!("{HEAD}{}", class("valve", "shut_down", VALVE));
    let without = Study::parse(&text, "tiny.toml").unwrap();
    let error = lane_trees(&without, &flights, &rates(&[(VALVE, 0.01)])).unwrap_err().to_string();
    assert!(error.contains("no action switches an actuator off"), "{error}");
}

#[test]
fn an_action_that_was_not_flown_is_missed_for_certain_or_not_at_all() {
    let study = study(&class("valve", "shut_down", VALVE));
    let trees = lane_trees(&study, &flights(&[], 0, 1.0), &rates(&[(VALVE, 0.01)])).unwrap();
    let missed = trees.constants.iter().find(|constant| constant.id == "missed-shut_down").unwrap();
    assert_eq!(missed.value, CountedValue { point: 1.0, low: 0.0, high: 1.0 });
    assert!(missed.evidence.contains("not flown"), "{}", missed.evidence);
}

#[test]
fn a_document_defines_what_it_uses_once() {
    let trees = two_lanes();
    let text = exchange::document("tiny study", &trees, &HOURS, BandEnd::High);
    assert!(text.contains("<define-fault-tree name=\"tiny-study\">"));
    for (used, defined) in [
        ("<gate name=\"", "<define-gate name=\""),
        ("<basic-event name=\"", "<define-basic-event name=\""),
        ("<parameter name=\"", "<define-parameter name=\""),
    ] {
        let names = |mark: &str| {
            let parts = text.split(mark).skip(1);
            parts.map(|rest| rest.split('"').next().unwrap().to_owned()).collect::<Vec<_>>()
        };
        let mut definitions = names(defined);
        let count = definitions.len();
        definitions.sort();
        definitions.dedup();
        assert_eq!(definitions.len(), count, "{defined} twice");
        let unknown: Vec<_> =
            names(used).into_iter().filter(|n| !definitions.contains(n)).collect();
        assert_eq!(unknown, Vec::<String>::new(), "{used}");
    }
    // Only the top events are used by nobody.
    let roots = text.matches("<define-gate").count();
    let used: std::collections::BTreeSet<&str> =
        text.split("<gate name=\"").skip(1).map(|rest| rest.split('"').next().unwrap()).collect();
    assert_eq!(roots - used.len(), 3);
}
