//! Scratch, never committed.
use servotwin::system::System;
fn main() {
    let system = System::read("systems/valve_and_cylinder.toml").unwrap();
    let p = &system.program;
    let held = p.stand_in_values(&p.parameters(&[]));
    println!("states {:?}", p.states().iter().map(|s| s.name.clone()).collect::<Vec<_>>());
    println!(
        "externals {:?} stand_ins {} derivatives {:?} slots {} memory {} constants {} blocks {}",
        p.externals(),
        held.len(),
        p.derivatives(),
        p.slots(),
        p.memory(),
        p.constants(),
        p.blocks()
    );
    let j = p.jacobian();
    println!(
        "jac slots {} entries {} products {} slope0 {} ",
        j.slots(),
        j.entries().len(),
        j.products(),
        j.slope(0)
    );
    println!("lu slots {} updates {}", p.lu().slots(), p.lu().updates());
    println!("{:?}", j.entries());
}
