//! `servotwin features`: the features of a campaign computed anew, or those of windows of any
//! measured and nominal signals.

use crate::Global;
use crate::failure::Failure;
use serde_json::json;
use servotwin::evaluation::EvaluationError;
use servotwin::evaluation::traces::TraceStudy;
use servotwin::job::{Folder, manifest};
use servotwin::study::Setting;
use servotwin::study::campaign::Campaign;
use servotwin::{files, table};
use std::path::{Path, PathBuf};

/// Compute the features of a campaign anew, or those of traces.
///
/// With the output folder of a campaign, makes its data sets again from the stored windows, without
/// simulating anything: for a program whose features have changed. With traces (measured and
/// nominal signals as columns of a table), writes a table of the features of their windows.
#[derive(clap::Args)]
pub struct Options {
    /// The output folder of a campaign, or traces (.csv or .parquet).
    input: PathBuf,
    /// The study file that says which columns of the traces are what (see studies/liu_engine.toml).
    #[arg(long)]
    study: Option<PathBuf>,
    /// The table of features to write (.csv or .parquet).
    #[arg(long)]
    out: Option<PathBuf>,
    /// Write the data sets of a folder as .csv, too.
    #[arg(long)]
    csv: bool,
}

/// The text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    match (options.input.is_dir(), &options.study, &options.out) {
        (true, None, None) => folder(&Folder::new(&options.input), options.csv, global),
        (true, _, _) => Err(Failure::Options("--study and --out are for traces, not for folders")),
        (false, Some(study), Some(out)) => of_traces(&options.input, study, out, global),
        (false, _, _) => Err(Failure::Options("traces need --study and --out")),
    }
}

fn folder(folder: &Folder, csv: bool, global: Global) -> Result<String, Failure> {
    let study = folder.read_study()?;
    let mut list = vec![];
    for setting in Setting::ALL {
        for role in study.roles() {
            let path = folder.data_set(setting, role);
            if !path.exists() {
                continue;
            }
            Campaign::stored(folder.path(), &study, setting, role).features()?;
            let table = table::read(&path)?;
            if csv {
                table::write(path.with_extension("csv"), &table)?;
            }
            list.push((path, table.row_count(), table.columns().len()));
        }
    }
    manifest::write(folder, &study)?;
    let line = |(path, rows, columns): &(PathBuf, usize, usize)| {
        format!("{}: {rows} variants, {columns} columns\n", path.display())
    };
    let entry = |(path, rows, columns): &(PathBuf, usize, usize)| json!({ "file": path.display().to_string(), "variants": rows, "columns": columns });
    Ok(match (global.json, global.quiet) {
        (true, _) => crate::render::json(&list.iter().map(entry).collect()),
        (false, true) => String::new(),
        (false, false) => list.iter().map(line).collect(),
    })
}

fn of_traces(
    traces: &Path,
    study: &PathBuf,
    out: &Path,
    global: Global,
) -> Result<String, Failure> {
    let text = files::read_text(study).map_err(EvaluationError::File)?;
    let in_study = |error| Failure::Trace { path: study.clone(), error };
    let parsed = TraceStudy::parse(&text).map_err(in_study)?;
    let features = parsed.features(&table::read(traces)?).map_err(in_study)?;
    table::write(out, &features)?;
    let (windows, columns) = (features.row_count(), features.columns().len());
    Ok(match (global.json, global.quiet) {
        (true, _) => crate::render::json(&json!({ "windows": windows, "columns": columns })),
        (false, true) => String::new(),
        (false, false) => format!("{}: {windows} windows, {columns} columns\n", out.display()),
    })
}
