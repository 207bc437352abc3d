//! The data sets of a scenario for evaluation: features in every view, labels, groups.
//!
//! Columns: `case`, `flown` (the command of the case), `fault`, `kind`, `intensity`, `grade`, `actuator`, `action`, `detail`,
//! `failure`, `detectable`, `largest:<sensor>` and `f:<feature>`. If the system has like actuators, `m:<feature>` is
//! the same feature seen from the second one, `m3:<feature>` from the third, and so on
//! ([`servotwin_diagnosis::hierarchy`]). Rows whose `kind` is `healthy` have no fault. Rows with a text in `failure`
//! were not simulated to the end; they are counted and left out.
//!
//! The judged rows come first, followed by the training rows.

use super::error::EvaluationError;
use super::perturbation::{Perturbation, PerturbedWindow};
use crate::parallel::{self, Workers};
use crate::records::columns::view_column;
use crate::records::{DataFeature, largest_column};
use crate::study::Purpose;
use crate::table::{Table, TableError};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::hierarchy::{HEALTHY, Names};
use servotwin_learning::hierarchy::{Examples, Label};
use std::borrow::Cow;
use std::cmp::Ordering;
use std::sync::Arc;

/// The properties of a row besides its features and label.
#[derive(Debug, Clone, PartialEq)]
pub struct DataRow {
    /// Whether the row is for judging or for training.
    pub purpose: Purpose,
    /// The variant's number in its data set.
    pub(crate) variant: usize,
    /// Index in [`DataSet::cases`].
    pub(crate) case: u32,
    /// The number of the command flown, in the order of their first rows.
    pub(crate) flown: u32,
    /// Index in [`DataSet::faults`].
    pub(crate) fault: u32,
    /// Index in `DataSet::kinds`.
    pub kind: u32,
    /// Index in `DataSet::intensities`: the study's nominal intensity.
    pub intensity: u32,
    /// Its actual intensity.
    pub own_intensity: f64,
    /// The number of its perturbation, from 1; 0 for the original window. Perturbed rows are used for training, never
    /// for judging.
    pub(crate) moved: usize,
    /// The factor by which the fault of its window was scaled.
    pub(crate) factor: f64,
    /// Whether the row has no fault.
    pub is_healthy: bool,
    /// Whether its simulation began without a steady state. Bands are not learned from such a row.
    pub began_on_the_move: bool,
    /// The largest absolute value of each residual, as a fraction of its scale, in the order of [`DataSet::sensors`].
    /// Empty if the data set lacks it.
    pub largest: Vec<f64>,
    /// The largest residual relative to its band.
    pub excess: f64,
}

impl DataRow {
    /// Whether a residual left its band.
    pub fn is_detected(&self) -> bool {
        self.excess > 1.0
    }
}

/// Selects training rows by their largest residual relative to its band.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TrainingFilter {
    /// Lower limit for faults.
    pub(crate) faults: f64,
    /// Lower limit for copies with a weaker fault.
    pub(crate) weaker: f64,
    /// Lower limit for healthy specimens.
    pub(crate) healthy: f64,
    /// How many perturbed copies of each window are used.
    pub(crate) moves: usize,
}

impl Default for TrainingFilter {
    /// Detected faults and nearly detected healthy specimens, with all their perturbations.
    fn default() -> Self {
        TrainingFilter { faults: 1.0, weaker: 1.0, healthy: 0.8, moves: usize::MAX }
    }
}

impl TrainingFilter {
    fn teaches(self, row: &DataRow) -> bool {
        let least = match row.is_healthy {
            true => self.healthy,
            false if row.factor < 1.0 => self.weaker,
            false => self.faults,
        };
        row.excess > least && row.moved <= self.moves
    }
}

