//! A campaign's data set as an evaluation sees it: features in every view, labels, groups.
//!
//! Columns: `case`, `fault`, `kind`, `intensity`, `actuator`, `command`, `detail`, `detectable`,
//! `f:<feature>` and, where the system has like actuators, `m:<feature>`, the same feature with the
//! two actuators exchanged. Rows whose `kind` is `healthy` have no fault; rows with a text in
//! `failure` were not simulated to the end, and are counted and left out.

use super::error::EvaluationError;
use crate::study::Study;
use crate::study::campaign::data_features;
use crate::table::Table;
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::classifiers::cart::Resolution;
use servotwin_diagnosis::hierarchy::{Examples, Label, Names};

/// The word for rows without a fault.
pub const HEALTHY: &str = "healthy";

/// Commands by urgency; others follow in the order of the alphabet.
const URGENCY: [&str; 3] = ["shut_down", "change_mode", "warning"];

/// What an evaluation must know of a feature.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FeatureInfo {
    /// Its name.
    pub name: String,
    /// The family that computes it.
    pub family: String,
    /// The actuators it looks at, from 0.
    pub units: Vec<usize>,
    /// See [`servotwin_diagnosis::features::Feature::resolution`].
    pub resolution: f64,
}

impl FeatureInfo {
    /// The features of a study; those that need its extra sensor only if asked for.
    pub fn of_study(study: &Study, extra: bool) -> Vec<Self> {
        let features = data_features(study).into_iter().filter(|f| extra || !f.extra);
        let info = |f: crate::study::campaign::DataFeature| FeatureInfo {
            name: f.feature.name,
            family: f.family.into(),
            units: f.feature.units,
            resolution: f.feature.resolution,
        };
        features.map(info).collect()
    }
}

/// What is known of a row besides its features and its label.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Place in [`DataSet::cases`].
    pub case: u32,
    /// Place in [`DataSet::faults`].
    pub fault: u32,
    /// Place in [`DataSet::kinds`].
    pub kind: u32,
    /// Place in [`DataSet::intensities`].
    pub intensity: u32,
    /// Whether a residual left the band.
    pub detectable: bool,
}

/// A data set ready to be learnt from.
#[derive(Debug, Clone)]
pub struct DataSet {
    /// The features.
    pub features: Vec<FeatureInfo>,
    /// The rows with a fault.
    pub examples: Examples,
    /// The same rows.
    pub rows: Vec<Row>,
    /// Operating cases, sorted.
    pub cases: Vec<String>,
    /// Faults with their actuator, sorted.
    pub faults: Vec<String>,
    /// Faults without it, sorted.
    pub kinds: Vec<String>,
    /// Intensities, ascending.
    pub intensities: Vec<f64>,
    /// Rows without a fault, if there are any; their labels mean nothing.
    pub healthy: Option<Examples>,
    /// Which of them left the band nevertheless.
    pub alarms: Vec<bool>,
    /// Rows that were not simulated to the end.
    pub failed: usize,
    /// Features that have one value in all rows with a fault.
    pub constant: Vec<String>,
}

