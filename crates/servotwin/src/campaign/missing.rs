//! Lists the parts whose shards a merge lacks, so that one command can submit them again.

use super::shard::Shards;
use super::{Campaign, CampaignError, PreparedCampaign};
use crate::study::{Role, Setting};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// The shards that the campaigns in a folder lack.
#[derive(Clone, Debug, PartialEq)]
pub struct MissingParts {
    /// The number of parts in which the campaigns are divided.
    pub of: usize,
    /// The missing parts, from 1, ascending.
    pub parts: Vec<usize>,
    /// The campaigns that lack shards.
    pub campaigns: Vec<MissingRows>,
    /// Whether the shards that are there were made with `campaign --all`.
    pub simulate_images: bool,
    /// The first file that is damaged.
    pub damaged: Option<PathBuf>,
}

/// The missing shards of one campaign.
#[derive(Clone, Debug, PartialEq)]
pub struct MissingRows {
    /// Its scenarios.
    pub settings: Vec<Setting>,
    /// The role of its data sets.
    pub role: Role,
    /// Number of rows without a usable shard, over all scenarios.
    pub missing: usize,
    /// Number of rows over all scenarios.
    pub variants: usize,
    /// The parts that contain them, from 1, ascending.
    pub parts: Vec<usize>,
}

/// A plan of a campaign compared with the existing shards.
struct Compared {
    bundles: usize,
    /// The indices of bundles with a missing shard.
    incomplete: Vec<usize>,
    missing: usize,
    variants: usize,
    damaged: Option<PathBuf>,
}

/// Finds the parts that the campaigns of a folder lack; `None` if every shard exists. The campaigns are those of
/// [`super::runs`], in this order, because parts number the bundles of all campaigns consecutively. Without `of`, every
/// bundle is a separate part, which fits any earlier submission.
///
/// `thorough` reads every shard; otherwise a campaign passes if all its shards have the right heads.
///
/// # Errors
/// [`CampaignError::NoVariants`] or [`CampaignError::NoSection`].
pub fn missing_parts(
    campaigns: &[Campaign],
    of: Option<usize>,
    thorough: bool,
) -> Result<Option<MissingParts>, CampaignError> {
    let mut plans: [Vec<Compared>; 2] = [vec![], vec![]];
    for campaign in campaigns {
        let prepared = campaign.prepared()?;
        plans[0].push(campaign.compared(&prepared, thorough));
        let prepared = campaign.without_images(prepared);
        plans[1].push(campaign.compared(&prepared, thorough));
    }
    let is_complete = |n: usize| plans.iter().any(|plan| plan[n].missing == 0);
    let open: Vec<usize> = (0..campaigns.len()).filter(|&n| !is_complete(n)).collect();
    if open.is_empty() {
        return Ok(None);
    }
    let lacks = |plan: &[Compared]| open.iter().map(|&n| plan[n].missing).sum::<usize>();
    let simulate_images = lacks(&plans[1]) < lacks(&plans[0]);
    let plan = &plans[usize::from(simulate_images)];
    let of = of.unwrap_or_else(|| plan.iter().map(|one| one.bundles).sum()).max(1);
    let rows = |&n: &usize| {
        let (campaign, one) = (&campaigns[n], &plan[n]);
        let before: usize = plan[..n].iter().map(|one| one.bundles).sum();
        let parts: BTreeSet<usize> =
            one.incomplete.iter().map(|bundle| (before + bundle) % of + 1).collect();
        MissingRows {
            settings: campaign.settings.clone(),
            role: campaign.role,
            missing: one.missing,
            variants: one.variants,
            parts: parts.into_iter().collect(),
        }
    };
    let campaigns: Vec<MissingRows> = open.iter().map(rows).collect();
    let parts: BTreeSet<usize> = campaigns.iter().flat_map(|rows| rows.parts.clone()).collect();
    let damaged = open.iter().find_map(|&n| plan[n].damaged.clone());
    let parts = parts.into_iter().collect();
    Ok(Some(MissingParts { of, parts, campaigns, simulate_images, damaged }))
}

impl Campaign<'_> {
    fn compared(&self, prepared: &PreparedCampaign, thorough: bool) -> Compared {
        let shards = self.shards(prepared);
        let is_passed = !thorough && shards.iter().all(Shards::seem_complete);
        let absent = |shards: &Shards| match is_passed {
            true => BTreeSet::new(),
            false => shards.missing(0..shards.count()),
        };
        let absent: Vec<BTreeSet<usize>> = shards.iter().map(absent).collect();
        let bundles = prepared.bundles();
        let lacks_one = |bundle: &[usize]| {
            bundle.iter().any(|shard| absent.iter().any(|absent| absent.contains(shard)))
        };
        let incomplete = bundles.iter().enumerate().filter(|(_, bundle)| lacks_one(bundle));
        let rows = |(shards, absent): (&Shards, &BTreeSet<usize>)| -> usize {
            absent.iter().map(|&shard| shards.variants_of(shard).len()).sum()
        };
        Compared {
            bundles: bundles.len(),
            incomplete: incomplete.map(|(position, _)| position).collect(),
            missing: shards.iter().zip(&absent).map(rows).sum(),
            variants: prepared.counts.iter().sum(),
            damaged: match is_passed {
                true => None,
                false => shards.iter().find_map(Shards::damaged),
            },
        }
    }
}
