//! A study of recordings: measured signals with labels, instead of a simulated plant.
//!
//! A small file in TOML names the records and assigns their columns (`docs/own-data.md` has worked examples).
//!
//! The windows and features are those of simulated runs. A missing number does not stop a study: see `windows`.

mod diagnoser;
pub mod judged;
mod nominal;
pub mod novelty;
mod records;
mod twin;
pub(crate) mod windows;

pub use diagnoser::Answers;
pub use windows::{NominalFit, NominalSource, Windows};

use crate::format::{At, Names, Value, section};
use crate::learn::EvaluationError;
use crate::simulate::SimulationError;
use crate::toml_text::{Collector, Diagnostic, TomlError, TomlText};
use servotwin_diagnosis::classifiers;
use servotwin_diagnosis::features::{ALL, Family, Quantity, Sensor, Sensors, find};
use std::path::{Path, PathBuf};
use twin::TwinChoice;

/// The supported format of these study files.
const FORMAT: u32 = 1;

/// The largest residual, in scales: products of four residuals, used in features, remain finite.
const FARTHEST: f64 = 1e50;

const COUNT: Value = Value::Whole(1.0, 1e9);

section! {
    /// The study file of recordings.
    pub struct RecordingStudy {
        #[expect(dead_code, reason = "it is checked before anything else")]
        must format: u32 = Value::Whole(FORMAT as f64, FORMAT as f64), "version of the file format";
        may records: Option<String>, "a folder of logs, each a record named like its file; or one table";
        may record: Option<String>, "column that names the record, in one table and in the labels";
        may labels: Option<At<String>>, "table with a row for each record; its columns join the records'";
        may groups: Vec<String>, "columns: windows that share their values are on one side of every split";
        may families: Vec<String> = Value::List(0, &Value::Word(families)),
            "families of features; default: all";
        must window_rows: usize = COUNT,
            "rows in a window; a shorter remainder is counted and not used";
        may segments: At<usize> = COUNT => At::new(1, 0..0),
            "parts of a window, each with its own features; default 1";
        may keep: Vec<String>, "columns copied to the windows; a window ends where one changes";
        may conditions: Vec<String>,
            "columns: each combination of their values has nominal values of its own";
        may residuals: Vec<String>, "columns that are used as they are";
        may healthy: Names<String>,
            "rows to learn nominal values from: the value of each column; default: as the only target says";
        may sensors: Vec<At<SensorText>>, "measured values beside their nominal ones";
        may targets: Vec<Target>, "what to learn from the windows";
        may folds: usize = Value::Whole(2.0, 1e6) => 5, "how often windows are held out; default 5";
        may classifiers: Vec<String> = Value::List(0, &Value::Word(classifiers)) => tree_and_forest(),
            "classifiers to compare; default: cart and random_forest";
        may novelty: Option<At<NoveltyChoice>>, "what is unlike the first healthy groups";
        may twin: Option<TwinChoice>, "gives every sensor of a system as a column twin.SENSOR";
    }
}

section! {
    /// A column that is learned from the windows.
    pub(crate) struct Target {
        must pub(crate) column: String, "the column";
        may pub(crate) healthy: Option<String>, "its value without a fault, if it has one";
    }
}

section! {
    /// The windows from which novelty is learned.
    struct NoveltyChoice {
        must healthy_groups: usize = COUNT, "number of healthy groups to learn from: the first ones";
    }
}

section! {
    struct SensorText {
        must name: String, "name in features";
        must measured: String, "column with the measured values";
        may nominal: Option<String>, "column with the nominal values, or twin.SENSOR";
        may nominal_from: Option<Vec<String>>,
            "columns from which nominal values are learned in healthy rows; none: their mean";
        may scale: Option<f64> = Value::Number(f64::MIN_POSITIVE, 1e300, ""),
            "what residuals are divided by; default where they are learned: 100 deviations of healthy rows";
        may quantity: Quantity => Quantity::Other, "role of the sensor in the diagnosis; default other";
        may actuator: usize = COUNT => 1, "number of its actuator; default 1";
    }
}

fn families() -> Vec<&'static str> {
    ALL.iter().map(|family| family.name).collect()
}

fn classifiers() -> Vec<&'static str> {
    classifiers::ALL.iter().map(|kind| kind.id()).collect()
}

/// One readable tree, and the ensemble that learns from missing values.
fn tree_and_forest() -> Vec<String> {
    vec!["cart".into(), "random_forest".into()]
}

/// Why a study file of recordings, or the recordings themselves, are invalid.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
pub enum RecordingError {
    /// The study file has mistakes.
    #[error(transparent)]
    Study(#[from] TomlError),
    /// A number is out of range.
    #[error("{what} must be {allowed}")]
    OutOfRange { what: String, allowed: &'static str },
    /// The file names no records.
    #[error("the study needs 'records': a table, or a folder of logs, relative to the study file")]
    NoNames,
    /// No window is complete.
    #[error("no window of {window_rows} rows fits: the longest run of rows has {longest}")]
    NoWindow { window_rows: usize, longest: usize },
    /// A nominal value must be learned, but no row is marked as healthy.
    #[error(
        "the nominal value of '{sensor}' is to be learned, but no row is healthy: name them in [healthy]"
    )]
    NoHealthyRows { sensor: String },
    /// The nominal value of a sensor cannot be learned without a scale.
    #[error("sensor '{sensor}': it never varies in healthy rows, so it needs a scale")]
    NoScale { sensor: String },
    /// A number is so large that squares of residuals would overflow.
    #[error(
        "{place}, column '{column}': {value:e} is too far from its nominal value {nominal:e}; allowed is \
         {FARTHEST:e} times the scale of {scale:e}"
    )]
    TooFar { column: String, place: String, value: f64, nominal: f64, scale: f64 },
    /// The folder of records has none.
    #[error("{}: the folder has no logs (.csv or .parquet)", .0.display())]
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

