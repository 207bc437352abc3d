//! `servotwin fit --design`: finds the command that determines the parameters best.

use super::{POSITIVE, quantity};
use crate::failure::Failure;
use servotwin::fit::Fit;
use servotwin::fit::design::{self, Design};
use servotwin::study::Study;
use servotwin::text::number;
use servotwin_model::spec::Unit;
use servotwin_view::document::{Document, Table, Value, Verdict, line};
use servotwin_view::row;

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

/// Finds the best commands within the limits.
pub(crate) fn run(
    limits: &AllowedCommand,
    problem: &Fit,
    study: &Study,
) -> Result<Document, Failure> {
    let unit = study.system.network().inputs[study.command_input].unit;
    let rate = match unit {
        Unit::Radian => Unit::RadianPerSecond,
        Unit::Metre => Unit::MetrePerSecond,
        // Other rates have no unit here and are plain numbers.
        _ => Unit::None,
    };
    let positive = |option, text, unit| quantity(option, text, unit, POSITIVE, "greater than 0");
    let limits = design::Limits {
        amplitude: positive("--amplitude", &limits.amplitude, unit)?,
        rate: positive("--rate", &limits.rate, rate)?,
        duration_s: {
            let range = "5 s to 3600 s";
            quantity("--duration", &limits.duration, Unit::Second, 5.0..=3600.0, range)?
        },
    };
    let found = problem.design(study, limits)?;
    let Some(best) = found.first() else {
        return Err(Failure::usage("no signal of the catalogue keeps these limits"));
    };
    Ok(described(&found, best, problem, unit))
}

fn described(found: &[Design], best: &Design, problem: &Fit, unit: Unit) -> Document {
    let command = line("{command}", [("command", best.command.text.as_str().into())]);
    let mut document = Document::listing("design", "");
    document.verdict = Some(Verdict::neutral(command));
    let mut commands =
        Table::of("command | gain_bits:gain, bits | amplitude:size | rate | error_sigmas:");
    for design in found {
        let command = &design.command;
        let rate = Value::difference(command.rate, unit, 3);
        let errors: Vec<f64> = (0..problem.unknowns.len()).map(|k| design.known.error(k)).collect();
        commands.push(row![
            &command.text,
            Value::digits(design.gain, 4),
            Value { suffix: unit.suffix(), ..Value::difference(command.amplitude, unit, 3) },
            Value { text: format!("{}/s", rate.text), ..rate },
            Value::of("", &errors),
        ]);
    }
    document.table("commands", commands);
    let mut parameters = Table::of("name:parameter | error_sigma:± 1 σ | knowledge:_")
        .captioned("With the first, errors in parts of the tolerances' standard deviations");
    for (k, unknown) in problem.unknowns.iter().enumerate() {
        let error = best.known.error(k);
        let error = Value::number(error, number(error, 2));
        parameters.push(row![
            &unknown.name,
            error,
            best.known.sentence("flight", &problem.unknowns, k)
        ]);
    }
    document.table("parameters", parameters);
    document
}
