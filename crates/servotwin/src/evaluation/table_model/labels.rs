//! Reads the classes and groups of a table's rows.

use super::columns::texts;
use super::error::TableModelError;
use super::{ClassWeights, Selection};
use crate::evaluation::{EvaluationError, UnknownClass};
use crate::table::{Column, Table, Values};
use std::collections::BTreeSet;

/// More distinct numbers are considered measured, unless they are integers.
const MOST_NUMBERS: usize = 20;

/// More distinct integers are also considered measured.
const MOST_WHOLE_NUMBERS: usize = 100;

/// Texts or numbers, with a code for every row.
#[derive(Debug, Clone, PartialEq)]
pub struct Coded {
    /// The names, in the order of their codes: numbers ascending, texts alphabetically.
    pub names: Vec<String>,
    /// The code of every row.
    pub codes: Vec<u32>,
}

impl Coded {
    /// Codes the distinct texts.
    pub(super) fn of(texts: &[String]) -> Self {
        let different: BTreeSet<&String> = texts.iter().collect();
        let mut names: Vec<String> = different.into_iter().cloned().collect();
        let number = |name: &String| name.parse::<f64>().ok().filter(|number| number.is_finite());
        if let Some(numbers) = names.iter().map(number).collect::<Option<Vec<f64>>>() {
            let mut order: Vec<usize> = (0..names.len()).collect();
            order.sort_by(|&a, &b| numbers[a].total_cmp(&numbers[b]));
            names = order.into_iter().map(|place| names[place].clone()).collect();
        }
        let places: std::collections::BTreeMap<&String, u32> = names.iter().zip(0..).collect();
        let codes = texts.iter().map(|text| places[text]).collect();
        Coded { names, codes }
    }

    /// The number of rows of each code.
    pub fn counts(&self) -> Vec<usize> {
        let mut counts = vec![0; self.names.len()];
        self.codes.iter().for_each(|&code| counts[code as usize] += 1);
        counts
    }
}

/// The classes of all rows of tables with the same columns; training may only use those of the first table.
pub(super) fn classes(tables: &[Table], selection: &Selection) -> Result<Coded, EvaluationError> {
    let name = &selection.label;
    if !selection.label_limits.is_empty() {
        return limited(tables, name, &selection.label_limits);
    }
    for (place, table) in tables.iter().enumerate() {
        let column = table.column(name).map_err(EvaluationError::from);
        column.and_then(refuse_measured).map_err(EvaluationError::of_table(place))?;
    }
    let learnt = Coded::of(&filled(&tables[0], name, "class")?);
    let (different, rows) = (learnt.names.len(), learnt.codes.len());
    if different < 2 {
        let class = learnt.names.into_iter().next().unwrap_or_default();
        return Err(EvaluationError::OneClass { column: name.clone(), class });
    }
    if rows > MOST_NUMBERS && 2 * different > rows {
        let column = name.clone();
        return Err(TableModelError::NamesNotClasses { column, different, rows }.into());
    }
    let mut all = learnt;
    for table in &tables[1..] {
        let classes = filled(table, name, "class");
        let codes = classes.and_then(|classes| known(table, &classes, name, &all.names));
        all.codes.extend(codes.map_err(EvaluationError::of_table(1))?);
    }
    Ok(all)
}

/// The codes of classes among the known ones.
pub(super) fn known(
    table: &Table,
    classes: &[String],
    column: &str,
    names: &[String],
) -> Result<Vec<u32>, EvaluationError> {
    let place = |(row, class): (usize, &String)| {
        let found = names.iter().position(|known| known == class);
        let unknown = || UnknownClass {
            column: column.into(),
            class: class.clone(),
            place: table.origin().place(row),
            known: names.to_vec(),
        };
        let code = found.map(|place| place as u32);
        code.ok_or_else(|| EvaluationError::UnknownClass(Box::new(unknown())))
    };
    classes.iter().enumerate().map(place).collect()
}

/// Rejects a label column with too many distinct numbers to be classes.
fn refuse_measured(column: &Column) -> Result<(), EvaluationError> {
    let numbers = match &column.values {
        Values::Text(_) | Values::Flag(_) => return Ok(()),
        _ => column.numbers()?,
    };
    let mut sorted: Vec<f64> = numbers.iter().copied().filter(|value| !value.is_nan()).collect();
    sorted.sort_by(f64::total_cmp);
    let third = |part: usize| sorted.get(part * sorted.len() / 3).copied().unwrap_or(0.0);
    let limits = (third(1), third(2));
    let whole = sorted.iter().all(|value| value.fract() == 0.0);
    sorted.dedup();
    let different = sorted.len();
    let measured = different > if whole { MOST_WHOLE_NUMBERS } else { MOST_NUMBERS };
    match measured {
        true => {
            let column = column.name.clone();
            Err(TableModelError::NumericLabel { column, different, limits }.into())
        }
        false => Ok(()),
    }
}

