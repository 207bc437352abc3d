//! Parts of a campaign that run apart, on as many machines as there are, and what joins them.
//!
//! A *bundle* is a set of shards of which no simulation serves any other shard ([`Images`]): so no
//! variant is simulated twice, wherever its bundle runs. A shard's bytes depend on nothing but the
//! study, so parts that run anywhere, again or at the same time give the files of one machine.

use super::images::Images;
use super::shard::{SHARD, Shards};
use super::{Campaign, CampaignError, Outcome, Plants};
use crate::files::create_folder;
use crate::study::{Role, Setting, Study};
use std::fmt;
use std::ops::Range;
use std::str::FromStr;

/// One of several parts, `3/100` for the third of a hundred.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// From 1.
    number: usize,
    of: usize,
}

impl Part {
    /// The part with a number from 1.
    pub fn new(number: usize, of: usize) -> Option<Self> {
        (1..=of).contains(&number).then_some(Part { number, of })
    }

    /// Whether a bundle is in it, of all bundles of a study in a row.
    fn holds(self, bundle: usize) -> bool {
        bundle % self.of == self.number - 1
    }
}

impl FromStr for Part {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers = text.split_once('/').and_then(|(number, of)| {
            Part::new(number.trim().parse().ok()?, of.trim().parse().ok()?)
        });
        numbers.ok_or("a part is written NUMBER/ALL, such as 3/100, and counts from 1")
    }
}

impl fmt::Display for Part {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}/{}", self.number, self.of)
    }
}

/// The campaigns of a study: training commands and judged cases for each group of settings.
pub fn runs(study: &Study, choice: impl Fn(Setting) -> bool) -> Vec<(Role, Vec<Setting>)> {
    let groups = Setting::groups(study, choice).into_iter();
    let of = |settings: Vec<Setting>| study.roles().into_iter().map(move |r| (r, settings.clone()));
    groups.flat_map(of).collect()
}

impl Campaign<'_> {
    /// The shards that are simulated together, by their numbers.
    ///
    /// # Errors
    /// The study is empty, or has not what a setting needs.
    pub fn bundles(&self) -> Result<Vec<Vec<usize>>, CampaignError> {
        if self.plants() == Plants::Pool {
            return Err(CampaignError::InOneGo);
        }
        let plan = self.checked_plan()?;
        Ok(bundles(&self.images(&plan), plan.len()))
    }

    /// The names of the files of a bundle, in the folder of the shards.
    ///
    /// # Errors
    /// As [`Campaign::bundles`].
    pub fn shard_files(&self, bundle: &[usize]) -> Result<Vec<String>, CampaignError> {
        let plan = self.checked_plan()?;
        let of = |shards: &Shards| shards.names(bundle);
        Ok(self.shards(&plan, &self.images(&plan)).iter().flat_map(of).collect())
    }

    /// How many variants a bundle has in all settings.
    ///
    /// # Errors
    /// As [`Campaign::bundles`].
    pub fn variants_in(&self, bundle: &[usize]) -> Result<usize, CampaignError> {
        let plan = self.checked_plan()?;
        let counts = self.settings.iter().map(|setting| setting.planned(&plan));
        let of = |variants| bundle.iter().map(|&s| variants_of(s, variants).len()).sum::<usize>();
        Ok(counts.map(of).sum())
    }

    /// Simulates the shards of some bundles that are not there yet. No data set is written.
    ///
    /// # Errors
    /// As [`Campaign::run`].
    pub fn run_bundles(
        &self,
        wanted: &[Vec<usize>],
        progress: impl Fn(usize, usize) + Sync,
    ) -> Result<Outcome, CampaignError> {
        let plan = self.checked_plan()?;
        create_folder(self.shard_folder()).map_err(CampaignError::File)?;
        let images = self.images(&plan);
        let shards = self.shards(&plan, &images);
        let wanted: Vec<usize> = wanted.iter().flatten().copied().collect();
        let pending = shards.iter().map(|shards| shards.pending_of(wanted.iter().copied()));
        let pending: Vec<Vec<usize>> = pending.collect();
        let variants = self.variants_in(&wanted)?;
        let mut outcome = Outcome { variants, ..Outcome::default() };
        self.simulate(&plan, &images, &shards, &pending, &mut outcome, &progress)?;
        outcome.cancelled = self.is_cancelled();
        Ok(outcome)
    }

    /// Simulates a part; `bundles_before` of the study's other campaigns were counted before this one's.
    /// Returns how many bundles this one has.
    ///
    /// # Errors
    /// As [`Campaign::run`].
    pub fn run_part(
        &self,
        part: Part,
        bundles_before: usize,
        progress: impl Fn(usize, usize) + Sync,
    ) -> Result<(Outcome, usize), CampaignError> {
        let bundles = self.bundles()?;
        let count = bundles.len();
        let numbered = bundles.into_iter().enumerate();
        let own = numbered.filter(|(place, _)| part.holds(bundles_before + place));
        let own: Vec<Vec<usize>> = own.map(|(_, bundle)| bundle).collect();
        Ok((self.run_bundles(&own, progress)?, count))
    }

    /// Joins the shards of a campaign that has ended to its data sets.
    ///
    /// # Errors
    /// [`CampaignError::Unfinished`] if shards are missing, [`CampaignError::NotAlike`]; a file cannot
    /// be read or written.
    pub fn merge(&self) -> Result<Outcome, CampaignError> {
        let (plan, images, rows) = self.done()?;
        if !images.hold(|variant| &rows[0][variant].window) {
            return Err(CampaignError::NotAlike);
        }
        let mut outcome = Outcome::default();
        outcome.variants = rows.iter().map(Vec::len).sum();
        outcome.resumed = outcome.variants;
        self.write_data_sets(&plan, &rows, &images, &mut outcome)?;
        Ok(outcome)
    }
}

