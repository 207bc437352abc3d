//! `servotwin evaluate`: a trained classifier judged with another table.

use super::train::people;
use crate::Global;
use crate::failure::Failure;
use crate::render::json;
use serde_json::json;
use servotwin::evaluation::foreign::evaluate_table;
use servotwin::evaluation::model_file;
use servotwin::table;
use std::path::PathBuf;

/// Judge a classifier of `servotwin train` with a table it has not seen.
#[derive(clap::Args)]
pub struct Options {
    /// The table (.csv or .parquet), with the features and the class that the model knows.
    table: PathBuf,
    /// The model, a file that `servotwin train --out` has written.
    #[arg(long)]
    model: PathBuf,
}

/// The text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let model = model_file::read_table_model(&options.model)?;
    let score = evaluate_table(&table::read(&options.table)?, &model)?;
    Ok(match global.json {
        true => json(&json!({ "classifier": model.model.kind().id(), "score": score })),
        false => format!("{}:\n{}", model.model.kind().title(), people(&score)),
    })
}