/// Data sets prepared for training and evaluation.
#[derive(Debug, Clone)]
pub struct DataSet {
    /// The features, in column order.
    pub features: Vec<DataFeature>,
    /// The features and labels of all rows. They are large, so data sets that differ only in bands share them.
    pub examples: Arc<Examples>,
    /// The other properties of the same rows.
    pub rows: Vec<DataRow>,
    /// The sensors with known largest residuals.
    pub sensors: Vec<String>,
    /// Operating cases, in the order of their first rows.
    pub(crate) cases: Vec<String>,
    /// Faults with their actuator, sorted by name.
    pub(crate) faults: Vec<String>,
    /// Faults without the actuator, sorted by name.
    pub(crate) kinds: Vec<String>,
    /// The study's intensities, ascending.
    pub(crate) intensities: Vec<f64>,
    /// Number of rows that were not simulated to the end.
    pub failed: usize,
    /// Features with a single value in all fault rows.
    pub(crate) constant: Vec<String>,
}

/// Rows below this excess are not used for training and need no perturbation.
const LEAST_EXCESS: f64 = 0.5;

/// The table and row that a data set's row comes from.
#[derive(Clone, Copy)]
struct Origin<'t> {
    purpose: Purpose,
    table: &'t Table,
    row: usize,
}

impl DataSet {
    /// The indices of named actions; names without a row are left out.
    pub(crate) fn actions(&self, names: &[String]) -> Vec<u32> {
        let known = self.examples.names().actions.iter().enumerate();
        known.filter(|(_, name)| names.contains(name)).map(|(place, _)| place as u32).collect()
    }

    /// Reads the tables of one scenario. `units` lists the actuators in the order in which features count them; if
    /// empty, they are sorted by name. `urgency` lists the actions, the most urgent first; others follow by name.
    ///
    /// # Errors
    /// A column is missing or of another type, a feature is NaN or infinite, or there is no fault.
    pub fn new(
        tables: &[(Purpose, Table)],
        features: Vec<DataFeature>,
        units: &[String],
        urgency: &[String],
    ) -> Result<Self, EvaluationError> {
        if features.is_empty() {
            return Err(EvaluationError::NoFeatures);
        }
        let (mut origins, mut all) = (vec![], 0);
        for (purpose, table) in tables {
            all += table.row_count();
            let failures = table.text("failure")?.iter().enumerate();
            let done = failures.filter(|(_, failure)| failure.is_empty());
            origins.extend(done.map(|(row, _)| Origin { purpose: *purpose, table, row }));
        }
        let origins = origins.as_slice();
        let column = |name: &str| texts(origins, name);
        let kinds = column("kind")?;
        if kinds.iter().all(|kind| kind == HEALTHY) {
            return Err(EvaluationError::NoFaults);
        }
        let names = names(origins, &features, units, urgency)?;
        let all_views = 0..names.actuators.len();
        let has = |view| tables.iter().all(|(_, table)| has_view(table, view, &features));
        let count = if all_views.clone().all(has) { all_views.end } else { 1 };
        let views = (0..count).map(|view| values(origins, view, &features));
        let views: Vec<Vec<f64>> = views.collect::<Result<_, _>>()?;
        let is_faulty: Vec<bool> = kinds.iter().map(|kind| kind != HEALTHY).collect();
        let constant = constant_features(&views[0], &features, &is_faulty);
        let read = own_columns(&features, &names);
        let labels = labels(origins, &names)?;
        let examples = Examples::new(names, read, views, labels)?;
        let sensors = known_sensors(tables);
        let (cases, case) = in_order(&column("case")?);
        let (_, command) = in_order(&column("flown")?);
        let (faults, fault) = coded(&column("fault")?, Ord::cmp);
        let (kind_names, kind) = coded(&kinds, Ord::cmp);
        let own_intensity = numbers(origins, "intensity")?;
        let (intensities, intensity) = coded(&numbers(origins, "grade")?, f64::total_cmp);
        let moving = flags(origins, "began_on_the_move");
        let moving = moving.unwrap_or_else(|_| vec![false; origins.len()]);
        let detectable = flags(origins, "detectable")?;
        let largest = sensors.iter().map(|s| numbers(origins, &largest_column(s)));
        let largest: Vec<Vec<f64>> = largest.collect::<Result<_, _>>()?;
        let row = |place: usize| DataRow {
            purpose: origins[place].purpose,
            variant: origins[place].row,
            case: case[place],
            flown: command[place],
            fault: fault[place],
            kind: kind[place],
            intensity: intensity[place],
            own_intensity: own_intensity[place],
            moved: 0,
            factor: 1.0,
            is_healthy: kinds[place] == HEALTHY,
            began_on_the_move: moving[place],
            largest: largest.iter().map(|column| column[place]).collect(),
            // The data set's own verdict, until bands are applied.
            excess: if detectable[place] { f64::INFINITY } else { 0.0 },
        };
        Ok(DataSet {
            rows: (0..origins.len()).map(row).collect(),
            features,
            examples: Arc::new(examples),
            sensors,
            cases,
            faults,
            kinds: kind_names,
            intensities,
            failed: all - origins.len(),
            constant,
        })
    }

