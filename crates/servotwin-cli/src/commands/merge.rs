//! `servotwin merge`: the shards of a campaign's parts joined to data sets.

use super::campaign::{campaign, chosen, describe};
use crate::failure::Failure;
use crate::{Global, stop};
use servotwin::job::{Folder, manifest};
use servotwin::study::Setting;
use std::path::PathBuf;
use std::time::Instant;

/// Join what 'servotwin campaign --shards' has simulated to data sets.
///
/// The files are those of a campaign in one go, to the byte.
#[derive(clap::Args)]
pub struct Options {
    /// The folder in which all parts have worked.
    folder: PathBuf,
    /// The setting that was named to 'servotwin campaign' [default: all but fitted].
    #[arg(long, value_parser = Setting::ALL.map(Setting::name))]
    setting: Option<String>,
}

/// The text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let folder = Folder::new(&options.folder);
    let (study, _hold) = folder.open()?;
    stop::heed();
    let mut text = String::new();
    let mut merged = vec![];
    for (role, settings) in chosen(&study, options.setting.as_deref())? {
        let begin = Instant::now();
        let campaign = campaign(&study, role, settings, &folder, None);
        let outcome = campaign.merge()?;
        text += &describe(&campaign, &outcome, begin.elapsed().as_secs_f64());
        merged.push(serde_json::json!({
            "settings": campaign.settings.iter().map(|s| s.name()).collect::<Vec<_>>(),
            "variants": outcome.variants,
            "failed": outcome.failed.len(),
        }));
    }
    manifest::write(&folder, &study)?;
    Ok(match global {
        Global { json: true, .. } => crate::render::json(&merged.into()),
        Global { quiet: true, .. } => String::new(),
        _ => text,
    })
}
