//! A valid system that is hardly meant draws a warning; those of the toolkit draw none.

use servotwin::built_in::SYSTEMS;
use servotwin::plausibility::warnings;
use servotwin::system::System;

const PRESS: &str = include_str!("../../../../systems/press_axis.toml");

/// The warnings about the press axis with parts of its text replaced.
fn of_press(changes: &[(&str, &str)]) -> Vec<String> {
    let mut text = PRESS.to_owned();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    warnings(&System::parse(&text, "press.toml").unwrap_or_else(|e| panic!("{e}")))
}

#[track_caller]
fn assert_one_with(found: &[String], words: &str) {
    assert!(found.iter().any(|warning| warning.contains(words)), "{words}: {found:?}");
}

#[test]
fn the_systems_of_the_toolkit_draw_no_warning() {
    for (name, _) in SYSTEMS {
        let found = warnings(&System::read(name).unwrap());
        assert!(found.is_empty(), "{name}: {found:?}");
    }
}

const FIXED_PUMP: (&str, &str) = (
    "kind = \"variable_pump\"\nflow_m3_s = 1.0e-3                # 60 L/min\nset_pa = 21e6\nrange_pa = 1e6",
    "kind = \"flow_source\"\nflow_m3_s = 1.0e-3",
);

#[test]
fn a_fixed_pump_needs_a_relief_valve_that_its_flow_reaches() {
    let relieved = of_press(&[FIXED_PUMP]);
    assert!(!relieved.iter().any(|warning| warning.contains("relief")), "{relieved:?}");
    let without = [("\"relief.b\", ", ""), ("\"relief.a\", ", "")];
    let component = ("[components.relief]\nkind = \"relief_valve\"\nset_pa = 24e6", "");
    let found = of_press(&[FIXED_PUMP, without[0], without[1], component]);
    assert_one_with(&found, "the outlet of the pump 'pump' has no relief valve");
    assert_one_with(&found, "20000 bar");
    // A relief valve that opens the other way, or that never opens, is none.
    let found = of_press(&[&REVERSED[..], &[FIXED_PUMP]].concat());
    assert_one_with(&found, "has no relief valve");
    let found = of_press(&[FIXED_PUMP, ("set_pa = 24e6", "set_pa = 1e8")]);
    assert_one_with(&found, "has no relief valve");
}

const REVERSED: [(&str, &str); 3] = [
    ("\"relief.b\"", "\"relief.c\""),
    ("\"relief.a\"", "\"relief.b\""),
    ("\"relief.c\"", "\"relief.a\""),
];

#[test]
fn a_relief_valve_of_a_compensated_pump_opens_above_its_pressure_and_the_right_way() {
    let relief = |found: &[String]| found.iter().filter(|w| w.contains("'relief'")).count();
    assert_eq!(relief(&of_press(&[("set_pa = 24e6", "set_pa = 21e6")])), 0);
    let found = of_press(&[("set_pa = 24e6", "set_pa = 18e6")]);
    assert_one_with(
        &found,
        "the relief valve 'relief' opens at 180 bar (relief.set_pa), below the 210 bar at which the compensator of the \
         pump 'pump' ends its flow (pump.set_pa)",
    );
    for found in [of_press(&REVERSED), of_press(&[&REVERSED[..], &[FIXED_PUMP]].concat())] {
        assert_one_with(
            &found,
            "the relief valve 'relief' is reversed: its port b is at the outlet",
        );
    }
}

#[test]
fn the_outlet_of_a_pump_is_not_at_the_tank() {
    let exchanged = [
        ("\"pump.inlet\"", "\"pump.x\""),
        ("\"pump.outlet\"", "\"pump.inlet\""),
        ("pump.x", "pump.outlet"),
    ];
    let found = of_press(&exchanged);
    assert_one_with(
        &found,
        "the pump 'pump' is reversed: its outlet is at the tank 'tank'; exchange 'pump.inlet' and 'pump.outlet'",
    );
    assert!(!found.iter().any(|warning| warning.contains("'relief'")), "{found:#?}");
}

#[test]
fn a_pressure_sensor_reads_beyond_the_supply() {
    let short = |found: &[String]| found.iter().filter(|w| w.contains("head room")).count();
    let found = of_press(&[("full_scale_pa = 250e5", "full_scale_pa = 210e5")]);
    assert_one_with(
        &found,
        "the range of 'sensor_supply' ends at 210 bar (sensor_supply.full_scale_pa) and has no head room: the supply \
         'pump' has 210 bar",
    );
    // The valve lets the supply into both chambers.
    assert_eq!(short(&found), 3, "{found:?}");
    assert_eq!(short(&of_press(&[("full_scale_pa = 250e5", "full_scale_pa = 211e5")])), 0);
}

#[test]
fn exchanged_chambers_and_too_large_a_gain_are_seen_at_the_default_inputs() {
    let exchanged = [
        ("[\"valve.a\"", "[\"valve.x\""),
        ("[\"valve.b\"", "[\"valve.a\""),
        ("[\"valve.x\"", "[\"valve.b\""),
    ];
    let found = of_press(&exchanged);
    assert_one_with(&found, "exchanged ports A and B");
    let found = of_press(&[("gain_per_m = 40", "gain_per_m = 1500")]);
    assert_one_with(&found, "default inputs");
}
