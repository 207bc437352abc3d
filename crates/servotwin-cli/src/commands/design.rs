//! `servotwin fit --design`: finds the command that determines the parameters best.

use crate::failure::Failure;
use crate::render::{Side, TextTable, json, number};
use crate::{Global, stop};
use serde_json::json;
use servotwin::fit::Fit;
use servotwin::fit::design::{self, Design, Rig};
use servotwin::signal::WrittenQuantity;
use servotwin::study::Study;
use servotwin_model::spec::Unit;

/// What the command may do.
#[derive(clap::Args)]
#[command(next_help_heading = "Limits of --design")]
pub(crate) struct AllowedCommand {
    /// Largest amplitude of the command.
    #[arg(long, value_name = "SIZE", requires = "design", default_value = "10deg")]
    amplitude: String,
    /// Largest rate of the command.
    #[arg(long, value_name = "RATE", requires = "design", default_value = "40deg/s")]
    rate: String,
    /// Duration of the command.
    #[arg(long, value_name = "TIME", requires = "design", default_value = "60s")]
    duration: String,
}

/// Returns the text for standard output.
pub(crate) fn run(
    limits: &AllowedCommand,
    mut problem: Fit,
    study: &Study,
    global: Global,
) -> Result<String, Failure> {
    let unit = study.system.network().inputs[study.command_input].unit;
    let rate = match unit {
        Unit::Radian => Unit::RadianPerSecond,
        Unit::Metre => Unit::MetrePerSecond,
        // Other rates have no unit here and are plain numbers.
        _ => Unit::None,
    };
    let limits = design::Limits {
        amplitude: positive("--amplitude", &limits.amplitude, unit)?,
        rate: positive("--rate", &limits.rate, rate)?,
        duration_s: positive("--duration", &limits.duration, Unit::Second)?,
    };
    if !(5.0..=3600.0).contains(&limits.duration_s) {
        let (option, given) = ("--duration", format!("{} s", limits.duration_s));
        return Err(Failure::OutOfRange { option, given, range: "5 s to 3600 s".into() });
    }
    let rig = Rig {
        input: study.command_input,
        sensors: study.measured[..study.base_sensors()].to_vec(),
        period_s: study.sample_period_s,
    };
    problem.cancel = Some(stop::flag());
    let found = problem.design(&rig, limits)?;
    let Some(best) = found.first() else {
        return Err(Failure::Options("no signal of the catalogue keeps these limits"));
    };
    Ok(match global {
        Global { json: true, .. } => {
            json(&json!(found.iter().map(|design| as_json(design, &problem)).collect::<Vec<_>>()))
        }
        Global { quiet: true, .. } => format!("{}\n", best.command),
        _ => people(&found, best, &problem, unit),
    })
}

fn positive(option: &'static str, text: &str, unit: Unit) -> Result<f64, Failure> {
    let value =
        WrittenQuantity::in_unit(text, unit).map_err(|error| Failure::Number { option, error })?;
    match value > 0.0 && value.is_finite() {
        true => Ok(value),
        false => {
            Err(Failure::OutOfRange { option, given: text.into(), range: "greater than 0".into() })
        }
    }
}

fn as_json(design: &Design, problem: &Fit) -> serde_json::Value {
    let errors = problem.unknowns.iter().enumerate().map(|(k, unknown)| {
        json!({
            "name": unknown.name,
            "error_sigma": design.known.error(k),
            "knowledge": design.known.forecast(&problem.unknowns, k),
        })
    });
    json!({
        "command": design.command,
        "gain_bits": design.gain,
        "amplitude": design.amplitude,
        "rate": design.rate,
        "parameters": errors.collect::<Vec<_>>(),
    })
}

fn people(found: &[Design], best: &Design, problem: &Fit, unit: Unit) -> String {
    let mut grid = TextTable::new(&[
        ("command", Side::Left),
        ("gain, bits", Side::Right),
        ("size", Side::Right),
        ("rate", Side::Right),
    ]);
    let shown =
        |value: f64| format!("{} {}", number(unit.difference_to_shown(value), 3), unit.shown());
    for design in found {
        grid.push(vec![
            design.command.clone(),
            number(design.gain, 4),
            shown(design.amplitude),
            format!("{}/s", shown(design.rate)),
        ]);
    }
    let mut text = grid.text();
    text += "\nWith the first, errors in parts of the tolerances' standard deviations:\n\n";
    let mut grid =
        TextTable::new(&[("parameter", Side::Left), ("± 1 σ", Side::Right), ("", Side::Left)]);
    for (k, unknown) in problem.unknowns.iter().enumerate() {
        let sentence = best.known.forecast(&problem.unknowns, k);
        grid.push(vec![unknown.name.clone(), number(best.known.error(k), 2), sentence]);
    }
    text + &grid.text()
}
