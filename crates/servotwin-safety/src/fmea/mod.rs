//! The artefact *FMEA*: one row per fault of the system, every cell with its evidence.
//!
//! - [`fields`]: the columns, and what fills them
//! - [`residuals`]: runs of the campaign, by fault
//! - [`flights`]: closed-loop flights, with the diagnosis and without it
//! - [`severity`]: the stated rule
//! - [`mod@sheet`]: what people filled in, and how it survives
//! - [`mod@format`]: CSV and XLSX

pub mod cell;
mod declared;
mod diagnosis;
mod effects;
pub mod fields;
pub mod flights;
pub mod format;
pub mod residuals;
pub mod severity;
pub mod sheet;

use crate::error::SafetyError;
use crate::rates::{FailureRates, RatedFault};
use crate::results::{EvidenceBasis, StudyResultsFolder};
use fields::{FmeaSources, FmeaSubject, rows};
use flights::{FlightPlan, FmeaFlights};
use residuals::ResidualRuns;
use servotwin::parallel::Workers;
use servotwin::study::Study;
use sheet::FmeaSheet;
use std::path::Path;

/// Whether faults are flown for the sheet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FlyFaults {
    /// Those of the study, where there is a diagnoser and their flights are missing or of another model.
    Listed,
    /// All of the system, likewise.
    All,
    /// Never: stored flights are used as they are.
    Never,
}

/// The names that rates of a system may have: all of its faults.
pub fn rated_faults(study: &Study) -> Vec<RatedFault> {
    let names = study.system.all_faults().into_iter();
    names.map(|id| RatedFault { kind: fields::kind_of(study, &id), id }).collect()
}

/// The sources of the sheet of a folder with results.
///
/// # Errors
/// A file is missing or damaged; a flight cannot be simulated; a rate is wrong.
pub fn sources<'s>(
    results: &'s StudyResultsFolder,
    rates: Option<&Path>,
    fly: FlyFaults,
    workers: Workers,
) -> Result<FmeaSources<'s>, SafetyError> {
    Ok(FmeaSources {
        study: &results.study,
        rates: read_rates(&results.study, rates)?,
        runs: ResidualRuns::read(results)?,
        flights: flown(results, fly, workers)?,
        results: Some(results),
    })
}

/// The sources of the sheet of a study without results: declarations and rates.
///
/// # Errors
/// A rate is wrong.
pub fn declared_sources<'s>(
    study: &'s Study,
    rates: Option<&Path>,
) -> Result<FmeaSources<'s>, SafetyError> {
    let rates = read_rates(study, rates)?;
    Ok(FmeaSources { study, results: None, runs: None, flights: None, rates })
}

fn read_rates(study: &Study, path: Option<&Path>) -> Result<Option<FailureRates>, SafetyError> {
    path.map(|path| FailureRates::read(path, &rated_faults(study))).transpose()
}

/// Whether a folder has a diagnoser to fly with in the quoted scenario.
pub fn can_fly(results: &StudyResultsFolder) -> bool {
    results.flown_setting().is_ok_and(|setting| results.folder.diagnoser(setting).exists())
}

fn flown(
    results: &StudyResultsFolder,
    fly: FlyFaults,
    workers: Workers,
) -> Result<Option<FmeaFlights>, SafetyError> {
    let stored = FmeaFlights::read(results)?;
    let study = &results.study;
    let faults = match fly {
        FlyFaults::Never => vec![],
        FlyFaults::Listed => listed_faults(study),
        FlyFaults::All => study.system.all_faults(),
    };
    let is_enough = |stored: &FmeaFlights| stored.stale.is_none() && stored.covers(&faults);
    let is_current = stored.as_ref().is_some_and(is_enough);
    if is_current || fly == FlyFaults::Never || !can_fly(results) {
        return Ok(stored);
    }
    Ok(Some(FmeaFlights::fly(results, &FlightPlan::of(study)?, &faults, workers)?))
}

/// The faults that the study lists, each once.
fn listed_faults(study: &Study) -> Vec<String> {
    let mut list: Vec<String> = vec![];
    for fault in &study.faults {
        if list.last() != Some(&fault.id) {
            list.push(fault.id.clone());
        }
    }
    list
}

