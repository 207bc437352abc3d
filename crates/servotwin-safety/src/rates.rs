//! The user's table of failure rates. No rate is ever invented: every one names its source.
//!
//! | column | content |
//! |---|---|
//! | `fault` | the full name of a fault, or its kind without the actuator for all actuators |
//! | `rate` | a number of 0 or more |
//! | `unit` | `1/h`, `1/(1e6 h)` or `FIT` (failures in 1e9 h) |
//! | `source` | where the rate comes from |

use crate::error::{SafetyError, unknown};
use servotwin::study::{FaultCase, Study};
use servotwin::table::csv::texts::{self, TextRow, Texts};
use servotwin::table::{Column, Table};
use servotwin::text::rounded;
use std::path::{Path, PathBuf};

/// The columns of the table.
const COLUMNS: [&str; 4] = ["fault", "rate", "unit", "source"];

/// The units of rates, with the hours that they count failures in. Whole hours divide without an error.
const UNITS: [(&str, f64); 3] = [("1/h", 1.0), ("1/(1e6 h)", 1e6), ("FIT", 1e9)];

/// The largest rate that is believed, 1/h: above it a component would fail in every flight.
const MAX_PER_H: f64 = 1.0;

/// A failure rate with its source.
#[derive(Debug, Clone, PartialEq)]
pub struct FailureRate {
    /// The full name of a fault, or its kind.
    pub fault: String,
    /// The rate, 1/h.
    pub per_h: f64,
    /// Where it comes from, in the user's words.
    pub source: String,
    /// The line of the table.
    pub line: usize,
}

/// The user's failure rates.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FailureRates {
    /// The table's file.
    pub path: PathBuf,
    /// One entry for each row.
    pub list: Vec<FailureRate>,
}

/// The faults of a study, which fault trees and the rate of the function need rates for. A fault stands in the study's
/// list once for each intensity, and here once.
pub fn rated_faults(study: &Study) -> impl Iterator<Item = &FaultCase> {
    study.faults.chunk_by(|fault, next| fault.id == next.id).map(|same| &same[0])
}

impl FailureRates {
    /// Reads a table of rates for the faults of a system.
    ///
    /// # Errors
    /// The file cannot be read; a column is missing; a cell is not allowed.
    pub(crate) fn read(path: &Path, study: &Study) -> Result<Self, SafetyError> {
        let faults = study.system.all_faults().into_iter();
        let mut known: Vec<String> =
            faults.flat_map(|id| [study.kind_of(&id).to_owned(), id]).collect();
        let table = texts::read(path)?;
        let places = find_columns(path, &table, COLUMNS)?;
        known.sort();
        known.dedup();
        let mut rates = FailureRates { path: path.into(), list: vec![] };
        for row in &table.rows {
            let rate = rates.row(row, places, &known)?;
            rates.list.push(rate);
        }
        Ok(rates)
    }

    fn row(
        &self,
        row: &TextRow,
        places: [usize; 4],
        known: &[String],
    ) -> Result<FailureRate, SafetyError> {
        let wrong = |column: usize, problem: String| SafetyError::Cell {
            path: self.path.clone(),
            line: row.line,
            column: COLUMNS[column],
            problem,
        };
        let [fault, rate, unit, source] = places.map(|place| row.cells[place].trim());
        if !known.iter().any(|name| name == fault) {
            return Err(wrong(0, unknown("fault", fault, known)));
        }
        if let Some(first) = self.list.iter().find(|first| first.fault == fault) {
            return Err(wrong(0, format!("'{fault}' has a rate in line {} already", first.line)));
        }
        let units = UNITS.map(|(name, _)| name).join(", ");
        let (_, hours) = UNITS.into_iter().find(|(name, _)| *name == unit).ok_or_else(|| {
            wrong(2, format!("'{unit}' is no unit of a failure rate; allowed are {units}"))
        })?;
        let range = || format!("allowed is 0 … {} {unit}", MAX_PER_H * hours);
        let no_number = |_| wrong(1, format!("'{rate}' is no number; {}{}", remedy(rate), range()));
        let value: f64 = rate.parse().map_err(no_number)?;
        let value = value / hours;
        if !(0.0..=MAX_PER_H).contains(&value) {
            return Err(wrong(1, format!("{rate} is out of range: {}", range())));
        }
        if source.is_empty() {
            return Err(wrong(
                3,
                "a rate needs its source: a handbook, field data, or who estimated it".into(),
            ));
        }
        Ok(FailureRate { fault: fault.into(), per_h: value, source: source.into(), line: row.line })
    }

    /// The rate of a fault. One for its full name takes precedence over one for its kind.
    pub(crate) fn of(&self, id: &str, kind: &str) -> Option<&FailureRate> {
        let find = |name: &str| self.list.iter().find(|rate| rate.fault == name);
        find(id).or_else(|| find(kind))
    }

    /// The rated faults of a study.
    pub(crate) fn of_study<'r>(
        &'r self,
        study: &'r Study,
    ) -> impl Iterator<Item = (&'r FaultCase, &'r FailureRate)> {
        rated_faults(study).filter_map(|fault| Some((fault, self.of(&fault.id, &fault.kind)?)))
    }

    /// Where a rate stands.
    pub(crate) fn place(&self, rate: &FailureRate) -> String {
        format!("{} line {}", self.path.display(), rate.line)
    }

    /// Refuses rates that lack a fault of a study.
    pub(crate) fn check(&self, study: &Study) -> Result<(), SafetyError> {
        let missing = rated_faults(study).filter(|fault| self.of(&fault.id, &fault.kind).is_none());
        let missing: Vec<String> = missing.map(|fault| fault.id.clone()).collect();
        match missing.is_empty() {
            true => Ok(()),
            false => Err(SafetyError::NoRates { path: self.path.clone(), missing }),
        }
    }
}

