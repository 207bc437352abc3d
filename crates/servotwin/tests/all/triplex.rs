//! Three actuators on one surface: the mid-value voter and the equaliser of three.

use servotwin::ensemble::{Ensemble, Variant};
use servotwin::system::System;

fn triplex() -> System {
    System::parse(include_str!("../triplex.toml"), "triplex.toml").unwrap_or_else(|e| panic!("{e}"))
}

/// States at rest with some parameters and faults at full intensity, by name.
fn at_rest(system: &System, set: &[(&str, f64)], faults: &[&str]) -> impl Fn(&str) -> f64 {
    let program = &system.program;
    let curves = system.default_inputs();
    let value = |&(id, value): &(&str, f64)| {
        let (component, parameter) = system.parameter(id).unwrap_or_else(|| panic!("{id}"));
        (component, parameter, value)
    };
    let fault = |id: &&str| {
        let (component, fault) = program.find_fault(id).unwrap_or_else(|| panic!("{id}"));
        servotwin_model::program::FaultAt { component, fault, intensity: 1.0 }
    };
    let variant = Variant {
        overrides: set.iter().map(value).collect(),
        faults: faults.iter().map(fault).collect(),
        inputs: curves.iter().collect(),
        ..Variant::default()
    };
    let (states, work) = Ensemble::new(program).settle(&variant).unwrap();
    assert_eq!(work.unsettled, 0);
    let names: Vec<String> = program.states().iter().map(|state| state.name.clone()).collect();
    move |id| states[names.iter().position(|name| name == id).unwrap_or_else(|| panic!("{id}"))]
}

/// The pressure difference with which an actuator pushes.
fn differential_pa(rest: &impl Fn(&str) -> f64, actuator: usize) -> f64 {
    let chamber = |side: &str| rest(&format!("actuator_{actuator}.cylinder.pressure_{side}_pa"));
    chamber("a") - chamber("b")
}

#[test]
fn three_equal_actuators_share_the_load() {
    let system = triplex();
    let rest = at_rest(&system, &[], &[]);
    let [first, second, third] = [1, 2, 3].map(|n| differential_pa(&rest, n));
    assert!(first.abs() > 1e5, "{first}");
    assert!((first - second).abs() < 10.0 && (first - third).abs() < 10.0);
}

#[test]
fn the_equaliser_of_three_takes_most_of_a_fight_out() {
    let system = triplex();
    let fight = |set: &[(&str, f64)]| {
        let rest = at_rest(&system, set, &["actuator_1.servo_valve.bias_positive"]);
        differential_pa(&rest, 1) - 0.5 * (differential_pa(&rest, 2) + differential_pa(&rest, 3))
    };
    let without = fight(&[("equaliser.gain_m_pa", 0.0)]);
    let with = fight(&[]);
    assert!(without.abs() > 5e5, "{without}");
    assert!(with.abs() < 0.7 * without.abs() && with * without > 0.0, "{with} of {without}");
}

#[test]
fn the_median_of_three_stroke_sensors_outvotes_a_wrong_one() {
    let system = triplex();
    let votes: Vec<(String, f64)> =
        (1..=3).map(|n| (format!("actuator_{n}.position_selector.select"), 1.0)).collect();
    let votes: Vec<(&str, f64)> = votes.iter().map(|(id, value)| (id.as_str(), *value)).collect();
    let angle =
        |set: &[(&str, f64)], faults: &[&str]| at_rest(&system, set, faults)("aileron.angle_rad");
    let wrong = ["actuator_2.sensor_ram.bias_positive"];
    let error = |set: &[(&str, f64)]| (angle(set, &wrong) - angle(set, &[])).abs();
    let (own, voted) = (error(&[]), error(&votes));
    assert!(own > 1e-3, "{own}");
    assert!(voted < 0.02 * own, "{voted} of {own}");
}
