//! The artefact *worst case*: the flights in which the diagnosis is closest to an error, each as a line that replays it.
//!
//! - `log`: every flight, in `safety/worst-case.csv`
//! - [`finding_line`]: one line of text that replays a flight
//! - `envelope`: what was not searched
//! - [`summary`]: the findings, the comparison with random flights, and the figure

pub(crate) mod envelope;
pub mod finding_line;
pub(crate) mod log;
pub mod summary;

use crate::error::SafetyError;
use crate::rates::find_columns;
use crate::results::{FOLDER, StudyResultsFolder};
use finding_line::{FindingLine, mistake};
use log::{Method, SearchBasis, SearchLog, SearchRow};
use servotwin::files::create_folder;
use servotwin::flight::worst_case::cross_entropy::{CrossEntropy, GENERATION};
use servotwin::flight::worst_case::space::{SearchPoint, SearchSpace};
use servotwin::flight::worst_case::{
    MAX_POINTS, PointFlyer, SearchError, SearchObjective, SearchOutcome,
};
use servotwin::job::flights::{Crew, diagnoser};
use servotwin::job::{Folder, JobError};
use servotwin::signal::random::NormalDeviates;
use servotwin::table::csv::texts;
use servotwin_diagnosis::diagnoser::Session;
use std::path::PathBuf;
use std::sync::Arc;
use summary::ObjectiveSummary;

/// The file of all flights.
pub(crate) const FILE: &str = "worst-case.csv";

/// The largest number of flights of each method: their points have numbers of their own.
pub const MAX_RUNS: usize = MAX_POINTS / 2;

/// The streams of random numbers of search and random flights.
const STREAMS: u64 = 0x776f_7273_7400_0000;

/// A search in an output folder.
pub struct WorstCaseSearch<'s> {
    results: &'s StudyResultsFolder,
    flyer: PointFlyer<'s>,
    /// One space for each objective that the study allows: stored flights of objectives that are not searched stay.
    spaces: Vec<SearchSpace>,
    log: SearchLog,
    progress: &'s (dyn Fn(&str, f64) + Sync),
}

impl<'s> WorstCaseSearch<'s> {
    /// A search with what the folder already has of it.
    ///
    /// # Errors
    /// Nothing flies in the scenario; there is no diagnoser; the study has no flights; the stored flights are damaged.
    pub fn new(
        results: &'s StudyResultsFolder,
        seed: u64,
        crew: &Crew<'s>,
    ) -> Result<Self, SafetyError> {
        let (study, scenario) = (&results.study, results.flown_setting()?);
        let diagnoser = Arc::new(diagnoser(&results.folder, scenario)?);
        let session =
            Session::new(diagnoser).map_err(|error| JobError::Evaluation(error.into()))?.at_rest();
        let mut spaces = vec![];
        for objective in SearchObjective::ALL {
            match SearchSpace::new(study, scenario, objective) {
                Err(SearchError::NoFault(_)) => {}
                space => spaces.push(space?),
            }
        }
        let basis = SearchBasis { evidence: results.basis.in_words(), scenario, seed };
        let log = SearchLog::read(&results.artefact(FILE), basis)?;
        let (workers, progress) = (crew.workers, crew.progress);
        let flyer = PointFlyer { study, scenario, seed, session, workers };
        Ok(WorstCaseSearch { results, flyer, spaces, log, progress })
    }

    /// Flies `runs` points of the search and as many random ones for each objective. Stored flights are not flown again.
    /// Every generation is stored. Returns the summaries and the written files.
    ///
    /// # Errors
    /// The study has no fault for an objective, a twin cannot be simulated, a file cannot be written, or the run was
    /// cancelled.
    pub fn run(
        &mut self,
        objectives: &[SearchObjective],
        runs: usize,
    ) -> Result<(Vec<ObjectiveSummary>, Vec<PathBuf>), SafetyError> {
        create_folder(self.results.folder.path().join(FOLDER))?;
        let mut summaries = vec![];
        for &objective in objectives {
            let space = self.space(objective)?.clone();
            self.search(&space, runs)?;
            self.draw(&space, runs)?;
            summaries.push(ObjectiveSummary::new(&self.results.study, &space, &self.log, runs)?);
        }
        let mut written = vec![self.results.artefact(FILE)];
        written.push(summary::write_cells(self.results, &summaries)?);
        for summary in &summaries {
            written.push(summary.draw(self.results, &self.log)?);
        }
        Ok((summaries, written))
    }

    /// The cross-entropy search.
    fn search(&mut self, space: &SearchSpace, runs: usize) -> Result<(), SafetyError> {
        let mut search = CrossEntropy::new(space, self.random(Method::Search));
        for first in (0..runs).step_by(GENERATION) {
            let points: Vec<SearchPoint> =
                (first..runs.min(first + GENERATION)).map(|number| search.draw(number)).collect();
            let flown = self.fly(space, Method::Search, (first, runs), points)?;
            search.learn(&flown);
        }
        Ok(())
    }

