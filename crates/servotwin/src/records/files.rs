//! The files of the parts of records.

use super::{Records, RunError};
use crate::run::part::{self, PartFiles};
use crate::run::plan;
use crate::study::{Scenario, Study, Suite};
use servotwin_model::hash::Fingerprint;
use servotwin_model::solver::SolverSettings;
use std::path::Path;

/// Plans the files of the parts of each scenario.
///
/// # Errors
/// The study is empty, or lacks a section that a scenario needs.
pub(super) fn of(
    folder: &Path,
    study: &Study,
    suite: &Suite,
    scenarios: &[Scenario],
) -> Result<Vec<PartFiles>, RunError> {
    let runs = plan::count(study, suite);
    if runs == 0 {
        return Err(RunError::NoVariants);
    }
    scenarios.iter().try_for_each(|&scenario| RunError::check(scenario, study))?;
    let model = part::model_mark(study);
    let faulty = plan::faulty(study, suite);
    let all = part::parts(study, suite, plan::all(study, suite));
    let of = |&scenario: &Scenario| {
        let count = if scenario.has_noise() { runs } else { faulty };
        let own = |part: &Vec<usize>| part.iter().copied().filter(|&n| n < count).collect();
        PartFiles::new(
            folder,
            format!("{}{}", scenario.name(), suite.purpose.suffix()),
            fingerprint((study, suite, scenario), count, model),
            all.iter().map(own).collect(),
        )
    };
    Ok(scenarios.iter().map(of).collect())
}

/// The fingerprint of everything that determines a part: equations with parameters, inputs, variants, sensors and
/// simulation settings.
fn fingerprint(
    (study, suite, scenario): (&Study, &Suite, Scenario),
    runs: usize,
    model: Fingerprint,
) -> Fingerprint {
    let mut mark = model;
    mark.add(scenario.name()).add(suite.purpose.suffix()).add(&SolverSettings::of_runs());
    mark.add(&[study.duration_s, suite.duration_s, study.sample_period_s]);
    mark.add(&study.seed);
    mark.add(&study.realism.as_ref().filter(|_| scenario.has_noise()));
    mark.add(&study.calibration.as_ref().filter(|_| scenario == Scenario::Fitted));
    for run in plan::all(study, suite).take(runs) {
        let fault = run.fault.map_or("healthy", |f| study.faults[f].id.as_str());
        mark.add(&run.environment).add(fault).add(&run.intensity);
    }
    for case in study.cases_of(suite.purpose) {
        mark.add(&case.inputs);
    }
    mark
}

impl Records<'_> {
    /// Number of parts.
    pub fn part_count(&self) -> usize {
        self.files[0].parts.len()
    }

    /// The number of rows of a part in all scenarios.
    pub(crate) fn rows_of(&self, part: usize) -> usize {
        self.files.iter().map(|files| files.parts[part].len()).sum()
    }

    /// The files of a part, relative to the output folder.
    pub(crate) fn files_of(&self, part: usize) -> Vec<String> {
        let own = self.files.iter().filter(|files| !files.parts[part].is_empty());
        own.map(|files| part::file_name(&files.stem, part)).collect()
    }
}
