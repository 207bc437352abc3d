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

/// What is known of a row besides its features.
#[derive(Clone)]
pub(crate) struct LabeledRow<'t> {
    pub(crate) purpose: Purpose,
    /// The variant's number in its data set.
    pub(crate) variant: usize,
    /// The operating case, and its command.
    pub(crate) case: &'t str,
    pub(crate) flown: &'t str,
    /// The fault, and the fault without its actuator; [`HEALTHY`] for none, as all labels.
    pub(crate) fault: &'t str,
    pub(crate) kind: &'t str,
    pub(crate) actuator: &'t str,
    pub(crate) action: &'t str,
    pub(crate) detail: &'t str,
    /// The study's nominal intensity, and the actual one.
    pub(crate) grade: f64,
    pub(crate) own_intensity: f64,
    pub(crate) began_on_the_move: bool,
    pub(crate) is_detectable: bool,
    /// See [`DataRow::largest`].
    pub(crate) largest: Vec<f64>,
}

impl DataSet {
    /// The indices of named actions; names without a row are left out.
    pub(crate) fn actions(&self, names: &[String]) -> Vec<u32> {
        let known = self.examples.names().actions.iter().enumerate();
        known.filter(|(_, name)| names.contains(name)).map(|(place, _)| place as u32).collect()
    }

    /// Reads the tables of one scenario. `actuators` lists the actuators in the order in which features count them; if
    /// empty, they are sorted by name. `urgency` lists the actions, the most urgent first; others follow by name.
    ///
    /// # Errors
    /// A column is missing or of another type, a feature is NaN or infinite, or there is no fault.
    pub fn new(
        tables: &[(Purpose, Table)],
        features: Vec<DataFeature>,
        actuators: &[String],
        urgency: &[String],
    ) -> Result<Self, EvaluationError> {
        if features.is_empty() {
            return Err(EvaluationError::NoFeatures);
        }
        let sensors = known_sensors(tables);
        let rows = tables.iter().map(|table| labeled_rows(table, &sensors));
        let rows = rows.collect::<Result<Vec<_>, _>>()?;
        let all_rows = rows.concat();
        let has = |view: usize| tables.iter().all(|(_, table)| has_view(table, view, &features));
        let names = names(&all_rows, &features, actuators, urgency)?;
        let all_views = 0..names.actuators.len();
        let count = if all_views.clone().all(has) { all_views.end } else { 1 };
        let of_view = |view| values(tables.iter().zip(&rows), view, &features);
        let views = (0..count).map(of_view).collect::<Result<_, _>>()?;
        let all: usize = tables.iter().map(|(_, table)| table.row_count()).sum();
        let failed = all - all_rows.len();
        Ok(DataSet { failed, ..Self::of(&all_rows, (features, views), sensors, names)? })
    }