    /// The rows for a purpose that satisfy a condition.
    pub fn rows_where(&self, purpose: Purpose, choice: impl Fn(&DataRow) -> bool) -> Vec<usize> {
        let wanted = |row: &usize| self.rows[*row].purpose == purpose && choice(&self.rows[*row]);
        (0..self.rows.len()).filter(wanted).collect()
    }

    /// The judged rows with a detected fault.
    ///
    /// # Errors
    /// [`EvaluationError::NothingDetectable`] if there are none.
    pub(crate) fn detectable(&self) -> Result<Vec<usize>, EvaluationError> {
        let rows = self.rows_where(Purpose::Test, |row| !row.is_healthy && row.is_detected());
        match rows.is_empty() {
            true => Err(EvaluationError::NothingDetectable { faults: self.faults().len() }),
            false => Ok(rows),
        }
    }

    /// The judged rows with a fault.
    pub(crate) fn faults(&self) -> Vec<usize> {
        self.rows_where(Purpose::Test, |row| !row.is_healthy)
    }

    /// Whether there are training rows separate from the judged ones.
    pub(crate) fn has_training(&self) -> bool {
        self.rows.iter().any(|row| row.purpose == Purpose::Train)
    }

    /// The rows from which the delivered diagnosis learns: the selected training rows, or the selected judged rows if
    /// there are no training rows.
    ///
    /// # Errors
    /// [`EvaluationError::NothingDetectable`] if none of them has a fault.
    pub(crate) fn learnt_from(
        &self,
        lessons: TrainingFilter,
    ) -> Result<Vec<usize>, EvaluationError> {
        let purpose = if self.has_training() { Purpose::Train } else { Purpose::Test };
        let rows = self.rows_where(purpose, |row| lessons.teaches(row));
        let all = self.rows_where(purpose, |row| !row.is_healthy).len();
        match rows.iter().all(|&row| self.rows[row].is_healthy) {
            true => Err(EvaluationError::NothingDetectable { faults: all }),
            false => Ok(rows),
        }
    }

    /// The same data with a band for each sensor in [`DataSet::sensors`].
    pub fn with_bands(&self, bands: &[f64]) -> Self {
        let mut data = self.clone();
        for row in &mut data.rows {
            let parts = row.largest.iter().zip(bands).map(|(size, band)| size / band);
            row.excess = parts.fold(0.0, f64::max);
        }
        data
    }

