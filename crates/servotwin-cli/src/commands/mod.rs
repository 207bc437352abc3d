//! One file for each command, and their shared code.

pub mod band;
pub mod cache;
pub mod campaign;
pub mod check;
pub mod completions;
pub mod components;
pub mod describe;
mod design;
pub mod evaluate;
pub mod explain;
pub mod export;
pub mod faults;
pub mod faulttree;
pub mod features;
pub mod fit;
pub mod flights;
pub mod fly;
mod fly_cost;
mod fly_truth;
pub mod fmea;
pub mod function_rate;
pub mod history;
pub mod init;
mod log_folder;
pub mod man;
pub mod merge;
pub mod predict;
mod progress;
pub mod prove;
pub mod report;
pub mod results;
pub mod schema;
pub mod sensors;
pub mod serve;
pub mod simulate;
pub mod study;
mod summary;
pub mod train;
pub mod watch;
pub mod worst_case;

use crate::Global;
use crate::failure::Failure;
use crate::out;
use servotwin::document::counted;
use servotwin::evaluation::EvaluationError;
use servotwin::evaluation::table_model::{
    ClassWeights, HoldOut, PreparedTable, Selection, TableModel, Unused, prepare,
};
use servotwin::fit::FitError;
use servotwin::job::{Folder, Hold, Kept};
use servotwin::sanitize;
use servotwin::study::{Setting, Study};
use servotwin::system::System;
use servotwin::table::{self, Table};
use servotwin_watch::intake::{self, IntakeError};
use servotwin_watch::map::Map;
use servotwin_watch::source::SourceError;
use servotwin_watch::span::LogSpan;
use std::io::Write;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

/// The system that a command is about.
#[derive(clap::Args)]
pub struct SystemOption {
    /// A system file, or the name of a built-in system (aileron_dual, spring_actuator, valve_and_cylinder,
    /// press_axis) [default: aileron_dual, the aileron with two actuators].
    #[arg(value_name = "SYSTEM")]
    path: Option<PathBuf>,
}

impl SystemOption {
    /// Reads the system.
    pub fn read(&self) -> Result<System, Failure> {
        match &self.path {
            Some(path) => Ok(System::read(path)?),
            None => Ok(System::default()),
        }
    }
}

/// The study that a command runs, and where its results go.
#[derive(clap::Args)]
pub struct StudyOptions {
    /// A study file, the name of a built-in study (paper, spring_actuator, press_axis), or a folder with results, which
    /// stands for their study [default: paper, the paper's study of the aileron].
    #[arg(value_name = "STUDY")]
    study: Option<PathBuf>,
    /// The folder for data sets, models, results and the report.
    #[arg(long, value_name = "FOLDER", default_value = "out")]
    out: PathBuf,
    /// Use the full sizes of the study instead of those in its section `[quick]`. Flights use those in `flights.full`.
    #[arg(long)]
    full: bool,
    /// Remove results of another study, or of the full size of this study, from the folder.
    #[arg(long)]
    replace: bool,
    /// Number of threads [default: all processors; the results do not depend
    /// on it].
    #[arg(long, value_parser = threads)]
    threads: Option<usize>,
}

impl StudyOptions {
    /// Reads the study and warns about doubtful entries. Its size is full if the user wants that, or if the folder
    /// holds it.
    fn read(&self, global: Global) -> Result<Study, Failure> {
        let study = self.find()?;
        warn(global, &study.warnings_in_words());
        if self.full {
            return Ok(study.full()?);
        }
        if study.is_full || self.replace || !Folder::new(&self.out).holds_full(&study) {
            return Ok(study);
        }
        let folder = self.out.display();
        note(
            global,
            &format!("{folder} holds the full study, which goes on (--replace for the quick one)"),
        );
        Ok(study.full()?)
    }

    /// Whether the user named a study.
    #[cfg(feature = "serve")]
    fn is_named(&self) -> bool {
        self.study.is_some()
    }

    fn find(&self) -> Result<Study, Failure> {
        find_study(self.study.as_deref())
    }

    /// Prepares the folder for the study, and reports removed results.
    fn keep(&self, study: &Study, global: Global) -> Result<Hold, Failure> {
        let Kept { hold, dropped } = Folder::new(&self.out).keep_study(study, self.replace)?;
        if dropped > 0 {
            removed(global, &self.out.display().to_string(), dropped);
        }
        Ok(hold)
    }
}

