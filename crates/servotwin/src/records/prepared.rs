//! The common inputs of all parts of a campaign: its suite and the files of its parts. A process prepares it once for all
//! its parts.

use super::{Campaign, RunError};
use crate::run::part::{self, PartFiles};
use crate::run::plan;
use crate::study::{Scenario, Suite};
use servotwin_model::hash::Fingerprint;

/// The plan of a campaign.
pub struct PreparedCampaign {
    pub(super) suite: Suite,
    /// The parts of each scenario.
    pub(super) files: Vec<PartFiles>,
}

impl PreparedCampaign {
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

impl Campaign<'_> {
    /// Plans the campaign.
    ///
    /// # Errors
    /// The study is empty, or lacks a section that a scenario needs.
    pub fn prepared(&self) -> Result<PreparedCampaign, RunError> {
        let suite = self.suite();
        let runs = plan::count(self.study, &suite);
        if runs == 0 {
            return Err(RunError::NoVariants);
        }
        self.scenarios.iter().try_for_each(|&scenario| RunError::check(scenario, self.study))?;
        let model = part::model_mark(self.study);
        let faulty = plan::faulty(self.study, &suite);
        let all = part::parts(self.study, &suite);
        let of = |&scenario: &Scenario| {
            let count = if scenario.has_noise() { runs } else { faulty };
            let own = |part: &Vec<usize>| part.iter().copied().filter(|&n| n < count).collect();
            PartFiles::new(
                &self.folder,
                format!("{}{}", scenario.name(), self.purpose.suffix()),
                self.fingerprint(scenario, (&suite, count), model),
                all.iter().map(own).collect(),
            )
        };
        Ok(PreparedCampaign { files: self.scenarios.iter().map(of).collect(), suite })
    }

    /// The fingerprint of everything that determines a part: equations with parameters, inputs, variants, sensors and
    /// simulation settings.
    fn fingerprint(
        &self,
        scenario: Scenario,
        (suite, runs): (&Suite, usize),
        model: Fingerprint,
    ) -> Fingerprint {
        let study = self.study;
        let mut mark = model;
        mark.add(scenario.name()).add(self.purpose.suffix()).add(&self.solver);
        mark.add(&[study.duration_s, suite.duration_s, study.sample_period_s]);
        mark.add(&study.seed);
        mark.add(&study.realism.as_ref().filter(|_| scenario.has_noise()));
        mark.add(&study.calibration.as_ref().filter(|_| scenario == Scenario::Fitted));
        for run in (0..runs).map(|number| plan::run(study, suite, number)) {
            let fault = run.fault.map_or("healthy", |f| study.faults[f].id.as_str());
            mark.add(&run.environment).add(fault).add(&run.intensity);
        }
        for case in study.cases_of(self.purpose) {
            mark.add(&case.inputs);
        }
        mark
    }
}
