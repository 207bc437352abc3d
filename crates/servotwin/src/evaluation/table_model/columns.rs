//! Selects which columns of a table become features, and explains why others do not.

use super::Selection;
use super::error::TableModelError;
use crate::campaign::columns::{is_data_set, is_feature_column};
use crate::evaluation::EvaluationError;
use crate::moment;
use crate::table::{Column, Table, Values};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// A text column with more distinct texts is not used as features.
pub const MOST_CATEGORIES: usize = 32;

/// With fewer rows, a column is never suspected of being an index.
const FEWEST_INDEX_ROWS: usize = 8;

/// A column with at most this many distinct values is checked for determining the class by itself.
const FEW_VALUES: usize = 64;

/// Why a column of a data set is not used.
const NO_FEATURE: &str =
    "is no feature of the data set: it holds what was simulated or how it was detected";

/// The source of a model's feature.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum FeatureSource {
    /// A column with numbers, or with booleans (true is 1, false is 0).
    Number {
        /// Name of the column.
        column: String,
    },
    /// A column with times as text, in seconds.
    Time {
        /// Name of the column.
        column: String,
    },
    /// One text of a text column: 1 in rows with this text, 0 in all others.
    Category {
        /// Name of the column.
        column: String,
        /// The text that this feature marks.
        value: String,
    },
}

impl FeatureSource {
    /// The column that it reads.
    pub fn column(&self) -> &str {
        match self {
            FeatureSource::Number { column }
            | FeatureSource::Time { column }
            | FeatureSource::Category { column, .. } => column,
        }
    }

    /// The name of the feature.
    pub fn name(&self) -> String {
        match self {
            FeatureSource::Number { column } | FeatureSource::Time { column } => column.clone(),
            FeatureSource::Category { column, value } => format!("{column} = {value}"),
        }
    }
}

/// An unused column, with the reason.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Unused {
    /// Name of the column.
    pub column: String,
    /// The reason, as part of a sentence.
    pub reason: String,
}

/// The result of [`choose`].
#[derive(Debug, Default)]
pub(super) struct Chosen {
    pub inputs: Vec<FeatureSource>,
    pub unused: Vec<Unused>,
    pub warnings: Vec<String>,
}

/// Chooses the features: the named columns, otherwise all informative columns.
pub(super) fn choose(
    table: &Table,
    selection: &Selection,
    labels: &[u32],
) -> Result<Chosen, EvaluationError> {
    let mut chosen = Chosen::default();
    for name in selection.features.iter().chain(&selection.categorical).chain(&selection.ignored) {
        table.column(name)?;
        if selection.reserved().contains(&name.as_str()) {
            return Err(TableModelError::UsedTwice { column: name.clone() }.into());
        }
    }
    if let Some(both) = selection.features.iter().find(|name| selection.ignored.contains(name)) {
        return Err(TableModelError::UsedTwice { column: both.clone() }.into());
    }
    let is_data_set = is_data_set(table);
    if selection.features.is_empty() {
        choose_all(table, selection, labels, &mut chosen)?;
    } else {
        for name in &selection.features {
            let column = table.column(name)?;
            let inputs = inputs_of(column, selection)?;
            chosen.inputs.extend(inputs.map_err(|reason| unfit(column, reason))?);
            if let Some(reason) = suspicion(column, labels) {
                chosen.warnings.push(format!("column '{name}' {reason}"));
            }
            if is_data_set && !is_feature_column(name) {
                chosen.warnings.push(format!("column '{name}' {NO_FEATURE}"));
            }
        }
    }
    match chosen.inputs.is_empty() {
        true => Err(EvaluationError::NoFeatures),
        false => Ok(chosen),
    }
}

fn unfit(column: &Column, different: usize) -> EvaluationError {
    let (column, largest) = (column.name.clone(), MOST_CATEGORIES);
    TableModelError::TooManyCategories { column, different, largest }.into()
}

