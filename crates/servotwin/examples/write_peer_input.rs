//! Writes what `peers/cvode` integrates: the aileron's C source and the cases.
//!
//! ```text
//! cargo run --release -p servotwin --example write_peer_input -- FOLDER
//! ```
//!
//! `FOLDER/aileron.c` is the system; `FOLDER/command.csv` the command, which the
//! test reads again (signals may change); `FOLDER/cases.txt` is, as numbers: count of
//! cases, duration, period; the states' scales; per case its name, effective
//! parameters and start at rest, and per input the count of its pieces, each
//! with its begin and four coefficients.

#[path = "../tests/all/peer_cases.rs"]
mod peer_cases;

use peer_cases::{CASES, COMMAND, DURATION_S, PERIOD_S};
use servotwin::ensemble::{Ensemble, Variant};
use servotwin::signal::Signal;
use servotwin::system::System;
use servotwin_model::c_source;
use servotwin_model::program::FaultAt;
use servotwin_model::signal::Piecewise;
use servotwin_model::spec::Unit;
use std::error::Error;
use std::fmt::Write;
use std::path::PathBuf;

fn numbers(text: &mut String, values: impl IntoIterator<Item = f64>) {
    for value in values {
        write!(text, "{value:e} ").expect("a string takes all");
    }
    text.push('\n');
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("which folder?")?);
    std::fs::create_dir_all(&folder)?;
    let system = System::default();
    let program = &system.program;
    std::fs::write(folder.join("aileron.c"), c_source::write_equations(program, "aileron", &[])?)?;

    let command = COMMAND.parse::<Signal>()?.build(Unit::Radian, DURATION_S)?;
    let mut inputs = Vec::new();
    for input in &program.network().inputs {
        let signal = Piecewise::constant(input.default)?;
        inputs.push(if input.id == "command" { command.clone() } else { signal });
    }
    let mut table =
        String::from("# written by the example write_peer_input\nbegin_s,c0,c1,c2,c3\n");
    for (begin, [a, b, c, d]) in command.breaks_s().iter().zip(command.pieces()) {
        writeln!(table, "{begin:e},{a:e},{b:e},{c:e},{d:e}")?;
    }
    std::fs::write(folder.join("command.csv"), table)?;
    let mut text = String::new();
    numbers(&mut text, [CASES.len() as f64, DURATION_S, PERIOD_S]);
    let names: Vec<&str> = program.states().iter().map(|s| s.name.as_str()).collect();
    writeln!(text, "{}", names.join(" "))?;
    numbers(&mut text, program.states().iter().map(|s| s.scale));
    for (name, fault) in CASES {
        let mut faults = Vec::new();
        if let Some((id, intensity)) = fault {
            let (component, fault) = program.find_fault(id).ok_or(id)?;
            faults.push(FaultAt { component, fault, intensity });
        }
        let parameters = program.parameters(&faults);
        let variant = Variant { faults, inputs: inputs.iter().collect(), ..Default::default() };
        let (start, _) = Ensemble::new(program).settle(&variant).map_err(|f| format!("{f:?}"))?;
        writeln!(text, "{name}")?;
        numbers(&mut text, parameters.into_iter().flatten());
        numbers(&mut text, start);
        for input in &inputs {
            writeln!(text, "{}", input.breaks_s().len())?;
            for (begin, piece) in input.breaks_s().iter().zip(input.pieces()) {
                numbers(&mut text, std::iter::once(*begin).chain(*piece));
            }
        }
    }
    std::fs::write(folder.join("cases.txt"), text)?;
    Ok(())
}