/// Shards joined by what serves both, in the order of their first ones.
fn bundles(images: &Images, variants: usize) -> Vec<Vec<usize>> {
    let count = variants.div_ceil(SHARD);
    // The first shard known to belong together with each.
    let mut first: Vec<usize> = (0..count).collect();
    let root = |first: &[usize], mut shard: usize| {
        while first[shard] != shard {
            shard = first[shard];
        }
        shard
    };
    for variant in 0..variants {
        let own = root(&first, variant / SHARD);
        let other = root(&first, images.simulated(variant) / SHARD);
        first[own.max(other)] = own.min(other);
    }
    let mut bundles: Vec<Vec<usize>> = vec![vec![]; count];
    for shard in 0..count {
        bundles[root(&first, shard)].push(shard);
    }
    bundles.retain(|bundle| !bundle.is_empty());
    bundles
}

/// The variants of a shard.
pub(super) fn variants_of(shard: usize, variants: usize) -> Range<usize> {
    (shard * SHARD).min(variants)..((shard + 1) * SHARD).min(variants)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_read_from_its_text_and_counts_from_one() {
        let part: Part = "3/100".parse().unwrap();
        assert_eq!(part.to_string(), "3/100");
        let held: Vec<usize> = (0..250).filter(|&bundle| part.holds(bundle)).collect();
        assert_eq!(held, [2, 102, 202]);
        for wrong in ["", "3", "0/3", "4/3", "-1/3", "a/b", "1/2/3"] {
            assert!(wrong.parse::<Part>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn every_shard_is_in_one_bundle_and_nobody_serves_another_bundle() {
        let study = Study::default();
        for (role, settings) in runs(&study, Setting::is_usual) {
            let campaign = Campaign {
                role,
                settings: settings.clone(),
                ..Campaign::stored(std::path::Path::new("none"), &study, settings[0], role)
            };
            let plan = campaign.plan();
            let images = campaign.images(&plan);
            let bundles = campaign.bundles().unwrap();
            let mut all: Vec<usize> = bundles.concat();
            all.sort_unstable();
            assert_eq!(all, (0..plan.len().div_ceil(SHARD)).collect::<Vec<_>>());
            let bundle_of = |variant: usize| {
                bundles.iter().position(|bundle| bundle.contains(&(variant / SHARD)))
            };
            for variant in 0..plan.len() {
                assert_eq!(bundle_of(variant), bundle_of(images.simulated(variant)));
            }
            assert!(bundles.len() > 2, "{role:?} {settings:?}: {bundles:?}");
        }
    }
}
