//! `servotwin features`: features of windows of any measured and nominal signals.

use crate::Global;
use crate::failure::Failure;
use serde_json::json;
use servotwin::evaluation::EvaluationError;
use servotwin::evaluation::traces::TraceStudy;
use servotwin::{files, table};
use std::path::PathBuf;

/// Compute features from traces: measured and nominal signals as columns of a table.
#[derive(clap::Args)]
pub struct Options {
    /// The traces (.csv or .parquet).
    traces: PathBuf,
    /// The study file that says which columns are what (see studies/liu_engine.toml).
    #[arg(long)]
    study: PathBuf,
    /// The table of features to write (.csv or .parquet).
    #[arg(long)]
    out: PathBuf,
}

/// The text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let text = files::read_text(&options.study).map_err(EvaluationError::File)?;
    let in_study = |error| Failure::Trace { path: options.study.clone(), error };
    let study = TraceStudy::parse(&text).map_err(in_study)?;
    let features = study.features(&table::read(&options.traces)?).map_err(in_study)?;
    table::write(&options.out, &features)?;
    let (windows, columns) = (features.row_count(), features.columns().len());
    Ok(match (global.json, global.quiet) {
        (true, _) => crate::render::json(&json!({ "windows": windows, "columns": columns })),
        (false, true) => String::new(),
        (false, false) => {
            format!("{}: {windows} windows, {columns} columns\n", options.out.display())
        }
    })
}
