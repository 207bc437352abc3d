//! A study of recordings: measured signals with labels, instead of a simulated plant.
//!
//! A small file in TOML names the records and assigns their columns (`docs/own-data.md` has worked examples):
//! ```toml
//! format = 1
//! records = "logs"                     # a folder of logs, each a record named like its file; or one table
//! record = "run"                       # the column that names the record, in one table and in the labels
//! labels = "labels.csv"                # a table with a row for each record; its columns join the records'
//! groups = ["session"]                 # columns: windows that share their values are on one side of every split
//! families = ["moments", "deviation"]  # all if not given
//! window_rows = 10                     # rows in a window; a shorter remainder is counted and not used
//! segments = 2                         # parts of a window, each with its own features
//! keep = ["note"]                      # copied to the windows; a window ends where one changes
//! conditions = ["load"]                # columns: each combination of their values has nominal values of its own
//! residuals = ["r1", "r2"]             # columns that are used as they are
//! folds = 5                            # how often windows are held out
//! classifiers = ["cart", "random_forest"]
//!
//! [healthy]                            # rows to learn nominal values from: all conditions hold
//! mode = "none"
//!
//! [[sensors]]                          # or measured and nominal separately
//! name = "p_a_1"
//! measured = "pressure_a_pa"
//! nominal = "twin_pressure_a_pa"       # a column, or twin.<sensor>; or, to be learned from the healthy rows,
//! # nominal_from = ["command_m"]       # a regression on these columns, [] for the mean
//! scale = 206.84e5                     # where learned, 100 deviations of healthy rows if not given
//! quantity = "pressure_a"              # `other` where not given
//! unit = 1                             # 1 where not given
//!
//! [[targets]]                          # what to learn from the windows
//! column = "mode"
//! healthy = "none"                     # its value without a fault, if it has one
//!
//! [twin]                               # gives every sensor of a system as a column twin.<sensor>
//! system = "axis.toml"                 # beside this file, or the name of a built-in system
//! period_s = 0.01                      # the time between two rows
//! inputs = { command = "command_m" }   # the column of each driven input, SI
//!
//! [novelty]                            # what is unlike the first healthy groups
//! healthy_groups = 3
//! ```
//!
//! The windows and features are those of simulated runs. A missing number does not stop a study: see `windows`.

pub mod judged;
pub mod model;
mod nominal;
pub mod novelty;
mod records;
mod twin;
pub(crate) mod windows;

pub use nominal::Nominal;
pub use windows::{NominalFit, NominalSource, Nominals, Windows};

use crate::evaluation::EvaluationError;
use crate::nearest::nearest;
use crate::simulate::SimulationError;
use crate::toml_text::TomlError;
use serde::Deserialize;
use servotwin_diagnosis::features::{ALL, Family, Quantity, Sensor, Sensors, find};
use std::collections::BTreeMap;
use std::path::PathBuf;
use twin::TwinChoice;

/// The supported format of these study files.
const FORMAT: u32 = 1;

/// The largest residual, in scales: products of four residuals, used in features, remain finite.
const FARTHEST: f64 = 1e50;

/// The study file of recordings.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordingStudy {
    format: u32,
    records: Option<PathBuf>,
    record: Option<String>,
    labels: Option<PathBuf>,
    #[serde(default)]
    groups: Vec<String>,
    #[serde(default)]
    families: Vec<String>,
    window_rows: usize,
    #[serde(default = "first")]
    segments: usize,
    #[serde(default)]
    keep: Vec<String>,
    #[serde(default)]
    conditions: Vec<String>,
    #[serde(default)]
    residuals: Vec<String>,
    #[serde(default)]
    healthy: BTreeMap<String, String>,
    #[serde(default)]
    sensors: Vec<SensorText>,
    #[serde(default)]
    targets: Vec<Target>,
    #[serde(default = "five")]
    folds: usize,
    #[serde(default = "tree_and_forest")]
    classifiers: Vec<String>,
    novelty: Option<NoveltyChoice>,
    twin: Option<TwinChoice>,
}

/// A column that is learned from the windows.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Target {
    /// The column.
    pub column: String,
    /// Its value without a fault, if it has one.
    pub healthy: Option<String>,
}