impl DataSet {
    /// Reads a data set's table. `units` are the actuators in the order in which the features count
    /// them; without, they are sorted by name.
    ///
    /// # Errors
    /// A column is missing or of another kind, a feature is NaN or infinite, or there is no fault.
    pub fn new(
        table: &Table,
        features: Vec<FeatureInfo>,
        units: &[String],
    ) -> Result<Self, EvaluationError> {
        if features.is_empty() {
            return Err(EvaluationError::NoFeatures);
        }
        let done = rows_that_ran(table)?;
        let failed = table.row_count() - done.len();
        let kinds = table.text("kind")?;
        let (healthy, faulty): (Vec<usize>, Vec<usize>) =
            done.into_iter().partition(|&row| kinds[row] == HEALTHY);
        if faulty.is_empty() {
            return Err(EvaluationError::NoFaults);
        }
        let names = names(table, &features, units, &faulty)?;
        let mirrored = names.actuators.len() == 2 && has_mirror(table, &features);
        let make = |rows: &[usize], labels| -> Result<Examples, EvaluationError> {
            let prefixes: &[&str] = if mirrored { &["f:", "m:"] } else { &["f:"] };
            let views = prefixes.iter().map(|prefix| values(table, prefix, &features, rows));
            let views = views.collect::<Result<_, _>>()?;
            let read = own_columns(&features, &names);
            Ok(Examples::new(names.clone(), read, views, labels)?)
        };
        let examples = make(&faulty, labels(table, &names, &faulty)?)?;
        let none = Label { actuator: 0, command: 0, detail: 0 };
        let healthy_examples = match healthy.is_empty() {
            true => None,
            false => Some(make(&healthy, vec![none; healthy.len()])?),
        };
        let detectable = table.bool("detectable")?;
        let text = |name: &str| -> Result<(Vec<String>, Vec<u32>), EvaluationError> {
            Ok(coded(table.text(name)?, &faulty))
        };
        let ((cases, case), (faults, fault), (kinds, kind)) =
            (text("case")?, text("fault")?, text("kind")?);
        let (intensities, intensity) = coded_numbers(&table.finite_f64("intensity")?, &faulty);
        let row = |place: usize| Row {
            case: case[place],
            fault: fault[place],
            kind: kind[place],
            intensity: intensity[place],
            detectable: detectable[faulty[place]],
        };
        Ok(DataSet {
            constant: constant_features(table, &features, &faulty)?,
            rows: (0..faulty.len()).map(row).collect(),
            alarms: healthy.iter().map(|&row| detectable[row]).collect(),
            healthy: healthy_examples,
            features,
            examples,
            cases,
            faults,
            kinds,
            intensities,
            failed,
        })
    }

    /// The rows that are detected, and so diagnosed.
    ///
    /// # Errors
    /// [`EvaluationError::NothingDetectable`].
    pub fn detectable(&self) -> Result<Vec<usize>, EvaluationError> {
        let rows: Vec<usize> =
            (0..self.rows.len()).filter(|&row| self.rows[row].detectable).collect();
        match rows.is_empty() {
            true => Err(EvaluationError::NothingDetectable { faults: self.rows.len() }),
            false => Ok(rows),
        }
    }

    /// The same data set with the features only that a choice allows.
    ///
    /// # Errors
    /// [`EvaluationError::NoFeatures`].
    pub fn with_features(
        &self,
        choice: impl Fn(&FeatureInfo) -> bool,
    ) -> Result<Self, EvaluationError> {
        let kept = |column: &usize| choice(&self.features[*column]);
        let columns: Vec<usize> = (0..self.features.len()).filter(kept).collect();
        if columns.is_empty() {
            return Err(EvaluationError::NoFeatures);
        }
        let healthy = self.healthy.as_ref().map(|healthy| healthy.select_columns(&columns));
        Ok(DataSet {
            features: columns.iter().map(|&column| self.features[column].clone()).collect(),
            examples: self.examples.select_columns(&columns)?,
            healthy: healthy.transpose()?,
            ..self.clone()
        })
    }

    /// The same data set with the stages below A reading the sensors of both
    /// actuators and what compares them.
    ///
    /// # Errors
    /// None for a data set that could be read.
    pub fn all_sensors_below(&self) -> Result<Self, EvaluationError> {
        let all = (0..self.features.len()).collect();
        let read = vec![all; self.examples.names().actuators.len()];
        Ok(DataSet { examples: self.examples.reading(read)?, ..self.clone() })
    }

    /// The smallest thresholds that features resolve where residuals carry an error, in parts of
    /// scale.
    pub fn resolutions(&self, residual_error: f64) -> Vec<Resolution> {
        let resolved = self.features.iter().filter(|feature| feature.resolution > 0.0);
        let resolution = |feature: &FeatureInfo| Resolution {
            feature: feature.name.clone(),
            gap: 0.0,
            magnitude: feature.resolution * residual_error,
        };
        resolved.map(resolution).collect()
    }

    /// The families of the features, in the order of the features.
    pub fn families(&self) -> Vec<String> {
        let mut families: Vec<String> = vec![];
        for feature in &self.features {
            if !families.contains(&feature.family) {
                families.push(feature.family.clone());
            }
        }
        families
    }

    /// The component of a kind: all but the last word.
    pub fn component(&self, kind: u32) -> &str {
        let kind = &self.kinds[kind as usize];
        kind.rsplit_once('.').map_or(kind, |(component, _)| component)
    }
}

