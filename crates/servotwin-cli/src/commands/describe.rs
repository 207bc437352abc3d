//! `servotwin describe`: what a system consists of and how it behaves at rest.

use super::{SystemOption, default_inputs};
use crate::Global;
use crate::failure::Failure;
use crate::render::{Grid, Side, json, number, number_and_unit, shown};
use serde_json::{Value, json};
use servotwin::eigenvalues::{self, Complex};
use servotwin::ensemble::{Ensemble, Variant};
use servotwin::report::schematic;
use servotwin::system::System;
use servotwin_model::network::Network;
use std::f64::consts::TAU;
use std::path::PathBuf;

/// Describe a system: components with parameters, states, inputs, sensors, and
/// the eigenvalues at rest.
#[derive(clap::Args)]
pub struct Options {
    #[command(flatten)]
    system: SystemOption,
    /// Draw components and connections to a .svg or .png file.
    #[arg(long, value_name = "FILE")]
    schematic: Option<PathBuf>,
}

/// A system at rest.
struct Rest {
    states: Vec<f64>,
    /// Slowest first.
    eigenvalues: Vec<Complex>,
}

/// The text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let system = options.system.read()?;
    if let Some(path) = &options.schematic {
        schematic::of(&system).draw().save(path)?;
    }
    let rest = rest(&system)?;
    Ok(if global.json { json(&as_json(&system, &rest)) } else { people(&system, &rest) })
}

fn rest(system: &System) -> Result<Rest, Failure> {
    let program = &system.program;
    let inputs = default_inputs(system);
    let variant = Variant { inputs: inputs.iter().collect(), ..Variant::default() };
    let states = Ensemble::new(program).settle(&variant).map_err(|failure| Failure::Run {
        time_s: failure.time_s,
        state: program.states()[failure.state].name.clone(),
        cause: failure.cause.to_string(),
    })?;
    let values: Vec<f64> = inputs.iter().map(|input| input.value(0.0)).collect();
    let eigenvalues = eigenvalues::of_system(program, &states, &values);
    let eigenvalues = eigenvalues.ok_or(Failure::Eigenvalues)?;
    Ok(Rest { states, eigenvalues })
}

fn as_json(system: &System, rest: &Rest) -> Value {
    let network = system.network();
    let components = network.components.iter().map(|instance| {
        let spec = instance.component.spec();
        let parameters = spec.parameters.iter().zip(&instance.parameters);
        let parameters = parameters.map(|(declared, value)| {
            json!({ "name": declared.name, "unit": declared.unit.symbol(), "value": value })
        });
        json!({
            "id": instance.id, "kind": spec.kind, "summary": spec.summary,
            "parameters": parameters.collect::<Vec<_>>(),
            "faults": spec.faults.iter().map(|fault| fault.name).collect::<Vec<_>>(),
        })
    });
    let states = system.program.states().iter().zip(&rest.states).map(|(state, value)| {
        json!({
            "name": state.name, "unit": state.unit.symbol(), "scale": state.scale, "rest": value,
        })
    });
    let inputs = network.inputs.iter().map(
        |input| json!({ "id": input.id, "unit": input.unit.symbol(), "default": input.default }),
    );
    let sensors = system.sensors.iter().map(|sensor| {
        json!({
            "id": sensor.id, "label": sensor.label, "signal": sensor.signal,
            "unit": sensor.unit.symbol(), "scale": sensor.scale,
        })
    });
    let eigenvalues = rest.eigenvalues.iter().map(|value| json!([value.re, value.im]));
    json!({
        "name": system.name, "title": system.title,
        "components": components.collect::<Vec<_>>(),
        "states": states.collect::<Vec<_>>(),
        "inputs": inputs.collect::<Vec<_>>(),
        "sensors": sensors.collect::<Vec<_>>(),
        "eigenvalues_per_s": eigenvalues.collect::<Vec<_>>(),
    })
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

fn states(system: &System, rest: &Rest) -> String {
    let mut grid = Grid::new(&[
        ("state", Side::Left),
        ("rest", Side::Right),
        ("scale", Side::Right),
        ("unit", Side::Left),
    ]);
    for (state, &value) in system.program.states().iter().zip(&rest.states) {
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
        Grid::new(&[("input", Side::Left), ("default", Side::Right), ("unit", Side::Left)]);
    for input in &network.inputs {
        let (value, unit) = number_and_unit(input.default, input.unit);
        grid.push(vec![input.id.clone(), value, unit.into()]);
    }
    grid.text()
}

fn sensors(system: &System) -> String {
    let mut grid = Grid::new(&[
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
    let mut grid = Grid::new(&[
        ("real 1/s", Side::Right),
        ("imaginary rad/s", Side::Right),
        ("frequency Hz", Side::Right),
        ("damping ratio", Side::Right),
    ]);
    // Of a conjugate pair one is enough; rounding noise is no oscillation.
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
