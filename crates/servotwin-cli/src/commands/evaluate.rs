//! `servotwin evaluate`: evaluates the hierarchies of a campaign under every protocol, or a trained
//! classifier on another table.

use super::progress::Stages;
use super::summary;
use super::train::{join, people};
use super::{is_read, not_as_model, read_wanted, warn};
use crate::failure::Failure;
use crate::render::json;
use crate::{Global, stop};
use serde_json::json;
use servotwin::evaluation::model_file;
use servotwin::evaluation::table_model::{
    JudgedClassifier, PreparedTable, TableModel, judge_table,
};
use servotwin::job::{self, Folder, JobError, Results, manifest};
use servotwin::parallel::Workers;
use servotwin::study::Study;
use std::path::{Path, PathBuf};

/// Evaluate the diagnosis of a campaign, or a classifier on a table.
///
/// With the output folder of a campaign that `servotwin train` has processed, writes `evaluation.json` into this
/// folder. With a table, evaluates the `--model` on it.
#[derive(clap::Args)]
pub struct Options {
    /// The output folder of a campaign, or a table (.csv or .parquet) with the model's features and class.
    input: PathBuf,
    /// The column of the table with the group. Intervals are then computed over groups.
    #[arg(long)]
    group: Option<String>,
    #[command(flatten)]
    judging: Judging,
}

/// What judges, and with how many threads.
#[derive(clap::Args)]
pub struct Judging {
    /// The model for a table, a file written by `servotwin train --out`.
    #[arg(long)]
    pub model: Option<PathBuf>,
    /// Number of threads [default: all processors; the results do not depend on it].
    #[arg(long, value_parser = super::threads)]
    pub threads: Option<usize>,
}

/// A table and the classifications of a model for it.
pub struct OfTable {
    pub model: TableModel,
    pub prepared: PreparedTable,
    pub judged: JudgedClassifier,
}

/// Returns the text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    match (options.input.is_dir(), &options.judging.model) {
        (true, None) => folder(options, global),
        (true, Some(_)) => Err(Failure::Options(MODEL_OF_FOLDER)),
        (false, Some(model)) => of_table(options, model, global),
        (false, None) => Err(Failure::Options("a table needs --model, the classifier to judge")),
    }
}

/// The error message for a folder with `--model`.
pub const MODEL_OF_FOLDER: &str = "--model is for tables, not for folders";

fn folder(options: &Options, global: Global) -> Result<String, Failure> {
    stop::heed();
    let folder = Folder::new(&options.input);
    let (study, _hold) = folder.open()?;
    let results = measure(job::evaluate_all, &folder, &study, options.judging.threads, global)?;
    Ok(match global {
        Global { json: true, .. } => json(&json!(results)),
        Global { quiet: true, .. } => String::new(),
        _ => summary::text(&results, &study),
    })
}

/// A number of threads that Ctrl-C can stop.
pub fn workers(threads: Option<usize>) -> Workers<'static> {
    threads.map_or(Workers::all(), Workers::new).stopped_by(stop::flag())
}

/// A stage of the main job that produces results.
type Measuring =
    fn(&Folder, &Study, Workers, &(dyn Fn(&str, f64) + Sync)) -> Result<Results, JobError>;

/// Runs such a stage for every data set of a folder, with its progress on a terminal.
pub fn measure(
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

fn of_table(options: &Options, rule: &Path, global: Global) -> Result<String, Failure> {
    let OfTable { model, judged, .. } =
        judge(&options.input, rule, options.group.as_deref(), global)?;
    let kind = model.model.kind();
    Ok(match global.json {
        true => {
            let mut result = json!({ "classifier": kind.id() });
            join(&mut result, json!(judged));
            json(&result)
        }
        false => format!("{}:\n{}", kind.title(), people(&judged)),
    })
}

/// Evaluates a model on a table; warnings go to standard error.
pub fn judge(
    input: &Path,
    rule: &Path,
    group: Option<&str>,
    global: Global,
) -> Result<OfTable, Failure> {
    let model = model_file::read_table_model(rule)?;
    let mixed: Vec<&str> = std::iter::once(model.label.as_str()).chain(group).collect();
    let table = read_wanted(input, &mixed, &is_read(&model, &mixed), global)?;
    if let Some(group) = group {
        table.column(group)?;
    }
    let (prepared, judged) =
        judge_table(table, &model, group).map_err(|error| not_as_model(input, rule, error))?;
    warn(global, &judged.warnings);
    Ok(OfTable { model, prepared, judged })
}