fn rows_that_ran(table: &Table) -> Result<Vec<usize>, EvaluationError> {
    let all = 0..table.row_count();
    if !table.names().any(|name| name == "failure") {
        return Ok(all.collect());
    }
    let failures = table.text("failure")?;
    Ok(all.filter(|&row| failures[row].is_empty()).collect())
}

fn has_mirror(table: &Table, features: &[FeatureInfo]) -> bool {
    let known: std::collections::BTreeSet<&str> = table.names().collect();
    features.iter().all(|feature| known.contains(format!("m:{}", feature.name).as_str()))
}

/// The texts of some rows, sorted and numbered.
fn coded(texts: &[String], rows: &[usize]) -> (Vec<String>, Vec<u32>) {
    let mut names: Vec<String> = rows.iter().map(|&row| texts[row].clone()).collect();
    names.sort();
    names.dedup();
    let code = |&row: &usize| names.binary_search(&texts[row]).unwrap_or(0) as u32;
    let codes = rows.iter().map(code).collect();
    (names, codes)
}

/// The numbers of some rows, sorted and numbered.
fn coded_numbers(numbers: &[f64], rows: &[usize]) -> (Vec<f64>, Vec<u32>) {
    let mut names: Vec<f64> = rows.iter().map(|&row| numbers[row]).collect();
    names.sort_by(f64::total_cmp);
    names.dedup();
    let code = |&row: &usize| {
        names.binary_search_by(|known| known.total_cmp(&numbers[row])).unwrap_or(0) as u32
    };
    let codes = rows.iter().map(code).collect();
    (names, codes)
}

fn names(
    table: &Table,
    features: &[FeatureInfo],
    units: &[String],
    rows: &[usize],
) -> Result<Names, EvaluationError> {
    let of = |column: &str| -> Result<Vec<String>, EvaluationError> {
        Ok(coded(table.text(column)?, rows).0)
    };
    let mut commands = of("command")?;
    let urgency = |name: &String| URGENCY.iter().position(|known| known == name);
    commands.sort_by_key(|name| (urgency(name).unwrap_or(URGENCY.len()), name.clone()));
    let found = of("actuator")?;
    let all_known = found.iter().all(|name| units.contains(name));
    Ok(Names {
        features: features.iter().map(|feature| feature.name.clone()).collect(),
        actuators: if all_known { units.to_vec() } else { found },
        commands,
        details: of("detail")?,
    })
}

fn labels(table: &Table, names: &Names, rows: &[usize]) -> Result<Vec<Label>, EvaluationError> {
    let place = |known: &[String], text: &String| {
        known.iter().position(|name| name == text).unwrap_or(0) as u32
    };
    let (actuators, commands, details) =
        (table.text("actuator")?, table.text("command")?, table.text("detail")?);
    let label = |&row: &usize| Label {
        actuator: place(&names.actuators, &actuators[row]),
        command: place(&names.commands, &commands[row]),
        detail: place(&names.details, &details[row]),
    };
    Ok(rows.iter().map(label).collect())
}

/// For each actuator the features of its own sensors; all, where it has none.
fn own_columns(features: &[FeatureInfo], names: &Names) -> Vec<Vec<usize>> {
    let own = |actuator: usize| {
        let is_own = |column: &usize| features[*column].units == [actuator];
        let own: Vec<usize> = (0..features.len()).filter(is_own).collect();
        let alone = names.actuators.len() == 1 || own.is_empty();
        if alone { (0..features.len()).collect() } else { own }
    };
    (0..names.actuators.len()).map(own).collect()
}

fn values(
    table: &Table,
    prefix: &str,
    features: &[FeatureInfo],
    rows: &[usize],
) -> Result<Vec<f64>, EvaluationError> {
    let mut values = Vec::with_capacity(features.len() * rows.len());
    for feature in features {
        let column = table.finite_f64(&format!("{prefix}{}", feature.name))?;
        values.extend(rows.iter().map(|&row| column[row]));
    }
    Ok(values)
}

fn constant_features(
    table: &Table,
    features: &[FeatureInfo],
    rows: &[usize],
) -> Result<Vec<String>, EvaluationError> {
    let mut constant = vec![];
    for feature in features {
        let column = table.f64(&format!("f:{}", feature.name))?;
        if rows.iter().all(|&row| column[row] == column[rows[0]]) {
            constant.push(feature.name.clone());
        }
    }
    Ok(constant)
}
