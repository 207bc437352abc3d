//! The windows of records and their features.
//!
//! A row that lacks a number (an empty cell, NaN, infinity) is left out of its window. A sensor without any number in a
//! window, or in a segment of it, does not take the other sensors' rows out: only the features that depend on it are
//! missing, which the trees learn as such.

use super::nominal::learn_nominal;
use super::{FARTHEST, RecordingError, RecordingStudy, SensorText};
use crate::format::At;
use crate::learn::EvaluationError;
use crate::table::{Column, Table, TableError, Values};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::diagnoser::{Nominal, Nominals};
use servotwin_diagnosis::features::{Family, Sensors};
use servotwin_diagnosis::hierarchy::Names;
use servotwin_diagnosis::residual::Window;
use servotwin_learning::hierarchy::{Examples, Label};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// The windows of some records.
#[derive(Debug, Clone)]
pub struct Windows {
    /// One row for each window: the kept columns as text, then the features.
    pub table: Table,
    /// Number of kept columns.
    pub(crate) kept: usize,
    /// The first row of each window in the records.
    pub starts: Vec<usize>,
    /// Number of rows in a window.
    pub rows: usize,
    /// Number of actuators that sensors belong to.
    pub(super) actuators: usize,
    /// The features of each window.
    pub(super) values: Vec<Vec<f64>>,
    /// Rows of the records that are in no window.
    pub left_over: usize,
    /// Rows within windows that lack a number.
    pub incomplete: usize,
}

impl Windows {
    /// The features.
    pub(super) fn features(&self) -> &[Column] {
        &self.table.columns()[self.kept..]
    }

    /// The windows as examples of some faults, which take the places of actuators. `None` stands for a healthy window.
    ///
    /// # Errors
    /// There is no such fault.
    pub(super) fn examples(
        &self,
        mut faults: Vec<String>,
        of_windows: impl Iterator<Item = Option<usize>>,
    ) -> Result<Examples, EvaluationError> {
        let features = self.features();
        // Every sensor belongs to one of the actuators.
        faults.resize(faults.len().max(self.actuators), String::new());
        let names = Names {
            features: features.iter().map(|feature| feature.name.clone()).collect(),
            actuators: faults,
            actions: vec![String::new()],
            details: vec![String::new()],
        };
        let healthy = names.healthy();
        let label = |fault: Option<usize>| Label {
            actuator: fault.map_or(healthy, |fault| fault as u32),
            action: 0,
            detail: 0,
        };
        let column = |place: usize| self.values.iter().map(move |own| own[place]);
        let values = (0..features.len()).flat_map(column).collect();
        let read = vec![(0..features.len()).collect(); names.actuators.len()];
        Ok(Examples::new(names, read, vec![values], of_windows.map(label).collect())?)
    }
}

/// Where the nominal values of a sensor come from, and how well they fit the healthy rows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NominalFit {
    /// The sensor.
    pub sensor: String,
    /// Where they come from.
    pub source: NominalSource,
    /// Number of healthy rows.
    pub rows: usize,
    /// Root mean square of measured minus nominal over the healthy rows, in the unit of the column.
    pub deviation: f64,
    /// Coefficient of determination over the healthy rows, of regressions within their conditions. `None` without
    /// variance.
    pub r2: Option<f64>,
}

/// Where the nominal values of a sensor come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NominalSource {
    /// A column, or the twin.
    Column(String),
    /// A regression on these columns in each of some conditions; without columns, the mean.
    Regression(Vec<String>, usize),
}

/// The signals of a sensor in all rows. A missing number is not finite.
struct SensorColumns<'t> {
    measured: Cow<'t, [f64]>,
    nominal: Cow<'t, [f64]>,
    scale: Vec<f64>,
}

impl SensorColumns<'_> {
    fn has(&self, row: usize) -> bool {
        self.measured[row].is_finite() && self.nominal[row].is_finite()
    }

    /// Measured value, nominal value and scale.
    fn sample(&self, row: usize) -> [f64; 3] {
        [self.measured[row], self.nominal[row], self.scale[row]]
    }
}

