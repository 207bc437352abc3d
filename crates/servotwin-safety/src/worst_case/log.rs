//! All flights of a search, stored in `safety/worst-case.csv`.
//!
//! A search is deterministic, so an interrupted one is drawn again from its beginning, and stored flights stand in for
//! new ones where their points agree.

use super::finding_line::FindingLine;
use crate::error::SafetyError;
use servotwin::flight::worst_case::space::{SearchPoint, SearchSpace};
use servotwin::flight::worst_case::{SearchError, SearchObjective, SearchOutcome};
use servotwin::study::Scenario;
use servotwin::table::csv::texts;
use servotwin::table::{self, Column, Table};
use std::path::Path;

/// How a point was drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Method {
    /// By the cross-entropy search.
    Search,
    /// From the distributions of the study, unbiased.
    Random,
}

impl Method {
    /// Both, in the order of flying.
    pub(crate) const ALL: [Method; 2] = [Method::Search, Method::Random];

    /// The name in files.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Method::Search => "search",
            Method::Random => "random",
        }
    }
}

/// A flight of a search.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SearchRow {
    /// How its point was drawn.
    pub method: Method,
    /// Its number in objective and method, from 1.
    pub run: usize,
    /// The line that replays it.
    pub line: FindingLine,
    /// What it gave.
    pub outcome: SearchOutcome,
}

/// What all flights of a file have in common.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SearchBasis {
    /// System, study and models as hashes.
    pub evidence: String,
    /// The scenario.
    pub scenario: Scenario,
    /// The seed.
    pub seed: u64,
}

/// The flights of a file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SearchLog {
    /// What they have in common.
    pub basis: SearchBasis,
    /// The flights in the order of flying.
    pub rows: Vec<SearchRow>,
}

