//! The common inputs of all parts of a campaign: the plan, its division, and the fingerprints of parts.
//!
//! A process prepares it once for all its parts. It takes about 40 bytes and some time for every variant of the whole
//! campaign.

use super::part::PART_FORMAT;
use super::{Campaign, CampaignError, Planned};
use crate::study::Scenario;
use servotwin_diagnosis::features::Sensor;
use servotwin_model::c_source;
use servotwin_model::hash::Fingerprint;
use std::ops::Range;

/// Samples of plants in a part: 10,000 s at 100 Hz.
const PART_SAMPLES: f64 = 1e6;

/// The plan of a campaign.
pub struct PreparedCampaign {
    pub(super) plan: Vec<Planned>,
    /// The variants of each part, which have one operating case.
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
        let plan = self.plan();
        if plan.is_empty() {
            return Err(CampaignError::NoVariants);
        }
        if let Some(&scenario) = self.scenarios.iter().find(|s| !s.is_possible(self.study)) {
            return Err(CampaignError::no_section(scenario, self.study));
        }
        let mut model = Fingerprint::default();
        self.add_model(&mut model);
        let of = |&scenario: &Scenario| self.fingerprint(scenario, &plan, model);
        let fingerprints = self.scenarios.iter().map(of).collect();
        let counts =
            self.scenarios.iter().map(|&scenario| variant_count(scenario, &plan)).collect();
        let parts = self.parts(&plan);
        Ok(PreparedCampaign { plan, parts, fingerprints, counts })
    }

    /// Divides a plan into equal parts of each case. Healthy specimens have parts of their own.
    fn parts(&self, plan: &[Planned]) -> Vec<Range<usize>> {
        let mut parts = vec![];
        let mut first = 0;
        let is_one =
            |a: &Planned, b: &Planned| (a.case, a.fault.is_some()) == (b.case, b.fault.is_some());
        for own in plan.chunk_by(is_one) {
            let samples = self.lasting_s(own[0]) / self.study.sample_period_s;
            let count = (own.len() as f64 * samples / PART_SAMPLES).ceil().max(1.0) as usize;
            let end = |part: usize| first + part * own.len() / count;
            parts.extend((0..count).map(|part| end(part)..end(part + 1)));
            first += own.len();
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
    fn fingerprint(&self, scenario: Scenario, plan: &[Planned], model: Fingerprint) -> String {
        let study = self.study;
        let mut mark = model;
        mark.add(PART_FORMAT);
        mark.add(scenario.name()).add(self.role.suffix()).add(&self.solver);
        mark.add(&[study.duration_s, self.duration_s(), study.sample_period_s]);
        mark.add(&study.seed);
        mark.add(&study.realism.as_ref().filter(|_| scenario.has_noise()));
        mark.add(&study.calibration.as_ref().filter(|_| scenario == Scenario::Fitted));
        for planned in &plan[..variant_count(scenario, plan)] {
            let fault = planned.fault.map_or("healthy", |f| study.faults[f].id.as_str());
            mark.add(&planned.case).add(fault).add(&planned.intensity);
        }
        for case in self.cases() {
            mark.add(&case.inputs);
        }
        mark.to_string()
    }
}

/// Number of variants of a plan in the data set of a scenario. Without noise, healthy specimens equal the twin and are
/// left out.
fn variant_count(scenario: Scenario, plan: &[Planned]) -> usize {
    let faults = plan.iter().filter(|planned| planned.fault.is_some()).count();
    if scenario.has_noise() { plan.len() } else { faults }
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
        for (role, scenarios) in runs(&study, Scenario::is_usual) {
            let stored = Campaign::stored(Path::new("none"), &study, scenarios[0], role);
            let campaign = Campaign { scenarios, ..stored };
            let PreparedCampaign { plan, parts, .. } = campaign.prepared().unwrap();
            assert!(parts.iter().cloned().flatten().eq(0..plan.len()));
            for part in parts {
                let own = &plan[part];
                let seconds: f64 = own.iter().map(|planned| campaign.lasting_s(*planned)).sum();
                assert!(seconds / study.sample_period_s < 1.01 * PART_SAMPLES, "{seconds}");
                assert!(own.iter().all(|planned| planned.case == own[0].case));
            }
        }
    }
}