fn choose_all(
    table: &Table,
    selection: &Selection,
    labels: &[u32],
    chosen: &mut Chosen,
) -> Result<(), EvaluationError> {
    let reserved = selection.reserved();
    let is_data_set = is_data_set(table);
    for column in table.columns().iter().filter(|c| !reserved.contains(&c.name.as_str())) {
        let mut leave = |reason: String| {
            chosen.unused.push(Unused { column: column.name.clone(), reason });
        };
        if selection.ignored.contains(&column.name) {
            leave("left out as asked".into());
        } else if is_data_set && !is_feature_column(&column.name) {
            leave(NO_FEATURE.into());
        } else if let Some(reason) = useless(column) {
            leave(reason.into());
        } else if let Some(reason) = suspicion(column, labels) {
            leave(format!("{reason}; name it with --features to use it"));
        } else {
            match inputs_of(column, selection)? {
                Ok(inputs) => {
                    chosen.inputs.extend(inputs);
                    chosen.warnings.extend(tells_the_class(column, labels));
                }
                Err(different) => {
                    let numbers = texts(column).iter().all(|text| is_number(text));
                    let hint = if numbers { " that are numbers in quotes" } else { "" };
                    leave(format!(
                        "holds {different} different texts{hint}, at most {MOST_CATEGORIES} become \
                         features"
                    ));
                }
            }
        }
    }
    Ok(())
}

fn is_number(text: &str) -> bool {
    text.trim().is_empty() || text.trim().replace(',', ".").parse::<f64>().is_ok()
}

/// The features of a column, or the number of its distinct texts if there are too many.
fn inputs_of(
    column: &Column,
    selection: &Selection,
) -> Result<Result<Vec<FeatureSource>, usize>, EvaluationError> {
    let name = || column.name.clone();
    let as_text = selection.categorical.contains(&column.name);
    match &column.values {
        Values::Text(texts) if !as_text && are_times(texts) => {
            return Ok(Ok(vec![FeatureSource::Time { column: name() }]));
        }
        Values::Text(_) => {}
        _ if !as_text => return Ok(Ok(vec![FeatureSource::Number { column: name() }])),
        _ => {}
    }
    let mut different: BTreeSet<String> = texts(column).into_iter().collect();
    if different.len() > MOST_CATEGORIES {
        return match as_text {
            true => Err(unfit(column, different.len())),
            false => Ok(Err(different.len())),
        };
    }
    if different.len() == 2 {
        // With two texts, the second carries the same information as the first.
        different.pop_first();
    }
    let input = |value| FeatureSource::Category { column: name(), value };
    Ok(Ok(different.into_iter().map(input).collect()))
}

fn are_times(texts: &[String]) -> bool {
    let mut given = texts.iter().filter(|text| !text.trim().is_empty()).peekable();
    given.peek().is_some() && given.all(|text| moment::seconds(text).is_some())
}

/// Why a column carries no information.
fn useless(column: &Column) -> Option<&'static str> {
    const EMPTY: &str = "has no value in any row";
    const CONSTANT: &str = "has the same value in every row";
    const TIMES: &str = "holds times, which say when a row was recorded and not what it is; \
                         name it with --features to use it";
    fn constant<T: PartialEq>(values: &[T]) -> Option<&'static str> {
        values.windows(2).all(|pair| pair[0] == pair[1]).then_some(CONSTANT)
    }
    match &column.values {
        Values::Float(values) if values.iter().all(|value| value.is_nan()) => Some(EMPTY),
        Values::Float(values) => constant(values),
        Values::Integer(values) => constant(values),
        Values::Unsigned(values) => constant(values),
        Values::Flag(values) => constant(values),
        Values::Text(values) if values.iter().all(|value| value.trim().is_empty()) => Some(EMPTY),
        Values::Text(values) if are_times(values) => Some(TIMES),
        Values::Text(values) => constant(values),
    }
}

/// Why a column should not be used although it could be.
fn suspicion(column: &Column, labels: &[u32]) -> Option<&'static str> {
    if let Some(numbers) = numbers(column) {
        if rises_evenly(&numbers) {
            return Some("counts the rows evenly, as an index or a time does");
        }
        if is_permutation(&numbers) {
            return Some("holds every row's own number once, as an index does");
        }
    }
    let classes: BTreeSet<u32> = labels.iter().copied().collect();
    let of_value = classes_of_values(column, labels, classes.len())?;
    let mut told: Vec<u32> = of_value.values().copied().collect::<Option<_>>()?;
    told.sort_unstable();
    told.dedup();
    let repeats = of_value.len() == classes.len() && told.len() == classes.len();
    repeats.then_some("repeats the label: one value for each class")
}

/// A warning if every value of a column occurs with only one class.
fn tells_the_class(column: &Column, labels: &[u32]) -> Option<String> {
    let of_value = classes_of_values(column, labels, FEW_VALUES)?;
    let sure = of_value.len() >= 2
        && labels.len() >= 10 * of_value.len()
        && of_value.values().all(Option::is_some);
    sure.then(|| {
        format!(
            "column '{}' determines the class by itself in every row: is it known before the class is?",
            column.name
        )
    })
}

