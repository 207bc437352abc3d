//! `servotwin describe`: the parts of a system and its behavior at rest.

use super::{SystemOption, faults, note};
use crate::Global;
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::render::{Side, TextTable, json, number, number_and_unit, shown};
use servotwin::rest::{self, Rest};
use servotwin::system::System;
use servotwin_model::network::Network;
use servotwin_report::schematic;
use std::f64::consts::TAU;
use std::path::PathBuf;

/// Describe a system: components, states, inputs, sensors, and eigenvalues at rest; or faults.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    system: SystemOption,
    /// Draw the components and their connections to a .svg or .png file.
    #[arg(long, value_name = "FILE")]
    schematic: Option<PathBuf>,
    /// List the faults that its components can have, instead of describing the system.
    #[arg(long)]
    faults: bool,
    /// Write the list of --faults as CSV, with numbers in SI units.
    #[arg(long, requires = "faults", conflicts_with = "json")]
    csv: bool,
}

impl Options {
    /// The files that the command reads and writes.
    pub(crate) fn paths(&self) -> Paths {
        let read = Paths::default().read("SYSTEM", &self.system.path);
        read.write("--schematic", Format::Figure, &self.schematic)
    }
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let system = options.system.read()?;
    if let Some(path) = &options.schematic {
        schematic::of(&system).draw().save(path)?;
    }
    if options.faults {
        return Ok(faults::text(&system, options.csv, global));
    }
    let rest = rest::of(&system)?;
    if !rest.is_found {
        let why = if rest.limit_cycle { ", a limit cycle was measured" } else { "" };
        let text = format!(
            "no rest was found{why}: the states and eigenvalues are those where the search for it ended"
        );
        note(global, &text);
    }
    Ok(if global.json { json(&rest::describe(&system, &rest)) } else { people(&system, &rest) })
}

fn people(system: &System, rest: &Rest) -> String {
    let network = system.network();
    format!(
        "{}: {}\n\nComponents\n{}\nStates at rest\n{}\nInputs\n{}\nSensors\n{}\n\
         Eigenvalues at rest\n{}",
        system.name,
        system.title,
        components(network),
        states(system, rest),
        inputs(network),
        sensors(system),
        eigenvalue_table(rest),
    )
}

fn components(network: &Network) -> String {
    let mut text = String::new();
    for instance in &network.components {
        let spec = instance.component.spec();
        text += &format!("{} ({}): {}\n", instance.id, spec.kind, spec.summary);
        for (declared, &value) in spec.parameters.iter().zip(&instance.parameters) {
            text += &format!("    {:<32} {}\n", declared.name, shown(value, declared.unit));
        }
    }
    text
}

/// The accuracy of a state at rest, as a share of its scale.
const KNOWN: f64 = 1e-12;

fn states(system: &System, rest: &Rest) -> String {
    let mut grid = TextTable::new(&[
        ("state", Side::Left),
        ("rest", Side::Right),
        ("scale", Side::Right),
        ("unit", Side::Left),
    ]);
    for (state, &value) in system.program.states().iter().zip(&rest.states) {
        // A smaller value is only noise of the search for rest.
        let value = if value.abs() < KNOWN * state.scale { 0.0 } else { value };
        grid.push(vec![
            state.name.clone(),
            number(state.unit.to_shown(value), 5),
            number(state.unit.difference_to_shown(state.scale), 5),
            state.unit.shown().into(),
        ]);
    }
    grid.text()
}

fn inputs(network: &Network) -> String {
    let mut grid =
        TextTable::new(&[("input", Side::Left), ("default", Side::Right), ("unit", Side::Left)]);
    for input in &network.inputs {
        let (value, unit) = number_and_unit(input.default, input.unit);
        grid.push(vec![input.id.clone(), value, unit.into()]);
    }
    grid.text()
}

fn sensors(system: &System) -> String {
    let mut grid = TextTable::new(&[
        ("sensor", Side::Left),
        ("signal", Side::Left),
        ("scale", Side::Right),
        ("unit", Side::Left),
    ]);
    for sensor in &system.sensors {
        grid.push(vec![
            sensor.id.clone(),
            sensor.signal.clone(),
            number(sensor.unit.difference_to_shown(sensor.scale), 5),
            sensor.unit.shown().into(),
        ]);
    }
    grid.text()
}

fn eigenvalue_table(rest: &Rest) -> String {
    let mut grid = TextTable::new(&[
        ("real 1/s", Side::Right),
        ("imaginary rad/s", Side::Right),
        ("frequency Hz", Side::Right),
        ("damping ratio", Side::Right),
    ]);
    // Show one value of each conjugate pair, and no oscillation from rounding noise.
    for value in rest.eigenvalues.iter().filter(|value| value.im >= 0.0) {
        let swings = value.im > 1e-9 * value.abs();
        let only = |number: String| if swings { number } else { String::new() };
        grid.push(vec![
            number(value.re, 5),
            only(number(value.im, 5)),
            only(number(value.abs() / TAU, 4)),
            only(number(-value.re / value.abs(), 3)),
        ]);
    }
    grid.text()
}
