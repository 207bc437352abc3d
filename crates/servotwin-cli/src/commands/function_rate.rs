//! `servotwin function-rate`: how often the function fails, with the hybrid twin and without.

use super::faulttree::band;
use super::{note, scenario_of};
use crate::Global;
use crate::failure::Failure;
use crate::paths::Paths;
use crate::render::json;
use serde_json::json;
use servotwin::job::{Among, Folder};
use servotwin_report::words::number;
use servotwin_safety::function_rate::flight::FunctionFailure;
use servotwin_safety::function_rate::{ConditionRates, FunctionRate};
use servotwin_safety::results::StudyResultsFolder;
use servotwin_safety::tree::numbers::ExposureHours;
use std::path::PathBuf;

/// Compute how often the function fails, with the hybrid twin and without.
///
/// The function fails if a fault that needs a shutdown acts without one, or if no actuator is on. Failure rates come
/// from your table, and what the diagnosis does from the counts in flights.json. Without the twin, either nothing
/// notices a fault until the next check, or two actuators are compared, which does not show the faulty one. The command
/// writes safety/function-rate.csv, and the sensitivity to every input as safety/function-rate-inputs.csv.
#[derive(clap::Args)]
pub(crate) struct Options {
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
    scenario: Option<String>,
}

impl Options {
    /// The files that the command reads.
    pub(crate) fn paths(&self) -> Paths {
        Paths::default().read("--rates", Some(&self.rates))
    }
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let folder = Folder::new(&options.folder);
    let wanted = options.scenario.as_deref().map(scenario_of).transpose()?;
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
    let mut text = "the function: failures that begin per flight hour, and flights in which it is failed, also by a fault \
                    that was hidden before\n"
        .to_owned();
    for own in &found.conditions {
        text += &condition(own);
    }
    text += "relative change of the flights with a failed function per relative change of an input, with the twin\n";
    for own in found.sensitivities.iter().take(6) {
        text += &format!("  {:+.3}  {} ({})\n", own.elasticity, own.input, own.evidence);
    }
    text
}

fn condition(own: &ConditionRates) -> String {
    let row = |name: &str, rates: FunctionFailure| {
        format!(
            "    {name}: begins {}/h ({}); failed in {} of flights ({})\n",
            number(rates.begins_per_h),
            beside_twin(rates.begins_per_h, own.twin_begins_per_h.point),
            number(rates.failed),
            beside_twin(rates.failed, own.twin_failed.point)
        )
    };
    // With one actuator, a shutdown ends the function too; then the twin changes this part alone.
    let uncontained = || {
        format!(
            "    without a shutdown: in {} of flights with the twin, in {} without\n",
            band(own.twin_uncontained),
            number(own.nobody.uncontained)
        )
    };
    let comparison = own.comparison.map(|rates| row("comparison of two actuators", rates));
    format!(
        "  {}\n    hybrid twin: begins {}/h; failed in {} of flights\n{}{}{}",
        own.condition,
        band(own.twin_begins_per_h),
        band(own.twin_failed),
        row("no monitoring", own.nobody),
        comparison.unwrap_or_else(uncontained),
        own.comparison.and_then(|rates| order(own, rates)).unwrap_or_default()
    )
}

/// A number beside that of the twin.
fn beside_twin(value: f64, twin: f64) -> String {
    match (twin > 0.0, value > 0.0) {
        (true, _) => format!("{} times the twin's", number(value / twin)),
        (false, true) => "the twin's is 0".into(),
        (false, false) => "as with the twin".into(),
    }
}

/// What readers must know where the two numbers prefer different monitoring.
fn order(own: &ConditionRates, comparison: FunctionFailure) -> Option<String> {
    let fewer_begin = own.twin_begins_per_h.point < comparison.begins_per_h;
    let fewer_failed = own.twin_failed.point < comparison.failed;
    (fewer_begin != fewer_failed).then(|| {
        let [begin, failed] = [fewer_begin, fewer_failed].map(|of_twin| match of_twin {
            true => "the twin",
            false => "the comparison",
        });
        format!(
            "    the numbers disagree: fewer failures begin with {begin}, and fewer flights have a failed function with \
             {failed}, because faults stay hidden until the check\n"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_twin_that_never_fails_gives_no_quotient() {
        assert_eq!(beside_twin(0.0, 0.0), "as with the twin");
        assert_eq!(beside_twin(1e-6, 0.0), "the twin's is 0");
        assert_eq!(beside_twin(3e-6, 1.5e-6), "2.00 times the twin's");
    }
}
