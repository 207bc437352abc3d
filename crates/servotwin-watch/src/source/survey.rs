//! The contents of a log before it is mapped: its columns, their units if given, and their first numbers.
//!
//! The beginning of a log may not show everything, so objects and channels are scanned to the end.

use super::frame::named;
use super::object::{Leaf, walk, without_special_numbers};
use super::{DATE, Wanted};
use servotwin::units;
use servotwin_io::moment;
use servotwin_io::table::csv::growing::{Numbers, is_missing};
use std::collections::BTreeMap;

/// The most numbers of a column that are kept.
pub(super) const HEAD: usize = 256;

/// The most names of object keys that are kept; further ones are ignored.
const MOST_COLUMNS: usize = 50_000;

/// Names of a time column, reduced to lowercase letters and digits.
const TIMES: &str = "time t ts timestamp timestamps stamp logtime datetime date utc epoch elapsed elapsedtime zeit \
                     zeitstempel datum uhrzeit messzeit";

/// Whether a name without unit, reduced to lowercase letters and digits, is that of a time.
pub(crate) fn is_time_name(key: &str) -> bool {
    TIMES.split(' ').any(|name| name == key)
}

/// Whether a column's name begins with that of a time, whatever unit follows.
pub(super) fn may_be_time(name: &str) -> bool {
    let mut parts = name.split(|c: char| !c.is_alphanumeric()).filter(|part| !part.is_empty());
    parts.next().is_some_and(|part| is_time_name(&part.to_lowercase()))
}

/// A column as found in the log.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LogColumn {
    /// The column's name in the log.
    pub name: String,
    /// The unit from a row of units or the schema; `date` for dates as text; empty if unknown.
    pub unit: String,
    /// Its first numbers, unconverted; dates as seconds since 1970.
    pub head: Vec<f64>,
}

impl LogColumn {
    /// A column whose unit and values are unknown.
    pub fn named(name: impl Into<String>) -> Self {
        LogColumn { name: name.into(), ..LogColumn::default() }
    }

    /// The typical difference between its numbers; `None` where they do not grow.
    pub(crate) fn step(&self) -> Option<f64> {
        let steps = self.head.windows(2).map(|pair| pair[1] - pair[0]);
        let mut steps: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
        steps.sort_by(f64::total_cmp);
        let grows = 2 * steps.len() + 1 >= self.head.len();
        grows.then(|| steps.get(steps.len() / 2).copied()).flatten()
    }

    /// Whether its numbers are whole and grow by one from row to row.
    pub(crate) fn counts_rows(&self) -> bool {
        self.head.len() > 2
            && self.head[0].fract() == 0.0
            && self.head.windows(2).all(|pair| pair[1] - pair[0] == 1.0)
    }

    fn push(&mut self, value: f64) {
        if self.head.len() < HEAD && value.is_finite() {
            self.head.push(value);
        }
    }

    /// Adds the text of a cell; `number` is its value as a number.
    pub(super) fn take(&mut self, text: &str, number: Option<f64>) {
        match number {
            Some(number) => self.push(number),
            None if self.head.len() < HEAD => {
                // A date that is refused is a date, too: its reason comes with the rows.
                if moment::refusal(text).is_some() {
                    self.unit = DATE.into();
                }
                if let Some(seconds) = moment::seconds(text) {
                    self.unit = DATE.into();
                    self.push(seconds);
                }
            }
            None => {}
        }
    }
}

/// The columns of cells below a header.
pub(super) struct Sheet {
    columns: Vec<LogColumn>,
    /// The number of columns without those at the end that have no name.
    named: usize,
    numbers: Numbers,
    rows: usize,
}

impl Sheet {
    pub(super) fn new(names: Vec<String>, separator: u8) -> Self {
        let named = named(&names);
        let columns = names.into_iter().map(LogColumn::named).collect();
        Sheet { columns, named, numbers: Numbers::new(separator == b','), rows: 0 }
    }

