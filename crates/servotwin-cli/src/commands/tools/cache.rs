//! `servotwin tools cache`: compiled equations that later runs reuse.

use crate::Global;
use crate::failure::Failure;
use crate::render::json;
use serde_json::json;
use servotwin::compiled::cache::{self, VARIABLE};
use servotwin::files::FileError;

/// Show the cache of compiled equations, or clear it.
///
/// Long simulations compile the system's equations and keep the result for later runs. The cache is the folder named by
/// SERVOTWIN_CACHE, or else `servotwin` in your cache folder.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Remove everything in the cache.
    #[arg(long)]
    clear: bool,
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let Some(folder) = cache::folder() else {
        let text =
            format!("there is no cache: {VARIABLE} is empty, or no folder for caches is known\n");
        return Ok(if global.json { json(&json!({ "folder": null })) } else { text });
    };
    let failed = |cause| FileError::from_io(&folder, cause);
    let removed = match options.clear {
        true => Some(cache::clear(&folder).map_err(failed)?),
        false => None,
    };
    let libraries = cache::libraries(&folder).map_err(failed)?;
    let (count, bytes) = (libraries.len(), libraries.iter().map(|(_, bytes)| bytes).sum::<u64>());
    let shown = folder.display().to_string();
    Ok(match (global, removed) {
        (Global { json: true, .. }, _) => json(
            &json!({ "folder": shown, "libraries": count, "bytes": bytes, "removed": removed }),
        ),
        (Global { quiet: true, .. }, Some(_)) => String::new(),
        (_, Some(removed)) => format!("{shown}: {removed} removed\n"),
        (_, None) => format!("{shown}: {count} libraries, {:.1} MB\n", bytes as f64 / 1e6),
    })
}
