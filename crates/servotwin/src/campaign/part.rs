//! Parts of a campaign that can run on different machines, and their merging.
//!
//! A *bundle* is a set of shards that share simulations ([`Prepared::bundles`]), so hardly any variant is simulated
//! twice, wherever its bundle runs. A shard's bytes depend only on the study. Parts that run anywhere, repeatedly or
//! simultaneously, therefore give the same files as a single machine.

use super::shard::Shards;
use super::{Campaign, CampaignError, CampaignOutcome, PreparedCampaign};
use crate::study::{Role, Setting, Study};
use std::fmt;
use std::str::FromStr;

/// One of several parts: `3/100` is the third of a hundred.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// Number of the part, from 1.
    number: usize,
    of: usize,
}

impl Part {
    /// Creates the part with a number from 1 to `of`; `None` if out of range.
    pub fn new(number: usize, of: usize) -> Option<Self> {
        (1..=of).contains(&number).then_some(Part { number, of })
    }

    /// Whether the part contains a bundle; bundles of all campaigns are numbered consecutively.
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

/// The campaigns of a study: training commands and judged cases for each group of scenarios.
pub fn runs(study: &Study, choice: impl Fn(Setting) -> bool) -> Vec<(Role, Vec<Setting>)> {
    let groups = Setting::groups(study, choice).into_iter();
    let of = |settings: Vec<Setting>| study.roles().into_iter().map(move |r| (r, settings.clone()));
    groups.flat_map(of).collect()
}

impl Campaign<'_> {
    /// The file names of a bundle in the folder of shards.
    pub fn shard_files(&self, prepared: &PreparedCampaign, bundle: &[usize]) -> Vec<String> {
        self.shards(prepared).iter().flat_map(|shards| shards.names(bundle)).collect()
    }

    /// Number of variants of a bundle in all scenarios.
    pub fn variants_in(&self, prepared: &PreparedCampaign, bundle: &[usize]) -> usize {
        let of = |shards: &Shards| -> usize {
            bundle.iter().map(|&shard| shards.variants_of(shard).len()).sum()
        };
        self.shards(prepared).iter().map(of).sum()
    }

    /// Simulates the missing shards of the bundles. It writes no data set.
    ///
    /// # Errors
    /// See [`Campaign::run`].
    pub fn run_bundles(
        &self,
        prepared: &PreparedCampaign,
        wanted: Vec<Vec<usize>>,
        progress: impl Fn(usize, usize) + Sync,
    ) -> Result<CampaignOutcome, CampaignError> {
        let mut outcome = CampaignOutcome::default();
        self.simulate(prepared, wanted, &mut outcome, &progress)?;
        Ok(outcome)
    }

    /// Simulates a part. `bundles_before` is the number of bundles in the study's earlier campaigns. Returns the number
    /// of bundles of this campaign.
    ///
    /// # Errors
    /// See [`Campaign::run`].
    pub fn run_part(
        &self,
        part: Part,
        bundles_before: usize,
        progress: impl Fn(usize, usize) + Sync,
    ) -> Result<(CampaignOutcome, usize), CampaignError> {
        let prepared = self.prepared()?;
        let bundles = prepared.bundles();
        let count = bundles.len();
        let numbered = bundles.into_iter().enumerate();
        let own = numbered.filter(|(place, _)| part.holds(bundles_before + place));
        let own: Vec<Vec<usize>> = own.map(|(_, bundle)| bundle).collect();
        Ok((self.run_bundles(&prepared, own, progress)?, count))
    }
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
}
