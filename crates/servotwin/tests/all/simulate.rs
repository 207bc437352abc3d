//! Simulations by names: inputs within their ranges, what begins at time zero, and what leaves the model.

use servotwin::built_in;
use servotwin::simulate::{InputSignal, Simulation, SimulationError, VariantSpec};
use servotwin::system::System;
use servotwin::validity::CrossedLimit;
use std::sync::atomic::AtomicBool;

#[test]
fn every_kind_of_input_is_held_to_the_range_of_its_input() {
    let system = System::default();
    let inputs = &system.network().inputs;
    let of_supply = inputs.iter().position(|input| input.id.contains("supply_pressure")).unwrap();
    let (id, (_, most)) = (inputs[of_supply].id.clone(), system.network().input_range(of_supply));
    let refused = |signal: InputSignal| {
        let run = Simulation::new(&system).input(&id, signal).duration_s(0.1).run();
        run.err().map(|error| error.to_string()).unwrap_or_default()
    };
    assert!(most.is_finite());
    let mut samples = vec![2e7; 11];
    assert_eq!(refused(samples.clone().into()), "");
    samples[5] = 2.0 * most;
    for signal in [InputSignal::from(2.0 * most), samples.into(), (-1.0).into()] {
        let error = refused(signal);
        assert!(error.starts_with(&id) && error.contains("bar"), "{error}");
    }
}

#[test]
fn a_step_and_a_fault_at_time_zero_begin_at_the_rest_before_them() {
    let system = System::read("spring_actuator").unwrap();
    let base = || Simulation::new(&system).duration_s(0.5).record(["cylinder.position_m"]);
    let position = |simulation: Simulation| simulation.run().unwrap().runs[0].values[0].clone();
    let late = position(base().input("command", "step:size=5deg,at=0.01s"));
    for at in ["0s", "1ns", "1us"] {
        let early = position(base().input("command", format!("step:size=5deg,at={at}")));
        assert!(early[0].abs() < 1e-6, "{at}: {}", early[0]);
        for (early, late) in early.iter().zip(&late[1..]) {
            assert!((early - late).abs() < 1e-5, "{at}: {early} {late}");
        }
    }
    let fault = system.all_faults().into_iter().find(|id| id.contains("bias_positive")).unwrap();
    let begins = position(base().fault_from(&fault, 1.0, 0.0));
    let has = position(base().fault(&fault, 1.0));
    assert!(begins[0].abs() < 1e-6 && has[0].abs() > 1e-4, "{} {}", begins[0], has[0]);
    assert!((begins[50] - has[50]).abs() < 1e-5);
}

#[test]
fn a_piston_behind_a_soft_end_stop_is_reported() {
    let system = System::read("press_axis").unwrap();
    let pushed = |stiffness_n_m: f64| {
        let base = Simulation::new(&system).duration_s(0.05);
        let stop = base.parameter("cylinder.stop_stiffness_n_m", stiffness_n_m);
        let mut run = stop.parameter("valve.null_bias", 2.0).run().unwrap().runs.remove(0);
        run.outside_validity.retain(|finding| finding.limit == CrossedLimit::Travel);
        run.outside_validity
    };
    assert_eq!(pushed(2e8), []);
    let found = pushed(1e5);
    assert_eq!(found.len(), 1);
    assert!(found[0].extreme > 0.2, "{:?}", found[0]);
    assert!(found[0].to_string().starts_with("cylinder.position_m is outside of the cylinder"));
}

const LEAK: &str = "actuator_1.leakage_a.leakage";

fn spring() -> System {
    System::read("spring_actuator").unwrap()
}

#[test]
fn a_sweep_gives_the_rows_of_its_single_runs() {
    let system = System::default();
    let base = Simulation::new(&system).input("command", "2deg").duration_s(0.1).record(["p_a_1"]);
    let swept = base.run_sweep(LEAK, &[0.0, 0.5]).unwrap();
    for (run, &intensity) in [0.0, 0.5].iter().enumerate() {
        let single = base.clone().fault(LEAK, intensity).run().unwrap();
        assert_eq!(single.runs[0].values, swept.runs[run].values);
    }
    let table = swept.table().unwrap();
    let names: Vec<&str> = table.names().collect();
    assert_eq!(names, [LEAK, "time_s", "p_a_1_pa"]);
    assert_eq!(table.row_count(), 22);
}

