//! `servotwin report`: writes the results of the other stages, or of a table, as one HTML file.

use super::evaluate::{Judging, MODEL_OF_FOLDER, OfTable, judge, workers};
use super::{TableOptions, warn};
use crate::Global;
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::render::json;
use serde_json::json;
use servotwin::evaluation::EvaluationError;
use servotwin::evaluation::comparison::default_classifiers;
use servotwin::evaluation::table_model::TableModelError;
use servotwin::files::write_atomically;
use servotwin::job::Folder;
use servotwin_diagnosis::classifiers::ClassifierKind;
use servotwin_report::table_model::{TableMaterial, render};
use std::path::{Path, PathBuf};

/// Write a report: one HTML file that needs no network.
///
/// With the output folder of an evaluated campaign, writes report.html and its figures as SVG into this folder. With a
/// table, compares all classifiers on held-out rows and draws the tree. With a table and a trained `--model`, shows how
/// good the model is on it.
#[derive(clap::Args)]
pub struct Options {
    /// The output folder of a campaign that `servotwin evaluate` has processed, or a table (.csv or .parquet).
    input: PathBuf,
    #[command(flatten)]
    judging: Judging,
    #[command(flatten)]
    table: TableOptions,
    /// Write the report to this .html file.
    #[arg(long)]
    out: Option<PathBuf>,
}

impl Options {
    /// The files that the command reads and writes.
    pub fn paths(&self) -> Paths {
        Paths::default()
            .read("INPUT", [&self.input])
            .read("--test", &self.table.test)
            .read("--model", &self.judging.model)
            .write("--out", Format::HTML, &self.out)
    }
}

/// Returns the text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let path = match options.input.is_dir() {
        true => folder(options)?,
        false => of_table(options, global)?,
    };
    let path = path.display().to_string();
    Ok(match global {
        Global { json: true, .. } => json(&json!({ "report": path })),
        Global { quiet: true, .. } => String::new(),
        _ => format!("{path}\n"),
    })
}

fn folder(options: &Options) -> Result<PathBuf, Failure> {
    if options.judging.model.is_some() {
        return Err(Failure::Options(MODEL_OF_FOLDER));
    }
    if options.out.is_some() {
        return Err(Failure::Options(
            "--out is for tables: the report of a folder is report.html in it",
        ));
    }
    if options.table.is_given() || options.table.group.is_some() {
        return Err(Failure::Options(
            "--label and what goes with it are for tables, not for folders",
        ));
    }
    let folder = Folder::new(&options.input);
    let (study, _hold) = folder.open()?;
    servotwin_report::write(&folder, &study)?;
    Ok(folder.report())
}

fn of_table(options: &Options, global: Global) -> Result<PathBuf, Failure> {
    let (table, out) = (&options.table, options.out.as_ref());
    let html = match (&options.judging.model, &table.label, out) {
        (Some(_), _, _) if table.is_given() => {
            return Err(Failure::Options(
                "a --model knows its label and features: beside it only --group and --out",
            ));
        }
        (Some(rule), None, Some(_)) => of_model(options, rule, global)?,
        (None, Some(label), Some(_)) => of_classifiers(options, label, global)?,
        _ => return Err(Failure::Options("a table needs --out, and --label or --model")),
    };
    let out = out.expect("it was there");
    write_atomically(out, |file| file.write_all(html.as_bytes())).map_err(EvaluationError::File)?;
    Ok(out.into())
}

/// The last part of a path, which names the table or model in a report.
fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// The report of a trained model on a table.
fn of_model(options: &Options, rule: &Path, global: Global) -> Result<String, Failure> {
    let OfTable { model, prepared, judged } =
        judge(&options.input, rule, options.table.group.as_deref(), global)?;
    Ok(render(&TableMaterial {
        name: &name(&options.input),
        prepared: &prepared,
        held_out: "",
        class_weights: "",
        results: &[(model.model.kind(), judged)],
        refused: &[],
        tree: &model,
        model: Some(&name(rule)),
    }))
}

/// The report that compares all classifiers on a table.
fn of_classifiers(options: &Options, label: &str, global: Global) -> Result<String, Failure> {
    let prepared = options.table.prepare(&options.input, label, global)?;
    let hold_out = options.table.hold_out();
    let list = default_classifiers();
    let (mut results, mut refused) = (vec![], vec![]);
    for settings in &list {
        match prepared.validate(settings, hold_out, workers(options.judging.threads)) {
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
    let cart = list.iter().find(|settings| settings.kind() == ClassifierKind::Cart);
    let cart = cart.cloned().unwrap_or_else(|| {
        servotwin_learning::classifiers::Settings::default_of(ClassifierKind::Cart)
    });
    Ok(render(&TableMaterial {
        name: &name(&options.input),
        prepared: &prepared,
        held_out: &options.table.held_out(),
        class_weights: &options.table.weights_in_words(),
        results: &results,
        refused: &refused,
        tree: &prepared.train(&cart)?,
        model: None,
    }))
}