    /// Random flights.
    fn draw(&mut self, space: &SearchSpace, runs: usize) -> Result<(), SafetyError> {
        let mut random = self.random(Method::Random);
        for first in (0..runs).step_by(GENERATION) {
            let numbers = first..runs.min(first + GENERATION);
            let points = numbers.map(|number| space.draw(MAX_RUNS + number, &mut random)).collect();
            self.fly(space, Method::Random, (first, runs), points)?;
        }
        Ok(())
    }

    fn random(&self, method: Method) -> NormalDeviates {
        NormalDeviates::stream(self.flyer.seed, STREAMS + method as u64)
    }

    /// Flies those of a generation's points that are not stored, and stores all. `first` points came before.
    fn fly(
        &mut self,
        space: &SearchSpace,
        method: Method,
        (first, runs): (usize, usize),
        points: Vec<SearchPoint>,
    ) -> Result<Vec<(SearchPoint, SearchOutcome)>, SafetyError> {
        let objective = space.objective;
        let what = format!("{}: {}", objective.name(), method.name());
        (self.progress)(&what, first as f64 / runs as f64);
        let stored: Vec<Option<SearchOutcome>> = points
            .iter()
            .enumerate()
            .map(|(place, point)| self.log.outcome((objective, method, first + place + 1), point))
            .collect();
        let missing = points.iter().zip(&stored).filter(|(_, stored)| stored.is_none());
        let missing: Vec<SearchPoint> = missing.map(|(point, _)| point.clone()).collect();
        if missing.is_empty() {
            let stored = stored.into_iter().flatten();
            return Ok(points.into_iter().zip(stored).collect());
        }
        let mut new = self.flyer.fly(space, &missing)?.into_iter();
        let mut flown = vec![];
        for (place, (point, stored)) in points.into_iter().zip(stored).enumerate() {
            let Some(outcome) = stored.or_else(|| new.next()) else { break };
            let line = self.line(objective, &point, outcome.margin);
            let row = SearchRow { method, run: first + place + 1, line, outcome: outcome.clone() };
            self.log.push(row);
            flown.push((point, outcome));
        }
        self.store()?;
        Ok(flown)
    }

    fn line(&self, objective: SearchObjective, point: &SearchPoint, margin: f64) -> FindingLine {
        let PointFlyer { scenario, seed, .. } = self.flyer;
        FindingLine { objective, scenario, seed, point: point.clone(), margin }
    }

    fn space(&self, objective: SearchObjective) -> Result<&SearchSpace, SearchError> {
        let own = self.spaces.iter().find(|space| space.objective == objective);
        own.ok_or(SearchError::NoFault(objective.name()))
    }

    fn store(&self) -> Result<(), SafetyError> {
        self.log.write(&self.results.artefact(FILE), |objective| self.space(objective))
    }
}

/// The line of a row of `FILE`, counted from 1.
///
/// # Errors
/// There is no such file, row, or line in it.
pub fn stored_line(folder: &Folder, row: usize) -> Result<FindingLine, SafetyError> {
    let path = folder.path().join(FOLDER).join(FILE);
    let table = texts::read(&path)?;
    let [line] = find_columns(&path, &table, ["line"])?;
    let found = row.checked_sub(1).and_then(|place| table.rows.get(place));
    let found = found.ok_or_else(|| {
        mistake(format!("row {row} is none of 1 to {} of {}", table.rows.len(), path.display()))
    })?;
    found.cells[line].parse()
}

/// Flies the flight of a line once more. The folder must have been opened with the scenario of the line.
///
/// # Errors
/// The line is not of this study's space; the margin is not that of the line to the bit; the flight cannot be flown.
pub fn replay(
    results: &StudyResultsFolder,
    line: &FindingLine,
    crew: &Crew,
) -> Result<SearchOutcome, SafetyError> {
    let search = WorstCaseSearch::new(results, line.seed, crew)?;
    let space = search.space(line.objective)?;
    if !space.contains(&line.point) {
        let count = space.dimensions.len();
        return Err(mistake(format!(
            "its point is not one of this study, whose points have {count} numbers"
        )));
    }
    let outcomes = search.flyer.fly(space, std::slice::from_ref(&line.point))?;
    let outcome = outcomes.into_iter().next().ok_or_else(|| mistake("it has no point".into()))?;
    match outcome.margin.to_bits() == line.margin.to_bits() {
        true => Ok(outcome),
        false => Err(SafetyError::NotReproduced { flown: outcome.margin, stated: line.margin }),
    }
}
