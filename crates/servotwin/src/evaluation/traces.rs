//! Features from foreign traces: measured and nominal signals as columns of a table.
//!
//! A small study file in TOML says which columns are what:
//! ```toml
//! format = 1
//! families = ["moments", "deviation"]  # all where not given
//! window_rows = 10                     # rows in a window; a shorter rest is left out
//! keep = ["mode"]                      # copied to the features; a window ends where one changes
//! residuals = ["r1", "r2"]             # columns that are residuals already
//!
//! [[sensors]]                          # or measured and nominal apart
//! name = "p_A1"
//! measured = "pressure_a_pa"
//! nominal = "twin_pressure_a_pa"
//! scale = 206.84e5
//! quantity = "pressure_a"              # `other` where not given
//! unit = 1                             # 1 where not given
//! ```

use super::error::EvaluationError;
use super::foreign::texts;
use crate::nearest::nearest;
use crate::table::{Column, Table, TableError};
use serde::Deserialize;
use servotwin_diagnosis::features::{ALL, Family, Quantity, Sensor, Sensors, find};
use servotwin_diagnosis::residual::Window;
use std::borrow::Cow;
use std::fmt;

/// The format of study files for traces that this version reads.
const FORMAT: u32 = 1;

/// What is in a table of traces.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TraceStudy {
    format: u32,
    #[serde(default)]
    families: Vec<String>,
    window_rows: usize,
    #[serde(default)]
    keep: Vec<String>,
    #[serde(default)]
    residuals: Vec<String>,
    #[serde(default)]
    sensors: Vec<SensorText>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct SensorText {
    name: String,
    measured: String,
    nominal: Option<String>,
    scale: f64,
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

/// What is wrong with a study file for traces, or with traces under it.
#[derive(Debug)]
pub enum TraceError {
    /// The text is no such file; the message has line and column.
    Syntax(Box<toml::de::Error>),
    /// Another format.
    Format(u32),
    /// A word is not known.
    Unknown {
        /// What was looked for.
        what: &'static str,
        /// The word.
        word: String,
        /// The nearest known word.
        nearest: Option<String>,
    },
    /// A number is out of range.
    OutOfRange {
        /// Which number.
        what: String,
        /// What is allowed.
        allowed: &'static str,
    },
    /// The file names no sensor and no residual.
    NoSensors,
    /// No window is full.
    NoWindow {
        /// Rows that a window needs.
        window_rows: usize,
        /// The longest run of rows that belong together.
        longest: usize,
    },
    /// The table is not as the file says.
    Evaluation(EvaluationError),
}

impl fmt::Display for TraceError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TraceError::Syntax(error) => write!(out, "{error}"),
            TraceError::Format(found) => {
                write!(out, "format {found} is not known, this version reads {FORMAT}")
            }
            TraceError::Unknown { what, word, nearest } => {
                write!(out, "no {what} is named '{word}'")?;
                nearest.as_ref().map_or(Ok(()), |near| write!(out, "; did you mean '{near}'?"))
            }
            TraceError::OutOfRange { what, allowed } => write!(out, "{what} must be {allowed}"),
            TraceError::NoSensors => {
                write!(out, "there is nothing to measure: name 'residuals' or add [[sensors]]")
            }
            TraceError::NoWindow { window_rows, longest } => write!(
                out,
                "no window of {window_rows} rows fits: the longest run of rows has {longest}"
            ),
            TraceError::Evaluation(error) => write!(out, "{error}"),
        }
    }
}

impl std::error::Error for TraceError {}

impl<E: Into<EvaluationError>> From<E> for TraceError {
    fn from(error: E) -> Self {
        TraceError::Evaluation(error.into())
    }
}

impl TraceStudy {
    /// Reads the text of a study file.
    ///
    /// # Errors
    /// [`TraceError`], but not about a table.
    pub fn parse(text: &str) -> Result<Self, TraceError> {
        let mut study: TraceStudy =
            toml::from_str(text).map_err(|error| TraceError::Syntax(Box::new(error)))?;
        if study.format != FORMAT {
            return Err(TraceError::Format(study.format));
        }
        let residual = |name: &String| SensorText {
            name: name.clone(),
            measured: name.clone(),
            nominal: None,
            scale: 1.0,
            quantity: other(),
            unit: first(),
        };
        let residuals: Vec<SensorText> = study.residuals.drain(..).map(|r| residual(&r)).collect();
        study.sensors.extend(residuals);
        study.check()?;
        Ok(study)
    }

