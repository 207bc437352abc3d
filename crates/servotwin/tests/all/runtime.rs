//! Twin and diagnosis beside an actuator: what a log says again is what the flight said.

use crate::flights::{diagnoser, fault, fly, study};
use crate::places::places;
use servotwin::live::closed_loop::{self, ClosedLoop};
use servotwin::live::observer::{DiagnosisState, Finding, Observer, Phase};
use servotwin::live::runtime::{Runtime, place_of};
use servotwin::live::watcher::Watcher;
use servotwin::parallel::Workers;
use servotwin::run::{Observer as FlightObserver, Run, Runner, plan};
use servotwin::signal::Signal;
use servotwin::signal::bus::sent;
use servotwin::study::Scenario;
use servotwin::study::suites::JUDGE;
use servotwin::study::{Reaction, Study};
use servotwin_diagnosis::diagnoser::{Alarm, Diagnoser, IndexedFinding, Scatter};
use servotwin_diagnosis::random::Random;
use servotwin_model::lanes::Level;
use servotwin_model::program::FaultAt;
use servotwin_model::signal::Piecewise;
use std::sync::Arc;
use std::sync::OnceLock;

/// All that an observer of a flight is told.
#[derive(Default)]
struct Log {
    samples: Vec<[Vec<f64>; 3]>,
}

impl FlightObserver for Log {
    fn sample(&mut self, _index: usize, measured: &[f64], twin: &[f64], inputs: &[f64]) {
        self.samples.push([measured.to_vec(), twin.to_vec(), inputs.to_vec()]);
    }
}

#[test]
fn a_runtime_beside_a_log_has_the_twin_of_records_bit_for_bit() {
    let suite = study().suite(JUDGE).unwrap();
    let all = 0..suite.environments;
    let mut runs = plan::runs(study(), suite, &all);
    let last = runs.len() - 1;
    runs.retain(|run| [0, 5, last].contains(&run.number));
    let (plants, workers) = ((Scenario::Realistic, None), Workers::new(2));
    let flown = Runner::new(study(), suite, plants, runs, workers).unwrap();
    let mut logs: Vec<(Run, Log)> = vec![];
    flown.fly(
        |_| Log::default(),
        |flight, log, outcome| {
            outcome.unwrap();
            logs.push((*flight, log));
        },
    );
    assert_eq!(logs.len(), 3);
    logs.sort_by_key(|(run, _)| run.number);
    for (number, (flight, log)) in logs.into_iter().enumerate() {
        // The twin is told the environment's parameters; here there are none.
        let mut runtime = Runtime::new(study(), diagnoser().clone(), vec![]).unwrap().at_rest();
        for (k, [measured, twin, inputs]) in log.samples.iter().enumerate() {
            if (number, k) == (2, 100) {
                // From here on the step is compiled.
                let system = &study().system;
                assert!(system.compiled.steps(&system.program, Level::Single).is_some());
            }
            runtime.push(inputs, measured).unwrap();
            assert_eq!(runtime.expected(), twin, "flight {}, sample {k}", flight.number);
        }
        assert!(log.samples.len() > 200);
        assert!(runtime.is_compiled() || number < 2, "a C compiler");
    }
}

/// Replays a flight through a watcher that comes from a checkpoint after each of some samples.
fn replay(checkpoints: &[usize]) -> Vec<(Finding, Vec<f64>)> {
    let record = fly(vec![(2.0, fault("actuator_1.servo_valve.bias_positive"))]);
    let mut watcher = Watcher::new(study(), diagnoser().clone()).unwrap();
    let sensors = study().system.sensors.len();
    let mut said = vec![];
    for k in 0..record.time_s.len() {
        let inputs: Vec<f64> = record.inputs.iter().map(|column| column[k]).collect();
        let mut measured = vec![f64::NAN; sensors];
        for (column, &sensor) in record.measured.iter().zip(&study().measured) {
            measured[sensor] = column[k];
        }
        let observation = watcher.push(record.time_s[k], &inputs, &measured);
        let twin: Vec<f64> = study().measured.iter().map(|&s| observation.twin[s]).collect();
        let expected: Vec<f64> = record.twin.iter().map(|column| column[k]).collect();
        assert_eq!(twin[..expected.len()], expected, "sample {k}");
        said.push((observation.finding.clone(), twin));
        if checkpoints.contains(&k) {
            let saved = watcher.save();
            watcher = Watcher::new(study(), diagnoser().clone()).unwrap();
            watcher.restore(&saved).unwrap();
        }
    }
    said
}