    /// Adds perturbed copies of the training rows, one per draw, so that trees do not learn details below the sensors'
    /// uncertainty. Faults are also made weaker ([`Perturbation::of_fault`]). Apply bands first.
    ///
    /// # Errors
    /// [`EvaluationError::Cancelled`]; a value that is not finite.
    pub(crate) fn with_perturbed(
        &self,
        perturbation: &Perturbation,
        workers: Workers,
    ) -> Result<Self, EvaluationError> {
        let rows = self.rows_where(Purpose::Train, |row| row.excess > LEAST_EXCESS);
        let specimens = self.specimens();
        let views = self.examples.views();
        let of = |&row: &usize| -> Vec<(DataRow, Vec<Vec<f64>>)> {
            let own = &self.rows[row];
            let moved = match own.is_healthy {
                true => {
                    let still = |window| PerturbedWindow { window, factor: 1.0 };
                    perturbation.perturbed(row).into_iter().map(still).collect()
                }
                false => perturbation.of_fault(row, &specimens[own.case as usize]),
            };
            let one = |(draw, PerturbedWindow { window, factor }): (usize, PerturbedWindow)| {
                let mut copy = DataRow { moved: 1 + draw, factor, ..own.clone() };
                if factor != 1.0 {
                    let sizes = copy.largest.iter_mut().enumerate();
                    sizes.for_each(|(sensor, size)| *size = window.largest(sensor));
                }
                (copy, perturbation.views(&window, views))
            };
            moved.into_iter().enumerate().map(one).collect()
        };
        let moved = parallel::map(&rows, workers, of)?;
        let mut origins = vec![];
        for (&row, moved) in rows.iter().zip(&moved) {
            origins.extend(moved.iter().map(|_| row));
        }
        let (copies, values): (Vec<DataRow>, Vec<Vec<Vec<f64>>>) =
            moved.into_iter().flatten().unzip();
        let rows = self.rows.iter().cloned().chain(copies).collect();
        let examples = self.examples.extended(&origins, |row, view| &values[row][view]);
        Ok(DataSet { rows, examples: Arc::new(examples), ..self.clone() })
    }

    /// For each case, the training rows without a fault.
    fn specimens(&self) -> Vec<Vec<usize>> {
        let mut specimens = vec![vec![]; self.cases.len()];
        for row in self.rows_where(Purpose::Train, |row| row.is_healthy && row.moved == 0) {
            specimens[self.rows[row].case as usize].push(row);
        }
        specimens
    }

    /// The same data without the rows that `drop` selects.
    pub fn without(&self, drop: impl Fn(&DataRow) -> bool) -> Self {
        let kept: Vec<usize> = (0..self.rows.len()).filter(|&row| !drop(&self.rows[row])).collect();
        DataSet {
            examples: Arc::new(self.examples.select_rows(&kept)),
            rows: kept.iter().map(|&row| self.rows[row].clone()).collect(),
            ..self.clone()
        }
    }

    /// The same data set with only the features that `choice` selects.
    ///
    /// # Errors
    /// [`EvaluationError::NoFeatures`] if none is left.
    pub fn with_features(
        &self,
        choice: impl Fn(&DataFeature) -> bool,
    ) -> Result<Self, EvaluationError> {
        let kept = |column: &usize| choice(&self.features[*column]);
        let columns: Vec<usize> = (0..self.features.len()).filter(kept).collect();
        if columns.is_empty() {
            return Err(EvaluationError::NoFeatures);
        }
        Ok(DataSet {
            features: columns.iter().map(|&column| self.features[column].clone()).collect(),
            examples: Arc::new(self.examples.select_columns(&columns)?),
            ..self.clone()
        })
    }

    /// The same data set with only the features for diagnosing whole records.
    ///
    /// # Errors
    /// [`EvaluationError::NoFeatures`] if none is left.
    pub fn taught(&self) -> Result<Self, EvaluationError> {
        self.with_features(|feature| feature.feature.teaches.of_records())
    }

    /// The same data set with only the features for diagnosing sliding windows.
    ///
    /// # Errors
    /// [`EvaluationError::NoFeatures`] if none is left.
    pub(crate) fn taught_to_windows(&self) -> Result<Self, EvaluationError> {
        self.with_features(|feature| feature.feature.teaches.of_windows())
    }