    fn check(&self) -> Result<(), TraceError> {
        let range = |holds: bool, what: &str, allowed| match holds {
            true => Ok(()),
            false => Err(TraceError::OutOfRange { what: what.into(), allowed }),
        };
        if self.sensors.is_empty() {
            return Err(TraceError::NoSensors);
        }
        range(self.window_rows >= 1, "window_rows", "at least 1")?;
        for sensor in &self.sensors {
            let positive = sensor.scale > 0.0 && sensor.scale.is_finite();
            range(positive, &format!("the scale of {}", sensor.name), "above 0")?;
            range(sensor.unit >= 1, &format!("the unit of {}", sensor.name), "at least 1")?;
        }
        self.seen().map(drop)?;
        self.chosen().map(drop)
    }

    fn seen(&self) -> Result<Sensors, TraceError> {
        let one = |sensor: &SensorText| {
            let known = Quantity::ALL.iter().find(|(_, word)| *word == sensor.quantity);
            let (quantity, _) = known.ok_or_else(|| {
                let words = Quantity::ALL.iter().map(|(_, word)| *word);
                unknown("quantity", &sensor.quantity, words)
            })?;
            let (name, unit) = (sensor.name.clone(), sensor.unit - 1);
            Ok(Sensor { name, quantity: *quantity, unit, noise: 0.0, is_noisy: false })
        };
        Ok(Sensors(self.sensors.iter().map(one).collect::<Result<_, TraceError>>()?))
    }

    fn chosen(&self) -> Result<Vec<&'static dyn Family>, TraceError> {
        if self.families.is_empty() {
            return Ok(ALL.to_vec());
        }
        let one = |name: &String| {
            let words = ALL.iter().map(|family| family.name());
            find(name).ok_or_else(|| unknown("family of features", name, words))
        };
        self.families.iter().map(one).collect()
    }

    /// The features of every full window of a table of traces.
    ///
    /// # Errors
    /// A column is missing or unfit, or no window is full.
    pub fn features(&self, traces: &Table) -> Result<Table, TraceError> {
        let column = |name: &String| traces.finite_f64(name);
        let measured =
            self.sensors.iter().map(|s| column(&s.measured)).collect::<Result<Vec<_>, _>>()?;
        let zero = || Ok(Cow::Owned(vec![0.0; traces.row_count()]));
        let nominal = self.sensors.iter().map(|s| s.nominal.as_ref().map_or_else(zero, column));
        let nominal = nominal.collect::<Result<Vec<_>, TableError>>()?;
        let kept =
            self.keep.iter().map(|name| texts(traces, name)).collect::<Result<Vec<_>, _>>()?;
        let starts = self.windows(traces.row_count(), &kept)?;
        let scales: Vec<f64> = self.sensors.iter().map(|sensor| sensor.scale).collect();
        let (sensors, families) = (self.seen()?, self.chosen()?);
        let row = |columns: &[Cow<'_, [f64]>], row: usize| -> Vec<f64> {
            columns.iter().map(|column| column[row]).collect()
        };
        let of_window = |start: &usize| {
            let mut window = Window::new(scales.len());
            for at in *start..*start + self.window_rows {
                window.add(&row(&measured, at), &row(&nominal, at), &scales);
            }
            let mut values = vec![];
            families.iter().for_each(|family| family.compute(&sensors, &window, &mut values));
            values
        };
        let rows: Vec<Vec<f64>> = starts.iter().map(of_window).collect();
        let names = families.iter().flat_map(|family| family.features(&sensors));
        let mut table = Table::new();
        for (name, texts) in self.keep.iter().zip(&kept) {
            let first: Vec<String> = starts.iter().map(|&start| texts[start].clone()).collect();
            table.push(Column::new(name, "", first))?;
        }
        for (place, feature) in names.enumerate() {
            let values: Vec<f64> = rows.iter().map(|row| row[place]).collect();
            table.push(Column::new(feature.name, feature.unit, values))?;
        }
        Ok(table)
    }

    /// The first rows of the full windows.
    fn windows(&self, rows: usize, kept: &[Vec<String>]) -> Result<Vec<usize>, TraceError> {
        let (mut starts, mut start, mut longest) = (vec![], 0, 0);
        for row in 1..=rows {
            let breaks = row == rows || kept.iter().any(|column| column[row] != column[row - 1]);
            if breaks {
                longest = longest.max(row - start);
                let full = (row - start) / self.window_rows;
                starts.extend((0..full).map(|window| start + window * self.window_rows));
                start = row;
            }
        }
        match starts.is_empty() {
            true => Err(TraceError::NoWindow { window_rows: self.window_rows, longest }),
            false => Ok(starts),
        }
    }
}

fn unknown<'a>(
    what: &'static str,
    word: &str,
    known: impl IntoIterator<Item = &'a str>,
) -> TraceError {
    let nearest = nearest(word, known).map(str::to_owned);
    TraceError::Unknown { what, word: word.into(), nearest }
}
