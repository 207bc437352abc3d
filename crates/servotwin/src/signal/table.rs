//! A recorded signal: a column of a CSV or Parquet file over its time column.
//!
//! The unit of a column is the suffix of its name (`_rad`, `_pa`, also `_deg`, `_bar`, `_mm`); without a suffix, values
//! are in SI. Times are in seconds and strictly increasing.

use super::error::SignalError;
use super::spec::{Fallback::*, Given, Kind, Sort::*, words};
use crate::table;
use crate::units::{self, NamedUnit};
use servotwin_model::signal::{CurveError, Piecewise};
use servotwin_model::spec::Unit;

/// The parameter that names the file.
pub(super) const FILE: &str = "file";

pub(super) static TABLE: Kind = Kind {
    name: "table",
    summary: "a column of a CSV or Parquet file over its time column",
    example: "table:file=log.csv,column=command_rad",
    parameters: &[
        words(FILE, Text, Required, "the file, .csv or .parquet, without a comma in its name"),
        words("column", Text, Required, "the column of the values"),
        words("time", Text, Word("time_s"), "the column of the times"),
        words("between", Choice(&["line", "hold"]), Word("line"), "interpolation between the rows"),
    ],
    build,
};

/// Suffixes that also end names without a unit: `p_c`, `flow_in`, `x_min`.
const LETTERS: [&str; 5] = ["c", "g", "l", "in", "min"];

/// The unit in the suffix of a column's name.
fn unit_of(column: &str, wanted: Unit) -> Option<&'static NamedUnit> {
    let length = |row: &NamedUnit| {
        let symbol = if row.is_si() { "" } else { row.symbol };
        let ends = [row.suffix(), symbol.to_lowercase()];
        let is_meant = row.to(wanted).is_some() || !LETTERS.contains(&ends[0].as_str());
        let fits = |end: &&String| {
            is_meant && column.strip_suffix(end.as_str()).is_some_and(|stem| stem.ends_with('_'))
        };
        ends.iter().filter(|end| !end.is_empty()).filter(fits).map(String::len).max()
    };
    units::TABLE.iter().max_by_key(|row| length(row)).filter(|row| length(row).is_some())
}

fn build(given: &Given) -> Result<Piecewise, SignalError> {
    let (file, column) = (given.word(FILE), given.word("column"));
    let wrong_unit = |row: &NamedUnit| {
        let (found, wanted) = (row.unit.symbol(), given.unit.symbol());
        let wanted = if wanted.is_empty() { "no unit" } else { wanted };
        let message = format!("column '{column}' is in {found}, the input is in {wanted}");
        SignalError::Invalid(message)
    };
    let factors = unit_of(column, given.unit)
        .map_or(Ok((1.0, 0.0)), |row| row.to(given.unit).ok_or_else(|| wrong_unit(row)));
    let (factor, offset) = factors?;
    let is_wanted = |name: &str| name == column || name == given.word("time");
    let table = table::read_wanted(file, &is_wanted);
    let table = table.map_err(|e| SignalError::Table(Box::new(e)))?;
    let numbers = |name| table.finite_f64(name).map_err(|e| SignalError::Table(Box::new(e)));
    let (times_s, values) = (numbers(given.word("time"))?, numbers(column)?);
    let values: Vec<f64> = values.iter().map(|value| value * factor + offset).collect();
    let curve = match given.word("between") {
        "hold" => Piecewise::steps(&times_s, &values),
        _ => Piecewise::linear(&times_s, &values),
    };
    curve.map_err(|error| SignalError::Rows {
        place: match error {
            CurveError::Order { index, .. } => table.origin().place_in_file(index),
            _ => file.into(),
        },
        error,
    })
}
