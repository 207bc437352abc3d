//! `servotwin train`: the hierarchies of a campaign, or a classifier from any table of features.

use super::TableOptions;
use super::evaluate::workers;
use crate::failure::Failure;
use crate::render::{Grid, Side, json};
use crate::{Global, stop};
use clap::ValueEnum;
use serde_json::json;
use servotwin::evaluation::comparison::default_classifiers;
use servotwin::evaluation::foreign::{HoldOut, train_table, validate_table};
use servotwin::evaluation::model_file;
use servotwin::evaluation::parallel::Workers;
use servotwin::evaluation::score::Score;
use servotwin::job::{self, Folder, manifest};
use servotwin::table;
use servotwin_diagnosis::classifiers::{ALL, Kind, Settings};
use std::path::PathBuf;

/// Train the hierarchies of a campaign, or a classifier from a table.
///
/// With the output folder of a campaign, writes a hierarchy for each data set there. With a table
/// of features, says how good a classifier is on rows held out.
#[derive(clap::Args)]
pub struct Options {
    /// The output folder of a campaign; or a table (.csv or .parquet): a row is an example, columns
    /// are features.
    input: PathBuf,
    #[command(flatten)]
    table: TableOptions,
    /// The classifier.
    #[arg(long, default_value = "cart")]
    classifier: Choice,
    /// Questions on the longest way through a tree (cart [default: 7],
    /// random_forest, adaboost).
    #[arg(long)]
    depth: Option<usize>,
    /// Hold out this last part of each class instead of folds: for series in
    /// time.
    #[arg(long, value_name = "SHARE", conflicts_with = "folds")]
    last: Option<f64>,
    /// Write the model, trained with all rows, to this .json file.
    #[arg(long)]
    out: Option<PathBuf>,
}

/// A kind of classifier as a word of the command line.
#[derive(Debug, Clone, Copy)]
struct Choice(Kind);

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
    fn settings(&self) -> Settings {
        let chosen = default_classifiers().into_iter().find(|s| s.kind() == self.classifier.0);
        let mut chosen = chosen.unwrap_or_else(|| self.classifier.0.default_settings());
        match (&mut chosen, self.depth) {
            (Settings::Cart(cart), depth) => cart.max_depth = Some(depth.unwrap_or(7)),
            (Settings::RandomForest(forest), Some(depth)) => forest.max_depth = Some(depth),
            (Settings::Adaboost(boost), Some(depth)) => boost.max_depth = depth,
            _ => {}
        }
        chosen
    }
}

/// The text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    match (options.input.is_dir(), &options.table.label) {
        (true, None) => folder(&Folder::new(&options.input), global),
        (true, Some(_)) => Err(Failure::Options("--label is for tables, not for folders")),
        (false, Some(label)) => of_table(options, label, global),
        (false, None) => Err(Failure::Options("a table needs --label, the column with the class")),
    }
}

fn folder(folder: &Folder, global: Global) -> Result<String, Failure> {
    stop::listen();
    let study = folder.read_study()?;
    let (mut text, mut results) = (String::new(), vec![]);
    for subject in job::subjects(folder, &study)? {
        let trained = job::train(folder, &study, subject, workers(None))?;
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
    let table = table::read(&options.input)?;
    let selection = options.table.selection(label);
    let settings = options.settings();
    let last = options.last.map(|share| HoldOut::Last { share });
    let hold_out = last.unwrap_or(options.table.hold_out());
    let score = validate_table(&table, &selection, &settings, hold_out, Workers::all())?;
    if let Some(path) = &options.out {
        model_file::write(path, &train_table(&table, &selection, &settings)?)?;
    }
    let title = options.classifier.0.title();
    Ok(match global.json {
        true => json(&json!({ "classifier": options.classifier.0.id(), "score": score })),
        false => format!("{title}, rows held out:\n{}", people(&score)),
    })
}

/// A score for people.
pub fn people(score: &Score) -> String {
    let percent = |share: f64| format!("{:.2} %", 100.0 * share);
    let rate = score.accuracy;
    let mut text = format!(
        "accuracy {} ({} … {} at 95 %), {} of {} rows; balanced {}\n\n",
        rate.share.map_or("–".into(), percent),
        percent(rate.low),
        percent(rate.high),
        rate.count,
        rate.of,
        score.balanced_accuracy.map_or("–".into(), percent),
    );
    let mut grid = Grid::new(&[
        ("class", Side::Left),
        ("rows", Side::Right),
        ("found", Side::Right),
        ("most often taken for", Side::Left),
    ]);
    for (class, counts) in score.confusion.iter().enumerate() {
        let rows: u64 = counts.iter().sum();
        let found = (rows > 0).then(|| percent(counts[class] as f64 / rows as f64));
        let others = counts.iter().enumerate().filter(|(other, _)| *other != class);
        // Of equally frequent ones the first.
        let worst = others.rev().max_by_key(|(_, count)| **count);
        let worst = worst.filter(|(_, count)| **count > 0);
        let worst = worst.map(|(other, count)| format!("{} ({count})", score.classes[other]));
        let found = found.unwrap_or_else(|| "–".into());
        let name = score.classes[class].clone();
        grid.push(vec![name, rows.to_string(), found, worst.unwrap_or_default()]);
    }
    text += &grid.text();
    text
}
