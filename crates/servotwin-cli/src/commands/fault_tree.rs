//! `servotwin fault-tree`: fault trees with counted probabilities, and the rate of the function.

use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::{Global, Run};
use servotwin::job::{Among, Folder};
use servotwin::study::Scenario;
use servotwin::text::three_digits;
use servotwin_safety::SafetyError;
use servotwin_safety::fault_tree::FaultTreeArtefact;
use servotwin_safety::function_rate::flight::FunctionFailure;
use servotwin_safety::function_rate::{ConditionRates, FunctionRate};
use servotwin_safety::interval::CountedValue;
use servotwin_safety::rated_flights::RatedFlights;
use servotwin_safety::rates;
use servotwin_safety::results::StudyResultsFolder;
use servotwin_safety::tree::numbers::{ExposureHours, TopNumbers};
use servotwin_view::document::{Document, Table, Value, Verdict, fact, line};
use servotwin_view::row;
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
    #[arg(long, value_name = "SCENARIO", value_parser = super::scenario())]
    scenario: Option<Scenario>,
}

impl Run for Options {
    fn paths(&self) -> Paths {
        let paths = Paths::default().read("--rates", &self.rates);
        paths.write("--template", Format::Only(&["csv"]), &self.template)
    }

    fn run(&self, _: Global) -> Result<Document, Failure> {
        let folder = Folder::new(&self.folder);
        if let Some(path) = &self.template {
            Failure::if_exists(path)?;
            rates::write_template(path, &folder.read_study()?)?;
            let verdict = line("{template}: fill in the rates", [("template", path.into())]);
            return Ok(Document::new("fault-tree", Verdict::good(verdict)));
        }
        let results = StudyResultsFolder::open(folder.clone(), self.scenario)?;
        let (Some(rates), Some(flight_h), Some(repair_h), Some(check_h)) =
            (&self.rates, self.flight_hours, self.repair_hours, self.check_hours)
        else {
            return Err(Failure::usage(
                "--rates, --flight-hours, --repair-hours and --check-hours are needed",
            ));
        };
        let hours = ExposureHours { flight_h, repair_h, check_h, test_h: self.test_hours };
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
        let mut document = described(&artefact.tops, function.as_ref(), hours);
        notes.into_iter().for_each(|text| _ = document.note(text));
        document.files(written).detail();
        Ok(document)
    }
}

/// How often the function fails, and the numbers of the top events.
fn described(
    tops: &[TopNumbers],
    function: Option<&FunctionRate>,
    hours: ExposureHours,
) -> Document {
    let as_counted = function.and_then(|function| function.conditions.first());
    let verdict = match as_counted {
        Some(own) => line(
            "With the hybrid twin the function begins to fail {begins_per_h} times per flight hour, and is failed in \
             {failed} of flights.",
            [
                ("begins_per_h", counted(own.twin_begins_per_h)),
                ("failed", counted(own.twin_failed)),
            ],
        ),
        None => "The fault trees are written.".into(),
    };
    let mut document = Document::new("fault-tree", Verdict::neutral(verdict));
    let test = hours.test_h.map_or("none".into(), |test_h| format!("every {test_h} h"));
    let every = |hours: f64| Value::number(hours, format!("{hours} h"));
    document.facts(
        "exposure",
        [
            fact("flight_h", "flight", every(hours.flight_h)),
            fact("repair_h", "repair", every(hours.repair_h)),
            fact("check_h", "between checks", every(hours.check_h)),
            fact("test_h", "tests on the ground", Value::of(test, &hours.test_h)),
        ],
    );
    let mut table = Table::of(
        ":top event | :probability, on average | :in the last flight | :begins, per flight hour | :minimal cut sets",
    );
    for top in tops {
        let orders = top.cut_set_orders.iter().enumerate().filter(|(_, count)| **count > 0);
        let orders = orders.map(|(order, count)| format!("{count} of {} events", order + 1));
        table.push(row![
            &top.title,
            counted(top.mean_probability),
            counted(top.probability),
            top.per_flight_hour.map(counted),
            orders.collect::<Vec<_>>().join(", "),
        ]);
    }
    document.table("", table);
    if let Some(function) = function {
        function_rates(function, &mut document);
    }
    document.table("", importances(tops)).detail();
    document.data("top_events", &tops);
    document.data("function_rate", &function);
    document
}