/// The names of the classes between the limits.
pub(super) fn limit_names(limits: &[f64]) -> Vec<String> {
    let first = limits.first().map(|limit| format!("up to {limit}"));
    let between = limits.windows(2).map(|pair| format!("{} to {}", pair[0], pair[1]));
    let last = limits.last().map(|limit| format!("above {limit}"));
    first.into_iter().chain(between).chain(last).collect()
}

/// Divides numbers into classes: up to the first limit, up to the second …
pub(super) fn limited(
    tables: &[Table],
    name: &str,
    limits: &[f64],
) -> Result<Coded, EvaluationError> {
    let mut codes = vec![];
    for table in tables {
        let column = table.column(name)?;
        filled(table, name, "class")?;
        let below = |value: &f64| limits.iter().filter(|limit| value > *limit).count() as u32;
        codes.extend(column.numbers()?.iter().map(below));
    }
    let ascending = limits.windows(2).all(|pair| pair[0] < pair[1]);
    let one = codes.iter().all(|code| *code == codes[0]);
    match ascending && !one && limits.iter().all(|limit| limit.is_finite()) {
        true => Ok(Coded { names: limit_names(limits), codes }),
        false => Err(TableModelError::Limits { column: name.into() }.into()),
    }
}

/// The texts of a column that must have a value in every row.
pub(super) fn filled(
    table: &Table,
    name: &str,
    what: &'static str,
) -> Result<Vec<String>, EvaluationError> {
    let texts = texts(table.column(name)?);
    match texts.iter().position(String::is_empty) {
        Some(row) => {
            let rows = texts.iter().filter(|text| text.is_empty()).count();
            let (column, place) = (name.into(), table.origin().place_in_file(row));
            Err(TableModelError::Empty { what, column, place, rows }.into())
        }
        None => Ok(texts),
    }
}

/// The weight of each class in training.
pub(super) fn weights(
    class_weights: &ClassWeights,
    names: &[String],
    codes: impl Iterator<Item = u32>,
) -> Result<Vec<f64>, TableModelError> {
    let mut weights = vec![1.0; names.len()];
    match class_weights {
        ClassWeights::Equal => {}
        ClassWeights::Balanced => {
            let mut counts = vec![0u32; names.len()];
            codes.for_each(|code| counts[code as usize] += 1);
            let present = counts.iter().filter(|count| **count > 0).count() as f64;
            let rows = f64::from(counts.iter().sum::<u32>());
            for (weight, &count) in weights.iter_mut().zip(&counts).filter(|(_, n)| **n > 0) {
                *weight = rows / (present * f64::from(count));
            }
        }
        ClassWeights::Given(given) => {
            for (class, weight) in given {
                let (class, weight) = (class.clone(), *weight);
                let Some(place) = names.iter().position(|name| *name == class) else {
                    return Err(TableModelError::UnknownWeight { class, known: names.to_vec() });
                };
                if !(weight > 0.0 && weight < 1e9) {
                    return Err(TableModelError::Weight { class, weight });
                }
                weights[place] = weight;
            }
        }
    }
    Ok(weights)
}

/// Warnings about classes and groups that make a result look better than it is.
pub(super) fn warnings(classes: &Coded, groups: &Coded, column: &str) -> Vec<String> {
    let mut groups_of_class = vec![BTreeSet::new(); classes.names.len()];
    let mut classes_of_group = vec![BTreeSet::new(); groups.names.len()];
    for (&class, &group) in classes.codes.iter().zip(&groups.codes) {
        groups_of_class[class as usize].insert(group);
        classes_of_group[group as usize].insert(class);
    }
    let mut warnings = vec![];
    let lonely = classes.names.iter().zip(&groups_of_class).filter(|(_, of)| of.len() == 1);
    let lonely: Vec<&str> = lonely.map(|(name, _)| name.as_str()).collect();
    if !lonely.is_empty() {
        warnings.push(format!(
            "{} in one {column} only ({}): it cannot be learnt from some and tested with others",
            if lonely.len() == 1 { "a class occurs" } else { "classes occur" },
            lonely.join(", ")
        ));
    }
    if classes_of_group.iter().all(|of| of.len() == 1) {
        let fewest = groups_of_class.iter().map(BTreeSet::len).filter(|n| *n > 0).min();
        warnings.push(format!(
            "every {column} has one class only, so it explains the label: whatever separates the {column} also \
             separates the classes, and a class is known from no more than {} of them",
            fewest.unwrap_or(0)
        ));
    }
    warnings
}
