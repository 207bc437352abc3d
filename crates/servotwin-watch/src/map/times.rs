//! Columns of times, and whether all columns of a map have the same.

use super::words::{LONGEST, key, splits, words};
use crate::source::frame::base;
use crate::source::{DATE, LogColumn, is_time_name};
use servotwin_io::sanitize;
use servotwin_model::spec::Unit;

/// Times that differ by less than this many steps are the same.
const SAME_STEPS: f64 = 0.5;
/// Times with a constant difference below this many steps are those of two clocks; a longer one is another zero.
const OWN_ZERO_STEPS: f64 = 10_000.0;

/// The columns whose name is that of a time, apart from its unit.
pub(super) fn time_columns(columns: &[LogColumn]) -> Vec<usize> {
    let is_time = |place: &usize| {
        let column = &columns[*place];
        let is_name = |(stem, unit): (&str, Option<(Unit, &str)>)| {
            is_time_name(&key(stem)) && unit.is_none_or(|(unit, _)| unit == Unit::Second)
        };
        column.name.len() <= LONGEST && splits(base(&column.name)).into_iter().any(is_name)
    };
    (0..columns.len()).filter(is_time).collect()
}

/// Why the columns in use cannot be rows with one time: one of them stands behind a second time that has its own
/// raster. `None` if all belong to the column `time`.
pub(crate) fn other_raster(
    columns: &[LogColumn],
    time: usize,
    is_used: &dyn Fn(usize) -> bool,
) -> Option<String> {
    let is_other = |place: &usize| {
        let column = &columns[*place];
        *place != time && speaks_of_time(column) && !is_same_raster(&columns[time], column)
    };
    let others: Vec<usize> = (0..columns.len()).filter(is_other).collect();
    let mut used = (0..columns.len()).filter(|&column| column != time && is_used(column));
    let before = |column: usize| others.iter().chain([&time]).filter(|t| **t < column).max();
    let (column, other) =
        used.find_map(|column| Some((column, *before(column).filter(|other| **other != time)?)))?;
    let name = |place: usize| sanitize::text(&columns[place].name);
    Some(format!(
        "'{}' and '{}' are times with rasters of their own, and '{}' behind the second would be read at the times of \
         the first: write a log for each time, or a map with the columns of one time",
        name(time),
        name(other),
        name(column)
    ))
}

/// Whether a column grows and its name has a word for a time.
fn speaks_of_time(column: &LogColumn) -> bool {
    if column.name.len() > LONGEST || column.step().is_none() {
        return false;
    }
    let ways = splits(without_copy(base(&column.name)));
    let is_other = ways.iter().any(|(_, unit)| unit.is_some_and(|(unit, _)| unit != Unit::Second));
    let (stem, _) = ways[0];
    let (words, _) = words(stem);
    let is_letter = words.len() == 1 && words[0] == "t";
    let is_word = |word: &String| word.len() > 1 && is_time_name(word);
    column.unit == DATE || (!is_other && (is_letter || words.iter().any(is_word)))
}

/// A name without the number that pandas writes behind the second of a name: `time_s.1`.
fn without_copy(name: &str) -> &str {
    let copy = name.rsplit_once('.').filter(|(_, number)| number.parse::<u32>().is_ok());
    copy.map_or(name, |(name, _)| name)
}

/// Whether two columns give the same times, in whatever unit and from whatever zero.
fn is_same_raster(one: &LogColumn, other: &LogColumn) -> bool {
    const UNITS_S: [f64; 7] = [1e-9, 1e-6, 1e-3, 1.0, 60.0, 3600.0, 86_400.0];
    let (Some(step), Some(other_step)) = (one.step(), other.step()) else { return true };
    let is_ratio = |a: f64| UNITS_S.iter().any(|b| (other_step / step * a / b - 1.0).abs() < 0.01);
    let apart = |(a, b): (&f64, &f64)| (b - other.head[0]) / other_step - (a - one.head[0]) / step;
    let drift =
        one.head.iter().zip(&other.head).map(apart).fold(0.0, |most: f64, d| most.max(d.abs()));
    let first = (other.head[0] / other_step - one.head[0] / step).abs();
    let is_own_zero =
        !(0.1..=OWN_ZERO_STEPS).contains(&first) || (other_step / step - 1.0).abs() > 0.01;
    UNITS_S.into_iter().any(is_ratio) && drift < SAME_STEPS && is_own_zero
}
