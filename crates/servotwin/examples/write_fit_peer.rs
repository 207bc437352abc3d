//! Writes what `peers/scipy_fit.py` fits: the aileron's C source and what a fit needs to know of it.
//!
//! ```text
//! cargo run --release -p servotwin --example write_fit_peer -- FOLDER
//! ```
//!
//! `FOLDER/aileron.c` is the system, its outputs the sensors of the paper's study. `FOLDER/fit.json` has their
//! columns in a record, the deviation that each of their samples carries, the states' scales, the default
//! inputs, the states at rest with them, all parameters, and for each tolerance of the study its name, its standard deviation, and the
//! places and values of the parameters that it moves.

use serde_json::json;
use servotwin::ensemble::{Ensemble, Variant};
use servotwin::fit::Unknown;
use servotwin::study::Study;
use servotwin_model::c_source;
use servotwin_model::network::ExternalInput;
use servotwin_model::signal::Piecewise;
use std::error::Error;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("which folder?")?);
    std::fs::create_dir_all(&folder)?;
    let study = Study::default();
    let (system, program) = (&study.system, &study.system.program);
    let sensors = &study.measured[..study.base_sensors()];
    let signal = |&sensor: &usize| program.observable(&system.sensors[sensor].signal).cloned();
    let outputs =
        sensors.iter().map(signal).collect::<Option<Vec<_>>>().ok_or("a sensor's signal")?;
    std::fs::write(
        folder.join("aileron.c"),
        c_source::write_equations(program, "aileron", &outputs)?,
    )?;
    let parameters = program.parameters(&[]);
    let begins = |component: usize| parameters[..component].iter().map(Vec::len).sum::<usize>();
    let unknown = |unknown: Unknown| {
        let places: Vec<usize> = unknown.members.iter().map(|&(c, p, _)| begins(c) + p).collect();
        let nominal: Vec<f64> = unknown.members.iter().map(|&(_, _, nominal)| nominal).collect();
        json!({
            "name": unknown.name, "sigma": unknown.sigma, "absolute": unknown.is_absolute,
            "places": places,
            "nominal": nominal, "range": [unknown.range.0, unknown.range.1], "step": unknown.step,
        })
    };
    let deviations =
        study.scales().into_iter().zip(&study.sensors.0).map(|(s, seen)| s * seen.noise);
    let columns = sensors.iter().map(|&s| {
        let sensor = &system.sensors[s];
        format!("{}{}", sensor.id, sensor.unit.suffix())
    });
    let constant = |input: &ExternalInput| Piecewise::constant(input.default);
    let inputs = program.network().inputs.iter().map(constant).collect::<Result<Vec<_>, _>>()?;
    let variant = Variant { inputs: inputs.iter().collect(), ..Variant::default() };
    let (start, _) = Ensemble::new(program).settle(&variant).map_err(|f| format!("{f:?}"))?;
    let content = json!({
        "start": start,
        "columns": columns.collect::<Vec<_>>(),
        "deviations": deviations.take(sensors.len()).collect::<Vec<_>>(),
        "state_scales": program.states().iter().map(|s| s.scale).collect::<Vec<_>>(),
        "inputs": program.network().inputs.iter().map(|i| i.default).collect::<Vec<_>>(),
        "command": study.command_input,
        "parameters": parameters.iter().flatten().collect::<Vec<_>>(),
        "unknowns": Unknown::of_study(&study).into_iter().map(unknown).collect::<Vec<_>>(),
    });
    std::fs::write(folder.join("fit.json"), serde_json::to_string(&content)?)?;
    Ok(())
}
