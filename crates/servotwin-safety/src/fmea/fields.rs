//! The fields of the sheet: one line in [`FIELDS`] and one function each.

use super::cell::{Filled, FmeaCell};
use super::flights::FmeaFlights;
use super::residuals::ResidualRuns;
use super::{declared, diagnosis, effects};
use crate::rates::FailureRates;
use crate::results::StudyResultsFolder;
use servotwin::measure::outcome::RunOutcome;
use servotwin::study::{FaultCase, Study};
use servotwin::system::ListedFault;

/// Everything that cells are filled from.
pub struct FmeaSources<'s> {
    /// The study, and through it the system.
    pub(crate) study: &'s Study,
    /// The output folder; `None` for a study without results.
    pub(crate) results: Option<&'s StudyResultsFolder>,
    /// The records.
    pub(crate) runs: Option<ResidualRuns>,
    /// The closed-loop flights.
    pub(crate) flights: Option<FmeaFlights>,
    /// The judged tests on the ground; none if there are none.
    pub(crate) tests: Vec<RunOutcome>,
    /// The user's failure rates.
    pub(crate) rates: Option<FailureRates>,
}

/// A row of the sheet: a fault of the system.
pub(crate) struct FmeaSubject<'s> {
    /// The fault as the catalogue declares it.
    pub(crate) fault: &'s ListedFault,
    /// The fault in the study; `None` if no class lists it.
    pub(crate) case: Option<&'s FaultCase>,
    /// The fault without its actuator.
    pub(crate) kind: &'s str,
}

impl<'s> FmeaSubject<'s> {
    /// The row of a fault.
    pub(crate) fn of(study: &'s Study, fault: &'s ListedFault) -> Self {
        let case = study.faults.iter().find(|case| case.id == fault.id);
        FmeaSubject { fault, case, kind: study.kind_of(&fault.id) }
    }
}

/// A field of the sheet.
pub struct FmeaField {
    /// The column's name.
    pub name: &'static str,
    /// Fills the cell.
    pub(crate) fill: fn(&FmeaSources, &FmeaSubject) -> Filled,
}

const fn field(name: &'static str, fill: fn(&FmeaSources, &FmeaSubject) -> Filled) -> FmeaField {
    FmeaField { name, fill }
}

/// All fields, in the order of the sheet. A new field goes to the end of its group; the version of the seal then grows.
pub const FIELDS: [FmeaField; 18] = [
    field("actuator", declared::actuator),
    field("component", declared::component),
    field("fault_mode", declared::fault_mode),
    field("physical_range", declared::range),
    field("local_effect", diagnosis::local_effect),
    field("effect_on_actuator", effects::on_actuator),
    field("effect_on_system", effects::on_system),
    field("detection_means", diagnosis::means),
    field("detection_latency", diagnosis::latency),
    field("smallest_detectable", diagnosis::smallest),
    field("isolation", diagnosis::isolation),
    field("confused_with", diagnosis::confused_with),
    field("action", declared::action),
    field("severity", effects::severity),
    field("failure_rate_per_h", declared::failure_rate),
    field("failure_rate_source", declared::failure_rate_source),
    field("diagnostic_coverage", diagnosis::coverage),
    field("remarks", declared::remarks),
];

/// A row with its cells, in the order of [`FIELDS`].
#[derive(Debug, Clone, PartialEq)]
pub struct FmeaRow {
    /// The fault's full name.
    pub fault: String,
    /// One cell per field.
    pub cells: Vec<FmeaCell>,
}

/// Fills the rows of all faults of the system: first those that the study lists, then the others, both in the order of
/// the components.
pub(crate) fn rows(sources: &FmeaSources) -> Vec<FmeaRow> {
    let study = sources.study;
    let list = study.system.fault_list();
    let row = |fault: &ListedFault| {
        let subject = FmeaSubject::of(study, fault);
        let cells = FIELDS.iter().map(|field| (field.fill)(sources, &subject));
        let cells = cells.map(|filled| filled.unwrap_or_else(|missing| missing)).collect();
        FmeaRow { fault: fault.id.clone(), cells }
    };
    let (listed, others): (Vec<&ListedFault>, Vec<&ListedFault>) =
        list.iter().partition(|fault| study.faults.iter().any(|case| case.id == fault.id));
    listed.into_iter().chain(others).map(row).collect()
}

/// What a cell shows for a fault that no class of the study lists.
pub(crate) fn not_in_study(what: &str) -> FmeaCell {
    FmeaCell::missing(what, "no class of the study lists this fault")
}