/// How to write a number with a decimal comma or in per cent, followed by "; "; empty for other texts.
fn remedy(text: &str) -> String {
    let with_point = text.replacen(',', ".", 1);
    let number = with_point.trim_end_matches('%').trim();
    match number.parse::<f64>() {
        Ok(value) if with_point.ends_with('%') => {
            format!("a rate is no share: write {:?} for {number} %; ", rounded(0.01 * value, 3))
        }
        Ok(_) => format!("write {number}, with a decimal point; "),
        Err(_) => String::new(),
    }
}

/// The indices of a table's columns.
pub(crate) fn find_columns<const N: usize>(
    path: &Path,
    table: &Texts,
    names: [&'static str; N],
) -> Result<[usize; N], SafetyError> {
    let mut places = [0; N];
    for (place, name) in places.iter_mut().zip(names) {
        *place = table.column(name).ok_or_else(|| SafetyError::NoColumn {
            path: path.into(),
            column: name.into(),
            needed: names.map(str::to_owned).to_vec(),
        })?;
    }
    Ok(places)
}

/// Writes a table of rates to be filled in: every kind of fault once, without a rate.
///
/// # Errors
/// The file cannot be written.
pub fn write_template(path: &Path, study: &Study) -> Result<(), SafetyError> {
    let mut kinds: Vec<String> = vec![];
    for fault in rated_faults(study) {
        if !kinds.contains(&fault.kind) {
            kinds.push(fault.kind.clone());
        }
    }
    let column = |name: &str, text: &str| Column::new(name, "", vec![text.to_owned(); kinds.len()]);
    let empty = [column(COLUMNS[1], ""), column(COLUMNS[2], UNITS[0].0), column(COLUMNS[3], "")];
    let mut columns = vec![Column::new(COLUMNS[0], "", kinds.clone())];
    columns.extend(empty);
    Ok(Table::from_columns(columns)?.write(path)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(rows: &str) -> Result<FailureRates, SafetyError> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), format!("fault,rate,unit,source\n{rows}")).unwrap();
        FailureRates::read(file.path(), &Study::default())
    }

    #[test]
    fn a_rate_of_an_actuator_beats_that_of_its_kind() {
        let rates = read(
            "cylinder.internal_leakage,200,FIT,handbook\nactuator_2.cylinder.internal_leakage,0.5,1/(1e6 h),fleet\n",
        )
        .unwrap();
        let kind = "cylinder.internal_leakage";
        let of = |actuator: &str| rates.of(&format!("{actuator}.{kind}"), kind).unwrap();
        let per_h = ["actuator_1", "actuator_2"].map(|actuator| of(actuator).per_h);
        assert!((per_h[0] - 2e-7).abs() < 1e-20 && (per_h[1] - 5e-7).abs() < 1e-20, "{per_h:?}");
        assert_eq!(of("actuator_2").source, "fleet");
    }

    #[test]
    fn a_wrong_cell_is_named_with_its_place_and_what_is_allowed() {
        let good = "cylinder.internal_leakage,1e-7,1/h,handbook\n";
        let cases = [
            (
                "cylinder.internal_leak,1,FIT,x\n",
                "column 'fault': there is no fault 'cylinder.internal_leak'; did you mean 'cylinder.internal_leakage'?",
            ),
            (
                "cylinder.internal_leakage,-1,FIT,x\n",
                "line 2, column 'rate': -1 is out of range: allowed is 0 … 1000000000 FIT",
            ),
            ("cylinder.internal_leakage,2,1/h,x\n", "2 is out of range: allowed is 0 … 1 1/h"),
            ("cylinder.internal_leakage,NaN,1/h,x\n", "out of range"),
            ("cylinder.internal_leakage,often,1/h,x\n", "'often' is no number; allowed"),
            (
                "cylinder.internal_leakage,\"1,5e-7\",1/h,x\n",
                "'1,5e-7' is no number; write 1.5e-7, with a decimal point; allowed is 0 … 1 1/h",
            ),
            (
                "cylinder.internal_leakage,0.1 %,1/h,x\n",
                "'0.1 %' is no number; a rate is no share: write 0.001 for 0.1 %; allowed",
            ),
            (
                "cylinder.internal_leakage,1,1/a,x\n",
                "column 'unit': '1/a' is no unit of a failure rate; allowed are 1/h, 1/(1e6 h), FIT",
            ),
            ("cylinder.internal_leakage,1e-7,1/h,\n", "column 'source': a rate needs its source"),
            (
                &format!("{good}{good}"),
                "line 3, column 'fault': 'cylinder.internal_leakage' has a rate in line 2 already",
            ),
        ];
        for (rows, message) in cases {
            let error = read(rows).unwrap_err().to_string();
            assert!(error.contains(message), "{rows}: {error}");
        }
    }

    #[test]
    fn a_template_is_a_table_of_rates_without_rates() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rates.csv");
        write_template(&path, &Study::default()).unwrap();
        let error = FailureRates::read(&path, &Study::default()).unwrap_err().to_string();
        assert!(error.contains("line 2, column 'rate': '' is no number"), "{error}");
    }
}
