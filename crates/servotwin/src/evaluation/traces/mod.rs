//! Computes features from a user's traces: measured and nominal signals as columns of a table.
//!
//! A small study file in TOML assigns the columns (`docs/own-data.md` has worked examples):
//! ```toml
//! format = 1
//! families = ["moments", "deviation"]  # all if not given
//! window_rows = 10                     # rows in a window; a shorter remainder is dropped
//! segments = 2                         # parts of a window, each with its own features
//! keep = ["mode"]                      # copied to the result; a window ends where one changes
//! residuals = ["r1", "r2"]             # columns that already hold residuals
//!
//! [healthy]                            # rows to learn nominal values from: all conditions hold
//! mode = "none"
//!
//! [[sensors]]                          # or measured and nominal separately
//! name = "p_a_1"
//! measured = "pressure_a_pa"
//! nominal = "twin_pressure_a_pa"       # a column; or, to be learned from the healthy rows,
//! # nominal_from = ["command_m"]       # a regression on these columns, [] for the mean
//! scale = 206.84e5                     # where learned, 100 deviations of healthy rows if not given
//! quantity = "pressure_a"              # `other` where not given
//! unit = 1                             # 1 where not given
//! ```

mod nominal;

pub use nominal::Nominal;

use super::error::EvaluationError;
use crate::nearest::nearest;
use crate::table::{Column, Table, TableError, Values};
use serde::Deserialize;
use servotwin_diagnosis::features::{ALL, Family, Quantity, Sensor, Sensors, find};
use servotwin_diagnosis::residual::Window;
use std::borrow::Cow;
use std::collections::BTreeMap;

/// The supported format of trace study files.
const FORMAT: u32 = 1;

/// The largest residual, in scales: products of four residuals, used in features, remain finite.
const FARTHEST: f64 = 1e50;

/// The study file for a table of traces.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TraceStudy {
    format: u32,
    #[serde(default)]
    families: Vec<String>,
    window_rows: usize,
    #[serde(default = "first")]
    segments: usize,
    #[serde(default)]
    keep: Vec<String>,
    #[serde(default)]
    residuals: Vec<String>,
    #[serde(default)]
    healthy: BTreeMap<String, String>,
    #[serde(default)]
    sensors: Vec<SensorText>,
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

/// The values of a column as text; a missing number is empty.
fn texts(column: &Column) -> Vec<String> {
    let values = &column.values;
    (0..values.len()).map(|row| text_at(values, row)).collect()
}

fn text_at(values: &Values, row: usize) -> String {
    match values {
        Values::Float(values) if values[row].is_nan() => String::new(),
        Values::Float(values) => values[row].to_string(),
        Values::Integer(values) => values[row].to_string(),
        Values::Unsigned(values) => values[row].to_string(),
        Values::Flag(values) => values[row].to_string(),
        Values::Text(values) => values[row].trim().to_owned(),
    }
}

fn other() -> String {
    "other".into()
}

fn first() -> usize {
    1
}

/// Why a study file for traces, or a table of traces, is invalid.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
pub enum TraceError {
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
    /// No window is complete.
    #[error("no window of {window_rows} rows fits: the longest run of rows has {longest}")]
    NoWindow { window_rows: usize, longest: usize },
    /// A nominal value must be learned, but no row is marked as healthy.
    #[error(
        "the nominal value of '{sensor}' is to be learnt, but no row is healthy: name them in [healthy], or give \
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
    /// The table does not match the study file.
    #[error(transparent)]
    Evaluation(EvaluationError),
    /// The healthy traces do not match the study file.
    #[error(transparent)]
    Healthy(EvaluationError),
}

fn did_you_mean(nearest: &Option<String>) -> String {
    nearest.as_ref().map_or_else(String::new, |near| format!("; did you mean '{near}'?"))
}

impl<E: Into<EvaluationError>> From<E> for TraceError {
    fn from(error: E) -> Self {
        TraceError::Evaluation(error.into())
    }
}