/// The study of a file, a built-in study, or that of a folder with results.
fn find_study(path: Option<&Path>) -> Result<Study, Failure> {
    Ok(match path {
        Some(path) if path.is_dir() => Folder::new(path).read_study()?,
        Some(path) => Study::read(path)?,
        None => Study::default(),
    })
}

/// Reports that results of an earlier version of the study were removed.
fn removed(global: Global, folder: &str, files: usize) {
    let files = counted(files, "result file");
    note(global, &format!("{folder}: {files} of before the study was changed removed"));
}

/// What a command makes of a table's columns and rows.
#[derive(clap::Args)]
#[command(next_help_heading = "Tables")]
pub struct TableOptions {
    /// The column with the class. This option and all that follow apply to tables only.
    #[arg(long)]
    label: Option<String>,
    /// Limits that turn a measured label into classes: up to the first limit, up to the second, and above the last.
    #[arg(long, value_name = "A,B,…", value_delimiter = ',', allow_hyphen_values = true)]
    label_limits: Vec<f64>,
    /// The column with the group. Rows of one group are held out together.
    #[arg(long)]
    group: Option<String>,
    /// The columns to learn from, separated by commas [default: all other columns that carry information].
    #[arg(long, value_delimiter = ',')]
    features: Vec<String>,
    /// Columns to ignore in training, separated by commas.
    #[arg(long, value_delimiter = ',')]
    ignore: Vec<String>,
    /// Columns whose numbers are names, separated by commas. Each number becomes a feature.
    #[arg(long, value_delimiter = ',')]
    categorical: Vec<String>,
    /// The weight of each class's rows in training: 'balanced', or CLASS=WEIGHT,…
    #[arg(long, value_name = "WEIGHTS", value_parser = class_weights)]
    class_weights: Option<ClassWeights>,
    /// Number of folds.
    #[arg(long, default_value_t = 5)]
    folds: usize,
    /// Seed of the folds, and of classifiers that draw random numbers.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Hold out this last part of each class instead of folds; with --group, its last groups. Use this for time series.
    #[arg(long, value_name = "SHARE", conflicts_with_all = ["folds", "split_column", "test"])]
    last: Option<f64>,
    /// The column that assigns each row to training or test, instead of folds.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["folds", "test"])]
    split_column: Option<String>,
    /// The value of --split-column that means test [default: test, testing, true or 1, if the other value is train,
    /// training, false or 0].
    #[arg(long, value_name = "VALUE", requires = "split_column")]
    test_value: Option<String>,
    /// A second table to test with, instead of folds. All rows of the first table are used for training.
    #[arg(long, value_name = "FILE", conflicts_with = "folds")]
    test: Option<PathBuf>,
}

/// The scenario of an option `--setting`.
fn setting_of(name: &str) -> Result<Setting, Failure> {
    let found = Setting::ALL.into_iter().find(|setting| setting.name() == name);
    found.ok_or_else(|| Failure::OutOfRange {
        option: "--setting",
        given: name.into(),
        range: Setting::ALL.map(Setting::name).join(", ").into(),
    })
}

/// Parses a number of threads from the command line.
fn threads(text: &str) -> Result<usize, String> {
    let threads = text.parse::<NonZeroUsize>();
    threads.map(NonZeroUsize::get).map_err(|_| "a number of threads is 1 or more".into())
}

/// Parses class weights from the command line.
fn class_weights(text: &str) -> Result<ClassWeights, String> {
    if text == "balanced" {
        return Ok(ClassWeights::Balanced);
    }
    let pair = |part: &str| {
        let (class, weight) = part.rsplit_once('=')?;
        Some((class.trim().to_owned(), weight.trim().parse::<f64>().ok()?))
    };
    let pairs = text.split(',').map(pair).collect::<Option<Vec<_>>>();
    pairs.map(ClassWeights::Given).ok_or_else(|| "'balanced' or CLASS=WEIGHT,… is needed".into())
}

impl TableOptions {
    fn selection(&self, label: &str) -> Selection {
        Selection {
            label: label.into(),
            label_limits: self.label_limits.clone(),
            group: self.group.clone(),
            split: self.split_column.clone(),
            test_value: self.test_value.clone(),
            features: self.features.clone(),
            ignored: self.ignore.clone(),
            categorical: self.categorical.clone(),
            class_weights: self.class_weights.clone().unwrap_or_default(),
        }
    }

