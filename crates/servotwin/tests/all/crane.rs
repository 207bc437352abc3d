//! A load held by a relief valve: its rest is hard to find, because the rod side fills from near vacuum.

use servotwin::ensemble::{Ensemble, Variant};
use servotwin::signal::Signal;
use servotwin::system::System;
use servotwin::template::{Like, Template};

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
        let (states, work) = Ensemble::new(program).settle(&variant).unwrap();
        assert_eq!((work.unsettled, work.limit_cycles), (0, 0), "null_bias {null_bias}");
        // The valve's zero moves the ram and nothing else.
        let near = |id: &str, expected: f64, tolerance: f64| {
            let value = states[state(id)];
            assert!((value - expected).abs() < tolerance, "{id}: {value}, null_bias {null_bias}");
        };
        near("cylinder.pressure_a_pa", 145.56 * BAR, 0.05 * BAR);
        near("cylinder.pressure_b_pa", 66.17 * BAR, 0.05 * BAR);
        near("cylinder.velocity_m_s", 0.0, 1e-9);
        near("cylinder.position_m", -12.334e-3 + 0.125 * null_bias, 5e-6);
    }
}

#[test]
fn a_loop_that_swings_for_ever_is_measured_to_do_so() {
    // A sampled controller that acts twenty times a second, with sixteen times the gain that such a loop bears.
    let text = Template::new("sampled", Like::ServoActuator).unwrap().system();
    let sampled = "kind = \"sampled_position_controller\"\nperiod_s = 0.05";
    let text = text.replace("kind = \"position_controller\"", sampled);
    let system = System::parse(&text, "sampled.toml").unwrap_or_else(|e| panic!("{e}"));
    let curves = system.default_inputs();
    let (component, parameter) = system.parameter("controller.gain_per_m").unwrap();
    let searched = |gain| {
        let variant = Variant {
            overrides: vec![(component, parameter, gain), rigged(&system)],
            inputs: curves.iter().collect(),
            ..Variant::default()
        };
        let (_, work) = Ensemble::new(&system.program).settle(&variant).unwrap();
        (work.unsettled, work.limit_cycles)
    };
    assert_eq!(searched(250.0), (0, 0));
    assert_eq!(searched(4000.0), (1, 1));
}

/// The loop holds 2.6 mm, away from the center.
fn rigged(system: &System) -> (usize, usize, f64) {
    let (component, parameter) = system.parameter("controller.rig_offset_m").unwrap();
    (component, parameter, 2.6e-3)
}
