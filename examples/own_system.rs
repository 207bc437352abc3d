//! Describes a small system in TOML, simulates it, and sweeps one parameter.

use servotwin::prelude::*;

const SYSTEM: &str = r#"
format = 1
name = "leaking_volume"
title = "A volume that is filled through an orifice"
[components.supply]
kind = "pressure_source"
pressure_pa = 2e7
[components.orifice]
kind = "orifice"
area_m2 = 1e-7
[components.chamber]
kind = "volume"
volume_m3 = 1e-4
[system]
connections = [["supply.port", "orifice.a"], ["orifice.b", "chamber.port"]]
"#;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    own_system()
}

/// Prints the faults of the system and simulates a sweep.
pub fn own_system() -> Result<(), Box<dyn std::error::Error>> {
    let system = System::parse(SYSTEM, "leaking_volume.toml")?;
    for fault in system.fault_list() {
        println!("{}: {}", fault.id, fault.summary);
    }
    let results = Simulation::new(&system)
        .duration_s(0.1)
        .run_sweep("orifice.area_m2", &[1e-8, 1e-7, 1e-6])?;
    println!("{} rows", results.table()?.row_count());
    Ok(())
}
