//! `servotwin fault-tree`: fault trees with counted probabilities, and the rate of the function.

use super::{function_rate, note, scenario_of};
use crate::Global;
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::render::json;
use serde_json::json;
use servotwin::job::{Among, Folder};
use servotwin_report::words::number;
use servotwin_safety::SafetyError;
use servotwin_safety::fault_tree::FaultTreeArtefact;
use servotwin_safety::function_rate::FunctionRate;
use servotwin_safety::interval::CountedValue;
use servotwin_safety::rated_flights::RatedFlights;
use servotwin_safety::rates::{self, rated_faults};
use servotwin_safety::results::StudyResultsFolder;
use servotwin_safety::tree::numbers::{ExposureHours, TopNumbers};
use std::path::PathBuf;

/// Write fault trees, and compute how often the function fails with the hybrid twin and without.
///
/// The trees are: loss of one lane, loss of both lanes, undetected degradation. The function fails if a fault that
/// needs a shutdown acts without one, or if no actuator is on. Without the twin, either nothing notices a fault until
/// the next check, or two actuators are compared, which does not show the faulty one.
///
/// Failure rates come from your table, and detection, wrong shutdowns and false alarms from the counts in
/// flights.json. The command writes into the folder safety: fault-tree.xml (Open-PSA, with the lower and upper ends
/// in fault-tree-low.xml and fault-tree-high.xml), a figure for each top event, minimal cut sets, importance, all
/// numbers as fault-tree.json, the rates of the function as function-rate.csv, and their sensitivity to every input
/// as function-rate-inputs.csv.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The output folder of a study with judged flights ('servotwin study --suite flights').
    #[arg(value_name = "FOLDER", default_value = "out")]
    folder: PathBuf,
    /// A table of failure rates: fault, rate, unit (1/h, 1/(1e6 h) or FIT), source.
    #[arg(long, value_name = "FILE", required_unless_present = "template")]
    rates: Option<PathBuf>,
    /// Write a table to fill in, a rate and its source for every fault, and nothing else.
    #[arg(long, value_name = "FILE", conflicts_with = "rates")]
    template: Option<PathBuf>,
    /// Duration of a flight, h.
    #[arg(long, value_name = "HOURS", required_unless_present = "template")]
    flight_hours: Option<f64>,
    /// From the report of a fault to its repair, h; 0 if no flight begins with a known fault.
    #[arg(long, value_name = "HOURS", required_unless_present = "template")]
    repair_hours: Option<f64>,
    /// Between two checks that find every hidden fault, h.
    #[arg(long, value_name = "HOURS", required_unless_present = "template")]
    check_hours: Option<f64>,
    /// Between two tests on the ground, h. They find some of the faults that stay hidden in flight, as counted in
    /// FOLDER/ground_test ('servotwin test') [default: there are no tests].
    #[arg(long, value_name = "HOURS")]
    test_hours: Option<f64>,
    /// The scenario whose flights are counted: noise or realistic [default: the most realistic one].
    #[arg(long, value_name = "SCENARIO")]
    scenario: Option<String>,
}

impl Options {
    /// The files that the command reads and writes.
    pub(crate) fn paths(&self) -> Paths {
        let paths = Paths::default().read("--rates", &self.rates);
        paths.write("--template", Format::Only(&["csv"]), &self.template)
    }
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let folder = Folder::new(&options.folder);
    if let Some(path) = &options.template {
        // A table that somebody filled in stays.
        if path.exists() {
            return Err(Failure::Exists(path.clone()));
        }
        let study = folder.read_study()?;
        rates::write_template(path, &rated_faults(&study))?;
        return Ok(format!("{}\n", path.display()));
    }
    let wanted = options.scenario.as_deref().map(scenario_of).transpose()?;
    let results = StudyResultsFolder::open(folder.clone(), wanted)?;
    let (Some(rates), Some(flight_h), Some(repair_h), Some(check_h)) =
        (&options.rates, options.flight_hours, options.repair_hours, options.check_hours)
    else {
        return Err(Failure::Options(
            "--rates, --flight-hours, --repair-hours and --check-hours are needed",
        ));
    };
    let hours = ExposureHours { flight_h, repair_h, check_h, test_h: options.test_hours };
    let flights = RatedFlights::read(&results, rates, hours)?;
    let artefact = FaultTreeArtefact::new(&flights)?;
    let mut notes = artefact.notes.clone();
    let function = match FunctionRate::new(&flights) {
        // The study has fault trees, but no function with a rate.
        Err(SafetyError::Study { problem, .. }) => {
            notes.push(problem.into());
            None
        }
        function => Some(function?),
    };
    let _hold = folder.hold(Among::Nobody)?;
    let mut written = artefact.write(&results)?;
    if let Some(function) = &function {
        written.extend(function.write(&results)?);
        notes.extend(function.notes.clone());
    }
    notes.iter().for_each(|text| note(global, text));
    let files: Vec<String> = written.iter().map(|path| path.display().to_string()).collect();
    Ok(match global {
        Global { json: true, .. } => {
            json(&json!({ "top_events": artefact.tops, "function_rate": function, "files": files }))
        }
        Global { quiet: true, .. } => String::new(),
        _ => {
            let tops: String = artefact.tops.iter().map(text_of).collect();
            let tops = given(hours) + &tops;
            let rates = function.as_ref().map_or_else(String::new, function_rate::text);
            format!("{tops}{rates}{}\n", files.join("\n"))
        }
    })
}

/// The hours that the numbers are for.
fn given(ExposureHours { flight_h, repair_h, check_h, test_h }: ExposureHours) -> String {
    let test = test_h.map_or("no test on the ground".into(), |test_h| {
        format!("a test on the ground every {test_h} h")
    });
    format!("flight {flight_h} h, repair {repair_h} h, check every {check_h} h, {test}\n")
}

/// A counted number with its interval; what was never seen has a bound alone.
pub(crate) fn band(value: CountedValue) -> String {
    match value.point > 0.0 {
        true => format!("{} ({} … {})", number(value.point), number(value.low), number(value.high)),
        false => format!("never seen, at most {}", number(value.high)),
    }
}

/// The numbers of a top event for people.
fn text_of(top: &TopNumbers) -> String {
    let orders: Vec<String> = top
        .cut_set_orders
        .iter()
        .enumerate()
        .filter(|(_, count)| **count > 0)
        .map(|(order, count)| format!("{count} of {} events", order + 1))
        .collect();
    let most = top
        .importances
        .iter()
        .take(3)
        .map(|own| format!("  {:5.1} %  {}\n", 100.0 * own.fussell_vesely, own.title));
    let widest = top.band_drivers.first().map_or(String::new(), |driver| {
        format!("  the band is widest by {} ({})\n", driver.parameter, driver.evidence)
    });
    let begins = top.per_flight_hour.map_or(String::new(), |rate| {
        format!("  begins, per flight hour: {} on average\n", band(rate))
    });
    format!(
        "{}\n  probability: {} on average, {} in the last flight before a check\n{begins}{widest}  minimal cut sets: {}\n{}",
        top.title,
        band(top.mean_probability),
        band(top.probability),
        orders.join(", "),
        most.collect::<String>()
    )
}