/// For each value, its class; `None` inside if it occurs with several classes. `None` for more than `most` values.
fn classes_of_values(
    column: &Column,
    labels: &[u32],
    most: usize,
) -> Option<BTreeMap<String, Option<u32>>> {
    let mut seen: BTreeMap<String, Option<u32>> = BTreeMap::new();
    for (row, &label) in labels.iter().enumerate() {
        let value = text_at(&column.values, row);
        if let Some(class) = seen.get_mut(&value) {
            *class = class.filter(|class| *class == label);
        } else if seen.len() == most {
            return None;
        } else {
            seen.insert(value, Some(label));
        }
    }
    Some(seen)
}

fn numbers(column: &Column) -> Option<Vec<f64>> {
    match &column.values {
        Values::Float(values) => Some(values.clone()),
        Values::Integer(values) => Some(values.iter().map(|value| *value as f64).collect()),
        Values::Unsigned(values) => Some(values.iter().map(|value| f64::from(*value)).collect()),
        _ => None,
    }
}

fn rises_evenly(values: &[f64]) -> bool {
    let [first, second, ..] = values else { return false };
    let step = second - first;
    let even = |pair: &[f64]| (pair[1] - pair[0] - step).abs() <= 1e-6 * step.abs();
    values.len() >= FEWEST_INDEX_ROWS && step != 0.0 && values.windows(2).all(even)
}

fn is_permutation(values: &[f64]) -> bool {
    let whole = |value: &f64| value.fract() == 0.0 && value.abs() < 1e15;
    if values.len() < FEWEST_INDEX_ROWS || !values.iter().all(whole) {
        return false;
    }
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.windows(2).all(|pair| pair[1] - pair[0] == 1.0)
}

/// The values of a column as text.
pub(crate) fn texts(column: &Column) -> Vec<String> {
    (0..column.values.len()).map(|row| text_at(&column.values, row)).collect()
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

/// Extracts the features from tables with the same columns, one below the other: column-major values, NaN where
/// missing. A column is released after its last use, so that a large table is never in memory twice.
pub(super) fn encode(
    tables: &mut [Table],
    inputs: &[FeatureSource],
) -> Result<Vec<f64>, EvaluationError> {
    let rows: usize = tables.iter().map(Table::row_count).sum();
    let mut values = Vec::with_capacity(inputs.len() * rows);
    for (place, input) in inputs.iter().enumerate() {
        let again = inputs.get(place + 1).is_some_and(|next| next.column() == input.column());
        for (place, table) in tables.iter_mut().enumerate() {
            let encoded = match again {
                true => table
                    .column(input.column())
                    .map_err(EvaluationError::from)
                    .and_then(|column| encode_column(table, column, input, &mut values)),
                false => table
                    .release(input.column())
                    .map_err(EvaluationError::from)
                    .and_then(|column| encode_column(table, &column, input, &mut values)),
            };
            encoded.map_err(EvaluationError::of_table(place))?;
        }
    }
    Ok(values)
}

fn encode_column(
    table: &Table,
    column: &Column,
    input: &FeatureSource,
    values: &mut Vec<f64>,
) -> Result<(), EvaluationError> {
    let first = values.len();
    match (input, &column.values) {
        (FeatureSource::Category { value, .. }, Values::Text(texts)) => {
            values.extend(texts.iter().map(|text| f64::from(u8::from(text.trim() == value))));
        }
        (FeatureSource::Category { value, .. }, _) => {
            let is_value = |text: String| f64::from(u8::from(text == *value));
            values.extend(texts(column).into_iter().map(is_value));
        }
        (FeatureSource::Time { .. }, Values::Text(texts)) => {
            let time = |text: &String| moment::seconds(text).unwrap_or(f64::NAN);
            values.extend(texts.iter().map(time));
        }
        (_, Values::Flag(flags)) => {
            values.extend(flags.iter().map(|&flag| f64::from(u8::from(flag))));
        }
        _ => values.extend_from_slice(&column.numbers()?),
    }
    match values[first..].iter().position(|value| value.is_infinite()) {
        Some(row) => Err(table.not_finite(&column.name, row, values[first + row]).into()),
        None => Ok(()),
    }
}
