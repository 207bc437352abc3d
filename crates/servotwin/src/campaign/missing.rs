//! Lists the shares whose parts a merge lacks, so that one command can submit them again.

use super::part::PartFiles;
use super::{Campaign, CampaignError};
use crate::study::{Purpose, Scenario};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// The parts that the campaigns in a folder lack.
#[derive(Clone, Debug, PartialEq)]
pub struct MissingParts {
    /// The number of shares in which the campaigns are divided.
    pub of: usize,
    /// The shares that lack a part, from 1, ascending.
    pub shares: Vec<usize>,
    /// The campaigns that lack parts.
    pub campaigns: Vec<MissingRows>,
    /// The first file that is damaged.
    pub damaged: Option<PathBuf>,
}

/// The missing parts of one campaign.
#[derive(Clone, Debug, PartialEq)]
pub struct MissingRows {
    /// Its scenarios.
    pub scenarios: Vec<Scenario>,
    /// The purpose of its data sets.
    pub purpose: Purpose,
    /// Number of rows without a usable part, over all scenarios.
    pub missing: usize,
    /// Number of rows over all scenarios.
    pub variants: usize,
    /// The shares that contain them, from 1, ascending.
    pub shares: Vec<usize>,
}

/// A campaign compared with the existing parts.
struct Compared {
    parts: usize,
    /// The parts that some scenario lacks.
    incomplete: BTreeSet<usize>,
    missing: usize,
    variants: usize,
    damaged: Option<PathBuf>,
}

/// Finds what the campaigns of a folder lack; `None` if every part exists. The campaigns are those of [`super::runs`], in
/// this order, because shares number the parts of all campaigns consecutively. Without `of`, every part is a share of
/// its own, which fits any earlier submission.
///
/// `thorough` reads every part; otherwise a campaign passes if all its parts have the right heads.
///
/// # Errors
/// [`CampaignError::NoVariants`] or [`CampaignError::NoSection`].
pub fn missing_parts(
    campaigns: &[Campaign],
    of: Option<usize>,
    thorough: bool,
) -> Result<Option<MissingParts>, CampaignError> {
    let all = campaigns.iter().map(|campaign| campaign.compared(thorough));
    let all: Vec<Compared> = all.collect::<Result<_, _>>()?;
    let of = of.unwrap_or_else(|| all.iter().map(|one| one.parts).sum()).max(1);
    let mut before = 0;
    let mut lacking = vec![];
    for (campaign, one) in campaigns.iter().zip(&all) {
        let shares = one.incomplete.iter().map(|part| (before + part) % of + 1);
        let shares: BTreeSet<usize> = shares.collect();
        before += one.parts;
        if one.missing > 0 {
            lacking.push(MissingRows {
                scenarios: campaign.scenarios.clone(),
                purpose: campaign.purpose,
                missing: one.missing,
                variants: one.variants,
                shares: shares.into_iter().collect(),
            });
        }
    }
    let shares: BTreeSet<usize> = lacking.iter().flat_map(|rows| rows.shares.clone()).collect();
    let damaged = all.into_iter().find_map(|one| one.damaged);
    let shares = shares.into_iter().collect();
    Ok((!lacking.is_empty()).then_some(MissingParts { of, shares, campaigns: lacking, damaged }))
}

impl Campaign<'_> {
    fn compared(&self, thorough: bool) -> Result<Compared, CampaignError> {
        let prepared = self.prepared()?;
        let (parts, variants) = (prepared.part_count(), prepared.counts.iter().sum());
        let files = self.files(&prepared);
        if !thorough && files.iter().all(PartFiles::seem_complete) {
            let incomplete = BTreeSet::new();
            return Ok(Compared { parts, incomplete, missing: 0, variants, damaged: None });
        }
        let (mut incomplete, mut missing) = (BTreeSet::new(), 0);
        for own in &files {
            let absent = own.missing(0..own.count());
            missing += absent.iter().map(|&part| own.variants_of(part).len()).sum::<usize>();
            incomplete.extend(absent);
        }
        let damaged = files.iter().find_map(PartFiles::damaged);
        Ok(Compared { parts, incomplete, missing, variants, damaged })
    }
}