#[test]
fn a_log_is_watched_as_the_flight_was_flown_also_after_a_checkpoint() {
    let said = replay(&[]);
    assert!(said == replay(&[0, 55, 127, 250]), "a checkpoint changes nothing");
    let raised = said.iter().position(|(finding, _)| finding.phase == Phase::Raised).unwrap();
    let (finding, _) = &said[raised];
    assert_eq!((finding.actuator_number, finding.action.as_str()), (Some(1), "shut_down"));
    // The log says that the actuator is off from then on: nothing more is said of it.
    assert_eq!(said.last().unwrap().0.state, DiagnosisState::Healthy);
}

/// Whether a healthy log is wider than a scatter whose widest flight had this median excess.
fn is_wider(median_excess: f64, checkpoint: usize) -> Option<String> {
    let record = fly(vec![]);
    let own = diagnoser();
    let scatter = Scatter { median_excess, ..own.scatter.clone().unwrap() };
    let diagnoser = Arc::new(Diagnoser { scatter: Some(scatter), ..(**own).clone() });
    let mut watcher = Watcher::new(study(), diagnoser.clone()).unwrap();
    for k in 0..record.time_s.len() {
        let inputs: Vec<f64> = record.inputs.iter().map(|column| column[k]).collect();
        let mut measured = vec![f64::NAN; study().system.sensors.len()];
        for (column, &sensor) in record.measured.iter().zip(&study().measured) {
            measured[sensor] = column[k];
        }
        watcher.push(record.time_s[k], &inputs, &measured);
        if k == checkpoint {
            let saved = watcher.save();
            watcher = Watcher::new(study(), diagnoser.clone()).unwrap();
            watcher.restore(&saved).unwrap();
        }
    }
    watcher.wider_than_trained()
}

#[test]
fn a_log_with_more_scatter_than_was_trained_for_is_told() {
    let scatter = diagnoser().scatter.as_ref().unwrap();
    assert_eq!((scatter.scenario.as_str(), scatter.flights), ("noise", 6));
    // A specimen that is its twin leaves hardly any band, so half of its windows are below the widest flight of training.
    assert!((0.05..1.5).contains(&scatter.median_excess), "{}", scatter.median_excess);
    assert_eq!(is_wider(scatter.median_excess, 0), None);
    let told = is_wider(0.0, 0).unwrap();
    assert!(told.contains("residuals of 1") && !told.contains("  "), "{told}");
    assert!(told.contains("6 training flights: the scatter of the scenario noise"), "{told}");
    // A checkpoint in between loses no window.
    assert_eq!(is_wider(0.0, 123), Some(told));
}

#[test]
fn values_that_are_missing_or_absurd_say_so_and_raise_nothing() {
    let mut watcher = Watcher::new(study(), diagnoser().clone()).unwrap();
    let defaults: Vec<f64> =
        study().system.network().inputs.iter().map(|input| input.default).collect();
    let sensors = study().system.sensors.len();
    let zero = vec![0.0; sensors];
    for (k, odd) in
        [f64::NAN, f64::INFINITY, 1e300, -1e300].into_iter().cycle().take(400).enumerate()
    {
        let mut inputs = defaults.clone();
        inputs[k % defaults.len()] = odd;
        let measured = if k % 3 == 0 { vec![odd; sensors] } else { zero.clone() };
        let observation = watcher.push(k as f64 * 0.02, &inputs, &measured);
        assert!(observation.finding.action.is_empty(), "{:?}", observation.finding);
        assert!(observation.twin.iter().all(|value| value.is_finite()));
    }
}