    fn hold_out(&self) -> HoldOut {
        match self.last {
            Some(share) => HoldOut::Last { share },
            None if self.split_column.is_some() || self.test.is_some() => HoldOut::Fixed,
            None => HoldOut::Folds { folds: self.folds, seed: self.seed },
        }
    }

    /// Whether any option for tables is given, other than `--group`, `--folds` and `--seed`.
    fn is_given(&self) -> bool {
        let lists = [&self.features, &self.ignore, &self.categorical];
        let texts = [&self.label, &self.split_column, &self.test_value];
        texts.iter().any(|text| text.is_some())
            || lists.iter().any(|list| !list.is_empty())
            || !self.label_limits.is_empty()
            || self.class_weights.is_some()
            || self.last.is_some()
            || self.test.is_some()
    }

    /// Checks that the options can hold rows out.
    fn check(&self) -> Result<(), Failure> {
        let wrong = |option, given, range: &'static str| Failure::OutOfRange {
            option,
            given,
            range: range.into(),
        };
        match self.hold_out() {
            HoldOut::Folds { folds, .. } if folds < 2 => {
                Err(wrong("--folds", folds.to_string(), "at least 2"))
            }
            HoldOut::Last { share } if !(share > 0.0 && share < 1.0) => {
                Err(wrong("--last", share.to_string(), "above 0, below 1"))
            }
            _ => Ok(()),
        }
    }

    /// Describes the class weights.
    fn weights_in_words(&self) -> String {
        match &self.class_weights {
            None | Some(ClassWeights::Equal) => "every row the same".into(),
            Some(ClassWeights::Balanced) => "balanced: every class the same".into(),
            Some(ClassWeights::Given(given)) => {
                let pairs = given.iter().map(|(class, weight)| format!("{class} {weight}"));
                pairs.collect::<Vec<_>>().join(", ") + ", others 1"
            }
        }
    }

    /// Describes how rows are held out.
    fn held_out(&self) -> String {
        let together = match &self.group {
            Some(group) => format!(", rows of one {group} together"),
            None => String::new(),
        };
        let how = match (self.last, &self.split_column, &self.test) {
            (Some(share), _, _) => {
                let part = if self.group.is_some() { "groups" } else { "part" };
                format!("the last {part} of each class ({share})")
            }
            (None, Some(column), _) => format!("as column {column} states"),
            (None, None, Some(path)) => format!("the rows of {}", path.display()),
            (None, None, None) if self.group.is_some() => {
                format!("{} folds, seed {}", self.folds, self.seed)
            }
            (None, None, None) => {
                let (folds, seed) = (self.folds, self.seed);
                format!("{folds} folds with equal shares of the classes, seed {seed}")
            }
        };
        how + &together
    }

    /// Reads the table and the optional test table, and prepares them; notes go to standard error.
    fn prepare(&self, input: &Path, label: &str, global: Global) -> Result<PreparedTable, Failure> {
        self.check()?;
        let selection = self.selection(label);
        let others = [&self.group, &self.split_column];
        let mixed = others.into_iter().flatten().chain(&self.categorical);
        let mixed: Vec<&str> = std::iter::once(label).chain(mixed.map(String::as_str)).collect();
        // With named features, no other column is needed.
        let named = &self.features;
        let is_wanted = |name: &str| {
            let is_other = || mixed.contains(&name) || self.ignore.iter().any(|i| i == name);
            named.is_empty() || named.iter().any(|feature| feature == name) || is_other()
        };
        let table = read_wanted(input, &mixed, &is_wanted, global)?;
        let test = match &self.test {
            Some(path) => Some(read_wanted(path, &mixed, &is_wanted, global)?),
            None => None,
        };
        let prepared = prepare(table, test, &selection)?;
        for Unused { column, reason } in &prepared.unused {
            note(global, &format!("column '{column}' is not used: it {reason}"));
        }
        Ok(prepared)
    }
}

/// Reads a table, and notes an unusual dialect and left-out columns.
fn read_table(path: &Path, mixed: &[&str], global: Global) -> Result<Table, Failure> {
    read_wanted(path, mixed, &|_| true, global)
}