    /// Adds a line below the header: values, units, or neither; reports whether it is a row of values.
    pub(super) fn add(&mut self, cells: &[String]) -> bool {
        if !self.fits(cells) {
            return false;
        }
        let values: Vec<Option<f64>> = cells.iter().map(|cell| self.numbers.real(cell)).collect();
        let is_row = is_row(cells, &values);
        if is_row {
            self.rows += 1;
            for (column, (cell, value)) in self.columns.iter_mut().zip(cells.iter().zip(values)) {
                column.take(cell, value);
            }
        } else if self.rows == 0 && is_units(cells) {
            for (column, cell) in self.columns.iter_mut().zip(cells) {
                column.unit = bare_unit(cell).into();
            }
        }
        is_row
    }

    /// Whether a line has as many cells as the header, apart from empty ones at the end of either.
    fn fits(&self, cells: &[String]) -> bool {
        let all = self.columns.len();
        (self.named..=all.max(named(cells))).contains(&cells.len()) && named(cells) <= all
    }

    /// The columns that have a name.
    pub(super) fn finish(mut self) -> Vec<LogColumn> {
        self.columns.retain(|column| !column.name.is_empty());
        self.columns
    }
}

/// Whether at least half of the filled cells of a line are numbers or dates.
fn is_row(cells: &[String], values: &[Option<f64>]) -> bool {
    let is_value =
        |(cell, value): (&String, &Option<f64>)| value.is_some() || moment::seconds(cell).is_some();
    let filled = cells.iter().filter(|cell| !is_missing(cell.as_bytes())).count();
    let found = cells.iter().zip(values).filter(|pair| is_value(*pair)).count();
    found > 0 && 2 * found >= filled
}

/// Whether most non-empty cells of a line are units.
pub(super) fn is_units(cells: &[String]) -> bool {
    let filled = cells.iter().map(|cell| bare_unit(cell)).filter(|unit| !unit.is_empty());
    let is_known = |unit: &&str| matches!(*unit, "-" | "1") || units::find(unit).is_some();
    let (known, all) =
        filled.fold((0, 0), |(known, all), unit| (known + usize::from(is_known(&unit)), all + 1));
    known > 0 && 2 * known > all
}

/// A unit without enclosing brackets.
fn bare_unit(cell: &str) -> &str {
    cell.trim().trim_start_matches(['[', '(']).trim_end_matches([']', ')']).trim()
}

/// The columns of objects, in order of appearance.
#[derive(Default)]
pub(super) struct Objects {
    columns: Vec<LogColumn>,
    places: BTreeMap<String, usize>,
}

impl Objects {
    /// Adds an object. Anything else is ignored.
    pub(super) fn add(&mut self, text: &[u8]) {
        if walk(text, &mut |path, leaf| self.take(path, &leaf)).is_err()
            && let Some(plain) = without_special_numbers(text)
        {
            // Columns read before a mistake are kept.
            let _ = walk(&plain, &mut |path, leaf| self.take(path, &leaf));
        }
    }

    fn take(&mut self, path: &str, leaf: &Leaf) {
        let Some(column) = self.column(path) else { return };
        match *leaf {
            Leaf::Number(value) => column.push(value),
            Leaf::Text(text) => column.take(text, text.parse().ok()),
            Leaf::Flag(_) | Leaf::Missing => {}
        }
    }

    /// Whether all wanted names have been seen.
    pub(super) fn has_all(&self, wanted: &Wanted) -> bool {
        wanted.names.iter().all(|name| self.places.contains_key(name))
    }

    pub(super) fn finish(self) -> Vec<LogColumn> {
        self.columns
    }

    fn column(&mut self, path: &str) -> Option<&mut LogColumn> {
        let place = match self.places.get(path) {
            Some(&place) => place,
            None if self.columns.len() == MOST_COLUMNS => return None,
            None => {
                self.columns.push(LogColumn::named(path));
                self.places.insert(path.to_owned(), self.columns.len() - 1);
                self.columns.len() - 1
            }
        };
        self.columns.get_mut(place)
    }
}