/// The windows from which novelty is learned.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct NoveltyChoice {
    /// The number of groups to learn from: the first healthy ones.
    healthy_groups: usize,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct SensorText {
    name: String,
    measured: String,
    nominal: Option<String>,
    nominal_from: Option<Vec<String>>,
    scale: Option<f64>,
    #[serde(default = "other")]
    quantity: String,
    #[serde(default = "first")]
    unit: usize,
}

fn other() -> String {
    "other".into()
}

fn first() -> usize {
    1
}

fn five() -> usize {
    5
}

/// One readable tree, and the ensemble that learns from missing values.
fn tree_and_forest() -> Vec<String> {
    vec!["cart".into(), "random_forest".into()]
}

/// Why a study file of recordings, or the recordings themselves, are invalid.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
pub enum RecordingError {
    /// The text is not valid; the message has line and column.
    #[error(transparent)]
    Syntax(Box<toml::de::Error>),
    /// An unsupported format.
    #[error("format {0} is not known, this version reads {FORMAT}")]
    Format(u32),
    /// An unknown word.
    #[error("no {what} is named '{word}'{}", did_you_mean(.nearest))]
    Unknown { what: &'static str, word: String, nearest: Option<String> },
    /// A number is out of range.
    #[error("{what} must be {allowed}")]
    OutOfRange { what: String, allowed: &'static str },
    /// The file names no sensor and no residual.
    #[error("there is nothing to measure: name 'residuals' or add [[sensors]]")]
    NoSensors,
    /// The file lacks a key that it needs.
    #[error("the study needs '{key}': {reason}")]
    Lacks { key: &'static str, reason: &'static str },
    /// No window is complete.
    #[error("no window of {window_rows} rows fits: the longest run of rows has {longest}")]
    NoWindow { window_rows: usize, longest: usize },
    /// A nominal value must be learned, but no row is marked as healthy.
    #[error(
        "the nominal value of '{sensor}' is to be learned, but no row is healthy: name them in [healthy], or give \
         healthy traces"
    )]
    NoHealthyRows { sensor: String },
    /// A sensor has both a nominal column and a learned nominal value, or a learned scale without a learned nominal
    /// value.
    #[error("sensor '{sensor}': {problem}")]
    Nominal { sensor: String, problem: &'static str },
    /// A number is so large that squares of residuals would overflow.
    #[error(
        "{place}, column '{column}': {value:e} is too far from its nominal value {nominal:e}; allowed is \
         {FARTHEST:e} times the scale of {scale:e}"
    )]
    TooFar { column: String, place: String, value: f64, nominal: f64, scale: f64 },
    /// The folder of records has none.
    #[error("{}: the folder has no logs (.csv, .parquet or .jsonl)", .0.display())]
    NoRecords(PathBuf),
    /// A record has no row in the table of labels, or several.
    #[error("the labels have {count} rows for the record '{record}'")]
    Labels { record: String, count: usize },
    /// The system of the twin cannot be read.
    #[error("the twin's system: {0}")]
    System(Box<TomlError>),
    /// The twin of a record cannot be simulated.
    #[error("the twin of the record '{record}': {error}")]
    Twin { record: String, error: Box<SimulationError> },
    /// The table does not match the study file, or training fails.
    #[error(transparent)]
    Evaluation(EvaluationError),
}

fn did_you_mean(nearest: &Option<String>) -> String {
    nearest.as_ref().map_or_else(String::new, |near| format!("; did you mean '{near}'?"))
}

impl<E: Into<EvaluationError>> From<E> for RecordingError {
    fn from(error: E) -> Self {
        RecordingError::Evaluation(error.into())
    }
}

impl RecordingStudy {
    /// Parses a study file.
    ///
    /// # Errors
    /// [`RecordingError`], except errors about a table.
    pub fn parse(text: &str) -> Result<Self, RecordingError> {
        let mut study: RecordingStudy =
            toml::from_str(text).map_err(|error| RecordingError::Syntax(Box::new(error)))?;
        if study.format != FORMAT {
            return Err(RecordingError::Format(study.format));
        }
        let residual = |name: &String| SensorText {
            name: name.clone(),
            measured: name.clone(),
            nominal: None,
            nominal_from: None,
            scale: Some(1.0),
            quantity: other(),
            unit: first(),
        };
        let residuals: Vec<SensorText> = study.residuals.drain(..).map(|r| residual(&r)).collect();
        study.sensors.extend(residuals);
        if let ([target], true) = (study.targets.as_slice(), study.healthy.is_empty()) {
            let healthy = target.healthy.iter().map(|value| (target.column.clone(), value.clone()));
            study.healthy.extend(healthy);
        }
        study.check()?;
        Ok(study)
    }