/// The samples of a flight in which nothing is switched but by `mode_1`, for a watcher: inputs and sensors.
fn samples(faults: Vec<(f64, FaultAt)>, mode_1: impl Fn(f64) -> f64) -> Vec<(Vec<f64>, Vec<f64>)> {
    let (study, duration_s) = (study(), 8.0);
    let network = study.system.network();
    let signal: Signal = "noise:rms=3deg,bandwidth=0.8Hz,seed=9".parse().unwrap();
    let command = signal.build(network.inputs[study.command_input].unit, duration_s).unwrap();
    let constant = |value: f64| Piecewise::constant(value).unwrap();
    let mut inputs: Vec<Piecewise> = network.inputs.iter().map(|i| constant(i.default)).collect();
    inputs[study.command_input] =
        sent(|time_s| command.value(time_s), study.sample_period_s, duration_s).unwrap();
    let mut flight =
        ClosedLoop { study, inputs, faults, duration_s, specimen: None, reacts: false };
    let times_s = (0..400).map(|k| f64::from(k) * study.sample_period_s);
    let (times_s, modes): (Vec<f64>, Vec<f64>) = times_s.map(|t| (t, mode_1(t))).unzip();
    let mode = input("actuator_1.mode");
    flight.inputs[mode] = Piecewise::hermite(&times_s, &modes, &vec![0.0; times_s.len()]).unwrap();
    let record = closed_loop::fly(&flight, diagnoser(), &[]).unwrap();
    let sample = |k: usize| {
        let mut inputs: Vec<f64> = record.inputs.iter().map(|column| column[k]).collect();
        inputs[mode] = modes[k.min(modes.len() - 1)];
        let mut measured = vec![f64::NAN; study.system.sensors.len()];
        for (column, &sensor) in record.measured.iter().zip(&study.measured) {
            measured[sensor] = column[k];
        }
        (inputs, measured)
    };
    (0..record.time_s.len()).map(sample).collect()
}

fn input(id: &str) -> usize {
    study().system.network().inputs.iter().position(|input| input.id == id).unwrap()
}

/// The study with a reaction that changes parameters, as a flight control computer may do it.
fn with_parameters() -> &'static Study {
    static MADE: OnceLock<Study> = OnceLock::new();
    let changed = r#"actuator_inputs = { mode = 0 }, actuator_parameters = { "controller.gain_per_m" = 100 }, takes_out = ["x_v_1", "x_v_2"]"#;
    let text = study().text.replace("actuator_inputs = { mode = 0 }", changed);
    MADE.get_or_init(|| Study::parse(&text, "tiny.toml").unwrap())
}

/// The study has fewer sensors than its system, so a sensor has other places in the two lists.
#[test]
fn a_reaction_takes_the_sensors_out_that_it_names() {
    for (actuator, name) in [(0, "x_v_1"), (1, "x_v_2")] {
        let reaction = with_parameters().reactions.of(actuator, "shut_down", None);
        let place = |&sensor: &usize| place_of(sensor, study(), diagnoser()).unwrap();
        let out = reaction.takes_out.iter().map(place).map(|at| &diagnoser().sensors[at].name);
        assert_eq!(out.collect::<Vec<_>>(), [name]);
    }
}

/// The healthy actuator was raised for shutdown, because the parameters of the reaction stayed.
#[test]
fn a_healthy_actuator_that_was_off_is_judged_by_its_own_parameters_again() {
    let mode = |time_s: f64| if (2.0..3.0).contains(&time_s) { 0.0 } else { 1.0 };
    let mut watcher = Watcher::new(with_parameters(), diagnoser().clone()).unwrap();
    let odd = [f64::NAN, 7.0, f64::INFINITY];
    for (k, (mut inputs, measured)) in samples(vec![], mode).into_iter().enumerate() {
        // Neither a missing nor an impossible mode switches anything.
        if matches!(k, 50..55 | 120..125 | 200..205) {
            inputs[input("actuator_1.mode")] = odd[k % 3];
        }
        let finding = watcher.push(k as f64 * 0.02, &inputs, &measured).finding.clone();
        let session = watcher.runtime().session();
        assert_eq!(session.is_off(0), (100..150).contains(&k), "sample {k}");
        assert!(finding.action.is_empty() && finding.stands.is_empty(), "{k}: {finding:?}");
        if k == 130 {
            let saved = watcher.save();
            watcher = Watcher::new(with_parameters(), diagnoser().clone()).unwrap();
            watcher.restore(&saved).unwrap();
        }
    }
    let finding = watcher.observation().finding;
    assert_eq!((finding.state, finding.phase), (DiagnosisState::Healthy, Phase::None));
    assert!(watcher.observation().residuals.iter().all(|r| r.is_nan() || r.abs() < 0.05));
}

