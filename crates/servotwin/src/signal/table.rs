//! A recorded signal: a column of a CSV or Parquet file over its time column.
//!
//! The unit of a column is the suffix of its name (`_rad`, `_pa`, also `_deg`,
//! `_bar`, `_mm`); a name without one is taken as SI. Times are in seconds and
//! strictly increasing.

use super::error::SignalError;
use super::spec::{Fallback, Given, Kind, Parameter, Range, Sort, Spec};
use super::units::UNITS;
use crate::table;
use servotwin_model::signal::{CurveError, Piecewise};
use servotwin_model::spec::Unit;

/// A recorded signal.
pub struct Recorded;

/// The parameter that names the file.
pub(super) const FILE: &str = "file";

static SPEC: Spec = Spec {
    kind: "table",
    summary: "a column of a CSV or Parquet file over its time column",
    example: "table:file=log.csv,column=command_rad",
    continuous: true,
    parameters: &[
        Parameter {
            name: FILE,
            sort: Sort::Text,
            range: Range::Any,
            fallback: Fallback::Required,
            summary: "the file, .csv or .parquet, without a comma in its name",
        },
        Parameter {
            name: "column",
            sort: Sort::Text,
            range: Range::Any,
            fallback: Fallback::Required,
            summary: "the column of the values",
        },
        Parameter {
            name: "time",
            sort: Sort::Text,
            range: Range::Any,
            fallback: Fallback::Word("time_s"),
            summary: "the column of the times",
        },
        Parameter {
            name: "between",
            sort: Sort::Choice(&["line", "hold"]),
            range: Range::Any,
            fallback: Fallback::Word("line"),
            summary: "interpolation between the rows",
        },
    ],
};

/// The unit given by the suffix of a column's name, and its factor to SI.
fn unit_of(column: &str) -> Option<(Unit, f64)> {
    let si = Unit::ALL.iter().map(|unit| (unit.suffix().to_string(), *unit, 1.0));
    let others = UNITS.iter().filter(|unit| unit.symbol != "%");
    let others = others.map(|u| (format!("_{}", u.symbol.to_lowercase()), u.unit, u.si));
    let fitting = si
        .chain(others)
        .filter(|(suffix, ..)| !suffix.is_empty() && column.ends_with(suffix.as_str()));
    let longest = fitting.max_by_key(|(suffix, ..)| suffix.len());
    longest.map(|(_, unit, factor)| (unit, factor))
}

impl Kind for Recorded {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn build(&self, given: &Given) -> Result<Piecewise, SignalError> {
        let (file, column) = (given.word(FILE), given.word("column"));
        let (unit, factor) = unit_of(column).unwrap_or((given.unit, 1.0));
        if unit != given.unit {
            return Err(SignalError::ColumnUnit {
                column: column.into(),
                found: unit,
                wanted: given.unit,
            });
        }
        let is_wanted = |name: &str| name == column || name == given.word("time");
        let table = table::read_wanted(file, &[], &is_wanted);
        let table = table.map_err(|e| SignalError::Table(Box::new(e)))?;
        let numbers = |name| table.finite_f64(name).map_err(|e| SignalError::Table(Box::new(e)));
        let (times_s, values) = (numbers(given.word("time"))?, numbers(column)?);
        let values: Vec<f64> = values.iter().map(|value| value * factor).collect();
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
}
