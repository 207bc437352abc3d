//! `servotwin train`: trains the hierarchies of a campaign, or a classifier on any table of features.

use super::evaluate::workers;
use super::{TableOptions, warn};
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::render::{Side, TextTable, json};
use crate::{Global, stop};
use clap::ValueEnum;
use serde_json::json;
use servotwin::evaluation::comparison::default_classifiers;
use servotwin::evaluation::model_file;
use servotwin::evaluation::table_model::{GroupResult, JudgedClassifier};
use servotwin::job::{self, Folder, manifest};
use servotwin::parallel::Workers;
use servotwin_diagnosis::classifiers::{ALL, ClassifierKind};
use servotwin_learning::classifiers::Settings;
use servotwin_report::words::rate;
use std::path::PathBuf;

/// Train the hierarchies of a campaign, or a classifier from a table.
///
/// With the output folder of a campaign, writes a hierarchy for each data set into it. With a table of features,
/// reports how good a classifier is on held-out rows. With `--out`, also writes a classifier trained on all rows, or on
/// the training rows if the split is fixed.
#[derive(clap::Args)]
pub struct Options {
    /// The output folder of a campaign, or a table (.csv or .parquet) whose rows are examples and whose columns are
    /// features.
    input: PathBuf,
    #[command(flatten)]
    table: TableOptions,
    /// The classifier.
    #[arg(long, default_value = "cart")]
    classifier: Choice,
    /// Maximum number of questions on a path through a tree (cart [default: 7], boosted_trees [default: 4],
    /// random_forest [default: no limit], adaboost [default: as many as one leaf per class needs]).
    #[arg(long)]
    depth: Option<usize>,
    /// Number of trees (adaboost [default: 50], boosted_trees [default: 60], random_forest
    /// [default: 100]).
    #[arg(long)]
    rounds: Option<usize>,
    /// Write the trained model to this .json file.
    #[arg(long)]
    out: Option<PathBuf>,
}

/// A kind of classifier, by its name on the command line.
#[derive(Debug, Clone, Copy)]
struct Choice(ClassifierKind);

impl ValueEnum for Choice {
    fn value_variants<'a>() -> &'a [Self] {
        const CHOICES: [Choice; ALL.len()] = {
            let mut choices = [Choice(ALL[0]); ALL.len()];
            let mut place = 0;
            while place < ALL.len() {
                choices[place] = Choice(ALL[place]);
                place += 1;
            }
            choices
        };
        &CHOICES
    }

    fn to_possible_value(&self) -> Option<clap::builder::PossibleValue> {
        Some(clap::builder::PossibleValue::new(self.0.id()))
    }
}

impl Options {
    /// The files that the command reads and writes.
    pub fn paths(&self) -> Paths {
        let read = Paths::default().read("INPUT", [&self.input]).read("--test", &self.table.test);
        read.write("--out", Format::JSON, &self.out)
    }

    fn settings(&self) -> Result<Settings, Failure> {
        let chosen = default_classifiers().into_iter().find(|s| s.kind() == self.classifier.0);
        let mut chosen = chosen.unwrap_or_else(|| Settings::default_of(self.classifier.0));
        match (&mut chosen, self.depth) {
            (Settings::Cart(cart), depth) => cart.max_depth = Some(depth.unwrap_or(7)),
            (_, None) => {}
            (Settings::BoostedTrees(boosted), Some(depth)) => boosted.max_depth = depth,
            (Settings::RandomForest(forest), Some(depth)) => forest.max_depth = Some(depth),
            (Settings::Adaboost(boost), Some(depth)) => boost.max_depth = Some(depth),
            _ => return Err(Failure::Options("--depth is for classifiers made of trees")),
        }
        match (&mut chosen, self.rounds) {
            (_, None) => {}
            (Settings::BoostedTrees(boosted), Some(rounds)) => boosted.trees = rounds,
            (Settings::RandomForest(forest), Some(rounds)) => forest.trees = rounds,
            (Settings::Adaboost(boost), Some(rounds)) => boost.rounds = rounds,
            _ => return Err(Failure::Options("--rounds is for classifiers made of many trees")),
        }
        Ok(chosen)
    }
}

/// Returns the text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    match (options.input.is_dir(), &options.table.label) {
        (true, None) => folder(&Folder::new(&options.input), global),
        (true, Some(_)) => Err(Failure::Options("--label is for tables, not for folders")),
        (false, Some(label)) => of_table(options, label, global),
        (false, None) => Err(Failure::Options("a table needs --label, the column with the class")),
    }
}

