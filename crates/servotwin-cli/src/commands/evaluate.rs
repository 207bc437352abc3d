//! `servotwin evaluate`: evaluates the hierarchies of a campaign under every protocol.

use super::progress::Stages;
use super::summary;
use crate::failure::Failure;
use crate::render::json;
use crate::{Global, stop};
use serde_json::json;
use servotwin::job::{self, Folder, JobError, Results, manifest};
use servotwin::parallel::Workers;
use servotwin::study::Study;
use std::path::PathBuf;

/// Evaluate the diagnosis of a campaign.
///
/// Writes `evaluation.json` into the folder, which `servotwin train` has processed.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The output folder of a campaign.
    folder: PathBuf,
    /// Number of threads [default: all processors; the results do not depend on it].
    #[arg(long, value_parser = super::threads)]
    threads: Option<usize>,
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    stop::heed();
    let folder = Folder::new(&options.folder);
    let (study, _hold) = folder.open()?;
    let results = measure(job::evaluate_all, &folder, &study, options.threads, global)?;
    Ok(match global {
        Global { json: true, .. } => json(&json!(results)),
        Global { quiet: true, .. } => String::new(),
        _ => summary::text(&results, &study),
    })
}

/// A number of threads that Ctrl-C can stop.
pub(crate) fn workers(threads: Option<usize>) -> Workers<'static> {
    threads.map_or(Workers::all(), Workers::new).stopped_by(stop::flag())
}

/// A stage of the main job that produces results.
type Measuring =
    fn(&Folder, &Study, Workers, &(dyn Fn(&str, f64) + Sync)) -> Result<Results, JobError>;

/// Runs such a stage for every data set of a folder, with its progress on a terminal.
pub(crate) fn measure(
    stage: Measuring,
    folder: &Folder,
    study: &Study,
    threads: Option<usize>,
    global: Global,
) -> Result<Results, Failure> {
    let workers = workers(threads);
    let stages = Stages::new(global);
    let results = stage(folder, study, workers, &|what, share| stages.show(what, share))?;
    stages.end();
    manifest::write(folder, study)?;
    Ok(results)
}
