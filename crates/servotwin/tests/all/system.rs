//! System files: good ones become systems, and each broken one is told what is
//! wrong, exactly as in the `.expected` file beside it.
//!
//! `UPDATE=1 cargo test -p servotwin --test all system` writes the expected files anew.

use crate::golden;
use servotwin::system::System;
use servotwin_io::toml_text::TomlError;
use servotwin_model::fluid::Fluid;
use servotwin_model::network::Instance;
use servotwin_model::spec::Unit;
use std::path::{Path, PathBuf};

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn shipped(name: &str) -> System {
    let path = folder("../../systems").join(name);
    System::read(&path).unwrap_or_else(|error| panic!("{error}"))
}

fn component<'a>(system: &'a System, id: &str) -> &'a Instance {
    let found = system.network().components.iter().find(|c| c.id == id);
    found.unwrap_or_else(|| panic!("no component {id}"))
}

fn parameter(system: &System, id: &str, name: &str) -> f64 {
    let instance = component(system, id);
    instance.parameters[instance.component.parameter(name).expect("declared")]
}

fn fault(system: &System, id: &str, name: &str) -> f64 {
    let instance = component(system, id);
    instance.fault_full[instance.component.fault(name).expect("declared")]
}

/// A source fills a volume through an orifice; `more` follows.
fn small(more: &str) -> String {
    format!(
        r#"format = 1
name = "small"
{more}
"#
    )
}

const FILLING: &str = r#"
[components.supply]
kind = "pressure_source"
[components.leak]
kind = "orifice"
area_m2 = 1e-7
[components.chamber]
kind = "volume"
volume_m3 = 1e-4
[system]
connections = [["supply.port", "leak.a"], ["leak.b", "chamber.port"]]
"#;

#[test]
fn broken_systems_are_told_what_is_wrong() {
    let parse = |text: &str, name: &str| System::parse(text, name).map(drop);
    golden::assert_mistakes("tests/broken_systems", 40, parse);
}

/// [`FILLING`] with a fluid by these points, as its source has it.
fn by_points(points: &str) -> Fluid {
    let fluid = format!("[fluids.green]\nkind = \"table\"\n{points}\n{FILLING}");
    let system = System::parse(&small(&fluid), "table").unwrap_or_else(|error| panic!("{error}"));
    component(&system, "supply").fluid.clone()
}

#[test]
fn a_fluid_by_table_has_the_numbers_of_its_points() {
    let points = [
        (273.15, 889.0, 530e-6, 1.9e9),
        (313.15, 865.0, 46e-6, 1.6e9),
        (373.15, 828.0, 6.8e-6, 1.1e9),
    ];
    let rows = points.map(|(kelvin, density, viscosity, modulus)| {
        format!(
            "temperature_k = {kelvin}\ndensity_kg_m3 = {density}\nviscosity_m2_s = {viscosity:e}\n\
             bulk_modulus_pa = {modulus:e}\n"
        )
    });
    let tables = rows.each_ref().map(|row| format!("[[fluids.green.points]]\n{row}")).concat();
    let list = rows.map(|row| format!("{{ {} }}", row.trim_end().replace('\n', ", "))).join(", ");
    let slope = "bulk_modulus_slope = 9.5\n";
    let fluid = by_points(&format!("{slope}points = [{list}]"));
    assert_eq!(fluid, by_points(&format!("{slope}{tables}")), "two ways to write it");
    assert_eq!(fluid.range_k(), (273.15, 373.15));
    for (kelvin, density, viscosity, modulus) in points {
        let state = fluid.at(kelvin);
        assert!((state.density_kg_m3 / density - 1.0).abs() < 1e-14, "{kelvin}");
        assert!((state.kinematic_viscosity_m2_s / viscosity - 1.0).abs() < 1e-11, "{kelvin}");
        assert!((state.bulk.liquid_pa / modulus - 1.0).abs() < 1e-14, "{kelvin}");
        assert_eq!(state.bulk.slope, 9.5);
    }
}

#[test]
fn a_fluid_by_table_without_bulk_modulus_has_that_of_its_law() {
    let fluid = by_points(
        "bulk_modulus_pa = 1.5e9
bulk_modulus_change = -5e6
[[fluids.green.points]]
temperature_k = 283.15
density_kg_m3 = 883
viscosity_m2_s = 260e-6
[[fluids.green.points]]
temperature_k = 373.15
density_kg_m3 = 828
viscosity_m2_s = 6.8e-6",
    );
    for (kelvin, modulus) in [(283.15, 1.65e9), (313.15, 1.5e9), (373.15, 1.2e9)] {
        assert!((fluid.at(kelvin).bulk.liquid_pa / modulus - 1.0).abs() < 1e-12, "{kelvin}");
    }
}