/// The values of a column as text; a missing number is empty.
pub(super) fn texts(column: &Column) -> Vec<String> {
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

/// The values of several columns in each row, joined; empty texts without columns.
pub(super) fn joined(table: &Table, names: &[String]) -> Result<Vec<String>, TableError> {
    let mut rows = vec![String::new(); table.row_count()];
    for name in names {
        for (row, text) in rows.iter_mut().zip(texts(table.column(name)?)) {
            *row += if row.is_empty() { "" } else { " " };
            *row += &text;
        }
    }
    Ok(rows)
}

impl RecordingStudy {
    /// The rows in which every column of `[healthy]` has the given value; none if the study names no healthy rows.
    ///
    /// # Errors
    /// A column is missing.
    pub fn healthy_rows(&self, records: &Table) -> Result<Vec<usize>, RecordingError> {
        if self.healthy.is_empty() {
            return Ok(vec![]);
        }
        let mut rows: Vec<usize> = (0..records.row_count()).collect();
        for (name, value) in &self.healthy {
            let texts = texts(records.column(name)?);
            rows.retain(|&row| texts[row] == *value);
        }
        Ok(rows)
    }

    /// Learns the nominal values from healthy rows of a table.
    ///
    /// # Errors
    /// A column is missing or not numeric, or no row is healthy although a nominal value is to be learned.
    pub fn learn(&self, records: &Table, healthy: &[usize]) -> Result<Nominals, RecordingError> {
        let conditions = joined(records, &self.conditions)?;
        let mut rows: BTreeMap<&String, Vec<usize>> = BTreeMap::new();
        healthy.iter().for_each(|&row| rows.entry(&conditions[row]).or_default().push(row));
        let one = |sensor: &At<SensorText>| {
            let Some(inputs) = &sensor.nominal_from else { return Ok(None) };
            let measured = records.f64(&sensor.measured)?;
            let inputs = inputs.iter().map(|name| records.f64(name));
            let inputs = inputs.collect::<Result<Vec<_>, TableError>>()?;
            let inputs: Vec<&[f64]> = inputs.iter().map(|column| &column[..]).collect();
            let learned: BTreeMap<String, Nominal> = rows
                .iter()
                .filter_map(|(condition, rows)| {
                    let nominal = learn_nominal(&measured, &inputs, rows)?;
                    // Without a scale, a condition that never varies gives none.
                    let is_usable = sensor.scale.is_some() || nominal.deviation > 0.0;
                    is_usable.then(|| ((*condition).clone(), nominal))
                })
                .collect();
            match (learned.is_empty(), healthy.is_empty()) {
                (false, _) => Ok(Some(learned)),
                (true, true) => Err(RecordingError::NoHealthyRows { sensor: sensor.name.clone() }),
                (true, false) => Err(RecordingError::NoScale { sensor: sensor.name.clone() }),
            }
        };
        self.sensors.iter().map(one).collect()
    }

    /// Whether any nominal value is learned.
    pub(crate) fn learns_nominals(&self) -> bool {
        self.sensors.iter().any(|sensor| sensor.nominal_from.is_some())
    }

    /// Whether these are nominal values of the study's sensors.
    pub(super) fn has_nominals(&self, nominals: &Nominals) -> bool {
        let learned = nominals.iter().map(Option::is_some);
        learned.eq(self.sensors.iter().map(|sensor| sensor.nominal_from.is_some()))
    }

    /// How well the nominal values fit the healthy rows. Columns that are used as they are have none.
    ///
    /// # Errors
    /// A column is missing or not numeric.
    pub fn fits(
        &self,
        records: &Table,
        nominals: &Nominals,
        healthy: &[usize],
    ) -> Result<Vec<NominalFit>, RecordingError> {
        let mut fits = vec![];
        for (sensor, learned) in self.sensors.iter().zip(nominals) {
            let (source, rows, rest, all) = match (&sensor.nominal, learned) {
                (Some(name), _) => {
                    let own = learn_nominal(&records.f64(&sensor.measured)?, &[], healthy);
                    let residuals = residuals(records, &sensor.measured, name, healthy)?;
                    let rest = residuals.iter().map(|residual| residual.powi(2)).sum();
                    let all = own.map_or(0.0, |own| own.rows as f64 * own.spread.powi(2));
                    (NominalSource::Column(name.clone()), residuals.len(), rest, all)
                }
                (None, Some(learned)) => {
                    let rows = learned.values().map(|nominal| nominal.rows as usize).sum();
                    let squares = |of: &dyn Fn(&Nominal) -> f64| -> f64 {
                        learned.values().map(|own| own.rows as f64 * of(own).powi(2)).sum()
                    };
                    let inputs = sensor.nominal_from.clone().unwrap_or_default();
                    let source = NominalSource::Regression(inputs, learned.len());
                    (source, rows, squares(&|own| own.deviation), squares(&|own| own.spread))
                }
                (None, None) => continue,
            };
            if rows > 0 {
                let deviation = (rest / rows as f64).sqrt();
                let r2 = (all > 0.0).then(|| 1.0 - rest / all);
                fits.push(NominalFit { sensor: sensor.name.clone(), source, rows, deviation, r2 });
            }
        }
        Ok(fits)
    }

    /// The features of every complete window of the records.
    ///
    /// # Errors
    /// A column is missing or invalid, or no window is complete.
    pub fn windows(&self, records: &Table, nominals: &Nominals) -> Result<Windows, RecordingError> {
        let columns = self.columns(records, nominals)?;
        let names = self.kept();
        let kept = names.iter().map(|name| records.column(name).map(texts));
        let kept = kept.collect::<Result<Vec<_>, _>>()?;
        let starts = self.starts(records.row_count(), &kept)?;
        let (sensors, families) = (self.sensors(), self.chosen());
        // Every part of a window has all sensors.
        let signals_of = |start: usize| -> Vec<(&SensorColumns, usize)> {
            let parts = (0..self.segments.value).map(|part| start + part * self.part_rows());
            parts.flat_map(|first| columns.iter().map(move |column| (column, first))).collect()
        };
        let of_window =
            |start: &usize| features(&families, &sensors, &signals_of(*start), self.part_rows());
        let values: Vec<Vec<f64>> = starts.iter().map(of_window).collect();
        let mut table = Table::new();
        for (name, texts) in names.into_iter().zip(&kept) {
            let first: Vec<String> = starts.iter().map(|&start| texts[start].clone()).collect();
            table.push(Column::new(name, "", first))?;
        }
        let features = families.iter().flat_map(|family| family.features(&sensors));
        for (place, feature) in features.enumerate() {
            let column: Vec<f64> = values.iter().map(|own| own[place]).collect();
            let column = Column::new(feature.name, feature.unit, column);
            table.push(column.described(feature.meaning))?;
        }
        let is_incomplete = |row: &usize| columns.iter().any(|column| !column.has(*row));
        let used = starts.iter().flat_map(|&start| start..start + self.window_rows);
        Ok(Windows {
            table,
            kept: kept.len(),
            rows: self.window_rows,
            actuators: self.actuators(),
            values,
            left_over: records.row_count() - starts.len() * self.window_rows,
            incomplete: used.filter(is_incomplete).count(),
            starts,
        })
    }

    /// Measured values, nominal values and scales of every sensor.
    fn columns<'t>(
        &self,
        records: &'t Table,
        nominals: &Nominals,
    ) -> Result<Vec<SensorColumns<'t>>, RecordingError> {
        let conditions = joined(records, &self.conditions)?;
        let count = records.row_count();
        let one = |(sensor, learned): (&At<SensorText>, &Option<BTreeMap<String, Nominal>>)| {
            let measured = records.f64(&sensor.measured)?;
            let fixed = vec![sensor.scale.unwrap_or(1.0); count];
            let (nominal, scale) = match (&sensor.nominal, learned) {
                (Some(name), _) => (records.f64(name)?, fixed),
                (None, None) => (Cow::Owned(vec![0.0; count]), fixed),
                (None, Some(learned)) => {
                    let inputs = sensor.nominal_from.iter().flatten().map(|name| records.f64(name));
                    let inputs = inputs.collect::<Result<Vec<_>, TableError>>()?;
                    let at = |row: usize| {
                        let Some(own) = learned.get(&conditions[row]) else {
                            return (f64::NAN, 1.0);
                        };
                        let inputs: Vec<f64> = inputs.iter().map(|column| column[row]).collect();
                        // The band of 3 % then corresponds to three standard deviations.
                        (own.at(&inputs), sensor.scale.unwrap_or(100.0 * own.deviation))
                    };
                    let (nominal, scale): (Vec<f64>, Vec<f64>) = (0..count).map(at).unzip();
                    (Cow::Owned(nominal), scale)
                }
            };
            let columns = SensorColumns { measured, nominal, scale };
            let is_far = |[value, nominal, scale]: [f64; 3]| {
                let residual = (value - nominal).abs();
                residual.is_finite() && residual > FARTHEST * scale
            };
            let Some(row) = (0..count).find(|&row| is_far(columns.sample(row))) else {
                return Ok(columns);
            };
            let (column, place) = (sensor.measured.clone(), records.origin().place(row));
            let [value, nominal, scale] = columns.sample(row);
            Err(RecordingError::TooFar { column, place, value, nominal, scale })
        };
        self.sensors.iter().zip(nominals).map(one).collect()
    }

    /// The first rows of the complete windows.
    fn starts(&self, rows: usize, kept: &[Vec<String>]) -> Result<Vec<usize>, RecordingError> {
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
            true => Err(RecordingError::NoWindow { window_rows: self.window_rows, longest }),
            false => Ok(starts),
        }
    }
}

