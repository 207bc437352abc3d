//! `servotwin predict`: classifies rows without a known class.

use super::{is_read, not_as_model, note, read_wanted, warn};
use crate::Global;
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::render::{Side, TextTable, json};
use serde_json::json;
use servotwin::evaluation::model_file;
use servotwin::evaluation::table_model::{Predicted, TableModel, predict};
use servotwin::table::{self, Table, csv};
use std::path::PathBuf;

/// Classify every row of a table with a trained classifier.
///
/// The table needs no class column. For each row, the result has the predicted class, the probability of every class
/// and, for a tree, the path to its leaf. Without `--out`, it is printed as CSV.
#[derive(clap::Args)]
pub struct Options {
    /// The model, a file written by `servotwin train --out`.
    model: PathBuf,
    /// The table (.csv or .parquet), with the columns that the model reads.
    table: PathBuf,
    /// Write the predictions to this table (.csv or .parquet).
    #[arg(long)]
    out: Option<PathBuf>,
    /// Make no prediction where the highest probability is lower than this.
    #[arg(long, value_name = "P")]
    abstain_below: Option<f64>,
    /// Columns to copy into the result, separated by commas.
    #[arg(long, value_delimiter = ',')]
    keep: Vec<String>,
}

impl Options {
    /// The files that the command reads and writes.
    pub fn paths(&self) -> Paths {
        let read = Paths::default().read("MODEL", [&self.model]).read("TABLE", [&self.table]);
        read.write("--out", Format::Table, &self.out)
    }
}

/// Returns the text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    if let Some(limit) = options.abstain_below.filter(|limit| !(0.0..=1.0).contains(limit)) {
        let (option, range) = ("--abstain-below", "0 to 1");
        return Err(Failure::OutOfRange { option, given: limit.to_string(), range: range.into() });
    }
    let model = model_file::read_table_model(&options.model)?;
    let mixed: Vec<&str> = options.keep.iter().map(String::as_str).collect();
    let input = read_wanted(&options.table, &mixed, &is_read(&model, &mixed), global)?;
    for name in &options.keep {
        input.column(name)?;
    }
    let Predicted { table: result, doubts } =
        predict(input, &model, &options.keep, options.abstain_below)
            .map_err(|error| not_as_model(&options.table, &options.model, error))?;
    warn(global, &doubts);
    let counts = counts(&model, &result)?;
    match &options.out {
        Some(path) => table::write(path, &result)?,
        None if !global.json => {
            let mut text = vec![];
            csv::write_to(&mut text, &result).map_err(Failure::Print)?;
            let abstained = counts.last().map_or(0, |(_, count)| *count);
            note(global, &format!("{} rows, {abstained} without an answer", result.row_count()));
            return Ok(String::from_utf8_lossy(&text).into_owned());
        }
        None => {}
    }
    Ok(match (global.json, global.quiet) {
        (true, _) => {
            let predicted: serde_json::Map<_, _> =
                counts.iter().map(|(name, count)| (name.to_string(), json!(count))).collect();
            json(&json!({ "rows": result.row_count(), "predicted": predicted, "doubts": doubts }))
        }
        (false, true) => String::new(),
        (false, false) => {
            let mut grid = TextTable::new(&[("predicted", Side::Left), ("rows", Side::Right)]);
            counts.iter().for_each(|(name, count)| {
                grid.push(vec![name.to_string(), count.to_string()]);
            });
            grid.text()
        }
    })
}

/// Counts the predictions of every class, and finally the rows without an answer.
fn counts<'a>(model: &'a TableModel, result: &Table) -> Result<Vec<(&'a str, usize)>, Failure> {
    let said = result.text("predicted")?;
    let count = |name: &str| said.iter().filter(|text| *text == name).count();
    let classes = model.classes.iter().map(|class| (class.as_str(), count(class)));
    Ok(classes.chain([("(no answer)", count(""))]).collect())
}
