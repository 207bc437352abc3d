//! A load held by a relief valve: its rest is hard to find, because the rod side fills from near vacuum.

use servotwin::ensemble::{Ensemble, Variant};
use servotwin::signal::Signal;
use servotwin::system::System;

const BAR: f64 = 1e5;

fn crane() -> System {
    System::parse(include_str!("../crane/crane.toml"), "crane.toml")
        .unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn a_load_held_by_a_relief_valve_comes_to_rest() {
    let system = crane();
    let program = &system.program;
    let load: Signal = "constant:value=-27429".parse().unwrap();
    let inputs = &system.network().inputs;
    let place = inputs.iter().position(|input| input.id == "hook_load").unwrap();
    let mut curves = system.default_inputs();
    curves[place] = system.driven(place, &load, 1.0).unwrap();
    let (component, parameter) = system.parameter("valve.null_bias").unwrap();
    let state = |id: &str| program.states().iter().position(|state| state.name == id).unwrap();
    for null_bias in [0.0, -0.01, 0.01] {
        let variant = Variant {
            overrides: vec![(component, parameter, null_bias)],
            inputs: curves.iter().collect(),
            ..Variant::default()
        };
        let (states, work) = Ensemble::new(program).settle_counted(&variant).unwrap();
        assert_eq!((work.unsettled, work.limit_cycles), (0, 0), "null_bias {null_bias}");
        // The valve's zero moves the ram and nothing else.
        let near = |id: &str, expected: f64, tolerance: f64| {
            let value = states[state(id)];
            assert!((value - expected).abs() < tolerance, "{id}: {value}, null_bias {null_bias}");
        };
        near("cylinder.pressure_a_pa", 145.56 * BAR, 0.05 * BAR);
        near("cylinder.pressure_b_pa", 66.17 * BAR, 0.05 * BAR);
        near("cylinder.velocity_m_s", 0.0, 1e-9);
        near("cylinder.position_m", -12.328e-3 + 0.125 * null_bias, 5e-6);
    }
}

#[test]
fn a_loop_that_swings_for_ever_is_measured_to_do_so() {
    let system = System::default();
    let program = &system.program;
    let (component, fault) = program.find_fault("actuator_1.sensor_ram.lag").unwrap();
    let mut curves = system.default_inputs();
    let place = system.network().inputs.iter().position(|input| input.id == "command").unwrap();
    let held: Signal = "5deg".parse().unwrap();
    curves[place] = system.driven(place, &held, 1.0).unwrap();
    let at = |intensity| Variant {
        faults: vec![servotwin_model::program::FaultAt { component, fault, intensity }],
        inputs: curves.iter().collect(),
        ..Variant::default()
    };
    let ensemble = Ensemble::new(program);
    let (_, healthy) = ensemble.settle_counted(&at(0.0)).unwrap();
    assert_eq!((healthy.unsettled, healthy.limit_cycles), (0, 0));
    let (_, swinging) = ensemble.settle_counted(&at(1.0)).unwrap();
    assert_eq!((swinging.unsettled, swinging.limit_cycles), (1, 1));
}