    /// Makes a data set of rows with the column-major values of their features in each view, and of the largest
    /// residuals of some sensors. `names` come from [`names`].
    ///
    /// # Errors
    /// The features have other numbers of values.
    pub(crate) fn of(
        labeled: &[LabeledRow],
        (features, views): (Vec<DataFeature>, Vec<Vec<f64>>),
        sensors: Vec<String>,
        names: Names,
    ) -> Result<Self, EvaluationError> {
        let is_faulty: Vec<bool> = labeled.iter().map(|row| row.kind != HEALTHY).collect();
        let constant = constant_features(&views[0], &features, &is_faulty);
        let read = own_columns(&features, &names);
        let labels = labels(labeled, &names);
        let examples = Examples::new(names, read, views, labels)?;
        let (cases, case) = in_order(labeled.iter().map(|row| row.case));
        let (_, command) = in_order(labeled.iter().map(|row| row.flown));
        let (faults, fault) = coded(labeled.iter().map(|row| row.fault).collect(), Ord::cmp);
        let (kinds, kind) = coded(labeled.iter().map(|row| row.kind).collect(), Ord::cmp);
        let (intensities, intensity) =
            coded(labeled.iter().map(|row| row.grade).collect(), f64::total_cmp);
        let row = |(place, own): (usize, &LabeledRow)| DataRow {
            purpose: own.purpose,
            variant: own.variant,
            case: case[place],
            flown: command[place],
            fault: fault[place],
            kind: kind[place],
            intensity: intensity[place],
            own_intensity: own.own_intensity,
            moved: 0,
            factor: 1.0,
            is_healthy: own.kind == HEALTHY,
            began_on_the_move: own.began_on_the_move,
            largest: own.largest.clone(),
            // The data set's own verdict, until bands are applied.
            excess: if own.is_detectable { f64::INFINITY } else { 0.0 },
        };
        let owned = |names: Vec<&str>| names.into_iter().map(str::to_owned).collect();
        Ok(DataSet {
            rows: labeled.iter().enumerate().map(row).collect(),
            features,
            examples: Arc::new(examples),
            sensors,
            cases: owned(cases),
            faults: owned(faults),
            kinds: owned(kinds),
            intensities,
            failed: 0,
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

/// The labels of those rows of a table that were simulated to the end, each with its row as the variant.
fn labeled_rows<'t>(
    (purpose, table): &'t (Purpose, Table),
    sensors: &[String],
) -> Result<Vec<LabeledRow<'t>>, TableError> {
    let texts = ["failure", "case", "flown", "fault", "kind", "actuator", "action", "detail"];
    let texts = texts.map(|name| table.text(name));
    let [failures, cases, commands, faults, kinds, actuators, actions, details] = texts;
    let (failures, cases, commands, faults) = (failures?, cases?, commands?, faults?);
    let (kinds, actuators, actions, details) = (kinds?, actuators?, actions?, details?);
    let (grades, intensities) = (table.finite_f64("grade")?, table.finite_f64("intensity")?);
    let (moving, detectable) = (table.bool("began_on_the_move").ok(), table.bool("detectable")?);
    let largest = sensors.iter().map(|sensor| table.finite_f64(&largest_column(sensor)));
    let largest = largest.collect::<Result<Vec<_>, _>>()?;
    let row = |row: usize| LabeledRow {
        purpose: *purpose,
        variant: row,
        case: &cases[row],
        flown: &commands[row],
        fault: &faults[row],
        kind: &kinds[row],
        actuator: &actuators[row],
        action: &actions[row],
        detail: &details[row],
        grade: grades[row],
        own_intensity: intensities[row],
        began_on_the_move: moving.is_some_and(|moving| moving[row]),
        is_detectable: detectable[row],
        largest: largest.iter().map(|column| column[row]).collect(),
    };
    Ok((0..table.row_count()).filter(|&own| failures[own].is_empty()).map(row).collect())
}

/// Numbers texts in the order of first occurrence.
pub(crate) fn in_order<T: PartialEq>(texts: impl IntoIterator<Item = T>) -> (Vec<T>, Vec<u32>) {
    let mut names: Vec<T> = vec![];
    // Equal texts mostly follow one another.
    let code = |text: T| match names.iter().rposition(|name| *name == text) {
        Some(place) => place as u32,
        None => {
            names.push(text);
            names.len() as u32 - 1
        }
    };
    let codes = texts.into_iter().map(code).collect();
    (names, codes)
}

/// Numbers values in ascending order.
pub(crate) fn coded<T: Clone + PartialEq>(
    values: Vec<T>,
    order: impl Fn(&T, &T) -> Ordering,
) -> (Vec<T>, Vec<u32>) {
    let mut names = values.clone();
    names.sort_by(&order);
    names.dedup();
    let place = |value: &T| names.binary_search_by(|known| order(known, value)).unwrap_or(0) as u32;
    let codes = values.iter().map(place).collect();
    (names, codes)
}

/// The names that the labels of rows refer to; for `actuators` and `urgency` see [`DataSet::new`].
///
/// # Errors
/// [`EvaluationError::NoFaults`].
pub(crate) fn names(
    rows: &[LabeledRow],
    features: &[DataFeature],
    actuators: &[String],
    urgency: &[String],
) -> Result<Names, EvaluationError> {
    if rows.iter().all(|row| row.kind == HEALTHY) {
        return Err(EvaluationError::NoFaults);
    }
    let of = |text: for<'r> fn(&'r LabeledRow) -> &'r str| -> Vec<String> {
        let mut names = coded(rows.iter().map(text).collect(), Ord::cmp).0;
        names.retain(|name| *name != HEALTHY);
        names.into_iter().map(str::to_owned).collect()
    };
    let mut actions = of(|row| row.action);
    let place = |name: &String| urgency.iter().position(|known| known == name);
    actions.sort_by_key(|name| (place(name).unwrap_or(urgency.len()), name.clone()));
    let found = of(|row| row.actuator);
    let all_known = found.iter().all(|name| actuators.contains(name));
    Ok(Names {
        features: features.iter().map(|feature| feature.feature.name.clone()).collect(),
        actuators: if all_known { actuators.to_vec() } else { found },
        actions,
        details: of(|row| row.detail),
    })
}

fn labels(rows: &[LabeledRow], names: &Names) -> Vec<Label> {
    let place = |known: &[String], text: &str| {
        known.iter().position(|name| name == text).unwrap_or(0) as u32
    };
    let label = |row: &LabeledRow| Label {
        actuator: match row.actuator == HEALTHY {
            true => names.healthy(),
            false => place(&names.actuators, row.actuator),
        },
        action: place(&names.actions, row.action),
        detail: place(&names.details, row.detail),
    };
    rows.iter().map(label).collect()
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

fn values<'t>(
    tables: impl Iterator<Item = (&'t (Purpose, Table), &'t Vec<LabeledRow<'t>>)> + Clone,
    view: usize,
    features: &[DataFeature],
) -> Result<Vec<f64>, TableError> {
    let mut values = vec![];
    for feature in features {
        for ((_, table), rows) in tables.clone() {
            let column = table.finite_f64(&view_column(view, &feature.feature.name))?;
            values.extend(rows.iter().map(|row| column[row.variant]));
        }
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