#[test]
fn a_unit_that_was_told_to_be_off_stays_off_whatever_the_inputs_show() {
    let mut watcher = Watcher::new(with_parameters(), diagnoser().clone()).unwrap();
    let reaction = with_parameters().reactions.of(0, "shut_down", None).clone();
    for (k, (inputs, measured)) in samples(vec![], |_| 1.0).into_iter().enumerate().take(100) {
        if k == 50 {
            watcher.runtime_mut().follow(0, &reaction).unwrap();
        }
        if k == 70 {
            let (told, saved) = (watcher.runtime().save().reactions, watcher.save());
            watcher = Watcher::new(with_parameters(), diagnoser().clone()).unwrap();
            watcher.restore(&saved).unwrap();
            assert_eq!(watcher.runtime().save().reactions, told);
        }
        watcher.push(k as f64 * 0.02, &inputs, &measured);
        assert_eq!(watcher.runtime().session().is_off(0), k >= 50, "sample {k}");
    }
}

#[test]
fn nothing_is_judged_while_the_twin_settles_beside_a_log_that_may_begin_in_motion() {
    let mut watcher = Watcher::new(study(), diagnoser().clone()).unwrap();
    let settling = (diagnoser().tuning.settle_s / diagnoser().period_s).round() as usize;
    for (k, (inputs, measured)) in samples(vec![], |_| 1.0).into_iter().enumerate() {
        let state = watcher.push(k as f64 * 0.02, &inputs, &measured).finding.state;
        assert!(k >= settling || state == DiagnosisState::NoData, "sample {k}: {state:?}");
    }
    assert_eq!(watcher.observation().finding.state, DiagnosisState::Healthy);
}

/// Gaps, invalid inputs, restarts, stored states and switches in any order: what was raised stands until it is reset, and
/// the healthy actuator is never raised.
#[test]
fn an_alarm_stands_whatever_happens_to_the_log() {
    let bias = fault("actuator_1.servo_valve.bias_positive");
    let log = samples(vec![(1.0, bias)], |_| 1.0);
    for seed in 0..6 {
        let mut random = Random::new(seed);
        let mut watcher = Watcher::new(with_parameters(), diagnoser().clone()).unwrap();
        let (mut is_raised, mut event, mut lasts) = (false, 99, 150);
        for (k, (inputs, measured)) in log.iter().enumerate() {
            let (mut inputs, mut measured) = (inputs.clone(), measured.clone());
            if lasts == 0 {
                (event, lasts) = (random.index(8), 5 + random.index(50));
                match event {
                    0 => watcher.restart(),
                    1 => {
                        let saved = watcher.save();
                        watcher = Watcher::new(with_parameters(), diagnoser().clone()).unwrap();
                        watcher.restore(&saved).unwrap();
                    }
                    _ => {}
                }
            }
            lasts -= 1;
            match event {
                2 => inputs.fill(f64::NAN),
                3 => measured.fill(f64::NAN),
                4 => inputs[random.index(11)] = f64::INFINITY,
                5 if is_raised => inputs[input("actuator_1.mode")] = 0.0,
                _ => {}
            }
            let finding = watcher.push(k as f64 * 0.02, &inputs, &measured).finding.clone();
            assert!(!is_raised || finding.phase == Phase::Raised, "{seed}, {k}: {finding:?}");
            assert!(finding.actuator_number != Some(2) || finding.action.is_empty(), "{finding:?}");
            is_raised = finding.phase == Phase::Raised;
            let of_1 = |stands: &String| stands.starts_with("actuator 1, shut down");
            assert!(
                finding.stands.iter().all(of_1) && finding.stands.len() == usize::from(is_raised)
            );
            assert!(!is_raised || finding.words().contains("actuator 1, shut down"), "{finding}");
        }
        assert!(is_raised, "seed {seed}");
        watcher.reset_alarm();
        let (inputs, _) = &log[0];
        let missing = vec![f64::NAN; log[0].1.len()];
        let finding = watcher.push(8.0, inputs, &missing).finding;
        assert_eq!((finding.phase, finding.stands.len()), (Phase::None, 0));
    }
}