/// Makes the sheet, with the cells that people filled into an earlier one.
///
/// # Errors
/// The earlier sheet cannot be understood.
pub fn sheet(sources: &FmeaSources, earlier: Option<&Path>) -> Result<FmeaSheet, SafetyError> {
    let basis = match sources.results {
        Some(results) => results.basis.clone(),
        None => EvidenceBasis::of_study(sources.study),
    };
    let texts = earlier.map(format::read).transpose()?;
    FmeaSheet::new(&rows(sources), &basis, earlier.zip(texts.as_ref()))
}

/// The diagnostic coverage of all rated faults.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WeightedCoverage {
    /// Σ λ · coverage / Σ λ over the flown faults, as IEC 61508-2 weighs it.
    pub share: f64,
    /// Number of rated faults that were flown.
    pub flown: usize,
    /// Number of rated faults.
    pub rated: usize,
}

/// Weighs the diagnostic coverage by the user's rates; `None` without rates or without flights.
pub fn weighted_coverage(sources: &FmeaSources) -> Option<WeightedCoverage> {
    let rates = sources.rates.as_ref()?;
    let (mut covered, mut all, mut flown, mut rated) = (0.0, 0.0, 0, 0);
    for fault in &sources.study.system.fault_list() {
        let subject = FmeaSubject::of(sources.study, fault);
        let name = RatedFault { id: fault.id.clone(), kind: subject.kind.clone() };
        let Some(rate) = rates.of(&name) else { continue };
        rated += 1;
        if let Some(share) = diagnosis::coverage_share(sources, &subject) {
            flown += 1;
            covered += rate.per_h * share;
            all += rate.per_h;
        }
    }
    (all > 0.0).then(|| WeightedCoverage { share: covered / all, flown, rated })
}

#[cfg(test)]
mod tests {
    use super::fields::FIELDS;
    use super::*;

    fn cell(sheet: &FmeaSheet, fault: &str, name: &str) -> String {
        let place = FIELDS.iter().position(|field| field.name == name).unwrap();
        let row = sheet.rows.iter().find(|row| row.fault == fault).unwrap();
        row.texts[place].clone()
    }

    #[test]
    fn every_fault_of_every_shipped_system_has_a_row_whose_filled_cells_name_their_evidence() {
        for (name, text) in servotwin::built_in::STUDIES {
            let study = Study::parse(text, name).unwrap();
            let sheet = sheet(&declared_sources(&study, None).unwrap(), None).unwrap();
            assert_eq!(sheet.rows.len(), study.system.all_faults().len(), "{name}");
            for row in &sheet.rows {
                for ((text, evidence), field) in row.texts.iter().zip(&row.evidence).zip(&FIELDS) {
                    let is_rate = field.name.starts_with("failure_rate") || field.name == "remarks";
                    assert_eq!(text.is_empty(), is_rate, "{name} {} {}", row.fault, field.name);
                    assert_eq!(
                        text.is_empty(),
                        evidence.is_empty(),
                        "{name} {} {}",
                        row.fault,
                        field.name
                    );
                }
            }
        }
    }

    #[test]
    fn declarations_fill_ranges_and_actions_and_nothing_else_is_invented() {
        let study = Study::default();
        let sheet = sheet(&declared_sources(&study, None).unwrap(), None).unwrap();
        let fault = "actuator_2.servo_valve.clogging_pa";
        assert_eq!(cell(&sheet, fault, "actuator"), "actuator 2");
        let range = cell(&sheet, fault, "physical_range");
        assert!(range.starts_with("width_pa_m: 2.38 mm … 0.119 mm"), "{range}");
        assert!(cell(&sheet, fault, "action").starts_with("shut down: switches the actuator off"));
        assert_eq!(
            cell(&sheet, fault, "severity"),
            "at least S3 if the action is raised (not flown): 1 of 2 lanes switched off"
        );
        assert_eq!(cell(&sheet, fault, "local_effect"), "not simulated");
        for name in ["effect_on_system", "isolation", "diagnostic_coverage"] {
            assert_eq!(cell(&sheet, fault, name), "not flown");
        }
        // The machine's only lane is its function.
        let press = Study::parse(servotwin::built_in::STUDIES[2].1, "press_axis").unwrap();
        let sheet = super::sheet(&declared_sources(&press, None).unwrap(), None).unwrap();
        assert_eq!(
            cell(&sheet, "valve.clogging_pa", "severity"),
            "at least S4 if the action is raised (not flown): no lane is left"
        );
        assert_eq!(cell(&sheet, "valve.clogging_pa", "actuator"), "the only one");
    }
}