#[test]
fn variants_of_any_thread_count_are_the_same_bits() {
    let system = spring();
    let base = Simulation::new(&system).duration_s(0.2);
    let variant = |size: f64| VariantSpec {
        inputs: vec![("command".into(), size.into())],
        ..VariantSpec::default()
    };
    let variants: Vec<VariantSpec> = (0..5).map(|k| variant(0.01 * f64::from(k))).collect();
    let [one, two] = [1, 2].map(|threads| {
        let prepared = base.clone().threads(threads).prepare_variants(&variants).unwrap();
        prepared.run(&|_| {}, None).unwrap().runs
    });
    assert_eq!(one, two);
}

#[test]
fn a_driven_input_is_recorded_with_the_sensors() {
    let system = System::default();
    let results = Simulation::new(&system).input("command", 0.01).duration_s(0.02).run().unwrap();
    assert_eq!(results.recorded[0].name, "command_rad");
    assert_eq!(results.recorded.len(), 1 + system.sensors.len());
    assert!(results.runs[0].starts_at_steady_state());
}

#[test]
fn every_slip_is_an_error_that_names_it() {
    let system = System::default();
    let simulation = || Simulation::new(&system).duration_s(0.02);
    let cases = [
        (simulation().fault("actuator_1.leakage_a.leakag", 0.5), LEAK),
        (simulation().fault(LEAK, 1.5), "is out of range: allowed are 0 … 1"),
        (simulation().fault(LEAK, f64::NAN), "is out of range"),
        (simulation().fault(LEAK, 0.5).fault(LEAK, 0.5), "is given twice"),
        (simulation().input("comand", "1deg"), "did you mean 'command'?"),
        (simulation().input("command", "stp:size=1"), "unknown kind of signal 'stp'"),
        (simulation().input("command", f64::NAN), "command: "),
        (simulation().input("command", vec![]), "there is no point in it"),
        (simulation().input("command", 0.1).input("command", 0.2), "is given twice"),
        (simulation().parameter("actuator_1.cylinder.area_a_m2", -1.0), "is out of range"),
        (simulation().record(["p_a_11"]), "p_a_1"),
        (simulation().duration_s(-1.0), "duration_s = -1 s is out of range"),
        (simulation().sample_period_s(0.0), "sample_period_s = 0 s is out of range"),
        (simulation().sample_period_s(1e-6).duration_s(1e6), "200 million values"),
    ];
    for (simulation, expected) in cases {
        let message = simulation.run().map(drop).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn a_temperature_that_makes_the_liquid_too_soft_is_refused_with_the_reason() {
    let own = "kind = \"own\"\nbulk_modulus_pa = 6e8\nbulk_modulus_change = -1.6e7";
    let text = built_in::SYSTEMS[0].1.replace("kind = \"phosphate_ester\"", own);
    let system = System::parse(&text, "soft.toml").unwrap();
    let name = "actuator_1.supply.temperature_k";
    let refused = Simulation::new(&system).parameter(name, 345.65).run();
    let message = refused.map(drop).unwrap_err().to_string();
    assert!(message.ends_with("the bulk modulus of its liquid would be 8e7 Pa"), "{message}");
}

#[test]
fn every_built_in_system_runs_by_its_names() {
    for (name, _) in built_in::SYSTEMS {
        let system = System::read(name).unwrap();
        let results = Simulation::new(&system).duration_s(0.05).run();
        let results = results.unwrap_or_else(|error| panic!("{name}: {error}"));
        let values = results.runs[0].values.iter().flatten();
        assert!(
            values.clone().count() > 0 && values.clone().all(|value| value.is_finite()),
            "{name}"
        );
    }
}

#[test]
fn a_canceled_simulation_has_no_results() {
    let system = spring();
    let prepared = Simulation::new(&system).duration_s(100.0).prepare(None).unwrap();
    let canceled = prepared.run(&|_| {}, Some(&AtomicBool::new(true)));
    assert!(matches!(canceled, Err(SimulationError::Canceled)));
}