#[test]
fn a_twin_that_fails_leaves_no_old_outcome_and_settles_again() {
    let log = samples(vec![], |_| 1.0);
    let mut runtime = Runtime::new(study(), diagnoser().clone(), vec![]).unwrap();
    let all = study().system.program.parameters_with(&[], &[]);
    let places = |(part, own): (usize, &Vec<f64>)| {
        (0..own.len()).map(move |place| (part, place, f64::NAN)).collect::<Vec<_>>()
    };
    let parameters = all.iter().enumerate().flat_map(places).collect();
    let broken = Reaction { parameters, ..Reaction::default() };
    let read: Vec<usize> = study().measured[..diagnoser().sensors.len()].to_vec();
    for (k, (inputs, measured)) in log.iter().enumerate() {
        let measured: Vec<f64> = read.iter().map(|&sensor| measured[sensor]).collect();
        if k == 199 {
            // From the next sample on.
            runtime.follow(0, &broken).unwrap();
        }
        let pushed = runtime.push(inputs, &measured).copied();
        assert_eq!(pushed.is_err(), k == 200);
        let outcome = *runtime.session().outcome();
        assert_eq!((outcome.sample, outcome.raised), (k as u64, None));
        let is_judged = !matches!(outcome.finding, IndexedFinding::Unjudged);
        assert!(!(200..=250).contains(&k) || !is_judged, "{k}: {outcome:?}");
        if k == 200 {
            assert!(outcome.alarm == Alarm::Error && outcome.counts.errors > 0, "{outcome:?}");
            runtime.release(0).unwrap();
        }
    }
    assert_eq!(runtime.session().outcome().finding, IndexedFinding::Healthy);
}

#[test]
fn a_stored_state_with_absurd_numbers_is_refused_or_goes_on() {
    use serde_json::json;
    let record = fly(vec![(1.0, fault("actuator_1.servo_valve.bias_positive"))]);
    let sensors = study().system.sensors.len();
    let push = |watcher: &mut Watcher, k: usize| {
        let inputs: Vec<f64> = record.inputs.iter().map(|column| column[k]).collect();
        let mut measured = vec![f64::NAN; sensors];
        for (column, &sensor) in record.measured.iter().zip(&study().measured) {
            measured[sensor] = column[k];
        }
        watcher.push(record.time_s[k], &inputs, &measured);
    };
    let mut watcher = Watcher::new(study(), diagnoser().clone()).unwrap();
    let stop = record.time_s.len() - 30;
    (0..stop).for_each(|k| push(&mut watcher, k));
    let saved: serde_json::Value = serde_json::from_str(&watcher.save()).unwrap();
    let found = places(&saved);
    let absurd = [
        json!(0),
        json!(-1.0),
        json!(1_u64 << 53),
        json!(u64::MAX),
        json!(1e300),
        json!(1e-300),
        json!(null),
        json!([]),
    ];
    let (mut tried, mut refused) = (0, 0);
    for place in &found {
        for value in &absurd {
            let mut changed = saved.clone();
            *changed.pointer_mut(place).unwrap() = value.clone();
            let restored = watcher.restore(&changed.to_string());
            if restored.is_ok() {
                (stop..stop + 12).for_each(|k| push(&mut watcher, k));
            }
            tried += 1;
            refused += usize::from(restored.is_err());
        }
    }
    assert!(tried > 1000 && refused > tried / 2, "{refused} of {tried}");
    for (place, value) in [
        ("/runtime/twin/wanted_s", json!(0)),
        ("/runtime/twin/wanted_s", json!(1e-300)),
        ("/runtime/twin/sample", json!(u64::MAX)),
        ("/runtime/twin/states/0", json!(null)),
        ("/runtime/session/samples", json!(u64::MAX)),
        ("/runtime/session/guard/settling", json!(1_u64 << 40)),
        ("/runtime/session/outcome/length", json!(99)),
        ("/runtime/session/outcome/finding", json!({ "actuator": { "actuator": 99 } })),
        ("/runtime/session/windows/absolute/spans/0/ended", json!(u64::MAX)),
        ("/runtime/session/windows/absolute/spans/0/open/0", json!(-3)),
        ("/runtime/reactions", json!([])),
        ("/runtime/reactions/0/0", json!(1)),
        ("/runtime/reactions/0/0", json!(99)),
        ("/runtime/reactions/0/1/takes_out", json!([99])),
        ("/is_seen_off", json!([])),
        ("/runtime/buses/0/1", json!(null)),
    ] {
        let mut changed = saved.clone();
        *changed.pointer_mut(place).unwrap_or_else(|| panic!("{place}")) = value;
        let before = watcher.save();
        assert!(watcher.restore(&changed.to_string()).is_err(), "{place}");
        assert!(watcher.save() == before, "{place}: a refused state changes nothing");
    }
    watcher.restore(&saved.to_string()).unwrap();
}
