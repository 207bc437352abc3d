//! What a search found, beside random flights, and what it did not search.

use super::envelope::{self, EnvelopeCell, is_flown};
use super::log::{Method, SearchLog, SearchRow};
use crate::error::SafetyError;
use crate::results::StudyResultsFolder;
use serde::Serialize;
use servotwin::figure::lines::{Curve, Lines};
use servotwin::files::write_atomically;
use servotwin::flight::worst_case::space::SearchSpace;
use servotwin::flight::worst_case::{INTENSITY, SearchObjective};
use servotwin::shown::shown;
use servotwin::study::Study;
use servotwin::table::{self, Column, Table};
use std::path::PathBuf;

/// The most findings of an objective that are listed; the file has all.
const MAX_FINDINGS: usize = 5;

/// The flights of a method.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MethodSummary {
    /// Number of flights.
    pub runs: usize,
    /// Those that could not be simulated to the end.
    pub failed: usize,
    /// Those with the error.
    pub errors: usize,
    /// The number of the first flight with the error, from 1.
    pub first_error: Option<usize>,
    /// The smallest margin; `None` without a finished flight.
    pub smallest_margin: Option<f64>,
}

/// A finding.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WorstCaseFinding {
    /// Whether the error occurred. Otherwise it is the closest flight.
    pub is_error: bool,
    /// How its point was drawn.
    pub method: &'static str,
    /// The fault, or `none`.
    pub fault: String,
    /// The flight in words.
    pub flight: String,
    /// Its row in the file of all flights, from 1. A search that goes on later stores its rows in another order.
    #[serde(skip)]
    pub row: usize,
    /// The margin.
    pub margin: f64,
    /// The first action since the onset, with its actuator; empty without one.
    pub action: String,
    /// The healthy actuator that was shut down.
    pub wrong_shutdown: Option<String>,
    /// The line that replays it.
    pub line: String,
}

/// The results of an objective.
#[derive(Debug, Clone, Serialize)]
pub struct ObjectiveSummary {
    /// What was looked for.
    pub objective: SearchObjective,
    /// The flights of the search.
    pub search: MethodSummary,
    /// The random flights.
    pub random: MethodSummary,
    /// The worst flight with each fault in which the error occurred, or else the closest flight. Flights in which a
    /// healthy actuator was shut down stand first.
    pub findings: Vec<WorstCaseFinding>,
    /// The number of joint cells of the envelope, and of those with a flight.
    pub joint_cells: (f64, usize),
    /// What was the same in all flights, in words.
    pub held_fixed: Vec<String>,
    /// The cells of the envelope.
    #[serde(skip)]
    pub cells: Vec<EnvelopeCell>,
}

impl ObjectiveSummary {
    /// The results of the first `runs` flights of each method.
    ///
    /// # Errors
    /// The command of a finding cannot be read.
    pub(crate) fn new(
        study: &Study,
        space: &SearchSpace,
        log: &SearchLog,
        runs: usize,
    ) -> Result<Self, SafetyError> {
        let objective = space.objective;
        let of = |method: Method| -> Vec<&SearchRow> {
            log.of(objective, method).filter(|row| row.run <= runs).collect()
        };
        let [searched, random] = Method::ALL.map(of);
        let all = [&searched[..], &random[..]].concat();
        Ok(ObjectiveSummary {
            objective,
            search: method(&searched),
            random: method(&random),
            findings: findings((study, space), log, &all)?,
            joint_cells: envelope::joint_cells(space, &all),
            held_fixed: held_fixed(study, space),
            cells: envelope::cells(space, &searched, &random),
        })
    }

    /// Draws the smallest margin so far over the number of flights, and returns the file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn draw(
        &self,
        results: &StudyResultsFolder,
        log: &SearchLog,
    ) -> Result<PathBuf, SafetyError> {
        let name = self.objective.name();
        let mut chart = Lines::new(
            format!("Worst case: {}", name.replace('-', " ")),
            "flights",
            "smallest margin so far",
        );
        for method in Method::ALL {
            let mut smallest = f64::INFINITY;
            let margins = log.of(self.objective, method).filter(|row| is_flown(row));
            let points = margins.map(|row| {
                smallest = smallest.min(row.outcome.margin);
                (row.run as f64, smallest)
            });
            chart = chart.with(Curve::new(method.name(), points.collect()).unmarked());
        }
        let path = results.artefact(&format!("worst-case-{name}.svg"));
        write_atomically(&path, |out| out.write_all(chart.draw().svg.as_bytes()))?;
        Ok(path)
    }
}

