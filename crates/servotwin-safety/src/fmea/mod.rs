//! The artefact *FMEA*: one row per fault of the system, every cell with its evidence.
//!
//! - [`fields`]: the columns, and what fills them
//! - `residuals`: records, by fault
//! - `flights`: outcomes of closed-loop flights, with the diagnosis and without it
//! - [`severity`]: the stated rule
//! - [`mod@sheet`]: what people filled in, and how it survives

pub mod cell;
mod declared;
mod diagnosis;
mod effects;
pub mod fields;
pub(crate) mod flights;
pub(crate) mod residuals;
pub mod severity;
pub mod sheet;

use crate::counts;
use crate::error::SafetyError;
use crate::rates::FailureRates;
use crate::results::{EvidenceBasis, StudyResultsFolder};
use fields::{FmeaSources, FmeaSubject, rows};
use flights::FmeaFlights;
use residuals::ResidualRuns;
use servotwin::parallel::Workers;
use servotwin::study::Study;
use servotwin::table::csv::texts;
use sheet::FmeaSheet;
use std::path::Path;

/// The sources of the sheet of a folder with results. If it `flies`, flights that are missing or of another basis are
/// flown where there is a diagnoser; else stored flights are used as they are.
///
/// # Errors
/// A file is missing or damaged; a flight cannot be simulated; a rate is wrong.
pub fn sources<'s>(
    results: &'s StudyResultsFolder,
    rates: Option<&Path>,
    flies: bool,
    workers: Workers,
) -> Result<FmeaSources<'s>, SafetyError> {
    Ok(FmeaSources {
        study: &results.study,
        rates: read_rates(&results.study, rates)?,
        runs: ResidualRuns::read(results)?,
        flights: FmeaFlights::of_folder(results, flies, workers)?,
        tests: counts::tests(results)?,
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
    Ok(FmeaSources { study, results: None, runs: None, flights: None, tests: vec![], rates })
}

fn read_rates(study: &Study, path: Option<&Path>) -> Result<Option<FailureRates>, SafetyError> {
    path.map(|path| FailureRates::read(path, study)).transpose()
}

/// Whether a folder has a diagnoser to fly with in the quoted scenario.
pub fn can_fly(results: &StudyResultsFolder) -> bool {
    results.flown_setting().is_ok_and(|scenario| results.folder.diagnoser(scenario).exists())
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
    let texts = earlier.map(texts::read).transpose()?;
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
        let Some(rate) = rates.of(&fault.id, subject.kind) else { continue };
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
    use servotwin::measure::outcome::{RunOutcome, Word};

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
    fn a_row_of_a_fault_that_no_class_lists_follows_from_its_flights() {
        let study = Study::default();
        let fault = "actuator_1.servo_valve.gain_low";
        let unlisted = "actuator_1.servo_valve.wear_pa";
        assert!(study.faults.iter().all(|case| case.id != unlisted));
        let healthy = RunOutcome { is_finished: true, ..RunOutcome::default() };
        let of_fault = |fault: &str, intensity| RunOutcome {
            event: fault.into(),
            intensity,
            onset_s: Some(7.0),
            ..healthy.clone()
        };
        let shut_down = |fault: &str| RunOutcome {
            word: Word::Actuator,
            first_word_s: Some(0.5),
            first_action: "shut_down".into(),
            first_actuator: "actuator_1".into(),
            first_action_s: Some(0.7),
            switched_off: "actuator_1".into(),
            travel_difference_m: Some(0.0),
            ..of_fault(fault, 1.0)
        };
        let silent = RunOutcome {
            // What a solver's steps differ by.
            travel_difference_m: Some(6e-10),
            force_difference_n: Some(5e-3),
            ..of_fault(unlisted, 0.5)
        };
        let outcomes = vec![silent, shut_down(unlisted), shut_down(fault), healthy.clone()];
        let (case, scenario) = ("S1/50".into(), "realistic".into());
        let flights = Some(FmeaFlights { outcomes, case, scenario, stale: None });
        let in_test = |intensity, word| RunOutcome { word, ..of_fault(unlisted, intensity) };
        let tests = vec![
            in_test(0.3, Word::Healthy),
            in_test(0.6, Word::Unknown),
            in_test(1.0, Word::Actuator),
        ];
        let sources = FmeaSources { flights, tests, ..declared_sources(&study, None).unwrap() };
        let sheet = sheet(&sources, None).unwrap();
        for (field, text) in [
            ("local_effect", "not in the records"),
            ("effect_on_actuator", "does not differ from the healthy flight (intensities 0.5, 1)"),
            (
                "detection_means",
                "reported in 1 of 2 own flights (intensity 1); reported in 2 of 3 tests on the ground (intensity 0.6, 1)",
            ),
            (
                "detection_latency",
                "reported after 0.5 s in 1 of 2 own flights; action after 0.7 s in 1 of 2 own flights",
            ),
            ("smallest_detectable", "reported in 1 of 2 own flights (intensity 1)"),
            ("isolation", "no right action to compare with"),
            (
                "action",
                "no class of the study names one: no action at 0.5, first action shut_down actuator_1 at 1",
            ),
            ("severity", "S3: 1 of 2 lanes switched off"),
            ("diagnostic_coverage", "no right action to compare with"),
        ] {
            assert_eq!(cell(&sheet, unlisted, field), text, "{field}");
        }
        // The number says what its cell says.
        let list = study.system.fault_list();
        let coverage = |id: &str| {
            let fault = list.iter().find(|own| own.id == id).unwrap();
            diagnosis::coverage_share(&sources, &FmeaSubject::of(&study, fault))
        };
        assert_eq!([coverage(unlisted), coverage(fault)], [None, Some(0.0)]);
        // Of the other actuator's fault there are no flights.
        assert_eq!(cell(&sheet, "actuator_2.servo_valve.gain_low", "isolation"), "not flown");
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