/// What contributes most to each top event, and what widens its band.
fn importances(tops: &[TopNumbers]) -> Table {
    let mut table = Table::of(":top event | :share | :event");
    for top in tops {
        for own in top.importances.iter().take(3) {
            table.push(row![&top.title, Value::percent(own.fussell_vesely, 1), &own.title]);
        }
        if let Some(driver) = top.band_drivers.first() {
            let widest = format!("{} ({})", driver.parameter, driver.evidence);
            table.push(row![&top.title, "widest band", widest]);
        }
    }
    table
}

/// A counted number with its interval; what was never seen has a bound alone.
fn counted(value: CountedValue) -> Value {
    let text = match value.point > 0.0 {
        true => format!(
            "{} ({} … {})",
            three_digits(value.point),
            three_digits(value.low),
            three_digits(value.high)
        ),
        false => format!("never seen, at most {}", three_digits(value.high)),
    };
    Value::of(text, &value)
}

/// How often the function fails, with the hybrid twin and without.
fn function_rates(function: &FunctionRate, document: &mut Document) {
    let mut table =
        Table::of(":the function fails | :monitoring | :begins, per flight hour | :failed flights");
    let mut disagreeing = vec![];
    for own in &function.conditions {
        let (begins, failed) = (counted(own.twin_begins_per_h), counted(own.twin_failed));
        table.push(row![&own.condition, "hybrid twin", begins, failed]);
        let others = [("none", Some(own.nobody)), ("comparison of two", own.comparison)];
        for (name, rates) in others {
            let Some(FunctionFailure { begins_per_h, failed, .. }) = rates else { continue };
            let begins = beside_twin(begins_per_h, own.twin_begins_per_h.point);
            table.push(row!["", name, begins, beside_twin(failed, own.twin_failed.point)]);
        }
        // With one actuator, a shutdown ends the function too; then the twin changes this part alone.
        if own.comparison.is_none() {
            let (twin, nobody) =
                (counted(own.twin_uncontained), three_digits(own.nobody.uncontained));
            table.push(row!["  without a shutdown", "hybrid twin", "", twin]);
            table.push(row!["", "none", "", nobody]);
        }
        disagreeing.extend(is_ambiguous(own).then_some(own.condition.as_str()));
    }
    document.table("", table);
    if !disagreeing.is_empty() {
        document.note(format!(
            "the two numbers prefer different monitoring, because faults stay hidden until the check: {}",
            disagreeing.join("; ")
        ));
    }
    let mut inputs = Table::of(":relative change | :input | :evidence").captioned(
        "Flights with a failed function, per relative change of an input, with the twin",
    );
    for own in function.sensitivities.iter().take(6) {
        let change = Value::number(own.elasticity, format!("{:+.3}", own.elasticity));
        inputs.push(row![change, &own.input, &own.evidence]);
    }
    document.table("", inputs).detail();
}

/// A number beside that of the twin.
fn beside_twin(value: f64, twin: f64) -> String {
    let beside = match (twin > 0.0, value > 0.0) {
        (true, _) => format!("{} times the twin's", three_digits(value / twin)),
        (false, true) => "the twin's is 0".into(),
        (false, false) => "as with the twin".into(),
    };
    format!("{} ({beside})", three_digits(value))
}

/// Whether fewer failures begin with one monitoring, and fewer flights have a failed function with the other.
fn is_ambiguous(own: &ConditionRates) -> bool {
    own.comparison.is_some_and(|comparison| {
        let fewer_begin = own.twin_begins_per_h.point < comparison.begins_per_h;
        let fewer_failed = own.twin_failed.point < comparison.failed;
        fewer_begin != fewer_failed
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_twin_that_never_fails_gives_no_quotient() {
        assert_eq!(beside_twin(0.0, 0.0), "0 (as with the twin)");
        assert_eq!(beside_twin(1e-6, 0.0), "1.00e-6 (the twin's is 0)");
        assert_eq!(beside_twin(3e-6, 1.5e-6), "3.00e-6 (2.00 times the twin's)");
    }
}
