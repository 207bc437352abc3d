use super::*;
use crate::built_in;

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