fn folder(folder: &Folder, global: Global) -> Result<String, Failure> {
    stop::heed();
    let (study, _hold) = folder.open()?;
    let (mut text, mut results) = (String::new(), vec![]);
    for (subject, trained) in job::train_all(folder, &study, workers(None))? {
        let path = folder.panel(subject);
        let stages: Vec<&str> =
            trained.trees.stages.iter().map(|stage| stage.id.as_str()).collect();
        text += &format!(
            "{}: {} trees and a committee: {}\n",
            path.display(),
            stages.len(),
            stages.join(" ")
        );
        results.push(json!({ "subject": subject, "stages": stages }));
    }
    manifest::write(folder, &study)?;
    Ok(match global {
        Global { json: true, .. } => json(&json!(results)),
        Global { quiet: true, .. } => String::new(),
        _ => text,
    })
}

fn of_table(options: &Options, label: &str, global: Global) -> Result<String, Failure> {
    let prepared = options.table.prepare(&options.input, label, global)?;
    let settings = options.settings()?;
    let judged = prepared.validate(&settings, options.table.hold_out(), Workers::all())?;
    let kind = options.classifier.0;
    warn(global, &judged.warnings);
    // A single tree trains quickly, so its warnings appear even if no model is written.
    if options.out.is_some() || kind == ClassifierKind::Cart {
        let model = prepared.train(&settings)?;
        warn(global, &prepared.hairline_warnings(&model));
        if let Some(path) = &options.out {
            model_file::write(path, &model)?;
        }
    }
    let held_out = options.table.held_out();
    Ok(match global.json {
        true => {
            let mut result = json!({ "classifier": kind.id(), "held_out": held_out });
            join(&mut result, json!(judged));
            result["features"] = json!(prepared.samples().feature_names());
            result["unused"] = json!(prepared.unused);
            json(&result)
        }
        false => format!("{}, held out: {held_out}\n{}", kind.title(), people(&judged)),
    })
}

/// Adds the entries of an object to another.
pub fn join(result: &mut serde_json::Value, more: serde_json::Value) {
    if let (Some(result), serde_json::Value::Object(more)) = (result.as_object_mut(), more) {
        result.extend(more);
    }
}

/// The maximum number of groups shown, the worst first.
const GROUPS_SHOWN: usize = 20;

/// Describes a result for readers.
pub fn people(judged: &JudgedClassifier) -> String {
    let score = &judged.score;
    let percent =
        |share: Option<f64>| share.map_or("–".into(), |s| format!("{:.2} %", 100.0 * s));
    let over = if judged.intervals_over_groups { ", drawing groups" } else { "" };
    let accuracy = score.accuracy;
    let mut text = format!(
        "accuracy {} ({} … {} at 95 %{over}), {} of {} rows; balanced {}\n",
        percent(accuracy.share),
        percent(Some(accuracy.low)),
        percent(Some(accuracy.high)),
        accuracy.count,
        accuracy.of,
        percent(score.balanced_accuracy),
    );
    if let Some(baseline) = &judged.baseline {
        text += &format!(
            "always saying '{}' would be right in {}\n",
            baseline.class,
            percent(baseline.accuracy)
        );
    }
    let mut grid = TextTable::new(&[
        ("class", Side::Left),
        ("rows", Side::Right),
        ("found", Side::Right),
        ("of those said right", Side::Right),
        ("most often taken for", Side::Left),
    ]);
    for (class, result) in judged.classes.iter().enumerate() {
        let others = score.confusion[class].iter().enumerate().filter(|(other, _)| *other != class);
        // Among equally frequent classes, take the first.
        let worst = others.rev().max_by_key(|(_, count)| **count).filter(|(_, count)| **count > 0);
        let worst = worst.map(|(other, count)| format!("{} ({count})", score.classes[other]));
        grid.push(vec![
            result.class.clone(),
            result.recall.of.to_string(),
            rate(Some(result.recall)),
            percent(result.precision),
            worst.unwrap_or_default(),
        ]);
    }
    text += &format!("\n{}", grid.text());
    if !judged.groups.is_empty() {
        text += &format!("\n{}", groups(&judged.groups));
    }
    text
}

fn groups(results: &[GroupResult]) -> String {
    let mut worst: Vec<&GroupResult> = results.iter().collect();
    let share = |result: &GroupResult| result.right as f64 / result.rows as f64;
    worst.sort_by(|a, b| share(a).total_cmp(&share(b)));
    let mut grid = TextTable::new(&[
        ("group", Side::Left),
        ("rows", Side::Right),
        ("right", Side::Right),
        ("classes", Side::Left),
    ]);
    for result in worst.iter().take(GROUPS_SHOWN) {
        grid.push(vec![
            result.group.clone(),
            result.rows.to_string(),
            format!("{:.2} %", 100.0 * share(result)),
            result.classes.join(", "),
        ]);
    }
    let more = worst.len().saturating_sub(GROUPS_SHOWN);
    let rest = if more > 0 { format!("and {more} more groups\n") } else { String::new() };
    grid.text() + &rest
}