    /// Number of rows in a window.
    pub fn window_rows(&self) -> usize {
        self.window_rows
    }

    /// The tables that the study reads, relative to its file; a folder of logs is one.
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.records.iter().chain(&self.labels)
    }

    fn check(&self) -> Result<(), RecordingError> {
        let range = |holds: bool, what: &str, allowed| match holds {
            true => Ok(()),
            false => Err(RecordingError::OutOfRange { what: what.into(), allowed }),
        };
        if self.sensors.is_empty() {
            return Err(RecordingError::NoSensors);
        }
        range(self.window_rows >= 1, "window_rows", "at least 1")?;
        let whole = self.segments >= 1 && self.window_rows.is_multiple_of(self.segments);
        range(whole, "segments", "at least 1 and divide window_rows")?;
        for sensor in &self.sensors {
            let positive = sensor.scale.is_none_or(|scale| scale > 0.0 && scale.is_finite());
            range(positive, &format!("the scale of {}", sensor.name), "above 0")?;
            let problem = match (&sensor.nominal, &sensor.nominal_from, sensor.scale) {
                (Some(_), Some(_), _) => Some("either nominal or nominal_from"),
                (_, None, None) => Some("a scale is needed unless the nominal value is learned"),
                _ => None,
            };
            if let Some(problem) = problem {
                return Err(RecordingError::Nominal { sensor: sensor.name.clone(), problem });
            }
            range(sensor.unit >= 1, &format!("the unit of {}", sensor.name), "at least 1")?;
        }
        range(self.folds >= 2, "folds", "at least 2")?;
        if self.novelty.is_some() && (self.groups.is_empty() || self.healthy.is_empty()) {
            let reason = "novelty is learned from the first healthy groups";
            return Err(RecordingError::Lacks { key: "groups and [healthy]", reason });
        }
        let is_period = |twin: &TwinChoice| twin.period_s > 0.0 && twin.period_s.is_finite();
        range(self.twin.as_ref().is_none_or(is_period), "period_s", "above 0")?;
        if self.labels.is_some() && self.record.is_none() {
            let reason = "the column of the labels that names the record";
            return Err(RecordingError::Lacks { key: "record", reason });
        }
        self.sensors().map(drop)?;
        self.chosen().map(drop)
    }

    /// The sensors in the form that feature families use.
    ///
    /// # Errors
    /// An unknown quantity.
    pub fn sensors(&self) -> Result<Sensors, RecordingError> {
        let one = |sensor: &SensorText| {
            let known = Quantity::ALL.iter().find(|(_, word)| *word == sensor.quantity);
            let (quantity, _) = known.ok_or_else(|| {
                let words = Quantity::ALL.iter().map(|(_, word)| *word);
                unknown("quantity", &sensor.quantity, words)
            })?;
            let unit = Some(sensor.unit - 1).filter(|_| *quantity != Quantity::Surface);
            let name = sensor.name.clone();
            Ok(Sensor {
                name,
                quantity: *quantity,
                actuator: unit,
                noise: 0.0,
                is_noisy: false,
                follows: vec![],
            })
        };
        Ok(Sensors(self.sensors.iter().map(one).collect::<Result<_, RecordingError>>()?))
    }

    fn chosen(&self) -> Result<Vec<&'static Family>, RecordingError> {
        if self.families.is_empty() {
            return Ok(ALL.iter().collect());
        }
        let one = |name: &String| {
            let words = ALL.iter().map(|family| family.name);
            find(name).ok_or_else(|| unknown("family of features", name, words))
        };
        self.families.iter().map(one).collect()
    }

    /// The columns that are copied to the windows. A window ends where one changes.
    fn kept(&self) -> Vec<&String> {
        let mut kept: Vec<&String> = vec![];
        let targets = self.targets.iter().map(|target| &target.column);
        let lists = self.record.iter().chain(&self.groups).chain(&self.conditions);
        for name in lists.chain(&self.keep).chain(targets) {
            if !kept.contains(&name) {
                kept.push(name);
            }
        }
        kept
    }
}

fn unknown<'a>(
    what: &'static str,
    word: &str,
    known: impl IntoIterator<Item = &'a str>,
) -> RecordingError {
    let nearest = nearest(word, known).map(str::to_owned);
    RecordingError::Unknown { what, word: word.into(), nearest }
}