#[test]
fn the_aileron_has_the_agreed_parts() {
    let system = System::default();
    assert_eq!(system.name, "aileron_dual");
    assert_eq!(system.network().components.len(), 2 * 26 + 5);
    assert_eq!(system.program.states().len(), 43);
    let ids: Vec<&str> = system.network().components.iter().map(|c| c.id.as_str()).collect();
    let first = ["supply", "tank", "supply_valve", "tank_valve", "manifold_supply"];
    for (id, name) in ids.iter().zip(first) {
        assert_eq!(*id, format!("actuator_1.{name}"), "components keep the file's order");
    }
    assert_eq!(ids[52..], ["equaliser", "aileron", "lever", "air", "sensor_aileron"]);
    let inputs: Vec<&str> = system.network().inputs.iter().map(|i| i.id.as_str()).collect();
    assert_eq!(
        inputs,
        [
            "actuator_1.mode",
            "actuator_1.supply_pressure",
            "actuator_1.return_pressure",
            "actuator_2.mode",
            "actuator_2.supply_pressure",
            "actuator_2.return_pressure",
            "command",
            "load_factor",
            "air_speed",
            "altitude",
            "incidence",
        ]
    );
    // mode_valve.command, controller.mode and the equaliser.
    assert_eq!(system.network().inputs[0].targets.len(), 3);
}

#[test]
fn the_aileron_has_the_papers_twelve_residuals_first() {
    let system = System::default();
    let ids: Vec<&str> = system.sensors.iter().map(|s| s.id.as_str()).collect();
    let order = ["p_a", "p_b", "x_p", "x_v", "p_s", "p_t"];
    let expected: Vec<String> =
        ["1", "2"].iter().flat_map(|k| order.map(|name| format!("{name}_{k}"))).collect();
    assert_eq!(ids[..12], expected);
    assert_eq!(ids[12..], ["x_p_3"]);
    for sensor in &system.sensors {
        let observable = system.program.observable(&sensor.signal).expect("observable");
        assert_eq!(observable.unit, sensor.unit);
    }
    assert_eq!(system.sensor("x_p_2").map(|s| s.scale), Some(22.2e-3));
    assert_eq!(system.sensor("p_t_1").map(|s| (s.scale, s.unit)), Some((25e5, Unit::Pascal)));
}

#[test]
fn the_aileron_overrides_faults_and_keeps_the_others() {
    let system = System::default();
    for k in [1, 2] {
        assert_eq!(fault(&system, &format!("actuator_{k}.leakage_a"), "leakage"), 2.0e-7);
        assert_eq!(fault(&system, &format!("actuator_{k}.leakage_supply"), "leakage"), 2.5e-6);
        assert_eq!(fault(&system, &format!("actuator_{k}.leakage_tank"), "leakage"), 5.0e-6);
    }
}

#[test]
fn a_system_with_more_entries_than_places_is_refused() {
    // Its states have places, its partial derivatives have not.
    let mut text = small("[components.tank]\nkind = \"tank\"\n");
    let mut connections = String::new();
    for n in 0..8_000 {
        text += &format!("[components.v{n}]\nkind = \"volume\"\nvolume_m3 = 1e-5\n");
        text += &format!("[components.o{n}]\nkind = \"orifice\"\narea_m2 = 1e-6\n");
        let before = if n == 0 { "tank.port".into() } else { format!("v{}.port", n - 1) };
        connections += &format!("[\"{before}\", \"o{n}.a\"], [\"o{n}.b\", \"v{n}.port\"],\n");
    }
    text += &format!("[system]\nconnections = [\n{connections}]\n");
    let error = System::parse(&text, "chain.toml").err().expect("a mistake").to_string();
    assert!(error.contains("too large for one program"), "{error}");
}

#[test]
fn the_smaller_systems_compile() {
    let learning = shipped("valve_and_cylinder.toml");
    assert_eq!(learning.network().components.len(), 4);
    assert_eq!(learning.program.states().len(), 6);
    let spring = shipped("spring_actuator.toml");
    assert_eq!(spring.network().components.len(), 15);
    assert_eq!(spring.program.states().len(), 15);
    assert_eq!(spring.sensors.len(), 5);
    let press = shipped("press_axis.toml");
    assert_eq!((press.network().components.len(), press.program.states().len()), (16, 17));
}

#[test]
fn the_default_is_the_shipped_file() {
    let file = shipped("aileron_dual.toml");
    assert_eq!(file.text, System::default().text);
}

#[test]
fn defaults_stand_where_the_file_says_nothing() {
    let system = System::parse(&small(FILLING), "small.toml").expect("a system");
    assert_eq!(system.title, "small");
    assert_eq!(parameter(&system, "supply", "pressure_pa"), 20.684e6);
    assert_eq!(parameter(&system, "leak", "area_m2"), 1e-7);
    assert_eq!(fault(&system, "leak", "clogging"), 0.05);
    assert_eq!(component(&system, "supply").fluid.air_fraction, 0.005);
}