fn method(rows: &[&SearchRow]) -> MethodSummary {
    let margins = rows.iter().filter(|row| is_flown(row)).map(|row| row.outcome.margin);
    let errors = || rows.iter().filter(|row| row.outcome.is_error);
    MethodSummary {
        runs: rows.len(),
        failed: rows.iter().filter(|row| !is_flown(row)).count(),
        errors: errors().count(),
        first_error: errors().map(|row| row.run).min(),
        smallest_margin: margins.reduce(f64::min),
    }
}

/// The worst flight with each fault, those with the error if there are any, else the closest one.
fn findings(
    (study, space): (&Study, &SearchSpace),
    log: &SearchLog,
    rows: &[&SearchRow],
) -> Result<Vec<WorstCaseFinding>, SafetyError> {
    let mut worst: Vec<&SearchRow> = rows.iter().copied().filter(|row| is_flown(row)).collect();
    worst.sort_by(|a, b| {
        let key = |row: &SearchRow| (row.outcome.wrong_shutdown.is_none(), row.outcome.rank());
        let ((a_wrong, a), (b_wrong, b)) = (key(a), key(b));
        (a_wrong, a.0).cmp(&(b_wrong, b.0)).then(a.1.total_cmp(&b.1))
    });
    let mut findings: Vec<WorstCaseFinding> = vec![];
    for row in worst {
        let fault = space.dimensions[0].in_words(row.line.point.values[0]);
        let is_finding = row.outcome.is_error || row.outcome.wrong_shutdown.is_some();
        let is_new = findings.iter().all(|known| known.fault != fault);
        if findings.len() == MAX_FINDINGS || !(findings.is_empty() || is_finding && is_new) {
            continue;
        }
        findings.push(WorstCaseFinding {
            is_error: row.outcome.is_error,
            method: row.method.name(),
            fault,
            flight: space.flight_in_words(study, row.line.seed, &row.line.point)?,
            row: 1 + log.rows.iter().position(|own| std::ptr::eq(own, row)).unwrap_or_default(),
            margin: row.outcome.margin,
            action: row.outcome.action.clone(),
            wrong_shutdown: row.outcome.wrong_shutdown.clone(),
            line: row.line.to_string(),
        });
    }
    Ok(findings)
}

/// What is the same in all flights.
fn held_fixed(study: &Study, space: &SearchSpace) -> Vec<String> {
    let has_fault = !space.dimensions[0].choices.iter().any(|fault| fault == "none");
    let mut fixed = vec![format!("duration {} s", space.ranges.duration_s)];
    if has_fault {
        fixed.push(format!("one fault, sudden, intensity {INTENSITY}"));
    }
    let inputs = study.system.network().inputs.iter().enumerate();
    let is_searched = |name: &str| space.environment().any(|(_, dimension)| dimension.name == name);
    let kept =
        inputs.filter(|(place, input)| *place != study.command_input && !is_searched(&input.id));
    let kept: Vec<String> = kept
        .map(|(_, input)| format!("{} {}", input.id, shown(input.default, input.unit)))
        .collect();
    if !kept.is_empty() {
        fixed.push(format!("inputs {}", kept.join(", ")));
    }
    fixed.push(
        "drawn and not searched: noise, the seed of random commands, draws of [flights]".into(),
    );
    fixed
}

/// Writes the cells of all objectives, and returns the file.
///
/// # Errors
/// The file cannot be written.
pub(crate) fn write_cells(
    results: &StudyResultsFolder,
    summaries: &[ObjectiveSummary],
) -> Result<PathBuf, SafetyError> {
    let cells: Vec<(&str, &EnvelopeCell)> = summaries
        .iter()
        .flat_map(|summary| summary.cells.iter().map(|cell| (summary.objective.name(), cell)))
        .collect();
    let text = |value: fn(&EnvelopeCell) -> String| {
        cells.iter().map(|(_, cell)| value(cell)).collect::<Vec<_>>()
    };
    let count = |value: fn(&EnvelopeCell) -> u64| {
        cells.iter().map(|(_, cell)| value(cell) as u32).collect::<Vec<_>>()
    };
    let objectives: Vec<String> = cells.iter().map(|(name, _)| (*name).to_owned()).collect();
    let uppers: Vec<f64> = cells.iter().map(|(_, cell)| cell.share_upper).collect();
    let table = Table::from_columns(vec![
        Column::new("objective", "", objectives),
        Column::new("dimension", "", text(|cell| cell.dimension.clone())),
        Column::new("part", "", text(|cell| cell.part.clone())),
        Column::new("searched", "", count(|cell| cell.searched)),
        Column::new("random", "", count(|cell| cell.random)),
        Column::new("random_errors", "", count(|cell| cell.random_errors)),
        Column::new("share_upper", "", uppers),
    ])?;
    let path = results.artefact("worst-case-cells.csv");
    table::write(&path, &table)?;
    Ok(path)
}
