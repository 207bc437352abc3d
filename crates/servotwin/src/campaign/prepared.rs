//! The common inputs of all parts of a campaign: its suite, the division into parts, and their fingerprints. A process
//! prepares it once for all its parts.

use super::part::PART_FORMAT;
use super::{Campaign, CampaignError};
use crate::run::plan;
use crate::study::{Scenario, Suite};
use servotwin_diagnosis::features::Sensor;
use servotwin_model::c_source;
use servotwin_model::hash::Fingerprint;
use std::ops::Range;

/// Samples of plants in a part: 10,000 s at 100 Hz.
const PART_SAMPLES: f64 = 1e6;

/// The plan of a campaign.
pub struct PreparedCampaign {
    pub(super) suite: Suite,
    /// The numbers of the runs of each part, which have one operating case.
    pub(super) parts: Vec<Range<usize>>,
    /// The fingerprint of the parts of each scenario.
    pub(super) fingerprints: Vec<String>,
    /// The number of variants of each scenario.
    pub(super) counts: Vec<usize>,
}

impl PreparedCampaign {
    /// Number of parts.
    pub fn part_count(&self) -> usize {
        self.parts.len()
    }
}

impl Campaign<'_> {
    /// Plans the campaign.
    ///
    /// # Errors
    /// The study is empty, or lacks a section that a scenario needs.
    pub fn prepared(&self) -> Result<PreparedCampaign, CampaignError> {
        let suite = self.suite();
        let runs = plan::count(self.study, &suite);
        if runs == 0 {
            return Err(CampaignError::NoVariants);
        }
        if let Some(&scenario) = self.scenarios.iter().find(|s| !s.is_possible(self.study)) {
            return Err(CampaignError::no_section(scenario, self.study));
        }
        let mut model = Fingerprint::default();
        self.add_model(&mut model);
        let faulty = plan::faulty(self.study, &suite);
        let count = |scenario: Scenario| if scenario.has_noise() { runs } else { faulty };
        let counts: Vec<usize> = self.scenarios.iter().map(|&scenario| count(scenario)).collect();
        let of = |(&scenario, &count): (&Scenario, &usize)| {
            self.fingerprint(scenario, (&suite, count), model)
        };
        let fingerprints = self.scenarios.iter().zip(&counts).map(of).collect();
        let parts = self.parts(&suite);
        Ok(PreparedCampaign { suite, parts, fingerprints, counts })
    }

    /// Divides a suite into equal parts of each case. Healthy specimens have parts of their own.
    fn parts(&self, suite: &Suite) -> Vec<Range<usize>> {
        let mut parts = vec![];
        for own in plan::of_environments(self.study, suite) {
            let duration_s = plan::run(self.study, suite, own.start).duration_s;
            let samples = own.len() as f64 * duration_s / self.study.sample_period_s;
            let count = (samples / PART_SAMPLES).ceil().max(1.0) as usize;
            let end = |part: usize| own.start + part * own.len() / count;
            parts.extend((0..count).map(|part| end(part)..end(part + 1)));
        }
        parts.retain(|part| !part.is_empty());
        parts
    }

    /// Adds the equations with their parameters, and the sensors.
    pub(super) fn add_model(&self, mark: &mut Fingerprint) {
        let study = self.study;
        let equations = c_source::write_equations(&study.system.program, "model", &[]);
        mark.add(&equations.expect("a prefix that is a name"));
        mark.add(&study.system.text).add(&study.measured);
        for Sensor { name, quantity, actuator, noise, is_noisy, follows } in &study.sensors.0 {
            mark.add(name).add(quantity.name()).add(actuator).add(noise).add(is_noisy).add(follows);
        }
    }

    /// The fingerprint of everything that determines a part: equations with parameters, inputs, variants, sensors and
    /// simulation settings.
    fn fingerprint(
        &self,
        scenario: Scenario,
        (suite, runs): (&Suite, usize),
        model: Fingerprint,
    ) -> String {
        let study = self.study;
        let mut mark = model;
        mark.add(PART_FORMAT);
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
        mark.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::runs;
    use crate::study::Study;
    use std::path::Path;

    #[test]
    fn parts_hold_every_variant_once_and_are_no_larger_than_one_size() {
        let study = Study::default();
        for (purpose, scenarios) in runs(&study, Scenario::is_usual) {
            let stored = Campaign::stored(Path::new("none"), &study, scenarios[0], purpose);
            let campaign = Campaign { scenarios, ..stored };
            let PreparedCampaign { suite, parts, .. } = campaign.prepared().unwrap();
            assert!(parts.iter().cloned().flatten().eq(0..plan::count(&study, &suite)));
            for part in parts {
                let own: Vec<_> = part.map(|number| plan::run(&study, &suite, number)).collect();
                let seconds: f64 = own.iter().map(|run| run.duration_s).sum();
                assert!(seconds / study.sample_period_s < 1.01 * PART_SAMPLES, "{seconds}");
                assert!(own.iter().all(|run| run.environment == own[0].environment));
            }
        }
    }
}