    /// The same data set, in which a committee reads only the features for sliding windows.
    ///
    /// # Errors
    /// Never for a data set that could be read.
    pub(crate) fn for_committee(&self) -> Result<Self, EvaluationError> {
        let columns = 0..self.features.len();
        let hidden = columns.filter(|&column| !self.features[column].feature.teaches.of_windows());
        Ok(DataSet { examples: Arc::new(self.examples.hiding(hidden.collect())?), ..self.clone() })
    }

    /// The component of a kind: its name without the last part.
    pub(crate) fn component(&self, kind: u32) -> &str {
        let kind = &self.kinds[kind as usize];
        kind.rsplit_once('.').map_or(kind, |(component, _)| component)
    }
}

fn has_view(table: &Table, view: usize, features: &[DataFeature]) -> bool {
    let known: std::collections::BTreeSet<&str> = table.names().collect();
    features.iter().all(|feature| known.contains(view_column(view, &feature.feature.name).as_str()))
}

/// The sensors whose largest residuals all tables have.
fn known_sensors(tables: &[(Purpose, Table)]) -> Vec<String> {
    let prefix = largest_column("");
    let of = |table: &Table| -> Vec<String> {
        table.names().filter_map(|name| Some(name.strip_prefix(&prefix)?.to_owned())).collect()
    };
    let first = tables.first().map_or(vec![], |(_, table)| of(table));
    let same = tables.iter().all(|(_, table)| of(table) == first);
    if same { first } else { vec![] }
}

