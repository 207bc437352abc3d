//! `servotwin merge`: joins the parts of a campaign into data sets.

use super::campaign::{campaign, chosen, describe, named};
use crate::failure::Failure;
use crate::incomplete::Incomplete;
use crate::{Global, stop};
use servotwin::campaign::{Campaign, CampaignError, missing_parts};
use servotwin::job::{Folder, data_card, manifest};
use servotwin::study::{Scenario, Study};
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Instant;

/// Join the results of 'servotwin campaign --share' into data sets.
///
/// The files equal those of an undivided campaign to the byte. If parts are missing, the message names their shares
/// with the command that runs them, and the exit code is 4. Shares of different divisions (3/100 and 2/7) may use one
/// folder.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The output folder of all shares.
    folder: PathBuf,
    /// The scenario that you gave to 'servotwin campaign' [default: all but fitted].
    #[arg(long, value_parser = Scenario::ALL.map(Scenario::name))]
    scenario: Option<String>,
    /// Number of shares in which to count the missing work [default: the number of parts, which fits any division].
    #[arg(long, value_name = "NUMBER")]
    shares: Option<NonZeroUsize>,
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let folder = Folder::new(&options.folder);
    let (study, _hold) = folder.open()?;
    stop::heed();
    let mut text = String::new();
    let mut merged = vec![];
    let campaigns = campaigns(options, &study, &folder)?;
    for campaign in &campaigns {
        let begin = Instant::now();
        let outcome = match campaign.merge() {
            Err(CampaignError::Unfinished { damaged, missing }) => {
                let error = CampaignError::Unfinished { damaged, missing };
                return Err(incomplete(options, &study, &folder, error, global));
            }
            outcome => outcome?,
        };
        text += &describe(campaign, &outcome, begin.elapsed().as_secs_f64());
        merged.push(serde_json::json!({
            "scenarios": campaign.scenarios.iter().map(|s| s.name()).collect::<Vec<_>>(),
            "variants": outcome.variants,
            "failed": outcome.failed.len(),
        }));
    }
    data_card::write(&folder, &study)?;
    manifest::write(&folder, &study)?;
    Ok(match global {
        Global { json: true, .. } => crate::render::json(&merged.into()),
        Global { quiet: true, .. } => String::new(),
        _ => text,
    })
}

/// The campaigns of the folder, in the order in which shares number their parts.
fn campaigns<'s>(
    options: &Options,
    study: &'s Study,
    folder: &Folder,
) -> Result<Vec<Campaign<'s>>, CampaignError> {
    let runs = chosen(study, options.scenario.as_deref())?.into_iter();
    Ok(runs.map(|(purpose, scenarios)| campaign(study, purpose, scenarios, folder, None)).collect())
}

/// The failure of a merge that lacks parts. With `--json` their shares also go to standard output.
fn incomplete(
    options: &Options,
    study: &Study,
    folder: &Folder,
    error: CampaignError,
    global: Global,
) -> Failure {
    let is_damaged = matches!(error, CampaignError::Unfinished { damaged: Some(_), .. });
    let shares = options.shares.map(NonZeroUsize::get);
    let found = campaigns(options, study, folder)
        .and_then(|campaigns| missing_parts(&campaigns, shares, is_damaged));
    let missing = match found {
        Ok(Some(missing)) => missing,
        Ok(None) => return error.into(),
        Err(error) => return error.into(),
    };
    let names = missing.campaigns.iter();
    let names = names.map(|rows| named(&rows.scenarios, rows.purpose)).collect();
    let scenario = options.scenario.clone();
    let report = Incomplete { folder: options.folder.clone(), scenario, names, missing };
    if global.json
        && let Err(failure) = crate::print(&crate::render::json(&report.to_json()))
    {
        return failure;
    }
    Failure::PartsMissing(Box::new(report))
}