impl<E: Into<EvaluationError>> From<E> for RecordingError {
    fn from(error: E) -> Self {
        RecordingError::Evaluation(error.into())
    }
}

impl RecordingStudy {
    /// Parses a study file; `path` appears only in messages.
    ///
    /// # Errors
    /// All mistakes in the text.
    pub fn parse(text: &str, path: &str) -> Result<Self, TomlError> {
        let mut mistakes = Collector::default();
        let document = TomlText::parse(text, FORMAT, &mut mistakes);
        let root = document.as_ref().map(TomlText::root).unwrap_or_default();
        let study =
            document.as_ref().and_then(|_| Self::of(&root, (&(0..0), "the file"), &mut mistakes));
        match study.map(Self::complete).inspect(|study| study.check(&mut mistakes)) {
            Some(study) if mistakes.is_empty() => Ok(study),
            _ => Err(mistakes.refuse(path, text)),
        }
    }

    /// With a sensor for each residual, and the healthy rows of the only target.
    fn complete(mut self) -> Self {
        let residual = |name: String| SensorText {
            name: name.clone(),
            measured: name,
            nominal: None,
            nominal_from: None,
            scale: Some(1.0),
            quantity: Quantity::Other,
            actuator: 1,
        };
        let residuals = self.residuals.drain(..).map(|name| At::new(residual(name), 0..0));
        self.sensors.extend(residuals);
        if let ([target], true) = (self.targets.as_slice(), self.healthy.is_empty())
            && let Some(healthy) = &target.healthy
        {
            self.healthy.insert(At::new(target.column.clone(), 0..0), healthy.clone());
        }
        self
    }

    /// Number of rows in a window.
    pub fn window_rows(&self) -> usize {
        self.window_rows
    }

    /// The tables that the study reads, relative to its file; a folder of logs is one.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        let labels = self.labels.iter().map(|labels| &labels.value);
        self.records.iter().chain(labels).map(Path::new)
    }

    fn check(&self, mistakes: &mut Collector) {
        let mut note = |at, message: String| mistakes.note(at, Diagnostic::new(message));
        if self.sensors.is_empty() {
            let nothing = "there is nothing to measure: name 'residuals' or add [[sensors]]";
            note(&(0..0), nothing.into());
        }
        if !self.window_rows.is_multiple_of(self.segments.value) {
            note(&self.segments.at, "segments must divide window_rows".into());
        }
        for At { value: sensor, at } in &self.sensors {
            match (&sensor.nominal, &sensor.nominal_from, sensor.scale) {
                (Some(_), Some(_), _) => note(at, "either nominal or nominal_from".into()),
                (_, None, None) => {
                    note(at, "a scale is needed unless the nominal value is learned".into());
                }
                _ => {}
            }
        }
        let has_groups = !self.groups.is_empty() && !self.healthy.is_empty();
        if let Some(novelty) = self.novelty.as_ref().filter(|_| !has_groups) {
            let needed =
                "novelty is learned from the first healthy groups: name 'groups' and 'healthy'";
            note(&novelty.at, needed.into());
        }
        if let Some(labels) = self.labels.as_ref().filter(|_| self.record.is_none()) {
            note(&labels.at, "labels need 'record', the column that names the record".into());
        }
    }

    /// The sensors in the form that feature families use. Every part of a window has sensors of its own.
    pub fn sensors(&self) -> Sensors {
        let parts = self.segments.value;
        let one = |part: usize, sensor: &SensorText| Sensor {
            name: match parts {
                1 => sensor.name.clone(),
                _ => format!("{}_part{}", sensor.name, part + 1),
            },
            quantity: sensor.quantity,
            actuator: Some(sensor.actuator - 1).filter(|_| sensor.quantity != Quantity::Surface),
            noise: 0.0,
            is_noisy: false,
            follows: vec![],
        };
        let of_part = |part: usize| self.sensors.iter().map(move |sensor| one(part, sensor));
        Sensors((0..parts).flat_map(of_part).collect())
    }

    /// Number of actuators that sensors belong to.
    fn actuators(&self) -> usize {
        self.sensors.iter().map(|sensor| sensor.actuator).max().unwrap_or(1)
    }

    /// Number of rows in a part of a window.
    fn part_rows(&self) -> usize {
        self.window_rows / self.segments.value
    }

    fn chosen(&self) -> Vec<&'static Family> {
        match self.families.is_empty() {
            true => ALL.iter().collect(),
            false => self.families.iter().filter_map(|name| find(name)).collect(),
        }
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