impl SearchLog {
    /// The stored flights of the same basis; none without a file, or if its flights have another basis.
    ///
    /// # Errors
    /// The file is damaged.
    pub(crate) fn read(path: &Path, basis: SearchBasis) -> Result<Self, SafetyError> {
        let mut rows = vec![];
        if path.exists() {
            let table = texts::read(path)?;
            let column = |name: &'static str| {
                table.column(name).ok_or_else(|| SafetyError::NoColumn {
                    path: path.into(),
                    column: name.into(),
                    needed: COLUMNS.map(str::to_owned).to_vec(),
                })
            };
            let mut places = [0; COLUMNS.len()];
            for (place, name) in places.iter_mut().zip(COLUMNS) {
                *place = column(name)?;
            }
            for row in &table.rows {
                let cells = places.map(|place| row.cells[place].as_str());
                let (evidence, row) = parse(cells).map_err(|problem| SafetyError::Cell {
                    path: path.into(),
                    line: row.line,
                    column: "line",
                    problem,
                })?;
                let FindingLine { scenario, seed, .. } = row.line;
                if (SearchBasis { evidence, scenario, seed }) == basis {
                    rows.push(row);
                }
            }
        }
        Ok(SearchLog { basis, rows })
    }

    /// The stored outcome of a point.
    pub(crate) fn outcome(
        &self,
        (objective, method, run): (SearchObjective, Method, usize),
        point: &SearchPoint,
    ) -> Option<SearchOutcome> {
        let is_same = |row: &&SearchRow| {
            row.line.objective == objective && row.method == method && row.run == run
        };
        let row = self.rows.iter().find(is_same)?;
        (row.line.point == *point).then(|| row.outcome.clone())
    }

    /// Takes a flight; one with the same number is replaced.
    pub(crate) fn push(&mut self, row: SearchRow) {
        let key = |row: &SearchRow| (row.line.objective, row.method, row.run);
        match self.rows.iter_mut().find(|known| key(known) == key(&row)) {
            Some(known) => *known = row,
            None => self.rows.push(row),
        }
    }

    /// The flights of an objective and a method.
    pub(crate) fn of(
        &self,
        objective: SearchObjective,
        method: Method,
    ) -> impl Iterator<Item = &SearchRow> {
        self.rows.iter().filter(move |row| row.line.objective == objective && row.method == method)
    }

    /// Writes all flights. `space` gives the space of an objective.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn write<'p>(
        &self,
        path: &Path,
        space: impl Fn(SearchObjective) -> Result<&'p SearchSpace, SearchError>,
    ) -> Result<(), SafetyError> {
        let text =
            |value: fn(&SearchRow) -> String| self.rows.iter().map(value).collect::<Vec<_>>();
        let number = |value: fn(&SearchRow) -> f64| self.rows.iter().map(value).collect::<Vec<_>>();
        let flag = |value: fn(&SearchRow) -> bool| self.rows.iter().map(value).collect::<Vec<_>>();
        let mut columns = vec![
            Column::new("objective", "", text(|row| row.line.objective.name().into())),
            Column::new("method", "", text(|row| row.method.name().into())),
            Column::new("run", "", self.rows.iter().map(|row| row.run as u32).collect::<Vec<_>>()),
            Column::new("margin", "", number(|row| row.outcome.margin)),
            Column::new("is_error", "", flag(|row| row.outcome.is_error)),
            Column::new("is_visible", "", flag(|row| row.outcome.is_visible)),
            Column::new("action", "", text(|row| row.outcome.action.clone())),
            Column::new("action_s", "s", number(|row| row.outcome.action_s)),
            Column::new("has_wrong_shutdown", "", flag(|row| row.outcome.wrong_shutdown.is_some())),
            Column::new(
                "wrong_shutdown",
                "",
                text(|row| row.outcome.wrong_shutdown.clone().unwrap_or_default()),
            ),
        ];
        let spaces: Vec<&SearchSpace> =
            self.rows.iter().map(|row| space(row.line.objective)).collect::<Result<_, _>>()?;
        // Spaces of different objectives differ in their faults only.
        let dimensions = spaces.first().map_or(&[][..], |space| &space.dimensions);
        for (place, dimension) in dimensions.iter().enumerate() {
            let rows = spaces.iter().zip(&self.rows);
            let words: Vec<String> = rows
                .map(|(space, row)| space.dimensions[place].in_words(row.line.point.values[place]))
                .collect();
            columns.push(Column::new(dimension.name.clone(), "", words));
        }
        columns.push(Column::new("line", "", text(|row| row.line.to_string())));
        let basis = vec![self.basis.evidence.clone(); self.rows.len()];
        columns.push(Column::new("basis", "", basis));
        Ok(table::write(path, &Table::from_columns(columns)?)?)
    }
}

/// The columns that are read again.
const COLUMNS: [&str; 10] = [
    "method",
    "run",
    "is_error",
    "is_visible",
    "action",
    "action_s",
    "has_wrong_shutdown",
    "wrong_shutdown",
    "line",
    "basis",
];

/// A row, and the evidence of its basis.
fn parse(cells: [&str; COLUMNS.len()]) -> Result<(String, SearchRow), String> {
    let [method, run, is_error, is_visible, action, action_s, has_wrong, wrong, line, basis] =
        cells;
    let wrong_cell = |cell: &str| format!("'{cell}' does not belong into the row");
    let flag = |cell: &str| cell.parse::<bool>().map_err(|_| wrong_cell(cell));
    let known = Method::ALL.into_iter().find(|known| known.name() == method);
    let line: FindingLine = line.parse().map_err(|error: SafetyError| error.to_string())?;
    let outcome = SearchOutcome {
        margin: line.margin,
        is_error: flag(is_error)?,
        is_visible: flag(is_visible)?,
        action: action.into(),
        action_s: action_s.parse().map_err(|_| wrong_cell(action_s))?,
        wrong_shutdown: flag(has_wrong)?.then(|| wrong.to_owned()),
    };
    let row = SearchRow {
        method: known.ok_or_else(|| wrong_cell(method))?,
        run: run.parse().map_err(|_| wrong_cell(run))?,
        line,
        outcome,
    };
    Ok((basis.to_owned(), row))
}