/// Joins a column over the rows of several tables.
fn gather<'t, T: Clone + 't>(
    origins: &[Origin<'t>],
    column: impl Fn(&'t Table) -> Result<Cow<'t, [T]>, TableError>,
) -> Result<Vec<T>, EvaluationError> {
    let mut values = Vec::with_capacity(origins.len());
    for run in origins.chunk_by(|a, b| std::ptr::eq(a.table, b.table)) {
        let column = column(run[0].table)?;
        values.extend(run.iter().map(|origin| column[origin.row].clone()));
    }
    Ok(values)
}

fn texts(origins: &[Origin], name: &str) -> Result<Vec<String>, EvaluationError> {
    gather(origins, |table| Ok(Cow::Borrowed(table.text(name)?)))
}

fn flags(origins: &[Origin], name: &str) -> Result<Vec<bool>, EvaluationError> {
    gather(origins, |table| Ok(Cow::Borrowed(table.bool(name)?)))
}

fn numbers(origins: &[Origin], name: &str) -> Result<Vec<f64>, EvaluationError> {
    gather(origins, |table| table.finite_f64(name))
}

/// Numbers texts in the order of first occurrence.
pub(crate) fn in_order(texts: &[String]) -> (Vec<String>, Vec<u32>) {
    let mut names: Vec<String> = vec![];
    // Equal texts mostly follow one another.
    let code = |text: &String| match names.iter().rposition(|name| name == text) {
        Some(place) => place as u32,
        None => {
            names.push(text.clone());
            names.len() as u32 - 1
        }
    };
    let codes = texts.iter().map(code).collect();
    (names, codes)
}

/// Numbers values in ascending order.
pub(crate) fn coded<T: Clone + PartialEq>(
    values: &[T],
    order: impl Fn(&T, &T) -> Ordering,
) -> (Vec<T>, Vec<u32>) {
    let mut names = values.to_vec();
    names.sort_by(&order);
    names.dedup();
    let place = |value: &T| names.binary_search_by(|known| order(known, value)).unwrap_or(0) as u32;
    let codes = values.iter().map(place).collect();
    (names, codes)
}

fn names(
    origins: &[Origin],
    features: &[DataFeature],
    units: &[String],
    urgency: &[String],
) -> Result<Names, EvaluationError> {
    let of = |column: &str| -> Result<Vec<String>, EvaluationError> {
        let mut names = coded(&texts(origins, column)?, Ord::cmp).0;
        names.retain(|name| name != HEALTHY);
        Ok(names)
    };
    let mut actions = of("action")?;
    let place = |name: &String| urgency.iter().position(|known| known == name);
    actions.sort_by_key(|name| (place(name).unwrap_or(urgency.len()), name.clone()));
    let found = of("actuator")?;
    let all_known = found.iter().all(|name| units.contains(name));
    Ok(Names {
        features: features.iter().map(|feature| feature.feature.name.clone()).collect(),
        actuators: if all_known { units.to_vec() } else { found },
        actions,
        details: of("detail")?,
    })
}

fn labels(origins: &[Origin], names: &Names) -> Result<Vec<Label>, EvaluationError> {
    let place = |known: &[String], text: &String| {
        known.iter().position(|name| name == text).unwrap_or(0) as u32
    };
    let (actuators, actions, details) =
        (texts(origins, "actuator")?, texts(origins, "action")?, texts(origins, "detail")?);
    let label = |row: usize| Label {
        actuator: match actuators[row] == HEALTHY {
            true => names.healthy(),
            false => place(&names.actuators, &actuators[row]),
        },
        action: place(&names.actions, &actions[row]),
        detail: place(&names.details, &details[row]),
    };
    Ok((0..origins.len()).map(label).collect())
}

/// For each actuator, the features of its own sensors; all features if it has none.
fn own_columns(features: &[DataFeature], names: &Names) -> Vec<Vec<usize>> {
    let own = |actuator: usize| {
        let is_own = |column: &usize| features[*column].feature.actuators == [actuator];
        let own: Vec<usize> = (0..features.len()).filter(is_own).collect();
        let alone = names.actuators.len() == 1 || own.is_empty();
        if alone { (0..features.len()).collect() } else { own }
    };
    (0..names.actuators.len()).map(own).collect()
}

fn values(
    origins: &[Origin],
    view: usize,
    features: &[DataFeature],
) -> Result<Vec<f64>, EvaluationError> {
    let mut values = Vec::with_capacity(features.len() * origins.len());
    for feature in features {
        values.extend(numbers(origins, &view_column(view, &feature.feature.name))?);
    }
    Ok(values)
}

fn constant_features(values: &[f64], features: &[DataFeature], counts: &[bool]) -> Vec<String> {
    let is_constant = |column: &[f64]| {
        let mut counted = column.iter().zip(counts).filter(|(_, counts)| **counts);
        let first = counted.next();
        counted.all(|(value, _)| first.is_some_and(|(first, _)| value == first))
    };
    let columns = values.chunks_exact(counts.len()).zip(features);
    let constant = columns.filter(|(column, _)| is_constant(column));
    constant.map(|(_, feature)| feature.feature.name.clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(excess: f64, factor: f64) -> DataRow {
        DataRow {
            purpose: Purpose::Train,
            variant: 0,
            case: 0,
            flown: 0,
            fault: 0,
            kind: 0,
            intensity: 0,
            own_intensity: 0.5,
            moved: usize::from(factor != 1.0),
            factor,
            is_healthy: false,
            began_on_the_move: false,
            largest: vec![],
            excess,
        }
    }

    #[test]
    fn copies_of_a_fault_teach_by_a_limit_of_their_own() {
        let lessons = TrainingFilter { weaker: 0.25, ..TrainingFilter::default() };
        assert!(lessons.teaches(&row(1.1, 1.0)) && lessons.teaches(&row(0.3, 0.4)));
        assert!(!lessons.teaches(&row(0.9, 1.0)) && !lessons.teaches(&row(0.2, 0.4)));
        let healthy = |excess| DataRow { is_healthy: true, ..row(excess, 1.0) };
        assert!(lessons.teaches(&healthy(0.9)) && !lessons.teaches(&healthy(0.7)));
    }
}
