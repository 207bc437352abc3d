//! The artefact *worst case*: the flights in which the diagnosis is closest to an error, beside random flights, and
//! what was not searched. It is read from the outcomes of a [search](servotwin::job::worst_case).

use crate::error::SafetyError;
use crate::results::StudyResultsFolder;
use serde::Serialize;
use servotwin::flight::margin::SearchObjective;
use servotwin::flight::worst_case::INTENSITY;
use servotwin::flight::worst_case::space::SearchSpace;
use servotwin::job::JobError;
use servotwin::job::{Crew, Job};
use servotwin::measure::outcome::RunOutcome;
use servotwin::run::RunName;
use servotwin::shown::shown;
use servotwin::study::Study;
use servotwin::view::lines::{Curve, Lines};
use servotwin_learning::metrics::clopper_pearson_upper;
use std::collections::BTreeSet;
use std::path::PathBuf;

pub use servotwin::job::worst_case::MAX_RUNS;

/// The most findings of an objective that are listed; the table of outcomes has all flights.
const MAX_FINDINGS: usize = 5;

/// The confidence of the bound on the share of errors.
const CONFIDENCE: f64 = 0.95;

/// The flights of the search, or the random ones.
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

impl MethodSummary {
    fn new(objective: SearchObjective, rows: &[RunOutcome]) -> Self {
        let is_error = |row: &RunOutcome| objective.is_error(row);
        MethodSummary {
            runs: rows.len(),
            failed: rows.iter().filter(|row| !row.is_finished).count(),
            errors: rows.iter().filter(|row| is_error(row)).count(),
            first_error: rows.iter().position(is_error).map(|place| place + 1),
            smallest_margin: rows.iter().filter_map(|row| row.margin).reduce(f64::min),
        }
    }
}

/// A finding.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WorstCaseFinding {
    /// The name of the run, which flies it again.
    pub run: String,
    /// Whether the error occurred. Otherwise it is the closest flight.
    pub is_error: bool,
    /// Whether a healthy actuator was shut down, whatever was searched.
    pub shuts_down_healthy: bool,
    /// The flight in words.
    pub flight: String,
    /// The margin.
    pub margin: f64,
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
    /// The upper end of the one-sided 95 % interval of the share of errors, from the random flights alone.
    pub share_upper: f64,
    /// The worst flight with each fault in which the error occurred, or else the closest flight. Flights in which a
    /// healthy actuator was shut down stand first.
    pub findings: Vec<WorstCaseFinding>,
    /// The number of joint cells of the environment, and of those with a flight.
    pub joint_cells: (f64, usize),
    /// What was the same in all flights, in words.
    pub held_fixed: Vec<String>,
    /// A figure of the smallest margin so far over the number of flights.
    pub figure: PathBuf,
}

/// Searches for some objectives with the diagnoser of the folder, with `runs` flights of the search and as many random
/// ones for each.
///
/// # Errors
/// Nothing flies in the scenario; there is no diagnoser; the study has no fault for an objective; a twin cannot be
/// simulated; a file cannot be written; or the run was cancelled.
pub fn search(
    results: &StudyResultsFolder,
    objectives: &[SearchObjective],
    (seed, runs): (u64, usize),
    crew: &Crew,
) -> Result<Vec<ObjectiveSummary>, SafetyError> {
    let (study, scenario) = (&results.study, results.flown_setting()?);
    let one = |&objective: &SearchObjective| {
        let space = SearchSpace::new(study, scenario, objective);
        let space = space.ok_or(SafetyError::NothingToSearch { objective: objective.name() })?;
        let job = Job { crew: *crew, ..Job::new(study, &results.folder) };
        let flown = job.search((scenario, &space), (seed, runs))?;
        summary(results, (&space, seed), &flown)
    };
    objectives.iter().map(one).collect()
}