/// Measured minus nominal in the healthy rows that have both.
fn residuals(
    records: &Table,
    measured: &str,
    nominal: &str,
    healthy: &[usize],
) -> Result<Vec<f64>, TableError> {
    let (measured, nominal) = (records.f64(measured)?, records.f64(nominal)?);
    let residuals = healthy.iter().map(|&row| measured[row] - nominal[row]);
    Ok(residuals.filter(|residual| residual.is_finite()).collect())
}

/// The features of a window of signals, each with its first row. Features that depend on a signal without a number are
/// missing.
fn features(
    families: &[&'static Family],
    sensors: &Sensors,
    signals: &[(&SensorColumns, usize)],
    rows: usize,
) -> Vec<f64> {
    let absent =
        |(own, first): &(&SensorColumns, usize)| !(*first..first + rows).any(|r| own.has(r));
    let mut absent: Vec<bool> = signals.iter().map(absent).collect();
    let is_complete = |row: &usize| {
        signals.iter().zip(&absent).all(|((own, first), absent)| *absent || own.has(first + row))
    };
    let complete: Vec<usize> = (0..rows).filter(is_complete).collect();
    if complete.is_empty() {
        absent.fill(true);
    }
    // A feature depends on an absent signal if it differs between two values of its residual.
    let with = |instead: f64| -> Vec<f64> {
        let mut window = Window::new(signals.len());
        for (k, row) in complete.iter().enumerate() {
            let instead = if k % 2 == 0 { instead } else { -0.5 * instead };
            let sample = |((own, first), absent): (&(&SensorColumns, usize), &bool)| match absent {
                true => [instead, 0.0, 1.0],
                false => own.sample(first + row),
            };
            let samples: Vec<[f64; 3]> = signals.iter().zip(&absent).map(sample).collect();
            let [measured, nominal, scale] =
                [0, 1, 2].map(|of| samples.iter().map(|own| own[of]).collect::<Vec<f64>>());
            window.add(&measured, &nominal, &scale);
        }
        families.iter().flat_map(|family| family.values(sensors, &window)).collect()
    };
    let values = with(0.0);
    if !absent.contains(&true) {
        return values;
    }
    let is_lost = complete.is_empty();
    let both = values.into_iter().zip(with(1.0));
    both.map(|(value, other)| if is_lost || value != other { f64::NAN } else { value }).collect()
}