impl TraceStudy {
    /// Parses a study file.
    ///
    /// # Errors
    /// [`TraceError`], except errors about a table.
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
            nominal_from: None,
            scale: Some(1.0),
            quantity: other(),
            unit: first(),
        };
        let residuals: Vec<SensorText> = study.residuals.drain(..).map(|r| residual(&r)).collect();
        study.sensors.extend(residuals);
        study.check()?;
        Ok(study)
    }

    /// Number of rows in a window.
    pub fn window_rows(&self) -> usize {
        self.window_rows
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
        let whole = self.segments >= 1 && self.window_rows.is_multiple_of(self.segments);
        range(whole, "segments", "at least 1 and divide window_rows")?;
        for sensor in &self.sensors {
            let positive = sensor.scale.is_none_or(|scale| scale > 0.0 && scale.is_finite());
            range(positive, &format!("the scale of {}", sensor.name), "above 0")?;
            let problem = match (&sensor.nominal, &sensor.nominal_from, sensor.scale) {
                (Some(_), Some(_), _) => Some("either nominal or nominal_from"),
                (_, None, None) => Some("a scale is needed unless the nominal value is learnt"),
                _ => None,
            };
            if let Some(problem) = problem {
                return Err(TraceError::Nominal { sensor: sensor.name.clone(), problem });
            }
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

    /// The sensors in the form that feature families use.
    ///
    /// # Errors
    /// An unknown quantity.
    pub fn sensors(&self) -> Result<Sensors, TraceError> {
        self.seen()
    }

    /// The features of every complete window in a table of traces. Nominal values and scales are learned from `healthy`
    /// traces if given, otherwise from the healthy rows of the study.
    ///
    /// # Errors
    /// A column is missing or invalid, no window is complete, or no row is healthy.
    pub fn features(&self, traces: &Table, healthy: Option<&Table>) -> Result<Table, TraceError> {
        let columns = self.columns(traces, healthy)?;
        let kept = self.keep.iter().map(|name| traces.column(name).map(texts));
        let kept = kept.collect::<Result<Vec<_>, _>>()?;
        let starts = self.windows(traces.row_count(), &kept)?;
        let scales: Vec<f64> = columns.iter().map(|column| column.scale).collect();
        let (sensors, families) = (self.seen()?, self.chosen()?);
        let length = self.window_rows / self.segments;
        let of_segment = |start: usize| {
            let mut window = Window::new(scales.len());
            for at in start..start + length {
                let measured: Vec<f64> = columns.iter().map(|c| c.measured[at]).collect();
                let nominal: Vec<f64> = columns.iter().map(|c| c.nominal[at]).collect();
                window.add(&measured, &nominal, &scales);
            }
            let mut values = vec![];
            families.iter().for_each(|family| family.compute(&sensors, &window, &mut values));
            values
        };
        let of_window = |start: &usize| -> Vec<f64> {
            (0..self.segments).flat_map(|segment| of_segment(start + segment * length)).collect()
        };
        let rows: Vec<Vec<f64>> = starts.iter().map(of_window).collect();
        let mut table = Table::new();
        for (name, texts) in self.keep.iter().zip(&kept) {
            let first: Vec<String> = starts.iter().map(|&start| texts[start].clone()).collect();
            table.push(Column::new(name, "", first))?;
        }
        let mut place = 0;
        for segment in 1..=self.segments {
            for feature in families.iter().flat_map(|family| family.features(&sensors)) {
                let name = match self.segments {
                    1 => feature.name,
                    _ => format!("{}_part{segment}", feature.name),
                };
                let values: Vec<f64> = rows.iter().map(|row| row[place]).collect();
                table.push(Column::new(name, feature.unit, values))?;
                place += 1;
            }
        }
        Ok(table)
    }

    /// Measured values, nominal values and scale of every sensor.
    fn columns<'t>(
        &self,
        traces: &'t Table,
        healthy: Option<&Table>,
    ) -> Result<Vec<SensorColumns<'t>>, TraceError> {
        let own_rows = match healthy {
            None if !self.healthy.is_empty() => self.healthy_rows(traces)?,
            _ => vec![],
        };
        let all_rows: Vec<usize> = (0..healthy.map_or(0, Table::row_count)).collect();
        let (learnt_from, rows) = match healthy {
            Some(table) => (table, all_rows),
            None => (traces, own_rows),
        };
        let one = |sensor: &SensorText| -> Result<SensorColumns<'t>, TraceError> {
            let measured = traces.finite_f64(&sensor.measured)?;
            let (nominal, scale) = match (&sensor.nominal, &sensor.nominal_from) {
                (Some(name), _) => (traces.finite_f64(name)?, sensor.scale),
                (None, None) => (Cow::Owned(vec![0.0; traces.row_count()]), sensor.scale),
                (None, Some(inputs)) => {
                    if rows.is_empty() {
                        return Err(TraceError::NoHealthyRows { sensor: sensor.name.clone() });
                    }
                    let learnt = learn(sensor, inputs, learnt_from, &rows);
                    let learnt = learnt.map_err(|error| match (error, healthy) {
                        (TraceError::Evaluation(error), Some(_)) => TraceError::Healthy(error),
                        (error, _) => error,
                    })?;
                    let inputs = inputs.iter().map(|name| traces.finite_f64(name));
                    let inputs = inputs.collect::<Result<Vec<_>, TableError>>()?;
                    let at = |row: usize| {
                        learnt.at(&inputs.iter().map(|column| column[row]).collect::<Vec<_>>())
                    };
                    let nominal = (0..traces.row_count()).map(at).collect();
                    // The band of 3 % then corresponds to three standard deviations.
                    let scale = Some(sensor.scale.unwrap_or(100.0 * learnt.deviation));
                    (Cow::Owned(nominal), scale)
                }
            };
            let scale = scale.unwrap_or(0.0);
            if scale <= 0.0 {
                let problem = "it never varies in healthy rows, so it needs a scale";
                return Err(TraceError::Nominal { sensor: sensor.name.clone(), problem });
            }
            let is_too_far =
                |(measured, nominal): (&f64, &f64)| (measured - nominal).abs() > FARTHEST * scale;
            if let Some(row) = measured.iter().zip(nominal.iter()).position(is_too_far) {
                return Err(TraceError::TooFar {
                    column: sensor.measured.clone(),
                    place: traces.origin().place(row),
                    value: measured[row],
                    nominal: nominal[row],
                    scale,
                });
            }
            Ok(SensorColumns { measured, nominal, scale })
        };
        self.sensors.iter().map(one).collect()
    }

    /// The rows in which every column of [healthy] has the given value.
    fn healthy_rows(&self, traces: &Table) -> Result<Vec<usize>, TraceError> {
        let mut rows: Vec<usize> = (0..traces.row_count()).collect();
        for (name, value) in &self.healthy {
            let texts = texts(traces.column(name)?);
            rows.retain(|&row| texts[row] == *value);
        }
        Ok(rows)
    }

    /// The first rows of the complete windows.
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

/// The signals of a sensor in all rows.
struct SensorColumns<'t> {
    measured: Cow<'t, [f64]>,
    nominal: Cow<'t, [f64]>,
    scale: f64,
}

fn learn(
    sensor: &SensorText,
    inputs: &[String],
    traces: &Table,
    rows: &[usize],
) -> Result<Nominal, TraceError> {
    let measured = traces.finite_f64(&sensor.measured)?;
    let inputs = inputs.iter().map(|name| traces.finite_f64(name));
    let inputs = inputs.collect::<Result<Vec<_>, TableError>>()?;
    let inputs: Vec<&[f64]> = inputs.iter().map(|column| &column[..]).collect();
    Ok(Nominal::learn(&measured, &inputs, rows))
}

fn unknown<'a>(
    what: &'static str,
    word: &str,
    known: impl IntoIterator<Item = &'a str>,
) -> TraceError {
    let nearest = nearest(word, known).map(str::to_owned);
    TraceError::Unknown { what, word: word.into(), nearest }
}