fn summary(
    results: &StudyResultsFolder,
    (space, seed): (&SearchSpace, u64),
    flown: &[Vec<RunOutcome>; 2],
) -> Result<ObjectiveSummary, SafetyError> {
    let [search, random] = flown.each_ref().map(|rows| MethodSummary::new(space.objective, rows));
    let finished = (random.runs - random.failed) as u64;
    Ok(ObjectiveSummary {
        objective: space.objective,
        share_upper: clopper_pearson_upper(random.errors as u64, finished, CONFIDENCE),
        search,
        random,
        findings: findings(results, (space, seed), flown)?,
        joint_cells: joint_cells(space, flown),
        held_fixed: held_fixed(&results.study, space),
        figure: draw(results, space, flown)?,
    })
}

/// The worst flight with each fault, those with the error if there are any, else the closest one.
fn findings(
    results: &StudyResultsFolder,
    (space, seed): (&SearchSpace, u64),
    flown: &[Vec<RunOutcome>; 2],
) -> Result<Vec<WorstCaseFinding>, SafetyError> {
    let mut worst: Vec<&RunOutcome> =
        flown.iter().flatten().filter(|row| row.is_finished).collect();
    worst.sort_by(|a, b| {
        let key = |row: &RunOutcome| (!row.shuts_down_healthy(), space.objective.rank(row));
        let ((a_healthy, a), (b_healthy, b)) = (key(a), key(b));
        (a_healthy, a.0).cmp(&(b_healthy, b.0)).then(a.1.total_cmp(&b.1))
    });
    let (mut findings, mut faults) = (vec![], BTreeSet::new());
    for row in worst {
        let (is_error, shuts_down_healthy) =
            (space.objective.is_error(row), row.shuts_down_healthy());
        let is_finding = (is_error || shuts_down_healthy) && !faults.contains(&row.event);
        let Some(point) = space.point_of(&row.point) else { continue };
        if findings.len() == MAX_FINDINGS || !(findings.is_empty() || is_finding) {
            continue;
        }
        faults.insert(&row.event);
        let (suite, number) = (space.suite(), row.number as usize);
        findings.push(WorstCaseFinding {
            run: RunName { suite, number, scenario: results.scenario }.to_string(),
            is_error,
            shuts_down_healthy,
            flight: space.flight_in_words(&results.study, seed, &point).map_err(JobError::from)?,
            margin: row.margin.unwrap_or(f64::NAN),
        });
    }
    Ok(findings)
}

/// How many joint cells there are, and how many of them have a flight: the command, and the lower or upper half of each
/// range of the environment.
fn joint_cells(space: &SearchSpace, flown: &[Vec<RunOutcome>; 2]) -> (f64, usize) {
    let command = space.dimensions.iter().position(|dimension| dimension.name == "command");
    let ranges: Vec<usize> = space.environment().map(|(place, _)| place).collect();
    let commands = command.map_or(1, |place| space.dimensions[place].choices.len());
    let cell = |row: &RunOutcome| -> Option<Vec<usize>> {
        let values = space.point_of(&row.point)?.values;
        let halves = ranges.iter().map(|&place| usize::from(values[place] >= 0.5));
        Some(command.map(|place| values[place] as usize).into_iter().chain(halves).collect())
    };
    let finished = flown.iter().flatten().filter(|row| row.is_finished);
    let visited: BTreeSet<Vec<usize>> = finished.filter_map(cell).collect();
    (commands as f64 * 2_f64.powi(ranges.len() as i32), visited.len())
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

/// Draws the smallest margin so far over the number of flights.
fn draw(
    results: &StudyResultsFolder,
    space: &SearchSpace,
    flown: &[Vec<RunOutcome>; 2],
) -> Result<PathBuf, SafetyError> {
    let name = space.objective.name();
    let title = format!("Worst case: {}", name.replace('_', " "));
    let mut chart = Lines::new(title, "flights", "smallest margin so far");
    for (method, rows) in ["search", "random"].into_iter().zip(flown) {
        let mut smallest = f64::INFINITY;
        let margins = (1..).zip(rows).filter_map(|(run, row)| Some((run, row.margin?)));
        let points = margins.map(|(run, margin)| {
            smallest = smallest.min(margin);
            (f64::from(run), smallest)
        });
        chart = chart.with(Curve::new(method, points.collect()).unmarked());
    }
    results.write(&format!("worst-case-{name}.svg"), &chart.draw().svg)
}
