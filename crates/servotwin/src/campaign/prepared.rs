//! The common inputs of all pieces of a campaign: the plan, the shared simulations, and the fingerprints of shards.
//!
//! A process prepares it once for all its pieces. It takes 50 bytes and some time for every variant of the whole
//! campaign.

use super::images::Images;
use super::shard::SHARD;
use super::{Campaign, CampaignError, Planned, SHARD_FORMAT};
use crate::study::Setting;
use servotwin_diagnosis::features::Sensor;
use servotwin_model::c_source;
use servotwin_model::hash::Fingerprint;

/// The most shards of a bundle, unless its first shard alone serves more.
const LARGEST_BUNDLE: usize = 8;

/// The plan of a campaign.
pub struct PreparedCampaign {
    pub(super) plan: Vec<Planned>,
    pub(super) images: Images,
    /// The fingerprint of the shards of each scenario.
    pub(super) fingerprints: Vec<String>,
    /// The number of variants of each scenario.
    pub(super) counts: Vec<usize>,
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
        if let Some(&setting) = self.settings.iter().find(|s| !s.is_possible(self.study)) {
            return Err(CampaignError::no_section(setting, self.study));
        }
        let images = self.images(&plan);
        Ok(self.prepared_with(plan, images))
    }

    /// The same plan with every variant simulated.
    pub(super) fn without_images(
        &self,
        PreparedCampaign { plan, .. }: PreparedCampaign,
    ) -> PreparedCampaign {
        let images = Images::none(&plan);
        self.prepared_with(plan, images)
    }

    fn prepared_with(&self, plan: Vec<Planned>, images: Images) -> PreparedCampaign {
        let mut model = Fingerprint::default();
        self.add_model(&mut model);
        let of = |&setting: &Setting| self.fingerprint(setting, &plan, &images, model);
        let fingerprints = self.settings.iter().map(of).collect();
        let counts = self.settings.iter().map(|&setting| variant_count(setting, &plan)).collect();
        PreparedCampaign { plan, images, fingerprints, counts }
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

    /// The fingerprint of everything that determines a shard: equations with parameters, inputs, variants, sensors and
    /// simulation settings.
    fn fingerprint(
        &self,
        setting: Setting,
        plan: &[Planned],
        images: &Images,
        model: Fingerprint,
    ) -> String {
        let study = self.study;
        let mut mark = model;
        mark.add(SHARD_FORMAT).add(&images.has_mirrored());
        mark.add(setting.name()).add(self.role.suffix()).add(&self.solver);
        mark.add(&[study.duration_s, self.duration_s(), study.sample_period_s]);
        mark.add(&study.realism.as_ref().filter(|_| setting.has_noise()));
        mark.add(&study.calibration.as_ref().filter(|_| setting == Setting::Fitted));
        for planned in &plan[..variant_count(setting, plan)] {
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
fn variant_count(setting: Setting, plan: &[Planned]) -> usize {
    let faults = plan.iter().filter(|planned| planned.fault.is_some()).count();
    if setting.has_noise() { plan.len() } else { faults }
}

impl PreparedCampaign {
    /// Groups of shards that are simulated together. Shards that share simulations are in one bundle, up to a size
    /// limit. At the edges of large bundles, some variants are simulated in both.
    pub fn bundles(&self) -> Vec<Vec<usize>> {
        let count = self.plan.len().div_ceil(SHARD);
        // For each shard, a first shard of its group, and for each first shard the size of its group.
        let mut first: Vec<usize> = (0..count).collect();
        let mut sizes = vec![1; count];
        let root = |first: &[usize], mut shard: usize| {
            while first[shard] != shard {
                shard = first[shard];
            }
            shard
        };
        for variant in 0..self.plan.len() {
            let one = root(&first, variant / SHARD);
            let other = root(&first, self.images.simulated(variant) / SHARD);
            let (low, high) = (one.min(other), one.max(other));
            if low != high && sizes[low] + sizes[high] <= LARGEST_BUNDLE {
                first[high] = low;
                sizes[low] += sizes[high];
            }
        }
        let mut bundles: Vec<Vec<usize>> = vec![vec![]; count];
        for shard in 0..count {
            bundles[root(&first, shard)].push(shard);
        }
        bundles.retain(|bundle| !bundle.is_empty());
        bundles
    }
}

#[cfg(test)]
mod tests {
    use super::super::runs;
    use super::*;
    use crate::study::{Role, Study};
    use std::path::Path;

    fn prepared(study: &Study, role: Role, settings: Vec<Setting>) -> PreparedCampaign {
        let stored = Campaign::stored(Path::new("none"), study, settings[0], role);
        Campaign { settings, ..stored }.prepared().unwrap()
    }

    /// The share of variants served by a simulation in another bundle.
    fn shared(prepared: &PreparedCampaign, bundles: &[Vec<usize>]) -> f64 {
        let mut bundle_of = vec![0; prepared.plan.len().div_ceil(SHARD)];
        for (place, bundle) in bundles.iter().enumerate() {
            bundle.iter().for_each(|&shard| bundle_of[shard] = place);
        }
        let of = |variant: usize| bundle_of[variant / SHARD];
        let variants = 0..prepared.plan.len();
        let count = variants.filter(|&v| of(v) != of(prepared.images.simulated(v))).count();
        count as f64 / prepared.plan.len() as f64
    }

    #[test]
    fn every_shard_is_in_one_bundle_and_few_variants_are_simulated_twice() {
        let study = Study::default();
        for (role, settings) in runs(&study, Setting::is_usual) {
            let prepared = prepared(&study, role, settings.clone());
            let bundles = prepared.bundles();
            let mut all: Vec<usize> = bundles.concat();
            all.sort_unstable();
            assert_eq!(all, (0..prepared.plan.len().div_ceil(SHARD)).collect::<Vec<_>>());
            assert!(bundles.iter().all(|bundle| bundle.len() <= LARGEST_BUNDLE));
            assert!(bundles.len() > 2, "{role:?} {settings:?}: {bundles:?}");
            assert!(shared(&prepared, &bundles) < 0.03);
        }
    }

    #[test]
    fn cases_that_straddle_shards_do_not_chain_all_of_them_together() {
        let text = Study::default().text.replace("intensities = [", "intensities = [0.01, 0.05, ");
        let study = Study::parse(&text, "paper.toml").unwrap();
        assert!(!study.faults.len().is_multiple_of(SHARD), "{}", study.faults.len());
        let prepared = prepared(&study, Role::Judged, vec![Setting::Ideal, Setting::Noise]);
        let bundles = prepared.bundles();
        assert!(bundles.len() >= prepared.plan.len().div_ceil(SHARD) / LARGEST_BUNDLE);
        let twice = shared(&prepared, &bundles);
        assert!(twice > 0.0 && twice < 0.1, "{twice}");
    }
}
