//! `servotwin function-rate`: the failure rate of the function, with the hybrid twin and without.

use super::{note, setting_of};
use crate::Global;
use crate::failure::Failure;
use crate::paths::Paths;
use crate::render::json;
use serde_json::json;
use servotwin::job::{Among, Folder};
use servotwin_report::words::number;
use servotwin_safety::function_rate::flight::FunctionFailure;
use servotwin_safety::function_rate::{ConditionRates, FunctionRate};
use servotwin_safety::interval::CountedValue;
use servotwin_safety::results::StudyResultsFolder;
use servotwin_safety::tree::numbers::ExposureHours;
use std::path::PathBuf;

/// Compute how often the function fails per flight hour, with the hybrid twin and without.
///
/// The function fails if a fault that needs a shutdown acts without one, or if no actuator is on. Failure rates come
/// from your table, and what the diagnosis does from the counts in flights.json. Without the twin, either nothing
/// notices a fault until the next check, or two actuators are compared, which does not show the faulty one. The command
/// writes safety/function-rate.csv, and the sensitivity to every input as safety/function-rate-inputs.csv.
#[derive(clap::Args)]
pub struct Options {
    /// The output folder of a study with judged flights ('servotwin flights').
    #[arg(value_name = "FOLDER", default_value = "out")]
    folder: PathBuf,
    /// A table of failure rates ('servotwin faulttree --template FILE' writes one to fill in).
    #[arg(long, value_name = "FILE")]
    rates: PathBuf,
    /// Duration of a flight, h.
    #[arg(long, value_name = "HOURS")]
    flight_hours: f64,
    /// From the report of a fault to its repair, h; 0 if no flight begins with a known fault.
    #[arg(long, value_name = "HOURS")]
    repair_hours: f64,
    /// Between two checks that find every hidden fault, h.
    #[arg(long, value_name = "HOURS")]
    check_hours: f64,
    /// The scenario whose flights are counted: noise or realistic [default: the most realistic one].
    #[arg(long, value_name = "SCENARIO")]
    setting: Option<String>,
}

impl Options {
    /// The files that the command reads.
    pub fn paths(&self) -> Paths {
        Paths::default().read("--rates", Some(&self.rates))
    }
}

/// Returns the text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let folder = Folder::new(&options.folder);
    let wanted = options.setting.as_deref().map(setting_of).transpose()?;
    let results = StudyResultsFolder::open(folder.clone(), wanted)?;
    let Options { flight_hours, repair_hours, check_hours, .. } = *options;
    let hours =
        ExposureHours { flight_h: flight_hours, repair_h: repair_hours, check_h: check_hours };
    let found = FunctionRate::new(&results, &options.rates, hours)?;
    let _hold = folder.hold(Among::Nobody)?;
    let written = found.write(&results)?;
    for text in &found.notes {
        note(global, text);
    }
    let files: Vec<String> = written.iter().map(|path| path.display().to_string()).collect();
    Ok(match global {
        Global { json: true, .. } => json(&json!({ "function_rate": found, "files": files })),
        Global { quiet: true, .. } => String::new(),
        _ => format!("{}{}\n", text_of(&found), files.join("\n")),
    })
}

fn text_of(found: &FunctionRate) -> String {
    let mut text = "failures of the function per flight hour\n".to_owned();
    for own in &found.conditions {
        text += &condition(own);
    }
    text += "relative change of the rate with the twin per relative change of an input\n";
    for own in found.sensitivities.iter().take(6) {
        text += &format!("  {:+.3}  {} ({})\n", own.elasticity, own.input, own.evidence);
    }
    text
}

fn condition(own: &ConditionRates) -> String {
    let band = |value: CountedValue| {
        format!("{} ({} … {})", number(value.point), number(value.low), number(value.high))
    };
    let row = |name: &str, rates: FunctionFailure| {
        format!(
            "    {name}: {}, {} times that; begins {}\n",
            number(rates.failure),
            number(rates.failure / own.twin.point),
            number(rates.begins)
        )
    };
    // With one actuator, a shutdown ends the function too; then the twin changes this part alone.
    let uncontained = || {
        format!(
            "    without a shutdown: {} with the twin, {} without\n",
            band(own.twin_uncontained),
            number(own.nobody.uncontained)
        )
    };
    let comparison = own.comparison.map(|rates| row("comparison of two actuators", rates));
    format!(
        "  {}\n    hybrid twin: {}; begins {}\n{}{}",
        own.condition,
        band(own.twin),
        band(own.twin_begins),
        row("no monitoring", own.nobody),
        comparison.unwrap_or_else(uncontained)
    )
}
