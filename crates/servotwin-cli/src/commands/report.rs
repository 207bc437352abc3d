//! `servotwin report`: what the other stages have found, or what a table holds, as one HTML file.

use super::{TableOptions, warn};
use crate::Global;
use crate::failure::Failure;
use crate::render::json;
use serde_json::json;
use servotwin::evaluation::EvaluationError;
use servotwin::evaluation::comparison::default_classifiers;
use servotwin::evaluation::parallel::Workers;
use servotwin::evaluation::table_model::TableModelError;
use servotwin::files::write_atomically;
use servotwin::job::{Folder, report};
use servotwin::report::table_model::{TableMaterial, render};
use servotwin_diagnosis::classifiers::Kind;
use std::path::{Path, PathBuf};

/// Write a report: one HTML file that needs no network.
///
/// With the output folder of an evaluated campaign, writes report.html there, and its figures as
/// SVG. With a table, compares all classifiers on rows held out and draws the tree.
#[derive(clap::Args)]
pub struct Options {
    /// The output folder of a campaign for which `servotwin evaluate` has run, or a table (.csv or
    /// .parquet).
    input: PathBuf,
    #[command(flatten)]
    table: TableOptions,
    /// The report to write (.html).
    #[arg(long)]
    out: Option<PathBuf>,
}

/// The text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let path = match (options.input.is_dir(), &options.table.label, &options.out) {
        (true, None, None) => folder(&Folder::new(&options.input))?,
        (_, _, Some(out)) if !is_html(out) => {
            return Err(Failure::Options("a report is HTML: --out must end in .html"));
        }
        (true, _, _) => return Err(Failure::Options("--label and --out are for tables")),
        (false, Some(label), Some(out)) => of_table(options, label, out, global)?,
        (false, _, _) => return Err(Failure::Options("a table needs --label and --out")),
    };
    let path = path.display().to_string();
    Ok(match global {
        Global { json: true, .. } => json(&json!({ "report": path })),
        Global { quiet: true, .. } => String::new(),
        _ => format!("{path}\n"),
    })
}

fn is_html(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("html"))
}

fn folder(folder: &Folder) -> Result<PathBuf, Failure> {
    report::write(folder, &folder.read_study()?)?;
    Ok(folder.report())
}

fn of_table(
    options: &Options,
    label: &str,
    out: &Path,
    global: Global,
) -> Result<PathBuf, Failure> {
    let prepared = options.table.prepare(&options.input, label, global)?;
    let hold_out = options.table.hold_out();
    let list = default_classifiers();
    let (mut results, mut refused) = (vec![], vec![]);
    for settings in &list {
        match prepared.validate(settings, hold_out, Workers::all()) {
            Ok(judged) => results.push((settings.kind(), judged)),
            Err(EvaluationError::TableModel(error @ TableModelError::Missing { .. })) => {
                refused.push((settings.kind(), error.to_string()));
            }
            Err(error) => return Err(error.into()),
        }
    }
    if let Some((_, judged)) = results.first() {
        warn(global, &judged.warnings);
    }
    let cart = list.iter().find(|settings| settings.kind() == Kind::Cart);
    let cart = cart.cloned().unwrap_or_else(|| Kind::Cart.default_settings());
    let html = render(&TableMaterial {
        name: &options.input.file_name().unwrap_or_default().to_string_lossy(),
        prepared: &prepared,
        held_out: &options.table.held_out(),
        class_weights: &options.table.weights_in_words(),
        results: &results,
        refused: &refused,
        tree: &prepared.train(&cart)?,
    });
    write_atomically(out, |file| file.write_all(html.as_bytes())).map_err(EvaluationError::File)?;
    Ok(out.into())
}