/// Like [`read_table`], for some columns. Other columns of a Parquet file are not decoded.
fn read_wanted(
    path: &Path,
    mixed: &[&str],
    is_wanted: &dyn Fn(&str) -> bool,
    global: Global,
) -> Result<Table, Failure> {
    let table = table::read_wanted(path, mixed, is_wanted)?;
    if let Some(dialect) = &table.origin().dialect {
        note(global, &format!("{}: read with {dialect}", path.display()));
    }
    for (_, reason) in table.origin().left_out() {
        note(global, &format!("{}: a column is left out: {reason}", path.display()));
    }
    Ok(table)
}

/// Whether a model reads a column, or an option names it.
fn is_read<'o>(model: &'o TableModel, named: &'o [&str]) -> impl Fn(&str) -> bool + 'o {
    let read = model.columns_read();
    // A table without any column would lose its number of rows.
    let all = read.is_empty();
    move |column| all || column == model.label || read.contains(column) || named.contains(&column)
}

/// The part of a log that a command reads.
#[derive(clap::Args)]
pub struct SpanOptions {
    /// Read the log from this time on: seconds after its first sample (12.5, 2min), or a date (2026-11-21T08:15:02).
    #[arg(long, value_name = "TIME")]
    from: Option<String>,
    /// Read the log up to this time.
    #[arg(long, value_name = "TIME")]
    to: Option<String>,
}

impl SpanOptions {
    /// Reads both times.
    pub fn read(&self) -> Result<LogSpan, Failure> {
        let span = LogSpan::parse(self.from.as_deref(), self.to.as_deref());
        Ok(span.map_err(SourceError::Cut)?)
    }
}

/// Reads a part of a log as a table of times, inputs and sensors in SI. A map assigns the columns; without a map, their
/// names do. Irregularities of the log are noted.
fn read_log(
    path: &Path,
    map: Option<&Map>,
    span: LogSpan,
    study: &Study,
    global: Global,
) -> Result<Table, Failure> {
    let whole = intake::read(path, map, span, study).map_err(|error| match error {
        IntakeError::Source(error) => error.into(),
        IntakeError::Map(error) => error.into(),
        IntakeError::Table(error) => error.into(),
        IntakeError::Record(error) => {
            Failure::Fit(FitError::Record { name: path.display().to_string(), error })
        }
    })?;
    let (name, counts) = (path.display(), &whole.counts);
    if !whole.assumed.is_empty() {
        note(global, &format!("{name}: SI is assumed in {}", sanitize::list(&whole.assumed)));
    }
    let met = counts.met().map(|(kind, tally)| {
        let (words, place) = (kind.words().1, counts.place(tally));
        format!("{words} ({}, first {place})", tally.count)
    });
    let met: Vec<String> = met.collect();
    if !met.is_empty() {
        let (frames, counted, samples) = (counts.frames, &counts.counted, counts.samples);
        let met = met.join("; ");
        note(global, &format!("{name}: {frames} {counted}s became {samples} samples: {met}"));
    }
    Ok(whole.table)
}

/// The failure for a table that contradicts a study file or a model. An error about a non-finite number already names
/// its place.
fn not_as(path: &Path, rule: &Path, error: EvaluationError) -> Failure {
    match error {
        EvaluationError::Table(table::TableError::NotFinite { .. }) => error.into(),
        error => Failure::NotAs { path: path.into(), rule: rule.into(), error: Box::new(error) },
    }
}

/// The failure for a table that lacks a column of a model or has it with another kind. Other errors are not the table's
/// fault.
fn not_as_model(path: &Path, model: &Path, error: EvaluationError) -> Failure {
    use table::TableError::{UnknownColumn, WrongKind};
    match error {
        EvaluationError::Table(UnknownColumn { .. } | WrongKind { .. }) => {
            not_as(path, model, error)
        }
        error => error.into(),
    }
}

/// Writes a note to standard error, unless `--quiet` is set.
fn note(global: Global, text: &str) {
    if !global.quiet {
        // If standard error is closed, there is no way to report that.
        let _ = writeln!(out::stderr(), "note: {text}");
    }
}

/// Writes warnings to standard error, unless `--quiet` is set.
fn warn(global: Global, warnings: &[String]) {
    if !global.quiet {
        for warning in warnings {
            let _ = writeln!(out::stderr(), "warning: {warning}");
        }
    }
}