#[test]
fn an_instance_overrides_its_assembly() {
    let text = small(
        r#"
[fluids.green]
kind = "mil_prf_5606"
[fluids.yellow]
kind = "phosphate_ester"
[assemblies.filling.components.supply]
kind = "pressure_source"
fluid = "green"
[assemblies.filling.components.leak]
kind = "orifice"
area_m2 = 1e-7
faults.clogging = 0.1
[assemblies.filling.components.chamber]
kind = "volume"
[assemblies.filling]
connections = [["supply.port", "leak.a"], ["leak.b", "chamber.port"]]
[components.second]
assembly = "filling"
chamber.volume_m3 = 2e-4
[components.first]
assembly = "filling"
fluid = "yellow"
chamber.volume_m3 = 1
leak.area_m2 = 2e-7
leak.faults.clogging = 0.2
"#,
    );
    let system = System::parse(&text, "small.toml").unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(system.program.states()[0].name, "second.chamber.pressure_pa");
    assert_eq!(parameter(&system, "first.leak", "area_m2"), 2e-7);
    assert_eq!(parameter(&system, "second.leak", "area_m2"), 1e-7);
    assert_eq!(parameter(&system, "first.chamber", "volume_m3"), 1.0);
    assert_eq!(fault(&system, "first.leak", "clogging"), 0.2);
    assert_eq!(fault(&system, "second.leak", "clogging"), 0.1);
    let fluid = |id| component(&system, id).fluid.kind.name();
    assert_eq!(fluid("first.supply"), "phosphate_ester");
    assert_eq!(fluid("second.supply"), "mil_prf_5606");
}

#[test]
fn the_order_of_states_is_the_order_of_the_file() {
    let reversed = FILLING.replace("chamber", "z_chamber").replace("leak", "y_leak");
    let more = r#"
[components.a_chamber]
kind = "volume"
volume_m3 = 1e-4
[components.a_leak]
kind = "orifice"
area_m2 = 1e-7
"#;
    let text = small(&format!("{more}{reversed}")).replace(
        "connections = [",
        "connections = [[\"a_leak.a\", \"supply.port\"], [\"a_leak.b\", \"a_chamber.port\"], ",
    );
    let system = System::parse(&text, "small.toml").unwrap_or_else(|error| panic!("{error}"));
    let names: Vec<&str> = system.program.states().iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["a_chamber.pressure_pa", "z_chamber.pressure_pa"]);
    let swapped = small(&format!("{reversed}{more}")).replace(
        "connections = [",
        "connections = [[\"a_leak.a\", \"supply.port\"], [\"a_leak.b\", \"a_chamber.port\"], ",
    );
    let system = System::parse(&swapped, "small.toml").unwrap_or_else(|error| panic!("{error}"));
    let names: Vec<&str> = system.program.states().iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["z_chamber.pressure_pa", "a_chamber.pressure_pa"]);
}

#[test]
fn several_mistakes_are_told_in_the_order_of_the_file() {
    let text = small(&FILLING.replace("1e-7", "7.0").replace("1e-4", "nan"));
    let Err(TomlError::Mistakes { mistakes, .. }) = System::parse(&text, "small.toml") else {
        panic!("mistakes expected");
    };
    let lines: Vec<usize> = mistakes.iter().map(|m| m.line).collect();
    assert_eq!(lines, [8, 11]);
    assert!(mistakes[0].message.contains("is out of range"), "{mistakes:?}");
    assert!(mistakes[1].message.contains("must be a finite number"), "{mistakes:?}");
}

#[test]
fn a_file_that_is_not_there_is_told() {
    let error = System::read("no/such/system.toml").err().expect("no system");
    assert_eq!(error.to_string(), "no/such/system.toml: no such file");
}

/// No cut or damaged file makes the reader panic.
#[test]
fn damaged_files_are_no_reason_to_panic() {
    let whole = System::default().text;
    for cut in (0..whole.len()).step_by(97).filter(|&at| whole.is_char_boundary(at)) {
        // Without the loads and the sensors, it still is a system.
        let complete = whole[..cut].contains("[inputs.command]");
        assert!(complete || System::parse(&whole[..cut], "cut.toml").is_err(), "cut at {cut}");
    }
    let lines: Vec<&str> = whole.lines().collect();
    for skipped in 0..lines.len() {
        let rest: Vec<&str> =
            lines.iter().enumerate().filter(|&(i, _)| i != skipped).map(|(_, l)| *l).collect();
        if let Err(error) = System::parse(&rest.join("\n"), "skipped.toml") {
            assert!(!error.to_string().is_empty());
        }
    }
}
