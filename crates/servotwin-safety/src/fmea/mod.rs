//! The artefact *FMEA*: one row per fault of the system, every cell with its evidence.
//!
//! - [`fields`]: the columns, and what fills them
//! - [`residuals`]: runs of the campaign, by fault
//! - [`flights`]: closed-loop flights, with the diagnosis and without it
//! - [`severity`]: the stated rule
//! - [`sheet`]: what people filled in, and how it survives
//! - [`format`]: CSV and XLSX

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
use fields::{FmeaSources, rows};
use flights::{FlightPlan, FmeaFlights};
use residuals::ResidualRuns;
use servotwin::parallel::Workers;
use servotwin::study::Study;
use sheet::FmeaSheet;
use std::path::Path;

/// Whether faults are flown for the sheet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FlyFaults {
    /// Where there is a diagnoser and its flights are missing or of another model.
    IfNeeded,
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
        runs: Some(ResidualRuns::read(results)?),
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

/// Whether a folder has a diagnoser to fly with.
pub fn can_fly(results: &StudyResultsFolder) -> bool {
    results.folder.diagnoser(results.flown_setting()).exists()
}

fn flown(
    results: &StudyResultsFolder,
    fly: FlyFaults,
    workers: Workers,
) -> Result<Option<FmeaFlights>, SafetyError> {
    let stored = FmeaFlights::read(results)?;
    let is_current = stored.as_ref().is_some_and(|stored| stored.stale.is_none());
    if is_current || fly == FlyFaults::Never || !can_fly(results) {
        return Ok(stored);
    }
    Ok(Some(FmeaFlights::fly(results, &FlightPlan::default(), workers)?))
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

/// The diagnostic coverage over all faults with a rate: Σ λ · detected share / Σ λ, as IEC 61508-2 weighs it.
pub fn weighted_coverage(sources: &FmeaSources) -> Option<f64> {
    let rates = sources.rates.as_ref()?;
    let (mut detected, mut all) = (0.0, 0.0);
    for fault in rated_faults(sources.study) {
        let known = rates.of(&fault).zip(diagnosis::detected_share(sources, &fault.id));
        if let Some((rate, share)) = known {
            detected += rate.per_h * share;
            all += rate.per_h;
        }
    }
    (all > 0.0).then(|| detected / all)
}
